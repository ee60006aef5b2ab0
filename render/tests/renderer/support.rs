//! Scenes in code, and one device for all tests.

use glam::{Mat4, Vec3, Vec4};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock};
use umbriel_render::{FrameStats, Gpu, Renderer, RgbaPixels};
use umbriel_scene::*;

/// The device, for one test at a time: software drivers use all cores anyway.
pub(crate) fn gpu() -> (MutexGuard<'static, ()>, &'static Gpu) {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    static TURN: Mutex<()> = Mutex::new(());
    let turn = TURN.lock().unwrap_or_else(|e| e.into_inner());
    (turn, GPU.get_or_init(|| Gpu::new(None).unwrap()))
}

/// Everything that a frame gave.
pub(crate) struct Shot {
    pub(crate) layers: Vec<RgbaPixels>,
    pub(crate) stats: FrameStats,
    pub(crate) problems: Vec<String>,
}

impl Shot {
    pub(crate) fn pixel(&self, x: u32, y: u32) -> [u8; 4] {
        self.layers[0].pixel(x, y)
    }

    /// Pixel in the middle of the first layer.
    pub(crate) fn centre(&self) -> [u8; 4] {
        self.pixel(self.layers[0].width / 2, self.layers[0].height / 2)
    }
}

/// Draws one picture with a new renderer, and keeps it in a file to look at.
pub(crate) fn shoot(scene: &Scene, picture: &Picture) -> Shot {
    let (_turn, gpu) = gpu();
    let mut renderer = Renderer::new(gpu).unwrap();
    let stats = renderer.render(scene, std::slice::from_ref(picture)).unwrap();
    let layers = renderer.read_back(0).unwrap();
    let problems = renderer.problems();
    keep(&picture.name, &layers);
    Shot { layers, stats, problems }
}

/// One renderer for many pictures in a row, which is much faster than [`shoot`].
pub(crate) struct Shooter {
    renderer: Renderer,
    _turn: MutexGuard<'static, ()>,
}

impl Shooter {
    pub(crate) fn new() -> Shooter {
        let (_turn, gpu) = gpu();
        Shooter { renderer: Renderer::new(gpu).unwrap(), _turn }
    }

    /// Draws one picture, and keeps it in a file to look at.
    pub(crate) fn shoot(&mut self, scene: &Scene, picture: &Picture) -> Shot {
        let stats = self.renderer.render(scene, std::slice::from_ref(picture)).unwrap();
        let layers = self.renderer.read_back(0).unwrap();
        keep(&picture.name, &layers);
        Shot { layers, stats, problems: self.renderer.problems() }
    }
}

/// Writes layers as PNG files into the tests' temporary folder.
pub(crate) fn keep(name: &str, layers: &[RgbaPixels]) {
    for (i, p) in layers.iter().enumerate() {
        let path = format!("{}/{name}.{i}.png", env!("CARGO_TARGET_TMPDIR"));
        image::save_buffer(path, &p.rgba, p.width, p.height, image::ColorType::Rgba8).unwrap();
    }
}

/// A camera that looks from `eye` to `to`, 45 degrees high.
pub(crate) fn look(name: &str, eye: Vec3, to: Vec3, size: [u32; 2]) -> View {
    let up = if (to - eye).normalize().y.abs() > 0.99 { Vec3::NEG_Z } else { Vec3::Y };
    View {
        name: name.into(),
        view_from_world: glam::camera::rh::view::look_at_mat4(eye, to, up),
        frustum: Frustum::symmetric(45f32.to_radians(), size[0] as f32 / size[1] as f32, 0.1),
        size,
    }
}

pub(crate) fn shape(mesh: Mesh, material: Material, world_from_object: Mat4) -> Drawable {
    shape_of(&Arc::new(mesh), &Arc::new(material), world_from_object)
}

pub(crate) fn shape_of(mesh: &Arc<Mesh>, material: &Arc<Material>, world_from_object: Mat4) -> Drawable {
    Drawable {
        name: mesh.name.clone(),
        bounds_in_world: mesh.bounds.transformed(&world_from_object),
        mesh: mesh.clone(),
        material: material.clone(),
        world_from_object,
        pose: None,
        visible: true,
        casts_shadow: true,
        receives_shadow: true,
        receives: None,
        revision: 0,
    }
}

pub(crate) fn at(x: f32, y: f32, z: f32) -> Mat4 {
    Mat4::from_translation(Vec3::new(x, y, z))
}

/// A matt material of one colour.
pub(crate) fn matt(r: f32, g: f32, b: f32) -> Material {
    let shading = Shading::Phong { specular: Vec3::ZERO, exponent: 1.0, ambient_intensity: 1.0 };
    Material { shading, base_color: Vec4::new(r, g, b, 1.0), ..Default::default() }
}

/// A square of the given side in the xz plane, seen from above; texture coordinates from 0 to 1.
pub(crate) fn plane(side: f32) -> Mesh {
    let h = side * 0.5;
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    Mesh {
        name: "plane".into(),
        positions: corners.map(|(x, z)| Vec3::new(x * h, 0.0, z * h)).into(),
        uv0: corners.map(|(x, z): (f32, f32)| glam::Vec2::new(x * 0.5 + 0.5, z * 0.5 + 0.5)).into(),
        indices: [0, 2, 1, 0, 3, 2].into(),
        ..Default::default()
    }
    .checked()
    .unwrap()
}

/// A box around the origin, with flat normals.
pub(crate) fn cuboid(size: Vec3) -> Mesh {
    let mut positions = Vec::new();
    let mut normals = Vec::new();
    let mut indices = Vec::new();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let n = Vec3::from_array(std::array::from_fn(|i| if i == axis { sign } else { 0.0 }));
            let u = Vec3::from_array(std::array::from_fn(|i| if i == (axis + 1) % 3 { sign } else { 0.0 }));
            let v = n.cross(u);
            let first = positions.len() as u32;
            for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                positions.push((n + u * a + v * b) * size * 0.5);
                normals.push(n);
            }
            indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        }
    }
    Mesh {
        name: "box".into(),
        positions: positions.into(),
        normals: normals.into(),
        indices: indices.into(),
        ..Default::default()
    }
    .checked()
    .unwrap()
}

/// A ball of radius 1.
pub(crate) fn ball(rings: u32) -> Mesh {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    let segments = 2 * rings;
    for r in 0..=rings {
        for s in 0..=segments {
            let (lat, lon) = (std::f32::consts::PI * r as f32 / rings as f32, std::f32::consts::TAU * s as f32 / segments as f32);
            positions.push(Vec3::new(lat.sin() * lon.cos(), lat.cos(), -lat.sin() * lon.sin()));
        }
    }
    for r in 0..rings {
        for s in 0..segments {
            let (a, b) = (r * (segments + 1) + s, (r + 1) * (segments + 1) + s);
            indices.extend([a, b, b + 1, a, b + 1, a + 1]);
        }
    }
    let normals: Vec<Vec3> = positions.iter().map(|p| p.normalize()).collect();
    Mesh {
        name: "ball".into(),
        positions: positions.into(),
        normals: normals.into(),
        indices: indices.into(),
        ..Default::default()
    }
    .checked()
    .unwrap()
}

/// Light straight down that a matt surface reflects in its own colour.
pub(crate) fn noon() -> Light {
    Light { name: "noon".into(), direction: Vec3::NEG_Y, ..Default::default() }
}

/// The byte of a linear value in an sRGB picture.
pub(crate) fn srgb(linear: f32) -> i32 {
    let v = linear.clamp(0.0, 1.0);
    let v = if v <= 0.0031308 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (v * 255.0).round() as i32
}

/// Compares a pixel with linear RGB, to 2 of 255.
#[track_caller]
pub(crate) fn assert_colour(pixel: [u8; 4], linear: [f32; 3], what: &str) {
    let expected = linear.map(srgb);
    let near = (0..3).all(|i| (i32::from(pixel[i]) - expected[i]).abs() <= 2);
    assert!(near, "{what}: {pixel:?} where {expected:?} is right");
}
