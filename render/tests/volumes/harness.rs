//! Just enough of a renderer: depth of the surfaces, the volumes, and the stencil read back.

use crate::shapes::Thing;
use glam::{Mat4, Vec4};
use umbriel_render::volumes::{
    Depth, Receiver, Seen, Sight, Surface, TurnedBox, VolumeCaster, VolumeDraws, VolumeJob, VolumeLight, VolumePass, VolumeStats,
    faces,
};
use umbriel_scene::{Aabb, View, VolumeSettings};
use wgpu::util::DeviceExt;

pub(crate) const VIEW: &str = include_str!("../../src/shaders/view.wgsl");
pub(crate) const POSITION: &str = include_str!("../../src/shaders/position.wgsl");

const SURFACE: &str = "
@group(1) @binding(0) var<uniform> world_from_object: mat4x4<f32>;
@vertex
fn surface(@location(0) p: vec3<f32>) -> @builtin(position) @invariant vec4<f32> {
    return clip_from_point(view.clip_from_world, world_from_vertex(world_from_object, p));
}
";
const COPY: &str = "
@group(0) @binding(0) var stencil: TEXTURE<u32>;
@group(0) @binding(1) var<storage, read_write> copied: array<u32>;
@group(0) @binding(2) var depth: DEPTH;
@compute @workgroup_size(8, 8)
fn copy(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(stencil);
    if any(id.xy >= size) { return; }
    for (var s = 0; s < SAMPLES; s++) {
        // Where nothing is seen there is nothing to be in shadow.
        let seen = textureLoad(depth, id.xy, s) != NOTHING;
        copied[(id.y * size.x + id.x) * u32(SAMPLES) + u32(s)] = select(0u, textureLoad(stencil, id.xy, s).x, seen);
    }
}
";
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32FloatStencil8;
const COLOUR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

pub(crate) struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) pass: VolumePass,
    samples: u32,
    depth: Depth,
    view_layout: wgpu::BindGroupLayout,
    object_layout: wgpu::BindGroupLayout,
    surface: wgpu::RenderPipeline,
    copy: wgpu::ComputePipeline,
}

/// Places of the samples in a pixel, as Vulkan fixes them.
pub(crate) fn sample_places(samples: u32) -> &'static [(f64, f64)] {
    match samples {
        1 => &[(0.5, 0.5)],
        _ => &[(0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)],
    }
}

/// A thing with its positions on the GPU, as a renderer's cache keeps it.
#[derive(Clone)]
pub(crate) struct Loaded {
    pub(crate) thing: Thing,
    pub(crate) positions: wgpu::Buffer,
    pub(crate) revision: u64,
}

impl Loaded {
    pub(crate) fn caster(&self) -> VolumeCaster {
        VolumeCaster {
            mesh: self.thing.at_rest.clone(),
            positions: self.positions.clone(),
            positions_revision: self.revision,
            world_from_object: self.thing.world_from_object,
            bounds: if self.thing.bounds_known {
                let bounds = Aabb::from_points(self.thing.mesh.positions.iter().copied());
                TurnedBox::of(&bounds, &self.thing.world_from_object)
            } else {
                TurnedBox::straight(Aabb::EMPTY)
            },
            surface: Surface::BothSides,
        }
    }
}

impl Gpu {
    pub(crate) fn new(samples: u32) -> Gpu {
        Gpu::with_depth(samples, Depth::Reversed)
    }

    pub(crate) fn with_depth(samples: u32, depth: Depth) -> Gpu {
        let instance = wgpu::Instance::default();
        let adapter = pollster::block_on(instance.request_adapter(&Default::default())).expect("a graphics adapter");
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            required_features: wgpu::Features::DEPTH32FLOAT_STENCIL8
                | if depth == Depth::Clamped { wgpu::Features::DEPTH_CLIP_CONTROL } else { wgpu::Features::empty() },
            required_limits: adapter.limits(),
            ..Default::default()
        }))
        .expect("a device with Depth32FloatStencil8");
        let uniform = |label| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries: &[wgpu::BindGroupLayoutEntry {
                    binding: 0,
                    visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
                    ty: wgpu::BindingType::Buffer {
                        ty: wgpu::BufferBindingType::Uniform,
                        has_dynamic_offset: false,
                        min_binding_size: None,
                    },
                    count: None,
                }],
            })
        };
        let (view_layout, object_layout) = (uniform("view"), uniform("object"));
        // The 4-sample pass has a colour attachment, the other has none.
        let colour = (samples > 1).then_some(COLOUR);
        let pass = VolumePass::new(&device, depth, FORMAT, samples, colour, &view_layout);
        let surface = surface_pipeline(&device, (samples, depth), &view_layout, &object_layout);
        let copy = copy_pipeline(&device, samples, depth);
        Gpu { device, queue, pass, samples, depth, view_layout, object_layout, surface, copy }
    }

    pub(crate) fn load(&self, thing: &Thing) -> Loaded {
        let positions = self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("positions"),
            contents: bytemuck::cast_slice(&thing.mesh.positions),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
        });
        Loaded { thing: thing.clone(), positions, revision: 0 }
    }

    fn uniform(&self, layout: &wgpu::BindGroupLayout, contents: &[u8]) -> wgpu::BindGroup {
        let buffer = self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents,
            usage: wgpu::BufferUsages::UNIFORM,
        });
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
        })
    }

    fn texture(&self, view: &View, format: wgpu::TextureFormat) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: view.size[0], height: view.size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: self.samples,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        })
    }

    /// The stencil of each sample of each pixel, rows from the top; 0 where nothing is seen.
    pub(crate) fn stencil(
        &mut self,
        casters: &[Loaded],
        receivers: &[Loaded],
        light: VolumeLight,
        view: &View,
    ) -> (Vec<u32>, VolumeStats, VolumeDraws) {
        let mut view_data = [0f32; 132];
        let clip_from_view = match self.depth {
            Depth::Reversed => view.frustum.clip_from_view(),
            Depth::Conventional => view.frustum.clip_from_view_conventional((-12f32).exp2()),
            Depth::Clamped => view.frustum.clip_from_view_conventional(0.0),
        };
        let clip_from_world: Mat4 = clip_from_view * view.view_from_world;
        view_data[..16].copy_from_slice(&clip_from_world.to_cols_array());
        let view_group = self.uniform(&self.view_layout, bytemuck::cast_slice(&view_data));
        let target = self.texture(view, FORMAT);
        let target_view = target.create_view(&Default::default());
        let colour = self.texture(view, COLOUR).create_view(&Default::default());
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let all = casters.iter().chain(receivers).map(|l| l.caster().bounds.in_world);
        let receives = if all.clone().any(|b| b.is_empty()) { Aabb::EMPTY } else { all.fold(Aabb::EMPTY, Aabb::union) };
        let job = VolumeJob { light, casters: casters.iter().map(Loaded::caster).collect(), receivers: receives };
        let mut sight = Sight::new(view, receives);
        if !receives.is_empty() {
            // Surfaces are drawn from both sides. Every fourth is known by its box.
            let mut seen = Seen::default();
            for (i, l) in casters.iter().chain(receivers).enumerate() {
                let faces = faces(&l.thing.mesh, &l.thing.world_from_object);
                seen.hiding.extend_from_slice(&faces);
                seen.receivers.push(Receiver { bounds: l.caster().bounds, faces: (i % 4 != 3).then_some(faces) });
            }
            sight = sight.with(seen);
        }
        let stats = self.pass.prepare(&self.device, &mut encoder, &[job]);
        self.surfaces(&mut encoder, casters.iter().chain(receivers), &view_group, &target_view);
        let draws = {
            let colours = [(self.samples > 1).then_some(wgpu::RenderPassColorAttachment {
                view: &colour,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
            })];
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("volumes"),
                color_attachments: if self.samples > 1 { &colours } else { &[] },
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &target_view,
                    depth_ops: None,
                    stencil_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0), store: wgpu::StoreOp::Store }),
                }),
                ..Default::default()
            });
            self.pass.draw(&mut pass, 0, &view_group, &sight)
        };
        (self.read_back(encoder, &target, view), stats, draws)
    }

    fn surfaces<'a>(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        things: impl Iterator<Item = &'a Loaded>,
        view_group: &wgpu::BindGroup,
        target: &wgpu::TextureView,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("surfaces"),
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: target,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(nothing_seen(self.depth)),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.surface);
        pass.set_bind_group(0, view_group, &[]);
        for loaded in things {
            let matrix = self.uniform(&self.object_layout, bytemuck::bytes_of(&loaded.thing.world_from_object));
            let indices = self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: None,
                contents: bytemuck::cast_slice(&loaded.thing.mesh.indices),
                usage: wgpu::BufferUsages::INDEX,
            });
            pass.set_bind_group(1, &matrix, &[]);
            pass.set_vertex_buffer(0, loaded.positions.slice(..));
            pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..loaded.thing.mesh.indices.len() as u32, 0, 0..1);
        }
    }

    fn read_back(&self, mut encoder: wgpu::CommandEncoder, target: &wgpu::Texture, view: &View) -> Vec<u32> {
        let size = 4 * u64::from(view.size[0] * view.size[1] * self.samples);
        let buffer =
            |usage| self.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false });
        let copied = buffer(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let mapped = buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
        let aspect = |aspect| target.create_view(&wgpu::TextureViewDescriptor { aspect, ..Default::default() });
        let (stencil, depth) = (aspect(wgpu::TextureAspect::StencilOnly), aspect(wgpu::TextureAspect::DepthOnly));
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.copy.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&stencil) },
                wgpu::BindGroupEntry { binding: 1, resource: copied.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 2, resource: wgpu::BindingResource::TextureView(&depth) },
            ],
        });
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.copy);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(view.size[0].div_ceil(8), view.size[1].div_ceil(8), 1);
        }
        encoder.copy_buffer_to_buffer(&copied, 0, &mapped, 0, size);
        self.queue.submit([encoder.finish()]);
        mapped.map_async(wgpu::MapMode::Read, .., |r| r.expect("mapping"));
        self.device.poll(wgpu::PollType::wait_indefinitely()).expect("the GPU finishes");
        let range = mapped.get_mapped_range(..).expect("mapped");
        bytemuck::cast_slice(&range).to_vec()
    }
}

fn surface_pipeline(
    device: &wgpu::Device,
    (samples, depth): (u32, Depth),
    view_layout: &wgpu::BindGroupLayout,
    object_layout: &wgpu::BindGroupLayout,
) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl([VIEW, POSITION, SURFACE].concat().into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(view_layout), Some(object_layout)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("surface"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: 12,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &wgpu::vertex_attr_array![0 => Float32x3],
            })],
        },
        primitive: Default::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: FORMAT,
            depth_write_enabled: Some(true),
            depth_compare: Some(if depth == Depth::Reversed {
                wgpu::CompareFunction::Greater
            } else {
                wgpu::CompareFunction::Less
            }),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: wgpu::MultisampleState { count: samples, ..Default::default() },
        fragment: None,
        multiview_mask: None,
        cache: None,
    })
}

/// Depth where there is no surface.
fn nothing_seen(depth: Depth) -> f32 {
    if depth == Depth::Reversed { 0.0 } else { 1.0 }
}

fn copy_pipeline(device: &wgpu::Device, samples: u32, runs: Depth) -> wgpu::ComputePipeline {
    let texture = if samples == 1 { "texture_2d" } else { "texture_multisampled_2d" };
    let depth = if samples == 1 { "texture_depth_2d" } else { "texture_depth_multisampled_2d" };
    let index = if samples == 1 { "0" } else { "s" };
    let source = COPY
        .replace("TEXTURE", texture)
        .replace("NOTHING", &format!("{:?}", nothing_seen(runs)))
        .replace("DEPTH", depth)
        .replace("SAMPLES", &samples.to_string())
        .replace("id.xy, s)", &format!("id.xy, {index})"));
    let module = device
        .create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source: wgpu::ShaderSource::Wgsl(source.into()) });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("copy"),
        layout: None,
        module: &module,
        entry_point: None,
        compilation_options: Default::default(),
        cache: None,
    })
}

/// A light in the direction `v` (w = 0) or at the place `v` (w = 1).
pub(crate) fn light(v: Vec4) -> VolumeLight {
    let toward_light = if v.w == 0.0 { v.normalize() } else { v };
    VolumeLight { toward_light, range: f32::INFINITY, cone: None, settings: VolumeSettings::default() }
}
