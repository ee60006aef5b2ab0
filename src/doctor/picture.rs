//! Before and after, side by side, with the faulty edges drawn in.

use crate::headless::describe;
use crate::png;
use glam::{Mat4, Vec3, Vec4};
use std::path::Path;
use std::sync::Arc;
use umbriel_displays::rig::fit_camera;
use umbriel_render::{Gpu, Renderer, RgbaPixels};
use umbriel_scene::doctor::faulty_edges;
use umbriel_scene::{Aabb, Drawable, Frustum, Light, Material, Mesh, Picture, Scene, Shading, ShadowMethod, View};

type Failure = Box<dyn std::error::Error>;

/// Pixels of each half.
const SIZE: [u32; 2] = [640, 640];
const FIELD_OF_VIEW_RAD: f32 = 0.7;
/// More edges of a kind than this are not drawn.
const MOST_EDGES: usize = 50_000;
/// Width of a drawn edge, as share of the whole.
const WIDTH: f32 = 0.003;

/// Draws both states of the meshes from the same side.
pub(super) fn write(path: &Path, before: &[(Mesh, Mat4)], after: &[(Mesh, Mat4)]) -> Result<(), Failure> {
    let bounds = before.iter().fold(Aabb::EMPTY, |b, (mesh, m)| b.union(mesh.bounds.transformed(m)));
    let camera = fit_camera(&bounds, FIELD_OF_VIEW_RAD, 1.0);
    let view = View {
        name: "doctor".to_owned(),
        view_from_world: camera.room_from_camera.inverse(),
        frustum: Frustum::symmetric(camera.fov_rad, 1.0, camera.near),
        size: SIZE,
    };
    let gpu = Gpu::new(None)?;
    let mut renderer = Renderer::new(&gpu)?;
    let mut halves: Vec<RgbaPixels> = Vec::new();
    for meshes in [before, after] {
        let scene = scene(meshes, WIDTH * bounds.radius(), camera.room_from_camera);
        renderer.render(&scene, &[Picture::mono(view.clone())])?;
        renderer.problems().iter().for_each(|problem| tracing::warn!("{problem}"));
        halves.extend(renderer.read_back(0)?);
    }
    Ok(png::write(path, &png::row(&halves), &describe(&gpu))?)
}

fn scene(meshes: &[(Mesh, Mat4)], width: f32, world_from_camera: Mat4) -> Scene {
    let front = material(Vec3::splat(0.6), false);
    let back = material(Vec3::new(0.15, 0.3, 0.9), false);
    let kinds = [Vec3::new(1.0, 0.05, 0.03), Vec3::new(0.9, 0.0, 0.9), Vec3::new(1.0, 0.8, 0.0)].map(|c| material(c, true));
    // Backs lie a little behind, so that fronts hide those of thin bodies.
    let eye = world_from_camera.transform_point3(Vec3::ZERO);
    let behind = Mat4::from_translation(eye) * Mat4::from_scale(Vec3::splat(1.001)) * Mat4::from_translation(-eye);
    let mut drawables = Vec::new();
    for (mesh, world_from_mesh) in meshes.iter().filter(|(m, _)| m.triangle_count() > 0) {
        let Ok(mesh) = mesh.clone().checked() else { continue };
        let edges = faulty_edges(&mesh);
        drawables.push(drawable(mesh.clone(), &front, *world_from_mesh));
        drawables.push(drawable(turned(&mesh), &back, behind * *world_from_mesh));
        for (edges, material) in [edges.open, edges.crowded, edges.clashing].iter().zip(&kinds) {
            let places = edges.iter().take(MOST_EDGES).map(|e| e.map(|p| world_from_mesh.transform_point3(p)));
            let bars = bars(places, width);
            if bars.triangle_count() > 0 {
                drawables.push(drawable(bars, material, Mat4::IDENTITY));
            }
        }
    }
    let background = umbriel_scene::Background { zenith: Vec3::ONE, horizon: Vec3::ONE, nadir: Vec3::ONE };
    Scene {
        drawables: drawables.into(),
        lights: vec![light(world_from_camera)],
        ambient: Vec3::splat(0.35),
        background,
        ..Scene::default()
    }
}

fn light(world_from_camera: Mat4) -> Light {
    let direction = world_from_camera.transform_vector3(Vec3::new(0.4, -0.5, -1.0)).normalize();
    Light { direction, intensity: 2.2, shadows: ShadowMethod::None, ..Light::default() }
}

fn material(color: Vec3, is_unlit: bool) -> Arc<Material> {
    let base_color: Vec4 = color.extend(1.0);
    let shading = if is_unlit { Shading::Unlit } else { Material::default().shading };
    Arc::new(Material { base_color, shading, double_sided: is_unlit, ..Material::default() })
}

/// As seen from behind.
fn turned(mesh: &Mesh) -> Mesh {
    Mesh {
        indices: mesh.indices.chunks_exact(3).flat_map(|t| [t[0], t[2], t[1]]).collect(),
        normals: mesh.normals.iter().map(|n| -*n).collect(),
        ..mesh.clone()
    }
}

/// A three-sided bar along each edge.
fn bars(edges: impl Iterator<Item = [Vec3; 2]>, width: f32) -> Mesh {
    let (mut positions, mut indices): (Vec<Vec3>, Vec<u32>) = (Vec::new(), Vec::new());
    for [a, b] in edges {
        let (right, up) = (b - a).normalize_or(Vec3::Y).any_orthonormal_pair();
        let first = positions.len() as u32;
        let corners = [right, -0.5 * right + 0.866 * up, -0.5 * right - 0.866 * up].map(|o| width * o);
        positions.extend([a, b].iter().flat_map(|end| corners.map(|o| *end + o)));
        for i in 0..3 {
            let j = (i + 1) % 3;
            indices.extend([i, j, j + 3, i, j + 3, i + 3].map(|k| first + k));
        }
    }
    let mesh = Mesh { name: "edges".to_owned(), positions: positions.into(), indices: indices.into(), ..Mesh::default() };
    mesh.checked().unwrap_or_default()
}

fn drawable(mesh: Mesh, material: &Arc<Material>, world_from_object: Mat4) -> Drawable {
    Drawable {
        name: mesh.name.clone(),
        bounds_in_world: mesh.bounds.transformed(&world_from_object),
        mesh: Arc::new(mesh),
        material: material.clone(),
        world_from_object,
        pose: None,
        visible: true,
        casts_shadow: false,
        receives_shadow: false,
        receives: None,
        revision: 0,
    }
}
