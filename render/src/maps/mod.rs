//! Shadow maps: once per frame, shared by all views.

mod atlas;
mod cascades;
mod fit;
mod keep;
mod picture;
mod pipeline;
mod share;

use crate::clock::Clock;
use crate::draws::{Draw, Draws, Kind, Snapshot};
use crate::layouts::Layouts;
use crate::lights::maps_holes_only;
use crate::record::Reads;
use crate::shaders;
use crate::slots::Slots;
use crate::stats::MapShare;
use crate::uniforms;
pub(crate) use cascades::Eye;
pub(crate) use fit::projector;
use fit::{Fit, Projection};
use glam::Mat4;
use keep::{Held, Motion};
use share::Demand;
use std::collections::HashMap;
use std::sync::Arc;
use umbriel_scene::{Aabb, Light, LightKind, MapUpdate, Scene};

const MAP_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// One map of one light.
pub(crate) struct Face {
    pub(crate) light: usize,
    pub(crate) projection: Projection,
    size: u32,
    place: atlas::Place,
    slot: usize,
    draws: Arc<[Draw]>,
    /// Has to be drawn in this frame.
    is_stale: bool,
    holes_only: bool,
    /// Nothing casts into it: nobody asked for it yet.
    is_empty: bool,
}

/// The maps of the frame, and what draws them.
pub(crate) struct Maps {
    pub(crate) faces: Vec<Face>,
    /// What every light got in this frame.
    pub(crate) shares: Vec<MapShare>,
    /// Maps in the texture, by place of their light in the scene.
    held: HashMap<usize, Vec<Held>>,
    /// Importance of each light.
    levels: HashMap<usize, i32>,
    /// What was asked for last, with how much memory, and the sides that came of it.
    room: (Vec<Demand>, u64, Vec<u32>),
    pub(crate) whole: wgpu::TextureView,
    pub(crate) texture: wgpu::Texture,
    layers: Vec<wgpu::TextureView>,
    pub(crate) sampler: wgpu::Sampler,
    module: wgpu::ShaderModule,
    layouts: [wgpu::PipelineLayout; 2],
    pipelines: HashMap<(u8, bool), wgpu::RenderPipeline>,
    empty: wgpu::RenderPipeline,
}

/// The maps that a light asks for.
struct Wanted {
    /// Place of the light in the scene.
    index: usize,
    /// Its maps stay as they were drawn.
    is_frozen: bool,
    fits: Vec<Fit>,
    demand: Demand,
}

/// What maps are fitted to.
#[derive(Default)]
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
        let layouts = pipeline::layouts(device, layouts);
        let (texture, whole, layers) = make_texture(device, 1, 1);
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor { label: Some("maps"), ..Default::default() });
        let empty = pipeline::emptying(device, &module);
        Maps {
            faces: Vec::new(),
            shares: Vec::new(),
            held: HashMap::new(),
            levels: HashMap::new(),
            room: (Vec::new(), 0, Vec::new()),
            whole,
            texture,
            layers,
            sampler,
            module,
            layouts,
            pipelines: HashMap::new(),
            empty,
        }
    }

    /// No light has maps.
    pub(crate) fn forget(&mut self) {
        self.faces.clear();
        self.shares.clear();
        self.levels.clear();
        self.held.clear();
    }

    /// Chooses the maps of the frame, for those `lights` of the scene that have some. True where the texture is a new one, which bind groups must learn.
    pub(crate) fn choose(
        &mut self,
        device: &wgpu::Device,
        (scene, lights): (&Scene, &[usize]),
        around: &Surroundings,
        snapshots: &[Arc<Snapshot>; 2],
        mut report: impl FnMut(String),
    ) -> bool {
        self.faces.clear();
        self.shares.clear();
        let limit = device.limits().max_texture_dimension_2d;
        let mut wanted: Vec<Wanted> = Vec::new();
        for &index in lights {
            let light = &ranged(&scene.lights[index], around.casters);
            let size = light.map.size.clamp(1, limit);
            if size != light.map.size {
                report(format!("light '{}': shadow map size {}: using {size}", light.name, light.map.size));
            }
            let fits = fits_of(light, size, around);
            let held = self.held.get(&index).filter(|h| !h.is_empty() && light.map.update == MapUpdate::Never);
            let is_same_kind = |h: &Held| std::mem::discriminant(&h.light.kind) == std::mem::discriminant(&light.kind);
            let is_same_set = |h: &Held| maps_holes_only(&h.light) == maps_holes_only(light);
            let held =
                held.filter(|h| h.iter().all(|h| is_same_kind(h) && is_same_set(h) && h.light.map.request == light.map.request));
            let is_frozen = held.is_some_and(|h| light.kind == LightKind::Directional || h.len() == fits.len());
            let faces = held.filter(|_| is_frozen).map_or(fits.len(), Vec::len);
            let level = share::level(light, &around.eyes, self.levels.get(&index).copied());
            wanted.push(Wanted { index, is_frozen, fits, demand: Demand { size, faces, level } });
        }
        self.levels = wanted.iter().map(|w| (w.index, w.demand.level)).collect();
        let (tiles, is_new) = self.make_room(device, &wanted, scene.map_memory_bytes);
        let mut motions: HashMap<[*const Snapshot; 2], Motion> = HashMap::new();
        let mut old = std::mem::take(&mut self.held);
        for (wanted, tiles) in wanted.into_iter().zip(tiles) {
            let light = &ranged(&scene.lights[wanted.index], around.casters);
            let snapshot = &snapshots[usize::from(maps_holes_only(light))];
            let old = old.remove(&wanted.index).unwrap_or_default();
            for held in &old {
                let motion = || keep::motion(&held.snapshot, snapshot);
                motions.entry([&held.snapshot, snapshot].map(Arc::as_ptr)).or_insert_with(motion);
            }
            let mut held = self.faces_of_light(light, &wanted, &tiles, &old, &motions, snapshot, around);
            if is_new {
                self.faces.iter_mut().filter(|f| f.light == wanted.index).for_each(|f| f.is_stale = true);
                held.iter_mut().for_each(|h| h.snapshot = snapshot.clone());
            }
            let faces = self.faces.iter().filter(|f| f.light == wanted.index);
            self.shares.push(MapShare {
                light: light.name.clone(),
                maps: held.len() as u32,
                redrawn: faces.filter(|f| f.is_stale).count() as u32,
                asked: wanted.demand.size,
                side: tiles.first().map_or(0, |t| t.0),
            });
            self.held.insert(wanted.index, held);
        }
        is_new
    }

    /// Which of a light's maps are kept and which are drawn anew.
    #[allow(clippy::too_many_arguments, reason = "a light's maps before and now, and what moved")]
    fn faces_of_light(
        &mut self,
        light: &Light,
        wanted: &Wanted,
        tiles: &[(u32, atlas::Place)],
        old: &[Held],
        motions: &HashMap<[*const Snapshot; 2], Motion>,
        snapshot: &Arc<Snapshot>,
        around: &Surroundings,
    ) -> Vec<Held> {
        let side = tiles.first().map_or(wanted.demand.size, |t| t.0);
        let smaller = (side != wanted.demand.size).then(|| fits_of(light, side, around));
        let fits = smaller.filter(|f| f.len() == wanted.fits.len()).unwrap_or_else(|| wanted.fits.clone());
        let motion_of = |held: &Held| &motions[&[&held.snapshot, snapshot].map(Arc::as_ptr)];
        let is_same_set = old.len() == fits.len();
        let carry = |(held, fit): (&Held, &Fit)| held.carried(light, fit, &motion_of(held).new_from_old);
        let mut carried: Vec<Option<Fit>> = old.iter().zip(&fits).map(carry).collect();
        if !is_same_set || light.kind != LightKind::Directional && carried.iter().any(Option::is_none) {
            // The six maps of a cube are one: their axes stay together.
            carried.iter_mut().for_each(|c| *c = None);
        }
        let now = Arc::new(light.clone());
        let mut all = Vec::new();
        for (number, tile) in tiles.iter().enumerate() {
            let held = old.get(number);
            let carried = carried.get(number).cloned().flatten();
            let lies_here = held.is_some_and(|h| h.tile == *tile);
            let (fit, is_stale) = match (held, carried) {
                (Some(held), carried) if wanted.is_frozen => {
                    // Parallel light has no place that tells how it turned with the world; its casters do.
                    let new_from_old = if held.light_stands(light) { Mat4::IDENTITY } else { motion_of(held).new_from_old };
                    let frozen = || Fit { projection: held.fit.projection.carried(&new_from_old), needed: None };
                    let from_light = || if held.fit.projection.eye.w > 0.5 { held.with_light(light) } else { frozen() };
                    (carried.unwrap_or_else(from_light), !lies_here)
                }
                (Some(held), Some(fit)) => {
                    let is_asked = matches!(light.map.update, MapUpdate::Always | MapUpdate::Next)
                        || held.light.map.request != light.map.request;
                    let is_stale = is_asked || !lies_here || Held::is_reached(&fit, &motion_of(held).strays);
                    (fit, is_stale)
                }
                _ => (fits[number].clone(), true),
            };
            let (projection, place) = (fit.projection, tile.1);
            let waits = light.map.update == MapUpdate::Never && light.map.request == Some(0);
            // One that takes the place of the light's own map was not asked for either.
            let is_empty = waits && held.is_none_or(|h| h.is_empty || h.light.map.request.is_none());
            let (index, draws) = (wanted.index, Arc::default());
            let holes_only = maps_holes_only(light);
            self.faces.push(Face {
                light: index,
                projection,
                size: tile.0,
                place,
                slot: 0,
                draws,
                is_stale,
                holes_only,
                is_empty,
            });
            all.push(match held.filter(|_| !is_stale) {
                // A map that moved along stays as old as it is: deviations do not add up.
                Some(held) if motion_of(held).is_exact && !wanted.is_frozen => {
                    Held { snapshot: snapshot.clone(), ..held.clone() }
                }
                Some(held) => held.clone(),
                None => Held { fit, tile: *tile, light: now.clone(), snapshot: snapshot.clone(), is_empty },
            });
        }
        all
    }

    /// Places for the maps of every light, in a texture that is as large as they need and memory allows. Maps stay where they
    /// lie, as long as the texture is not twice as large as it must be. True where it is a new one.
    fn make_room(
        &mut self,
        device: &wgpu::Device,
        wanted: &[Wanted],
        memory_bytes: u64,
    ) -> (Vec<Vec<(u32, atlas::Place)>>, bool) {
        let most_layers = device.limits().max_texture_array_layers;
        let demands: Vec<Demand> = wanted.iter().map(|w| w.demand).collect();
        if self.room.0 != demands || self.room.1 != memory_bytes {
            let sides = share::sides(&demands, memory_bytes, most_layers);
            self.room = (demands, memory_bytes, sides);
        }
        let (_, _, sides) = &self.room;
        let faces = || wanted.iter().zip(sides).flat_map(|(w, side)| (0..w.demand.faces).map(move |i| (w.index, i, *side)));
        let all: Vec<u32> = faces().map(|(_, _, side)| side).collect();
        let lies = |(light, i, side): (usize, usize, u32)| {
            let held = self.held.get(&light).and_then(|held| held.get(i))?;
            (held.tile.0 == side).then_some(held.tile.1)
        };
        let lying: Vec<Option<atlas::Place>> = faces().map(lies).collect();
        let (mut side, mut layers, mut places) = atlas::pack(&all);
        let now = self.texture.size();
        if now.width >= side {
            let (layers_around, places_around) = atlas::pack_around(now.width, &all, &lying);
            let layers_around = layers_around.max(now.depth_or_array_layers);
            let bytes = atlas::bytes(now.width, layers_around);
            if layers_around <= most_layers && bytes <= memory_bytes && bytes <= 2 * atlas::bytes(side, layers) {
                (side, layers, places) = (now.width, layers_around, places_around);
            }
        }
        let is_new = (now.width, now.depth_or_array_layers) != (side, layers.max(2));
        if is_new {
            (self.texture, self.whole, self.layers) = make_texture(device, side, layers);
        }
        let mut tiles = all.into_iter().zip(places);
        (wanted.iter().map(|w| tiles.by_ref().take(w.demand.faces).collect()).collect(), is_new)
    }

    /// Finds the casters of every map and the pipelines that they need.
    pub(crate) fn prepare(&mut self, device: &wgpu::Device, slots: &mut Slots<uniforms::View>, draws: &mut Draws) {
        for face in &mut self.faces {
            let map_from_world = face.projection.map_from_world;
            if !face.is_stale {
                continue;
            }
            face.slot = slots.push(&view_of(&face.projection));
            if face.is_empty {
                continue;
            }
            face.draws = draws.casters(&map_from_world, face.holes_only).draws;
            for draw in &*face.draws {
                let key = pipeline::key_of(&draws.batches()[draw.batch as usize].kind);
                self.pipelines.entry(key).or_insert_with(|| pipeline::of_kind(device, &self.module, &self.layouts, key));
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
            spare: 0.0,
            depth: face.projection.depth,
        };
        self.faces.iter().map(of).collect()
    }

    /// Near and far distance of the maps of a light with a position, metres; both are finite.
    pub(crate) fn range_of(&self, light: usize) -> [f32; 2] {
        let Some(face) = self.faces.iter().find(|f| f.light == light) else { return [0.0, 1.0] };
        let [offset, scale] = face.projection.depth;
        [offset / (1.0 + scale), offset / scale.max(1e-9)]
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

    /// Sets the pipeline of a kind of caster, and tells what it reads.
    pub(crate) fn set_pipeline(&self, pass: &mut wgpu::RenderPass<'_>, kind: &Kind) -> Reads {
        if let Some(pipeline) = self.pipelines.get(&pipeline::key_of(kind)) {
            pass.set_pipeline(pipeline);
        }
        pipeline::reads(kind)
    }
}

fn fits_of(light: &Light, size: u32, around: &Surroundings) -> Vec<Fit> {
    match light.kind {
        LightKind::Directional if !light.shines => fit::whole(light, size, around.casters),
        LightKind::Directional => cascades::cascades(light, size, &around.eyes, around.receivers, around.casters),
        LightKind::Spot { .. } => fit::spot(light, size),
        LightKind::Point => fit::point(light, size),
    }
}

/// A texture of a map shows grey between distances that are known: those of a light that only draws a map are fitted.
fn ranged(light: &Light, casters: Aabb) -> Light {
    let mut light = light.clone();
    if !light.shines && !casters.is_empty() {
        light.map.near_far = Some(fit::range(&light, casters));
    }
    light
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
    let layers = (0..layers.max(2)).map(layer).collect();
    (texture, whole, layers)
}
