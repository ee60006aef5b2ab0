//! Contours and silhouettes of shapes as lines (001 section 4.3).
//!
//! The one idea is the paper's: each shape marks its pixels in the stencil with a number of its own, so that strokes around its
//! silhouette are kept out of its inside by one comparison, and the stencil is emptied only once for 255 shapes. Where the
//! paper's text says to draw where the stencil equals the shape's number, it must differ from it: thick strokes belong outside
//! of the shape, and what of them would be inside is an internal contour, which is to be suppressed.

use crate::cache::{GpuMesh, Slab};
use crate::deform::Deformer;
use crate::draws::{Draw, Draws};
use crate::gpu::{DEPTH_FORMAT, LINEAR_FORMAT};
use crate::layouts::Layouts;
use crate::shaders;
use crate::slots::Slots;
use crate::start::{Late, late};
use crate::volumes::VolumePass;
use bytemuck::{Pod, Zeroable};
use glam::Mat4;
use std::collections::BTreeMap;
use umbriel_scene::{ContourStyle, Mesh, Samples, Scene};
use wgpu::{CompareFunction, StencilFaceState, StencilState};

/// The stencil where no shape is.
pub(crate) const NO_SHAPE: u32 = 255;

/// `Contour` of contours.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Uniform {
    pub(crate) world_from_object: Mat4,
    pub(crate) color: [f32; 3],
    pub(crate) line_px: f32,
    pub(crate) outline_px: f32,
    pub(crate) crease_cos: f32,
    pub(crate) spare: [f32; 2],
}

/// A shape of the frame with lines.
struct Inked {
    slot: usize,
    style: ContourStyle,
    /// Edges, and what they are read from.
    parts: Vec<(u32, wgpu::BindGroup)>,
}

/// Shapes of the frame with lines, and the pipelines of these.
pub(crate) struct Contours {
    layout: wgpu::BindGroupLayout,
    uniform_layout: wgpu::BindGroupLayout,
    /// Lines everywhere, and outlines where the stencil is another number.
    pipelines: Late<[wgpu::RenderPipeline; 2]>,
    uniforms: Slots<Uniform>,
    /// By place in the scene's drawables.
    shapes: BTreeMap<usize, Inked>,
}

impl Contours {
    pub(crate) fn new(device: &wgpu::Device, layouts: &Layouts, samples: Samples) -> Contours {
        let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let make = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
        };
        let list = wgpu::BufferBindingType::Storage { read_only: true };
        let layout = make("contour edges", &[0, 1, 2, 3].map(|i| entry(i, wgpu::ShaderStages::VERTEX, list)));
        let both = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let uniform_layout = make("contour", &[entry(0, both, wgpu::BufferBindingType::Uniform)]);
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("contours"),
            bind_group_layouts: &[Some(&layouts.view), Some(&layout), Some(&uniform_layout)],
            immediate_size: 0,
        });
        let of = device.clone();
        let pipelines = late(move || {
            let module = shaders::module(&of, "contours", shaders::CONTOURS);
            [("line", CompareFunction::Always), ("outline", CompareFunction::NotEqual)]
                .map(|(entry, compare)| pipeline(&of, (&module, &pipeline_layout), entry, compare, samples))
        });
        Contours { pipelines, uniforms: Slots::new(device, "contours"), shapes: BTreeMap::new(), layout, uniform_layout }
    }

    /// Takes the shapes of a frame.
    pub(crate) fn prepare(
        &mut self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        scene: &Scene,
        (draws, meshes, deformer): (&Draws, &Slab<Mesh, Option<GpuMesh>>, &Deformer),
        volumes: &mut VolumePass,
    ) {
        self.uniforms.clear();
        self.shapes.clear();
        for group in &scene.contours {
            for &index in &group.drawables {
                if let Some(mesh) = draws.mesh_of(index) {
                    self.take(device, scene, (index, mesh), group.style, (meshes, deformer), volumes);
                }
            }
        }
        self.uniforms.upload(device, queue, &self.uniform_layout);
    }

    fn take(
        &mut self,
        device: &wgpu::Device,
        scene: &Scene,
        (index, (mesh, deformed)): (usize, (u32, Option<u32>)),
        style: ContourStyle,
        (meshes, deformer): (&Slab<Mesh, Option<GpuMesh>>, &Deformer),
        volumes: &mut VolumePass,
    ) {
        let (Some(Some(rest)), Some(mesh)) = (meshes.get(mesh), meshes.key(mesh)) else { return };
        let positions = deformed.and_then(|d| deformer.get(d)).map_or(&rest.positions, |d| &d.positions);
        let slot = self.uniforms.push(&Uniform {
            world_from_object: scene.drawables[index].world_from_object,
            color: style.color.to_array(),
            line_px: 0.5 * style.line_px,
            outline_px: style.outline_px,
            crease_cos: if style.crease_rad < std::f32::consts::PI { style.crease_rad.cos() } else { -2.0 },
            spare: [0.0; 2],
        });
        let group = |part: &crate::volumes::GpuPart| {
            let buffers = [positions, &part.triangles, &part.edges, &part.incidences];
            let entries: Vec<_> = (0u32..)
                .zip(buffers)
                .map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() })
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("contour"),
                layout: &self.layout,
                entries: &entries,
            })
        };
        let parts = volumes.parts(device, mesh).iter().map(|part| (part.edge_count, group(part))).collect();
        self.shapes.insert(index, Inked { slot, style, parts });
    }

    /// Places of the shapes in the scene's drawables, ascending.
    pub(crate) fn places(&self) -> Vec<usize> {
        self.shapes.keys().copied().collect()
    }

    /// Draws the lines of some shapes, each with its draw, into a view whose depth is filled. `empty` sets the stencil to its
    /// reference; `mark` does so where a shape is seen.
    pub(crate) fn draw(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        view: &wgpu::BindGroup,
        shapes: &[(usize, Draw)],
        empty: impl Fn(&mut wgpu::RenderPass<'_>),
        mut mark: impl FnMut(&mut wgpu::RenderPass<'_>, &Draw),
    ) {
        for (number, (index, draw)) in (0u32..).zip(shapes) {
            let Some(shape) = self.shapes.get(index) else { continue };
            let own = number % NO_SHAPE;
            if own == 0 {
                pass.set_stencil_reference(NO_SHAPE);
                empty(pass);
            }
            pass.set_stencil_reference(own);
            if shape.style.outline_px > 0.0 {
                mark(pass, draw);
            }
            pass.set_bind_group(0, view, &[]);
            let widths = [(shape.style.line_px, 6), (shape.style.outline_px, 12)];
            for (place, (width, corners)) in widths.into_iter().enumerate() {
                if width > 0.0 {
                    pass.set_pipeline(&self.pipelines[place]);
                    pass.set_bind_group(2, self.uniforms.group(shape.slot), &[]);
                    for (edges, group) in &shape.parts {
                        pass.set_bind_group(1, group, &[]);
                        pass.draw(0..corners, 0..*edges);
                    }
                }
            }
        }
        pass.set_stencil_reference(0);
    }
}

fn pipeline(
    device: &wgpu::Device,
    (module, layout): (&wgpu::ShaderModule, &wgpu::PipelineLayout),
    entry: &str,
    compare: CompareFunction,
    samples: Samples,
) -> wgpu::RenderPipeline {
    let face = StencilFaceState { compare, ..StencilFaceState::IGNORE };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(entry),
        layout: Some(layout),
        vertex: wgpu::VertexState { module, entry_point: Some(entry), compilation_options: Default::default(), buffers: &[] },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(false),
            depth_compare: Some(CompareFunction::GreaterEqual),
            stencil: StencilState { front: face, back: face, read_mask: 0xff, write_mask: 0 },
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState { count: samples.count(), ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("inked"),
            compilation_options: Default::default(),
            targets: &[Some(wgpu::ColorTargetState { format: LINEAR_FORMAT, blend: None, write_mask: wgpu::ColorWrites::ALL })],
        }),
        multiview_mask: None,
        cache: None,
    })
}
