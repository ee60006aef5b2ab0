//! Makes the nodes of a model: scenes, transforms, shapes, skins.

use super::Model;
use super::content::{Content, target_count};
use super::error::{Cause, Fault};
use super::surface::Surface;
use glam::{Mat4, Quat, Vec3};
use gltf::scene::Transform;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use umbriel_fields::{Graph, NodeId, Value};

/// Makes nodes and remembers them, so that a failure can take them back.
pub(super) struct Builder<'a> {
    pub(super) graph: &'a mut Graph,
    pub(super) content: &'a Content,
    /// All nodes that were made.
    pub(super) made: &'a mut Vec<NodeId>,
    /// How often each name was asked for.
    names: HashMap<String, usize>,
    /// The Transform of each node of the file.
    pub(super) transforms: Vec<NodeId>,
    /// The shapes below each of `transforms`.
    pub(super) shapes: Vec<Vec<NodeId>>,
    pub(super) viewpoints: Vec<NodeId>,
    pub(super) lights: Vec<NodeId>,
    pub(super) warnings: Vec<String>,
}

impl<'a> Builder<'a> {
    pub(super) fn new(graph: &'a mut Graph, content: &'a Content, made: &'a mut Vec<NodeId>) -> Builder<'a> {
        Builder {
            graph,
            content,
            made,
            names: HashMap::new(),
            transforms: Vec::new(),
            shapes: Vec::new(),
            viewpoints: Vec::new(),
            lights: Vec::new(),
            warnings: content.source.warnings.clone(),
        }
    }

    /// Makes everything; `name` is that of the model.
    pub(super) fn build(mut self, name: &str) -> Result<Model, Fault> {
        let content = self.content;
        let root = self.create("Group", Some(name))?;
        self.make_transforms()?;
        let skins = self.make_skins()?;
        let appearances = self.make_appearances()?;
        let meshes = self.make_meshes()?;
        for node in content.source.document.nodes() {
            let mut below = self.make_shapes(&node, &skins, &appearances, &meshes)?;
            self.shapes.push(below.clone());
            below.extend(self.make_camera(&node)?);
            below.extend(self.make_light(&node)?);
            below.extend(node.children().map(|c| self.transforms[c.index()]));
            self.set(self.transforms[node.index()], "children", below)?;
        }
        let (scenes, mut below) = self.make_scenes()?;
        let clocks = self.make_animations(name, &mut below)?;
        self.set(root, "children", below)?;
        let Builder { viewpoints, lights, warnings, .. } = self;
        Ok(Model { root, scenes, viewpoints, lights, clocks, warnings })
    }

    /// A new node. The name gets a suffix where the graph has it already.
    pub(super) fn create(&mut self, kind: &str, name: Option<&str>) -> Result<NodeId, Fault> {
        let node = self.graph.create(kind).map_err(|e| refused(kind, &e))?;
        self.made.push(node);
        if let Some(name) = name.filter(|n| !n.is_empty()) {
            let name = self.unique(name);
            self.graph.set_name(node, &name).map_err(|e| refused(&name, &e))?;
        }
        Ok(node)
    }

    pub(super) fn set(&mut self, node: NodeId, field: &str, value: impl Into<Value>) -> Result<(), Fault> {
        let id = self.graph.field(node, field).map_err(|e| refused(field, &e))?;
        self.graph.set_value(id, value.into()).map_err(|e| refused(field, &e))
    }

    /// `name`, or `name.1`, `name.2`, ... where it is taken.
    fn unique(&mut self, name: &str) -> String {
        let count = self.names.entry(name.to_owned()).or_insert(0);
        loop {
            let candidate = if *count == 0 { name.to_owned() } else { format!("{name}.{count}") };
            *count += 1;
            if self.graph.find(&candidate).is_none() {
                return candidate;
            }
        }
    }

    fn make_transforms(&mut self) -> Result<(), Fault> {
        let animated: HashSet<usize> = self.content.animations.iter().flat_map(|a| &a.tracks).map(|t| t.node).collect();
        for node in self.content.source.document.nodes() {
            let id = self.create("Transform", node.name())?;
            self.transforms.push(id);
            let decomposed = match node.transform() {
                // Routes write translation, rotation and scale.
                Transform::Matrix { matrix } if animated.contains(&node.index()) => {
                    let (s, r, t) = Mat4::from_cols_array_2d(&matrix).to_scale_rotation_translation();
                    Some((t, r, s))
                }
                Transform::Matrix { matrix } => {
                    self.set(id, "matrix", Mat4::from_cols_array_2d(&matrix))?;
                    None
                }
                Transform::Decomposed { translation, rotation, scale } => {
                    Some((translation.into(), Quat::from_array(rotation), scale.into()))
                }
            };
            if let Some((t, r, s)) = decomposed {
                self.set(id, "translation", t)?;
                self.set(id, "rotation", if r.length_squared() > 0.0 { r.normalize() } else { Quat::IDENTITY })?;
                self.set(id, "scale", s)?;
            }
        }
        Ok(())
    }

    fn make_skins(&mut self) -> Result<Vec<NodeId>, Fault> {
        let content = self.content;
        let mut skins = Vec::new();
        for skin in content.source.document.skins() {
            let id = self.create("Skin", skin.name())?;
            let joints: Vec<NodeId> = skin.joints().map(|j| self.transforms[j.index()]).collect();
            self.set(id, "joints", joints)?;
            self.set(id, "inverse_bind", content.inverse_binds[skin.index()].clone())?;
            if let Some(skeleton) = skin.skeleton() {
                self.set(id, "skeleton", self.transforms[skeleton.index()])?;
            }
            skins.push(id);
        }
        Ok(skins)
    }

    /// One Mesh node per primitive.
    fn make_meshes(&mut self) -> Result<Vec<Vec<Option<NodeId>>>, Fault> {
        let content = self.content;
        let mut out = Vec::new();
        for mesh in content.source.document.meshes() {
            let mut primitives = Vec::new();
            for surface in &content.meshes[mesh.index()] {
                primitives.push(match surface {
                    Some(surface) => Some(self.make_mesh(mesh.name(), surface)?),
                    None => None,
                });
            }
            out.push(primitives);
        }
        Ok(out)
    }

    fn make_mesh(&mut self, name: Option<&str>, surface: &Surface) -> Result<NodeId, Fault> {
        let id = self.create("Mesh", name)?;
        self.set(id, "topology", surface.topology.name())?;
        self.set(id, "position", surface.position.clone())?;
        self.set(id, "index", surface.index.clone())?;
        self.set_some(id, "normal", &surface.normal)?;
        for (field, values) in [("tangent", &surface.tangent), ("color", &surface.color), ("weight", &surface.weight)] {
            self.set_some(id, field, values)?;
        }
        for (field, values) in ["tex_coord", "tex_coord1"].into_iter().zip(&surface.tex_coord) {
            self.set_some(id, field, values)?;
        }
        self.set_some(id, "joint", &surface.joint)?;
        let mut targets = Vec::new();
        for target in &surface.targets {
            let node = self.create("MorphTarget", None)?;
            for (field, values) in [("position", &target.position), ("normal", &target.normal), ("tangent", &target.tangent)] {
                self.set_some(node, field, values)?;
            }
            targets.push(node);
        }
        if !targets.is_empty() {
            self.set(id, "targets", targets)?;
        }
        Ok(id)
    }

    fn set_some<T>(&mut self, node: NodeId, field: &str, values: &Arc<[T]>) -> Result<(), Fault>
    where
        Value: From<Arc<[T]>>,
    {
        if values.is_empty() { Ok(()) } else { self.set(node, field, values.clone()) }
    }

    fn make_shapes(
        &mut self,
        node: &gltf::Node<'_>,
        skins: &[NodeId],
        appearances: &HashMap<Option<usize>, NodeId>,
        meshes: &[Vec<Option<NodeId>>],
    ) -> Result<Vec<NodeId>, Fault> {
        let Some(mesh) = node.mesh() else { return Ok(Vec::new()) };
        let surfaces = &self.content.meshes[mesh.index()];
        let mut weights = node.weights().or(mesh.weights()).unwrap_or_default().to_vec();
        weights.resize(target_count(surfaces), 0.0);
        let mut shapes = Vec::new();
        for (primitive, (surface, geometry)) in mesh.primitives().zip(surfaces.iter().zip(&meshes[mesh.index()])) {
            let (Some(surface), Some(geometry)) = (surface, geometry) else { continue };
            let shape = self.create("Shape", node.name().or(mesh.name()))?;
            self.set(shape, "geometry", *geometry)?;
            self.set(shape, "appearance", appearances[&primitive.material().index()])?;
            if let Some(skin) = node.skin().filter(|_| !surface.joint.is_empty()) {
                self.set(shape, "skin", skins[skin.index()])?;
            }
            if !surface.targets.is_empty() {
                self.set(shape, "morph_weights", weights[..surface.targets.len()].to_vec())?;
            }
            shapes.push(shape);
        }
        Ok(shapes)
    }

    /// The scenes, and what comes below the model's root to show the default one.
    fn make_scenes(&mut self) -> Result<(Vec<NodeId>, Vec<NodeId>), Fault> {
        let document = &self.content.source.document;
        let mut parents = vec![None; self.transforms.len()];
        for node in document.nodes() {
            for child in node.children() {
                parents[child.index()] = Some(node.index());
            }
        }
        let mut scenes = Vec::new();
        let mut placed = HashSet::new();
        for scene in document.scenes() {
            let listed: HashSet<usize> = scene.nodes().map(|n| n.index()).collect();
            let mut roots = Vec::new();
            for node in scene.nodes().map(|n| n.index()) {
                let mut ancestors = std::iter::successors(parents[node], |p| parents[*p]);
                if ancestors.any(|p| listed.contains(&p)) {
                    let object = super::error::label("scene", scene.index(), scene.name());
                    self.warnings
                        .push(format!("{object}: node {node} is also below another of its nodes; it is shown there only"));
                } else if !roots.contains(&self.transforms[node]) {
                    roots.push(self.transforms[node]);
                }
            }
            placed.extend(listed.iter().map(|n| std::iter::successors(Some(*n), |p| parents[*p]).last().unwrap_or(*n)));
            let group = self.create("Group", scene.name())?;
            self.set(group, "children", roots)?;
            scenes.push(group);
        }
        // Nodes of no scene, perhaps joints, are kept off the picture; without any scene there is nothing else to show.
        let rest: Vec<NodeId> =
            (0..parents.len()).filter(|n| parents[*n].is_none() && !placed.contains(n)).map(|n| self.transforms[n]).collect();
        let shown = document.default_scene().map_or(0, |s| s.index());
        let mut groups = scenes.clone();
        if !rest.is_empty() || scenes.is_empty() {
            let group = self.create("Group", None)?;
            self.set(group, "children", rest)?;
            groups.push(group);
        }
        if groups.len() == 1 {
            return Ok((scenes, groups));
        }
        let switch = self.create("Switch", None)?;
        self.set(switch, "children", groups)?;
        self.set(switch, "which_choice", shown as i32)?;
        Ok((scenes, vec![switch]))
    }
}

/// The graph's own message under the name of what it refused.
pub(super) fn refused(object: &str, error: &dyn std::fmt::Display) -> Fault {
    Fault::new(object, Cause::Graph(error.to_string()))
}

/// The colour of a factor.
pub(super) fn color(rgb: Vec3) -> umbriel_fields::Color {
    umbriel_fields::Color(rgb.max(Vec3::ZERO))
}
