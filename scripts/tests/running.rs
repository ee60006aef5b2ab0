//! Worlds that run: handlers, routes, script-defined node types, reload.

use std::path::PathBuf;

use crate::support::{problems, world};
use umbriel_scripts::{Limits, Settings, World};

fn at(world: &mut World, expression: &str) -> String {
    world.console(expression).unwrap_or_else(|problem| panic!("{expression}\n{problem}"))
}

/// Script, frames at times, and what an expression is then.
#[test]
fn frames() {
    for (script, times, expression, expected) in [
        ("let t = transform(#{}); on_frame(|time, dt| { t.translation = vec3(time, dt, 0); });", &[1.0, 1.5][..], "t.translation", "vec3(1.5, 0.5, 0)"),
        ("let n = 0; on_frame(|| { n += 1; });", &[0.0, 0.0, 0.1], "n", "3"),
        ("let n = 0; let h = (); h = on_frame(|time| { n += 1; if n == 2 { h.stop(); } });", &[0.0, 0.1, 0.2, 0.3], "n", "2"),
        // backwards and no time at all: the clock of a world never runs back
        ("let d = []; on_frame(|time, dt| { d.push([time, dt]); });", &[2.0, 1.0, f64::NAN], "d", "[[2.0, 0.0], [2.0, 0.0], [2.0, 0.0]]"),
        (
            "let a = group([]); add_field(a, \"x\", 0.0); let b = group([]); add_field(b, \"y\", 0.0);
             route(a, \"x\", b, \"y\"); on_frame(|time| { a.x = time; });",
            &[1.0, 2.5],
            "b.y",
            "2.5",
        ),
        (
            "let a = group([]); add_field(a, \"x\", 0.0); let seen = []; on_change(a, \"x\", |x| { seen.push(x); });
             on_frame(|time| { a.x = time; });",
            &[1.0, 1.0, 2.0],
            "seen",
            "[1.0, 2.0]",
        ),
        (
            "let a = group([]); add_field(a, \"x\", 0.0); let seen = 0; let watch = ();
             watch = on_change(a, \"x\", |x| { seen += 1; watch.stop(); }); on_frame(|time| { a.x = time; });",
            &[1.0, 2.0, 3.0],
            "seen",
            "1",
        ),
        // a handler that deletes what it watches, and makes something new
        (
            "let a = group([]); add_field(a, \"x\", 0.0); on_change(a, \"x\", |x| { delete(a); world.add(group([])); });
             on_frame(|time| { if a.has(\"x\") { a.x = time; } });",
            &[1.0, 2.0, 3.0],
            "world.children.len()",
            "1",
        ),
        // a node type of the script: evaluated when a field was written
        (
            "define(\"Double\", #{ fields: #{ input: 0.0, output: 0.0, runs: 0 }, evaluate: |me, time| { me.output = me.input * 2; me.runs += 1; } });
             let d = make(\"Double\"); on_frame(|time| { d.input = floor(time); });",
            &[3.0, 3.1, 3.2, 3.3],
            "d.output",
            "6.0",
        ),
        (
            "define(\"Pulse\", #{ fields: #{ rate: 1.0, value: 0.0 }, always: true, evaluate: |me, time| { me.value = time * me.rate; } });
             let p = make(\"Pulse\", #{ rate: 3 }); let t = transform(#{}); add_field(t, \"v\", 0.0); route(p, \"value\", t, \"v\");",
            &[1.0, 2.0],
            "t.v",
            "6.0",
        ),
        (
            "define(\"Door\", #{ fields: #{ open: false, log: \"\" }, changed: #{ open: |me, open| { me.log += if open { \"o\" } else { \"c\" }; } } });
             let d = make(\"Door\"); let n = 0; on_frame(|| { n += 1; d.open = n % 2 == 1; });",
            &[0.0, 0.1, 0.2],
            "d.log",
            "oco",
        ),
        ("fn twice(x) { x * 2 } const K = 5; let n = 0; on_frame(|time| { n = twice(K); });", &[0.0], "n", "10"),
        ("let n = 0; fn tick(time, dt) { global::N } const N = 3; on_frame(|t| { n = N; });", &[0.0], "n", "3"),
    ] {
        let mut world = world(script);
        times.iter().for_each(|time| drop(world.step(*time)));
        assert_eq!(problems(&mut world), Vec::<String>::new(), "{script}");
        assert_eq!(at(&mut world, expression), expected, "{script}");
    }
}

/// A failing handler is reported once with its place and switched off; the others go on.
#[test]
fn failing_handlers_are_switched_off() {
    for (script, pieces) in [
        (
            "let n = 0;\non_frame(|time| {\n  make(\"Boxx\");\n});\non_frame(|| { n += 1; });",
            &["test:3:", "Boxx", "did you mean `Box`", "switched off"][..],
        ),
        (
            "let n = 0; let a = group([]); a.name = \"gate\"; add_field(a, \"x\", 0.0);\non_change(a, \"x\", |x| a.y = x);\non_frame(|time| { a.x = time; n += 1; });",
            &["test:2:", "`y`", "gate", "switched off"],
        ),
        (
            "let n = 0;\ndefine(\"Bad\", #{ fields: #{ x: 1.0 }, always: true, evaluate: |me, time| { me.x = \"no\"; } });\nmake(\"Bad\"); on_frame(|| n += 1);",
            &["test:2:", "expected a number", "Bad", "switched off"],
        ),
        ("let n = 0;\non_frame(|| { loop { } });\non_frame(|| n += 1);", &["test:2:", "longer than 40 ms", "switched off"]),
        (
            "let n = 0;\nfn deep(x) { deep(x + 1) }\non_frame(|| deep(0));\non_frame(|| n += 1);",
            &["test:3:", "too deeply", "switched off"],
        ),
        (
            "let n = 0; let m = #{}; on_frame(|| { for i in 0..1000000 { m[n.to_string() + i] = i; } });\non_frame(|| n += 1);",
            &["test:1:", "switched off"],
        ),
    ] {
        let limits = Limits { handler: std::time::Duration::from_millis(40), ..Limits::default() };
        let mut world = World::load_source_with("test", script, Settings { limits, ..Settings::default() }).expect(script);
        (1..=4).for_each(|frame| drop(world.step(f64::from(frame))));
        let problems = problems(&mut world);
        assert_eq!(problems.len(), 1, "{script}: {problems:?}");
        for piece in pieces {
            assert!(problems[0].contains(piece), "{script}\nsays {}\nwithout {piece}", problems[0]);
        }
        assert_eq!(at(&mut world, "n"), "4", "{script}");
    }
}

/// A new folder in the build's own place for temporary files.
fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder for the test");
    folder
}

fn write(path: &std::path::Path, text: &str) {
    std::fs::write(path, text).expect("a file for the test");
}

#[test]
fn includes_share_functions_constants_and_places() {
    let folder = folder("includes");
    write(
        &folder.join("main.rhai"),
        "let before = 1;\ninclude(\"parts.rhai\");\ninclude(\"parts.rhai\");\nwall(2);\non_frame(|| wall(before));\n",
    );
    write(
        &folder.join("parts.rhai"),
        "const THICK = 3;\nfn wall(n) {\n  if n == 1 { make(\"Bick\"); }\n  world.add(group([])); THICK\n}\nwall(0);\n",
    );
    let mut world = World::load_file(folder.join("main.rhai")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(at(&mut world, "world.children.len() + THICK"), "5");
    let mut files: Vec<_> = world.files().map(|f| f.file_name().map(|n| n.to_string_lossy().into_owned())).collect();
    files.sort();
    assert_eq!(files, [Some("main.rhai".into()), Some("parts.rhai".into())]);
    world.step(0.0);
    let problems = problems(&mut world);
    assert!(problems[0].contains("parts.rhai:3:") && problems[0].contains("called in main.rhai:5"), "{problems:?}");
}

#[test]
fn reload_keeps_the_visitor_and_survives_mistakes() {
    let folder = folder("reload");
    let path = folder.join("world.rhai");
    let text = |size: &str| {
        format!(
            "world.add(make(\"Navigation\"));\nlet box = make(\"Box\", #{{ size: {size} }});\nlet n = 0;\non_frame(|| n += 1);\n"
        )
    };
    write(&path, &text("vec3(1)"));
    let mut world = World::load_file(&path).unwrap_or_else(|e| panic!("{e}"));
    at(&mut world, "let place = find_all(\"Navigation\")[0]; place.position = vec3(7, 0, 0);");
    world.step(1.0);

    write(&path, &text("vec5(2)"));
    assert!(!world.reload());
    let problems = problems(&mut world);
    assert!(problems.len() == 1 && problems[0].contains("world.rhai:2:") && problems[0].contains("vec5"), "{problems:?}");
    world.step(2.0);
    assert_eq!(at(&mut world, "[n, box.size.x]"), "[2, 1.0]");

    write(&path, &text("vec3(2)"));
    assert!(world.reload());
    world.step(3.0);
    assert_eq!(at(&mut world, "[n, box.size.x, find_all(\"Navigation\")[0].position.x]"), "[1, 2.0, 7.0]");
    assert_eq!((world.generation(), crate::support::problems(&mut world)), (1, vec![]));

    std::fs::remove_file(&path).expect("the file is there");
    assert!(!world.reload());
    assert!(crate::support::problems(&mut world)[0].contains("cannot read"));
    world.step(4.0);
    assert_eq!(at(&mut world, "n"), "2");
}

#[test]
fn the_console_reaches_the_running_world() {
    let mut world = world("let lamp = make(\"SpotLight\", #{ name: \"lamp\" });\nfn dim(x) { x.intensity = 1; }\n");
    assert_eq!(at(&mut world, "dim(lamp)"), "");
    assert_eq!(at(&mut world, "lamp.intensity"), "1.0");
    assert_eq!(at(&mut world, "let mine = 4; mine + 1"), "5");
    assert_eq!(at(&mut world, "mine"), "4");
    at(&mut world, "on_frame(|time| { lamp.intensity = time; })");
    world.step(9.0);
    assert_eq!(at(&mut world, "lamp.intensity"), "9.0");
    let problem = world.console("lamp\n.intensty").expect_err("no such field");
    assert_eq!((problem.file.as_str(), problem.line), ("console", 2), "{problem}");
    let problem = world.console("dim(3)").expect_err("a number has no fields");
    assert_eq!((problem.file.as_str(), problem.line), ("test", 2), "{problem}");
}

/// The same script and the same times give the same world, to the bit.
#[test]
fn two_runs_are_alike() {
    let script = "let dice = random(3); let spots = each(50, |i| transform(#{ translation: vec3(dice.float(), dice.float(), i) }));
         world.add(spots); on_frame(|time, dt| { for spot in spots { spot.translation = spot.translation * 1.01 + vec3(sin(time), 0, 0); } });";
    let run = || {
        let mut world = world(script);
        (0..20).for_each(|i| drop(world.step(f64::from(i) * 0.016)));
        at(&mut world, "spots.map(|s| s.translation)")
    };
    assert_eq!(run(), run());
}

/// 000 section 4.2: a stencil shadow is made, changed and removed while the world runs.
#[test]
fn a_stencil_shadow_comes_changes_and_goes() {
    use umbriel_scene::{ShadowMethod, StencilMode, VolumeCounting};
    let mut world = world(
        "let lamp = make(\"PointLight\", #{ name: \"lamp\", location: vec3(0, 3, 0) }); world.add(lamp);
         let a = shape(make(\"Box\")); let b = shape(make(\"Sphere\")); let g = ();
         on_frame(|time| {
             if time == 1.0 { g = make(\"StencilShadow\", #{ light: lamp, caster: [a], mode: \"modulative\" }); world.add(g); }
             if time == 2.0 { g.caster = [a, b]; g.mode = \"additive\"; lamp.volume_counting = \"z_fail\"; }
             if time == 3.0 { delete(g); lamp.shadows = \"volume\"; }
         });",
    );
    let (mut extractor, mut scene) = (umbriel_scenegraph::Extractor::new(), umbriel_scene::Scene::default());
    let mut seen = Vec::new();
    for time in 0..4 {
        world.step(f64::from(time));
        assert_eq!(problems(&mut world), Vec::<String>::new());
        extractor.update(world.graph(), &mut scene);
        let groups: Vec<(usize, bool)> =
            scene.stencil_groups.iter().map(|g| (g.casters.len(), g.mode == StencilMode::Additive)).collect();
        seen.push((groups, scene.lights[0].volume.counting == VolumeCounting::ZFail, scene.lights[0].shadows));
    }
    let (none, volume) = (ShadowMethod::None, ShadowMethod::Volume);
    let expected =
        [(vec![], false, none), (vec![(1, false)], false, none), (vec![(2, true)], true, none), (vec![], true, volume)];
    assert_eq!(seen, expected);
}
