//! A model alone: it gets a sun, a ground to throw its shadow on, and a camera that sees all of it.

use crate::session::bounds;
use glam::{Quat, Vec2, Vec3};
use std::path::Path;
use std::sync::Arc;
use umbriel_displays::rig::fit_camera;
use umbriel_fields::{Color, Graph, NodeId, Value};
use umbriel_scene::{Aabb, Scene};
use umbriel_scenegraph::gltf::{self, LoadOptions};
use umbriel_scenegraph::{Extractor, WORLD};

const FIELD_OF_VIEW_RAD: f32 = 0.7;
/// Width over height for which the camera is fitted; wider windows show more at the sides.
const ASPECT: f32 = 4.0 / 3.0;

/// So many of a model's own lights cast shadows; maps of more would fill a small device.
const SHADOWED_LIGHTS: usize = 4;

/// Why a model cannot be shown.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// The file is wrong.
    #[error(transparent)]
    Load(#[from] gltf::Error),
    /// The graph refused a node.
    #[error(transparent)]
    Fields(#[from] umbriel_fields::Error),
}

/// Loads the model into the world of `graph` and puts light, ground and camera around it; gives the box around the model.
pub(crate) fn show(graph: &mut Graph, path: &Path) -> Result<Aabb, Error> {
    let model = gltf::load(graph, path, &LoadOptions::default())?;
    for warning in &model.warnings {
        tracing::warn!("{warning}");
    }
    let world = graph.find(WORLD).expect("every graph of ours has its world");
    set_children(graph, world, &[model.root])?;
    let mut scene = Scene::default();
    Extractor::new().update(graph, &mut scene);
    let bounds = bounds(&scene);

    let mut children = vec![viewpoint(graph, &bounds)?, model.root, ground(graph, &bounds)?];
    if model.lights.is_empty() {
        children.push(sun(graph)?);
    }
    for light in model.lights.iter().take(SHADOWED_LIGHTS) {
        graph.set_named(*light, "shadows", "map")?;
    }
    set_children(graph, world, &children)?;
    Ok(bounds)
}

fn set_children(graph: &mut Graph, node: NodeId, children: &[NodeId]) -> Result<(), umbriel_fields::Error> {
    let children: Arc<[Option<NodeId>]> = children.iter().copied().map(Some).collect();
    graph.set_named(node, "children", children)
}

fn create(graph: &mut Graph, type_name: &str, fields: &[(&str, Value)]) -> Result<NodeId, umbriel_fields::Error> {
    let node = graph.create(type_name)?;
    for (name, value) in fields {
        graph.set_named(node, name, value.clone())?;
    }
    Ok(node)
}

fn viewpoint(graph: &mut Graph, bounds: &Aabb) -> Result<NodeId, umbriel_fields::Error> {
    let camera = fit_camera(bounds, FIELD_OF_VIEW_RAD, ASPECT);
    let (_, orientation, position) = camera.room_from_camera.to_scale_rotation_translation();
    create(
        graph,
        "Viewpoint",
        &[
            ("position", position.into()),
            ("orientation", orientation.into()),
            ("field_of_view", FIELD_OF_VIEW_RAD.into()),
            ("near", camera.near.into()),
            ("description", "the whole model".into()),
        ],
    )
}

/// A matt floor just below the model, wide enough for its shadow. Nothing is below that it could shade.
fn ground(graph: &mut Graph, bounds: &Aabb) -> Result<NodeId, umbriel_fields::Error> {
    let radius = bounds.radius().max(1e-3);
    let side = 12.0 * radius;
    let below = Vec3::Y * 2e-3 * radius;
    let foot = if bounds.is_empty() { Vec3::ZERO } else { bounds.centre().with_y(bounds.min.y) - below };
    let grey: [(&str, Value); 2] = [("base_color", Color(Vec3::splat(0.36)).into()), ("roughness", 1.0f32.into())];
    let material = create(graph, "PhysicalMaterial", &grey)?;
    let appearance = create(graph, "Appearance", &[("material", Some(material).into())])?;
    let plane = create(graph, "Plane", &[("size", Vec2::splat(side).into())])?;
    let fields = [("geometry", Some(plane).into()), ("appearance", Some(appearance).into()), ("cast_shadow", false.into())];
    let shape = create(graph, "Shape", &fields)?;
    let transform = create(graph, "Transform", &[("translation", foot.into())])?;
    set_children(graph, transform, &[shape])?;
    Ok(transform)
}

/// A sun over the left shoulder of the camera.
fn sun(graph: &mut Graph) -> Result<NodeId, umbriel_fields::Error> {
    let direction = Quat::from_rotation_y(0.55) * Vec3::new(0.55, -1.0, -0.45);
    create(graph, "DirectionalLight", &[("direction", direction.normalize().into()), ("shadows", "map".into())])
}
