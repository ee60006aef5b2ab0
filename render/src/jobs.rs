//! What the shadow volumes are made of: one job per light that is added outside its shadow, one per film.

use crate::cache::{GpuMaterial, GpuMesh, Slab};
use crate::cutouts::{Cutout, CutoutJob};
use crate::deform::{Deformed, Deformer};
use crate::draws::{Casting, Draws};
use crate::lights::{Lights, leaves_holes_to_maps};
use crate::plan::{BLACK_FILM, Purpose};
use crate::slots::Slots;
use crate::stats::Problems;
use crate::volumes::{self, Cone, Receiver, Seen, Surface, TurnedBox, VolumeCaster, VolumeJob, VolumeLight};
use crate::{enclosed, uniforms};
use glam::{Mat4, Vec3, Vec4};
use std::sync::Arc;
use umbriel_scene::{
    Aabb, AlphaMode, Drawable, Light, LightKind, Material, Mesh, Scene, ShadowMethod, StencilGroup, StencilMode, Topology,
};

/// All jobs of the frame.
#[derive(Default)]
pub(crate) struct Jobs {
    pub(crate) volumes: Vec<VolumeJob>,
    /// What has holes, by the place of its volumes' job.
    pub(crate) cutouts: Vec<CutoutJob>,
    /// What each is for.
    pub(crate) purposes: Vec<Purpose>,
}

/// What casters are made of.
pub(crate) struct Things<'a> {
    pub(crate) draws: &'a Draws,
    pub(crate) meshes: &'a Slab<Mesh, Option<GpuMesh>>,
    pub(crate) materials: &'a Slab<Material, GpuMaterial>,
    pub(crate) deformer: &'a Deformer,
}

/// All jobs of the frame. Films are added to `films`.
pub(crate) fn jobs(
    scene: &Scene,
    lights: &Lights,
    things: &Things<'_>,
    films: &mut Slots<uniforms::Film>,
    problems: &mut Problems,
) -> Jobs {
    let black = films.push(&uniforms::Film { color: [0.0, 0.0, 0.0, 1.0] });
    debug_assert_eq!(black, BLACK_FILM);
    let mut jobs = Jobs::default();
    problems.begin_standing();
    let is_film = |group: &StencilGroup| matches!(group.mode, StencilMode::Modulative(_));
    if lights.order.len() == lights.in_surface_pass && !scene.stencil_groups.iter().any(is_film) {
        return jobs;
    }
    let draws = things.draws;
    let receivers = receivers(draws.drawn().map(|(i, _)| i), scene);
    let mut enclosed = Vec::new();
    let mut push = |source: &Light, light: VolumeLight, members: &mut dyn Iterator<Item = usize>, purpose: Purpose| {
        let (mut casters, mut cutouts) = (Vec::new(), Vec::new());
        for index in members {
            match draws.holed_by(index) {
                None => {
                    casters.extend(things.caster(scene, index));
                    enclosed.extend(enclosed::problem_of(source, scene, things, index));
                }
                Some(material) => cutouts.extend(things.cutout(scene, index, material)),
            }
        }
        jobs.volumes.push(VolumeJob { light, casters, receivers });
        jobs.cutouts.push(CutoutJob { light, receivers, cutouts });
        jobs.purposes.push(purpose);
    };
    for (place, &index) in lights.order.iter().enumerate().skip(lights.in_surface_pass) {
        let light = &scene.lights[index];
        let (volume, purpose) = (volume_light(light), Purpose::Light(place));
        if light.shadows == ShadowMethod::Volume {
            let takes_holes = !leaves_holes_to_maps(light);
            let casts = |casting| casting == Casting::Whole || casting == Casting::Holed && takes_holes;
            push(light, volume, &mut draws.drawn().filter(|(_, casting)| casts(*casting)).map(|(index, _)| index), purpose);
        } else {
            let groups = scene.stencil_groups.iter().filter(|g| g.light == index && g.mode == StencilMode::Additive);
            let mut members: Vec<usize> = groups.flat_map(|g| g.casters.iter().copied()).collect();
            members.sort_unstable();
            members.dedup();
            push(light, volume, &mut members.into_iter(), purpose);
        }
    }
    for group in &scene.stencil_groups {
        let StencilMode::Modulative(film) = group.mode else { continue };
        if lights.place_of(group.light).is_none() {
            continue;
        }
        let light = &scene.lights[group.light];
        if light.shadows != ShadowMethod::None {
            let by = if light.shadows == ShadowMethod::Map { "map" } else { "volume" };
            problems.report(format!(
                "stencil shadow '{}': its light '{}' casts by {by} already, so its film is left out: nothing is darkened twice. \
                 Set `shadows` of the light to none, or `mode` to additive",
                group.name, light.name
            ));
            continue;
        }
        let [r, g, b, a] = film.color.to_array();
        let a = a * light.shadow_intensity.clamp(0.0, 1.0);
        let film = films.push(&uniforms::Film { color: [r * a, g * a, b * a, a] });
        // A film darkens what is outside of the cone too.
        let everywhere = VolumeLight { cone: None, ..volume_light(light) };
        push(light, everywhere, &mut group.casters.iter().copied(), Purpose::Film { film, light: group.light });
    }
    enclosed.into_iter().for_each(|message| problems.report_standing(message));
    jobs
}

fn volume_light(light: &Light) -> VolumeLight {
    let toward_light: Vec4 = match light.kind {
        LightKind::Directional => -light.direction.normalize_or(Vec3::NEG_Z).extend(0.0),
        _ => light.position.extend(1.0),
    };
    let range = if toward_light.w == 0.0 { f32::INFINITY } else { light.range };
    let cone = match light.kind {
        LightKind::Spot { outer_rad, .. } => Some(Cone { direction: light.direction.normalize_or(Vec3::NEG_Z), outer_rad }),
        _ => None,
    };
    VolumeLight { toward_light, range, cone, settings: light.volume }
}

/// Box around those of the drawables that shadows may fall on; empty where one of these has no bounds.
pub(crate) fn receivers(drawables: impl Iterator<Item = usize>, scene: &Scene) -> Aabb {
    let mut all = Aabb::EMPTY;
    for index in drawables {
        let d = &scene.drawables[index];
        if d.receives_shadow && d.material.alpha != AlphaMode::Blend {
            if d.bounds_in_world.is_empty() {
                return Aabb::EMPTY;
            }
            all = all.union(d.bounds_in_world);
        }
    }
    all
}

/// Box around a drawable, as small as is known.
fn bounds_of(drawable: &Drawable, is_deformed: bool) -> TurnedBox {
    if is_deformed || drawable.bounds_in_world.is_empty() || drawable.mesh.bounds.is_empty() {
        return TurnedBox::straight(drawable.bounds_in_world);
    }
    TurnedBox::of(&drawable.mesh.bounds, &drawable.world_from_object)
}

/// What is known of the surfaces that a view shows; none where a receiver has no bounds.
pub(crate) fn seen(drawables: impl Iterator<Item = usize>, scene: &Scene, view_from_world: &Mat4) -> Option<Seen> {
    let eye = view_from_world.inverse().w_axis.truncate().as_dvec3();
    let mut seen = Seen::default();
    for index in drawables {
        let d = &scene.drawables[index];
        let receives = d.receives_shadow && d.material.alpha != AlphaMode::Blend;
        if receives && d.bounds_in_world.is_empty() {
            return None;
        }
        let is_known = d.pose.is_none() && d.mesh.topology == Topology::Triangles && d.mesh.triangle_count() <= MOST_FACES;
        let mut known = is_known.then(Vec::new);
        if let Some(known) = &mut known {
            let front = if d.world_from_object.determinant() < 0.0 { -1.0 } else { 1.0 };
            let hides = d.material.alpha == AlphaMode::Opaque && d.material.shader.is_none();
            for face in volumes::faces(&d.mesh, &d.world_from_object) {
                let over = if d.material.double_sided { f64::INFINITY } else { front * face.distance_to(eye) };
                seen.hiding.extend((hides && over > 0.0).then_some(face));
                known.extend((over > -face.margin()).then_some(face));
            }
        }
        if receives {
            seen.receivers.push(Receiver { bounds: bounds_of(d, d.pose.is_some()), faces: known });
        }
    }
    Some(seen)
}

/// Triangles of a mesh whose faces are looked at one by one: walls, quays, grounds.
const MOST_FACES: usize = 64;

/// A shape as it is drawn.
struct Shape<'a> {
    drawable: &'a Drawable,
    mesh: &'a Arc<Mesh>,
    rest: &'a GpuMesh,
    deformed: Option<&'a Deformed>,
}

impl Shape<'_> {
    fn positions(&self) -> wgpu::Buffer {
        self.deformed.map_or(&self.rest.positions, |d| &d.positions).clone()
    }

    fn bounds(&self) -> TurnedBox {
        bounds_of(self.drawable, self.deformed.is_some())
    }
}

impl<'a> Things<'a> {
    fn shape(&self, scene: &'a Scene, index: usize) -> Option<Shape<'a>> {
        let (mesh, deformed) = self.draws.mesh_of(index)?;
        Some(Shape {
            drawable: scene.drawables.get(index)?,
            mesh: self.meshes.key(mesh)?,
            rest: self.meshes.get(mesh)?.as_ref()?,
            deformed: deformed.and_then(|d| self.deformer.get(d)),
        })
    }

    fn caster(&self, scene: &Scene, index: usize) -> Option<VolumeCaster> {
        let shape = self.shape(scene, index)?;
        let Shape { drawable, deformed, .. } = shape;
        Some(VolumeCaster {
            mesh: shape.mesh.clone(),
            positions: shape.positions(),
            positions_revision: deformed.map_or(0, |d| d.revision),
            world_from_object: drawable.world_from_object,
            bounds: shape.bounds(),
            surface: match drawable.material.alpha {
                AlphaMode::Opaque if drawable.material.double_sided => Surface::BothSides,
                AlphaMode::Opaque if deformed.is_none() => Surface::Front,
                _ => Surface::InParts,
            },
        })
    }

    fn cutout(&self, scene: &Scene, index: usize, material: u32) -> Option<Cutout> {
        let shape = self.shape(scene, index).filter(|shape| shape.rest.topology == Topology::Triangles)?;
        let rest = shape.rest;
        Some(Cutout {
            positions: shape.positions(),
            indices: rest.indices.clone(),
            attributes: rest.attributes.clone(),
            triangle_count: rest.index_count / 3,
            material: self.materials.get(material)?.group.clone(),
            world_from_object: shape.drawable.world_from_object,
            bounds: shape.bounds(),
        })
    }
}
