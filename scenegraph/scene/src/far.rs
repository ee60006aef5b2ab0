//! Worlds far from the origin, moved to where numbers are fine.
//!
//! Single precision knows a place 10 km out to a millimetre, which is coarser than texels of a map and than the pixels that normals follow
//! from. Places near the eye have coordinates of its size, so their difference to a place near it is exact: the whole frame is moved
//! before anything is computed from it.

use crate::{Picture, Projector, Scene};
use glam::{Mat4, Vec3};

/// Within this distance of an origin numbers are fine enough, metres: steps of 0.06 mm.
const FINE_M: f32 = 800.0;
/// Origins lie on a grid of this many metres.
const GRID_M: f32 = 512.0;

/// A place near the eyes of a frame, to draw it around. It stays what it was `before` as long as eyes are near it, so that nothing
/// changes from frame to frame.
pub fn origin_near_eyes(before: Vec3, pictures: &[Picture]) -> Vec3 {
    let Some(view) = pictures.iter().flat_map(|p| &p.views).next() else { return before };
    let eye = view.view_from_world.inverse().w_axis.truncate();
    if !eye.is_finite() || eye.distance(before) <= FINE_M {
        return before;
    }
    if eye.length() <= FINE_M { Vec3::ZERO } else { (eye / GRID_M).round() * GRID_M }
}

/// A pose, seen from another origin.
fn moved(pose: &Mat4, origin: Vec3) -> Mat4 {
    let mut pose = *pose;
    pose.w_axis -= (origin * pose.w_axis.w).extend(0.0);
    pose
}

impl Scene {
    /// The same with `origin` at zero.
    pub fn around(&self, origin: Vec3) -> Scene {
        let mut scene = self.clone();
        for d in &mut scene.drawables {
            d.world_from_object = moved(&d.world_from_object, origin);
            // An empty box is infinite and stays so.
            d.bounds_in_world.min -= origin;
            d.bounds_in_world.max -= origin;
        }
        for light in &mut scene.lights {
            light.position -= origin;
            light.volume.lower_plane = light.volume.lower_plane.map(|p| p.truncate().extend(p.w + p.truncate().dot(origin)));
        }
        for projector in scene.projectors.iter_mut().flatten() {
            if let Projector::Viewpoint { world_from_view, world_from_camera, .. } = projector {
                *world_from_view = moved(world_from_view, origin);
                *world_from_camera = moved(world_from_camera, origin);
            }
        }
        scene.world_from_room *= Mat4::from_translation(origin);
        scene
    }
}

impl Picture {
    /// The same with `origin` at zero.
    pub fn around(&self, origin: Vec3) -> Picture {
        let mut picture = self.clone();
        picture.views.iter_mut().for_each(|view| view.view_from_world *= Mat4::from_translation(origin));
        picture
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Aabb, Frustum, Light, View};
    use glam::{Vec4, Vec4Swizzles};

    fn picture(eye: Vec3) -> Picture {
        let frustum = Frustum::symmetric(1.0, 1.0, 0.1);
        Picture::mono(View { name: "v".into(), view_from_world: Mat4::from_translation(-eye), frustum, size: [8, 8] })
    }

    #[test]
    fn origins_follow_in_steps() {
        let far = Vec3::new(1e6, 0.0, 3e5);
        for (name, before, eye, expected) in [
            ("at home", Vec3::ZERO, Vec3::new(300.0, 2.0, 400.0), Vec3::ZERO),
            ("out", Vec3::ZERO, far, Vec3::new(999_936.0, 0.0, 300_032.0)),
            ("a step there", Vec3::new(999_936.0, 0.0, 300_032.0), far + Vec3::X * 500.0, Vec3::new(999_936.0, 0.0, 300_032.0)),
            ("back", Vec3::new(999_936.0, 0.0, 300_032.0), Vec3::ONE, Vec3::ZERO),
            ("nowhere", Vec3::ZERO, Vec3::NAN, Vec3::ZERO),
        ] {
            assert_eq!(origin_near_eyes(before, &[picture(eye)]), expected, "{name}");
        }
        assert_eq!(origin_near_eyes(Vec3::X, &[]), Vec3::X);
    }

    #[test]
    fn all_moves_alike() {
        let origin = Vec3::new(1024.0, -512.0, 2048.0);
        let mut light = Light { position: origin + Vec3::Y, ..Light::default() };
        light.volume.lower_plane = Some(Vec4::new(0.0, 1.0, 0.0, 510.0));
        let viewpoint = Mat4::from_translation(origin + Vec3::Z);
        let projector = Projector::Viewpoint { world_from_view: viewpoint, angle_rad: 1.0, world_from_camera: viewpoint };
        let scene = Scene { lights: vec![light], projectors: vec![Some(projector), None], ..Scene::default() };
        let here = scene.around(origin);
        assert_eq!(here.lights[0].position, Vec3::Y);
        // 2 m below the light's foot: as far above the plane as before.
        let height = |scene: &Scene, p: Vec3| scene.lights[0].volume.lower_plane.unwrap().dot(p.extend(1.0));
        assert_eq!(height(&here, Vec3::ZERO), height(&scene, origin));
        let Some(Projector::Viewpoint { world_from_view, .. }) = &here.projectors[0] else { panic!("a viewpoint") };
        assert_eq!(world_from_view.w_axis.xyz(), Vec3::Z);
        assert_eq!(here.world_from_room.transform_point3(Vec3::ZERO), origin);
        let p = Vec3::new(1.0, 2.0, 3.0);
        let seen = picture(origin).around(origin).views[0].view_from_world.transform_point3(p);
        assert_eq!(seen, p);
        assert!(Aabb { min: Aabb::EMPTY.min - origin, max: Aabb::EMPTY.max - origin }.is_empty());
    }
}
