//! The pipeline of cut-outs, and the groups that it reads.

use crate::gpu::{DEPTH_FORMAT, LINEAR_FORMAT};
use crate::shaders;
use std::ops::Range;
use umbriel_scene::Samples;
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{BindGroupLayout, BindingResource, BindingType, BufferBindingType, ShaderStages, TextureSampleType};

/// WGSL of the pass.
const SHADER: &[&str] = &[
    include_str!("../shaders/view.wgsl"),
    include_str!("../shaders/position.wgsl"),
    include_str!("../shaders/material.wgsl"),
    include_str!("../shaders/samples.wgsl"),
    include_str!("../volumes/thrown.wgsl"),
    include_str!("cutouts.wgsl"),
];

/// Corners of a triangle's volume.
pub(super) const CORNERS: u32 = 6;
/// Its faces, outward: 0, 1, 2 lie on the triangle, counter-clockwise as the light sees them, and 3, 4, 5 are thrown away.
const FACES: [u32; 24] = [0, 1, 2, 3, 5, 4, 0, 3, 4, 0, 4, 1, 1, 4, 5, 1, 5, 2, 2, 5, 3, 2, 3, 0];
/// Triangles that the list of indices is for; more are drawn in runs.
const RUN: u32 = 1024;

/// Finds samples behind triangles, as the light sees them.
pub(super) struct Pipeline {
    view: BindGroupLayout,
    caster: BindGroupLayout,
    mesh: BindGroupLayout,
    pipeline: wgpu::RenderPipeline,
    indices: wgpu::Buffer,
}

/// Ranges of indices that draw so many triangles, and the first triangle of each.
pub(super) fn runs(triangle_count: u32) -> impl Iterator<Item = (Range<u32>, u32)> {
    (0..triangle_count).step_by(RUN as usize).map(move |first| {
        let count = RUN.min(triangle_count - first);
        (0..count * FACES.len() as u32, first)
    })
}

impl Pipeline {
    pub(super) fn new(device: &wgpu::Device, material: &BindGroupLayout, samples: Samples) -> Pipeline {
        let layout = |label, entries: &[(ShaderStages, BindingType)]| {
            let entries: Vec<_> = (0..)
                .zip(entries)
                .map(|(binding, &(visibility, ty))| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None })
                .collect();
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
        };
        let both = ShaderStages::VERTEX_FRAGMENT;
        let buffer = |ty| BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let (uniform, list) = (buffer(BufferBindingType::Uniform), buffer(BufferBindingType::Storage { read_only: true }));
        let depth = BindingType::Texture {
            sample_type: TextureSampleType::Depth,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: samples != Samples::One,
        };
        let view = layout("view, its depth", &[(both, uniform), (ShaderStages::FRAGMENT, depth)]);
        let caster = layout("cut-out", &[(both, uniform)]);
        let mesh = layout("cut-out mesh", &[(ShaderStages::VERTEX, list), (both, list), (ShaderStages::FRAGMENT, list)]);
        let groups = [&view, &caster, material, &mesh].map(Some);
        let pipeline = pipeline(device, &groups, samples);
        let corner = |t: u32| FACES.map(|c| t * CORNERS + c);
        let indices: Vec<u32> = (0..RUN).flat_map(corner).collect();
        let indices = device.create_buffer_init(&BufferInitDescriptor {
            label: Some("cut-out volumes"),
            contents: bytemuck::cast_slice(&indices),
            usage: wgpu::BufferUsages::INDEX,
        });
        Pipeline { view, caster, mesh, pipeline, indices }
    }

    /// Layout of a caster's uniform.
    pub(super) fn caster_layout(&self) -> &BindGroupLayout {
        &self.caster
    }

    pub(super) fn set(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_pipeline(&self.pipeline);
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint32);
    }

    /// Group 0.
    pub(super) fn view(
        &self,
        device: &wgpu::Device,
        view: wgpu::BufferBinding<'_>,
        depth: &wgpu::TextureView,
    ) -> wgpu::BindGroup {
        bind(device, &self.view, &[BindingResource::Buffer(view), BindingResource::TextureView(depth)])
    }

    /// Group 3: positions, indices and attributes.
    pub(super) fn mesh(&self, device: &wgpu::Device, buffers: [&wgpu::Buffer; 3]) -> wgpu::BindGroup {
        bind(device, &self.mesh, &buffers.map(|b| b.as_entire_binding()))
    }
}

fn bind(device: &wgpu::Device, layout: &BindGroupLayout, resources: &[BindingResource<'_>]) -> wgpu::BindGroup {
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() }).collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("cut-outs"), layout, entries: &entries })
}

/// Every convex volume that holds a sample ends once behind it, wherever the eye is: faces away from the eye, behind what is seen,
/// with a margin that leaves the decision to the ray.
fn pipeline(device: &wgpu::Device, groups: &[Option<&BindGroupLayout>], samples: Samples) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("cut-outs"),
        bind_group_layouts: groups,
        immediate_size: 0,
    });
    let source = shaders::of_samples(samples, SHADER);
    let module = shaders::module(device, "cut-outs", &[&source]);
    let target = wgpu::ColorTargetState { format: LINEAR_FORMAT, blend: None, write_mask: wgpu::ColorWrites::empty() };
    let mark = wgpu::StencilFaceState {
        compare: wgpu::CompareFunction::Equal,
        pass_op: wgpu::StencilOperation::IncrementClamp,
        ..wgpu::StencilFaceState::IGNORE
    };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("cut-outs"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("volume"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState { cull_mode: Some(wgpu::Face::Front), ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(false),
            depth_compare: Some(wgpu::CompareFunction::LessEqual),
            stencil: wgpu::StencilState { front: mark, back: mark, read_mask: 0xff, write_mask: 0xff },
            bias: wgpu::DepthBiasState { constant: -64, slope_scale: -1.0, clamp: 0.0 },
        }),
        multisample: wgpu::MultisampleState { count: samples.count(), ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("hidden_samples"),
            compilation_options: Default::default(),
            targets: &[Some(target)],
        }),
        multiview_mask: None,
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutouts::Uniform;
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use std::mem::offset_of;

    #[test]
    fn shaders_are_valid_and_read_what_is_sent() {
        for samples in [Samples::One, Samples::Four] {
            let source = shaders::of_samples(samples, SHADER);
            let module = naga::front::wgsl::parse_str(&source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(&source)));
            let valid = Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module);
            valid.unwrap_or_else(|e| panic!("{}", e.emit_to_string(&source)));
            let (_, theirs) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some("Cutout")).unwrap();
            let naga::TypeInner::Struct { members, span } = &theirs.inner else { panic!("no struct") };
            let offsets: Vec<_> = members.iter().map(|m| m.offset as usize).collect();
            let ours = [offset_of!(Uniform, world_from_object), offset_of!(Uniform, toward_light), offset_of!(Uniform, reach_w)];
            assert_eq!((offsets, *span as usize), (ours.to_vec(), size_of::<Uniform>()));
        }
    }

    #[test]
    fn runs_draw_every_triangle_once() {
        let faces = FACES.len() as u32;
        for count in [0, 1, RUN - 1, RUN, RUN + 1, 5 * RUN + 7] {
            let drawn: Vec<u32> = runs(count).flat_map(|(i, first)| (0..i.end / faces).map(move |t| first + t)).collect();
            assert_eq!(drawn, (0..count).collect::<Vec<_>>());
        }
    }

    /// Each side of the volume runs one way in one face and the other way in its neighbour.
    #[test]
    fn volumes_are_closed_and_face_outward() {
        let mut sides: Vec<[u32; 2]> = FACES.chunks(3).flat_map(|f| [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]]).collect();
        sides.sort_unstable();
        assert!(sides.windows(2).all(|w| w[0] != w[1]));
        assert!(sides.iter().all(|[a, b]| sides.binary_search(&[*b, *a]).is_ok()));
        // The light is above.
        let at = |c: u32| {
            glam::Vec3::from([[0., 1., 0.], [0., 1., 1.], [1., 1., 0.]][c as usize % 3]) - glam::Vec3::Y * (c / 3) as f32
        };
        let volume: f32 = FACES.chunks(3).map(|f| at(f[0]).dot(at(f[1]).cross(at(f[2])))).sum();
        assert!((volume - 3.0).abs() < 1e-6, "{volume}");
    }
}
