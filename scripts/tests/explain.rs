//! What a world says about itself: reasons, costs, pictures, problems, files for editors.

use std::time::Duration;

use umbriel_scripts::{Limits, Settings, World, definitions};

use crate::support::{problems, world};

#[test]
fn reasons_name_places_in_the_script() {
    let script = "explain(true);\nlet a = group([]); a.name = \"a\"; add_field(a, \"x\", 0.0); let b = group([]); b.name = \"b\"; add_field(b, \"y\", 0.0);
route(a, \"x\", b, \"y\");
on_frame(|time| {
    a.x = time;
});";
    let mut world = world(script);
    (1..3).for_each(|frame| drop(world.step(f64::from(frame))));
    let lines = world.console("let text = \"\"; for line in why(b, \"y\") { text += line + \"\\n\"; } text").expect("lines");
    let expected = ["y", "frame 2", "route from", "x", "test:5"];
    assert!(expected.iter().all(|piece| lines.contains(piece)) && lines.lines().count() == 2, "{lines}");
    let unasked = crate::support::console("let l = make(\"PointLight\");", "why(l, \"color\")");
    assert!(unasked.contains("default"), "{unasked}");
}

#[test]
fn costs_and_pictures() {
    let script = "let c = make(\"TimeSensor\", #{ name: \"clock\", loop: true }); let t = transform(#{ name: \"arm\" }); add_field(t, \"v\", 0.0); route(c, \"time\", t, \"v\");
        let seen = []; on_frame(|| { seen = costs(); });";
    let mut world = world(script);
    (1..4).for_each(|frame| drop(world.step(f64::from(frame))));
    let value = |world: &mut World, text: &str| world.console(text).unwrap_or_else(|problem| panic!("{text}: {problem}"));
    assert_eq!(value(&mut world, "[costs()[0].node == c, costs()[0].evaluations, costs()[0].keys().len()]"), "[true, 3, 3]");
    // handlers see no times: worlds are the same in every run
    assert_eq!(value(&mut world, "seen[0].keys().sort(); seen[0].keys().contains(\"seconds\")"), "false");
    let dot = value(&mut world, "dot()");
    assert!(dot.starts_with("digraph") && dot.contains("clock") && dot.contains("arm") && dot.contains("->"), "{dot}");
}

/// Problems that nodes report are problems of the world, with node and place, each once.
#[test]
fn problems_of_nodes_are_problems_of_the_world() {
    let mut world = world(
        "let p = make(\"PositionInterpolator\", #{ name: \"path\", key: [0.0, 1.0], key_value: [vec3(0)] }); on_frame(|time| p.set_fraction = time);",
    );
    let mut reports = 0;
    for frame in 1..5 {
        reports += world.step(f64::from(frame) / 10.0).problems.len();
    }
    let found = problems(&mut world);
    assert!(found.len() == 1 && found[0].contains("path"), "{found:?}");
    assert_eq!(reports, 0);
}

/// A loop that does nothing and never ends has a line: its own, or that of the call of the function around it.
#[test]
fn endless_loops_have_a_line() {
    for (script, place) in [
        ("let x = 1;\n\nloop { }", "test:3:"),
        ("let x = 1;\nif x == 1 {\n  while true { }\n}", "test:3:"),
        ("fn wait() {\n  loop {}\n}\nwait();", "test:4:"),
        ("let x = 1;\nloop { 1; }", "test:2:"),
        ("let x = 1;\nloop {\n  x += 1;\n}", "test:3:"),
    ] {
        let limits = Limits { main: Duration::from_millis(50), ..Limits::default() };
        let settings = Settings { limits, ..Settings::default() };
        let error = World::load_source_with("test", script, settings).map(drop).expect_err(script).to_string();
        assert!(error.contains(place) && error.contains("longer than 50 ms"), "{script}: {error}");
    }
}

/// Each handler stays within its bound, all together do not: the heaviest goes, the small one stays.
#[test]
fn all_handlers_together_are_bounded() {
    let one = |name: &str, step: usize| {
        format!("let {name} = []; on_frame(|| {{ {name}.pad({name}.len() + {step}, 0); for k in 0..30000 {{ }} }});\n")
    };
    let script = format!(
        "let n = 0; on_frame(|| n += 1);\n{}{}{}{}{}",
        one("a", 4000),
        one("b", 3000),
        one("c", 3000),
        one("d", 3000),
        one("e", 5000)
    );
    let limits = Limits { memory: 16 << 20, handler: Duration::from_secs(5), ..Limits::default() };
    let settings = Settings { limits, ..Settings::default() };
    let mut world = World::load_source_with("test", &script, settings).unwrap_or_else(|error| panic!("{error}"));
    let mut found = Vec::new();
    let mut frames = 0;
    while found.is_empty() && frames < 300 {
        frames += 1;
        world.step(f64::from(frames));
        found = problems(&mut world);
    }
    assert!(found.len() == 1 && found[0].contains("16 MB") && found[0].contains("together"), "{found:?} after {frames} frames");
    assert!(found[0].starts_with("test:6:"), "the heaviest is the last: {found:?}");
    let before: u32 = world.console("n").expect("n").parse().expect("a number");
    world.step(1e6);
    assert_eq!(world.console("n").expect("n"), (before + 1).to_string());
    // Long enough to be weighed for certain: what is there may be used and let go, and not grow.
    let long = |text: &str| format!("let k = 0; while k < 300000 {{ k += 1; }} {text}");
    assert_eq!(world.console(&long("e.len() > 0")).expect("long"), "true");
    let more = world.console("let more = []; more.pad(200000, 0); for k in 0..300000 { more[0] += 1; }").expect_err("more");
    assert!(more.to_string().contains("16 MB"), "{more}");
    world.console("more = []; e = []").expect("let go");
    world.console("let more = []; more.pad(100000, 0); for k in 0..300000 { more[0] += 1; } more = []").expect("room again");
}

/// Editors get every function with its documentation, and every field.
#[test]
fn definitions_have_all() {
    let files = definitions();
    let text: String = files.iter().map(|(_, text)| text.as_str()).collect();
    for function in umbriel_scripts::functions() {
        assert!(text.contains(&format!("fn {}(", function.name())), "{}", function.name());
        assert!(text.contains(function.doc), "{}", function.doc);
    }
    for line in [
        "fn route(from: Node, field: string, to: Node, field: string) -> ();",
        "fn on_frame(handler: Fn) -> Handler;",
        "fn clamp(x: ?, low: ?, high: ?)",
        "fn get intensity(node: Node) -> float;",
        "const world: Node;",
    ] {
        assert!(
            text.contains(line),
            "no {line} in\n{}",
            text.lines().filter(|l| l.starts_with("fn r") || l.starts_with("const")).collect::<Vec<_>>().join("\n")
        );
    }
    assert!(files.iter().all(|(name, text)| name.ends_with(".d.rhai") && text.starts_with("module static;")), "each file is one");
}
