//! The lights of a frame in the order in which the passes take them.

use crate::{soft, uniforms};
use glam::Vec3;
use umbriel_scene::{Light, LightKind, MapFilter, Scene, ShadowMethod, StencilMode};

/// Lights by pass: those of the surface pass first, then those that are added one by one outside their stencil shadows.
#[derive(Default)]
pub(crate) struct Lights {
    /// Places in [`Scene::lights`], in the order of the GPU's list.
    pub(crate) order: Vec<usize>,
    /// How many of them the surface pass takes.
    pub(crate) in_surface_pass: usize,
    /// Places of those that do not shine, which follow in the GPU's list: textures show their maps.
    pub(crate) dark: Vec<usize>,
}

impl Lights {
    pub(crate) fn new(scene: &Scene) -> Lights {
        let is_masked = |i: usize| scene.lights[i].shadows == ShadowMethod::Volume || has_additive_group(scene, i);
        let (masked, mut order): (Vec<usize>, Vec<usize>) = (0..scene.lights.len())
            .filter(|i| scene.lights[*i].shines && is_sound(&scene.lights[*i]))
            .partition(|i| is_masked(*i));
        let in_surface_pass = order.len();
        order.extend(masked);
        let dark =
            scene.shadow_textures.iter().flatten().copied().filter(|i| scene.lights.get(*i).is_some_and(is_sound)).collect();
        Lights { order, in_surface_pass, dark }
    }

    /// All lights of the GPU's list, as places in [`Scene::lights`].
    pub(crate) fn all(&self) -> impl Iterator<Item = usize> + '_ {
        self.order.iter().chain(&self.dark).copied()
    }

    /// Place of a scene's light in the GPU's list.
    pub(crate) fn place_of(&self, light: usize) -> Option<usize> {
        self.order.iter().position(|i| *i == light)
    }
}

/// Does a light draw maps: for shapes in general, or for those that list it? Volumes may leave to maps what has holes.
pub(crate) fn draws_map(scene: &Scene, light: usize, any_caster_has_holes: bool) -> bool {
    let is_listed = || scene.receive_lists.iter().any(|list| list.contains(&light));
    is_sound(&scene.lights[light])
        && match scene.lights[light].shadows {
            ShadowMethod::Map => true,
            ShadowMethod::None => is_listed(),
            ShadowMethod::Volume => {
                any_caster_has_holes && scene.lights[light].shines && leaves_holes_to_maps(&scene.lights[light])
            }
        }
}

/// Are a light's maps of casters with holes alone?
pub(crate) fn maps_holes_only(light: &Light) -> bool {
    light.shadows == ShadowMethod::Volume
}

/// Do the volumes of a light leave to maps what has holes: by choice, or because outlines of holes have penumbrae by maps alone?
pub(crate) fn leaves_holes_to_maps(light: &Light) -> bool {
    light.shadows == ShadowMethod::Volume && (light.volume.holes_by_map || soft::size_of(light) > 0.0)
}

/// Does the shadow of a light fall on a drawable?
pub(crate) fn falls_on(scene: &Scene, light: usize, drawable: usize) -> bool {
    let d = &scene.drawables[drawable];
    let lists_it = |list: usize| scene.receive_lists.get(list).is_some_and(|list| list.contains(&light));
    d.receives_shadow && d.receives.is_none_or(lists_it)
}

/// Finite numbers and a direction: anything else is left out.
pub(crate) fn is_sound(light: &Light) -> bool {
    let numbers = [light.position, light.direction, light.color, light.attenuation];
    numbers.iter().all(|v| v.is_finite()) && light.intensity.is_finite() && light.direction != Vec3::ZERO
}

/// Is a light masked by a group's shadow?
pub(crate) fn has_additive_group(scene: &Scene, light: usize) -> bool {
    scene.stencil_groups.iter().any(|g| g.light == light && g.mode == StencilMode::Additive)
}

/// A light for the shaders. `faces` are its faces in the list of map faces: first and count.
pub(crate) fn uniform_of(light: &Light, faces: (u32, u32)) -> uniforms::Light {
    let (kind, cos_inner, cos_outer) = match light.kind {
        LightKind::Directional => (0, 1.0, -1.0),
        LightKind::Spot { inner_rad, outer_rad } => (1, inner_rad.min(outer_rad).cos(), outer_rad.cos()),
        LightKind::Point => (2, 1.0, -1.0),
    };
    let map = &light.map;
    uniforms::Light {
        position: light.position.to_array(),
        kind,
        direction: light.direction.normalize_or(Vec3::NEG_Z).to_array(),
        range: light.range.min(f32::MAX),
        color: (light.color * light.intensity).to_array(),
        shadow_intensity: light.shadow_intensity.clamp(0.0, 1.0),
        ambient: (light.color * light.ambient_intensity).to_array(),
        cos_outer,
        attenuation: light.attenuation.to_array(),
        cone_scale: 1.0 / (cos_inner - cos_outer).max(1e-4),
        first_face: faces.0,
        face_count: faces.1,
        filter_width: match filter_of(light) {
            MapFilter::None => 0.0,
            MapFilter::Hardware => 1.0,
            MapFilter::Pcf4 => 2.0,
            MapFilter::Pcf16 | MapFilter::Poisson | MapFilter::Pcss => 4.0,
        },
        slope_bias: map.slope_bias.map_or(-1.0, |b| b.max(0.0)),
        constant_bias: map.constant_bias.map_or(-1.0, |b| b.max(0.0)),
        map_flags: map_flags(light, faces.1),
        size: light.size.max(0.0),
        flags: if light.shadows == ShadowMethod::None { 0 } else { uniforms::Light::CASTS },
    }
}

/// What soft volumes leave to maps is as soft.
fn filter_of(light: &Light) -> MapFilter {
    if maps_holes_only(light) && light.soft { MapFilter::Pcss } else { light.map.filter }
}

fn map_flags(light: &Light, face_count: u32) -> u32 {
    use uniforms::Light as L;
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    flag(light.kind != LightKind::Directional && face_count == 6, L::MAP_CUBE)
        | flag(light.map.outside_in_shadow && light.map.frustum.is_some(), L::MAP_DARK_OUTSIDE)
        | flag(filter_of(light) == MapFilter::Poisson, L::MAP_POISSON)
        | flag(filter_of(light) == MapFilter::Pcss, L::MAP_PCSS)
}
