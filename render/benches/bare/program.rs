//! The bare program: the same shaders and states, everything made beforehand, a frame is nothing but its commands.

use glam::{Mat3, Mat4};
use std::collections::HashMap;
use std::sync::Arc;
use umbriel_render::Gpu;
use umbriel_scene::{Light, Material, Mesh, Scene, Shading, View};
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{BufferUsages, LoadOp, Operations, ShaderStages, StoreOp, TextureFormat, TextureUsages};

const SURFACE: &[&str] = &[
    include_str!("../../src/shaders/position.wgsl"),
    include_str!("../../src/shaders/view.wgsl"),
    include_str!("../../src/shaders/instance.wgsl"),
    include_str!("../../src/shaders/material.wgsl"),
    include_str!("../../src/shaders/light.wgsl"),
    include_str!("../../src/shaders/brdf.wgsl"),
    include_str!("../../src/shaders/shadow_map.wgsl"),
    include_str!("../../src/surface.wgsl"),
];
const BACKGROUND: &[&str] = &[
    include_str!("../../src/shaders/view.wgsl"),
    include_str!("../../src/shaders/light.wgsl"),
    include_str!("../../src/shaders/fullscreen.wgsl"),
    include_str!("../../src/background.wgsl"),
];
const COMPOSE: &[&str] = &[
    include_str!("../../src/shaders/view.wgsl"),
    include_str!("../../src/shaders/fullscreen.wgsl"),
    include_str!("../../src/compose.wgsl"),
];

const LINEAR: TextureFormat = TextureFormat::Rgba16Float;
const DEPTH: TextureFormat = TextureFormat::Depth32FloatStencil8;

struct Batch {
    buffers: [wgpu::Buffer; 3],
    indices: wgpu::Buffer,
    index_count: u32,
    material: wgpu::BindGroup,
    instances: std::ops::Range<u32>,
}

pub(crate) struct Program {
    surface: wgpu::RenderPipeline,
    background: wgpu::RenderPipeline,
    compose: wgpu::RenderPipeline,
    view: wgpu::BindGroup,
    instances: wgpu::BindGroup,
    lighting: wgpu::BindGroup,
    picture: wgpu::BindGroup,
    visible: wgpu::Buffer,
    batches: Vec<Batch>,
    samples: wgpu::TextureView,
    resolved: wgpu::TextureView,
    depth: wgpu::TextureView,
    target: wgpu::Texture,
    target_view: wgpu::TextureView,
}

impl Program {
    pub(crate) fn new(gpu: &Gpu, scene: &Scene, view: &View) -> Program {
        let device = &gpu.device;
        let layouts = Layouts::new(device);
        let texture = |format, samples, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: extent(view.size),
                mip_level_count: 1,
                sample_count: samples,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let whole = |t: &wgpu::Texture| t.create_view(&Default::default());
        let resolved = whole(&texture(LINEAR, 1, TextureUsages::TEXTURE_BINDING));
        let target = texture(TextureFormat::Rgba8UnormSrgb, 1, TextureUsages::COPY_SRC);
        let (instances, visible, batches) = batches(gpu, &layouts, scene);
        let view_buffer = init(device, &view_bytes(view), BufferUsages::UNIFORM);
        let lighting = lighting(device, &layouts.lighting, scene);
        Program {
            surface: surface_pipeline(device, &layouts),
            background: screen_pipeline(
                device,
                BACKGROUND,
                "background",
                &[Some(&layouts.view), None, None, Some(&layouts.lighting)],
                true,
            ),
            compose: screen_pipeline(device, COMPOSE, "exposed", &[Some(&layouts.view), Some(&layouts.picture)], false),
            view: group(device, &layouts.view, &[view_buffer.as_entire_binding()]),
            instances: group(device, &layouts.instances, &[instances.as_entire_binding()]),
            lighting,
            picture: group(device, &layouts.picture, &[wgpu::BindingResource::TextureView(&resolved)]),
            visible,
            batches,
            samples: whole(&texture(LINEAR, 4, TextureUsages::empty())),
            depth: whole(&texture(DEPTH, 4, TextureUsages::empty())),
            target_view: whole(&target),
            resolved,
            target,
        }
    }

    pub(crate) fn frame(&self, gpu: &Gpu) {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &self.samples,
                depth_slice: None,
                resolve_target: Some(&self.resolved),
                ops: Operations { load: LoadOp::Clear(wgpu::Color::BLACK), store: StoreOp::Discard },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(Operations { load: LoadOp::Clear(0.0), store: StoreOp::Discard }),
                stencil_ops: Some(Operations { load: LoadOp::Clear(0), store: StoreOp::Discard }),
            }),
            ..Default::default()
        });
        pass.set_bind_group(0, &self.view, &[]);
        pass.set_bind_group(1, &self.instances, &[]);
        pass.set_bind_group(3, &self.lighting, &[]);
        pass.set_pipeline(&self.surface);
        pass.set_vertex_buffer(3, self.visible.slice(..));
        for batch in &self.batches {
            for (slot, buffer) in (0..).zip(&batch.buffers) {
                pass.set_vertex_buffer(slot, buffer.slice(..));
            }
            pass.set_index_buffer(batch.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.set_bind_group(2, &batch.material, &[]);
            pass.draw_indexed(0..batch.index_count, 0, batch.instances.clone());
        }
        pass.set_pipeline(&self.background);
        pass.draw(0..3, 0..1);
        drop(pass);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &self.target_view,
                depth_slice: None,
                resolve_target: None,
                ops: Operations { load: LoadOp::Clear(wgpu::Color::BLACK), store: StoreOp::Store },
            })],
            ..Default::default()
        });
        pass.set_pipeline(&self.compose);
        pass.set_bind_group(0, &self.view, &[]);
        pass.set_bind_group(1, &self.picture, &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
    }

    /// The target's bytes; its width must make rows of a multiple of 256 bytes.
    pub(crate) fn pixels(&self, gpu: &Gpu) -> Vec<u8> {
        let size = self.target.size();
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(size.width * size.height * 4),
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(size.width * 4), rows_per_image: None };
        encoder.copy_texture_to_buffer(self.target.as_image_copy(), wgpu::TexelCopyBufferInfo { buffer: &buffer, layout }, size);
        gpu.queue.submit([encoder.finish()]);
        buffer.map_async(wgpu::MapMode::Read, .., |_| ());
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
        buffer.get_mapped_range(..).expect("mapped").to_vec()
    }
}

fn extent(size: [u32; 2]) -> wgpu::Extent3d {
    wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 }
}

fn init(device: &wgpu::Device, contents: &[u8], usage: BufferUsages) -> wgpu::Buffer {
    device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage })
}

struct Layouts {
    view: wgpu::BindGroupLayout,
    instances: wgpu::BindGroupLayout,
    material: wgpu::BindGroupLayout,
    lighting: wgpu::BindGroupLayout,
    picture: wgpu::BindGroupLayout,
}

impl Layouts {
    fn new(device: &wgpu::Device) -> Layouts {
        let layout = |stages: ShaderStages, types: &[wgpu::BindingType]| {
            let entry = |(binding, ty): (u32, &wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: stages,
                ty: *ty,
                count: None,
            };
            let entries: Vec<_> = (0..).zip(types).map(entry).collect();
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
        };
        let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let (uniform, storage) =
            (buffer(wgpu::BufferBindingType::Uniform), buffer(wgpu::BufferBindingType::Storage { read_only: true }));
        let texture =
            |sample_type, view_dimension| wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false };
        let float = |filterable| texture(wgpu::TextureSampleType::Float { filterable }, wgpu::TextureViewDimension::D2);
        let look_up = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let maps = texture(wgpu::TextureSampleType::Depth, wgpu::TextureViewDimension::D2Array);
        let nearest = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering);
        let mut material = vec![uniform];
        (0..5).for_each(|_| material.extend([float(true), look_up]));
        Layouts {
            view: layout(ShaderStages::VERTEX_FRAGMENT, &[uniform]),
            instances: layout(ShaderStages::VERTEX, &[storage]),
            material: layout(ShaderStages::FRAGMENT, &material),
            lighting: layout(ShaderStages::FRAGMENT, &[uniform, storage, storage, maps, nearest]),
            picture: layout(ShaderStages::FRAGMENT, &[float(false)]),
        }
    }
}

fn group(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, resources: &[wgpu::BindingResource<'_>]) -> wgpu::BindGroup {
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, r)| wgpu::BindGroupEntry { binding, resource: r.clone() }).collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

/// Instances in the order of their batches, the list of their numbers, and the batches.
fn batches(gpu: &Gpu, layouts: &Layouts, scene: &Scene) -> (wgpu::Buffer, wgpu::Buffer, Vec<Batch>) {
    let device = &gpu.device;
    let white = device.create_texture_with_data(
        &gpu.queue,
        &wgpu::TextureDescriptor {
            label: None,
            size: extent([1, 1]),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: TextureFormat::Rgba8Unorm,
            usage: TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        &[255; 4],
    );
    let white = white.create_view(&Default::default());
    let sampler = device.create_sampler(&Default::default());
    type Look = (Arc<Mesh>, Arc<Material>, Vec<Mat4>);
    let mut by_look: HashMap<(usize, usize), Look> = HashMap::new();
    for d in &scene.drawables {
        let key = (Arc::as_ptr(&d.mesh) as usize, Arc::as_ptr(&d.material) as usize);
        by_look.entry(key).or_insert_with(|| (d.mesh.clone(), d.material.clone(), Vec::new())).2.push(d.world_from_object);
    }
    let mut instances: Vec<f32> = Vec::new();
    let mut batches = Vec::new();
    for (mesh, material, places) in by_look.into_values() {
        let first = instances.len() as u32 / 32;
        for m in places {
            let normal = Mat3::from_mat4(m).inverse().transpose();
            instances.extend(m.to_cols_array());
            [normal.x_axis, normal.y_axis, normal.z_axis].iter().for_each(|c| instances.extend([c.x, c.y, c.z, 0.0]));
            instances.extend([f32::from_bits(1), 0.0, 0.0, 0.0]);
        }
        let count = mesh.positions.len();
        let frames: Vec<[f32; 7]> = mesh.normals.iter().map(|n| [n.x, n.y, n.z, 0.0, 0.0, 0.0, 0.0]).collect();
        let attributes = vec![[0.0f32, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]; count];
        let uniform = init(device, &material_bytes(&material), BufferUsages::UNIFORM);
        let mut resources = vec![uniform.as_entire_binding()];
        for _ in 0..5 {
            resources.extend([wgpu::BindingResource::TextureView(&white), wgpu::BindingResource::Sampler(&sampler)]);
        }
        batches.push(Batch {
            buffers: [
                init(device, bytemuck::cast_slice(&mesh.positions), BufferUsages::VERTEX),
                init(device, bytemuck::cast_slice(&frames), BufferUsages::VERTEX),
                init(device, bytemuck::cast_slice(&attributes), BufferUsages::VERTEX),
            ],
            indices: init(device, bytemuck::cast_slice(&mesh.indices), BufferUsages::INDEX),
            index_count: mesh.indices.len() as u32,
            material: group(device, &layouts.material, &resources),
            instances: first..instances.len() as u32 / 32,
        });
    }
    let numbers: Vec<u32> = (0..instances.len() as u32 / 32).collect();
    let visible = init(device, bytemuck::cast_slice(&numbers), BufferUsages::VERTEX);
    (init(device, bytemuck::cast_slice(&instances), BufferUsages::STORAGE), visible, batches)
}

fn view_bytes(view: &View) -> Vec<u8> {
    let clip_from_world = view.frustum.clip_from_view() * view.view_from_world;
    let mut f: Vec<f32> = Vec::new();
    for m in [clip_from_world, clip_from_world.inverse(), view.view_from_world] {
        f.extend(m.to_cols_array());
    }
    f.extend(view.view_from_world.inverse().w_axis.to_array());
    f.extend([0.0, 0.0, view.size[0] as f32, view.size[1] as f32]);
    f.extend([f32::from_bits(0), f32::from_bits(1), 1.0, 0.0]);
    bytemuck::cast_slice(&f).to_vec()
}

fn material_bytes(material: &Material) -> Vec<u8> {
    let Shading::MetallicRoughness { metallic, roughness } = material.shading else { panic!("the grid is metallic-roughness") };
    let mut f = material.base_color.to_array().to_vec();
    f.extend([0.0; 8]);
    f.extend([metallic, roughness, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    f.extend([0.0; 40]);
    bytemuck::cast_slice(&f).to_vec()
}

fn lighting(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, scene: &Scene) -> wgpu::BindGroup {
    let mut frame = vec![scene.ambient.x, scene.ambient.y, scene.ambient.z, 0.0];
    (0..3).for_each(|_| frame.extend([0.0, 0.0, 0.0, 1.0]));
    frame.extend([0.0, 0.0, 0.0, 0.0, 0.0, f32::from_bits(1), 0.0, 0.0]);
    let Light { direction: d, color, intensity, .. } = &scene.lights[0];
    let c = *color * *intensity;
    let mut light = vec![0.0, 0.0, 0.0, 0.0, d.x, d.y, d.z, f32::MAX, c.x, c.y, c.z, 1.0];
    light.extend([0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0, 4.0, -1.0, -1.0, 0.0, 0.0, 0.0]);
    let maps = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 2 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: TextureFormat::Depth32Float,
        usage: TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    let maps = maps
        .create_view(&wgpu::TextureViewDescriptor { dimension: Some(wgpu::TextureViewDimension::D2Array), ..Default::default() });
    let frame = init(device, bytemuck::cast_slice(&frame), BufferUsages::UNIFORM);
    let lights = init(device, bytemuck::cast_slice(&light), BufferUsages::STORAGE);
    let faces = init(device, &[0; 256], BufferUsages::STORAGE);
    let sampler = device.create_sampler(&Default::default());
    let resources = [
        frame.as_entire_binding(),
        lights.as_entire_binding(),
        faces.as_entire_binding(),
        wgpu::BindingResource::TextureView(&maps),
        wgpu::BindingResource::Sampler(&sampler),
    ];
    group(device, layout, &resources)
}

fn module(device: &wgpu::Device, parts: &[&str]) -> wgpu::ShaderModule {
    let source = wgpu::ShaderSource::Wgsl(parts.concat().into());
    device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source })
}

fn surface_pipeline(device: &wgpu::Device, layouts: &Layouts) -> wgpu::RenderPipeline {
    let module = module(device, SURFACE);
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[&layouts.view, &layouts.instances, &layouts.material, &layouts.lighting].map(Some),
        immediate_size: 0,
    });
    let buffers = [
        (12, wgpu::VertexStepMode::Vertex, wgpu::vertex_attr_array![0 => Float32x3].to_vec()),
        (28, wgpu::VertexStepMode::Vertex, wgpu::vertex_attr_array![1 => Float32x3, 2 => Float32x4].to_vec()),
        (32, wgpu::VertexStepMode::Vertex, wgpu::vertex_attr_array![3 => Float32x2, 4 => Float32x2, 5 => Float32x4].to_vec()),
        (4, wgpu::VertexStepMode::Instance, wgpu::vertex_attr_array![6 => Uint32].to_vec()),
    ];
    let buffers: Vec<_> = buffers
        .iter()
        .map(|(array_stride, step_mode, attributes)| {
            Some(wgpu::VertexBufferLayout { array_stride: *array_stride, step_mode: *step_mode, attributes })
        })
        .collect();
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: &buffers,
        },
        primitive: wgpu::PrimitiveState { cull_mode: Some(wgpu::Face::Back), ..Default::default() },
        depth_stencil: Some(depth_stencil(wgpu::CompareFunction::Greater, true)),
        multisample: wgpu::MultisampleState { count: 4, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("opaque"),
            compilation_options: Default::default(),
            targets: &[Some(LINEAR.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn depth_stencil(compare: wgpu::CompareFunction, writes: bool) -> wgpu::DepthStencilState {
    wgpu::DepthStencilState {
        format: DEPTH,
        depth_write_enabled: Some(writes),
        depth_compare: Some(compare),
        stencil: Default::default(),
        bias: Default::default(),
    }
}

fn screen_pipeline(
    device: &wgpu::Device,
    parts: &[&str],
    entry: &str,
    groups: &[Option<&wgpu::BindGroupLayout>],
    in_view: bool,
) -> wgpu::RenderPipeline {
    let module = module(device, parts);
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: groups,
        immediate_size: 0,
    });
    let format = if in_view { LINEAR } else { TextureFormat::Rgba8UnormSrgb };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("fullscreen"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: in_view.then(|| depth_stencil(wgpu::CompareFunction::Equal, false)),
        multisample: wgpu::MultisampleState { count: if in_view { 4 } else { 1 }, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
