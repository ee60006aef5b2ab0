//! Pipelines of shadow maps.

use super::MAP_FORMAT;
use crate::cache::{POSITION_BUFFERS, VERTEX_BUFFERS};
use crate::draws::{Alpha, Kind};
use crate::layouts::Layouts;
use crate::record::Reads;

/// Topology, and whether there are holes.
pub(crate) fn key_of(kind: &Kind) -> (u8, bool) {
    (kind.topology, kind.alpha == Alpha::Mask)
}

/// What the pipeline of a kind reads.
pub(crate) fn reads(kind: &Kind) -> Reads {
    if key_of(kind).1 { Reads::All } else { Reads::Positions }
}

/// Layouts of the pipelines: of casters that are whole, and of those with holes.
pub(crate) fn layouts(device: &wgpu::Device, layouts: &Layouts) -> [wgpu::PipelineLayout; 2] {
    let groups = [&layouts.view, &layouts.instances, &layouts.material].map(Some);
    [&groups[..2], &groups[..]].map(|bind_group_layouts| {
        device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("maps"),
            bind_group_layouts,
            immediate_size: 0,
        })
    })
}

/// The pipeline that draws casters of a kind, see [`key_of`].
pub(crate) fn of_kind(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    [whole, with_holes]: &[wgpu::PipelineLayout; 2],
    (topology, holed): (u8, bool),
) -> wgpu::RenderPipeline {
    let topology = crate::surface::topology_of(topology);
    let nearest = Some(wgpu::CompareFunction::Greater);
    if holed {
        pipeline(device, module, with_holes, "holed", Some("cut"), topology, nearest, &VERTEX_BUFFERS)
    } else {
        pipeline(device, module, whole, "solid", None, topology, nearest, &POSITION_BUFFERS)
    }
}

/// The pipeline that empties a tile.
pub(crate) fn emptying(device: &wgpu::Device, module: &wgpu::ShaderModule) -> wgpu::RenderPipeline {
    let no_groups = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor::default());
    let always = Some(wgpu::CompareFunction::Always);
    pipeline(device, module, &no_groups, "empty", None, wgpu::PrimitiveTopology::TriangleList, always, &[])
}

#[allow(clippy::too_many_arguments, reason = "one place where pipelines of this pass are made")]
fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    layout: &wgpu::PipelineLayout,
    vertex: &str,
    fragment: Option<&str>,
    topology: wgpu::PrimitiveTopology,
    depth_compare: Option<wgpu::CompareFunction>,
    buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
) -> wgpu::RenderPipeline {
    let compilation_options = wgpu::PipelineCompilationOptions::default();
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("shadow maps"),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(vertex),
            compilation_options: compilation_options.clone(),
            buffers,
        },
        // Both sides cast: meshes may be open.
        primitive: wgpu::PrimitiveState { topology, ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: MAP_FORMAT,
            depth_write_enabled: Some(true),
            depth_compare,
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: fragment.map(|entry_point| wgpu::FragmentState {
            module,
            entry_point: Some(entry_point),
            compilation_options,
            targets: &[],
        }),
        multiview_mask: None,
        cache: None,
    })
}
