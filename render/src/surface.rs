//! Pipelines of surfaces.

use crate::author::{Authors, STANDARD};
use crate::cache::VERTEX_BUFFERS;
use crate::draws::{Alpha, Kind, Needs};
use crate::gpu::DEPTH_FORMAT;
use crate::layouts::Layouts;
use crate::lights::Lights;
use crate::start::at_once;
use crate::targets::Canvas;
use crate::{shaders, uniforms};
use std::collections::HashMap;
use umbriel_scene::{FogKind, Material, Samples, Scene};

/// What a pass over the surfaces does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Pass {
    /// Depth, ambient and emitted light and the lights of the surface pass.
    Base,
    /// Depth alone.
    Depth,
    /// As [`Pass::Base`], on what is in depth already, where the stencil is 0.
    BaseLit,
    /// The same where the stencil is not 0.
    BaseInShadow,
    /// Half-transparent shapes over what is there.
    Blend,
    /// One light where the stencil is 0.
    Add,
    /// One light as far as its shadow texture shows it.
    AddSoft,
    /// One light where the stencil is not 0, for shapes that make something of the shadow.
    AddInShadow,
    /// Depth, and what a map lets through of one light.
    Visibility,
    /// The same where the stencil is 0.
    VisibilityAdd,
    /// What the shadow texture shows of one light.
    VisibilitySoft,
    /// Sets the stencil to its reference where a shape shows.
    Mark,
    /// Sets the stencil to 0 where a shape shows that receives no shadows.
    Exempt,
}

impl Pass {
    /// What of a kind matters: shaders of authors shade, and only that.
    fn seen(self, kind: Kind) -> Kind {
        match self {
            Pass::Base | Pass::BaseLit | Pass::BaseInShadow => kind,
            Pass::Blend | Pass::Add | Pass::AddSoft | Pass::AddInShadow => kind,
            // Its alpha may be its own, too.
            Pass::Depth if kind.alpha == Alpha::Mask => kind,
            Pass::Depth | Pass::Mark | Pass::Exempt => Kind { shader: STANDARD, needs: Needs::default(), ..kind },
            Pass::Visibility | Pass::VisibilityAdd | Pass::VisibilitySoft => Kind { shader: STANDARD, ..kind },
        }
    }
}

/// What all surfaces of a frame need of their shader.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct FrameNeeds {
    /// Some light has maps.
    maps: bool,
    /// Some light shines from a position.
    lamps: bool,
    /// Some light adds to what comes from everywhere.
    ambients: bool,
    /// Some surface lists the lights whose shadows fall on it.
    lists: bool,
    /// As the shader's constant: none, linear, exponential.
    fog: u8,
    /// Lights that the surface pass adds up, and all of them; at most [`ANY_NUMBER`].
    lights: [u8; 2],
    canvas: Canvas,
}

/// More lights than a view holds.
const ANY_NUMBER: u8 = uniforms::View::LIGHTS as u8 + 1;

impl FrameNeeds {
    /// `uniforms` are of the lights that shine.
    pub(crate) fn new(scene: &Scene, uniforms: &[uniforms::Light], lights: &Lights, maps: bool, canvas: Canvas) -> FrameNeeds {
        let number = |count: usize| count.min(usize::from(ANY_NUMBER)) as u8;
        FrameNeeds {
            maps,
            lamps: uniforms.iter().any(|l| l.kind != 0),
            ambients: uniforms.iter().any(|l| l.ambient.iter().any(|a| *a > 0.0)),
            lists: !scene.receive_lists.is_empty(),
            fog: match scene.fog.filter(|f| f.visibility_range > 0.0).map(|f| f.kind) {
                None => 0,
                Some(FogKind::Linear) => 1,
                Some(FogKind::Exponential) => 2,
            },
            lights: [lights.in_surface_pass, uniforms.len()].map(number),
            canvas,
        }
    }

    /// What is left of it for one pass, with the number of lights that it adds up.
    fn of(self, pass: Pass, kind: Kind) -> (FrameNeeds, u8) {
        let [in_surface_pass, all] = self.lights;
        let rest = FrameNeeds { lights: [0; 2], ..self };
        match pass {
            Pass::Depth | Pass::Mark | Pass::Exempt if kind.alpha != Alpha::Mask => {
                (FrameNeeds { canvas: self.canvas, ..FrameNeeds::default() }, 0)
            }
            Pass::Base | Pass::BaseInShadow => (rest, in_surface_pass),
            Pass::BaseLit => (rest, ANY_NUMBER.min(in_surface_pass + 1)),
            Pass::Blend => (rest, all),
            Pass::Add | Pass::AddSoft | Pass::AddInShadow => (rest, 1),
            Pass::Depth | Pass::Mark | Pass::Exempt => (rest, 0),
            Pass::Visibility | Pass::VisibilityAdd | Pass::VisibilitySoft => (rest, 0),
        }
    }
}

/// Pipelines by pass and kind of drawable. Each holds of the shader only what its drawables and the frame need: devices
/// without cheap branches, software ones among them, pay for every function that could be called.
pub(crate) struct Surface {
    module: wgpu::ShaderModule,
    layout: wgpu::PipelineLayout,
    /// With the shadow texture beside the view.
    soft_layout: wgpu::PipelineLayout,
    authors: Authors,
    samples: Samples,
    frame: FrameNeeds,
    pipelines: HashMap<Key, wgpu::RenderPipeline>,
    /// What is needed and not made yet.
    wanted: Vec<Key>,
}

/// What a pipeline is made for.
type Key = (Pass, Kind, (FrameNeeds, u8));

impl Surface {
    pub(crate) fn new(device: &wgpu::Device, layouts: &Layouts, samples: Samples) -> Surface {
        let layout = |view| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("surface"),
                bind_group_layouts: &[view, &layouts.instances, &layouts.material, &layouts.lighting].map(Some),
                immediate_size: 0,
            })
        };
        let (layout, soft_layout) = (layout(&layouts.view), layout(&layouts.soft_view));
        let module = shaders::module(device, "surface", &[&shaders::surface()]);
        Surface {
            module,
            layout,
            soft_layout,
            authors: Authors::default(),
            samples,
            frame: FrameNeeds::default(),
            pipelines: HashMap::new(),
            wanted: Vec::new(),
        }
    }

    /// Draws with so many samples from now on.
    pub(crate) fn set_samples(&mut self, samples: Samples) {
        self.samples = samples;
        self.pipelines.clear();
    }

    /// What is made and drawn from now on belongs to such a frame.
    pub(crate) fn set_frame(&mut self, frame: FrameNeeds) {
        self.frame = frame;
    }

    fn key(&self, pass: Pass, kind: Kind) -> Key {
        let kind = pass.seen(kind);
        (pass, kind, self.frame.of(pass, kind))
    }

    /// A pipeline is needed: [`Surface::make_wanted`] makes it where there is none yet.
    pub(crate) fn want(&mut self, pass: Pass, kind: Kind) {
        let key = self.key(pass, kind);
        if !self.pipelines.contains_key(&key) && !self.wanted.contains(&key) {
            self.wanted.push(key);
        }
    }

    /// Makes all pipelines that are needed, at the same time: each takes a driver tens of milliseconds.
    pub(crate) fn make_wanted(&mut self, device: &wgpu::Device) {
        let wanted = std::mem::take(&mut self.wanted);
        let made = at_once(&wanted, |(pass, kind, needs)| {
            let module = self.authors.get(kind.shader).map_or(&self.module, |author| &author.module);
            let is_soft = matches!(pass, Pass::AddSoft | Pass::VisibilitySoft);
            let layout = if is_soft { &self.soft_layout } else { &self.layout };
            pipeline(device, (module, layout), *pass, (*kind, *needs), self.samples)
        });
        self.pipelines.extend(wanted.into_iter().zip(made));
    }

    pub(crate) fn get(&self, pass: Pass, kind: Kind) -> Option<&wgpu::RenderPipeline> {
        self.pipelines.get(&self.key(pass, kind))
    }

    /// Number of the shader that a material is drawn with, and of the one that its author wrote, which may be wrong.
    pub(crate) fn shaders_of(
        &mut self,
        device: &wgpu::Device,
        of: &Material,
        frame: u64,
        report: impl FnOnce(String),
    ) -> [u32; 2] {
        let named = self.authors.number_of(device, of, frame, report);
        [if self.authors.get(named).is_some() { named } else { STANDARD }, named]
    }

    /// A shader is drawn with.
    pub(crate) fn touch(&mut self, shader: u32, frame: u64) {
        self.authors.touch(shader, frame);
    }

    /// Does a shader make something of a light's shadow?
    pub(crate) fn shades_shadow(&self, shader: u32) -> bool {
        self.authors.get(shader).is_some_and(|author| author.shades)
    }

    /// Forgets shaders that nothing is drawn with.
    pub(crate) fn drop_unused(&mut self, frame: u64) {
        let gone = self.authors.drop_unused(frame);
        if !gone.is_empty() {
            self.pipelines.retain(|(_, kind, _), _| !gone.contains(&kind.shader));
        }
    }
}

/// Topology from the number in a [`Kind`].
pub(crate) fn topology_of(number: u8) -> wgpu::PrimitiveTopology {
    match number {
        0 => wgpu::PrimitiveTopology::TriangleList,
        1 => wgpu::PrimitiveTopology::LineList,
        _ => wgpu::PrimitiveTopology::PointList,
    }
}

fn pipeline(
    device: &wgpu::Device,
    (module, layout): (&wgpu::ShaderModule, &wgpu::PipelineLayout),
    pass: Pass,
    (kind, (frame, lights)): (Kind, (FrameNeeds, u8)),
    samples: Samples,
) -> wgpu::RenderPipeline {
    let entry = match (pass, kind.alpha) {
        (Pass::Base, Alpha::Mask) => "masked",
        (Pass::Base | Pass::BaseLit | Pass::BaseInShadow, _) => "opaque",
        (Pass::Depth, Alpha::Mask) => "holes",
        (Pass::Blend, _) => "blended",
        (Pass::Add, _) => "added",
        (Pass::AddSoft, _) => "added_soft",
        (Pass::VisibilitySoft, _) => "visibility_soft",
        (Pass::AddInShadow, _) => "added_in_shadow",
        (Pass::Visibility, Alpha::Mask) => "visibility_masked",
        (Pass::Visibility | Pass::VisibilityAdd, _) => "visibility",
        (Pass::Depth | Pass::Mark | Pass::Exempt, _) => "nothing",
    };
    let fills_depth = matches!(pass, Pass::Base | Pass::Depth | Pass::Visibility);
    let depth_compare =
        if fills_depth || pass == Pass::Blend { wgpu::CompareFunction::Greater } else { wgpu::CompareFunction::Equal };
    let sum = |dst_factor| wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor,
        operation: wgpu::BlendOperation::Add,
    };
    let blend = match pass {
        Pass::Base | Pass::Depth | Pass::BaseLit | Pass::BaseInShadow | Pass::Visibility | Pass::Mark | Pass::Exempt => None,
        Pass::Blend => Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
        Pass::Add | Pass::AddInShadow | Pass::VisibilityAdd | Pass::AddSoft | Pass::VisibilitySoft => {
            Some(wgpu::BlendState { color: sum(wgpu::BlendFactor::One), alpha: sum(wgpu::BlendFactor::One) })
        }
    };
    let stencil = match pass {
        Pass::Exempt => without_shadow(),
        Pass::Mark => replacing(),
        Pass::BaseLit | Pass::Add | Pass::VisibilityAdd => where_volumes(wgpu::CompareFunction::Equal),
        Pass::BaseInShadow | Pass::AddInShadow => where_volumes(wgpu::CompareFunction::NotEqual),
        _ => wgpu::StencilState::default(),
    };
    let write_mask =
        if matches!(pass, Pass::Depth | Pass::Mark | Pass::Exempt) { wgpu::ColorWrites::empty() } else { wgpu::ColorWrites::ALL };
    let constants = [
        ("TEXTURES", f64::from(kind.needs.textures)),
        ("LAYERS", f64::from(kind.needs.layers)),
        ("SHADING", f64::from(kind.needs.shading)),
        ("MAPS", f64::from(u8::from(frame.maps))),
        ("LAMPS", f64::from(u8::from(frame.lamps))),
        ("AMBIENTS", f64::from(u8::from(frame.ambients))),
        ("LISTS", f64::from(u8::from(frame.lists))),
        ("FOG", f64::from(frame.fog)),
        ("LIGHTS", f64::from(lights)),
        frame.canvas.constant(),
        ("HOLES", if kind.alpha == Alpha::Mask { f64::from(samples.count()) } else { 0.0 }),
    ];
    let compilation_options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(entry),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(if entry == "nothing" { "solid" } else { "vertex" }),
            compilation_options: compilation_options.clone(),
            buffers: &VERTEX_BUFFERS,
        },
        primitive: wgpu::PrimitiveState {
            topology: topology_of(kind.topology),
            front_face: if kind.mirrored { wgpu::FrontFace::Cw } else { wgpu::FrontFace::Ccw },
            cull_mode: if kind.double_sided || kind.topology != 0 { None } else { Some(wgpu::Face::Back) },
            ..Default::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(fills_depth),
            depth_compare: Some(depth_compare),
            stencil,
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState { count: samples.count(), ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(entry),
            compilation_options,
            targets: &[Some(wgpu::ColorTargetState { format: frame.canvas.format(), blend, write_mask })],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// Passes where the number of volumes compares to 0.
fn where_volumes(compare: wgpu::CompareFunction) -> wgpu::StencilState {
    let face = wgpu::StencilFaceState { compare, ..wgpu::StencilFaceState::IGNORE };
    wgpu::StencilState { front: face, back: face, read_mask: 0xff, write_mask: 0 }
}

/// Forgets what volumes were counted.
fn without_shadow() -> wgpu::StencilState {
    let face = wgpu::StencilFaceState { pass_op: wgpu::StencilOperation::Zero, ..wgpu::StencilFaceState::IGNORE };
    wgpu::StencilState { front: face, back: face, read_mask: 0xff, write_mask: 0xff }
}

/// Sets the stencil to its reference.
pub(crate) fn replacing() -> wgpu::StencilState {
    let face = wgpu::StencilFaceState { pass_op: wgpu::StencilOperation::Replace, ..wgpu::StencilFaceState::IGNORE };
    wgpu::StencilState { front: face, back: face, read_mask: 0xff, write_mask: 0xff }
}
