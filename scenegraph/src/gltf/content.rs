//! All that a model file holds as plain, checked data: whatever can be wrong with a file is found here, before the
//! graph is touched.

use super::LoadOptions;
use super::accessor::{Accessors, name_of};
use super::budget::Budget;
use super::error::{Fault, label};
use super::read::{Source, read};
use super::surface::{Surface, Surfaces};
use super::tracks::{Animation, read_animations};
use glam::Mat4;
use gltf::accessor::Dimensions;
use std::path::Path;

/// A model file, decoded.
pub(crate) struct Content {
    pub(crate) source: Source,
    /// The primitives of each mesh; none where there is nothing to draw.
    pub(crate) meshes: Vec<Vec<Option<Surface>>>,
    /// The inverse bind matrices of each skin; empty for identities.
    pub(crate) inverse_binds: Vec<Vec<Mat4>>,
    pub(crate) animations: Vec<Animation>,
}

impl Content {
    /// Reads, checks and decodes a file.
    pub(crate) fn load(file: &Path, options: &LoadOptions) -> Result<Content, Fault> {
        let budget = Budget::new(options.max_bytes);
        let source = read(file, options, &budget)?;
        let (meshes, mesh_warnings) = read_meshes(&source, &budget)?;
        let inverse_binds = read_inverse_binds(&source, &budget)?;
        check_shapes(&source, &meshes, &budget)?;
        let (animations, animation_warnings) = read_animations(&Accessors { source: &source, budget: &budget }, &meshes)?;
        let mut content = Content { source, meshes, inverse_binds, animations };
        content.source.warnings.extend(mesh_warnings.into_iter().chain(animation_warnings));
        Ok(content)
    }
}

type Meshes = Vec<Vec<Option<Surface>>>;

fn read_meshes(source: &Source, budget: &Budget) -> Result<(Meshes, Vec<String>), Fault> {
    let mut surfaces = Surfaces::new(Accessors { source, budget });
    let mut meshes = Vec::new();
    for mesh in source.document.meshes() {
        if mesh.primitives().len() == 0 {
            surfaces.warnings.push(format!("{}: it has no primitives", label("mesh", mesh.index(), mesh.name())));
        }
        let primitives: Result<_, _> = mesh.primitives().map(|p| surfaces.read(&mesh, &p)).collect();
        meshes.push(primitives?);
    }
    Ok((meshes, surfaces.warnings))
}

fn read_inverse_binds(source: &Source, budget: &Budget) -> Result<Vec<Vec<Mat4>>, Fault> {
    let read = |skin: gltf::Skin<'_>| {
        let object = label("skin", skin.index(), skin.name());
        let joints = skin.joints().len();
        if joints == 0 {
            return Err(Fault::invalid(object, "has no joints"));
        }
        let Some(accessor) = skin.inverse_bind_matrices() else { return Ok(Vec::new()) };
        let matrices = Accessors { source, budget }.floats::<16>(&accessor, &[Dimensions::Mat4])?;
        if matrices.len() < joints {
            let message = format!("has {} matrices for the {joints} joints of {object}", matrices.len());
            return Err(Fault::data(name_of(&accessor), message));
        }
        Ok(matrices[..joints].iter().map(Mat4::from_cols_array).collect())
    };
    source.document.skins().map(read).collect()
}

/// The number of morph targets of a mesh.
pub(crate) fn target_count(mesh: &[Option<Surface>]) -> usize {
    mesh.iter().flatten().map(|s| s.targets.len()).max().unwrap_or(0)
}

/// Joints must exist in the skin with which a mesh is used, and there must be memory for all morph weights.
fn check_shapes(source: &Source, meshes: &[Vec<Option<Surface>>], budget: &Budget) -> Result<(), Fault> {
    for node in source.document.nodes() {
        let Some(mesh) = node.mesh() else { continue };
        let surfaces = &meshes[mesh.index()];
        let object = || label("node", node.index(), node.name());
        budget.take(4 * (target_count(surfaces) * surfaces.len()) as u64, &object())?;
        let Some(skin) = node.skin() else { continue };
        let joints = skin.joints().len();
        if let Some(last) = surfaces.iter().flatten().filter_map(|s| s.last_joint).max().filter(|last| *last >= joints) {
            let message = format!(
                "{} has weights for joint {last}, but {} has {joints} joints",
                label("mesh", mesh.index(), mesh.name()),
                label("skin", skin.index(), skin.name())
            );
            return Err(Fault::data(object(), message));
        }
    }
    Ok(())
}
