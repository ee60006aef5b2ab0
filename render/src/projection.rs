//! Lists of the shaders about what receives and what is projected.

use crate::lights::Lights;
use crate::maps::{Maps, projector};
use crate::uniforms::{NOWHERE, ShadowTexture};
use glam::{Mat4, Vec3};
use umbriel_scene::{Aabb, Frustum, Picture, Projector, Scene, View};

/// The lists, never empty, as buffers want them.
pub(crate) struct ProjectionLists {
    /// A bit for each light of the GPU's list, list after list.
    pub(crate) receive: Vec<u32>,
    /// Words of each list.
    pub(crate) receive_words: u32,
    /// Zero where there is nothing to project.
    pub(crate) projectors: Vec<[[f32; 4]; 4]>,
    pub(crate) shadow_textures: Vec<ShadowTexture>,
}

/// Lists of the frame. `casters` is a box around what casts.
pub(crate) fn lists(scene: &Scene, pictures: &[Picture], lights: &Lights, maps: &Maps, casters: Aabb) -> ProjectionLists {
    let words = lights.order.len().div_ceil(32).max(1);
    let mut receive = vec![0; words * scene.receive_lists.len().max(1)];
    for (list, bits) in scene.receive_lists.iter().zip(receive.chunks_mut(words)) {
        for place in list.iter().filter_map(|light| lights.place_of(*light)) {
            bits[place / 32] |= 1 << (place % 32);
        }
    }
    let clip_from_world = |p: &Option<Projector>| {
        let found = p.as_ref().and_then(|p| clip_from_world(p, scene, pictures, casters)).filter(Mat4::is_finite);
        found.unwrap_or(Mat4::ZERO).to_cols_array_2d()
    };
    let mut projectors: Vec<_> = scene.projectors.iter().map(clip_from_world).collect();
    projectors.resize(projectors.len().max(1), [[0.0; 4]; 4]);
    let texture = |light: &Option<usize>| {
        let place = light.and_then(|light| Some(lights.order.len() + lights.dark.iter().position(|d| *d == light)?));
        let [near, far] = light.map_or([0.0, 1.0], |light| maps.range_of(light));
        ShadowTexture { light: place.map_or(NOWHERE, |p| p as u32), near, far }
    };
    let mut shadow_textures: Vec<_> = scene.shadow_textures.iter().map(texture).collect();
    shadow_textures.resize(shadow_textures.len().max(1), texture(&None));
    ProjectionLists { receive, receive_words: words as u32, projectors, shadow_textures }
}

fn clip_from_world(from: &Projector, scene: &Scene, pictures: &[Picture], casters: Aabb) -> Option<Mat4> {
    match from {
        Projector::Light(light) => projector(scene.lights.get(*light)?, casters),
        Projector::Viewpoint { world_from_view, angle_rad, world_from_camera } => {
            let near = 1e-3;
            let square = Frustum::symmetric(*angle_rad, 1.0, near);
            let camera = pictures.iter().flat_map(|p| &p.views).find(|view| looks_from(view, world_from_camera));
            let frustum = camera.map_or(square, |view| {
                // The camera's window, without the shift of an eye.
                let f = &view.frustum;
                let (width, height) = ((f.right - f.left) / f.near * near, (f.top - f.bottom) / f.near * near);
                Frustum { left: -0.5 * width, right: 0.5 * width, bottom: -0.5 * height, top: 0.5 * height, near }
            });
            Some(frustum.clip_from_view() * world_from_view.inverse())
        }
    }
}

/// Half the distance of two eyes, and some, metres.
const EYE_OFFSET_M: f32 = 0.05;

/// Does a view look through a viewpoint whose camera stands here? The eyes of a stereo view stand beside it.
fn looks_from(view: &View, world_from_camera: &Mat4) -> bool {
    let view_from_camera = view.view_from_world * *world_from_camera;
    let turns = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| view_from_camera.transform_vector3(axis).dot(axis));
    turns.into_iter().all(|t| t > 1.0 - 1e-5) && view_from_camera.w_axis.truncate().length() < EYE_OFFSET_M
}
