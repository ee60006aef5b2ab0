//! Pipelines of the bare program, in the states of the renderer's.

use crate::bindings::Layouts;
use crate::program::{DEPTH, LINEAR, MAP, PICTURE};
use wgpu::VertexStepMode::{Instance, Vertex};
use wgpu::{BindGroupLayout, CompareFunction, Device, RenderPipeline, TextureFormat};

const MAPS: &[&str] = &[
    include_str!("../../src/shaders/position.wgsl"),
    include_str!("../../src/shaders/view.wgsl"),
    include_str!("../../src/shaders/instance.wgsl"),
    include_str!("../../src/shaders/material.wgsl"),
    include_str!("../../src/maps.wgsl"),
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

/// What pipelines of this program differ in.
struct States<'a> {
    groups: &'a [Option<&'a BindGroupLayout>],
    vertex: &'a str,
    has_vertices: bool,
    fragment: Option<(&'a str, TextureFormat)>,
    constants: &'a [(&'a str, f64)],
    cull_mode: Option<wgpu::Face>,
    /// Format, whether it is written, and what passes.
    depth: Option<(TextureFormat, bool, CompareFunction)>,
    samples: u32,
}

/// Opaque surfaces without textures, with or without the look-up of maps.
pub(crate) fn surface(device: &Device, layouts: &Layouts, has_maps: bool) -> RenderPipeline {
    let states = States {
        groups: &[&layouts.view, &layouts.instances, &layouts.material, &layouts.lighting].map(Some),
        vertex: "vertex",
        has_vertices: true,
        fragment: Some(("opaque", LINEAR)),
        constants: &[
            ("TEXTURES", 0.0),
            ("LAYERS", 0.0),
            ("SHADING", 0.0),
            ("MAPS", if has_maps { 1.0 } else { 0.0 }),
            ("LAMPS", 0.0),
            ("AMBIENTS", 0.0),
            ("LISTS", 0.0),
            ("FOG", 0.0),
            ("LIGHTS", 1.0),
        ],
        cull_mode: Some(wgpu::Face::Back),
        depth: Some((DEPTH, true, CompareFunction::Greater)),
        samples: 4,
    };
    pipeline(device, &umbriel_render::surface_wgsl(), &states)
}

/// Depth seen from the light.
pub(crate) fn maps(device: &Device, layouts: &Layouts) -> RenderPipeline {
    let states = States {
        groups: &[&layouts.view, &layouts.instances, &layouts.material].map(Some),
        vertex: "solid",
        has_vertices: true,
        fragment: None,
        constants: &[],
        cull_mode: None,
        depth: Some((MAP, true, CompareFunction::Greater)),
        samples: 1,
    };
    pipeline(device, &MAPS.concat(), &states)
}

/// Where depth is still 0.
pub(crate) fn background(device: &Device, layouts: &Layouts) -> RenderPipeline {
    let states = States {
        groups: &[Some(&layouts.view), None, None, Some(&layouts.lighting)],
        vertex: "fullscreen",
        has_vertices: false,
        fragment: Some(("background", LINEAR)),
        constants: &[],
        cull_mode: None,
        depth: Some((DEPTH, false, CompareFunction::Equal)),
        samples: 4,
    };
    pipeline(device, &BACKGROUND.concat(), &states)
}

/// Sheet to pictures.
pub(crate) fn compose(device: &Device, layouts: &Layouts) -> RenderPipeline {
    let states = States {
        groups: &[Some(&layouts.view), Some(&layouts.picture)],
        vertex: "fullscreen",
        has_vertices: false,
        fragment: Some(("exposed", PICTURE)),
        constants: &[],
        cull_mode: None,
        depth: None,
        samples: 1,
    };
    pipeline(device, &COMPOSE.concat(), &states)
}

fn pipeline(device: &Device, wgsl: &str, states: &States<'_>) -> RenderPipeline {
    let source = wgpu::ShaderSource::Wgsl(wgsl.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: states.groups,
        immediate_size: 0,
    });
    let attributes = [
        (12, Vertex, wgpu::vertex_attr_array![0 => Float32x3].to_vec()),
        (28, Vertex, wgpu::vertex_attr_array![1 => Float32x3, 2 => Float32x4].to_vec()),
        (32, Vertex, wgpu::vertex_attr_array![3 => Float32x2, 4 => Float32x2, 5 => Float32x4].to_vec()),
        (4, Instance, wgpu::vertex_attr_array![6 => Uint32].to_vec()),
    ];
    let buffers = attributes.each_ref().map(|(array_stride, step_mode, attributes)| {
        Some(wgpu::VertexBufferLayout { array_stride: *array_stride, step_mode: *step_mode, attributes })
    });
    let compilation_options = wgpu::PipelineCompilationOptions { constants: states.constants, ..Default::default() };
    let targets = states.fragment.map(|(_, format)| [Some(wgpu::ColorTargetState::from(format))]);
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some(states.vertex),
            compilation_options: compilation_options.clone(),
            buffers: if states.has_vertices { &buffers } else { &[] },
        },
        primitive: wgpu::PrimitiveState { cull_mode: states.cull_mode, ..Default::default() },
        depth_stencil: states.depth.map(|(format, is_written, compare)| wgpu::DepthStencilState {
            format,
            depth_write_enabled: Some(is_written),
            depth_compare: Some(compare),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: wgpu::MultisampleState { count: states.samples, ..Default::default() },
        fragment: states.fragment.zip(targets.as_ref()).map(|((entry, _), targets)| wgpu::FragmentState {
            module: &module,
            entry_point: Some(entry),
            compilation_options,
            targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}
