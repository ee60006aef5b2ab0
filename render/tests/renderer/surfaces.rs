//! Reflection models and textures against closed forms.

use crate::support::*;
use glam::{Mat4, Vec2, Vec3, Vec4};
use std::f32::consts::PI;
use std::sync::Arc;
use umbriel_scene::*;

fn picture(rgba: [u8; 4]) -> Option<TextureRef> {
    let image = Arc::new(Image { width: 1, height: 1, rgba: Arc::from(rgba.to_vec()) });
    Some(TextureRef { image, sampler: Sampler::default(), uv_set: 0, uv_from_mesh: Default::default() })
}

/// The floor in the middle of a picture from above, light of intensity pi at 45 degrees.
fn floor_colour(name: &str, mesh: Mesh, material: Material, eye: Vec3, ambient: f32) -> [u8; 4] {
    let light = Light { direction: Vec3::new(1.0, -1.0, 0.0).normalize(), ..noon() };
    let scene = Scene {
        drawables: vec![shape(mesh, material, Mat4::IDENTITY)].into(),
        lights: vec![light],
        ambient: Vec3::splat(ambient),
        ..Default::default()
    };
    let shot = shoot(&scene, &Picture::mono(look(name, eye, Vec3::ZERO, [33, 33])));
    assert_eq!(shot.problems, Vec::<String>::new());
    shot.centre()
}

/// glTF 2.0 appendix B, for light and eye in one plane with the normal.
fn metallic_roughness(base: f32, metallic: f32, roughness: f32, towards: Vec3, to_eye: Vec3) -> f32 {
    let h = (towards + to_eye).normalize();
    let (nl, nv, nh, vh) = (towards.y, to_eye.y, h.y, to_eye.dot(h));
    let a2 = roughness.powi(4);
    let d = a2 / (PI * ((nh * nh) * (a2 - 1.0) + 1.0).powi(2));
    let g = |x: f32| 2.0 * x / (x + (a2 + (1.0 - a2) * x * x).sqrt());
    let v = g(nl) * g(nv) / (4.0 * nl * nv);
    let fresnel = |f0: f32| f0 + (1.0 - f0) * (1.0 - vh).powi(5);
    let metal = fresnel(base) * d * v;
    let dielectric = (1.0 - fresnel(0.04)) * base / PI + fresnel(0.04) * d * v;
    PI * nl * (dielectric + (metal - dielectric) * metallic)
}

#[test]
fn reflection_follows_the_models() {
    let towards = Vec3::new(-1.0, 1.0, 0.0).normalize();
    let base = 0.4;
    for (metallic, roughness) in [(0.0, 1.0), (0.0, 0.3), (1.0, 0.5), (0.5, 0.7)] {
        for eye in [Vec3::new(0.0, 4.0, 0.0), Vec3::new(3.0, 3.0, 0.0), Vec3::new(3.0, 2.0, 0.0)] {
            let shading = Shading::MetallicRoughness { metallic, roughness };
            let material = Material { shading, base_color: Vec4::new(base, base, base, 1.0), ..Default::default() };
            let colour = floor_colour("brdf", plane(20.0), material, eye, 0.0);
            let expected = metallic_roughness(base, metallic, roughness, towards, eye.normalize());
            assert_colour(colour, [expected; 3], &format!("metallic {metallic} roughness {roughness} from {eye}"));
        }
    }
    let eye = Vec3::new(3.0, 2.0, 0.0);
    let specular = Vec3::new(0.3, 0.2, 0.1);
    let phong = Material {
        shading: Shading::Phong { specular, exponent: 20.0, ambient_intensity: 0.5 },
        base_color: Vec4::new(0.4, 0.4, 0.4, 1.0),
        ..Default::default()
    };
    let n_h = (towards + eye.normalize()).normalize().y;
    let expected = Vec3::splat(0.4 * towards.y + 0.4 * 0.5 * 0.2) + specular * n_h.powf(20.0);
    assert_colour(floor_colour("phong", plane(20.0), phong, eye, 0.2), expected.to_array(), "phong");
}

#[test]
fn textures_change_what_they_should() {
    let above = Vec3::new(0.0, 4.0, 0.0);
    let lit = 0.5f32.sqrt();
    // A normal that leans by 45 degrees: along +u, which is +x here, is away from the light.
    let lean = |x: f32, y: f32| {
        let byte = |v: f32| ((v * 0.5 + 0.5) * 255.0).round() as u8;
        picture([byte(x), byte(y), byte((1.0 - x * x - y * y).sqrt()), 255])
    };
    let base = matt(0.5, 0.5, 0.5);
    let grey = |v: f32| [v; 3];
    let rows = [
        ("plain", base.clone(), 0.0, grey(0.5 * lit)),
        (
            "base colour, sRGB",
            Material { base_color_texture: picture([188, 188, 188, 255]), ..base.clone() },
            0.0,
            grey(0.25 * lit),
        ),
        (
            "emissive, sRGB",
            Material { emissive: Vec3::splat(0.5), emissive_texture: picture([188, 0, 0, 255]), ..matt(0.0, 0.0, 0.0) },
            0.0,
            [0.251, 0.0, 0.0],
        ),
        (
            "occlusion, linear",
            Material { occlusion_texture: picture([128, 0, 0, 255]), ..base.clone() },
            0.4,
            grey(0.5 * lit + 0.5 * 0.4 * 0.502),
        ),
        (
            "half of the occlusion",
            Material { occlusion_texture: picture([0, 0, 0, 255]), occlusion_strength: 0.5, ..base.clone() },
            0.4,
            grey(0.5 * lit + 0.1),
        ),
        ("flat normals", Material { normal_texture: lean(0.0, 0.0), ..base.clone() }, 0.0, grey(0.5 * lit)),
        ("normals towards the light", Material { normal_texture: lean(-lit, 0.0), ..base.clone() }, 0.0, grey(0.5)),
        ("normals away from it", Material { normal_texture: lean(lit, 0.0), ..base.clone() }, 0.0, grey(0.0)),
        ("normals across", Material { normal_texture: lean(0.0, lit), ..base.clone() }, 0.0, grey(0.25)),
    ];
    for (name, material, ambient, expected) in rows {
        let colour = floor_colour("textures", plane(20.0), material.clone(), above, ambient);
        let near = (0..3).all(|i| (i32::from(colour[i]) - srgb(expected[i])).abs() <= 4);
        assert!(near, "{name}: {colour:?} where {:?} is right", expected.map(srgb));
        // The same with tangents from the mesh.
        let mut mesh = plane(20.0);
        mesh.tangents = umbriel_scene::tangents(&mesh, 0).into();
        let colour = floor_colour("textures", mesh, material, above, ambient);
        let near = (0..3).all(|i| (i32::from(colour[i]) - srgb(expected[i])).abs() <= 4);
        assert!(near, "{name}, with tangents: {colour:?} where {:?} is right", expected.map(srgb));
    }
}

/// u along -z, v along x: what leans along +v (down the picture) leans away from the light.
#[test]
fn bumps_follow_turned_and_mirrored_coordinates() {
    let lit = 0.5f32.sqrt();
    let byte = |v: f32| ((v * 0.5 + 0.5) * 255.0).round() as u8;
    for (name, uv_of, lean, expected) in [
        ("turned", (|p: Vec3| Vec2::new(-p.z, p.x)) as fn(Vec3) -> Vec2, [0.0, 1.0], 0.5),
        ("turned, along u", |p| Vec2::new(-p.z, p.x), [1.0, 0.0], 0.25),
        ("mirrored", |p| Vec2::new(-p.x, p.z), [1.0, 0.0], 0.5),
        ("mirrored, against u", |p| Vec2::new(-p.x, p.z), [-1.0, 0.0], 0.0),
    ] {
        let mut mesh = plane(20.0);
        mesh.uv0 = mesh.positions.iter().map(|p| uv_of(*p)).collect();
        let rgba = [byte(lean[0] * lit), byte(lean[1] * lit), byte(lit), 255];
        let material = Material { normal_texture: picture(rgba), ..matt(0.5, 0.5, 0.5) };
        for with_tangents in [false, true] {
            if with_tangents {
                mesh.tangents = umbriel_scene::tangents(&mesh, 0).into();
            }
            let colour = floor_colour("bumps", mesh.clone(), material.clone(), Vec3::new(0.0, 4.0, 0.0), 0.0);
            assert!(
                (i32::from(colour[0]) - srgb(expected)).abs() <= 4,
                "{name}, tangents {with_tangents}: {colour:?}, not {}",
                srgb(expected)
            );
        }
    }
}

#[test]
fn vertex_colours_multiply() {
    let mut mesh = plane(20.0);
    mesh.colors = mesh.positions.iter().map(|_| Vec4::new(0.5, 1.0, 0.25, 1.0)).collect();
    let lit = 0.5f32.sqrt();
    let colour = floor_colour("vertex_colours", mesh, matt(0.8, 0.4, 0.8), Vec3::new(0.0, 4.0, 0.0), 0.0);
    assert_colour(colour, [0.4 * lit, 0.4 * lit, 0.2 * lit], "vertex colours");
}

/// Of a box whose corners are shared and that brings no normals, each side has one colour.
#[test]
fn meshes_without_normals_are_flat() {
    let corners = [-1.0, 1.0].map(|x| [-1.0, 1.0].map(|y| [-1.0, 1.0].map(|z| Vec3::new(x, y, z))));
    let indices = [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3];
    let mesh = Mesh { positions: corners.concat().concat().into(), indices: indices.into(), ..Default::default() };
    let scene = Scene {
        drawables: vec![shape(mesh.checked().unwrap(), matt(0.8, 0.8, 0.8), Mat4::IDENTITY)].into(),
        lights: vec![Light { direction: Vec3::new(-0.3, -1.0, -0.6).normalize(), ..noon() }],
        ..Default::default()
    };
    let shot = shoot(&scene, &Picture::mono(look("flat", Vec3::new(3.0, 4.0, 5.0), Vec3::ZERO, [96, 96])));
    let mut colours: Vec<[u8; 4]> = shot.layers[0].rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect();
    colours.sort_unstable();
    let wide = colours.chunk_by(|a, b| a == b).filter(|same| same.len() > 300).count();
    assert_eq!(wide, 4, "three sides and the background");
}
