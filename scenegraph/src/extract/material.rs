//! Appearances become materials.

use super::layer::{Stack, layers};
use super::problem::Problems;
use super::projection::Projections;
use super::read::{Reader, name_of, stamp};
use super::shader::{Shaders, shader};
use super::texture::{Pictures, texture};
use glam::{Vec3, Vec4};
use slotmap::SecondaryMap;
use std::collections::HashMap;
use std::sync::Arc;
use umbriel_fields::{Graph, NodeId, Revision};
use umbriel_scene::{AlphaMode, Material, Shading, TextureRef};

/// A material and what it was made of.
#[derive(Clone)]
pub(super) struct CachedMaterial {
    pub(super) material: Arc<Material>,
    pub(super) casts_shadow: bool,
    /// A place in the scene's lists of lights.
    pub(super) receives: Option<usize>,
    pub(super) deps: Vec<NodeId>,
    /// It names a shader, which may not be there.
    has_shader: bool,
    stamp: (Revision, usize),
}

/// Materials by appearance; an `Arc` stays the same as long as no node it was made of is written.
pub(super) struct Materials {
    cache: SecondaryMap<NodeId, CachedMaterial>,
    /// For geometries that say themselves where textures lie: by appearance and geometry.
    by_geometry: HashMap<(NodeId, NodeId), CachedMaterial>,
    plain: CachedMaterial,
}

impl Materials {
    pub(super) fn new() -> Materials {
        let material = Arc::new(plain(String::new()));
        let plain =
            CachedMaterial { material, casts_shadow: true, receives: None, deps: Vec::new(), has_shader: false, stamp: (0, 0) };
        Materials { cache: SecondaryMap::new(), by_geometry: HashMap::new(), plain }
    }

    pub(super) fn get(
        &mut self,
        graph: &Graph,
        appearance: Option<NodeId>,
        geometry: Option<NodeId>,
        parts: &mut Parts<'_>,
    ) -> CachedMaterial {
        let Some(appearance) = appearance else { return self.plain.clone() };
        let own = geometry.filter(|g| !Reader::new(graph, *g).nodes("texture_coordinates").is_empty());
        let known = match own {
            Some(geometry) => self.by_geometry.get(&(appearance, geometry)),
            None => self.cache.get(appearance),
        };
        if let Some(known) = known.filter(|c| c.stamp == stamp(graph, &c.deps)) {
            return known.clone();
        }
        let mut made = make(graph, appearance, own, parts);
        made.stamp = stamp(graph, &made.deps);
        match own {
            Some(geometry) => drop(self.by_geometry.insert((appearance, geometry), made.clone())),
            None => drop(self.cache.insert(appearance, made.clone())),
        }
        made
    }

    /// Every material with a shader is made anew, for the text may be another one.
    pub(super) fn forget_shaders(&mut self) {
        self.cache.retain(|_, cached| !cached.has_shader);
        self.by_geometry.retain(|_, cached| !cached.has_shader);
    }

    /// Forgets materials of dead nodes.
    pub(super) fn sweep(&mut self, graph: &Graph) {
        self.cache.retain(|node, _| graph.contains(node));
        self.by_geometry.retain(|(appearance, geometry), _| graph.contains(*appearance) && graph.contains(*geometry));
    }
}

/// Where materials get what they are made of.
pub(super) struct Parts<'a> {
    pub(super) pictures: &'a mut Pictures,
    pub(super) shaders: &'a mut Shaders,
    pub(super) projections: &'a mut Projections,
    pub(super) problems: &'a mut Problems,
}

/// What a shape without a material looks like: matt light grey, as X3D's default Material.
fn plain(name: String) -> Material {
    Material {
        name,
        base_color: Vec4::new(0.8, 0.8, 0.8, 1.0),
        shading: Shading::Phong { specular: Vec3::ZERO, exponent: 0.2 * 128.0, ambient_intensity: 0.2 },
        ..Material::default()
    }
}

fn make(graph: &Graph, appearance: NodeId, geometry: Option<NodeId>, parts: &mut Parts<'_>) -> CachedMaterial {
    let look = Reader::new(graph, appearance);
    let mut deps = vec![appearance];
    let mut made = match look.node("material") {
        None => plain(name_of(graph, appearance)),
        Some(node) => {
            deps.push(node);
            let read = Reader::new(graph, node);
            let mut texture = |field: &str| texture(graph, &read, field, parts.pictures, parts.problems, &mut deps);
            let made = surface(graph, &read, &mut texture);
            finite_or_plain(graph, node, made, parts.problems)
        }
    };
    let Stack { base, layers } = layers(&look, geometry, made.base_color_texture.is_none(), parts, &mut deps);
    made.base_color_texture = base.or(made.base_color_texture);
    made.layers = layers;
    made.alpha = match look.choice("alpha_mode") {
        1 => AlphaMode::Opaque,
        2 => AlphaMode::Mask { cutoff: look.get("alpha_cutoff") },
        3 => AlphaMode::Blend,
        _ if made.base_color.w < 1.0 => AlphaMode::Blend,
        _ => AlphaMode::Opaque,
    };
    made.double_sided = look.get("double_sided");
    let shader_node = look.node("shader");
    if let Some(node) = shader_node {
        deps.push(node);
        made.shader = shader(graph, node, (&parts.pictures.asset_root, parts.shaders), parts.problems);
    }
    let has_shader = shader_node.is_some();
    let casts_shadow = look.get("shadow_caster") && (made.alpha != AlphaMode::Blend || look.get("transparent_caster"));
    let receives = (!look.nodes("receive_shadows").is_empty()).then(|| parts.projections.receive_lists.of(appearance));
    CachedMaterial { material: Arc::new(made), casts_shadow, receives, deps, has_shader, stamp: (0, 0) }
}

fn surface(graph: &Graph, read: &Reader<'_>, texture: &mut dyn FnMut(&str) -> Option<TextureRef>) -> Material {
    let name = name_of(graph, read.node);
    let node_type = graph.type_of(read.node);
    let alpha = 1.0 - read.get::<f32>("transparency").clamp(0.0, 1.0);
    match &*node_type.name {
        "PhysicalMaterial" => Material {
            shading: Shading::MetallicRoughness { metallic: read.get("metallic"), roughness: read.get("roughness") },
            base_color: read.color("base_color").extend(alpha),
            base_color_texture: texture("base_texture"),
            metallic_roughness_texture: texture("metallic_roughness_texture"),
            ..common(name, read, texture)
        },
        "Material" => Material {
            shading: Shading::Phong {
                specular: read.color("specular_color"),
                exponent: (128.0 * read.get::<f32>("shininess")).max(1.0),
                ambient_intensity: read.get("ambient_intensity"),
            },
            base_color: read.color("diffuse_color").extend(alpha),
            base_color_texture: texture("diffuse_texture"),
            ..common(name, read, texture)
        },
        // The picture of an unlit surface is its colour, and nothing is emitted on top.
        "UnlitMaterial" => Material {
            name,
            shading: Shading::Unlit,
            base_color: read.color("emissive_color").extend(alpha),
            base_color_texture: texture("emissive_texture"),
            ..Material::default()
        },
        _ => plain(name),
    }
}

/// What Material and PhysicalMaterial have in common.
fn common(name: String, read: &Reader<'_>, texture: &mut dyn FnMut(&str) -> Option<TextureRef>) -> Material {
    Material {
        name,
        emissive: read.color("emissive_color"),
        emissive_texture: texture("emissive_texture"),
        normal_texture: texture("normal_texture"),
        normal_scale: read.get("normal_scale"),
        occlusion_texture: texture("occlusion_texture"),
        occlusion_strength: read.get("occlusion_strength"),
        ..Material::default()
    }
}

/// A material with numbers that are not finite is reported and replaced.
fn finite_or_plain(graph: &Graph, node: NodeId, made: Material, problems: &mut Problems) -> Material {
    let shading = match made.shading {
        Shading::MetallicRoughness { metallic, roughness } => metallic + roughness,
        Shading::Phong { specular, exponent, ambient_intensity } => specular.element_sum() + exponent + ambient_intensity,
        Shading::Unlit => 0.0,
    };
    let all = made.base_color.element_sum() + made.emissive.element_sum() + made.normal_scale + made.occlusion_strength + shading;
    let broken = !all.is_finite();
    problems.set(graph, node, "material", broken.then(|| "a number is not finite; shown in plain grey".to_owned()));
    if broken { plain(made.name) } else { made }
}
