//! Lights inside of what casts their shadows, and what is said of them.

use crate::support::*;
use glam::{Mat4, Vec3};
use umbriel_render::Renderer;
use umbriel_scene::*;

/// A box without its lid.
fn shade() -> Mesh {
    let whole = cuboid(Vec3::ONE);
    Mesh { indices: whole.indices[6..].into(), ..whole }
}

/// The same box as seen from within.
fn inward() -> Mesh {
    let whole = cuboid(Vec3::ONE);
    Mesh { indices: whole.indices.chunks(3).flat_map(|t| [t[0], t[2], t[1]]).collect(), ..whole }
}

/// Bars around the light, all in one mesh, each of them closed.
fn lantern() -> Mesh {
    let bar = cuboid(Vec3::new(0.1, 1.0, 0.1));
    let at = |x: f32, z: f32| bar.positions.iter().map(move |p| *p + Vec3::new(x, 0.0, z)).collect::<Vec<_>>();
    let positions = [at(-0.5, -0.5), at(0.5, -0.5), at(-0.5, 0.5), at(0.5, 0.5)].concat();
    let count = bar.positions.len() as u32;
    let indices = (0..4).flat_map(|i| bar.indices.iter().map(move |v| v + i * count)).collect();
    Mesh { name: "bars".into(), positions: positions.into(), indices, ..Default::default() }.checked().unwrap()
}

fn globe(mesh: Mesh, material: Material) -> Drawable {
    Drawable { name: "globe".into(), ..shape(mesh, material, at(0.0, 2.0, 0.0)) }
}

fn scene(globe: Drawable, light: Light) -> Scene {
    let floor = shape(plane(6.0), matt(0.5, 0.5, 0.5), Mat4::IDENTITY);
    Scene { drawables: vec![floor, globe].into(), lights: vec![light], ..Default::default() }
}

fn lamp() -> Light {
    let position = Vec3::new(0.1, 2.2, 0.05);
    Light { name: "lamp".into(), kind: LightKind::Point, position, shadows: ShadowMethod::Volume, ..noon() }
}

#[test]
fn a_light_inside_of_its_caster_is_told() {
    let told = "light 'lamp' is inside of 'globe', which is closed: all that is outside of it is in its shadow. Move the light, or \
                set `cast_shadow` of the shape to false";
    let (grey, both) = (matt(0.6, 0.6, 0.6), Material { double_sided: true, ..matt(0.6, 0.6, 0.6) });
    let whole = || globe(cuboid(Vec3::ONE), grey.clone());
    let mirrored = Drawable { world_from_object: at(0.0, 2.0, 0.0) * Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0)), ..whole() };
    let room = || {
        let mut room = scene(globe(cuboid(Vec3::ONE), both.clone()), lamp());
        room.drawables.push(shape(cuboid(Vec3::splat(0.1)), grey.clone(), at(-0.2, 2.0, 0.0)));
        room
    };
    let mut film = scene(Drawable { casts_shadow: false, ..whole() }, Light { shadows: ShadowMethod::None, ..lamp() });
    let mode = StencilMode::Modulative(Film { color: glam::Vec4::new(0.0, 0.0, 0.0, 0.5) });
    film.stencil_groups = vec![StencilGroup { name: "group".into(), light: 0, casters: vec![1], mode }];
    let spot = LightKind::Spot { inner_rad: 0.4, outer_rad: 0.5 };
    let rows = [
        ("closed", scene(whole(), lamp()), true),
        ("spot", scene(whole(), Light { kind: spot, ..lamp() }), true),
        ("mirrored", scene(mirrored, lamp()), true),
        ("both_sides", scene(globe(cuboid(Vec3::ONE), both.clone()), lamp()), true),
        ("film", film, true),
        ("room", room(), false),
        ("open", scene(globe(shade(), grey.clone()), lamp()), false),
        ("inward", scene(globe(inward(), grey.clone()), lamp()), false),
        ("lantern", scene(globe(lantern(), grey.clone()), lamp()), false),
        ("outside", scene(whole(), Light { position: Vec3::new(0.0, 2.6, 0.0), ..lamp() }), false),
        ("sun", scene(whole(), Light { kind: LightKind::Directional, ..lamp() }), false),
        ("casts_nothing", scene(Drawable { casts_shadow: false, ..whole() }, lamp()), false),
        ("by_map", scene(whole(), Light { shadows: ShadowMethod::Map, ..lamp() }), false),
    ];
    for (name, scene, is_told) in rows {
        let view = look(&format!("enclosed_{name}"), Vec3::new(0.0, 3.0, 4.0), Vec3::new(0.0, 1.0, 0.0), [64, 48]);
        let expected: Vec<&str> = if is_told { vec![told] } else { vec![] };
        assert_eq!(shoot(&scene, &Picture::mono(view)).problems, expected, "{name}");
    }
}

/// Said once, and again when it was over and comes back.
#[test]
fn a_light_that_goes_in_again_is_news() {
    let (_turn, gpu) = gpu();
    let mut renderer = Renderer::new(gpu).unwrap();
    let view = look("enclosed_again", Vec3::new(0.0, 3.0, 4.0), Vec3::new(0.0, 1.0, 0.0), [64, 48]);
    let mut scene = scene(globe(cuboid(Vec3::ONE), matt(0.6, 0.6, 0.6)), lamp());
    let told = [2.2, 2.1, 3.0, 3.0, 2.2, 2.2].map(|height| {
        scene.lights[0].position.y = height;
        renderer.render(&scene, &[Picture::mono(view.clone())]).unwrap();
        renderer.problems().len()
    });
    assert_eq!(told, [1, 0, 0, 0, 1, 0]);
    // Without any light the frame has nothing to look at.
    let lights = std::mem::take(&mut scene.lights);
    for (lights, expected) in [(vec![], 0), (lights, 1)] {
        scene.lights = lights;
        renderer.render(&scene, &[Picture::mono(view.clone())]).unwrap();
        assert_eq!(renderer.problems().len(), expected);
    }
}
