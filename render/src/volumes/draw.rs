//! Counts volumes into the stencil: both faces in one draw, in front of or behind what is seen.

use super::Depth;
use super::choose::{Choice, Sight};
use super::extract::{Lists, Piece};
use super::parts::{GROUP_LAYERS, STENCIL_LAYERS};
use std::collections::HashMap;
use wgpu::{CompareFunction, StencilOperation};

/// WGSL of the pass: the View of bind group 0, the shared ways from vertices to the screen, then its own.
pub(super) const LISTED: &str = concat!(
    include_str!("../shaders/view.wgsl"),
    include_str!("../shaders/position.wgsl"),
    include_str!("silhouette.wgsl"),
    include_str!("thrown.wgsl"),
    include_str!("draw.wgsl")
);
pub(super) const QUADS: &str = concat!(
    include_str!("../shaders/view.wgsl"),
    include_str!("../shaders/position.wgsl"),
    include_str!("silhouette.wgsl"),
    include_str!("thrown.wgsl"),
    include_str!("quads.wgsl")
);

/// Bits of the stencil that count where groups follow each other; the eighth remembers.
const COUNT_BITS: u32 = 0x7f;
const SHADOWED: u32 = 0x80;

/// What the pipelines are drawn into.
#[derive(Clone, Copy)]
pub(super) struct Target {
    pub(super) depth: Depth,
    pub(super) depth_stencil_format: wgpu::TextureFormat,
    pub(super) sample_count: u32,
    pub(super) colour_format: Colour,
}

/// Layouts of bind group 1.
#[derive(Clone)]
pub(super) struct Layouts {
    /// The caster and its positions.
    pub(super) listed: wgpu::BindGroupLayout,
    /// The same, with its triangles and edges.
    pub(super) quads: wgpu::BindGroupLayout,
}

impl Layouts {
    pub(super) fn new(device: &wgpu::Device) -> Layouts {
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::VERTEX,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let layout = |label, buffers| {
            let mut entries = vec![entry(0, wgpu::BufferBindingType::Uniform)];
            entries.extend((1..=buffers).map(|i| entry(i, wgpu::BufferBindingType::Storage { read_only: true })));
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
        };
        Layouts { listed: layout("volume caster", 1), quads: layout("volume caster for quads", 5) }
    }
}

/// What a pipeline is chosen by, in the order in which they are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
struct Kind {
    /// Seven bits count, with the step between groups.
    grouped: bool,
    /// None for lists, else the piece that the vertex shader makes.
    quads: Option<Piece>,
    z_fail: bool,
    turned: bool,
    /// On the caster's own surface.
    on_surface: bool,
}

/// Pipelines of the draw.
pub(super) struct Drawing {
    target: Target,
    listed: (wgpu::ShaderModule, wgpu::PipelineLayout),
    quads: (wgpu::ShaderModule, wgpu::PipelineLayout),
    alone: (wgpu::ShaderModule, wgpu::PipelineLayout),
    counting: HashMap<(Colour, Kind), wgpu::RenderPipeline>,
    /// Drops the counts of a group and remembers where they were not 0.
    remember: HashMap<Colour, wgpu::RenderPipeline>,
}

/// Format of the colour beside which is drawn.
type Colour = Option<wgpu::TextureFormat>;

/// What is behind or level with the visible surface fails, near caps on their own surface among it.
fn in_front(depth: Depth) -> CompareFunction {
    match depth {
        Depth::Reversed => CompareFunction::Greater,
        Depth::Conventional | Depth::Clamped => CompareFunction::Less,
    }
}

/// How much farther from the eye near caps count as lying, in ways from pixel to pixel: more than rounding takes two triangles
/// of one plane apart (vertices stand on a grid of 1/256 pixel). What lies in the plane of a cap, as the ground does under a
/// bottom, is then on the eye's side of it, as the cap's own surface is to the last bit: lit where light and eye are on the same
/// side, and in shadow where they are not.
const CAPS_BEHIND_PIXELS: f32 = 1.0 / 32.0;

fn behind(depth: Depth) -> wgpu::DepthBiasState {
    let away = match depth {
        Depth::Reversed => -1,
        Depth::Conventional | Depth::Clamped => 1,
    };
    wgpu::DepthBiasState { constant: 4 * away, slope_scale: away as f32 * CAPS_BEHIND_PIXELS, clamp: 0.0 }
}

/// Counting behind what is seen, faces turned to the eye end a shadow that began behind them, so they count down (the
/// mirror of 000's front state). Counting in front of it they begin one, so they count up.
fn counting(write_mask: u32, z_fail: bool, turned: bool) -> wgpu::StencilState {
    let face = |op| {
        let keep = wgpu::StencilFaceState { compare: CompareFunction::Always, ..Default::default() };
        if z_fail { wgpu::StencilFaceState { depth_fail_op: op, ..keep } } else { wgpu::StencilFaceState { pass_op: op, ..keep } }
    };
    let (down, up) = (face(StencilOperation::DecrementWrap), face(StencilOperation::IncrementWrap));
    let (front, back) = if turned == z_fail { (up, down) } else { (down, up) };
    wgpu::StencilState { front, back, read_mask: 0xff, write_mask }
}

/// Where any bit counts, the count is dropped and the eighth bit set.
fn remembering() -> wgpu::StencilState {
    let face =
        wgpu::StencilFaceState { compare: CompareFunction::NotEqual, pass_op: StencilOperation::Replace, ..Default::default() };
    wgpu::StencilState { front: face, back: face, read_mask: COUNT_BITS, write_mask: 0xff }
}

impl Drawing {
    pub(super) fn new(device: &wgpu::Device, target: Target, view_layout: &wgpu::BindGroupLayout, layouts: &Layouts) -> Drawing {
        let program = |label, source: &'static str, layouts: &[Option<&wgpu::BindGroupLayout>]| {
            let source = wgpu::ShaderSource::Wgsl(source.into());
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(label), source });
            let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(label),
                bind_group_layouts: layouts,
                immediate_size: 0,
            });
            (module, layout)
        };
        let listed = program("volume draw", LISTED, &[Some(view_layout), Some(&layouts.listed)]);
        let quads = program("volume quads", QUADS, &[Some(view_layout), Some(&layouts.quads)]);
        let alone = program("volume group end", LISTED, &[]);
        Drawing { target, listed, quads, alone, counting: HashMap::new(), remember: HashMap::new() }
    }

    /// What is made and drawn from now on is drawn beside colour of such a format.
    pub(super) fn set_colour(&mut self, format: Colour) {
        self.target.colour_format = format;
    }

    /// Makes the pipelines that `lists` may need.
    pub(super) fn make(&mut self, device: &wgpu::Device, lists: &Lists) {
        self.remember.entry(self.target.colour_format).or_insert_with(|| {
            let always = (CompareFunction::Always, wgpu::DepthBiasState::default());
            pipeline(device, &self.target, &self.alone, "whole_view", always, remembering())
        });
        for grouped in [false, true] {
            for z_fail in [false, true] {
                for piece in Piece::ALL {
                    let kind = Kind::of(lists, piece, z_fail, grouped);
                    let key = (self.target.colour_format, kind);
                    if self.counting.contains_key(&key) {
                        continue;
                    }
                    let mask = if grouped { COUNT_BITS } else { 0xff };
                    let stencil = counting(mask, z_fail, kind.turned);
                    let (program, entry) = match kind.quads {
                        None => (&self.listed, "place"),
                        Some(Piece::Sides) => (&self.quads, "side"),
                        Some(Piece::NearCaps) => (&self.quads, "near_cap"),
                        Some(Piece::TurnedCaps) => (&self.quads, "turned_cap"),
                        Some(Piece::SolidCaps) => (&self.quads, "solid_cap"),
                        Some(Piece::FarCaps) => (&self.quads, "far_cap"),
                    };
                    let depth = self.target.depth;
                    let bias = if kind.on_surface { behind(depth) } else { Default::default() };
                    let made = pipeline(device, &self.target, program, entry, (in_front(depth), bias), stencil);
                    self.counting.insert(key, made);
                }
            }
        }
    }

    /// Draws the lists of a job that a view shows, in groups that cannot overflow the stencil.
    pub(super) fn run(&self, pass: &mut wgpu::RenderPass<'_>, shown: &[(&Lists, Choice)], sight: &Sight, view: &wgpu::BindGroup) {
        pass.set_bind_group(0, view, &[]);
        let total: u32 = shown.iter().map(|(l, _)| l.part.layers.min(STENCIL_LAYERS)).sum();
        let whole = sight.in_target();
        let mut scissor = [0; 4];
        cut(pass, &mut scissor, whole);
        if total <= STENCIL_LAYERS {
            self.count(pass, shown, false, (sight, &mut scissor));
        } else {
            pass.set_stencil_reference(SHADOWED);
            for (i, group) in groups(shown, |(l, _)| l.part.layers).enumerate() {
                if i > 0 {
                    cut(pass, &mut scissor, whole);
                    pass.set_pipeline(&self.remember[&self.target.colour_format]);
                    pass.draw(0..3, 0..1);
                }
                self.count(pass, group, true, (sight, &mut scissor));
            }
        }
        cut(pass, &mut scissor, whole);
    }

    /// Draws all pieces, sorted so that pipelines follow each other.
    fn count(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        shown: &[(&Lists, Choice)],
        grouped: bool,
        (sight, scissor): (&Sight, &mut [u32; 4]),
    ) {
        let mut pieces = Vec::with_capacity(2 * shown.len());
        for (place, (lists, choice)) in shown.iter().enumerate() {
            let wanted = |piece| match piece {
                Piece::Sides => true,
                Piece::SolidCaps => choice.near_caps && lists.has(piece) && !choice.front_hides,
                Piece::NearCaps | Piece::TurnedCaps => {
                    choice.near_caps && lists.has(piece) && !(choice.front_hides && lists.hides_caps_from(sight.eye))
                }
                Piece::FarCaps => choice.far_caps,
            };
            let kinds = Piece::ALL.into_iter().filter(|p| wanted(*p));
            pieces.extend(kinds.map(|piece| (Kind::of(lists, piece, choice.z_fail, grouped), place, piece)));
        }
        pieces.sort_unstable();
        let (mut kind, mut bound) = (None, None);
        for (wanted, place, piece) in pieces {
            let (lists, choice) = &shown[place];
            let Some(pipeline) = self.counting.get(&(self.target.colour_format, wanted)) else { continue };
            if kind.replace(wanted) != Some(wanted) {
                pass.set_pipeline(pipeline);
            }
            if bound.replace(place) != Some(place) {
                pass.set_bind_group(1, &lists.placed, &[]);
                cut(pass, scissor, sight.placed(choice.scissor));
                if let Some(listed) = &lists.listed {
                    pass.set_index_buffer(listed.indices.slice(..), wgpu::IndexFormat::Uint32);
                }
            }
            match (&lists.listed, piece) {
                (Some(listed), _) => pass.draw_indexed_indirect(&listed.draws, piece.offset()),
                (None, Piece::Sides) => pass.draw(0..18 * lists.part.triangle_count, 0..1),
                (None, _) => pass.draw(0..3 * lists.part.triangle_count, 0..1),
            }
        }
    }
}

impl Kind {
    fn of(lists: &Lists, piece: Piece, z_fail: bool, grouped: bool) -> Kind {
        let quads = lists.listed.is_none().then_some(piece);
        let on_surface = matches!(piece, Piece::NearCaps | Piece::TurnedCaps | Piece::SolidCaps);
        Kind { grouped, quads, z_fail, turned: piece == Piece::TurnedCaps, on_surface }
    }
}

fn cut(pass: &mut wgpu::RenderPass<'_>, now: &mut [u32; 4], to: [u32; 4]) {
    if *now != to {
        *now = to;
        pass.set_scissor_rect(to[0], to[1], to[2], to[3]);
    }
}

fn pipeline(
    device: &wgpu::Device,
    target: &Target,
    (module, layout): &(wgpu::ShaderModule, wgpu::PipelineLayout),
    entry_point: &'static str,
    (depth_compare, bias): (CompareFunction, wgpu::DepthBiasState),
    stencil: wgpu::StencilState,
) -> wgpu::RenderPipeline {
    let targets = [target.colour_format.map(|format| wgpu::ColorTargetState {
        format,
        blend: None,
        write_mask: wgpu::ColorWrites::empty(),
    })];
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(entry_point),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(entry_point),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState { unclipped_depth: target.depth == Depth::Clamped, ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: target.depth_stencil_format,
            depth_write_enabled: Some(false),
            depth_compare: Some(depth_compare),
            stencil,
            bias,
        }),
        multisample: wgpu::MultisampleState { count: target.sample_count, ..Default::default() },
        fragment: target.colour_format.map(|_| wgpu::FragmentState {
            module,
            entry_point: Some("no_colour"),
            compilation_options: Default::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// Runs of items whose layers fit into one group; an item that is too large stands alone.
fn groups<T>(items: &[T], layers: impl Fn(&T) -> u32) -> impl Iterator<Item = &[T]> {
    let mut rest = items;
    std::iter::from_fn(move || {
        let mut sum = 0u32;
        let fit = rest.iter().take_while(|i| {
            sum = sum.saturating_add(layers(i));
            sum <= GROUP_LAYERS
        });
        let (group, others) = rest.split_at(fit.count().max(1).min(rest.len()));
        rest = others;
        (!group.is_empty()).then_some(group)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_hold_what_seven_bits_count() {
        let rows: [(&[u32], &[usize]); 5] =
            [(&[], &[]), (&[127], &[1]), (&[100, 27, 1], &[2, 1]), (&[1000, 1, 1], &[1, 2]), (&[1, 1000, 127], &[1, 1, 1])];
        for (layers, expected) in rows {
            assert_eq!(groups(layers, |l| *l).map(<[u32]>::len).collect::<Vec<_>>(), expected, "{layers:?}");
        }
    }
}
