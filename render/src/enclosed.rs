//! Lights inside of what casts their shadows: all else is dark then, and rightly so, but seldom meant.

use crate::jobs::Things;
use glam::Vec3;
use umbriel_scene::{Drawable, Light, LightKind, Scene};

/// Meshes with more triangles are not looked at: each look takes all of them, in every frame.
const MOST_TRIANGLES: usize = 1 << 16;

/// What the author of the world should know where the light stands inside of a shape that casts. Only what is certain is told: the
/// shape is closed and shows its outside.
pub(crate) fn problem_of(light: &Light, scene: &Scene, things: &Things<'_>, index: usize) -> Option<String> {
    let d = scene.drawables.get(index)?;
    let is_near = light.kind != LightKind::Directional && contains(d, light.position);
    if !is_near || light.shadow_intensity <= 0.0 || d.pose.is_some() || d.mesh.triangle_count() > MOST_TRIANGLES {
        return None;
    }
    let mesh = things.meshes.get(things.draws.mesh_of(index)?.0)?.as_ref()?;
    let place = d.world_from_object.inverse().transform_point3(light.position);
    if !mesh.is_closed(&d.mesh) || d.mesh.winding_around(place) <= 0 {
        return None;
    }
    let stand_in = scene.stand_ins.iter().find(|s| s.place == index);
    if (d.material.double_sided || stand_in.is_some()) && is_room(d, scene, things) {
        return None;
    }
    let seen = stand_in.and_then(|s| scene.drawables.get(s.of)).unwrap_or(d);
    Some(format!(
        "light '{}' is inside of '{}', which is closed: all that is outside of it is in its shadow. Move the light, or set \
         `cast_shadow` of the shape to false",
        light.name, seen.name
    ))
}

fn contains(d: &Drawable, place: Vec3) -> bool {
    let bounds = &d.bounds_in_world;
    place.cmpge(bounds.min).all() && place.cmple(bounds.max).all()
}

/// A box around people and things may be a room that is lit from within.
fn is_room(d: &Drawable, scene: &Scene, things: &Things<'_>) -> bool {
    let holds = |other: &Drawable| contains(d, other.bounds_in_world.min) && contains(d, other.bounds_in_world.max);
    let mut others = things.draws.drawn().filter_map(|(place, _)| scene.drawables.get(place));
    others.any(|other| !std::ptr::eq(other, d) && other.receives_shadow && holds(other))
}
