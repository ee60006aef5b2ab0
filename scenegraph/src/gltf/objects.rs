//! The primitives of a model file as plain meshes, each with its place in the file: what a mesh doctor examines.

use super::accessor::Accessors;
use super::budget::Budget;
use super::error::{Cause, Error, Fault, label};
use super::read::{Source, read};
use super::surface::{Surface, Surfaces};
use super::topology::Topology as Kind;
use super::uri::Place;
use super::{LoadOptions, container, guard, write};
use glam::Mat4;
use serde_json::Value;
use std::path::{Path, PathBuf};
use umbriel_scene::doctor::Mended;
use umbriel_scene::{Aabb, Mesh, MorphTarget, Topology};

/// One primitive of a model file.
#[derive(Clone, Debug)]
pub struct Object {
    /// Which one it is, such as `mesh 3 'Roof', primitive 0`.
    pub label: String,
    /// Names of the nodes above the first place where it stands; empty where it stands nowhere.
    pub path: String,
    /// Its vertices at rest; a primitive without triangles, lines or points has no indices.
    pub mesh: Mesh,
    /// Where it stands first.
    pub scene_from_mesh: Mat4,
    /// Place in the file.
    pub(super) mesh_index: usize,
    pub(super) primitive: usize,
}

/// A model file that was read, and can be written again.
pub struct Objects {
    /// Its primitives, in the order of the file.
    pub list: Vec<Object>,
    /// What was left out: object and reason.
    pub warnings: Vec<String>,
    pub(super) source: Source,
    pub(super) json: Value,
    pub(super) place: Place,
    file: PathBuf,
}

impl Objects {
    /// Reads a .gltf or .glb file.
    pub fn read(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Objects, Error> {
        let path = path.as_ref();
        guard(|| Objects::try_read(path, options)).map_err(|fault| fault.in_file(path))
    }

    fn try_read(path: &Path, options: &LoadOptions) -> Result<Objects, Fault> {
        let budget = Budget::new(options.max_bytes);
        let source = read(path, options, &budget)?;
        let whole = |cause| Fault::new("", cause);
        let unreadable = |e: std::io::Error| whole(Cause::Unreadable(e.to_string()));
        let bytes = std::fs::read(path).map_err(unreadable)?;
        let parts = container::split(&bytes).map_err(whole)?;
        let json = serde_json::from_slice(&bytes[parts.json]).map_err(|e| whole(Cause::Json(e.to_string())))?;
        let place = Place::of(path, options.asset_root.as_deref()).map_err(unreadable)?;
        let standing = standings(&source);
        let mut surfaces = Surfaces::new(Accessors { source: &source, budget: &budget });
        let mut list = Vec::new();
        for mesh in source.document.meshes() {
            let (path, scene_from_mesh) = standing.get(mesh.index()).cloned().flatten().unwrap_or_default();
            for primitive in mesh.primitives() {
                let label = format!("{}, primitive {}", label("mesh", mesh.index(), mesh.name()), primitive.index());
                let surface = surfaces.read(&mesh, &primitive)?;
                list.push(Object {
                    mesh: surface.map(|s| mesh_of(&label, &s)).unwrap_or_default(),
                    label,
                    path: path.clone(),
                    scene_from_mesh,
                    mesh_index: mesh.index(),
                    primitive: primitive.index(),
                });
            }
        }
        let warnings = std::mem::take(&mut surfaces.warnings);
        Ok(Objects { list, warnings, source, json, place, file: path.to_owned() })
    }

    /// The file as .glb with mended primitives in place of the old ones: one entry of `mended` per object, in their order.
    /// Everything else keeps its bytes: materials, animations, skins, what extensions say, primitives that were not mended.
    /// Buffers and pictures beside the file are taken into it. Also gives what had to be left outside.
    pub fn write(&self, mended: &[Option<Mended>]) -> Result<(Vec<u8>, Vec<String>), Error> {
        guard(|| write::glb(self, mended)).map_err(|fault| fault.in_file(&self.file))
    }
}

/// Path and place of the first node that shows each mesh.
fn standings(source: &Source) -> Vec<Option<(String, Mat4)>> {
    let mut found = vec![None; source.document.meshes().len()];
    let mut has_parent = vec![false; source.document.nodes().len()];
    source.document.nodes().flat_map(|n| n.children().map(|c| c.index()).collect::<Vec<_>>()).for_each(|c| has_parent[c] = true);
    let roots = source.document.nodes().filter(|n| !has_parent[n.index()]);
    let mut open: Vec<(gltf::Node<'_>, String, Mat4)> = roots.map(|n| (n, String::new(), Mat4::IDENTITY)).collect();
    open.reverse();
    while let Some((node, above, scene_from_parent)) = open.pop() {
        let name = node.name().map_or_else(|| format!("node {}", node.index()), str::to_owned);
        let path = if above.is_empty() { name } else { format!("{above}/{name}") };
        let scene_from_node = scene_from_parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        if let Some(mesh) = node.mesh() {
            found[mesh.index()].get_or_insert_with(|| (path.clone(), scene_from_node));
        }
        let children: Vec<_> = node.children().collect();
        open.extend(children.into_iter().rev().map(|c| (c, path.clone(), scene_from_node)));
    }
    found
}

fn mesh_of(name: &str, s: &Surface) -> Mesh {
    let target = |t: &super::surface::Target| MorphTarget {
        positions: t.position.clone(),
        normals: t.normal.clone(),
        tangents: t.tangent.clone(),
    };
    Mesh {
        name: name.to_owned(),
        topology: match s.topology {
            Kind::Triangles => Topology::Triangles,
            Kind::Lines => Topology::Lines,
            Kind::Points => Topology::Points,
        },
        bounds: Aabb::from_points(s.position.iter().copied()),
        positions: s.position.clone(),
        normals: s.normal.clone(),
        flat: s.normal.is_empty(),
        tangents: s.tangent.clone(),
        uv0: s.tex_coord[0].clone(),
        uv1: s.tex_coord[1].clone(),
        colors: s.color.clone(),
        // The reader lets in no joint above 65535: none of the file's own kinds of numbers for joints holds more.
        joints: s.joint.chunks_exact(4).map(|j| [j[0] as u16, j[1] as u16, j[2] as u16, j[3] as u16]).collect(),
        weights: s.weight.clone(),
        morph_targets: s.targets.iter().map(target).collect(),
        indices: s.index.iter().map(|i| *i as u32).collect(),
    }
}
