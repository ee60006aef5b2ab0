//! Shaders of authors: what they see, what they replace, and what is said of wrong ones.

use crate::support::*;
use glam::{Mat4, Vec3, Vec4};
use std::sync::Arc;
use umbriel_render::Renderer;
use umbriel_scene::*;

fn shader(text: &str, params: &[(&str, ShaderParam)]) -> Option<FragmentShader> {
    let source = Arc::new(ShaderSource { name: "own.wgsl".into(), text: text.into() });
    Some(FragmentShader { source, params: params.iter().map(|(name, value)| (Arc::from(*name), *value)).collect() })
}

/// A floor with a shader, and a box over its middle that throws a shadow to the left.
fn scene(material: Material, shadows: ShadowMethod) -> Scene {
    let light = Light { direction: Vec3::new(-1.0, -1.0, 0.0).normalize(), shadows, ..noon() };
    Scene {
        drawables: vec![
            shape(plane(12.0), material, Mat4::IDENTITY),
            shape(cuboid(Vec3::splat(1.0)), matt(0.8, 0.8, 0.8), at(2.0, 2.0, 0.0)),
        ]
        .into(),
        lights: vec![light],
        ambient: Vec3::splat(0.1),
        ..Default::default()
    }
}

/// One renderer for many pictures.
struct Stage(Renderer);

impl Stage {
    fn new() -> Stage {
        let (_turn, gpu) = gpu();
        Stage(Renderer::new(gpu).unwrap())
    }

    fn drawn(&mut self, scene: &Scene) -> Shot {
        let (_turn, _) = gpu();
        let view = look("author", Vec3::new(0.0, 8.0, 0.0), Vec3::ZERO, [66, 66]);
        let stats = self.0.render(scene, &[Picture::mono(view)]).unwrap();
        let layers = self.0.read_back(0).unwrap();
        Shot { layers, stats, problems: self.0.problems() }
    }
}

/// Pixel in the box's shadow, and one in the light.
fn dark_and_lit(shot: &Shot) -> [[u8; 4]; 2] {
    [shot.pixel(33, 33), shot.pixel(33, 10)]
}

const METHODS: [ShadowMethod; 2] = [ShadowMethod::Map, ShadowMethod::Volume];

/// Shades by the shadow alone: red where it is lit, blue where it is not.
const BY_SHADOW: &str = "
fn ambient(s: Surface, light: vec3<f32>) -> vec3<f32> { return vec3<f32>(0.0); }
fn shade(s: Surface, light: LightSample) -> vec3<f32> {
    return mix(vec3<f32>(0.0, 0.0, 1.0), vec3<f32>(1.0, 0.0, 0.0), light.shadow);
}";

#[test]
fn shadows_reach_the_shader_by_every_method() {
    let mut stage = Stage::new();
    let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    for method in METHODS {
        for (name, material, dark) in [
            ("opaque", matt(0.5, 0.5, 0.5), blue),
            ("holed", Material { alpha: AlphaMode::Mask { cutoff: 0.5 }, ..matt(0.5, 0.5, 0.5) }, blue),
            // What is half-transparent gets the light of volumes everywhere, as without a shader.
            (
                "blended",
                Material { alpha: AlphaMode::Blend, ..matt(0.5, 0.5, 0.5) },
                if method == ShadowMethod::Map { blue } else { red },
            ),
        ] {
            let shot = stage.drawn(&scene(Material { shader: shader(BY_SHADOW, &[]), ..material }, method));
            assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
            let [in_shadow, in_light] = dark_and_lit(&shot);
            assert_colour(in_shadow, dark, &format!("{name}, {method:?}, in the shadow"));
            assert_colour(in_light, red, &format!("{name}, {method:?}, in the light"));
        }
    }
}

#[test]
fn part_of_a_shadow_reaches_the_shader() {
    let mut stage = Stage::new();
    for method in METHODS {
        let mut scene = scene(Material { shader: shader(BY_SHADOW, &[]), ..matt(0.5, 0.5, 0.5) }, method);
        scene.lights[0].shadow_intensity = 0.25;
        assert_colour(dark_and_lit(&stage.drawn(&scene))[0], [0.75, 0.0, 0.25], &format!("{method:?}"));
        scene.drawables[0].receives_shadow = false;
        assert_colour(dark_and_lit(&stage.drawn(&scene))[0], [1.0, 0.0, 0.0], &format!("{method:?}, no receiver"));
    }
}

/// A shader that does what we do gives our picture.
#[test]
fn our_own_functions_give_our_own_picture() {
    let text = "
        fn shade(s: Surface, light: LightSample) -> vec3<f32> { return standard_shade(s, light); }
        fn ambient(s: Surface, light: vec3<f32>) -> vec3<f32> { return standard_ambient(s, light); }
        fn finish(s: Surface, lit: vec3<f32>) -> vec4<f32> { return standard_finish(s, lit); }
        fn surface(s: Surface) -> Surface { return s; }";
    let mut stage = Stage::new();
    let material = Material { emissive: Vec3::new(0.1, 0.0, 0.0), ..matt(0.5, 0.4, 0.3) };
    for method in METHODS {
        let plain = stage.drawn(&scene(material.clone(), method)).layers;
        let shot = stage.drawn(&scene(Material { shader: shader(text, &[]), ..material.clone() }, method));
        assert_eq!(shot.problems, Vec::<String>::new());
        let apart = shot.layers[0].rgba.iter().zip(&plain[0].rgba).filter(|(a, b)| a.abs_diff(**b) > 1).count();
        assert_eq!(apart, 0, "{method:?}");
    }
}

#[test]
fn each_function_is_asked() {
    let half = "vec3<f32>(0.5)";
    let lit = 0.5f32.sqrt() * 0.5;
    /// Name, text, parameters, linear RGB.
    type Row<'a> = (&'a str, String, &'a [(&'a str, ShaderParam)], [f32; 3]);
    let rows: [Row<'_>; 8] = [
        ("none", "fn surface(s: Surface) -> Surface { return s; }".into(), &[], [lit + 0.05; 3]),
        (
            "surface",
            "fn surface(s: Surface) -> Surface { var t = s; t.base_color = vec4<f32>(1.0, 0.0, 0.0, 1.0); return t; }".into(),
            &[],
            [2.0 * lit + 0.1, 0.0, 0.0],
        ),
        ("shade", format!("fn shade(s: Surface, light: LightSample) -> vec3<f32> {{ return {half}; }}"), &[], [0.55; 3]),
        ("ambient", format!("fn ambient(s: Surface, light: vec3<f32>) -> vec3<f32> {{ return {half}; }}"), &[], [lit + 0.5; 3]),
        (
            "finish",
            "fn finish(s: Surface, lit: vec3<f32>) -> vec4<f32> { return vec4<f32>(lit * 2.0 + vec3<f32>(0.0, 0.1, 0.0), 1.0); }"
                .into(),
            &[],
            [2.0 * lit + 0.1, 2.0 * lit + 0.2, 2.0 * lit + 0.1],
        ),
        (
            "number and colour",
            "fn finish(s: Surface, lit: vec3<f32>) -> vec4<f32> { return vec4<f32>(params.tint * params.strength, 1.0); }".into(),
            &[("strength", ShaderParam::Scalar(0.5)), ("tint", ShaderParam::Vec3(Vec3::new(1.0, 0.5, 0.0)))],
            [0.5, 0.25, 0.0],
        ),
        (
            "vectors",
            "fn finish(s: Surface, lit: vec3<f32>) -> vec4<f32> { return vec4<f32>(params.a, params.b.w, 1.0); }".into(),
            &[("a", ShaderParam::Vec2(glam::Vec2::new(0.2, 0.4))), ("b", ShaderParam::Vec4(Vec4::new(0.0, 0.0, 0.0, 0.6)))],
            [0.2, 0.4, 0.6],
        ),
        (
            "places",
            "fn finish(s: Surface, lit: vec3<f32>) -> vec4<f32> {
                return vec4<f32>(place_in_world(s.position).x / 20.0, s.uv0.x, s.distance / 10.0, 1.0);
            }"
            .into(),
            &[],
            [0.5, 0.5, 0.8],
        ),
    ];
    let mut stage = Stage::new();
    for method in [ShadowMethod::None, ShadowMethod::Volume] {
        for (name, text, params, expected) in &rows {
            let mut scene = scene(Material { shader: shader(text, params), ..matt(0.5, 0.5, 0.5) }, method);
            scene.drawables[1].visible = false;
            scene.world_from_room = at(10.0, 0.0, 0.0);
            let shot = stage.drawn(&scene);
            assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
            let pixel = shot.centre();
            let expected: [i32; 3] = expected.map(srgb);
            let near = (0..3).all(|i| (i32::from(pixel[i]) - expected[i]).abs() <= 4);
            assert!(near, "{name}, {method:?}: {pixel:?} where {expected:?} is right");
        }
    }
}

/// A wrong shader is told once, and its shape looks as if it had none. One that is mended is used, and the same mistake is told again.
#[test]
fn a_wrong_shader_costs_itself() {
    let mut stage = Stage::new();
    let plain = stage.drawn(&scene(matt(0.5, 0.5, 0.5), ShadowMethod::Map));
    let wrong = scene(Material { shader: shader("fn shade() {", &[]), ..matt(0.5, 0.5, 0.5) }, ShadowMethod::Map);
    let first = stage.drawn(&wrong);
    assert_eq!(first.problems.len(), 1, "{:?}", first.problems);
    assert!(first.problems[0].contains("own.wgsl:1:13"), "{:?}", first.problems);
    assert!(first.layers == plain.layers, "the shape changed");
    assert_eq!(stage.drawn(&wrong).problems, Vec::<String>::new(), "told once");
    let mended = scene(Material { shader: shader(BY_SHADOW, &[]), ..matt(0.5, 0.5, 0.5) }, ShadowMethod::Map);
    assert_colour(dark_and_lit(&stage.drawn(&mended))[0], [0.0, 0.0, 1.0], "mended");
    for _ in 0..70 {
        assert_eq!(stage.drawn(&mended).problems, Vec::<String>::new(), "mended");
    }
    let again = scene(Material { shader: shader("fn shade() {", &[]), ..matt(0.5, 0.5, 0.5) }, ShadowMethod::Map);
    assert_eq!(stage.drawn(&again).problems, first.problems, "the same mistake again");
    for _ in 0..70 {
        assert_eq!(stage.drawn(&again).problems, Vec::<String>::new(), "told once as long as it is drawn");
    }
    // Other numbers for the same text are no news.
    let other = scene(Material { shader: shader("fn shade() {", &[]), ..matt(0.4, 0.5, 0.5) }, ShadowMethod::Map);
    assert_eq!(stage.drawn(&other).problems, Vec::<String>::new(), "the same text");
    let given: Vec<_> = ["a"; 17].iter().map(|name| (*name, ShaderParam::Scalar(1.0))).collect();
    let many = scene(Material { shader: shader(BY_SHADOW, &given), ..matt(0.5, 0.5, 0.5) }, ShadowMethod::Map);
    let many = stage.drawn(&many);
    assert!(many.problems[0].contains("16 parameters, it is given 17"), "{:?}", many.problems);
}

#[test]
fn loops_without_end_end() {
    let text = "fn finish(s: Surface, lit: vec3<f32>) -> vec4<f32> {
            var x = 1.0;
            loop { x = x + 1.0; }
            while true { x += 1.0; }
            for (;;) { x += 1.0; if x < 0.0 { break; } }
            return vec4<f32>(0.0, saturate(x), 0.0, 1.0);
        }";
    let mut scene = scene(Material { shader: shader(text, &[]), ..matt(0.5, 0.5, 0.5) }, ShadowMethod::None);
    scene.drawables[1].visible = false;
    let shot = shoot(&scene, &Picture::mono(look("endless", Vec3::new(0.0, 8.0, 0.0), Vec3::ZERO, [8, 8])));
    assert_eq!(shot.problems, Vec::<String>::new());
    assert_colour(shot.centre(), [0.0, 1.0, 0.0], "the loops");
}
