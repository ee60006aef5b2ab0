//! X3D's shadow nodes and fields (003, and those of X3D 4) as an author uses them: each row is a world, its picture is asked for the
//! places that must be dark or lit.
//!
//! A floor of 12 m lies around the origin, seen from 14 m above; a square of 2 m hovers 2 m over (-2, 0), whose shadow by a sun that
//! shines along (1, -1, 0) is the square around the origin.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use umbriel_displays::WindowSizes;
use umbriel_displays::rig::{Rig, Wanted};
use umbriel_render::{Gpu, Renderer, RgbaPixels};
use umbriel_scene::{Aabb, Scene};
use umbriel_scenegraph::Extractor;
use umbriel_scripts::World;

const SIDE: u32 = 96;

const BEFORE: &str = r#"
let matt = phong(#{ diffuse_color: color(0.8, 0.8, 0.8) });
let white = unlit(#{ emissive_color: color(1.0, 1.0, 1.0) });
let square = shape(plane(2, 2), matt);
let caster = transform(#{ translation: vec3(-2, 2, 0) }, square);
let slanted = vec3(1, -1, 0);
let down = vec3(0, -1, 0);
fn floor_of(look) { shape(plane(12, 12), look) }
world.add(make("Environment", #{ ambient: color(0, 0, 0) }));
world.add(make("Viewpoint", #{ position: vec3(0, 14, 0), orientation: axis_angle(vec3(1, 0, 0), -PI() / 2.0), field_of_view: 1.0 }));
"#;

/// What a place of the floor must look like, linear.
#[derive(Clone, Copy, Debug)]
enum Looks {
    Lit,
    Dark,
    Rgb(f32, f32, f32),
}

use Looks::{Dark, Lit, Rgb};

/// A running world and what draws it.
struct Stage {
    world: World,
    extractor: Extractor,
    scene: Scene,
    time_s: f64,
}

impl Stage {
    /// Writes the world into a file, so that it finds the slide beside it. The renderer forgets the maps of worlds before.
    fn new(name: &str, script: &str, renderer: &mut Renderer) -> Stage {
        renderer.render(&Scene::default(), &[]).expect("nothing is drawn");
        let path = folder().join(format!("{name}.rhai"));
        std::fs::write(&path, format!("{BEFORE}{script}")).expect("a world can be written");
        let world = World::load_file(&path).unwrap_or_else(|e| panic!("{name}: {e}"));
        let extractor = Extractor::new().with_asset_root(folder());
        Stage { world, extractor, scene: Scene::default(), time_s: 0.0 }
    }

    /// Draws the next frame; there must be nothing to complain of. Gives the number of maps that it drew, too.
    fn frame(&mut self, name: &str, renderer: &mut Renderer) -> (RgbaPixels, u32) {
        for light in self.extractor.maps_drawn_once() {
            self.world.graph_mut().set_named(light, "shadow_update", "none").expect("lights have this field");
        }
        self.world.step(self.time_s);
        self.time_s += 1.0 / 60.0;
        self.extractor.update(self.world.graph(), &mut self.scene);
        let problems = self.extractor.problems();
        assert!(problems.is_empty(), "{name}: {problems:?}");
        assert!(self.world.problems().is_empty(), "{name}");
        let wanted = Wanted { view: None, size: [SIDE; 2], windows: &WindowSizes::new() };
        let found = Rig::new().pictures(self.world.graph(), self.extractor.viewpoints(), &Aabb::EMPTY, &wanted);
        let pictures = found.expect("there is a viewpoint").pictures;
        let stats = renderer.render(&self.scene, &pictures).expect("the frame is drawn");
        assert_eq!(renderer.problems(), [""; 0], "{name}");
        let picture = renderer.read_back(0).expect("there is a picture").remove(0);
        let file = folder().join(format!("{name}.png"));
        image::save_buffer(file, &picture.rgba, SIDE, SIDE, image::ColorType::Rgba8).expect("a picture can be written");
        (picture, stats.map_redraws)
    }
}

/// Where worlds and pictures go; the slide is red, green, blue and black from its upper left corner on.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let make = || {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("x3d_shadows");
        std::fs::create_dir_all(&folder).expect("a folder can be made");
        let texels = [255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 0, 0, 0, 255];
        image::save_buffer(folder.join("slide.png"), &texels, 2, 2, image::ColorType::Rgba8).expect("a picture can be written");
        folder
    };
    FOLDER.get_or_init(make)
}

/// Linear RGB of the floor at (x, z), metres.
fn at(picture: &RgbaPixels, [x, z]: [f32; 2]) -> [f32; 3] {
    let pixel = |metres: f32| ((metres / (14.0 * 0.5f32.tan()) * 0.5 + 0.5) * SIDE as f32) as u32;
    let linear = |byte: u8| {
        let v = f32::from(byte) / 255.0;
        if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    };
    let [r, g, b, _] = picture.pixel(pixel(x), pixel(z));
    [r, g, b].map(linear)
}

/// What is wrong with a picture.
fn wrong(name: &str, picture: &RgbaPixels, places: &[([f32; 2], Looks)]) -> Vec<String> {
    let wrong = |(place, looks): &([f32; 2], Looks)| {
        let found = at(picture, *place);
        let is_right = match *looks {
            Lit => found.iter().all(|v| *v > 0.15),
            Dark => found.iter().all(|v| *v < 0.01),
            Rgb(r, g, b) => found.iter().zip([r, g, b]).all(|(v, wanted)| (v - wanted).abs() < 0.03),
        };
        (!is_right).then(|| format!("{name}, {place:?}: {found:.3?} is not {looks:?}"))
    };
    places.iter().filter_map(wrong).collect()
}

fn assert_right(wrong: &[String]) {
    assert!(wrong.is_empty(), "\n{}\nsee the pictures in {}", wrong.join("\n"), folder().display());
}

/// The middle of the shadow, and beside it.
const SHADOW: &[([f32; 2], Looks)] = &[([0.0, 0.0], Dark), ([3.5, 0.0], Lit), ([0.0, 3.0], Lit)];
const NO_SHADOW: &[([f32; 2], Looks)] = &[([0.0, 0.0], Lit), ([3.5, 0.0], Lit), ([0.0, 3.0], Lit)];
const NO_LIGHT: &[([f32; 2], Looks)] = &[([0.0, 0.0], Dark), ([3.5, 0.0], Dark), ([0.0, 3.0], Dark)];

/// Name, world, places.
type Row = (&'static str, &'static str, &'static [([f32; 2], Looks)]);

fn draw(rows: &[Row]) {
    let gpu = Gpu::new(None).expect("there is a device");
    let mut renderer = Renderer::new(&gpu).expect("the renderer works");
    let found = rows.iter().flat_map(|(name, script, places)| {
        let (picture, _) = Stage::new(name, script, &mut renderer).frame(name, &mut renderer);
        wrong(name, &picture, places)
    });
    assert_right(&found.collect::<Vec<_>>());
}

/// A sun over the usual floor, with fields of the row.
macro_rules! sun {
    ($fields:literal) => {
        concat!(
            "world.add(floor_of(matt)); world.add(caster); world.add(make(\"DirectionalLight\", #{ direction: slanted, ",
            $fields,
            " }));"
        )
    };
}

/// A sun straight above without anything that it meets on its way to the floor but a pebble in a corner.
macro_rules! noon {
    ($fields:literal) => {
        concat!(
            "world.add(floor_of(matt)); world.add(transform(#{ translation: vec3(5.5, 0.1, 5.5) }, shape(cuboid(vec3(0.1, 0.1, 0.1)), matt)));",
            "world.add(make(\"DirectionalLight\", #{ direction: down, shadows: true, ",
            $fields,
            " }));"
        )
    };
}

#[test]
fn lights_project_as_their_fields_say() {
    draw(&[
        ("fitted", sun!("shadows: true"), SHADOW),
        // Along the light the square is 2.83 m from (-4, 4, 0), the middle of the floor 5.66 m.
        ("near_before_it", sun!("shadows: true, projectionLocation: vec3(-4, 4, 0), projectionNear: 2.0"), SHADOW),
        ("near_behind_it", sun!("shadows: true, projectionLocation: vec3(-4, 4, 0), projectionNear: 3.5"), NO_SHADOW),
        (
            "far_behind_the_floor",
            sun!("shadows: true, projectionLocation: vec3(-4, 4, 0), projectionNear: 1.0, projectionFar: 12.0"),
            SHADOW,
        ),
        ("far_before_the_floor", sun!("shadows: true, projectionLocation: vec3(-4, 4, 0), projectionFar: 4.0"), NO_SHADOW),
        (
            "rectangle",
            noon!("projectionRectangle: vec4(-1, -2, 3, 4), up: vec3(0, 0, -1)"),
            &[([2.5, 0.0], Lit), ([-2.0, 0.0], Dark), ([4.0, 0.0], Dark), ([0.0, -3.5], Lit), ([0.0, 3.0], Dark)],
        ),
        (
            "up_across",
            noon!("projectionRectangle: vec4(-3, -1, 3, 1), up: vec3(0, 0, -1)"),
            &[([2.5, 0.0], Lit), ([0.0, 2.5], Dark)],
        ),
        (
            "up_along",
            noon!("projectionRectangle: vec4(-3, -1, 3, 1), up: vec3(1, 0, 0)"),
            &[([2.5, 0.0], Dark), ([0.0, 2.5], Lit)],
        ),
        (
            "location",
            noon!("projectionRectangle: vec4(-1, -1, 1, 1), projectionLocation: vec3(3, 5, 0)"),
            &[([3.0, 0.0], Lit), ([0.0, 0.0], Dark), ([-3.0, 0.0], Dark)],
        ),
        (
            "outside_is_lit",
            noon!("shadow_frustum: vec4(-1, 1, -1, 1), shadow_outside: \"lit\""),
            &[([0.0, 0.0], Lit), ([3.0, 0.0], Lit)],
        ),
        (
            "outside_is_dark",
            noon!("shadow_frustum: vec4(-1, 1, -1, 1), shadow_outside: \"shadow\""),
            &[([0.0, 0.0], Lit), ([3.0, 0.0], Dark)],
        ),
        // From 6 m above the shadow reaches from -4.5 m to -1.5 m, a map of 0.6 rad from -1.9 m to 1.9 m.
        (
            "whole_cone",
            r#"world.add(floor_of(matt)); world.add(caster); world.add(make("SpotLight", #{ location: vec3(0, 6, 0), direction: down, shadows: true }));"#,
            &[([-4.0, 0.0], Dark), ([1.0, 0.0], Lit)],
        ),
        (
            "angle",
            r#"world.add(floor_of(matt)); world.add(caster); world.add(make("SpotLight", #{ location: vec3(0, 6, 0), direction: down, shadows: true, projectionAngle: 0.6 }));"#,
            &[([-4.0, 0.0], Lit), ([1.0, 0.0], Lit)],
        ),
        // The point light stands where the sun's ray to the middle of the floor does.
        (
            "point",
            r#"world.add(floor_of(matt)); world.add(caster); world.add(make("PointLight", #{ location: vec3(-4, 4, 0), shadows: true }));"#,
            SHADOW,
        ),
        (
            "point_far",
            r#"world.add(floor_of(matt)); world.add(caster); world.add(make("PointLight", #{ location: vec3(-4, 4, 0), shadows: true, projectionNear: 3.5 }));"#,
            NO_SHADOW,
        ),
    ]);
}

#[test]
fn lights_and_shapes_say_who_casts_on_whom() {
    draw(&[
        ("shadows_true", sun!("shadows: true"), SHADOW),
        ("shadows_false", sun!("shadows: false"), NO_SHADOW),
        // Half of 0.8 at 45 degrees.
        (
            "half_intensity",
            sun!("shadows: true, shadowIntensity: 0.5"),
            &[([0.0, 0.0], Rgb(0.283, 0.283, 0.283)), ([3.5, 0.0], Rgb(0.566, 0.566, 0.566))],
        ),
        ("cast_shadow_false", concat!("square.castShadow = false;", sun!("shadows: true")), NO_SHADOW),
        (
            "shadow_caster_false",
            concat!("square.appearance = appearance(#{ material: matt, shadowCaster: false });", sun!("shadows: true")),
            NO_SHADOW,
        ),
        (
            "receives_listed",
            r#"let sun = make("DirectionalLight", #{ direction: slanted, ambientIntensity: 0.2 }); world.add(sun); world.add(caster);
               world.add(floor_of(appearance(#{ material: matt, receiveShadows: [sun] })));"#,
            SHADOW,
        ),
        (
            "receives_another",
            r#"let sun = make("DirectionalLight", #{ direction: slanted, shadows: true }); world.add(sun); world.add(caster);
               let other = make("DirectionalLight", #{ direction: slanted, intensity: 0.0 }); world.add(other);
               world.add(floor_of(appearance(#{ material: matt, receiveShadows: [other] })));"#,
            NO_SHADOW,
        ),
        // Empty until it is asked for.
        ("default_map_none", sun!(r#"shadows: true, defaultShadowMap: make("GeneratedShadowMap", #{ size: 256 })"#), NO_SHADOW),
        (
            "default_map_always",
            sun!(r#"shadows: true, defaultShadowMap: make("GeneratedShadowMap", #{ update: "ALWAYS", size: 256 })"#),
            SHADOW,
        ),
    ]);
}

#[test]
fn maps_and_slides_are_textures() {
    draw(&[
        (
            "lequal",
            r#"let sun = make("DirectionalLight", #{ direction: slanted }); let map = make("GeneratedShadowMap", #{ light: sun, update: "ALWAYS" });
               world.add(caster); world.add(floor_of(appearance(#{ material: white, texture: map })));"#,
            SHADOW,
        ),
        (
            "gequal",
            r#"let sun = make("DirectionalLight", #{ direction: slanted });
               let map = make("GeneratedShadowMap", #{ light: sun, update: "ALWAYS", compareMode: "COMPARE_R_GEQUAL" });
               world.add(caster); world.add(floor_of(appearance(#{ material: white, texture: map })));"#,
            &[([0.0, 0.0], Lit), ([3.5, 0.0], Dark), ([0.0, 3.0], Dark)],
        ),
        // The map reaches from x = -10 m to 2 m and lies over the floor as any picture would.
        (
            "depth",
            r#"let sun = make("DirectionalLight", #{ direction: down, up: vec3(0, 0, -1), projectionLocation: vec3(-4, 10, 0),
                   projectionRectangle: vec4(-6, -6, 6, 6), projectionNear: 5.0, projectionFar: 15.0 });
               let map = make("GeneratedShadowMap", #{ light: sun, update: "ALWAYS", compareMode: "NONE" });
               world.add(caster); world.add(floor_of(appearance(#{ material: white, texture: map })));"#,
            &[([2.0, 0.0], Rgb(0.3, 0.3, 0.3)), ([4.0, 0.0], Rgb(0.5, 0.5, 0.5)), ([-5.0, 0.0], Rgb(1.0, 1.0, 1.0))],
        ),
        // Two suns, whose shadows of the square lie around the origin and around (-2, 2).
        (
            "two_maps",
            r#"let maps = [slanted, vec3(0, -1, 1)].map(|d| make("GeneratedShadowMap", #{ light: make("DirectionalLight", #{ direction: d }), update: "ALWAYS" }));
               world.add(caster); world.add(floor_of(appearance(#{ material: white, texture: maps })));"#,
            &[([0.0, 0.0], Dark), ([-2.0, 2.2], Dark), ([3.5, 0.0], Lit), ([0.0, 3.5], Lit)],
        ),
        (
            "picture_and_map",
            r#"let sun = make("DirectionalLight", #{ direction: slanted }); let map = make("GeneratedShadowMap", #{ light: sun, update: "ALWAYS" });
               let slide = texture(#{ url: "slide.png", filter: "nearest" });
               world.add(caster); world.add(floor_of(appearance(#{ material: white, texture: make("MultiTexture", #{ texture: [slide, map], mode: ["REPLACE", "MODULATE"] }) })));"#,
            &[
                ([0.5, -0.5], Dark),
                ([3.0, -3.0], Rgb(0.0, 1.0, 0.0)),
                ([-3.0, -3.0], Rgb(1.0, 0.0, 0.0)),
                ([-3.0, 3.0], Rgb(0.0, 0.0, 1.0)),
            ],
        ),
        (
            "slide_of_a_spot",
            r#"let spot = make("SpotLight", #{ location: vec3(0, 6, 0), direction: down, up: vec3(0, 0, -1), projectionAngle: 1.2 });
               let slide = texture(#{ url: "slide.png", filter: "nearest", wrap_s: "border", wrap_t: "border" });
               world.add(floor_of(appearance(#{ material: white, texture: slide, texCoord: make("ProjectedTextureCoordinate", #{ projector: spot }) })));"#,
            SLIDE,
        ),
        (
            "slide_of_a_sun",
            r#"let sun = make("DirectionalLight", #{ direction: down, up: vec3(0, 0, -1), projectionLocation: vec3(0, 5, 0), projectionRectangle: vec4(-4, -4, 4, 4) });
               let slide = texture(#{ url: "slide.png", filter: "nearest", wrap_s: "border", wrap_t: "border" });
               world.add(floor_of(appearance(#{ material: white, texture: slide, texCoord: make("ProjectedTextureCoordinate", #{ projector: sun }) })));"#,
            SLIDE,
        ),
        (
            "slide_of_a_viewpoint",
            r#"let eye = make("Viewpoint", #{ position: vec3(0, 6, 0), orientation: axis_angle(vec3(1, 0, 0), -PI() / 2.0), fieldOfView: 1.2 });
               let slide = texture(#{ url: "slide.png", filter: "nearest", wrap_s: "border", wrap_t: "border" });
               world.add(floor_of(appearance(#{ material: white, texture: slide, texCoord: make("ProjectedTextureCoordinate", #{ projector: eye }) })));"#,
            SLIDE,
        ),
        (
            "light_of_a_map_is_dark",
            r#"let sun = make("DirectionalLight", #{ direction: slanted, ambientIntensity: 1.0 }); let map = make("GeneratedShadowMap", #{ light: sun, update: "ALWAYS" });
               world.add(caster); world.add(floor_of(appearance(#{ material: matt, texture: map })));"#,
            NO_LIGHT,
        ),
        (
            "light_of_a_projector_is_dark",
            r#"let spot = make("SpotLight", #{ location: vec3(0, 6, 0), direction: down, ambientIntensity: 1.0 }); let slide = texture(#{ url: "slide.png" });
               world.add(floor_of(appearance(#{ material: matt, texture: slide, texCoord: make("ProjectedTextureCoordinate", #{ projector: spot }) })));"#,
            NO_LIGHT,
        ),
        // It shines where it stands in the world as well.
        (
            "light_of_a_map_in_the_world",
            r#"let sun = make("DirectionalLight", #{ direction: slanted }); world.add(sun); let map = make("GeneratedShadowMap", #{ light: sun, update: "ALWAYS" });
               world.add(caster); world.add(floor_of(appearance(#{ material: matt, texture: map })));"#,
            SHADOW,
        ),
    ]);
}

/// Red, green, blue and black around the origin, white beyond 4 m.
const SLIDE: &[([f32; 2], Looks)] = &[
    ([-2.0, -2.0], Rgb(1.0, 0.0, 0.0)),
    ([2.0, -2.0], Rgb(0.0, 1.0, 0.0)),
    ([-2.0, 2.0], Rgb(0.0, 0.0, 1.0)),
    ([2.0, 2.0], Dark),
    ([5.0, 0.0], Rgb(1.0, 1.0, 1.0)),
    ([0.0, -5.0], Rgb(1.0, 1.0, 1.0)),
];

/// Both a GeneratedShadowMap's `update` and a light's own `shadow_update` fall back to NONE after the frame that was asked for.
#[test]
fn a_map_drawn_once_rests_afterwards() {
    let gpu = Gpu::new(None).expect("there is a device");
    let mut renderer = Renderer::new(&gpu).expect("the renderer works");
    let of_light = r#"let map = make("DirectionalLight", #{ direction: slanted, shadows: true, shadow_update: "none" }); world.add(map);
        world.add(floor_of(matt)); world.add(caster);"#;
    let of_node = r#"let sun = make("DirectionalLight", #{ direction: slanted }); let map = make("GeneratedShadowMap", #{ light: sun });
        world.add(floor_of(appearance(#{ material: white, texture: map }))); world.add(caster);"#;
    // A light's own map starts drawn, one of a GeneratedShadowMap empty until it is asked for.
    let rows = [("once_of_a_light", of_light, "shadow_update", Dark), ("once_of_a_map", of_node, "update", Lit)];
    for (name, script, field, first) in rows {
        let mut stage = Stage::new(name, script, &mut renderer);
        assert_right(&wrong(name, &stage.frame(name, &mut renderer).0, &[([0.0, 0.0], first)]));
        // What is done before a frame, whether that draws the map, and the floor's middle.
        let ask = format!("map.{field} = \"NEXT_FRAME_ONLY\"");
        let away = "caster.translation = vec3(-2, 2, 4)".to_owned();
        let back = "caster.translation = vec3(-2, 2, 0)".to_owned();
        for (step, (done, is_drawn, middle)) in
            [(ask.clone(), true, Dark), (away, false, Dark), ("0".to_owned(), false, Dark), (ask, true, Lit), (back, false, Lit)]
                .into_iter()
                .enumerate()
        {
            stage.world.console(&done).unwrap_or_else(|p| panic!("{name}: {p}"));
            let name = format!("{name}_{step}");
            let (picture, redraws) = stage.frame(&name, &mut renderer);
            assert_eq!(redraws, u32::from(is_drawn), "{name}");
            assert_right(&wrong(&name, &picture, &[([0.0, 0.0], middle)]));
        }
        let _ = stage.frame(name, &mut renderer);
        assert_eq!(stage.world.console(&format!("map.{field}")).as_deref(), Ok("none"), "{name}");
    }
}
