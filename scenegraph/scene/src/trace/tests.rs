mod shapes;

use super::*;
use crate::{AlphaMode, Drawable, Filter, Frustum, Image, Material, Mesh, Pose, Sampler, TextureRef};
use glam::{Affine2, Mat4, Vec3, Vec4, dvec3, vec3};
use shapes::*;
use std::sync::Arc;

fn scene(drawables: Vec<Drawable>) -> Scene {
    Scene { drawables: drawables.into(), ..Scene::default() }
}

/// What the light does at the point where a ray from `eye` towards `target` ends.
fn class(scene: &Scene, light: &Light, eye: Vec3, target: Vec3, options: &TraceOptions) -> u8 {
    let direction = (target - eye).as_dvec3().normalize();
    Tracer::new(scene).classify(&Ray::new(eye.as_dvec3(), direction), &Beam::new(light).unwrap(), options)
}

fn check(name: &str, scene: &Scene, light: &Light, rows: &[(Vec3, Vec3, u8)]) {
    for &(eye, target, expected) in rows {
        assert_eq!(class(scene, light, eye, target, &TraceOptions::default()), expected, "{name}: from {eye} to {target}");
    }
}

fn view(eye: Vec3, target: Vec3, size: [u32; 2]) -> View {
    let view_from_world = glam::camera::rh::view::look_at_mat4(eye, target, Vec3::Y);
    let frustum = Frustum::symmetric(1.0, size[0] as f32 / size[1] as f32, 0.1);
    View { name: "test".into(), view_from_world, frustum, size }
}

const BACKGROUND: u8 = Mask::BACKGROUND;
const LIT: u8 = Mask::LIT;
const SHADOW: u8 = Mask::SHADOW;
const AWAY: u8 = Mask::AWAY;
const OUTSIDE: u8 = Mask::OUTSIDE;

/// A sun so low that a ray which starts a quarter of a millimetre off the ground is out of the shadow six millimetres too soon.
#[test]
fn wide_worlds_keep_fine_shadows() {
    let world = scene(vec![ground(1000.0), box_at(vec3(0.0, 1.0, 0.0))]);
    let wide = TraceOptions { eps_scale: 1e-7, ..TraceOptions::default() };
    let fine = TraceOptions { eps_at_place: 2.0 * f64::from(f32::EPSILON), ..wide.clone() };
    let low = sun(vec3(1.0, -0.05, 0.0));
    for (options, x, expected) in
        [(&wide, 40.99, SHADOW), (&wide, 40.997, LIT), (&fine, 40.997, SHADOW), (&fine, 41.001, LIT), (&fine, 60.0, LIT)]
    {
        let found = class(&world, &low, vec3(41.0, 1.0, 0.5), vec3(x, 0.0, 0.0), options);
        assert_eq!(found, expected, "{x} with {options:?}");
    }
}

#[test]
fn box_in_the_sun() {
    // From x = 1 its shadow is as long as the box is high: 2.
    let world = scene(vec![ground(10.0), box_at(vec3(0.0, 1.0, 0.0))]);
    let eye = vec3(3.0, 12.0, 0.5);
    check(
        "sun",
        &world,
        &sun(vec3(1.0, -1.0, 0.0)),
        &[
            (eye, vec3(2.999, 0.0, 0.0), SHADOW),
            (eye, vec3(3.001, 0.0, 0.0), LIT),
            (eye, vec3(1.001, 0.0, 0.999), SHADOW),
            (eye, vec3(1.5, 0.0, 1.001), LIT),
            (eye, vec3(0.0, 2.0, 0.0), LIT),
            (eye, vec3(1.0, 1.0, 0.0), AWAY),
            (eye, vec3(-9.9, 0.0, 0.0), LIT),
            (eye, vec3(10.1, 0.0, 0.0), BACKGROUND),
            (eye, vec3(3.0, 13.0, 0.0), BACKGROUND),
            (vec3(-5.0, 1.0, 0.0), vec3(-1.0, 1.0, 0.0), LIT),
            // The ground has one side.
            (vec3(5.0, -2.0, 0.0), vec3(5.0, 0.0, 0.0), BACKGROUND),
        ],
    );
    let grazing = |slope: f32| class(&world, &sun(vec3(1.0, -slope, 0.0)), eye, vec3(-5.0, 0.0, 0.0), &TraceOptions::default());
    assert_eq!((grazing(0.0299), grazing(0.0302)), (AWAY, LIT));
}

#[test]
fn spots_have_cones() {
    let world = scene(vec![ground(10.0), box_at(vec3(0.0, 1.0, 0.0))]);
    let rim = 4.0 * 0.5_f32.tan();
    let rows = [
        (vec3(0.0, 9.0, 5.0), vec3(rim - 0.001, 0.0, 0.0), LIT),
        (vec3(0.0, 9.0, 5.0), vec3(rim + 0.001, 0.0, 0.0), OUTSIDE),
        // Under the light, on the far side of the box: not in the cone comes before facing away.
        (vec3(8.0, 1.0, 0.0), vec3(1.0, 0.1, 0.0), AWAY),
        (vec3(0.0, 9.0, 5.0), vec3(0.5, 2.0, 0.5), LIT),
    ];
    check("spot", &world, &spot(vec3(0.0, 4.0, 0.0), 0.5), &rows);
    let short = Light { range: 4.0, ..spot(vec3(0.0, 4.0, 0.0), 0.5) };
    check(
        "range",
        &world,
        &short,
        &[(vec3(0.0, 9.0, 5.0), vec3(1.5, 0.0, 0.0), OUTSIDE), (vec3(0.0, 9.0, 5.0), vec3(0.5, 2.0, 0.5), LIT)],
    );
    check("outside first", &world, &spot(vec3(0.0, 4.0, 0.0), 0.1), &[(vec3(8.0, 1.0, 0.0), vec3(1.0, 0.1, 0.0), OUTSIDE)]);
}

#[test]
fn shadow_of_a_sphere_is_the_cone_through_its_circle() {
    let (light, centre) = (vec3(0.3, 4.0, 0.2), vec3(0.0, 1.5, 0.0));
    let world =
        Scene { lights: vec![lamp(light)], ..scene(vec![ground(6.0), drawable(sphere(160), Mat4::from_translation(centre))]) };
    let view = view(vec3(5.0, 6.0, 5.0), vec3(0.0, 0.0, 0.0), [240, 180]);
    let camera = Camera::new(&view, 1).unwrap();
    let mask = trace_visibility(&world, 0, &view, &TraceOptions { sub_samples: 1, ..TraceOptions::default() }).unwrap();
    // Distance of the sphere's centre from a ray, and whether it is in front of the end.
    let distance = |from: DVec3, along: DVec3| (centre.as_dvec3() - from).cross(along).length();
    let (mut compared, mut shadowed) = (0, 0);
    for (pixel, class) in (0..240 * 180).zip(&mask.classes) {
        let direction = camera.rays([pixel % 240, pixel / 240]).next().unwrap().direction;
        let at_ground = camera.eye - direction * (camera.eye.y / direction.y);
        let to_light = (light.as_dvec3() - at_ground).normalize();
        let (seen_past, lit_past) = (distance(camera.eye, direction), distance(at_ground, to_light));
        let on_ground = direction.y < 0.0 && at_ground.x.abs() < 6.0 && at_ground.z.abs() < 6.0;
        if !on_ground || seen_past < 1.0 || (lit_past - 1.0).abs() < 4e-4 {
            continue;
        }
        let expected = if lit_past < 1.0 { SHADOW } else { LIT };
        assert_eq!(*class, expected, "pixel {pixel}, {at_ground}");
        compared += 1;
        shadowed += usize::from(lit_past < 1.0);
    }
    assert!(compared > 15_000 && shadowed > 800, "{compared} compared, {shadowed} in shadow");
    // Straight above, the shadow is a circle of radius h tan(asin(r / (h - c))).
    let radius = 4.0 * (1.0_f32 / 2.5).asin().tan();
    let world = scene(vec![ground(6.0), drawable(sphere(160), Mat4::from_translation(centre))]);
    for angle in 0..32 {
        let out = vec3((angle as f32 * 0.2).cos(), 0.0, (angle as f32 * 0.2).sin());
        let eye = out * 8.0 + Vec3::Y;
        check("circle", &world, &lamp(Vec3::Y * 4.0), &[(eye, out * radius * 0.999, SHADOW), (eye, out * radius * 1.001, LIT)]);
    }
}

/// A way in which a shape differs from the plain one.
type Change = fn(&mut Drawable, &mut Material);

#[test]
fn sheets_sides_and_alpha_modes() {
    let sheet = |change: Change| {
        let above = drawable(square(), Mat4::from_translation(Vec3::Y * 2.0));
        scene(vec![ground(10.0), with(above, change)])
    };
    let (above, below) = (vec3(0.0, 5.0, 0.0), vec3(0.0, 2.0, 0.0));
    let under = vec3(4.0, 1.0, 0.0);
    let (from_below, upwards) = (vec3(0.1, 1.0, 0.0), vec3(0.1, 2.0, 0.0));
    let plain = TraceOptions::default();
    let no_cull = TraceOptions { cull: false, ..plain.clone() };
    let no_blend = TraceOptions { blend_casts: false, ..plain.clone() };
    let blend: Change = |_, m| m.alpha = AlphaMode::Blend;
    let upside_down: Change = |d, _| d.world_from_object *= Mat4::from_rotation_x(3.0);
    // What differs, options, eye, target, class under a sun from above.
    let rows: Vec<(&str, Change, &TraceOptions, Vec3, Vec3, u8)> = vec![
        ("sheet from above", |_, _| (), &plain, above, below, LIT),
        ("its shadow", |_, _| (), &plain, under, Vec3::ZERO, SHADOW),
        ("beside it", |_, _| (), &plain, under, vec3(1.01, 0.0, 0.0), LIT),
        ("sheet from below", |_, _| (), &plain, from_below, upwards, BACKGROUND),
        ("without culling", |_, _| (), &no_cull, from_below, upwards, AWAY),
        ("of two sides", |_, m| m.double_sided = true, &plain, from_below, upwards, AWAY),
        ("back to the sun", upside_down, &plain, under, Vec3::ZERO, SHADOW),
        ("back to the eye", upside_down, &plain, above, vec3(0.3, 2.0, 0.0), SHADOW),
        ("mirrored", |d, _| d.world_from_object *= Mat4::from_scale(vec3(-1.0, 1.0, 1.0)), &plain, above, below, LIT),
        (
            "turned inside out",
            |d, _| d.world_from_object *= Mat4::from_scale(vec3(1.0, -1.0, 1.0)),
            &plain,
            from_below,
            upwards,
            AWAY,
        ),
        ("blend is not seen", blend, &plain, above, below, SHADOW),
        ("blend casts", blend, &plain, under, Vec3::ZERO, SHADOW),
        ("blend without casting", blend, &no_blend, under, Vec3::ZERO, LIT),
        ("no caster", |d, _| d.casts_shadow = false, &plain, under, Vec3::ZERO, LIT),
        ("no caster, but seen", |d, _| d.casts_shadow = false, &plain, above, below, LIT),
        ("not visible", |d, _| d.visible = false, &plain, under, Vec3::ZERO, LIT),
        (
            "moved by its pose",
            |d, _| {
                let lift = Mat4::from_translation(Vec3::X * 5.0);
                let skinned = Mesh { joints: [[0; 4]; 4].into(), weights: [Vec4::X; 4].into(), ..square() };
                d.mesh = Arc::new(skinned);
                d.pose = Some(Arc::new(Pose { object_from_bind: vec![lift], morph_weights: vec![] }));
            },
            &plain,
            under,
            vec3(5.9, 0.0, 0.0),
            SHADOW,
        ),
    ];
    for (name, change, options, eye, target, expected) in rows {
        let found = class(&sheet(change), &sun(Vec3::NEG_Y), eye, target, options);
        assert_eq!(found, expected, "{name}: from {eye} to {target}");
    }
    let mut deaf = sheet(|_, _| ());
    deaf.drawables[0].receives_shadow = false;
    assert_eq!(class(&deaf, &sun(Vec3::NEG_Y), under, Vec3::ZERO, &plain), LIT, "receives no shadows");
}

/// A lamp in the ground shines on what hangs over it, and leans towards it, from afar.
#[test]
fn what_a_light_stands_in_does_not_hide_it() {
    let leaning = Mat4::from_translation(vec3(8.0, 0.2, 0.0)) * Mat4::from_rotation_z(2.0);
    let world = scene(vec![ground(10.0), with(drawable(square(), leaning), |_, m| m.double_sided = true)]);
    let at = |up: f32| leaning.transform_point3(vec3(up, 0.0, 0.1));
    let eye = vec3(5.0, 0.3, 0.1);
    check("in the ground", &world, &lamp(Vec3::ZERO), &[(eye, at(0.0), LIT), (eye, at(0.15), LIT), (eye, at(-0.15), LIT)]);
    check("under it", &world, &lamp(Vec3::NEG_Y * 0.01), &[(eye, at(0.0), SHADOW)]);
}

#[test]
fn alpha_masks_have_holes_for_the_eye_and_for_light() {
    // The left half of the sheet is there, the right half is not.
    let rgba: Vec<u8> = [255, 0].into_iter().flat_map(|a| [0, 0, 0, a]).collect();
    let image = Arc::new(Image { width: 2, height: 1, rgba: rgba.into() });
    let sampler = Sampler { filter: Filter::Nearest, ..Sampler::default() };
    let texture = TextureRef { image, sampler, uv_set: 0, uv_from_mesh: Affine2::IDENTITY };
    let masked = |m: Mat4| {
        with(drawable(square(), Mat4::from_translation(Vec3::Y * 2.0) * m), |_, material| {
            material.alpha = AlphaMode::Mask { cutoff: 0.5 };
            material.base_color_texture = Some(texture.clone());
            material.double_sided = true;
        })
    };
    let (up, under) = (vec3(0.0, 9.0, 0.0), vec3(4.0, 1.0, 0.0));
    let (left, right) = (vec3(-0.5, 0.0, 0.2), vec3(0.5, 0.0, 0.2));
    let light = sun(Vec3::NEG_Y);
    check(
        "mask",
        &scene(vec![ground(10.0), masked(Mat4::IDENTITY)]),
        &light,
        &[
            (under, left, SHADOW),
            (under, right, LIT),
            (up, left + Vec3::Y * 2.0, LIT),
            (up, right + Vec3::Y * 2.0, LIT),
            // Through the hole at the ground in the shadow of the other half.
            (vec3(1.0, 5.0, 0.0), vec3(-0.1, 0.0, 0.0), SHADOW),
        ],
    );
    check(
        "mirrored mask",
        &scene(vec![ground(10.0), masked(Mat4::from_scale(vec3(-1.0, 1.0, 1.0)))]),
        &light,
        &[(under, left, LIT), (under, right, SHADOW), (under, vec3(-0.5, 0.0, 0.8), LIT), (under, vec3(0.5, 0.0, 0.8), SHADOW)],
    );
    let thin = |alpha: f32| {
        let pane = with(masked(Mat4::IDENTITY), |_, m| {
            m.base_color_texture = None;
            m.base_color.w = alpha;
        });
        class(&scene(vec![ground(10.0), pane]), &light, under, left, &TraceOptions::default())
    };
    assert_eq!((thin(0.5), thin(0.49)), (SHADOW, LIT));
}

#[test]
fn light_and_eye_inside_of_a_caster() {
    let eye = vec3(0.2, 6.0, 6.0);
    let room = box_at(vec3(0.0, 1.0, 0.0));
    let closed = scene(vec![ground(10.0), room.clone()]);
    for x in [-0.9, 0.0, 0.7] {
        let light = lamp(vec3(x, 1.3, 0.0));
        check(
            "light inside",
            &closed,
            &light,
            &[(eye, vec3(3.0, 0.0, 0.0), SHADOW), (eye, vec3(0.0, 0.0, 5.0), SHADOW), (eye, vec3(0.0, 2.0, 0.0), AWAY)],
        );
    }
    let two_sided = scene(vec![ground(10.0), with(room, |_, m| m.double_sided = true)]);
    let inside = vec3(0.1, 1.2, 0.3);
    check("both inside", &two_sided, &lamp(vec3(0.5, 1.5, 0.0)), &[(inside, vec3(1.0, 1.0, 0.0), LIT)]);
    check(
        "eye inside, walls of one side",
        &closed,
        &sun(vec3(1.0, -1.0, 0.0)),
        &[(inside, vec3(2.5, 0.0, 0.3), SHADOW), (inside, vec3(4.0, 0.0, 0.3), LIT)],
    );
    check("light behind the caster only", &closed, &lamp(vec3(0.0, 0.5, 4.0)), &[(eye, vec3(0.0, 0.0, 5.0), LIT)]);
}

/// A sheet half a metre before the eye, which a near plane beyond it cuts away. It casts all the same.
#[test]
fn what_is_nearer_than_the_near_plane_is_not_seen() {
    let sheet = with(drawable(square(), Mat4::from_translation(vec3(0.0, 3.5, 0.0))), |_, m| m.double_sided = true);
    let tracer = Tracer::new(&scene(vec![ground(10.0), sheet]));
    let above = view(vec3(0.0, 4.0, 0.01), Vec3::ZERO, [1, 1]);
    let window = above.frustum;
    for (near, expected) in [(0.1, LIT), (1.0, SHADOW)] {
        let scaled = |edge: f32| edge / window.near * near;
        let [left, right, bottom, top] = [window.left, window.right, window.bottom, window.top].map(scaled);
        let view = View { frustum: Frustum { left, right, bottom, top, near }, ..above.clone() };
        let options = TraceOptions { sub_samples: 1, ..TraceOptions::default() };
        let mask = tracer.visibility(&sun(Vec3::NEG_Y), &view, &options, &|_| ()).unwrap();
        assert_eq!(mask.classes, [expected], "near plane at {near} m");
    }
}

#[test]
fn the_hierarchy_misses_nothing() {
    // A linear congruence is random enough, and the same everywhere.
    let mut state = 7_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32 * 2.0 - 1.0
    };
    let mut point = |scale: f32| vec3(random(), random(), random()) * scale;
    for (offset, reach) in [(0.0, 3.0), (1000.0, 3.0), (0.0, 100_000.0)] {
        let corners: Vec<[Vec3; 3]> = (0..400)
            .map(|_| {
                let at = point(1.0) + offset;
                [at, at + point(0.2), at + point(0.2)]
            })
            .collect();
        let soup = mesh(corners.concat(), (0..1200).collect());
        let tracer = Tracer::new(&scene(vec![drawable(soup, Mat4::IDENTITY)]));
        assert_eq!(tracer.triangle_count(), 400);
        let mut hits = 0;
        for ray in 0..4000 {
            // Corners lie in the faces of their boxes, where rounding decides.
            let [a, b, c] = corners[ray % 400].map(|p| p.as_dvec3());
            let inside = (a + b + c) / 3.0;
            let target = if ray % 2 == 0 { b.lerp(inside, 1e-6) } else { inside };
            let origin = point(reach).as_dvec3() + f64::from(offset);
            let ray = Ray::new(origin, (target - origin).normalize());
            let start = tracer.soup.start(&ray).unwrap();
            let all = tracer.soup.triangles.iter().enumerate().filter_map(|(i, t)| ray.starting_at(start).meets(i, t));
            let nearest = all.min_by(|a, b| a.distance.total_cmp(&b.distance));
            let nearest = nearest.map(|hit| Hit { distance: hit.distance + start, ..hit });
            assert_eq!(tracer.soup.first(&ray, |_| true), nearest);
            let Some(nearest) = nearest else { continue };
            assert!(tracer.soup.any(&ray, nearest.distance + 1e-6, |_| true));
            assert!(!tracer.soup.any(&ray, nearest.distance - 1e-6, |_| true));
            hits += 1;
        }
        assert!(hits > 3900, "{hits}");
    }
}

#[test]
fn bad_input_is_an_error_or_nothing() {
    let no_mesh =
        Drawable { mesh: Arc::new(mesh(vec![Vec3::ZERO, Vec3::NAN, Vec3::X], vec![0, 1, 2, 0, 0, 2, 5, 6, 7])), ..ground(1.0) };
    let empty = scene(vec![no_mesh]);
    let view = view(Vec3::ONE * 3.0, Vec3::ZERO, [8, 6]);
    let options = TraceOptions { sub_samples: 0, ..TraceOptions::default() };
    let trace = |light: Light, view: &View| trace_visibility(&Scene { lights: vec![light], ..empty.clone() }, 0, view, &options);
    assert_eq!(trace(sun(Vec3::NEG_Y), &view), Ok(Mask::background(8, 6)));
    assert_eq!(trace(sun(Vec3::NEG_Y), &View { size: [0, 6], ..view.clone() }), Ok(Mask::background(0, 6)));
    for light in [sun(Vec3::ZERO), sun(Vec3::NAN), lamp(Vec3::INFINITY)] {
        assert!(matches!(trace(light, &view), Err(TraceError::BadLight { .. })));
    }
    let flat = Frustum { left: 1.0, right: 1.0, ..view.frustum };
    for bad in [View { view_from_world: Mat4::ZERO, ..view.clone() }, View { frustum: flat, ..view.clone() }] {
        assert!(matches!(trace(sun(Vec3::NEG_Y), &bad), Err(TraceError::BadView { .. })));
    }
    assert_eq!(trace_visibility(&empty, 2, &view, &options), Err(TraceError::NoLight { light: 2, count: 0 }));
    assert_eq!(class(&scene(vec![ground(1.0)]), &lamp(Vec3::ZERO), Vec3::Y, Vec3::ZERO, &options), LIT, "light on the surface");
}

#[test]
fn progress_counts_every_row() {
    let rows = Mutex::new(Vec::new());
    let tracer = Tracer::new(&scene(vec![ground(1.0)]));
    let view = view(vec3(0.0, 2.0, 2.0), Vec3::ZERO, [16, 40]);
    let mask = tracer.visibility(&sun(Vec3::NEG_Y), &view, &TraceOptions::default(), &|n| rows.lock().unwrap().push(n)).unwrap();
    let mut rows = rows.into_inner().unwrap();
    rows.sort_unstable();
    assert_eq!(rows, (1..=40).collect::<Vec<u32>>());
    // The square is seen as a trapezium without holes, its border is mixed, all else is background.
    assert!(mask.count(LIT) > 100 && mask.count(Mask::MIXED) > 20 && mask.count(BACKGROUND) > 100);
    assert_eq!(mask.count(LIT) + mask.count(Mask::MIXED) + mask.count(BACKGROUND), 640);
    assert_eq!(mask, tracer.visibility(&sun(Vec3::NEG_Y), &view, &TraceOptions::default(), &|_| ()).unwrap());
    assert!(dvec3(0.0, 2.0, 2.0).distance(Camera::new(&view, 1).unwrap().eye) < 1e-6);
}

#[test]
fn a_straight_edge_hides_the_segment_of_the_disc() {
    // A half plane at height 4 over the ground under a light straight above: at x from the edge's foot the disc is cut at
    // the distance x from its centre.
    let sheet = drawable(square(), Mat4::from_translation(vec3(25.0, 4.0, 0.0)) * Mat4::from_scale(Vec3::splat(25.0)));
    let world = scene(vec![ground(60.0), sheet]);
    let high = vec3(0.0, 12.0, 0.0);
    for (name, light, radius) in [
        ("sun", Light { size: 0.1, ..sun(Vec3::NEG_Y) }, 0.4),
        // A disc of 0.1 twice as far above the edge as the ground is below: half as large on the ground.
        ("lamp", Light { size: 0.1, ..lamp(high) }, 0.05),
    ] {
        let tracer = Tracer::new(&world);
        let beam = Beam::new(&light).unwrap();
        let disc = super::area::disc(f64::from(light.size), 4096);
        for x in [-1.5f64, -1.0, -0.7, -0.2, 0.0, 0.4, 0.9, 1.1] {
            let (eye, target) = (dvec3(-9.0, 3.0, 0.0), dvec3(x * radius, 0.0, 0.0));
            let found = tracer.share(&Ray::new(eye, (target - eye).normalize()), &beam, &TraceOptions::default(), &disc).unwrap();
            let cut = x.clamp(-1.0, 1.0);
            let expected = (cut.acos() - cut * (1.0 - cut * cut).sqrt()) / std::f64::consts::PI;
            assert!((found - expected).abs() < 0.01, "{name} {x}: {found} instead of {expected}");
        }
    }
    let shares = Shares { width: 4, height: 1, shares: vec![None, Some(0.0), Some(0.5), Some(1.0)] };
    let score = shares.score(&[9, 51, 255, 255]).unwrap();
    assert_eq!((score.penumbra_pixels, score.pixels), (1, 3));
    assert!((score.penumbra - 0.5).abs() < 1e-6 && (score.overall - 0.7 / 3.0).abs() < 1e-6, "{score:?}");
    assert_eq!(shares.visibility(), [0, 0, 128, 255]);
    assert!(shares.score(&[0; 3]).is_err());
}

/// A wire of a hundredth of a pixel and its shadow pass between sixteen rays here and there, but not between those of a pixel that
/// lies beside one where they were met.
#[test]
fn wires_are_followed_where_rays_are_too_far_apart() {
    let wire = drawable(sphere(8), Mat4::from_translation(vec3(0.0, 1.0, 0.0)) * Mat4::from_scale(vec3(4.0, 0.0005, 0.0005)));
    let world = Scene { lights: vec![sun(vec3(0.05, -1.0, 0.3))], ..scene(vec![ground(6.0), wire]) };
    let view = view(vec3(0.3, 7.0, 6.0), Vec3::ZERO, [64, 48]);
    let mask = |fine_sub_samples| {
        let options = TraceOptions { fine_sub_samples, ..TraceOptions::default() };
        trace_visibility(&world, 0, &view, &options).unwrap()
    };
    let [plain, same, fine] = [0, 4, 24].map(mask);
    assert_eq!(plain, same);
    assert!(plain.classes.iter().zip(&fine.classes).all(|(plain, fine)| fine == plain || *fine == Mask::MIXED));
    let counts = [&plain, &fine].map(|m| m.count(Mask::MIXED));
    assert!(counts[1] >= counts[0] + 20, "{counts:?}");
    assert_eq!(fine, mask(24));
}
