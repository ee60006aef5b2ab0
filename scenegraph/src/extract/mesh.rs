//! Geometry nodes become meshes.

use super::problem::Problems;
use super::read::{Reader, label, stamp};
use super::skin::JointBounds;
use super::texture::{Pictures, picture};
use crate::geometry::{self, ConeParts, CylinderParts, DepthCamera, MeshFields, mesh_from_fields};
use glam::{Vec2, Vec3};
use slotmap::SecondaryMap;
use std::collections::HashMap;
use std::sync::{Arc, Weak};
use umbriel_fields::{Graph, NodeId, Revision};
use umbriel_scene::{Mesh, MorphTarget, Topology};

/// A mesh and what it was made of.
#[derive(Clone)]
pub(super) struct CachedMesh {
    /// None where the node has a problem, which is reported.
    pub(super) mesh: Option<Arc<Mesh>>,
    /// Where the mesh has joints or morph targets.
    pub(super) joints: Option<Arc<JointBounds>>,
    pub(super) deps: Vec<NodeId>,
    stamp: (Revision, usize),
}

/// What makes a solid: kind and numbers. Equal solids share one mesh and so are drawn as instances.
type SolidKey = (&'static str, [u32; 3], [bool; 3], u32);
type MakeSolid = Box<dyn Fn() -> Mesh>;

/// Meshes by geometry node; an `Arc` stays the same as long as no node it was made of is written.
#[derive(Default)]
pub(super) struct Meshes {
    cache: SecondaryMap<NodeId, CachedMesh>,
    solids: HashMap<SolidKey, Weak<Mesh>>,
}

impl Meshes {
    pub(super) fn get(&mut self, graph: &Graph, node: NodeId, pictures: &mut Pictures, problems: &mut Problems) -> CachedMesh {
        if let Some(known) = self.cache.get(node).filter(|c| c.stamp == stamp(graph, &c.deps)) {
            return known.clone();
        }
        let read = Reader::new(graph, node);
        let mut deps = vec![node];
        let made = match &*graph.type_of(node).name {
            "Mesh" => {
                let targets = read.nodes("targets").into_iter().map(|(_, id)| id);
                deps.extend(targets);
                mesh_from_fields(mesh_fields(&read, &deps[1..])).map(Arc::new).map_err(|e| e.to_string())
            }
            "DepthPicture" => {
                deps.extend(read.node("depth"));
                seen(&read, deps.get(1).map(|depth| Reader::new(graph, *depth)), pictures, problems)
            }
            kind => self.solid(kind, &read),
        };
        let problem = made.as_ref().err().map(|e| format!("{e}; the shape is not shown"));
        problems.set(graph, node, "geometry", problem);
        let mesh = made.ok();
        let joints = mesh.as_ref().filter(|m| !m.joints.is_empty() || !m.morph_targets.is_empty());
        let joints = joints.map(|m| Arc::new(JointBounds::of(m)));
        let cached = CachedMesh { mesh, joints, stamp: stamp(graph, &deps), deps };
        self.cache.insert(node, cached.clone());
        cached
    }

    /// Forgets meshes of dead nodes and solids that nobody uses.
    pub(super) fn sweep(&mut self, graph: &Graph) {
        self.cache.retain(|node, _| graph.contains(node));
        self.solids.retain(|_, mesh| mesh.strong_count() > 0);
    }

    fn solid(&mut self, kind: &str, read: &Reader<'_>) -> Result<Arc<Mesh>, String> {
        let (key, make) = solid(kind, read)?;
        if let Some(known) = self.solids.get(&key).and_then(Weak::upgrade) {
            return Ok(known);
        }
        let mesh = make().checked().map_err(|e| e.to_string())?;
        if mesh.indices.is_empty() {
            return Err("none of its parts is there".to_owned());
        }
        let mesh = Arc::new(mesh);
        self.solids.insert(key, Arc::downgrade(&mesh));
        Ok(mesh)
    }
}

fn solid(kind: &str, read: &Reader<'_>) -> Result<(SolidKey, MakeSolid), String> {
    let part = |field: &str| read.get::<bool>(field);
    let segments = |least: i32, most: i32| read.get::<i32>("segments").clamp(least, most) as u32;
    match kind {
        "Box" => {
            let size: Vec3 = read.get("size");
            let sides = positive(["size.x", "size.y", "size.z"], size.to_array())?;
            Ok((("Box", sides, [true; 3], 0), Box::new(move || geometry::cuboid(size))))
        }
        "Sphere" => {
            let (radius, n) = (read.get::<f32>("radius"), segments(3, 4096));
            let [bits] = positive(["radius"], [radius])?;
            Ok((("Sphere", [bits, 0, 0], [true; 3], n), Box::new(move || geometry::sphere(radius, n))))
        }
        "Cone" => {
            let (radius, height, n) = (read.get::<f32>("bottom_radius"), read.get::<f32>("height"), segments(3, 4096));
            let [r, h] = positive(["bottom_radius", "height"], [radius, height])?;
            let parts = ConeParts { side: part("side"), bottom: part("bottom") };
            let key = ("Cone", [r, h, 0], [parts.side, parts.bottom, true], n);
            Ok((key, Box::new(move || geometry::cone(radius, height, n, parts))))
        }
        "Cylinder" => {
            let (radius, height, n) = (read.get::<f32>("radius"), read.get::<f32>("height"), segments(3, 4096));
            let [r, h] = positive(["radius", "height"], [radius, height])?;
            let parts = CylinderParts { side: part("side"), top: part("top"), bottom: part("bottom") };
            let key = ("Cylinder", [r, h, 0], [parts.side, parts.top, parts.bottom], n);
            Ok((key, Box::new(move || geometry::cylinder(radius, height, n, parts))))
        }
        "Plane" => {
            let (size, n) = (read.get::<Vec2>("size"), segments(1, 1024));
            let [x, z] = positive(["size.x", "size.y"], size.to_array())?;
            Ok((("Plane", [x, z, 0], [true; 3], n), Box::new(move || geometry::plane(size, n))))
        }
        other => Err(format!("a {other} is no geometry")),
    }
}

/// The surface of a picture with depth.
fn seen(
    read: &Reader<'_>,
    depth: Option<Reader<'_>>,
    pictures: &mut Pictures,
    problems: &mut Problems,
) -> Result<Arc<Mesh>, String> {
    let depth = depth.filter(|d| &*d.graph.type_of(d.node).name == "ImageTexture").ok_or("depth is no ImageTexture")?;
    let picture = picture(&depth, pictures, problems, "the shape is not shown").ok_or("its depth cannot be read")?;
    if picture.width < 2 || picture.height < 2 {
        return Err(format!("its depth has {} x {} pixels, it needs 2 x 2 at least", picture.width, picture.height));
    }
    let camera = DepthCamera { fov_rad: read.get("field_of_view"), near: read.get("near"), far: read.get("far") };
    positive(["field_of_view", "near", "far"], [camera.fov_rad, camera.near, camera.far])?;
    let mesh = geometry::depth_picture(&picture, camera).checked().map_err(|e| e.to_string())?;
    Ok(Arc::new(mesh))
}

/// The numbers' bits, if each is a length that makes a surface.
fn positive<const N: usize>(names: [&str; N], numbers: [f32; N]) -> Result<[u32; N], String> {
    for (name, number) in names.iter().zip(numbers) {
        if !(number.is_finite() && number > 0.0) {
            return Err(format!("{name} is {number}, it must be above 0"));
        }
    }
    Ok(numbers.map(f32::to_bits))
}

fn mesh_fields(read: &Reader<'_>, targets: &[NodeId]) -> MeshFields {
    let target = |id: &NodeId| {
        let read = Reader::new(read.graph, *id);
        MorphTarget { positions: read.get("position"), normals: read.get("normal"), tangents: read.get("tangent") }
    };
    MeshFields {
        name: label(read.graph, read.node),
        topology: [Topology::Triangles, Topology::Lines, Topology::Points][read.choice("topology").min(2) as usize],
        position: read.get("position"),
        normal: read.get("normal"),
        tangent: read.get("tangent"),
        tex_coord: read.get("tex_coord"),
        tex_coord1: read.get("tex_coord1"),
        color: read.get("color"),
        joint: read.get("joint"),
        weight: read.get("weight"),
        index: read.get("index"),
        targets: targets.iter().map(target).collect(),
    }
}
