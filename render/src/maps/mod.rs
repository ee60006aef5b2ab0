//! Shadow maps: once per frame, shared by all views.

mod atlas;
mod cascades;
mod fit;
mod keep;
mod picture;
mod pipeline;

use crate::clock::Clock;
use crate::draws::{Caster, Draw, Draws, Kind};
use crate::layouts::Layouts;
use crate::lights::shines;
use crate::slots::Slots;
use crate::uniforms;
use crate::{cull::Planes, shaders};
pub(crate) use cascades::Eye;
use fit::Projection;
use keep::{Record, Snapshot};
use std::collections::HashMap;
use std::sync::Arc;
use umbriel_scene::{Aabb, LightKind, Scene, ShadowMethod};

const MAP_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Texture memory for all maps; beyond it sizes are halved, with a report.
const MEMORY_BYTES: u64 = 2 << 30;

/// One map of one light.
pub(crate) struct Face {
    pub(crate) light: usize,
    pub(crate) projection: Projection,
    size: u32,
    place: atlas::Place,
    slot: usize,
    draws: Vec<Draw>,
    /// Has to be drawn in this frame.
    is_stale: bool,
}

/// The maps of the frame, and what draws them.
pub(crate) struct Maps {
    pub(crate) faces: Vec<Face>,
    records: Vec<Record>,
    pub(crate) whole: wgpu::TextureView,
    pub(crate) texture: wgpu::Texture,
    layers: Vec<wgpu::TextureView>,
    pub(crate) sampler: wgpu::Sampler,
    module: wgpu::ShaderModule,
    layout: wgpu::PipelineLayout,
    pipelines: HashMap<(u8, bool), wgpu::RenderPipeline>,
    empty: wgpu::RenderPipeline,
}

/// What maps are fitted to.
pub(crate) struct Surroundings {
    pub(crate) eyes: Vec<Eye>,
    /// Box around what receives and some view sees.
    pub(crate) receivers: Aabb,
    /// Box around what casts.
    pub(crate) casters: Aabb,
}

impl Maps {
    pub(crate) fn new(device: &wgpu::Device, layouts: &Layouts) -> Maps {
        let module = shaders::module(device, "maps", shaders::MAPS);
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("maps"),
            bind_group_layouts: &[Some(&layouts.view), Some(&layouts.instances), Some(&layouts.material)],
            immediate_size: 0,
        });
        let (texture, whole, layers) = make_texture(device, 1, 1);
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor { label: Some("maps"), ..Default::default() });
        let empty = pipeline::emptying(device, &module);
        Maps {
            faces: Vec::new(),
            records: Vec::new(),
            whole,
            texture,
            layers,
            sampler,
            module,
            layout,
            pipelines: HashMap::new(),
            empty,
        }
    }

    /// Chooses the maps of the frame. True where the texture is a
    /// new one, which bind groups must learn.
    pub(crate) fn choose(
        &mut self,
        device: &wgpu::Device,
        scene: &Scene,
        around: &Surroundings,
        casters: Vec<Caster>,
        mut report: impl FnMut(String),
    ) -> bool {
        self.faces.clear();
        let limit = device.limits().max_texture_dimension_2d;
        let mapped: Vec<usize> = (0..scene.lights.len())
            .filter(|i| scene.lights[*i].shadows == ShadowMethod::Map && shines(&scene.lights[*i]))
            .collect();
        if mapped.is_empty() {
            self.records.clear();
            return false;
        }
        let mut lights = Vec::new();
        for &index in &mapped {
            let light = &scene.lights[index];
            let size = light.map.size.clamp(1, limit);
            if size != light.map.size {
                report(format!("light '{}': shadow map size {}: using {size}", light.name, light.map.size));
            }
            let fits = match light.kind {
                LightKind::Directional => cascades::cascades(light, size, &around.eyes, around.receivers, around.casters),
                LightKind::Spot { .. } => fit::spot(light, size),
                LightKind::Point => fit::point(light, size),
            };
            lights.push((index, size, fits));
        }
        let sides: Vec<u32> = lights.iter().flat_map(|(_, size, fits)| fits.iter().map(|_| *size)).collect();
        let (sides, is_new) = self.make_room(device, sides, report);
        let (_, _, places) = atlas::pack(&sides);
        let snapshot = Arc::new(Snapshot { casters, radius: around.casters.radius() });
        let old = std::mem::take(&mut self.records);
        let mut tiles = sides.into_iter().zip(places);
        for (number, (index, size, wanted)) in lights.into_iter().enumerate() {
            let light = &scene.lights[index];
            let tiles: Vec<(u32, atlas::Place)> = tiles.by_ref().take(wanted.len()).collect();
            let record = old.get(number).filter(|r| !is_new && r.tiles == tiles);
            let kept = record.and_then(|r| {
                let new_from_old = keep::motion(&r.snapshot, &snapshot)?;
                r.kept(light, &wanted, new_from_old)
            });
            let is_stale = kept.is_none();
            let fits = kept.unwrap_or(wanted);
            for (fit, (tile, place)) in fits.iter().zip(&tiles) {
                let mut projection = fit.projection;
                projection.texel *= size as f32 / *tile as f32;
                let draws = Vec::new();
                self.faces.push(Face { light: index, projection, size: *tile, place: *place, slot: 0, draws, is_stale });
            }
            // A kept map stays as old as it is: deviations do not add up.
            self.records.push(match record.filter(|_| !is_stale) {
                Some(r) => Record { light: r.light.clone(), snapshot: r.snapshot.clone(), fits: r.fits.clone(), tiles },
                None => Record { light: light.clone(), snapshot: snapshot.clone(), fits, tiles },
            });
        }
        is_new
    }

    /// Makes the texture as large as squares of these sides need. Gives the sides that memory allows, and whether the
    /// texture is a new one.
    fn make_room(&mut self, device: &wgpu::Device, mut sides: Vec<u32>, mut report: impl FnMut(String)) -> (Vec<u32>, bool) {
        let bytes = |sides: &[u32]| {
            let (side, layers, _) = atlas::pack(sides);
            4 * u64::from(side) * u64::from(side) * u64::from(layers)
        };
        while bytes(&sides) > MEMORY_BYTES {
            sides.iter_mut().for_each(|s| *s = (*s / 2).max(1));
            report(format!("shadow maps need more than {} MiB: halving their sizes", MEMORY_BYTES >> 20));
        }
        let (side, layers, _) = atlas::pack(&sides);
        let now = self.texture.size();
        let is_new = (now.width, now.depth_or_array_layers) != (side, layers.max(2));
        if is_new {
            (self.texture, self.whole, self.layers) = make_texture(device, side, layers);
        }
        (sides, is_new)
    }

    /// Finds the casters of every map and the pipelines that they need.
    pub(crate) fn prepare(&mut self, device: &wgpu::Device, slots: &mut Slots<uniforms::View>, draws: &mut Draws) {
        for face in &mut self.faces {
            let map_from_world = face.projection.map_from_world;
            if !face.is_stale {
                continue;
            }
            face.slot = slots.push(&view_of(&face.projection));
            let planes = Planes::new(&map_from_world);
            face.draws = draws.cull(&planes, |_, casts, _| casts).0;
            for draw in &face.draws {
                let key = pipeline::key_of(&draws.batches[draw.batch as usize].kind);
                self.pipelines.entry(key).or_insert_with(|| pipeline::of_kind(device, &self.module, &self.layout, key));
            }
        }
    }

    /// The faces for the shaders.
    pub(crate) fn uniforms(&self) -> Vec<uniforms::MapFace> {
        let of = |face: &Face| uniforms::MapFace {
            map_from_world: face.projection.map_from_world.to_cols_array_2d(),
            world_from_map: face.projection.map_from_world.inverse().to_cols_array_2d(),
            tile: [face.place[0], face.place[1], face.size, face.place[2]],
            light: face.projection.eye.to_array(),
            texel: face.projection.texel,
            spare: [0.0; 3],
        };
        self.faces.iter().map(of).collect()
    }

    /// Faces of one light: first and count.
    pub(crate) fn faces_of(&self, light: usize) -> (u32, u32) {
        let first = self.faces.iter().position(|f| f.light == light).unwrap_or(0);
        (first as u32, self.faces.iter().filter(|f| f.light == light).count() as u32)
    }

    /// Draws every map: one pass per layer, one viewport per map. Gives the number of maps drawn.
    pub(crate) fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        clock: &Clock,
        slots: &Slots<uniforms::View>,
        mut draw: impl FnMut(&mut wgpu::RenderPass<'_>, &[Draw]),
    ) -> u32 {
        let mut redrawn = 0;
        for (layer, view) in (0u32..).zip(&self.layers) {
            let faces: Vec<&Face> = self.faces.iter().filter(|f| f.is_stale && f.place[2] == layer).collect();
            if faces.is_empty() {
                continue;
            }
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("shadow maps"),
                timestamp_writes: clock.render("shadow maps"),
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view,
                    depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store }),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            for face in faces {
                redrawn += 1;
                let [x, y, _] = face.place;
                pass.set_viewport(x as f32, y as f32, face.size as f32, face.size as f32, 0.0, 1.0);
                pass.set_bind_group(0, slots.group(face.slot), &[]);
                pass.set_pipeline(&self.empty);
                pass.draw(0..3, 0..1);
                draw(&mut pass, &face.draws);
            }
        }
        redrawn
    }

    /// Sets the pipeline of a kind of caster.
    pub(crate) fn set_pipeline(&self, pass: &mut wgpu::RenderPass<'_>, kind: &Kind) {
        if let Some(pipeline) = self.pipelines.get(&pipeline::key_of(kind)) {
            pass.set_pipeline(pipeline);
        }
    }
}

fn view_of(projection: &Projection) -> uniforms::View {
    let mut view: uniforms::View = bytemuck::Zeroable::zeroed();
    view.clip_from_world = projection.map_from_world.to_cols_array_2d();
    view.world_from_clip = projection.map_from_world.inverse().to_cols_array_2d();
    view.view_from_world = view.clip_from_world;
    view.eye_in_world = projection.eye.to_array();
    view
}

fn make_texture(device: &wgpu::Device, side: u32, layers: u32) -> (wgpu::Texture, wgpu::TextureView, Vec<wgpu::TextureView>) {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("shadow maps"),
        // Two layers at least: some back ends take a single layer for no array.
        size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers.max(2) },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: MAP_FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let dimension = Some(wgpu::TextureViewDimension::D2Array);
    let whole = texture.create_view(&wgpu::TextureViewDescriptor { dimension, ..Default::default() });
    let layer = |i| {
        texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2),
            base_array_layer: i,
            array_layer_count: Some(1),
            ..Default::default()
        })
    };
    let layers = (0..layers).map(layer).collect();
    (texture, whole, layers)
}
