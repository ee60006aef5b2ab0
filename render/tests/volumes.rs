//! Stencil shadow volumes against ray casting in double precision: every kind of mesh, every kind of light, the eye
//! anywhere.

#[path = "volumes/harness.rs"]
mod harness;
#[path = "volumes/shapes.rs"]
mod shapes;
#[path = "volumes/truth.rs"]
mod truth;

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use harness::{Gpu, Loaded, light};
use shapes::{Thing, cuboid, exploded, inconsistent, merged, sheet, soup, sphere, three_blades};
use umbriel_render::volumes::{Depth, VolumeDraws, VolumeLight};
use umbriel_scene::{Frustum, Silhouettes, View, VolumeCounting, VolumeSettings};

const SIZE: [u32; 2] = [128, 96];
/// Share of counted samples that may differ from the truth.
const ALLOWED: f64 = 0.0002;

#[derive(Default)]
struct Score {
    counted: u64,
    wrong: u64,
    shadowed: u64,
    inverted_frames: u64,
}

/// Draws one picture at each sample count and compares every sample.
fn compare(gpus: &mut [(u32, Gpu)], casters: &[Thing], receivers: &[Thing], toward_light: Vec4, view: &View) -> Score {
    compare_under(gpus, casters, receivers, light(toward_light), view)
}

fn compare_under(gpus: &mut [(u32, Gpu)], casters: &[Thing], receivers: &[Thing], light: VolumeLight, view: &View) -> Score {
    let truth = truth::Truth::new(casters, receivers, light.toward_light, view);
    let mut score = Score::default();
    for (samples, gpu) in gpus {
        let load = |things: &[Thing]| -> Vec<Loaded> { things.iter().map(|t| gpu.load(t)).collect() };
        let (casters, receivers) = (load(casters), load(receivers));
        let (stencil, ..) = gpu.stencil(&casters, &receivers, light, view);
        let places = harness::sample_places(*samples);
        let (mut counted, mut wrong) = (0, 0);
        for (i, value) in stencil.into_iter().enumerate() {
            let (pixel, sample) = (i / places.len(), i % places.len());
            let (x, y) = (pixel as u32 % view.size[0], pixel as u32 / view.size[0]);
            let Some(expected) = truth.shadowed(f64::from(x) + places[sample].0, f64::from(y) + places[sample].1) else {
                continue;
            };
            counted += 1;
            score.shadowed += u64::from(expected);
            wrong += u64::from(expected != (value != 0));
        }
        score.counted += counted;
        score.wrong += wrong;
        score.inverted_frames += u64::from(2 * wrong > counted);
    }
    score
}

fn both() -> Vec<(u32, Gpu)> {
    [1, 4].map(|samples| (samples, Gpu::new(samples))).into()
}

fn looking(eye: Vec3, at: Vec3, frustum: Frustum) -> View {
    let view_from_world = glam::camera::rh::view::look_at_mat4(eye, at, Vec3::Y);
    View { name: String::new(), view_from_world, frustum, size: SIZE }
}

fn ordinary() -> View {
    looking(Vec3::new(2.3, 2.9, 4.1), Vec3::new(0.2, 0.4, 0.0), Frustum::symmetric(0.9, 128.0 / 96.0, 0.05))
}

fn room() -> Vec<Thing> {
    let wall = Mat4::from_translation(Vec3::new(0.3, 2.0, -3.0)) * Mat4::from_rotation_x(1.4);
    vec![sheet(6.0), sheet(4.0).under(wall)]
}

fn sun() -> Vec4 {
    Vec4::new(-0.6, 1.0, -0.5, 0.0)
}

fn lamp() -> Vec4 {
    Vec4::new(-1.1, 3.2, -1.4, 1.0)
}

#[test]
fn any_mesh_under_any_light() {
    let up = Vec3::new(0.0, 1.0, 0.0);
    let tilt = Mat4::from_rotation_translation(Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.2), up);
    let a_box = || cuboid(Vec3::new(0.6, 0.5, 0.7));
    let lidless = || a_box().edited(|_, indices| indices.truncate(30));
    let minus_zero =
        |t: Thing| t.edited(|p, _| p.iter_mut().step_by(2).for_each(|v| *v = v.map(|c| if c == 0.0 { -0.0 } else { c })));
    // A quad whose right neighbours meet the middle of its edge.
    let t_junction = || {
        let p = |x: f32, z: f32| Vec3::new(x, 0.0, z);
        let points = vec![p(-1., -1.), p(0., -1.), p(0., 1.), p(-1., 1.), p(0., 0.1), p(1., -1.), p(1., 0.1), p(1., 1.)];
        soup(points, vec![0, 2, 1, 0, 3, 2, 1, 4, 6, 1, 6, 5, 4, 2, 7, 4, 7, 6])
    };
    let rows: Vec<(&str, Vec<Thing>)> = vec![
        ("box", vec![a_box().under(tilt)]),
        ("box on the floor", vec![a_box().at(Vec3::Y * 0.5)]),
        ("sphere", vec![sphere(0.8, 24, 12).at(up)]),
        ("box wound inward", vec![a_box().edited(|_, i| i.chunks_exact_mut(3).for_each(|t| t.swap(1, 2))).under(tilt)]),
        ("sheet", vec![sheet(0.8).under(tilt)]),
        ("standing sheet", vec![sheet(0.8).under(tilt * Mat4::from_rotation_z(1.5))]),
        ("box without a lid", vec![lidless().at(Vec3::Y * 0.6)]),
        ("tilted box without a lid", vec![lidless().under(tilt)]),
        ("lidless box upside down", vec![lidless().under(tilt * Mat4::from_rotation_x(3.0))]),
        ("single triangle", vec![sheet(1.0).edited(|_, i| i.truncate(3)).under(tilt)]),
        ("three blades at an edge", vec![three_blades().at(up)]),
        ("inconsistent winding", vec![inconsistent(sphere(0.8, 16, 8)).at(up)]),
        ("T-junction", vec![t_junction().under(tilt)]),
        ("own vertices for each triangle", vec![exploded(sphere(0.8, 16, 8)).at(up)]),
        ("minus zero", vec![minus_zero(exploded(sphere(0.8, 16, 8))).at(up)]),
        ("everything twice", vec![merged(&[a_box(), a_box()]).under(tilt)]),
        ("both sides of a sheet", vec![sheet(0.8).edited(|_, i| i.extend([0, 1, 2, 0, 2, 3])).under(tilt)]),
        (
            "zero areas",
            vec![
                a_box()
                    .edited(|p, i| {
                        p.push((p[0] + p[1]) * 0.5);
                        i.extend([0, 0, 0, 0, 1, 1, 0, 8, 1, 2, 3, 2]);
                    })
                    .under(tilt),
            ],
        ),
        ("mirrored", vec![a_box().under(tilt * Mat4::from_scale(Vec3::new(-1.0, 1.2, 0.8)))]),
        ("mirrored and open", vec![lidless().under(tilt * Mat4::from_scale(Vec3::new(0.9, -1.0, 0.8)))]),
        (
            "deformed",
            vec![
                sphere(0.8, 16, 8).deformed(|p| p * (1.0 + 0.3 * (5.0 * p.y).sin()) + Vec3::X * p.y * p.y).at(up),
                lidless().deformed(|p| p + Vec3::Z * 0.4 * p.y).at(Vec3::new(-0.9, 0.9, 0.4)),
            ],
        ),
        ("flattened by its matrix", vec![sphere(0.9, 12, 6).under(tilt * Mat4::from_scale(Vec3::new(1.0, 0.0, 1.0)))]),
        (
            "overlapping, one mirrored",
            vec![
                a_box().under(tilt),
                sphere(0.6, 16, 8).under(Mat4::from_translation(Vec3::new(0.5, 1.3, 0.2)) * Mat4::from_scale(-Vec3::ONE)),
                sheet(1.0).at(Vec3::new(0.3, 2.2, 0.1)),
            ],
        ),
        ("shell in a shell", vec![merged(&[sphere(0.9, 16, 8), sphere(0.5, 12, 6)]).at(up)]),
    ];
    let lights = [("sun", sun()), ("lamp", lamp()), ("low spot", Vec4::new(3.0, 0.9, 1.5, 1.0))];
    let mut gpus = both();
    for (name, casters) in rows {
        for (light_name, toward_light) in lights {
            let score = compare(&mut gpus, &casters, &room(), toward_light, &ordinary());
            let share = score.wrong as f64 / score.counted as f64;
            println!("{name} under {light_name}: {} of {} wrong, {} shadowed", score.wrong, score.counted, score.shadowed);
            assert!(score.shadowed > 500, "{name} under {light_name}: {} shadowed", score.shadowed);
            assert!(share <= ALLOWED, "{name} under {light_name}: {} of {} wrong", score.wrong, score.counted);
        }
    }
}

/// Numbers in 0..1, always the same.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    fn around(&mut self, centre: Vec3, half: Vec3) -> Vec3 {
        centre + half * Vec3::new(self.next() - 0.5, self.next() - 0.5, self.next() - 0.5) * 2.0
    }

    /// A window that the eye sees from the side.
    fn off_axis(&mut self, near: f32) -> Frustum {
        let centre = Vec2::new(self.next() - 0.5, self.next() - 0.5) * 1.5;
        let half = Vec2::new(0.3 + self.next(), 0.3 + self.next());
        let (low, high) = ((centre - half) * near, (centre + half) * near);
        Frustum { left: low.x, right: high.x, bottom: low.y, top: high.y, near }
    }
}

/// 60 places, or as many as a long check wants: `UMBRIEL_EYES=600 cargo test -p umbriel-render --test volumes the_eye`.
#[test]
fn the_eye_anywhere() {
    let wanted = std::env::var("UMBRIEL_EYES").map_or(60, |count| count.parse().expect("UMBRIEL_EYES is a number of places"));
    eyes(wanted, &mut both(), VolumeCounting::Auto);
}

/// Depth that runs from 0 to 1 - epsilon (002), and depth that the device clamps.
#[test]
fn conventional_depth() {
    eyes(
        12,
        &mut [(1, Gpu::with_depth(1, Depth::Conventional)), (4, Gpu::with_depth(4, Depth::Conventional))],
        VolumeCounting::Auto,
    );
    eyes(6, &mut [(1, Gpu::with_depth(1, Depth::Clamped))], VolumeCounting::ZFail);
}

/// Views from places in and around volumes, under three lights, through windows aside.
fn eyes(count: usize, gpus: &mut [(u32, Gpu)], counting: VolumeCounting) {
    let settings = VolumeSettings { counting, ..VolumeSettings::default() };
    let mut casters = vec![
        cuboid(Vec3::new(0.9, 0.3, 0.8)).at(Vec3::Y * 2.0),
        cuboid(Vec3::new(0.5, 0.4, 0.5)).edited(|_, i| i.truncate(30)).at(Vec3::new(0.7, 0.6, -0.5)),
        sheet(0.7).at(Vec3::new(-0.9, 1.3, 0.3)),
    ];
    let mut random = Random(7);
    let mut total = Score::default();
    for i in 0..count {
        let toward_light = [sun(), lamp(), Vec4::new(0.1, 3.0, 0.2, 1.0)][i % 3];
        let eye = random.around(Vec3::new(-0.2, 0.9, -0.2), Vec3::new(0.8, 0.85, 0.8));
        let at = random.around(Vec3::new(0.0, 0.3, 0.0), Vec3::splat(2.0));
        let near = [0.02, 0.1, 0.4][i / 3 % 3];
        let view = looking(eye, at, random.off_axis(near));
        casters.iter_mut().for_each(|c| c.bounds_known = i % 2 == 0);
        let score = compare_under(gpus, &casters, &room(), VolumeLight { settings, ..light(toward_light) }, &view);
        let share = score.wrong as f64 / score.counted.max(1) as f64;
        assert!(share <= ALLOWED, "view {i} from {eye}: {} of {} wrong", score.wrong, score.counted);
        assert_eq!(score.inverted_frames, 0, "view {i} from {eye}");
        total.counted += score.counted;
        total.wrong += score.wrong;
        total.shadowed += score.shadowed;
    }
    println!("{count} eyes: {} of {} wrong, {} shadowed", total.wrong, total.counted, total.shadowed);
    assert!(total.shadowed * 5 > total.counted);
}

#[test]
fn a_light_inside_a_caster() {
    let lantern = cuboid(Vec3::splat(0.5)).at(Vec3::new(0.0, 1.2, 0.0));
    let windowed = cuboid(Vec3::splat(0.5)).edited(|_, i| i.truncate(30)).under(Mat4::from_translation(Vec3::Y * 1.2));
    let inner = sphere(0.15, 12, 6).at(Vec3::new(0.25, 1.3, 0.1));
    let near_mesh = sphere(0.6, 16, 8).at(Vec3::new(0.0, 1.2, 0.0));
    let toward_light = Vec4::new(0.0, 1.25, 0.05, 1.0);
    let inside = looking(Vec3::new(-0.4, 1.2, 0.3), Vec3::new(0.3, 1.2, 0.0), Frustum::symmetric(1.2, 1.3, 0.02));
    let mut gpus = both();
    for (name, casters, view) in [
        ("closed", vec![lantern.clone()], ordinary()),
        ("open above", vec![windowed.clone()], ordinary()),
        ("something beside the light", vec![lantern, inner.clone()], inside.clone()),
        ("open, something beside the light", vec![windowed, inner], inside),
        ("sphere", vec![near_mesh], ordinary()),
    ] {
        let score = compare(&mut gpus, &casters, &room(), toward_light, &view);
        println!("{name}: {} of {} wrong, {} shadowed", score.wrong, score.counted, score.shadowed);
        assert!(score.wrong as f64 <= ALLOWED * score.counted as f64, "{name}: {} of {} wrong", score.wrong, score.counted);
        assert!(score.shadowed > 500, "{name}");
    }
}

/// Within a closed caster everything is dark, whichever side of it throws the volume.
#[test]
fn the_eye_inside_a_closed_caster() {
    let hall = || cuboid(Vec3::new(1.5, 1.0, 1.3)).at(Vec3::Y);
    let inward = || hall().edited(|_, i| i.chunks_exact_mut(3).for_each(|t| t.swap(1, 2)));
    let mirror = Mat4::from_scale(Vec3::new(1.0, 1.0, -1.0));
    let stone = cuboid(Vec3::new(0.3, 0.2, 0.2)).at(Vec3::new(0.4, 0.5, -0.3));
    let view = looking(Vec3::new(-1.0, 1.2, 0.9), Vec3::new(0.4, 0.7, -0.2), Frustum::symmetric(1.4, 1.3, 0.02));
    let mut gpus = both();
    for (name, hall) in [
        ("outward", hall()),
        ("inward", inward()),
        ("mirrored", hall().under(mirror)),
        ("inward and mirrored", inward().under(mirror)),
        ("one mesh, one surface inward", merged(&[cuboid(Vec3::splat(0.2)).at(Vec3::new(0.0, 1.5, 0.0)), inward()])),
    ] {
        for toward_light in [sun(), lamp()] {
            let score = compare(&mut gpus, std::slice::from_ref(&hall), std::slice::from_ref(&stone), toward_light, &view);
            println!("{name}: {} of {} wrong", score.wrong, score.counted);
            assert!(score.wrong as f64 <= ALLOWED * score.counted as f64, "{name}: {} of {} wrong", score.wrong, score.counted);
            assert!(score.shadowed == score.counted && score.counted > 50_000, "{name}");
        }
    }
}

/// More layers than eight bits count: on the floor lie 300, 256 and 128 of them side by side.
#[test]
fn three_hundred_layers() {
    let plate = |i: usize| {
        let reach = [0.75, 0.5, 0.25][i / 128];
        cuboid(Vec3::new(reach, 0.0002, 0.8)).at(Vec3::new(reach, 1.0 + 0.001 * i as f32, 0.0))
    };
    let plates: Vec<Thing> = (0..300).map(plate).collect();
    // One surface, folded to and fro.
    let edge = |i: u32| {
        let x = if i.is_multiple_of(2) { 0.0 } else { [1.5, 1.0, 0.5][(i as usize - 1) / 128] };
        [-0.8, 0.8].map(|z| Vec3::new(x, 1.0 + 0.001 * i as f32, z))
    };
    let folds = (0..300u32).flat_map(|i| [0, 1, 2, 2, 1, 3].map(|k| 2 * i + k)).collect();
    let strip = soup((0..=300).flat_map(edge).collect(), folds);
    let view = looking(Vec3::new(0.7, 0.8, 2.4), Vec3::new(0.7, 0.0, 0.5), Frustum::symmetric(0.7, 128.0 / 96.0, 0.05));
    let mut gpus = both();
    for toward_light in [Vec4::new(0.02, 1.0, 0.01, 0.0), Vec4::new(0.7, 20.0, 0.0, 1.0)] {
        for (name, casters, silhouettes) in [
            ("300 casters", plates.clone(), Silhouettes::Compute),
            ("one surface of 300 folds", vec![strip.clone()], Silhouettes::Compute),
            ("a surface of 300 folds over another", vec![strip.clone(), strip.clone().at(Vec3::Y * 0.4)], Silhouettes::Compute),
            ("one mesh of 300 pieces", vec![merged(&plates)], Silhouettes::Compute),
            ("one mesh of 300 pieces as quads", vec![merged(&plates)], Silhouettes::Quads),
        ] {
            let settings = VolumeSettings { silhouettes, ..VolumeSettings::default() };
            let under = VolumeLight { settings, ..light(toward_light) };
            let score = compare_under(&mut gpus, &casters, &[sheet(6.0)], under, &view);
            println!("{name}: {} of {} wrong, {} shadowed", score.wrong, score.counted, score.shadowed);
            assert!(score.wrong as f64 <= ALLOWED * score.counted as f64, "{name}: {} of {} wrong", score.wrong, score.counted);
            assert!(score.shadowed > 5000, "{name}");
        }
    }
}

/// What does not change is not made again, and what changes is.
#[test]
fn lists_are_kept_and_renewed() {
    let view = ordinary();
    let mut gpu = Gpu::new(1);
    let far = Vec3::new(50.0, 1.0, 0.0);
    let (a, b) = (cuboid(Vec3::splat(0.5)).at(Vec3::Y), sphere(0.4, 12, 6).at(Vec3::new(0.8, 1.2, 0.5)));
    let (a, b, floor) = (gpu.load(&a), gpu.load(&b), gpu.load(&sheet(6.0)));
    let moved = Loaded { thing: a.thing.clone().at(far), ..a.clone() };
    let deformed = Loaded { revision: 1, ..a.clone() };
    let away: Vec<Vec3> = a.thing.mesh.positions.iter().map(|p| *p + far).collect();
    let empty = gpu.load(&soup(vec![Vec3::ZERO; 3], vec![0, 0, 1]));
    let mut shadowed = |casters: &[&Loaded], toward_light: Vec4, write: bool| {
        if write {
            gpu.queue.write_buffer(&a.positions, 0, bytemuck::cast_slice(&away));
        }
        let casters: Vec<Loaded> = casters.iter().map(|l| (*l).clone()).collect();
        let (stencil, stats, _) = gpu.stencil(&casters, std::slice::from_ref(&floor), light(toward_light), &view);
        (stencil.iter().filter(|s| **s != 0).count(), [stats.extracted, stats.kept, stats.left_out])
    };
    let (first, _) = shadowed(&[&a, &b], sun(), false);
    let (b_alone, _) = shadowed(&[&b], sun(), false);
    assert!(first > b_alone + 200 && b_alone > 50, "{first} {b_alone}");
    /// Name, casters, light, are the positions of `a` written, is more in shadow than by `b` alone; lists extracted,
    /// kept, left out.
    type Row<'a> = (&'static str, &'a [&'a Loaded], Vec4, bool, bool, [usize; 3]);
    let turn = Mat4::from_rotation_translation(Quat::from_rotation_y(0.4), Vec3::new(0.1, 0.0, 0.05));
    let turned = |l: &Loaded| Loaded { thing: l.thing.clone().under(turn), ..l.clone() };
    let (a_turned, b_turned, lamp_turned) = (turned(&a), turned(&b), turn * lamp());
    let rows: [Row<'_>; 11] = [
        ("a again beside b", &[&a, &b], sun(), false, true, [1, 1, 0]),
        ("nothing changed", &[&a, &b], sun(), false, true, [0, 2, 0]),
        ("order changed", &[&b, &a], sun(), false, true, [0, 2, 0]),
        ("a moved away under parallel light", &[&moved, &b], sun(), false, false, [0, 2, 0]),
        ("a is back", &[&a, &b], sun(), false, true, [0, 2, 0]),
        ("nothing to cast", &[&a, &empty, &b], sun(), false, true, [0, 2, 1]),
        ("another light", &[&a, &b], lamp(), false, true, [2, 0, 0]),
        ("all turned as one", &[&a_turned, &b_turned], lamp_turned, false, true, [0, 2, 0]),
        ("one turned, the light with it", &[&a_turned, &b], lamp_turned, false, true, [1, 1, 0]),
        ("all back", &[&a, &b], lamp(), false, true, [1, 1, 0]),
        ("a deformed away", &[&deformed, &b], sun(), true, false, [2, 0, 0]),
    ];
    for (name, casters, toward_light, write, more, expected) in rows {
        let (count, stats) = shadowed(casters, toward_light, write);
        assert_eq!(stats, expected, "{name}");
        assert_eq!(count > b_alone + 100, more, "{name}: {count} shadowed, {b_alone} by b");
    }
}

#[test]
fn shaders_are_valid() {
    let silhouette = include_str!("../src/volumes/silhouette.wgsl");
    let thrown = include_str!("../src/volumes/thrown.wgsl");
    let files = [
        (
            "extract",
            [
                harness::POSITION,
                silhouette,
                include_str!("../src/volumes/caster.wgsl"),
                include_str!("../src/volumes/extract.wgsl"),
            ]
            .concat(),
        ),
        ("draw", [harness::VIEW, harness::POSITION, silhouette, thrown, include_str!("../src/volumes/draw.wgsl")].concat()),
        ("quads", [harness::VIEW, harness::POSITION, silhouette, thrown, include_str!("../src/volumes/quads.wgsl")].concat()),
    ];
    for (file, source) in files {
        let module = naga::front::wgsl::parse_str(&source).unwrap_or_else(|e| panic!("{file}: {}", e.emit_to_string(&source)));
        let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
        validator.validate(&module).unwrap_or_else(|e| panic!("{file}: {e:?}"));
        let (_, caster) =
            module.types.iter().find(|(_, t)| t.name.as_deref() == Some("Caster")).unwrap_or_else(|| panic!("{file}: no Caster"));
        let naga::TypeInner::Struct { members, span } = &caster.inner else { panic!("{file}: Caster is no struct") };
        let offsets: Vec<u32> = members.iter().map(|m| m.offset).collect();
        assert_eq!((offsets, *span), (vec![0, 64, 80, 84, 88, 92], 96), "{file}");
    }
}

/// Counting in front of what is seen, ends, scissors and culling change nothing in the picture, nor does another way to
/// find silhouettes: stencils are equal sample by sample.
#[test]
fn all_settings_give_the_same_stencil() {
    let all_off = VolumeSettings { counting: VolumeCounting::ZFail, culling: false, fitted: false, ..VolumeSettings::default() };
    let variants = [
        ("auto", VolumeSettings { counting: VolumeCounting::Auto, ..all_off }),
        ("culled", VolumeSettings { culling: true, ..all_off }),
        ("fitted", VolumeSettings { fitted: true, ..all_off }),
        ("all", VolumeSettings::default()),
        ("quads", VolumeSettings { silhouettes: Silhouettes::Quads, ..all_off }),
        ("all with quads", VolumeSettings { silhouettes: Silhouettes::Quads, ..VolumeSettings::default() }),
        ("all but depth bounds", VolumeSettings { depth_bounds: false, ..VolumeSettings::default() }),
    ];
    let tilt = Mat4::from_rotation_translation(Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.2), Vec3::new(-0.4, 0.8, 0.9));
    let casters = [
        cuboid(Vec3::new(0.9, 0.3, 0.8)).at(Vec3::Y * 2.0),
        cuboid(Vec3::new(0.5, 0.4, 0.5)).edited(|_, i| i.truncate(30)).at(Vec3::new(0.7, 0.6, -0.5)),
        inconsistent(sphere(0.3, 12, 6)).under(tilt),
        sphere(0.4, 16, 8).under(Mat4::from_translation(Vec3::new(1.5, 0.7, 1.2)) * Mat4::from_scale(Vec3::new(1.0, -1.0, 1.0))),
        sheet(0.7).at(Vec3::new(-0.9, 1.3, 0.3)),
        three_blades().at(Vec3::new(0.2, 1.0, -1.6)),
        // Much smaller than the box around it along the axes of the world, and askew.
        cuboid(Vec3::new(0.9, 0.05, 0.07)).under(Mat4::from_scale(Vec3::new(1.0, 1.4, 0.8)) * tilt),
    ];
    let mut random = Random(11);
    let mut totals = [VolumeDraws::default(); 7];
    for (samples, views) in [(1, 40), (4, 20)] {
        let mut gpu = Gpu::new(samples);
        let casters: Vec<Loaded> = casters.iter().map(|t| gpu.load(t)).collect();
        let receivers: Vec<Loaded> = room().iter().map(|t| gpu.load(t)).collect();
        for i in 0..views {
            let toward_light = [sun(), lamp(), Vec4::new(0.1, 3.0, 0.2, 1.0), Vec4::new(0.7, 0.6, -0.5, 1.0)][i % 4];
            let eye = random.around(Vec3::new(-0.2, 1.2, -0.2), Vec3::new(2.8, 1.15, 2.8));
            let at = random.around(Vec3::new(0.0, 0.6, 0.0), Vec3::splat(1.5));
            let view = looking(eye, at, random.off_axis([0.02, 0.1, 0.4][i / 4 % 3]));
            let mut drawn = |settings| gpu.stencil(&casters, &receivers, VolumeLight { settings, ..light(toward_light) }, &view);
            let (expected, _, plain) = drawn(all_off);
            assert_eq!((plain.z_fail, plain.culled), (casters.len() as u32, 0), "view {i}");
            for (v, (name, settings)) in variants.into_iter().enumerate() {
                let (found, _, draws) = drawn(settings);
                let differ = expected.iter().zip(&found).filter(|(a, b)| a != b).count();
                // An edge that ends elsewhere, or is cut to another rectangle, may be rounded to another sample.
                let allowed = if settings.fitted || settings.culling { expected.len() / 10_000 } else { 0 };
                assert!(
                    differ <= allowed,
                    "{differ} differ: {name}, view {i} from {eye} to {at}, {samples} samples, light {toward_light}: {draws:?}"
                );
                totals[v].add(&draws);
            }
        }
    }
    println!("{totals:?}");
    let [auto, culled, _, all, _, _, unbounded] = totals;
    // Each of them had something to do.
    assert!(auto.z_pass > 40 && auto.z_fail > 40, "{auto:?}");
    assert!(all.culled > unbounded.culled + 25, "{all:?} {unbounded:?}");
    assert!(culled.culled > 20 && all.culled > 20 && all.far_caps < culled.far_caps + all.z_fail, "{culled:?} {all:?}");
}
