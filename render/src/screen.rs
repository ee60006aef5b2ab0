//! Passes that cover the screen: background, film, composition.

use crate::gpu::{DEPTH_FORMAT, LINEAR_FORMAT};
use crate::layouts::Layouts;
use crate::shaders;
use crate::surface::replacing;
use crate::targets::{Canvas, PICTURE_FORMAT, PICTURE_FORMAT_SRGB};
use std::collections::HashMap;
use umbriel_scene::Samples;
use wgpu::{ColorWrites, CompareFunction};

/// Pipelines that need no vertices.
pub(crate) struct Screen {
    /// Where depth is still 0.
    backgrounds: HashMap<Canvas, wgpu::RenderPipeline>,
    background_layout: wgpu::PipelineLayout,
    samples: Samples,
    /// On surfaces where the stencil is not 0.
    pub(crate) film: wgpu::RenderPipeline,
    /// Sets the stencil to its reference.
    pub(crate) fill_stencil: wgpu::RenderPipeline,
    /// Linear picture to its place: all channels, red, green and blue.
    pub(crate) exposed: [wgpu::RenderPipeline; 3],
    /// Visibility to its place.
    pub(crate) plain: [wgpu::RenderPipeline; 3],
    compose_module: wgpu::ShaderModule,
    blit_layout: wgpu::PipelineLayout,
    /// Finished pictures to windows, by the window's format.
    blits: HashMap<wgpu::TextureFormat, wgpu::RenderPipeline>,
}

/// Channels of the whole, of the left eye and of the right one.
const MASKS: [ColorWrites; 3] = [ColorWrites::ALL, ColorWrites::RED, ColorWrites::GREEN.union(ColorWrites::BLUE)];

impl Screen {
    pub(crate) fn new(device: &wgpu::Device, layouts: &Layouts, samples: Samples) -> Screen {
        let layout = |label, groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(label),
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let background_layout = layout("background", &[Some(&layouts.view), Some(&layouts.lighting)]);
        let film_layout = layout("film", &[None, Some(&layouts.film)]);
        let compose_layout = layout("compose", &[Some(&layouts.view), Some(&layouts.picture)]);
        let compose_module = shaders::module(device, "compose", shaders::COMPOSE);
        let in_shadow = wgpu::StencilFaceState { compare: CompareFunction::NotEqual, ..wgpu::StencilFaceState::IGNORE };
        let stencil = wgpu::StencilState { front: in_shadow, back: in_shadow, read_mask: 0xff, write_mask: 0 };
        let over = Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING);
        let compose = |entry, format| {
            MASKS.map(|mask| {
                pipeline(device, (&compose_layout, &compose_module), ["of_view", entry], (format, None, mask), None, &[])
            })
        };
        Screen {
            backgrounds: HashMap::new(),
            background_layout,
            samples,
            film: pipeline(
                device,
                (&film_layout, &shaders::module(device, "film", shaders::FILM)),
                ["fullscreen", "tint"],
                (LINEAR_FORMAT, over, ColorWrites::ALL),
                // Depth of the film is 0, infinitely far: it passes where there is a surface.
                Some((samples, CompareFunction::Less, stencil)),
                &[],
            ),
            fill_stencil: pipeline(
                device,
                (&film_layout, &shaders::module(device, "fill stencil", shaders::FILM)),
                ["fullscreen", "tint"],
                (LINEAR_FORMAT, None, ColorWrites::empty()),
                Some((samples, CompareFunction::Always, replacing())),
                &[],
            ),
            exposed: compose("exposed", PICTURE_FORMAT_SRGB),
            plain: compose("plain", PICTURE_FORMAT),
            compose_module,
            blit_layout: layout("blit", &[None, Some(&layouts.picture)]),
            blits: HashMap::new(),
        }
    }

    /// Makes what [`Screen::background`] gives.
    pub(crate) fn make_background(&mut self, device: &wgpu::Device, canvas: Canvas) {
        self.backgrounds.entry(canvas).or_insert_with(|| {
            pipeline(
                device,
                (&self.background_layout, &shaders::module(device, "background", &[&shaders::background()])),
                ["sky", "background"],
                (canvas.format(), None, ColorWrites::ALL),
                Some((self.samples, CompareFunction::Equal, wgpu::StencilState::default())),
                &[canvas.constant()],
            )
        });
    }

    /// The pipeline that fills what depth leaves open.
    pub(crate) fn background(&self, canvas: Canvas) -> Option<&wgpu::RenderPipeline> {
        self.backgrounds.get(&canvas)
    }

    /// The pipeline that shows finished pictures on a surface of this format.
    pub(crate) fn blit(&mut self, device: &wgpu::Device, format: wgpu::TextureFormat) -> &wgpu::RenderPipeline {
        self.blits.entry(format).or_insert_with(|| {
            let target = (format, None, ColorWrites::ALL);
            pipeline(device, (&self.blit_layout, &self.compose_module), ["whole", "plain"], target, None, &[])
        })
    }
}

fn pipeline(
    device: &wgpu::Device,
    (layout, module): (&wgpu::PipelineLayout, &wgpu::ShaderModule),
    [vertex, fragment]: [&str; 2],
    (format, blend, write_mask): (wgpu::TextureFormat, Option<wgpu::BlendState>, ColorWrites),
    over: Option<(Samples, CompareFunction, wgpu::StencilState)>,
    constants: &[(&str, f64)],
) -> wgpu::RenderPipeline {
    let count = over.as_ref().map_or(1, |(samples, ..)| samples.count());
    let compilation_options = wgpu::PipelineCompilationOptions { constants, ..Default::default() };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(fragment),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(vertex),
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: over.map(|(_, compare, stencil)| wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(false),
            depth_compare: Some(compare),
            stencil,
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState { count, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(fragment),
            compilation_options,
            targets: &[Some(wgpu::ColorTargetState { format, blend, write_mask })],
        }),
        multiview_mask: None,
        cache: None,
    })
}
