//! The passes that make a shadow texture, and the groups of those that read it.

use super::target::{HARD_FORMAT, HIDDEN_FORMAT, RADIUS_FORMAT, SoftTarget};
use crate::clock::Clock;
use crate::gpu::LINEAR_FORMAT;
use crate::layouts::Layouts;
use crate::shaders;
use crate::start::{Late, late};
use umbriel_scene::Samples;
use wgpu::{BindingResource, BindingType, BlendComponent, BlendFactor, BlendOperation, ShaderStages, TextureSampleType};

/// Pipelines, in the order in which they run, each made when it is first needed.
pub(crate) struct Passes {
    stencil_layout: wgpu::BindGroupLayout,
    wedge_layout: wgpu::BindGroupLayout,
    penumbra_layout: wgpu::BindGroupLayout,
    depth_layout: wgpu::BindGroupLayout,
    pub(super) source_layout: wgpu::BindGroupLayout,
    soft_view: wgpu::BindGroupLayout,
    hard: Late<wgpu::RenderPipeline>,
    wedges: Late<wgpu::RenderPipeline>,
    penumbra: Late<wgpu::RenderPipeline>,
    film: Late<wgpu::RenderPipeline>,
}

const EMPTY: wgpu::LoadOp<wgpu::Color> = wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT);
const BOTH: ShaderStages = ShaderStages::VERTEX_FRAGMENT;

fn buffer(binding: u32, ty: wgpu::BufferBindingType) -> wgpu::BindGroupLayoutEntry {
    let ty = BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    wgpu::BindGroupLayoutEntry { binding, visibility: BOTH, ty, count: None }
}

/// Textures, read texel by texel.
fn texture(binding: u32, sample_type: TextureSampleType, multisampled: bool) -> wgpu::BindGroupLayoutEntry {
    let ty = BindingType::Texture { sample_type, view_dimension: wgpu::TextureViewDimension::D2, multisampled };
    wgpu::BindGroupLayoutEntry { binding, visibility: BOTH, ty, count: None }
}

impl Passes {
    pub(super) fn new(device: &wgpu::Device, layouts: &Layouts, samples: Samples) -> Passes {
        let group = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
        };
        let are_many = samples != Samples::One;
        let plain = TextureSampleType::Float { filterable: false };
        let source = buffer(0, wgpu::BufferBindingType::Uniform);
        let list = buffer(2, wgpu::BufferBindingType::Storage { read_only: true });
        let stencil_layout = group(
            "view depth and stencil",
            &[texture(0, TextureSampleType::Depth, are_many), texture(1, TextureSampleType::Uint, are_many)],
        );
        let wedge_layout = group("wedges", &[source, texture(1, plain, false), list]);
        let penumbra_layout = group("penumbra", &[source, texture(1, plain, false), texture(3, plain, false)]);
        let depth_layout = group("view depth", &[texture(0, TextureSampleType::Depth, are_many)]);
        let view = Some(&layouts.view);
        let hard = Stage::new("hard_shadow", &shaders::of_samples(samples, shaders::HARD_SHADOW));
        let largest =
            BlendComponent { src_factor: BlendFactor::One, dst_factor: BlendFactor::One, operation: BlendOperation::Max };
        let wedges = Stage {
            vertex: "wedge",
            target: RADIUS_FORMAT,
            // The sides away from the eye are there wherever the eye is.
            cull_mode: Some(wgpu::Face::Front),
            blend: Some(wgpu::BlendState { color: largest, alpha: largest }),
            ..Stage::new("penumbra_radius", &shaders::WEDGES.concat())
        };
        // Past several layers of casters: 1 - (1 - a) (1 - b).
        let past =
            BlendComponent { src_factor: BlendFactor::One, dst_factor: BlendFactor::OneMinusSrc, operation: BlendOperation::Add };
        let penumbra = Stage {
            target: HIDDEN_FORMAT,
            blend: Some(wgpu::BlendState { color: past, alpha: past }),
            ..Stage::new("soft_shadow", &shaders::PENUMBRA.concat())
        };
        let film = Stage {
            target: LINEAR_FORMAT,
            samples: samples.count(),
            blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
            ..Stage::new("soft_tint", &shaders::of_samples(samples, shaders::SOFT_FILM))
        };
        Passes {
            hard: hard.pipeline(device, &[Some(&stencil_layout)]),
            wedges: wedges.pipeline(device, &[view, Some(&wedge_layout)]),
            penumbra: penumbra.pipeline(device, &[view, Some(&penumbra_layout)]),
            film: film.pipeline(device, &[Some(&layouts.soft_view), Some(&layouts.film), Some(&depth_layout)]),
            source_layout: group("soft source", &[source]),
            soft_view: layouts.soft_view.clone(),
            stencil_layout,
            wedge_layout,
            penumbra_layout,
            depth_layout,
        }
    }

    /// Makes the shadow texture of one layer of casters. The first layer of a light starts it anew.
    #[allow(clippy::too_many_arguments, reason = "all that the passes read")]
    pub(super) fn draw(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        clock: &Clock,
        view: &wgpu::BindGroup,
        source: wgpu::BufferBinding<'_>,
        silhouettes: &wgpu::Buffer,
        (to, is_first): (&SoftTarget, bool),
    ) {
        let texture = BindingResource::TextureView;
        let group = |layout, resources: &[(u32, BindingResource<'_>)]| bind(device, layout, resources);
        let source = BindingResource::Buffer(source);
        let mut pass = begin(encoder, clock, "hard shadow", &to.hard, EMPTY);
        pass.set_pipeline(&self.hard);
        pass.set_bind_group(0, &group(&self.stencil_layout, &[(0, texture(&to.depth)), (1, texture(&to.stencil))]), &[]);
        pass.draw(0..3, 0..1);
        drop(pass);

        let resources = [(0, source.clone()), (1, texture(&to.hard)), (2, silhouettes.as_entire_binding())];
        let mut pass = begin(encoder, clock, "penumbra wedges", &to.radius, EMPTY);
        pass.set_pipeline(&self.wedges);
        pass.set_bind_group(0, view, &[]);
        pass.set_bind_group(1, &group(&self.wedge_layout, &resources), &[]);
        pass.draw_indirect(silhouettes, 0);
        drop(pass);

        let resources = [(0, source), (1, texture(&to.hard)), (3, texture(&to.radius))];
        let mut pass = begin(encoder, clock, "soft shadow", &to.hidden, if is_first { EMPTY } else { wgpu::LoadOp::Load });
        pass.set_pipeline(&self.penumbra);
        pass.set_bind_group(0, view, &[]);
        pass.set_bind_group(1, &group(&self.penumbra_layout, &resources), &[]);
        pass.draw(0..3, 0..1);
    }

    /// Group 0 of passes that read the shadow texture: a view and the texture.
    pub(crate) fn view_group(&self, device: &wgpu::Device, view: wgpu::BufferBinding<'_>, from: &SoftTarget) -> wgpu::BindGroup {
        let [hidden, depth] = [&from.hidden, &from.hard].map(BindingResource::TextureView);
        bind(device, &self.soft_view, &[(0, BindingResource::Buffer(view)), (1, hidden), (2, depth)])
    }

    /// Lays a film over what is drawn, as strong as the shadow.
    pub(crate) fn film(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        clock: &Clock,
        (soft_view, film): (&wgpu::BindGroup, &wgpu::BindGroup),
        (from, samples): (&SoftTarget, &wgpu::TextureView),
    ) {
        let mut pass = begin(encoder, clock, "film", samples, wgpu::LoadOp::Load);
        pass.set_pipeline(&self.film);
        pass.set_bind_group(0, soft_view, &[]);
        pass.set_bind_group(1, film, &[]);
        pass.set_bind_group(2, &bind(device, &self.depth_layout, &[(0, BindingResource::TextureView(&from.depth))]), &[]);
        pass.draw(0..3, 0..1);
    }
}

fn bind(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, resources: &[(u32, BindingResource<'_>)]) -> wgpu::BindGroup {
    let entries: Vec<_> = resources
        .iter()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("soft shadow"), layout, entries: &entries })
}

fn begin<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    clock: &Clock,
    label: &'static str,
    view: &wgpu::TextureView,
    load: wgpu::LoadOp<wgpu::Color>,
) -> wgpu::RenderPass<'e> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some(label),
        timestamp_writes: clock.render(label),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
        })],
        ..Default::default()
    })
}

/// A pipeline over one texture, not yet made.
struct Stage {
    vertex: &'static str,
    fragment: &'static str,
    source: String,
    target: wgpu::TextureFormat,
    samples: u32,
    cull_mode: Option<wgpu::Face>,
    blend: Option<wgpu::BlendState>,
}

impl Stage {
    fn new(fragment: &'static str, source: &str) -> Stage {
        let (vertex, target) = ("fullscreen", HARD_FORMAT);
        Stage { vertex, fragment, source: source.to_owned(), target, samples: 1, cull_mode: None, blend: None }
    }

    fn pipeline(self, device: &wgpu::Device, groups: &[Option<&wgpu::BindGroupLayout>]) -> Late<wgpu::RenderPipeline> {
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(self.fragment),
            bind_group_layouts: groups,
            immediate_size: 0,
        });
        let device = device.clone();
        late(move || self.make(&device, &layout))
    }

    fn make(&self, device: &wgpu::Device, layout: &wgpu::PipelineLayout) -> wgpu::RenderPipeline {
        let module = shaders::module(device, self.fragment, &[&self.source]);
        let target = wgpu::ColorTargetState { format: self.target, blend: self.blend, write_mask: wgpu::ColorWrites::ALL };
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(self.fragment),
            layout: Some(layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(self.vertex),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState { cull_mode: self.cull_mode, ..Default::default() },
            depth_stencil: None,
            multisample: wgpu::MultisampleState { count: self.samples, ..Default::default() },
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(self.fragment),
                compilation_options: Default::default(),
                targets: &[Some(target)],
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}
