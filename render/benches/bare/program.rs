//! The bare program: the renderer's shaders and states, everything made beforehand; a frame is nothing but its commands.
//!
//! Its views lie side by side in one target, as small views do in the renderer.

use crate::bindings::{self, Batch, Instances, Layouts, LightMap};
use crate::pipelines;
use umbriel_render::Gpu;
use umbriel_scene::{Scene, View};
use wgpu::{BufferUsages, LoadOp, Operations, StoreOp, TextureFormat, TextureUsages};

pub(crate) const LINEAR: TextureFormat = TextureFormat::Rgba16Float;
pub(crate) const DEPTH: TextureFormat = TextureFormat::Depth32FloatStencil8;
pub(crate) const MAP: TextureFormat = TextureFormat::Depth32Float;
pub(crate) const PICTURE: TextureFormat = TextureFormat::Rgba8UnormSrgb;

/// What draws the shadow map of the light.
struct ShadowPass {
    pipeline: wgpu::RenderPipeline,
    view: wgpu::BindGroup,
    target: wgpu::TextureView,
}

/// One view, its place in the sheet, and the picture that it ends in.
struct Eye {
    buffer: wgpu::Buffer,
    group: wgpu::BindGroup,
    left: u32,
    size: [u32; 2],
    picture: wgpu::Texture,
    target: wgpu::TextureView,
}

pub(crate) struct Program {
    shadows: Option<ShadowPass>,
    surface: wgpu::RenderPipeline,
    background: wgpu::RenderPipeline,
    compose: wgpu::RenderPipeline,
    eyes: Vec<Eye>,
    /// Numbers of the one light, which lie in every view.
    light: Vec<f32>,
    instances: Instances,
    lighting: wgpu::BindGroup,
    sheet: wgpu::BindGroup,
    batches: Vec<Batch>,
    samples: wgpu::TextureView,
    resolved: wgpu::TextureView,
    depth: wgpu::TextureView,
}

impl Program {
    /// A program that draws one scene from some views of one size. Its one light has a map where that is set by hand.
    pub(crate) fn new(gpu: &Gpu, scene: &Scene, views: &[View]) -> Program {
        let device = &gpu.device;
        let layouts = Layouts::new(device);
        let size = views[0].size;
        let sheet_size = [size[0] * views.len() as u32, size[1]];
        let resolved = texture(device, sheet_size, LINEAR, 1, TextureUsages::TEXTURE_BINDING);
        let resolved = resolved.create_view(&Default::default());
        let target = |format| texture(device, sheet_size, format, 4, TextureUsages::empty()).create_view(&Default::default());
        let map = LightMap::new(&scene.lights[0]);
        let maps = bindings::maps_texture(device, map.as_ref());
        let (instances, batches) = bindings::batches(gpu, &layouts, scene);
        let light = bindings::light_numbers(&scene.lights[0], map.as_ref());
        let eyes = (0..).zip(views).map(|(number, view)| {
            let left = number * size[0];
            let picture = texture(device, size, PICTURE, 1, TextureUsages::COPY_SRC);
            let (buffer, group) = bindings::view_group(device, &layouts, &bindings::view_numbers(view, left, &light));
            Eye { buffer, group, left, size, target: picture.create_view(&Default::default()), picture }
        });
        Program {
            eyes: eyes.collect(),
            light,
            shadows: map.as_ref().map(|map| ShadowPass {
                pipeline: pipelines::maps(device, &layouts),
                view: bindings::map_view(device, &layouts, map),
                target: bindings::layer(&maps, 0),
            }),
            surface: pipelines::surface(device, &layouts, map.is_some()),
            background: pipelines::background(device, &layouts),
            compose: pipelines::compose(device, &layouts),
            lighting: bindings::lighting(device, &layouts, scene, map.as_ref(), &maps),
            instances,
            sheet: bindings::group(device, &layouts.picture, &[wgpu::BindingResource::TextureView(&resolved)]),
            batches,
            samples: target(LINEAR),
            depth: target(DEPTH),
            resolved,
        }
    }

    /// Sends views that take the place of those before.
    pub(crate) fn look(&self, gpu: &Gpu, views: &[View]) {
        for (eye, view) in self.eyes.iter().zip(views) {
            gpu.queue.write_buffer(&eye.buffer, 0, bytemuck::cast_slice(&bindings::view_numbers(view, eye.left, &self.light)));
        }
    }

    /// Sends all places where some drawables moved.
    pub(crate) fn place(&mut self, gpu: &Gpu, scene: &Scene, moved: &[usize]) {
        let Instances { buffer, places, numbers, .. } = &mut self.instances;
        for &index in moved {
            numbers[places[index]] = bindings::instance(&scene.drawables[index].world_from_object);
        }
        if !moved.is_empty() {
            gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(numbers.as_flattened()));
        }
    }

    /// Draws a frame, with the shadow map if `draws_map`.
    pub(crate) fn frame(&self, gpu: &Gpu, draws_map: bool) {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        if let Some(shadows) = self.shadows.as_ref().filter(|_| draws_map) {
            self.shadow_pass(&mut encoder, shadows);
        }
        self.surfaces(&mut encoder);
        for eye in &self.eyes {
            self.compose(&mut encoder, eye);
        }
        gpu.queue.submit([encoder.finish()]);
    }

    fn shadow_pass(&self, encoder: &mut wgpu::CommandEncoder, shadows: &ShadowPass) {
        let depth_ops = Some(Operations { load: LoadOp::Clear(0.0), store: StoreOp::Store });
        let view = &shadows.target;
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment { view, depth_ops, stencil_ops: None }),
            ..Default::default()
        });
        pass.set_pipeline(&shadows.pipeline);
        pass.set_bind_group(0, &shadows.view, &[]);
        self.draw(&mut pass);
    }

    fn surfaces(&self, encoder: &mut wgpu::CommandEncoder) {
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
        pass.set_bind_group(3, &self.lighting, &[]);
        for eye in &self.eyes {
            let [width, height] = eye.size;
            pass.set_viewport(eye.left as f32, 0.0, width as f32, height as f32, 0.0, 1.0);
            pass.set_scissor_rect(eye.left, 0, width, height);
            pass.set_bind_group(0, &eye.group, &[]);
            pass.set_pipeline(&self.surface);
            self.draw(&mut pass);
            pass.set_pipeline(&self.background);
            pass.draw(0..3, 0..1);
        }
    }

    fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_bind_group(1, &self.instances.group, &[]);
        pass.set_vertex_buffer(3, self.instances.visible.slice(..));
        for batch in &self.batches {
            for (slot, buffer) in (0..).zip(&batch.buffers) {
                pass.set_vertex_buffer(slot, buffer.slice(..));
            }
            pass.set_index_buffer(batch.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.set_bind_group(2, &batch.material, &[]);
            pass.draw_indexed(0..batch.index_count, 0, batch.instances.clone());
        }
    }

    fn compose(&self, encoder: &mut wgpu::CommandEncoder, eye: &Eye) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &eye.target,
                depth_slice: None,
                resolve_target: None,
                ops: Operations { load: LoadOp::Clear(wgpu::Color::BLACK), store: StoreOp::Store },
            })],
            ..Default::default()
        });
        pass.set_pipeline(&self.compose);
        pass.set_bind_group(0, &eye.group, &[]);
        pass.set_bind_group(1, &self.sheet, &[]);
        pass.draw(0..3, 0..1);
    }

    /// RGBA of each view's picture. Their width must make rows of a multiple of 256 bytes.
    pub(crate) fn pixels(&self, gpu: &Gpu) -> Vec<Vec<u8>> {
        let read = |eye: &Eye| {
            let [width, height] = eye.size;
            let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: u64::from(width * height * 4),
                usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
                mapped_at_creation: false,
            });
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width * 4), rows_per_image: None };
            let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
            encoder.copy_texture_to_buffer(eye.picture.as_image_copy(), to, eye.picture.size());
            gpu.queue.submit([encoder.finish()]);
            buffer.map_async(wgpu::MapMode::Read, .., |_| ());
            gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
            buffer.get_mapped_range(..).expect("mapped").to_vec()
        };
        self.eyes.iter().map(read).collect()
    }
}

fn texture(
    device: &wgpu::Device,
    [width, height]: [u32; 2],
    format: TextureFormat,
    sample_count: u32,
    usage: TextureUsages,
) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: TextureUsages::RENDER_ATTACHMENT | usage,
        view_formats: &[],
    })
}
