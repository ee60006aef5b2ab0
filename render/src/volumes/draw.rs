//! Counts volumes into the stencil: both faces in one draw, where they lie behind what is seen.

use super::extract::{CAPS, Lists, SIDES, TURNED_CAPS};
use super::parts::{GROUP_LAYERS, STENCIL_LAYERS};
use wgpu::{CompareFunction, StencilOperation};

/// WGSL of this pass: the View of bind group 0, the shared ways from vertices to the screen, then its own.
pub(super) const SHADER: &str =
    concat!(include_str!("../shaders/view.wgsl"), include_str!("../shaders/position.wgsl"), include_str!("draw.wgsl"));

/// Bits of the stencil that count where groups follow each other; the eighth remembers.
const COUNT_BITS: u32 = 0x7f;
const SHADOWED: u32 = 0x80;

/// What the pipelines are drawn into.
#[derive(Clone, Copy)]
pub(super) struct Target {
    pub(super) depth_stencil_format: wgpu::TextureFormat,
    pub(super) sample_count: u32,
    pub(super) colour_format: Option<wgpu::TextureFormat>,
}

/// Counting with one mask of stencil bits.
struct Counting {
    volume: wgpu::RenderPipeline,
    turned: wgpu::RenderPipeline,
}

/// Pipelines of the draw.
pub(super) struct Drawing {
    /// All eight bits, for jobs that fit.
    whole: Counting,
    /// Seven bits, with `remember` between groups.
    grouped: Counting,
    remember: wgpu::RenderPipeline,
}

/// Layout of bind group 1: the caster and its positions.
pub(super) fn placed_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::VERTEX,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("volume caster"),
        entries: &[entry(0, wgpu::BufferBindingType::Uniform), entry(1, wgpu::BufferBindingType::Storage { read_only: true })],
    })
}

/// Reversed depth: what is behind or level with the visible surface fails, near caps on their own surface among it.
/// Faces turned to the eye end a shadow that began behind them, so they count down (the mirror of 000's front state).
fn z_fail(write_mask: u32, turned: bool) -> (CompareFunction, wgpu::StencilState) {
    let face = |depth_fail_op| wgpu::StencilFaceState { compare: CompareFunction::Always, depth_fail_op, ..Default::default() };
    let (down, up) = (face(StencilOperation::DecrementWrap), face(StencilOperation::IncrementWrap));
    let (front, back) = if turned { (up, down) } else { (down, up) };
    (CompareFunction::Greater, wgpu::StencilState { front, back, read_mask: 0xff, write_mask })
}

/// Where any bit counts, the count is dropped and the eighth bit set.
fn remembering() -> (CompareFunction, wgpu::StencilState) {
    let face =
        wgpu::StencilFaceState { compare: CompareFunction::NotEqual, pass_op: StencilOperation::Replace, ..Default::default() };
    (CompareFunction::Always, wgpu::StencilState { front: face, back: face, read_mask: COUNT_BITS, write_mask: 0xff })
}

impl Drawing {
    pub(super) fn new(
        device: &wgpu::Device,
        target: Target,
        view_layout: &wgpu::BindGroupLayout,
        placed_layout: &wgpu::BindGroupLayout,
    ) -> Drawing {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("volume draw"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("volume draw"),
            bind_group_layouts: &[Some(view_layout), Some(placed_layout)],
            immediate_size: 0,
        });
        let targets = [target.colour_format.map(|format| wgpu::ColorTargetState {
            format,
            blend: None,
            write_mask: wgpu::ColorWrites::empty(),
        })];
        let pipeline = |label, entry_point, (depth_compare, stencil)| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(label),
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(entry_point),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: target.depth_stencil_format,
                    depth_write_enabled: Some(false),
                    depth_compare: Some(depth_compare),
                    stencil,
                    bias: Default::default(),
                }),
                multisample: wgpu::MultisampleState { count: target.sample_count, ..Default::default() },
                fragment: target.colour_format.map(|_| wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("no_colour"),
                    compilation_options: Default::default(),
                    targets: &targets,
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let counting = |mask| Counting {
            volume: pipeline("volume", "place", z_fail(mask, false)),
            turned: pipeline("volume, turned caps", "place", z_fail(mask, true)),
        };
        Drawing {
            whole: counting(0xff),
            grouped: counting(COUNT_BITS),
            remember: pipeline("volume group end", "whole_view", remembering()),
        }
    }

    /// Draws all lists of a job, in groups that cannot overflow the stencil.
    pub(super) fn run(&self, pass: &mut wgpu::RenderPass<'_>, lists: &[Lists], view: &wgpu::BindGroup) {
        pass.set_bind_group(0, view, &[]);
        let total: u32 = lists.iter().map(|l| l.part.layers.min(STENCIL_LAYERS)).sum();
        if total <= STENCIL_LAYERS {
            return self.whole.run(pass, lists);
        }
        pass.set_stencil_reference(SHADOWED);
        for (i, group) in groups(lists, |l| l.part.layers).enumerate() {
            if i > 0 {
                pass.set_pipeline(&self.remember);
                pass.draw(0..3, 0..1);
            }
            self.grouped.run(pass, group);
        }
    }
}

impl Counting {
    fn run(&self, pass: &mut wgpu::RenderPass<'_>, lists: &[Lists]) {
        for (pipeline, draws) in [(&self.volume, &[SIDES, CAPS][..]), (&self.turned, &[TURNED_CAPS])] {
            pass.set_pipeline(pipeline);
            for l in lists {
                pass.set_bind_group(1, &l.placed, &[]);
                pass.set_index_buffer(l.indices.slice(..), wgpu::IndexFormat::Uint32);
                for &draw in draws {
                    pass.draw_indexed_indirect(&l.draws, draw);
                }
            }
        }
    }
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
