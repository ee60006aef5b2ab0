//! Textures of an Appearance become layers of its material (X3D MultiTexture, 003 sections 4.4 and 4.5).

use super::material::Parts;
use super::read::{Reader, label, type_name};
use super::texture::texture_of;
use glam::Vec4;
use std::sync::Arc;
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::{Coordinates, Layer, LayerMode, LayerSource, MapCompare, Material, TextureRef};

/// The textures of an appearance, from the base up.
#[derive(Default)]
pub(super) struct Stack {
    /// A first picture that is nothing but the material's own, so that its alpha cuts shadows too.
    pub(super) base: Option<TextureRef>,
    pub(super) layers: Vec<Layer>,
}

/// One texture before its coordinates are known.
struct Stage {
    node: NodeId,
    mode: LayerMode,
    factor: f32,
}

/// Reads the textures of `appearance`; `geometry` says where they lie, if it has coordinates of its own. What cannot be
/// shown is reported and left out.
pub(super) fn layers(
    appearance: &Reader<'_>,
    geometry: Option<NodeId>,
    base_is_free: bool,
    parts: &mut Parts<'_>,
    deps: &mut Vec<NodeId>,
) -> Stack {
    let graph = appearance.graph;
    let stages = stages(appearance, parts, deps);
    let holder = geometry.map_or(*appearance, |node| Reader::new(graph, node));
    deps.extend(geometry);
    let coordinates: Arc<[Option<NodeId>]> = holder.get("texture_coordinates");
    let mut stack = Stack::default();
    for (place, stage) in stages.iter().enumerate() {
        // The last one counts for all that follow.
        let node = coordinates.get(place.min(coordinates.len().saturating_sub(1))).copied().flatten();
        let Some(coordinates) = coordinates_of(&holder, node.filter(|n| graph.contains(*n)), parts, deps) else { continue };
        let Some(source) = source(graph, stage.node, parts) else { continue };
        let plain = stage.mode == LayerMode::Modulate && coordinates == Coordinates::Mesh;
        match source {
            LayerSource::Picture { texture, border: [false, false] } if place == 0 && base_is_free && plain => {
                stack.base = Some(texture);
            }
            source => stack.layers.push(Layer { source, coordinates, mode: stage.mode, factor: Vec4::splat(stage.factor) }),
        }
    }
    let (most, count) = (Material::MOST_LAYERS, stack.layers.len());
    let problem = (count > most).then(|| format!("{count} textures over the material's own; the first {most} are shown"));
    parts.problems.set(graph, appearance.node, "texture", problem);
    stack.layers.truncate(most);
    stack
}

/// All textures in their order, those of MultiTextures among them.
fn stages(appearance: &Reader<'_>, parts: &mut Parts<'_>, deps: &mut Vec<NodeId>) -> Vec<Stage> {
    let graph = appearance.graph;
    let mut stages = Vec::new();
    for (_, node) in appearance.nodes("texture") {
        deps.push(node);
        if type_name(graph, node) != "MultiTexture" {
            stages.push(Stage { node, mode: LayerMode::Modulate, factor: 1.0 });
            continue;
        }
        let multi = Reader::new(graph, node);
        let modes: Arc<[Arc<str>]> = multi.get("mode");
        let unknown = modes.iter().find(|m| mode_named(m).is_none());
        let problem = unknown.map(|mode| format!("there is no mode \"{mode}\"; MODULATE is used"));
        parts.problems.set(graph, node, "mode", problem);
        for (place, texture) in multi.nodes("texture") {
            deps.push(texture);
            let mode = modes.get(place).and_then(|m| mode_named(m)).unwrap_or_default();
            stages.push(Stage { node: texture, mode, factor: multi.get::<f32>("alpha").clamp(0.0, 1.0) });
        }
    }
    stages
}

/// X3D's name of a mode, in any spelling.
fn mode_named(name: &str) -> Option<LayerMode> {
    let plain = |name: &str| -> String { name.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_lowercase() };
    LayerMode::ALL.into_iter().find(|mode| plain(&format!("{mode:?}")) == plain(name))
}

fn source(graph: &Graph, node: NodeId, parts: &mut Parts<'_>) -> Option<LayerSource> {
    let read = Reader::new(graph, node);
    let kind = type_name(graph, node);
    let problem = match &*kind {
        "ImageTexture" => {
            let texture = texture_of(graph, node, parts.pictures, parts.problems)?;
            return Some(LayerSource::Picture { texture, border: ["wrap_s", "wrap_t"].map(|field| read.choice(field) == 3) });
        }
        "GeneratedShadowMap" => {
            let compare =
                [MapCompare::LessEqual, MapCompare::GreaterEqual, MapCompare::None][read.choice("compare_mode").min(2) as usize];
            return Some(LayerSource::ShadowMap { texture: parts.projections.shadow_textures.of(node), compare });
        }
        "MultiTexture" => "it stands in another MultiTexture; left out".to_owned(),
        _ => format!("a {kind} is no texture; left out"),
    };
    parts.problems.report(graph, node, "texture", problem);
    None
}

/// Where a texture lies; None where it lies nowhere.
fn coordinates_of(
    holder: &Reader<'_>,
    node: Option<NodeId>,
    parts: &mut Parts<'_>,
    deps: &mut Vec<NodeId>,
) -> Option<Coordinates> {
    let graph = holder.graph;
    let Some(node) = node else { return Some(Coordinates::Mesh) };
    deps.push(node);
    if type_name(graph, node) != "ProjectedTextureCoordinate" {
        let message = format!("'{}' is no ProjectedTextureCoordinate; the mesh's own are used", label(graph, node));
        parts.problems.report(graph, holder.node, "texture_coordinates", message);
        return Some(Coordinates::Mesh);
    }
    let projector = Reader::new(graph, node).node("projector");
    let problem = match projector.map(|id| type_name(graph, id)).as_deref() {
        Some("SpotLight" | "DirectionalLight" | "LightSource" | "Viewpoint") => None,
        Some("PointLight") => Some("a PointLight has no direction to project along; the texture is left out".to_owned()),
        Some(other) => Some(format!("a {other} does not project; the texture is left out")),
        None => Some("none is set; the texture is left out".to_owned()),
    };
    let fine = problem.is_none();
    parts.problems.set(graph, node, "projector", problem);
    projector.filter(|_| fine).map(|id| Coordinates::Projected(parts.projections.projectors.of(id)))
}
