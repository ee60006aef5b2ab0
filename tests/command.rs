//! The command line: what it prints, and what it says of bad input. One bad thing costs no more than itself.

use crate::support::{root, umbriel, umbriel_told};
use std::path::{Path, PathBuf};

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    folder
}

/// Draws a world from a text; gives the run and the picture's path.
fn draw(name: &str, script: &str, args: &[&str]) -> (crate::support::Run, PathBuf) {
    let world = folder("command").join(format!("{name}.rhai"));
    let out = world.with_extension("png");
    let _ = std::fs::remove_file(&out);
    std::fs::write(&world, script).expect("a world can be written");
    let [path, picture] = [&world, &out].map(|p| p.to_str().expect("paths are text"));
    let run = umbriel(&[&["run", path, "--headless", "--size", "96x64", "--out", picture], args].concat());
    (run, out)
}

/// Red everywhere: something that must survive.
const BACKDROP: &str = r#"
world.add(transform(#{ translation: vec3(0, 0, -5) }, [shape(make("Box", #{ size: vec3(40, 40, 0.1) }), make("UnlitMaterial", #{ emissive_color: color(1, 0, 0) }))]));
world.add(make("Viewpoint", #{ position: vec3(0, 0, 5) }));
"#;

fn corner_is_red(picture: &Path) -> bool {
    let picture = image::open(picture).expect("the picture was written").to_rgb8();
    picture.get_pixel(2, 2).0 == [255, 0, 0]
}

#[test]
fn a_mistake_costs_itself_and_says_where_it_is() {
    let truncated = folder("command").join("truncated.glb");
    std::fs::write(&truncated, b"glTF\x02\0\0\0\xff\0\0\0").expect("a file can be written");
    // Name, line of the world, what the message must contain. The rest of the world is drawn.
    let rows: [(&str, &str, &[&str]); 40] = [
        (
            "negative_soft_range",
            r#"world.add(make("DirectionalLight", #{ name: "sun", shadows: "volume", soft: "range", soft_range: -1.0 }));"#,
            &["sun", "soft_range"],
        ),
        (
            "three_samples",
            r#"world.add(make("Environment", #{ name: "air", samples: 3 }));"#,
            &["three_samples.rhai:4:11", "air", "samples: 3 is neither 1 nor 4"],
        ),
        ("missing_model", r#"world.add(load("nowhere.glb"));"#, &["nowhere.glb", "missing_model.rhai:4"]),
        ("truncated_model", r#"world.add(load("truncated.glb"));"#, &["truncated.glb", "truncated_model.rhai:4"]),
        ("endless_handler", r#"on_frame(|t, dt| { loop {} });"#, &["endless_handler.rhai:4", "switched off"]),
        ("failing_handler", r#"on_frame(|t, dt| { let x = [1][5]; });"#, &["failing_handler.rhai:4", "switched off"]),
        (
            "nan_transform",
            r#"world.add(transform(#{ name: "lost", translation: vec3(0.0/0.0, 0, 0) }, [shape(make("Box"))]));"#,
            &["nan_transform.rhai:4:11", "lost"],
        ),
        ("empty_mesh", r#"let m = make("Mesh"); m.name = "nothing"; world.add(shape(m));"#, &["empty_mesh.rhai:4:9", "nothing"]),
        (
            "index_out_of_range",
            r#"let m = make("Mesh", #{ position: [vec3(0,0,0), vec3(1,0,0), vec3(0,1,0)], index: [0, 1, 7] }); m.name = "torn"; world.add(shape(m));"#,
            &["index_out_of_range.rhai:4", "torn", "7"],
        ),
        (
            "map_of_size_0",
            r#"world.add(make("DirectionalLight", #{ name: "sun", shadows: "map", shadow_size: 0 }));"#,
            &["map_of_size_0.rhai:4:11", "sun", "shadow_size"],
        ),
        (
            "near_behind_far",
            r#"world.add(make("SpotLight", #{ name: "spot", shadows: "map", shadow_near_far: vec2(5.0, 1.0) }));"#,
            &["near_behind_far.rhai:4", "spot", "shadow_near_far"],
        ),
        (
            "empty_rectangle",
            r#"world.add(make("SpotLight", #{ name: "spot", shadows: "map", shadow_frustum: vec4(0.5, 0.5, -1.0, 1.0) }));"#,
            &["empty_rectangle.rhai:4:11", "spot", "shadow_frustum", "makes no sense here"],
        ),
        (
            "bias_that_is_no_number",
            r#"world.add(make("SpotLight", #{ name: "spot", shadows: "map", displace_offset: 0.0/0.0 }));"#,
            &["bias_that_is_no_number.rhai:4:11", "spot", "displace_offset", "NaN"],
        ),
        (
            "no_memory",
            r#"world.add(make("Environment", #{ name: "air", shadow_memory: 0 }));"#,
            &["no_memory.rhai:4:11", "air", "shadow_memory", "1024 is used"],
        ),
        (
            "map_of_size_100000",
            r#"world.add(make("DirectionalLight", #{ name: "sun", shadows: "map", shadow_size: 100000 }));"#,
            &["sun", "100000", "using 16384"],
        ),
        (
            "projection_ends_before_it_begins",
            r#"world.add(make("SpotLight", #{ name: "spot", projectionNear: 5.0, projectionFar: 1.0 }));"#,
            &["projection_ends_before_it_begins.rhai:4:11", "'spot', projection_far: 1.0 is not beyond projection_near, 5.0"],
        ),
        (
            "up_along_the_light",
            r#"world.add(make("SpotLight", #{ name: "spot", direction: vec3(0, -1, 0), up: vec3(0, 2, 0) }));"#,
            &["up_along_the_light.rhai:4:11", "'spot', up", "makes no sense here"],
        ),
        (
            "rectangle_of_no_width",
            r#"world.add(make("DirectionalLight", #{ name: "sun", projectionRectangle: vec4(1, 0, 1, 2) }));"#,
            &["rectangle_of_no_width.rhai:4:11", "'sun', projection_rectangle", "makes no sense here"],
        ),
        (
            "projector_without_direction",
            r#"let c = make("ProjectedTextureCoordinate", #{ name: "slide", projector: make("PointLight") }); let m = make("GeneratedShadowMap"); world.add(shape(make("Box"), make("Appearance", #{ texture: m, texCoord: c })));"#,
            &["projector_without_direction.rhai:4:9", "'slide', projector: a PointLight has no direction to project along"],
        ),
        (
            "near_is_far",
            r#"world.add(make("SpotLight", #{ name: "spot", shadows: "map", shadow_near_far: vec2(2.0, 2.0) }));"#,
            &["near_is_far.rhai:4:11", "spot", "shadow_near_far", "makes no sense here"],
        ),
        (
            "location_that_is_no_number",
            r#"world.add(make("PointLight", #{ name: "lamp", location: vec3(0, 0.0/0.0, 0), shadows: "map" }));"#,
            &["location_that_is_no_number.rhai:4:11", "'lamp', location", "NaN"],
        ),
        (
            "projection_from_nowhere",
            r#"world.add(make("DirectionalLight", #{ name: "sun", projectionLocation: vec3(0, 0.0/0.0, 0) }));"#,
            &["projection_from_nowhere.rhai:4:11", "'sun', projection_location", "NaN"],
        ),
        (
            "sun_from_nowhere",
            r#"world.add(make("LightSource", #{ name: "sun", position: vec4(0, 0.0/0.0, 0, 0) }));"#,
            &["sun_from_nowhere.rhai:4:11", "'sun', position", "NaN"],
        ),
        (
            "performer_to_nowhere",
            r#"world.add(make("LightSource", #{ name: "spot", position: vec4(0, 1, 0, 1), spot_dir: vec3(0, 0, 0) }));"#,
            &["performer_to_nowhere.rhai:4:11", "'spot', spot_dir", "makes no sense here"],
        ),
        (
            "missing_texture",
            r#"world.add(shape(make("Box"), make("PhysicalMaterial", #{ base_texture: make("ImageTexture", #{ url: "no.png" }) })));"#,
            &["missing_texture.rhai:4", "no.png"],
        ),
        (
            "no_such_day",
            r#"let sky = make("Ephemeris", #{ date: "2026-02-30" });"#,
            &["no_such_day.rhai:4", "there is no such day", "date", "Ephemeris"],
        ),
        (
            "missing_shader",
            r#"world.add(shape(make("Box"), appearance(#{ shader: shader("no.wgsl", #{}) })));"#,
            &["missing_shader.rhai:4", "no.wgsl", "url"],
        ),
        (
            "wrong_shader",
            r#"world.add(shape(make("Box"), appearance(#{ shader: make("FragmentShader", #{ name: "toon", source: "\nfn shade() {}" }) })));"#,
            &[
                "FragmentShader 'toon', source:2:1: it must be `fn shade(s: Surface, light: LightSample) -> vec3<f32>`",
                "vec3<f32>`; 'unnamed Shape' (",
                "wrong_shader.rhai:4:11) is shown without it",
            ],
        ),
        (
            "wrong_shader_of_many",
            r#"let look = appearance(#{ shader: make("FragmentShader", #{ name: "toon", source: "fn shade() {}" }) }); for i in 0..5 { let s = shape(make("Box"), look); s.name = `ball${i}`; world.add(s); }"#,
            &["'ball0' (", "wrong_shader_of_many.rhai:4:129), 'ball1' (", "'ball2' (", "and 2 more are shown without it"],
        ),
        (
            "endless_number",
            r#"let s = make("FragmentShader", #{ name: "toon", source: "fn surface(s: Surface) -> Surface { return s; }" }); s.add_field("bands", 1.0 / 0.0); world.add(shape(make("Box"), appearance(#{ shader: s })));"#,
            &["endless_number.rhai:4", "toon", "`bands` is not finite"],
        ),
        (
            "caster_without_triangles",
            r#"world.add(shape(make("Mesh", #{ name: "dust", position: [vec3(0,1,0), vec3(1,1,0)], index: [0,1], topology: "lines" }))); world.add(make("DirectionalLight", #{ shadows: "volume" }));"#,
            &["caster_without_triangles.rhai:4", "mesh 'dust' casts no shadow volume: none of its 0 triangles", "`cast_shadow`"],
        ),
        (
            "caster_at_one_place",
            r#"let p = vec3(1, 1, 0); world.add(shape(make("Mesh", #{ name: "dot", position: [p, p, p, p], index: [0,1,2, 0,2,3] }))); world.add(make("DirectionalLight", #{ shadows: "volume" }));"#,
            &[
                "caster_at_one_place.rhai:4",
                "mesh 'dot' casts no shadow volume: none of its 2 triangles has three places of its own",
            ],
        ),
        (
            "caster_with_an_index_too_many",
            r#"world.add(shape(make("Mesh", #{ name: "torn", position: [vec3(0,1,0), vec3(1,1,0), vec3(1,1,1)], index: [0,1,3] }))); world.add(make("DirectionalLight", #{ shadows: "volume" }));"#,
            &["caster_with_an_index_too_many.rhai:4", "torn", "index 3 at place 2 is outside of its 3 vertices"],
        ),
        (
            "light_inside_of_its_caster",
            r#"let globe = shape(make("Sphere", #{ radius: 0.3 })); globe.name = "globe"; world.add(globe); world.add(make("PointLight", #{ name: "lamp", location: vec3(0, 0.1, 0), shadows: "volume" }));"#,
            &["light_inside_of_its_caster.rhai:4:", "light 'lamp' is inside of 'globe', which is closed", "`cast_shadow`"],
        ),
        (
            "vertex_that_is_no_number",
            r#"world.add(shape(make("Mesh", #{ name: "torn", position: [vec3(0,1,0), vec3(1,1,0), vec3(0.0/0.0,1,1)] }))); world.add(make("DirectionalLight", #{ shadows: "volume" }));"#,
            &["vertex_that_is_no_number.rhai:4", "Mesh 'torn', geometry", "position 2 is not finite"],
        ),
        (
            "film_that_is_none",
            r#"let sun = make("DirectionalLight"); world.add(sun); world.add(make("StencilShadow", #{ name: "group", light: sun, mode: "modulative", caster: [shape(make("Box"))], shadow_quad: make("Group", #{ name: "quad" }) }));"#,
            &["film_that_is_none.rhai:4", "StencilShadow 'group', shadow_quad: 'quad' is no ShadowQuad; the film is black"],
        ),
        (
            "light_that_is_none",
            r#"world.add(make("DirectionalLight")); world.add(make("StencilShadow", #{ name: "group", light: make("Group", #{ name: "lamp" }), caster: [shape(make("Box"))] }));"#,
            &["light_that_is_none.rhai:4", "StencilShadow 'group', light: 'lamp' is no light of this world; no shadow"],
        ),
        (
            "volume_of_negative_length",
            r#"world.add(make("DirectionalLight", #{ name: "sun", shadows: "volume", volume_length: -2.0 }));"#,
            &["volume_of_negative_length.rhai:4:11", "DirectionalLight 'sun', volume_length: -2.0 makes no sense here"],
        ),
        (
            "lightless_stencil",
            r#"world.add(make("StencilShadow", #{ name: "group", caster: [shape(make("Box"))] }));"#,
            &["lightless_stencil.rhai:4", "group", "light"],
        ),
        (
            "flat_screen",
            r#"make("Display", #{ name: "wall", screens: [make("Screen", #{ name: "flat", lower_left: vec3(0,0,0), lower_right: vec3(0,0,0), upper_left: vec3(0,1,0) })], user: make("User") });"#,
            &["flat_screen.rhai:4:44", "flat", "no area"],
        ),
    ];
    for (name, line, expected) in rows {
        let (run, picture) = draw(name, &format!("{BACKDROP}{line}\n"), &[]);
        assert!(!run.ok, "{name}: a problem must be seen in the exit status\n{}{}", run.stdout, run.stderr);
        for part in expected {
            assert!(run.stderr.contains(part), "{name}: '{part}' is not in\n{}", run.stderr);
        }
        assert!(corner_is_red(&picture), "{name}: the rest of the world is gone");
        println!("{name}: {}", run.stderr.trim());
    }
}

#[test]
fn a_wrong_world_ends_with_a_message() {
    let rows: [(&str, &str, &[&str]); 10] = [
        (
            "latitude_100",
            "let a = 1;\nlet sky = make(\"Ephemeris\", #{ latitude: 100.0 });",
            &["latitude_100.rhai:2", "latitude", "Ephemeris", "100"],
        ),
        ("unknown_node", "let a = 1;\nlet b = make(\"SpotLihgt\");", &["unknown_node.rhai:2", "SpotLihgt", "SpotLight"]),
        (
            "unknown_field",
            "let b = make(\"SpotLight\");\n\nb.shadwos = \"map\";",
            &["unknown_field.rhai:3", "shadwos", "shadows", "SpotLight"],
        ),
        (
            "wrong_type",
            "let b = make(\"SpotLight\");\nb.intensity = \"bright\";",
            &["wrong_type.rhai:2", "intensity", "SpotLight"],
        ),
        (
            "film_too_dense",
            "let q = make(\"ShadowQuad\", #{ name: \"film\" });\nq.alpha = 1.5;",
            &["film_too_dense.rhai:2:", "`film.alpha` takes values from 0 to 1; 1.5 is outside", "ShadowQuad"],
        ),
        (
            "negative_error",
            "let c = make(\"ReducedCaster\", #{ name: \"few\" });\nc.max_error = -1.0;",
            &["negative_error.rhai:2:", "`few.max_error` takes values from 0 to inf; -1 is outside"],
        ),
        ("wrong_choice", "let b = make(\"SpotLight\");\nb.shadows = \"volumes\";", &["wrong_choice.rhai:2", "volumes", "volume"]),
        ("syntax", "let a = ;", &["syntax.rhai:1"]),
        ("endless", "loop {}", &["endless.rhai:1"]),
        (
            "strong_loop",
            "let a = make(\"Sum\"); let b = make(\"Sum\");\nroute(a, \"value\", b, \"a\");\nroute(b, \"value\", a, \"a\");",
            &["strong_loop.rhai:3", "weak"],
        ),
    ];
    for (name, script, expected) in rows {
        let (run, _) = draw(name, script, &[]);
        assert!(!run.ok, "{name}");
        for part in expected {
            assert!(run.stderr.contains(part), "{name}: '{part}' is not in\n{}", run.stderr);
        }
        println!("{name}: {}", run.stderr.trim());
    }
}

#[test]
fn wrong_words_on_the_command_line() {
    let rows: [(&[&str], &str); 12] = [
        (&["run", "nowhere.rhai", "--headless"], "nowhere.rhai"),
        (&["run", "nowhere.glb", "--headless"], "nowhere.glb"),
        (&["run", "a.txt", "--headless"], ".rhai"),
        (&["run", "a.rhai", "--headless", "--size", "0x10"], "0x10"),
        (&["run", "a.rhai", "--headless", "--frames", "0"], "--frames"),
        (&["run", "a.rhai", "--headless", "--time", "NaN"], "--time"),
        (&["shadow-error", "--scene", "nowhere.json"], "nowhere.json"),
        (&["shadow-error", "--models", "nowhere"], "nowhere: No such file or directory"),
        (&["shadow-error", "--models", "docs"], "docs: there are no models (.gltf, .glb) in it"),
        (&["shadow-error", "a.rhai", "--eyes", "0"], "--eyes"),
        (&["shadow-map", "nowhere.rhai"], "nowhere.rhai"),
        (&["nodes", "Transfrom"], "Transform"),
    ];
    for (args, expected) in rows {
        let run = umbriel(args);
        assert!(!run.ok && run.stderr.contains(expected), "{args:?}: {}", run.stderr);
    }
}

#[test]
fn an_unknown_view_names_the_views_that_there_are() {
    let (run, _) = draw("views", "world.add(make(\"Viewpoint\", #{ name: \"tower\" }));", &["--view", "towre"]);
    assert!(!run.ok && run.stderr.contains("tower"), "{}", run.stderr);
}

#[test]
fn a_world_is_opened_from_its_own_folder() {
    let folder = folder("bare");
    std::fs::copy(root().join("scripts/worlds/models/lamp.glb"), folder.join("lamp.glb")).expect("a model can be copied");
    std::fs::write(folder.join("bare.rhai"), "world.add(load(\"lamp.glb\"));").expect("a world can be written");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_umbriel"))
        .args(["run", "bare.rhai", "--headless", "--size", "32x32"])
        .current_dir(&folder)
        .output()
        .expect("the command can be started");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn frames_are_numbered_and_follow_the_clock() {
    let script = format!(
        "{BACKDROP}\nlet c = make(\"TimeSensor\", #{{ cycle_interval: 2.0, loop: true }});\n\
         let p = make(\"PositionInterpolator\", #{{ key: [0.0, 1.0], key_value: [vec3(-4, 0, 0), vec3(4, 0, 0)] }});\n\
         let t = transform(#{{}}, [shape(make(\"Box\"), make(\"UnlitMaterial\", #{{ emissive_color: color(1, 1, 1) }}))]);\n\
         world.add(t);\nroute(c, \"fraction_changed\", p, \"set_fraction\");\nroute(p, \"value_changed\", t, \"translation\");\n"
    );
    let (run, out) = draw("frames", &script, &["--frames", "3", "--fps", "2", "--time", "0.5"]);
    assert!(run.ok, "{}", run.stderr);
    let place = |frame: u32| {
        let path = out.with_file_name(format!("frames.{frame:04}.png"));
        let picture = image::open(path).expect("the frame was written").to_rgb8();
        let white: Vec<f32> = picture.enumerate_pixels().filter(|(_, _, p)| p.0[1] > 128).map(|(x, ..)| x as f32).collect();
        white.iter().sum::<f32>() / white.len() as f32
    };
    let places = [0, 1, 2].map(place);
    let steps = [places[1] - places[0], places[2] - places[1]];
    assert!(steps.iter().all(|s| *s > 5.0) && (steps[0] - steps[1]).abs() < 2.0, "{places:?}");
}

/// One line before each frame: values are printed, what is written is drawn, and a mistake costs its line.
#[test]
fn lines_of_the_console_run_in_the_world() {
    let world = folder("command").join("console.rhai");
    let script = format!("{BACKDROP}\nlet ball = transform(#{{ name: \"ball\" }}); let n = 1; on_frame(|t| {{ n += 1; }});");
    std::fs::write(&world, script).expect("a world can be written");
    let out = world.with_extension("png");
    let [path, picture] = [&world, &out].map(|p| p.to_str().expect("paths are text"));
    let args = ["run", path, "--headless", "--size", "96x64", "--frames", "7", "--console", "--out", picture];
    let lines =
        "ball.translation.y = 2; let more = 5;\nball.translation\nball.translaton\nfn twice(x) { 2 * x }\n\n[twice(more), n]\n";
    let run = umbriel_told(&args, lines);
    assert!(run.stdout.starts_with("vec3(0, 2, 0)\n[10, 6]\n") && run.stdout.contains("7 pictures"), "{}", run.stdout);
    let words = "console:1:6: `ball` (Transform) has no field `translaton`; did you mean `translation`?";
    assert!(!run.ok && run.stderr.contains(words) && run.stderr.contains("with 1 problem"), "{}", run.stderr);
}

/// Text and bytes: the frame that a saved world shows is the one that the world would have shown.
#[test]
fn a_saved_world_goes_on_where_it_was() {
    let script = format!(
        "{BACKDROP}\ndefine(\"Lift\", #{{ extends: \"Transform\", fields: #{{ height: 0.0 }}, evaluate: |me, time| {{ me.translation.y = me.height * 2; }} }});\n\
         let c = make(\"TimeSensor\", #{{ cycle_interval: 2.0, loop: true }});\n\
         let lift = make(\"Lift\");\n\
         lift.add(shape(make(\"Box\"), make(\"UnlitMaterial\", #{{ emissive_color: color(1, 1, 1) }})));\n\
         world.add(lift);\nroute(c, \"fraction_changed\", lift, \"height\");\n"
    );
    let (run, whole) = draw("lifted", &script, &["--frames", "4", "--fps", "2"]);
    assert!(run.ok, "{}", run.stderr);
    let world = whole.with_extension("rhai");
    let saved = folder("command").join("lifted.umbriel");
    let [world, file] = [&world, &saved].map(|p| p.to_str().expect("paths are text"));
    for form in [&[][..], &["--binary"]] {
        let run = umbriel(&[&["save", world, "--frames", "3", "--fps", "2"], form].concat());
        assert!(run.ok && run.stdout.contains("lifted.umbriel"), "{}{}", run.stdout, run.stderr);
        let out = saved.with_file_name("went_on.png");
        let out = out.to_str().expect("paths are text");
        let run = umbriel(&["run", file, "--headless", "--size", "96x64", "--time", "1.5", "--out", out]);
        assert!(run.ok, "{form:?}: {}", run.stderr);
        let expected = image::open(whole.with_file_name("lifted.0003.png")).expect("the frame was written").to_rgb8();
        let first = image::open(whole.with_file_name("lifted.0000.png")).expect("the frame was written").to_rgb8();
        let found = image::open(out).expect("the frame was written").to_rgb8();
        assert!(expected == found && expected != first, "{form:?}");
    }
}

#[test]
fn saves_that_are_wrong_say_where_and_the_rest_is_shown() {
    let (run, picture) = draw("plain", BACKDROP, &[]);
    assert!(run.ok, "{}", run.stderr);
    let world = picture.with_extension("rhai");
    let saved = picture.with_extension("umbriel");
    let [world, file] = [&world, &saved].map(|p| p.to_str().expect("paths are text"));
    let save = |form: &[&str]| {
        assert!(umbriel(&[&["save", world], form].concat()).ok);
        std::fs::read(file).expect("the save was written")
    };
    let (text, bytes) = (String::from_utf8(save(&[])).expect("text"), save(&["--binary"]));
    let mut damaged = bytes.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    let rows: Vec<(&str, Vec<u8>, &str, bool)> = vec![
        ("none", b"hello".to_vec(), "plain.umbriel: this is no saved world", false),
        ("cut text", text.as_bytes()[..text.len() / 2].to_vec(), "plain.umbriel: line", false),
        ("cut bytes", bytes[..middle].to_vec(), "plain.umbriel: the file is damaged", false),
        ("damaged bytes", damaged, "plain.umbriel: the file is damaged", false),
        ("later major", text.replace("(1, 0)", "(2, 0)").into_bytes(), "format version 2.0; versions from 1.0", false),
        ("later minor", text.replace("(1, 0)", "(1, 9)").into_bytes(), "written as version 1.9", true),
        ("unknown field", text.replace("\"size\"", "\"sizes\"").into_bytes(), "has no field `sizes`; did you mean `size`?", true),
        ("unknown type", text.replace("\"Viewpoint\"", "\"Viewpont\"").into_bytes(), "did you mean `Viewpoint`?", true),
        ("no script", text.replace("plain.rhai", "gone.rhai").into_bytes(), "gone.rhai", true),
    ];
    for (name, data, expected, is_shown) in rows {
        assert!(data != text.as_bytes() && data != bytes, "{name} is no mistake");
        std::fs::write(&saved, data).expect("a save can be written");
        let _ = std::fs::remove_file(&picture);
        let out = picture.to_str().expect("paths are text");
        let run = umbriel(&["run", file, "--headless", "--size", "96x64", "--out", out]);
        assert!(!run.ok && run.stderr.contains(expected), "{name}: {}", run.stderr);
        assert_eq!(picture.exists(), is_shown, "{name}: {}", run.stderr);
        println!("{name}: {}", run.stderr.trim());
    }
    let run = umbriel(&["save", world, "--out", "out.txt"]);
    assert!(!run.ok && run.stderr.contains("out.txt: saved worlds are called .umbriel"), "{}", run.stderr);
}

#[test]
fn the_doctor_reports_mends_and_says_what_is_wrong() {
    let model = root().join("scripts/worlds/models/ferry.glb");
    let (model, folder) = (model.to_str().expect("paths are text"), folder("doctor"));
    let (mended, picture) = (folder.join("ferry.glb"), folder.join("ferry.png"));
    let [mended, picture] = [&mended, &picture].map(|p| p.to_str().expect("paths are text"));
    let report = umbriel(&["doctor", model]);
    assert!(!report.ok && report.stdout.contains("meshes=6 sound=2"), "{}{}", report.stdout, report.stderr);
    let run = umbriel(&["doctor", model, "--all", "--out", mended, "--picture", picture]);
    assert!(run.ok && run.stdout.contains("mended: meshes=6 sound=6"), "{}{}", run.stdout, run.stderr);
    let again = umbriel(&["doctor", mended]);
    assert!(again.ok && again.stdout.contains("meshes=6 sound=6"), "{}{}", again.stdout, again.stderr);
    let picture = image::open(picture).expect("a picture was drawn").to_rgb8();
    let red = |from: u32| {
        let half = picture.enumerate_pixels().filter(|(x, _, p)| x / 640 == from && p[0] > 200 && p[1] < 100 && p[2] < 100);
        half.count()
    };
    assert!(red(0) > 100 && red(1) == 0, "open edges before {}, after {}", red(0), red(1));

    let world = root().join("scripts/worlds/hello.rhai");
    let world = world.to_str().expect("paths are text");
    let rows: [(&[&str], &str); 6] = [
        (&["doctor", "nowhere.glb"], "nowhere.glb: cannot be read"),
        (&["doctor", model, "--all", "--out", "/nowhere/a.glb"], "/nowhere/a.glb"),
        (&["doctor", model, "--all", "--out", "a.obj"], ".glb"),
        (&["doctor", model, "--weld=-1"], "0 or more"),
        (&["doctor", world, "--all", "--out", mended], "mend the models that it loads"),
        (&["doctor", "a.txt"], "a.txt"),
    ];
    for (args, expected) in rows {
        let run = umbriel(args);
        assert!(!run.ok && run.stderr.contains(expected), "{args:?}: {}", run.stderr);
    }
    let run = umbriel(&["doctor", world]);
    assert!(run.stdout.contains("meshes="), "{}{}", run.stdout, run.stderr);
}

/// A light without a map is told from one with it, and the frames tell what maps cost.
#[test]
fn maps_are_shown_and_counted() {
    let world = folder("command").join("maps.rhai");
    let script = r#"
world.add(transform(#{ translation: vec3(0, 1, 0) }, [shape(make("Box"))]));
world.add(shape(make("Box", #{ size: vec3(9, 0.1, 9) })));
let spot = make("SpotLight", #{ name: "spot", location: vec3(2, 6, 1), direction: vec3(-2, -6, -1), shadows: "map", shadow_size: 128 });
world.add(spot);
world.add(make("PointLight", #{ name: "lamp", location: vec3(0, 3, 0), shadows: "map", shadow_size: 64 }));
world.add(make("PointLight", #{ name: "plain", location: vec3(0, 3, 0) }));
world.add(make("Viewpoint", #{ position: vec3(0, 2, 8) }));
"#;
    std::fs::write(&world, script).expect("a world can be written");
    let world = world.to_str().expect("paths are text");
    for (light, size, printed) in
        [("spot", [128, 128], "1 map of light 'spot', 128"), ("lamp", [384, 64], "6 maps of light 'lamp', 64")]
    {
        let out = folder("command").join(format!("{light}.map.png"));
        let run = umbriel(&["shadow-map", world, "--light", light, "--out", out.to_str().expect("paths are text")]);
        assert!(run.ok && run.stdout.contains(printed), "{}{}", run.stdout, run.stderr);
        let picture = image::open(&out).expect("the picture was written").to_luma8();
        assert_eq!(picture.dimensions(), (size[0], size[1]));
        let (dark, bright) = picture.pixels().fold((255, 0), |(a, b), p| (p.0[0].min(a), p.0[0].max(b)));
        assert!(dark < 50 && bright > 200, "{light}: {dark} to {bright}");
    }
    for (light, message) in [("plain", "has no shadow map"), ("nobody", "spot, lamp, plain")] {
        let run = umbriel(&["shadow-map", world, "--light", light]);
        assert!(!run.ok && run.stderr.contains(message), "{light}: {}", run.stderr);
    }
}

/// Coarse maps and lights without casters are no mistakes.
#[test]
fn coarse_and_empty_maps_are_drawn() {
    let lights = |fields: &str| {
        ["DirectionalLight", "SpotLight", "PointLight"]
            .map(|kind| format!(r#"world.add(make("{kind}", #{{ shadows: "map", filter: "pcss", {fields} }}));"#))
            .concat()
    };
    let casts_nothing = BACKDROP.replace("[shape(", "[no_caster(");
    let no_caster = "fn no_caster(geometry, look) { let s = shape(geometry, look); s.cast_shadow = false; s }";
    for (name, script) in [
        ("map_of_size_1", format!("{BACKDROP}{}", lights("shadow_size: 1"))),
        ("map_of_size_3", format!("{BACKDROP}{}", lights("shadow_size: 3"))),
        ("no_casters", format!("{no_caster}{casts_nothing}{}", lights("shadow_size: 64"))),
    ] {
        let (run, picture) = draw(name, &script, &[]);
        assert!(run.ok && corner_is_red(&picture), "{name}: {}{}", run.stdout, run.stderr);
    }
}

/// After the one frame that was asked for the field itself says that the map rests (003).
#[test]
fn maps_drawn_once_rest_afterwards() {
    for (second, is_fine) in [("none", true), ("next_frame_only", false)] {
        let script = format!(
            "{BACKDROP}let spot = make(\"SpotLight\", #{{ shadows: \"map\", shadow_update: \"next_frame_only\" }});\n\
             world.add(spot);\n\
             on_frame(|t, dt| {{\n\
                 let expected = if t < 0.5 {{ \"next_frame_only\" }} else {{ \"{second}\" }};\n\
                 if spot.shadow_update != expected {{ throw `${{spot.shadow_update}} at ${{t}} s`; }}\n\
             }});\n"
        );
        let (run, _) = draw("once", &script, &["--frames", "2", "--fps", "1"]);
        assert_eq!(run.ok, is_fine, "{second}: {}{}", run.stdout, run.stderr);
    }
}

#[test]
fn reduced_casters_are_scored_against_full_ones() {
    let world = folder("command").join("reduced.rhai");
    let script = r#"
let ball = shape(make("Sphere", #{ radius: 1.0, segments: 64 }));
ball.caster = make("ReducedCaster", #{ max_error: 0.03 });
world.add(transform(#{ translation: vec3(0, 1.5, 0) }, [ball]));
world.add(shape(make("Plane", #{ size: vec2(12, 12) })));
world.add(make("DirectionalLight", #{ direction: vec3(0.3, -1, -0.2), shadows: "volume" }));
world.add(make("Viewpoint", #{ position: vec3(0, 4, 8), orientation: axis_angle(vec3(1, 0, 0), -0.4) }));
"#;
    std::fs::write(&world, script).expect("a world can be written");
    let world = world.to_str().expect("paths are text");
    for method in ["volume", "map"] {
        let run = umbriel(&["shadow-error", world, "--method", method, "--size", "320x240", "--sub-samples", "2"]);
        assert!(run.ok && run.stdout.contains("reduced casters: 1, "), "{method}: {}{}", run.stdout, run.stderr);
        let share = run.stdout.split("disagreement=").nth(1).and_then(|t| t.split('%').next()?.parse::<f32>().ok());
        // Some pixels differ, or the full caster would have been drawn; the shadow is there, and the ball is not in it.
        assert!(share.is_some_and(|s| s > 0.0 && s < 2.0), "{method}: {}", run.stdout);
        println!("{method}: {}", run.stdout);
    }
}
