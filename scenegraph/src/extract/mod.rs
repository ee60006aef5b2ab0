//! Keeps a flat scene up to date from the revisions of the graph.
//!
//! The graph is compiled into one list: an entry for every path from the world to a node, parents before children, each
//! sub-tree one contiguous run. A changed transform recomputes its run; a changed resource rewrites its shapes; only
//! changed `children` compile the list anew. Everything is extracted in ROOM space: the displays stand still and the
//! world moves (000 section 4.1), lights included.

mod contours;
mod dirty;
mod drawable;
pub(crate) mod files;
mod instance;
mod layer;
mod light;
mod map_settings;
mod material;
mod mesh;
mod problem;
mod projection;
mod read;
mod reducer;
mod role;
mod room;
mod shader;
mod shape;
mod skin;
mod stand_in;
mod stencil;
mod sweep;
mod texture;

#[cfg(test)]
mod tests;

pub use map_settings::wants_map_once;
pub use problem::Problem;
pub use room::Viewpoint;
pub(crate) use texture::decode;

use dirty::Dirty;
use drawable::Slots;
use glam::Vec3;
use instance::{Instances, compile, local_matrix, switch_choice};
use light::{LightEntry, place_light, read_light};
use material::Materials;
use mesh::Meshes;
use problem::Problems;
use projection::Projections;
use role::{Role, Types};
use room::{Globals, Room, read_environment, read_head, read_room, read_viewpoints};
use shader::Shaders;
use shape::{Resources, Shapes};
use skin::Bindings;
use slotmap::SecondaryMap;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use sweep::{Touched, lod_choice, sweep};
use texture::Pictures;
use umbriel_fields::{Graph, NodeId, Revision};
use umbriel_scene::{MapUpdate, Scene, StencilGroup};

/// Most places in the world, so that nodes which share children cannot multiply without end.
const MAX_PLACES: usize = 1_000_000;

/// What an update did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExtractStats {
    /// Places visited and nodes read anew.
    pub nodes_touched: usize,
    /// Drawables written.
    pub drawables_changed: usize,
    /// Lights written.
    pub lights_changed: usize,
    /// The list was compiled anew, because branches of the tree changed.
    pub rebuilt: bool,
}

/// Follows one graph and keeps one scene.
pub struct Extractor {
    last: Option<Revision>,
    limit: usize,
    types: Types,
    /// Every living node and the place of its type.
    known: SecondaryMap<NodeId, u16>,
    globals: Globals,
    world: Option<NodeId>,
    room: Room,
    head: Vec3,
    instances: Instances,
    shapes: Shapes,
    bindings: Bindings,
    slots: Slots,
    lights: Vec<LightEntry>,
    lods: Vec<u32>,
    groups: Vec<u32>,
    contours: Vec<u32>,
    viewpoint_places: Vec<u32>,
    viewpoints: Vec<Viewpoint>,
    resources: Resources,
    /// Shapes to read anew, although no field of theirs was written.
    reread: Vec<NodeId>,
}

impl Default for Extractor {
    fn default() -> Extractor {
        Extractor::new()
    }
}

impl Extractor {
    /// An extractor whose pictures lie below the current folder.
    pub fn new() -> Extractor {
        let resources = Resources {
            meshes: Meshes::default(),
            materials: Materials::new(),
            pictures: Pictures::new(PathBuf::from(".")),
            shaders: Shaders::default(),
            projections: Projections::default(),
            problems: Problems::default(),
            reducer: Default::default(),
            unseen: Default::default(),
        };
        Extractor {
            last: None,
            limit: MAX_PLACES,
            types: Types::default(),
            known: SecondaryMap::new(),
            globals: Globals::default(),
            world: None,
            room: Room::default(),
            head: Vec3::ZERO,
            instances: Instances::default(),
            shapes: Shapes::default(),
            bindings: Bindings::default(),
            slots: Slots::default(),
            lights: Vec::new(),
            lods: Vec::new(),
            groups: Vec::new(),
            contours: Vec::new(),
            viewpoint_places: Vec::new(),
            viewpoints: Vec::new(),
            resources,
            reread: Vec::new(),
        }
    }

    /// Files that nodes name (pictures, shaders) lie below this folder; no other file is read.
    pub fn with_asset_root(mut self, folder: impl Into<PathBuf>) -> Extractor {
        self.resources.pictures.asset_root = folder.into();
        self
    }

    /// Reduced casters are made before the frame that wants them, however long that takes; otherwise they come when a thread
    /// has made them, and shapes cast themselves until then.
    pub fn with_ready_casters(mut self) -> Extractor {
        self.resources.reducer.waits = true;
        self
    }

    /// At most so many places in the world; a graph of shared nodes may have more paths than memory. 1 000 000 at first.
    pub fn with_place_limit(mut self, places: usize) -> Extractor {
        self.limit = places;
        self
    }

    /// Brings the scene up to date with all writes to the graph since the last update. Call it after `evaluate`, always
    /// with the same graph and the same scene.
    pub fn update(&mut self, graph: &Graph, scene: &mut Scene) -> ExtractStats {
        let mut dirty = self.gather(graph);
        dirty.shapes.extend(self.reread.drain(..));
        if self.resources.reducer.poll() {
            dirty.shapes.extend(&self.shapes.with_caster);
        }
        if scene.drawables.len() != self.slots.places.len() + scene.stand_ins.len() {
            dirty.everything();
        }
        if dirty.is_empty() {
            return ExtractStats::default();
        }
        let mut stats = ExtractStats { rebuilt: dirty.structure, ..ExtractStats::default() };
        self.update_room(graph, &mut dirty);
        if dirty.structure {
            scene.drawables.truncate(self.slots.places.len());
            self.recompile(graph, scene, &mut dirty);
        }
        self.refresh_shapes(graph, &mut dirty, &mut stats);
        let touched = self.move_places(graph, &mut dirty, &mut stats);
        let mut casting = self.write_drawables(scene, touched.shapes, &mut stats);
        casting |=
            stand_in::place(scene, self.slots.places.len(), &self.instances, &self.shapes, self.head, &self.resources.unseen);
        let relisted = self.update_lights(graph, scene, &dirty, &touched.lights, &mut stats);
        self.update_projections(graph, scene);
        if dirty.structure || dirty.stencils || touched.groups || relisted || casting {
            scene.stencil_groups = self.stencil_groups(graph, scene);
        }
        if dirty.structure || dirty.contours {
            contours::read(graph, &self.instances, &self.contours, scene);
        }
        if touched.viewpoints || dirty.viewpoints {
            self.viewpoints = read_viewpoints(graph, &self.instances, &self.viewpoint_places, &self.room);
        }
        if dirty.environment {
            scene.world_from_room = self.room.world_from_room;
            read_environment(graph, &self.globals, &self.room, &mut self.resources.problems, scene);
        }
        stats
    }

    /// Problems found since this was last called, each once until it is mended and comes back.
    pub fn problems(&mut self) -> Vec<Problem> {
        self.resources.problems.drain()
    }

    /// The files of shaders that were read, or could not be.
    pub fn shader_files(&self) -> impl Iterator<Item = &Path> {
        self.resources.shaders.files()
    }

    /// Files changed: shaders among them are read again at the next update. True if any of them was one.
    pub fn forget_shaders(&mut self, files: &[PathBuf]) -> bool {
        let forgotten = self.resources.shaders.forget(files);
        if forgotten {
            self.resources.materials.forget_shaders();
            self.reread.extend(self.shapes.states.keys());
        }
        forgotten
    }

    /// The place of a light node in [`Scene::lights`]; None if it is off, hidden or no light of the world.
    pub fn light_of(&self, node: NodeId) -> Option<usize> {
        light_slot(&self.instances, &self.lights, node)
    }

    /// Light nodes whose map was asked for in this frame only. Before the next one their `shadow_update` falls back to
    /// none (003 section 4.1), which is up to whoever may write to the graph.
    pub fn maps_drawn_once(&self) -> Vec<NodeId> {
        let once = |light: &LightEntry| light.placed.as_ref().is_some_and(|l| l.map.update == MapUpdate::Next);
        let lights = self.instances.list.iter().filter(|i| i.role == Role::Light);
        lights.zip(&self.lights).filter(|(_, light)| once(light)).map(|(instance, _)| instance.node).collect()
    }

    /// The places in [`Scene::drawables`] of all shapes at and below a node, in tree order.
    pub fn drawables_of(&self, node: NodeId) -> Vec<usize> {
        let below = |place: u32| &self.instances.list[place as usize..self.instances.at(place).end as usize];
        let shapes = self.instances.of(node).flat_map(below).filter(|i| i.role == Role::Shape);
        shapes.map(|i| i.slot as usize).collect()
    }

    /// The shape that is shown in a place of [`Scene::drawables`].
    pub fn node_of_drawable(&self, drawable: usize) -> Option<NodeId> {
        let place = self.slots.places.get(drawable)?;
        self.instances.list.get(*place as usize).map(|i| i.node)
    }

    /// Everything to see the world from, in tree order.
    pub fn viewpoints(&self) -> &[Viewpoint] {
        &self.viewpoints
    }

    /// Where the room is in the world (the Navigation's pose and scale).
    pub fn world_from_room(&self) -> glam::Mat4 {
        self.room.world_from_room
    }

    fn update_room(&mut self, graph: &Graph, dirty: &mut Dirty) {
        if dirty.room {
            let room = read_room(graph, &self.globals, &mut self.resources.problems);
            if room != self.room {
                self.room = room;
                dirty.places.extend((!self.instances.list.is_empty()).then_some(0));
                dirty.environment = true;
            }
        }
        if dirty.head {
            self.head = read_head(graph, &self.globals);
        }
    }

    /// Compiles the list anew. Shapes that stay keep their places, meshes and materials.
    fn recompile(&mut self, graph: &Graph, scene: &mut Scene, dirty: &mut Dirty) {
        let (instances, found) = compile(graph, &mut self.types, self.world, self.limit, &self.instances);
        self.instances = instances;
        let problems = &mut self.resources.problems;
        problems.sweep(graph);
        problems.replace_all(graph, "children", found.cycles);
        problems.replace_all(graph, "places", found.limit);
        let given_up = self.slots.assign(&mut self.instances);
        self.slots.fit(scene);
        for slot in given_up {
            self.slots.vacate(scene, slot);
        }
        let instances = &self.instances;
        self.shapes.retain(|shape| instances.first.contains_key(shape));
        let unread = instances.list.iter().filter(|i| i.role == Role::Shape && !self.shapes.states.contains_key(i.node));
        dirty.shapes.extend(unread.map(|i| i.node));
        self.list_leaves();
        dirty.everything_stands();
        self.resources.meshes.sweep(graph);
        self.resources.materials.sweep(graph);
        self.resources.pictures.sweep();
        self.resources.reducer.sweep();
    }

    /// Lists lights, LODs, groups and viewpoints of a newly compiled list.
    fn list_leaves(&mut self) {
        for list in [&mut self.lods, &mut self.groups, &mut self.contours, &mut self.viewpoint_places] {
            list.clear();
        }
        self.lights.clear();
        for (place, instance) in (0u32..).zip(&mut self.instances.list) {
            match instance.role {
                Role::Lod => self.lods.push(place),
                Role::Stencil => self.groups.push(place),
                Role::Contours => self.contours.push(place),
                Role::Viewpoint => self.viewpoint_places.push(place),
                Role::Light => {
                    instance.slot = self.lights.len() as u32;
                    self.lights.push(LightEntry { node: instance.node, local: None, placed: None, slot: None });
                }
                _ => {}
            }
        }
    }

    /// Reads changed shapes anew, and finds joints again where skins changed.
    fn refresh_shapes(&mut self, graph: &Graph, dirty: &mut Dirty, stats: &mut ExtractStats) {
        let mut rebind = dirty.structure;
        for shape in std::mem::take(&mut dirty.shapes) {
            if !self.instances.first.contains_key(shape) || !graph.contains(shape) {
                continue;
            }
            stats.nodes_touched += 1;
            rebind |= self.shapes.refresh(graph, shape, &mut self.resources);
            dirty.shown.extend(self.instances.of(shape));
        }
        if rebind {
            let mut skinned: Vec<(u32, &skin::Skin)> = Vec::new();
            for (node, state) in &self.shapes.states {
                if let Some(skin) = &state.skin {
                    skinned.extend(self.instances.of(node).map(|place| (place, skin)));
                }
            }
            skinned.sort_by_key(|(place, _)| *place);
            self.bindings.bind(&mut self.instances, skinned.into_iter());
        }
    }

    /// Moves and shows everything below changed places. Returns the leaves it passed.
    fn move_places(&mut self, graph: &Graph, dirty: &mut Dirty, stats: &mut ExtractStats) -> Touched {
        for node in std::mem::take(&mut dirty.moved) {
            let Some(info) = self.known.get(node).map(|t| self.types.get(*t)) else { continue };
            let local = info.transform.map(|keys| local_matrix(graph, node, keys));
            let choice = (info.role == Role::Switch).then(|| switch_choice(graph, node));
            let places: Vec<u32> = self.instances.of(node).collect();
            for place in places {
                let instance = &mut self.instances.list[place as usize];
                instance.parent_from_local = local.unwrap_or(instance.parent_from_local);
                instance.choice = choice.unwrap_or(instance.choice);
                dirty.places.insert(place);
            }
        }
        let mut touched = Touched::default();
        let Extractor { instances, resources: Resources { problems, .. }, .. } = self;
        let everything: BTreeSet<u32> = (!instances.list.is_empty()).then_some(0).into_iter().collect();
        let places = if dirty.structure { &everything } else { &dirty.places };
        sweep(graph, instances, places, self.room.room_from_world, self.head, problems, &mut touched);
        if dirty.head {
            let chosen = |at: &&u32| lod_choice(graph, instances, **at, self.head) != instances.at(**at).choice;
            let switched: BTreeSet<u32> = self.lods.iter().filter(chosen).copied().collect();
            sweep(graph, instances, &switched, self.room.room_from_world, self.head, problems, &mut touched);
        }
        for joint in std::mem::take(&mut touched.joints) {
            touched.shapes.extend(self.bindings.users(joint));
        }
        stats.nodes_touched += touched.visited;
        touched.shapes.append(&mut dirty.shown);
        touched.shapes.sort_unstable();
        touched.shapes.dedup();
        touched
    }

    /// Writes drawables. True if some cast that did not before, or the other way round.
    fn write_drawables(&mut self, scene: &mut Scene, places: Vec<u32>, stats: &mut ExtractStats) -> bool {
        let mut casting = false;
        for place in places {
            let written = self.slots.write(scene, &self.instances, place, &self.shapes, &self.bindings);
            stats.drawables_changed += usize::from(written.changed);
            casting |= written.casting;
        }
        casting
    }

    /// Reads and places changed lights. True if the list has other lights now.
    fn update_lights(
        &mut self,
        graph: &Graph,
        scene: &mut Scene,
        dirty: &Dirty,
        moved: &BTreeSet<u32>,
        stats: &mut ExtractStats,
    ) -> bool {
        let mut places = moved.clone();
        for node in &dirty.lights {
            places.extend(self.instances.of(*node));
        }
        let mut relist = dirty.structure;
        for place in places {
            let instance = self.instances.at(place);
            let entry = &mut self.lights[instance.slot as usize];
            if dirty.structure || dirty.lights.contains(&instance.node) {
                entry.local = read_light(graph, instance.node, &mut self.resources.problems);
            }
            let lit = entry.local.as_ref().filter(|_| instance.shown && instance.finite);
            entry.placed = lit.and_then(|l| place_light(l, &instance.room_from_local, self.room.world_per_room));
            stats.nodes_touched += 1;
            match (&entry.placed, entry.slot) {
                (Some(light), Some(slot)) if !relist && scene.lights[slot] == *light => {}
                (Some(light), Some(slot)) if !relist => {
                    scene.lights[slot] = light.clone();
                    stats.lights_changed += 1;
                }
                (None, None) => {}
                _ => relist = true,
            }
        }
        if relist {
            scene.lights.clear();
            for entry in &mut self.lights {
                entry.slot = entry.placed.is_some().then_some(scene.lights.len());
                scene.lights.extend(entry.placed.clone());
            }
            stats.lights_changed += scene.lights.len();
        }
        relist
    }

    fn stencil_groups(&mut self, graph: &Graph, scene: &Scene) -> Vec<StencilGroup> {
        let Extractor { instances, groups, lights, resources, .. } = self;
        let light_of = |node| light_slot(instances, lights, node);
        stencil::read_groups(graph, instances, groups, scene, light_of, &mut resources.problems)
    }
}

/// The place in the scene's lights of the first standing of a light that shines.
fn light_slot(instances: &Instances, lights: &[LightEntry], node: NodeId) -> Option<usize> {
    let standings = instances.of(node).map(|place| instances.at(place)).filter(|i| i.role == Role::Light);
    standings.into_iter().find_map(|i| lights[i.slot as usize].slot)
}
