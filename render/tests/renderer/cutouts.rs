//! Leaves, fences and nets under lights that cast by volume, against ray tracing.

use crate::support::*;
use glam::{Affine2, Mat4, Quat, Vec2, Vec3, Vec4};
use std::sync::Arc;
use umbriel_scene::*;

/// A picture of which only alpha matters, from coordinates of -1 to 1.
fn cut(size: u32, wrap: Wrap, filter: Filter, alpha: impl Fn(f32, f32) -> f32) -> TextureRef {
    let place = |i: u32| 2.0 * (i as f32 + 0.5) / size as f32 - 1.0;
    let texel = |i: u32| [90, 160, 60, (255.0 * alpha(place(i % size), place(i / size)).clamp(0.0, 1.0)) as u8];
    let image = Image { width: size, height: size, rgba: (0..size * size).flat_map(texel).collect() };
    let sampler = Sampler { wrap_u: wrap, wrap_v: wrap, filter, ..Default::default() };
    TextureRef { image: Arc::new(image), sampler, uv_set: 0, uv_from_mesh: Affine2::IDENTITY }
}

fn masked(texture: TextureRef, cutoff: f32) -> Material {
    let alpha = AlphaMode::Mask { cutoff };
    Material { base_color_texture: Some(texture), alpha, double_sided: true, ..matt(0.6, 0.6, 0.6) }
}

fn leaf() -> Material {
    masked(cut(32, Wrap::Repeat, Filter::Linear, |x, y| f32::from(x.abs() < 0.8 * (1.0 - y * y))), 0.5)
}

/// Wires of 1.5 texels.
fn net(times: f32, wrap: Wrap) -> Material {
    let wire = |x: f32| 1.5 - (16.0 * (1.0 - x.abs()) - 0.5).max(0.0);
    let mut texture = cut(32, wrap, Filter::Linear, |x, y| wire(x).max(wire(y)));
    texture.uv_from_mesh = Affine2::from_scale_angle_translation(Vec2::new(times, 1.3 * times), 0.2, Vec2::new(0.37, -2.1));
    masked(texture, 0.5)
}

fn ground(side: f32) -> Drawable {
    let ground = shape(plane(side), Material { double_sided: true, ..matt(0.5, 0.5, 0.5) }, Mat4::IDENTITY);
    Drawable { casts_shadow: false, ..ground }
}

/// Cards turned by the golden angle, many of them through each other.
fn cards(count: u32, material: Material, scale: Vec3) -> Vec<Drawable> {
    let (card, material) = (Arc::new(plane(1.0)), Arc::new(material));
    let place = |i: u32| {
        let turn = 2.399_963 * i as f32;
        let at = Vec3::new(turn.cos() * 0.4, 1.0 + 0.05 * i as f32, turn.sin() * 0.4);
        let turned = Quat::from_rotation_y(turn) * Quat::from_rotation_x(0.4 + 0.3 * i as f32);
        Mat4::from_scale(scale) * Mat4::from_translation(at) * Mat4::from_quat(turned)
    };
    let mut all: Vec<Drawable> = (0..count).map(|i| shape_of(&card, &material, place(i))).collect();
    all.push(ground(30.0 * scale.y));
    all
}

/// Upright cards of many leaves through each other, before each other in most pixels.
fn bush() -> Vec<Drawable> {
    let leaves = |x: f32, y: f32| f32::from((9.0 * x).sin() * (9.0 * y + 2.0 * x).cos() > 0.2);
    let (card, material) = (Arc::new(plane(1.0)), Arc::new(masked(cut(64, Wrap::Repeat, Filter::Linear, leaves), 0.5)));
    let place = |i: u32| {
        let turn = 2.399_963 * i as f32;
        let out = Vec3::new(turn.cos(), 0.0, turn.sin()) * 0.07 * (i as f32).sqrt();
        Mat4::from_translation(out + 0.5 * Vec3::Y) * Mat4::from_rotation_y(turn) * Mat4::from_rotation_x(1.45)
    };
    (0..30).map(|i| shape_of(&card, &material, place(i))).chain([ground(30.0)]).collect()
}

fn by_volume(kind: LightKind, position: Vec3) -> Light {
    Light { kind, position, direction: -position.normalize(), shadows: ShadowMethod::Volume, ..noon() }
}

/// Share of the pixels that are wrong, intersection over union, and pixels in shadow.
fn scored(shooter: &mut Shooter, name: &str, scene: &Scene, view: &View) -> (f64, f64, usize) {
    score_of(shooter, name, scene, view, &traced(scene, view))
}

fn traced(scene: &Scene, view: &View) -> Mask {
    let options = TraceOptions { sub_samples: 3, eps_scale: 1e-7, ..Default::default() };
    Tracer::new(scene).visibility(&scene.lights[0], view, &options, &|_| ()).unwrap()
}

fn score_of(shooter: &mut Shooter, name: &str, scene: &Scene, view: &View, truth: &Mask) -> (f64, f64, usize) {
    let picture = Picture { kind: PictureKind::LightVisibility(0), name: name.into(), ..Picture::mono(view.clone()) };
    let shot = shooter.shoot(scene, &picture);
    assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
    let seen: Vec<u8> = shot.layers[0].rgba.chunks_exact(4).map(|p| p[0]).collect();
    let rgba = difference(truth, &seen).unwrap();
    keep(&format!("{name}_difference"), &[umbriel_render::RgbaPixels { rgba, ..shot.layers[0].clone() }]);
    let score = score(truth, &seen).unwrap();
    (score.disagreement, score.iou, truth.count(Mask::SHADOW))
}

#[test]
fn holes_are_exact() {
    let sun = || by_volume(LightKind::Directional, Vec3::new(0.4, 1.0, 0.3));
    let lamp = || by_volume(LightKind::Point, Vec3::new(0.6, 3.4, 0.5));
    let spot = || by_volume(LightKind::Spot { inner_rad: 0.5, outer_rad: 0.6 }, Vec3::new(1.5, 4.0, 0.5));
    let graded = |x: f32, y: f32| 1.0 - (x * x + y * y).sqrt();
    let half = Vec3::splat(0.5);
    let far = Vec3::new(1.5, 2.5, 2.5);
    // Coloured vertices fade the leaf towards one side.
    let mut faded = cards(6, masked(cut(16, Wrap::Clamp, Filter::Linear, graded), 0.3), Vec3::ONE);
    let mut mesh = plane(1.0);
    mesh.colors = [1.0, 0.5, 0.4, 1.0].map(|a| Vec4::new(1.0, 1.0, 1.0, a)).into();
    let mesh = Arc::new(mesh);
    faded.iter_mut().take(6).for_each(|d| d.mesh = mesh.clone());
    // One that a morph target bends.
    let mut bent = cards(5, leaf(), Vec3::ONE);
    let mut mesh = plane(1.0);
    let offsets = [0.3, 0.0, 0.4, -0.2].map(|y| Vec3::Y * y).into();
    mesh.morph_targets = vec![MorphTarget { positions: offsets, ..Default::default() }];
    let (mesh, pose) = (Arc::new(mesh), Arc::new(Pose { object_from_bind: vec![], morph_weights: vec![0.7] }));
    for d in bent.iter_mut().take(5) {
        (d.mesh, d.pose) = (mesh.clone(), Some(pose.clone()));
        d.bounds_in_world = Aabb { min: d.bounds_in_world.min - half, max: d.bounds_in_world.max + half };
    }
    // One that hangs on two joints, of which the second moved.
    let mut hung = cards(5, leaf(), Vec3::ONE);
    let mut mesh = plane(1.0);
    mesh.joints = vec![[0, 1, 0, 0]; 4].into();
    mesh.weights = [0.0, 1.0, 0.6, 0.2].map(|w| Vec4::new(1.0 - w, w, 0.0, 0.0)).into();
    let moved = Mat4::from_rotation_translation(Quat::from_rotation_z(0.7), Vec3::new(0.1, 0.35, 0.2));
    let (mesh, pose) = (Arc::new(mesh), Arc::new(Pose { object_from_bind: vec![Mat4::IDENTITY, moved], morph_weights: vec![] }));
    for d in hung.iter_mut().take(5) {
        (d.mesh, d.pose) = (mesh.clone(), Some(pose.clone()));
        d.bounds_in_world = Aabb { min: d.bounds_in_world.min - half, max: d.bounds_in_world.max + half };
    }
    let fence = |times, wrap| {
        let upright = at(0.0, 0.6, 0.0) * Mat4::from_rotation_x(1.5) * Mat4::from_scale(Vec3::new(3.0, 1.0, 1.2));
        vec![shape(plane(1.0), net(times, wrap), upright), ground(30.0)]
    };
    let nearest = masked(cut(8, Wrap::Repeat, Filter::Nearest, |x, y| f32::from(x * y > 0.0)), 0.5);
    let short = Light { volume: VolumeSettings { length: 1.2, ..Default::default() }, ..lamp() };
    /// Name, what stands there, its light, where the eye is and where it looks.
    type Row = (&'static str, Vec<Drawable>, Light, Vec3, Vec3);
    let rows: Vec<Row> = vec![
        ("cards_under_a_sun", cards(12, leaf(), Vec3::ONE), sun(), far, half),
        ("cards_around_a_lamp", cards(12, leaf(), Vec3::ONE), lamp(), far, half),
        ("cards_under_a_spot", cards(12, leaf(), Vec3::ONE), spot(), far, half),
        ("among_the_cards", cards(24, leaf(), Vec3::ONE), sun(), Vec3::new(0.3, 1.2, 0.2), Vec3::new(-0.4, 0.0, -0.6)),
        ("bush", bush(), sun(), Vec3::new(1.2, 1.0, 1.1), half),
        ("in_a_shadow", cards(3, leaf(), Vec3::splat(6.0)), sun(), Vec3::new(-1.0, 0.4, -1.0), Vec3::new(-4.0, 0.0, -4.0)),
        ("mirrored", cards(8, leaf(), Vec3::new(-1.0, 1.0, 1.0)), sun(), far, half),
        ("small", cards(8, leaf(), Vec3::splat(0.01)), sun(), far * 0.01, half * 0.01),
        ("large", cards(8, leaf(), Vec3::splat(100.0)), sun(), far * 100.0, half * 100.0),
        ("fence", fence(3.0, Wrap::Repeat), sun(), Vec3::new(-0.4, 1.6, -0.7), Vec3::new(-0.3, 0.0, -0.2)),
        ("tiles_that_mirror", fence(2.0, Wrap::Mirror), spot(), Vec3::new(-0.4, 1.6, -0.7), Vec3::new(-0.3, 0.0, -0.2)),
        ("texels", cards(6, nearest, Vec3::ONE), lamp(), far, half),
        ("faded", faded, sun(), far, half),
        ("bent", bent, sun(), far, half),
        ("hung_on_joints", hung, lamp(), far, half),
        ("short", cards(6, leaf(), Vec3::ONE), short, far, half),
    ];
    let mut shooter = Shooter::new();
    let mut failed = Vec::new();
    for (name, drawables, light, eye, to) in rows {
        let mut view = look(name, eye, to, [160, 120]);
        view.frustum = Frustum::symmetric(0.9, 4.0 / 3.0, 0.002 * eye.distance(to));
        let ends = light.volume.length.is_finite();
        let mut scene = Scene { drawables: drawables.into(), lights: vec![light], ..Default::default() };
        let truth = traced(&scene, &view);
        for samples in [Samples::One, Samples::Four] {
            scene.samples = samples;
            let name = format!("{name}_{}", samples.count());
            let (wrong, iou, dark) = score_of(&mut shooter, &name, &scene, &view, &truth);
            println!("{name}: {:.4} % disagree, IoU {iou:.4}, {dark} in shadow", 100.0 * wrong);
            // Rays know no length.
            if ends != (wrong > 0.0002 || iou < 0.99) || dark < 50 {
                failed.push(name);
            }
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

/// Whatever is changed, the next frame shows it, and nothing is kept that would have to be forgotten.
#[test]
fn holes_change_from_frame_to_frame() {
    let mut shooter = Shooter::new();
    let light = by_volume(LightKind::Directional, Vec3::new(0.4, 1.0, 0.3));
    let graded = |x: f32, y: f32| 1.0 - (x * x + y * y).sqrt();
    let cards = cards(4, masked(cut(16, Wrap::Clamp, Filter::Linear, graded), 0.5), Vec3::ONE);
    let mut scene = Scene { drawables: cards.into(), lights: vec![light], ..Default::default() };
    let view = look("changed", Vec3::new(1.5, 2.5, 2.5), Vec3::splat(0.5), [160, 120]);
    let mut darks = Vec::new();
    let material = |scene: &mut Scene, change: &dyn Fn(&mut Material)| {
        for d in scene.drawables.iter_mut().take(4) {
            change(Arc::make_mut(&mut d.material));
        }
    };
    type Change<'a> = (&'static str, &'a dyn Fn(&mut Scene));
    let changes: [Change<'_>; 6] = [
        ("as it was", &|_| ()),
        ("a lower cutoff", &|s| material(s, &|m| m.alpha = AlphaMode::Mask { cutoff: 0.2 })),
        ("a fainter colour", &|s| material(s, &|m| m.base_color.w = 0.5)),
        ("another picture", &|s| {
            material(s, &|m| m.base_color_texture = Some(cut(16, Wrap::Clamp, Filter::Linear, |x, y| x * x + y * y)))
        }),
        ("another place", &|s| {
            for d in s.drawables.iter_mut().take(4) {
                let by = Mat4::from_translation(Vec3::new(-0.4, 0.2, 0.0));
                (d.world_from_object, d.bounds_in_world) = (by * d.world_from_object, d.bounds_in_world.transformed(&by));
            }
        }),
        ("no holes", &|s| material(s, &|m| (m.base_color_texture, m.base_color.w) = (None, 1.0))),
    ];
    for (name, change) in changes {
        change(&mut scene);
        let (wrong, iou, dark) = scored(&mut shooter, "changed", &scene, &view);
        assert!(wrong <= 0.0002 && iou >= 0.99, "{name}: {wrong}, {iou}");
        darks.push(dark);
    }
    assert!(darks.windows(2).all(|d| d[0] != d[1]), "{darks:?}");
}

/// Groups cast with the holes of their casters, by either mode.
#[test]
fn groups_have_holes_too() {
    let mut shooter = Shooter::new();
    let drawables = cards(8, leaf(), Vec3::ONE);
    let film = Film { color: Vec4::new(0.0, 0.0, 0.0, 0.5) };
    let view = look("groups", Vec3::new(1.5, 2.5, 2.5), Vec3::splat(0.5), [160, 120]);
    for (name, mode) in [("additive", StencilMode::Additive), ("modulative", StencilMode::Modulative(film))] {
        let light = Light { shadows: ShadowMethod::None, ..by_volume(LightKind::Point, Vec3::new(0.6, 3.4, 0.5)) };
        let group = StencilGroup { name: name.into(), light: 0, casters: (0..8).collect(), mode };
        let scene =
            Scene { drawables: drawables.clone().into(), lights: vec![light], stencil_groups: vec![group], ..Default::default() };
        let (wrong, iou, dark) = scored(&mut shooter, &format!("group_{name}"), &scene, &view);
        assert!(wrong <= 0.0002 && iou >= 0.99 && dark > 500, "{name}: {wrong}, {iou}, {dark}");
    }
}
