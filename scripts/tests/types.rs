//! Node types that worlds define, on top of others, and Expressions.

use umbriel_fields::Graph;
use umbriel_scripts::World;

use crate::support::{error_of, expect, problems, world};

fn at(world: &mut World, expression: &str) -> String {
    world.console(expression).unwrap_or_else(|problem| panic!("{expression}\n{problem}"))
}

/// A script, the times of its frames, and expressions with their values.
type Row<'a> = (&'a str, &'a [f64], &'a [(&'a str, &'a str)]);

/// Each script runs without a problem; then the expressions have these values.
#[test]
fn types_on_types() {
    let pulse = "define(\"Pulse\", #{ doc: \"Beats.\", fields: #{ rate: 1.0, value: 0.0, runs: 0 }, always: true,
        evaluate: |me, time| { me.value = time * me.rate; me.runs += 1; },
        changed: #{ rate: |me, rate| print(rate) } });\n";
    let rows: &[Row<'_>] = &[
        // all is inherited, a first value is another
        ("define(\"Fast\", #{ extends: \"Pulse\", fields: #{ rate: 5 } }); let f = make(\"Fast\");", &[1.0, 2.0], &[("f.value", "10.0"), ("f.type", "Fast")]),
        ("define(\"Fast\", #{ extends: \"Pulse\", fields: #{ rate: field(5.0, #{ unit: \"Hz\" }) } }); let f = make(\"Fast\");", &[2.0], &[("f.value", "10.0")]),
        // evaluate is another, and calls the one above, through three levels
        (
            "define(\"Blinker\", #{ extends: \"Pulse\", fields: #{ on: false }, evaluate: |me, time| { me.evaluate_base(time); me.on = me.value > 1; } });
             define(\"Alarm\", #{ extends: \"Blinker\", fields: #{ loud: false }, evaluate: |me, time| { evaluate_base(me, time); me.loud = me.on; } });
             let a = make(\"Alarm\", #{ rate: 2 });",
            &[1.0],
            &[("[a.value, a.on, a.loud]", "[2.0, true, true]"), ("find_all(\"Pulse\") == [a]", "true"), ("find_all(\"Alarm\").len()", "1"), ("a.runs", "1")],
        ),
        // a level without its own evaluate is passed over
        (
            "define(\"A\", #{ extends: \"Pulse\" }); define(\"B\", #{ extends: \"A\", evaluate: |me, time| { me.evaluate_base(time); me.value += 100; } }); let b = make(\"B\");",
            &[1.0],
            &[("b.value", "101.0")],
        ),
        // a native type: the node is a Transform for all who know nothing of scripts
        (
            "define(\"Spinner\", #{ extends: \"Transform\", fields: #{ speed: 2.0, runs: 0, scale: vec3(3) }, always: true,
                evaluate: |me, time| { me.translation = vec3(time * me.speed, 0, 0); me.runs += 1; } });
             let s = make(\"Spinner\", #{ speed: 3 }); world.add(s); s.add(shape(sphere(1)));",
            &[1.0, 2.0, 2.0],
            &[("s.translation.x", "6.0"), ("s.runs", "3"), ("s.scale.y", "3.0"), ("s.type", "Spinner"), ("find_all(\"Transform\") == [s]", "true"), ("find_all(\"Spinner\").len()", "1")],
        ),
        // in every frame, only when another depends on it, and in the order that a frame asks for
        (
            "define(\"Count\", #{ fields: #{ x: 0.0, runs: 0, order: 0, log: () }, evaluate: |me, time| { me.runs += 1; me.log.last += 1; me.order = me.log.last; } });
             let log = group([]); add_field(log, \"last\", 0);
             let a = make(\"Count\", #{ log: log }); let b = make(\"Count\", #{ log: log }); let c = make(\"Count\", #{ log: log });
             evaluate_when(b, \"always\"); evaluate_when(c, \"pull\");
             let n = 0; on_frame(|| { n += 1; if n == 3 { a.x = 1; c.x = 1; depend_for_this_frame(a, c); } });",
            &[1.0, 2.0, 3.0, 4.0],
            &[("[a.runs, b.runs, c.runs]", "[2, 4, 1]"), ("c.order < a.order", "true")],
        ),
        // evaluated when written, once in a frame whatever was written, and not by what it writes itself
        (
            "define(\"Mover\", #{ extends: \"Transform\", fields: #{ goal: 0.0, runs: 0 }, evaluate: |me, time| { me.translation.x = me.goal; me.runs += 1; } });
             let m = make(\"Mover\"); let n = 0; on_frame(|| { n += 1; if n == 3 { m.goal = 7; m.scale = vec3(2); } });",
            &[1.0, 2.0, 3.0, 4.0, 5.0],
            &[("[m.translation.x, m.runs]", "[7.0, 2]")],
        ),
        // in the order of routes: what it computes goes on in the same frame, what comes is there
        (
            "define(\"Mover\", #{ extends: \"Transform\", fields: #{ goal: 0.0 }, always: true, evaluate: |me, time| { me.translation.x = me.goal; } });
             let clock = group([]); add_field(clock, \"time\", 0.0); on_frame(|time| clock.time = time); let m = make(\"Mover\"); let t = transform(#{}); route(clock, \"time\", m, \"goal\"); route(m, \"translation\", t, \"scale\");",
            &[1.0, 4.0],
            &[("t.scale.x", "4.0")],
        ),
        (
            "define(\"Lamp\", #{ extends: \"PointLight\", changed: #{ on: |me, on| me.intensity = if on { 5 } else { 0 } } });
             define(\"Big\", #{ extends: \"Lamp\", fields: #{ radius: 4 }, evaluate: |me, time| { me.color = color(1, 0, 0); } });
             let l = make(\"Big\"); on_frame(|| l.on = false);",
            &[1.0, 2.0],
            &[("[l.intensity, l.radius, l.color]", "[0.0, 4.0, color(1, 0, 0)]")],
        ),
        (
            "define(\"Sign\", #{ fields: #{ state: field(\"red\", #{ choices: [\"red\", \"green\"] }), size: field(1, #{ type: \"f32\" }), path: field([], #{ type: \"vec3\" }),
                other: field((), #{ doc: \"another\" }), kick: field(0.0, #{ event: true, aliases: [\"push\"] }) } });
             define(\"Go\", #{ extends: \"Sign\", fields: #{ state: \"green\" } }); let s = make(\"Go\"); s.path += [vec3(1, 2, 3)]; s.push = 2;",
            &[1.0],
            &[("[s.state, s.size, s.path.len(), s.other, s.kick]", "[\"green\", 1.0, 1, (), 2.0]")],
        ),
    ];
    for (script, times, values) in rows {
        let script = format!("{pulse}{script}");
        let mut world = world(&script);
        times.iter().for_each(|time| drop(world.step(*time)));
        assert_eq!(problems(&mut world), Vec::<String>::new(), "{script}");
        values.iter().for_each(|(expression, value)| expect(&at(&mut world, expression), value, &script));
    }
}

/// What is known of a field is in the declaration that everybody reads.
#[test]
fn declarations_say_what_the_script_said() {
    let script = "define(\"Pulse\", #{ doc: \"Beats.\", fields: #{ rate: field(1.0, #{ range: [0, 10], doc: \"How fast.\", unit: \"Hz\" }) } });
        let g = group([]); add_field(g, \"speed\", field(2.0, #{ range: [0, 3], unit: \"m/s\" })); let p = make(\"Pulse\");";
    let mut world = world(script);
    let graph: &Graph = world.graph();
    let pulse = graph.types().get("Pulse").expect("the type");
    let rate = pulse.field_named("rate").expect("the field");
    assert_eq!((&*pulse.doc, &*rate.doc, &*rate.unit, rate.range), ("Beats.", "How fast.", "Hz", Some((0.0, 10.0))));
    for (line, pieces) in [("p.rate = 11", ["rate", "from 0 to 10"]), ("g.speed = 4", ["speed", "from 0 to 3"])] {
        let problem = world.console(line).expect_err(line).to_string();
        assert!(pieces.iter().all(|piece| problem.contains(piece)), "{line}: {problem}");
    }
}

/// A scripted Transform is extracted as Transforms are: its matrix moves what is below it.
#[test]
fn a_scripted_transform_moves_its_children() {
    let script = "define(\"Lift\", #{ extends: \"Transform\", always: true, evaluate: |me, time| { me.translation = vec3(0, time, 0); } });
        let lift = make(\"Lift\"); world.add(lift); lift.add(shape(cuboid(vec3(1))));";
    let mut world = world(script);
    let mut extractor = umbriel_scenegraph::Extractor::new();
    let mut scene = umbriel_scene::Scene::default();
    for time in [1.0f64, 2.5] {
        world.step(time);
        extractor.update(world.graph(), &mut scene);
        let heights: Vec<f32> = scene.drawables.iter().filter(|d| d.visible).map(|d| d.world_from_object.w_axis.y).collect();
        assert_eq!(heights, [time as f32], "at {time}");
    }
}

#[test]
fn expressions() {
    let rows: &[(&str, &[f64], &str, &str)] = &[
        ("let e = make(\"Expression\", #{ inputs: #{ a: 1.0, p: vec3(5, 0, 0) }, code: \"a * 2.0 + p.x\" }); e.a = 4;", &[1.0], "e.value", "13.0"),
        ("let e = make(\"Expression\", #{ inputs: #{ a: 1.0 }, value: vec3(0), code: \"vec3(a, 2 * a, 0)\" });", &[1.0], "e.value", "vec3(1, 2, 0)"),
        ("let e = make(\"Expression\", #{ inputs: #{ a: 3 }, value: field(0.0, #{ range: [0, 100] }), code: \"if a > 2 { a * 10 } else { 0 }\" });", &[1.0], "e.value", "30.0"),
        // the functions and constants of the world
        ("const K = 10; fn twice(x) { x * 2 } let e = make(\"Expression\", #{ inputs: #{ a: 1.5 }, code: \"twice(a) + K\" });", &[1.0], "e.value", "13.0"),
        // between routes, in one frame
        (
            "let c = group([]); add_field(c, \"time\", 0.0); on_frame(|time| c.time = time); let e = make(\"Expression\", #{ name: \"e\", inputs: #{ t: 0.0 }, value: vec3(0), code: \"vec3(t, 0, 0)\" });
             let b = transform(#{}); route(c, \"time\", e, \"t\"); route(e, \"value\", b, \"translation\");",
            &[1.0, 2.0],
            "b.translation.x",
            "2.0",
        ),
        // another text takes effect, also where the one before failed
        ("let e = make(\"Expression\", #{ inputs: #{ a: 2.0 }, code: \"a\" }); e.code = \"a * a * a\";", &[1.0], "e.value", "8.0"),
        // only when an input changed: dice would show it
        ("let e = make(\"Expression\", #{ inputs: #{ a: 2.0 }, code: \"a + 1\" }); on_frame(|| if e.value == 3.0 { e.value = 77.0; });", &[1.0, 2.0, 3.0], "e.value", "3.0"),
        ("let e = make(\"Expression\", #{ inputs: #{ l: [1.0, 2.0, 3.0] }, value: list(\"f64\"), code: \"l.map(|x| x * 2)\" });", &[1.0], "e.value", "[2.0, 4.0, 6.0]"),
    ];
    for (script, times, expression, value) in rows {
        let mut world = world(script);
        times.iter().for_each(|time| drop(world.step(*time)));
        assert_eq!(problems(&mut world), Vec::<String>::new(), "{script}");
        expect(&at(&mut world, expression), value, script);
    }
}

/// An Expression that fails is reported once, with node, field and column; the frame goes on, and a new text mends it.
#[test]
fn expressions_that_fail() {
    for (code, pieces) in [
        ("a + bb", &["test:1:", "`e` (Expression)", "a + bb", "column 5", "no input `bb`", "switched off"][..]),
        ("a + ", &["column", "a + "]),
        ("nothing(a)", &["column 1", "no function `nothing(f64)`"]),
        ("\"text\"", &["value", "expected a number"]),
        ("while true {}", &["column 1"]),
        ("forever(a)", &["longer than 250 ms"]),
        ("make(\"Box\")", &["sees its inputs only"]),
        ("on_frame(|| 1)", &["sees its inputs only"]),
        ("n.translation.x", &["sees its inputs only"]),
        ("a * 1e300 * 1e300", &[]),
    ] {
        let script = "fn forever(x) { loop { x += 1; } } let t = transform(#{}); let n = 0; on_frame(|| n += 1); let e = make(\"Expression\", #{ name: \"e\", inputs: #{ a: 1.0, n: t }, code: \"a\" });";
        let mut world = world(script);
        at(&mut world, &format!("e.code = `{code}`"));
        (1..4).for_each(|frame| drop(world.step(f64::from(frame))));
        at(&mut world, "e.a = 2");
        world.step(4.0);
        let found = problems(&mut world);
        assert_eq!(found.len(), usize::from(!pieces.is_empty()), "{code}: {found:?}");
        for piece in pieces {
            assert!(found[0].contains(piece), "{code} says {}\nwithout {piece}", found[0]);
        }
        at(&mut world, "e.code = \"a * 3\"");
        world.step(5.0);
        assert_eq!(
            (at(&mut world, "[n, e.value, world.children.len()]"), problems(&mut world)),
            ("[5, 6.0, 0]".into(), vec![]),
            "{code}"
        );
    }
}

#[test]
fn mistakes_when_made() {
    for (script, pieces) in [
        (
            "let x = 1;\nmake(\"Expression\", #{ inputs: #{ a: 1.0 }, code: \"a + b\" });",
            &["test:2:1", "column 5", "no input `b`"][..],
        ),
        ("make(\"Expression\", #{ inputs: 3, code: \"1\" });", &["test:1:1", "takes a map"]),
        ("make(\"Expression\", #{ inputs: #{ a: 1.0 } });", &["test:1:1", "has no `code`"]),
        ("make(\"Expression\", #{ expression: \"1 + 2\" });", &["test:1:1", "no field `expression`"]),
        ("make(\"Expression\", #{ inputs: #{ a: 1.0 }, code: \"(a\", value: 0.0 });", &["test:1:1", "column"]),
        ("fn f() { make(\"Expression\", #{ code: \"f()\" }) } f();", &["sees its inputs only"]),
        ("define(\"A\", #{ extends: \"Trasform\" });", &["test:1:1", "Trasform", "Transform"]),
        ("define(\"A\", #{ extends: \"Expression\" });", &["cannot extend Expression"]),
        ("define(\"A\", #{ extends: \"Box\", fields: #{ size: \"big\" } });", &["size", "A", "expected a vec3"]),
        ("define(\"A\", #{ extends: \"PointLight\", fields: #{ shadows: \"yes\" } });", &["shadows", "yes", "none, map"]),
        ("field(1.0, #{ rang: [0, 1] });", &["test:1:1", "no `rang`", "range"]),
        ("field(1.0, #{ range: 3 });", &["[low, high]"]),
        ("define(\"A\", #{ fields: #{ x: field(5, #{ range: [0, 1] }) } });", &["x", "range 0 to 1"]),
        ("field(\"a\", #{ type: \"vec3\" });", &["expected a vec3"]),
        ("evaluate_base(world, 0);", &["within the evaluate"]),
    ] {
        let text = error_of(script);
        for piece in pieces {
            assert!(text.contains(piece), "{script}\nsays {text}\nwithout {piece}");
        }
    }
}

/// A failing `evaluate` of a native type is switched off for that node; routes and native evaluation go on.
#[test]
fn failing_behaviours_are_switched_off() {
    let script = "define(\"Bad\", #{ extends: \"Transform\", always: true, evaluate: |me, time| { if me.name == \"b\" { me.nothing = 1; } me.translation.x = time; } });
        let a = make(\"Bad\", #{ name: \"a\" }); let b = make(\"Bad\", #{ name: \"b\" }); let c = make(\"Bad\"); delete(c);";
    let mut world = world(script);
    (1..4).for_each(|frame| drop(world.step(f64::from(frame))));
    let found = problems(&mut world);
    assert!(found.len() == 1 && found[0].contains("nothing") && found[0].contains("switched off"), "{found:?}");
    assert_eq!(at(&mut world, "[a.translation.x, b.translation.x]"), "[3.0, 0.0]");
}

/// What scripts keep from other processes: nodes of a type, native or not, one node, one field.
#[test]
fn some_things_stay_in_the_application() {
    let mut world = world(
        "define(\"Log\", #{ local: true, fields: #{ lines: 0 } });
         define(\"Ghost\", #{ local: true, extends: \"Transform\" });
         define(\"Lamp\", #{ fields: #{ state: 0, draft: field(0.0, #{ local: true }) } });
         let log = make(\"Log\", #{ name: \"log\" }); let ghost = make(\"Ghost\", #{ name: \"ghost\" });
         let lamp = make(\"Lamp\", #{ name: \"lamp\" }); let tool = make(\"Transform\", #{ name: \"tool\" }); let other = make(\"Transform\", #{ name: \"other\" });
         keep_local(tool);",
    );
    world.step(0.0);
    assert_eq!(problems(&mut world), Vec::<String>::new());
    let graph = world.graph();
    for (name, is_local) in [("log", true), ("ghost", true), ("lamp", false), ("tool", true), ("other", false)] {
        assert_eq!(graph.is_local(graph.find(name).unwrap()), is_local, "{name}");
    }
    let lamp = graph.find("lamp").unwrap();
    let is_local = |field: &str| graph.declaration(graph.field(lamp, field).unwrap()).unwrap().local;
    assert_eq!([is_local("state"), is_local("draft")], [false, true]);
}
