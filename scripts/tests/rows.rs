//! Rows of scripts: what they give, or what they are told.

use crate::support::{console, error_of, expect};

/// Scripts and the value that the last line has at the console.
#[test]
fn values() {
    for (script, value) in [
        ("let b = make(\"Box\", #{ size: vec3(1, 2, 3) });", ["b.size", "vec3(1, 2, 3)"]),
        ("let b = make(\"box\");", ["b.type", "Box"]),
        ("let l = make(\"SpotLight\"); l.name = \"lamp\";", ["find(\"lamp\") == l", "true"]),
        ("let l = make(\"SpotLight\", #{ name: \"lamp\" });", ["l.name", "lamp"]),
        ("let l = make(\"SpotLight\"); l.shadows = \"map\";", ["l.shadows", "map"]),
        ("let l = make(\"SpotLight\"); l.shadows = true;", ["l.shadows", "map"]),
        (
            "let l = make(\"SpotLight\"); l.shadowSize = 512; l.ShadowIntensity = 0.1;",
            ["[l.shadow_size, l.shadow_intensity]", "[512, 0.1]"],
        ),
        ("let c = make(\"TimeSensor\", #{ cycle_interval: 10, loop: true });", ["c.loop", "true"]),
        (
            "let c = make(\"TimeSensor\"); c.loop = true; let s = 0; loop { s += 1; if s == 3 { break; } }",
            ["[c.loop, s]", "[true, 3]"],
        ),
        (
            "let s = shape(make(\"Box\"), material(#{ base_color: color(0.8, 0.2, 0.1) }));",
            ["s.appearance.material.base_color", "color(0.8, 0.2, 0.1)"],
        ),
        ("let t = transform(#{ translation: vec3(0, 1, 0) }); t.translation.y = 2;", ["t.translation", "vec3(0, 2, 0)"]),
        ("let t = transform(#{}); t.translation += vec3(1, 0, 0); t.translation += vec3(1, 0, 0);", ["t.translation.x", "2.0"]),
        ("let a = group([]); let b = group([a]); world.add(b); world.add(b);", ["world.children.len()", "1"]),
        ("let a = group([]); world.add(a); world.remove(a);", ["world.children", "[]"]),
        ("let a = group([]); a.name = \"house\"; world.add(a);", ["find(\"/world/house\") == a", "true"]),
        ("", ["find(\"nobody\") == ()", "true"]),
        ("let a = group([]); add_field(a, \"speed\", 1.5); a.speed = 3;", ["a.speed", "3.0"]),
        ("let a = group([]); add_field(a, \"path\", [vec3(1, 2, 3)]); a.path = [];", ["a.path", "[]"]),
        ("let a = group([]); add_field(a, \"path\", list(\"vec3\")); a.path += [vec3(1, 2, 3)];", ["a.path.len()", "1"]),
        ("let a = group([]); delete(a);", ["find_all(\"Group\").len()", "1"]),
        ("let m = mesh(#{ position: [vec3(0,0,0), vec3(1,0,0), vec3(0,1,0)], index: [0, 1, 2] });", ["m.index", "[0, 1, 2]"]),
        ("let m = make(\"Material\", #{ diffuse_color: \"#ff0000\" });", ["m.diffuse_color", "color(1, 0, 0)"]),
        ("const SIZE = 3.0; fn twice() { SIZE * 2 }", ["twice()", "6.0"]),
        ("const lamp = make(\"SpotLight\"); fn dim() { lamp.intensity = 1; } dim();", ["lamp.intensity", "1.0"]),
        ("fn corner() { world.add(group([])); } corner();", ["world.children.len()", "1"]),
        ("let dice = random(7);", ["let a = dice.float(); let again = random(7); a == again.float()", "true"]),
        ("", ["(axis_angle(vec3(0, 1, 0), deg(90)) * vec3(0, 0, -1)).distance(vec3(-1, 0, 0)) < 1e-6", "true"]),
        ("", ["look(vec3(0, 0, 5), vec3(0, 0, 0)) == quat(0, 0, 0, 1)", "true"]),
        ("", ["mix(vec3(0), vec3(2), 0.5)", "vec3(1, 1, 1)"]),
        ("", ["mix(1, 3, 0.5)", "2.0"]),
        ("", ["2 * vec3(1, 2, 3) / 2 - vec3(1)", "vec3(0, 1, 2)"]),
        ("", ["mat4(vec3(1, 2, 3), euler(0, 0, 0), vec3(2)) * vec3(1, 1, 1)", "vec3(3, 4, 5)"]),
        ("", ["grid_index(2, 2)", "[0, 2, 1, 1, 2, 3]"]),
        ("", ["each(3, |i| i * i)", "[0, 1, 4]"]),
        (
            "let e = make(\"Expression\", #{ inputs: #{ maxSpeed: 2.0, step_size: 0.5 }, code: \"maxSpeed * stepSize\" });",
            ["[e.value, e.max_speed]", "[1.0, 2.0]"],
        ),
        ("let a = [3, 1, 2, 1]; a.sort(|x, y| y - x);", ["a", "[3, 2, 1, 1]"]),
        ("", ["sin(0) + max(1, 2.5)", "2.5"]),
        ("", ["smoothstep(0, 2, 1)", "0.5"]),
        ("let a = []; try { make(\"Boxx\"); } catch (e) { a.push(e.message); }", ["a[0].contains(\"Box\")", "true"]),
    ] {
        expect(&console(script, value[0]), value[1], script);
    }
}

/// Scripts and what the message about them must say, the place first.
#[test]
fn errors() {
    for (script, pieces) in [
        ("let x = 1;\nmake(\"SpotLigt\");", &["test:2:1", "SpotLigt", "SpotLight"][..]),
        ("let l = make(\"SpotLight\");\n\nl.shadow = true;", &["test:3:3", "shadow", "SpotLight", "shadows"]),
        ("let l = make(\"SpotLight\");\nlet i = l.intensty;", &["test:2:11", "intensty", "did you mean `intensity`"]),
        ("let l = make(\"SpotLight\");\nl.shadows = \"maps\";", &["test:2:", "maps", "map"]),
        (
            "let l = make(\"SpotLight\");\nl.intensity = \"bright\";",
            &["test:2:", "intensity", "SpotLight", "expected a number", "string \"bright\""],
        ),
        (
            "let b = make(\"Box\"); b.name = \"crate\";\nb.size = 3;",
            &["test:2:", "size", "crate", "expected a vec3", "whole number 3"],
        ),
        ("let b = make(\"Box\");\nb.size = vec4(1, 2, 3, 4);", &["test:2:", "expected a vec3", "vec4"]),
        ("let l = make(\"SpotLight\");\nl.on_change(\"on\", |v| l.intensity = 1.0);", &["write `on_change(node"]),
        ("let m = make(\"Mesh\");\nm.index = [0, 1.5];", &["test:2:", "an array of whole number", "number 1.5 as element 1"]),
        ("let m = make(\"Mesh\");\nm.index = [3000000000];", &["test:2:", "does not fit into 32 bits"]),
        ("let l = make(\"SpotLight\");\nl.intensity = 1e300;", &["test:2:", "too large"]),
        ("let l = make(\"SpotLight\", #{ shadow_intensity: 7 });", &["test:1:", "shadow_intensity", "from 0 to 1"]),
        ("shpae(make(\"Box\"));", &["test:1:1", "no function `shpae`", "did you mean `shape`"]),
        ("shape(1);", &["test:1:1", "does not take (int)", "shape(geometry: Node)"]),
        ("let lamp = 1;\nprint(lamb);", &["test:2:", "no variable `lamb`", "did you mean `lamp`"]),
        ("let x = 1;\nlet y = ;", &["test:2:", "Syntax error"]),
        ("let l = make(\"SpotLight\", #{ name: \"l\" });\nfind(\"l\").on = false;", &["test:2:", "let lamp = find(\"lamp\");"]),
        (
            "fn a() { b(); }\nfn b() { make(\"Nothing\"); }\n\na();",
            &["test:2:", "Nothing", "in b, called in test:1", "in a, called in test:4"],
        ),
        ("world.add(3);", &["test:1:", "`add` does not take (Node, int)"]),
        ("world.add([3]);", &["test:1:", "only nodes", "whole number 3"]),
        ("world.add(world);", &["test:1:", "below itself"]),
        (
            "let c = make(\"TimeSensor\"); let b = make(\"Box\");\nroute(c, \"time\", b, \"size\");",
            &["test:2:1", "time", "size", "vec3"],
        ),
        ("let c = make(\"TimeSensor\"); let b = make(\"Box\");\nunroute(c, \"time\", b, \"size\");", &["test:2:1", "no route"]),
        ("let a = group([]); delete(a);\na.children = [];", &["test:2:", "does not exist any more"]),
        ("color(\"red\");", &["test:1:1", "red", "#ff8800"]),
        ("define(\"A\", #{ field: #{} });", &["test:1:1", "no part `field`", "fields"]),
        ("define(\"A\", #{ fields: #{ a: 1 }, changed: #{ b: |me, v| 1 } });", &["test:1:1", "no field `b`"]),
        ("define(\"Box\", #{});", &["test:1:1", "Box"]),
        ("let g = group([]);\nevaluate_when(g, \"always\");", &["test:2:1", "an unnamed Group has no evaluate"]),
        (
            "let s = make(\"Sum\");\nevaluate_when(s, \"allways\");",
            &["test:2:1", "on_change, always, pull", "did you mean `always`"],
        ),
        (
            "let a = make(\"Sum\"); let b = make(\"Sum\"); route(a, \"value\", b, \"a\");\ndepend_for_this_frame(a, b);",
            &["test:2:1", "an unnamed Sum"],
        ),
        ("list(\"vec5\");", &["test:1:1", "vec5", "vec"]),
        ("let a = group([]);\nadd_field(a, \"path\", []);", &["test:2:1", "path", "list(\"vec3\")"]),
        ("eval(\"1\");", &["test:1:", "eval"]),
        ("import \"x\" as y;", &["test:1:", "import"]),
        ("sleep(1000);", &["test:1:1", "no function `sleep`"]),
        ("include(\"../secret.rhai\");", &["test:1:9", "out of the world's folder"]),
        ("let x = include(\"a.rhai\");", &["test:1:", "include"]),
        ("throw \"my own words\";", &["test:1:", "my own words"]),
        ("let b = make(\"Box\");\nb.size = [1e300, 0, 0];", &["test:2:", "`size`", "1e300 is too large"]),
        ("let l = make(\"SpotLight\");\nl.shadows = 3;", &["test:2:", "`shadows`", "whole number 3", "one of none, map, volume"]),
        ("let a = group([]);\nadd_field(a, \"Name\", 1);", &["test:2:1", "every node has a `name` already"]),
        ("define(\"A\", #{ fields: #{ type: 1 } });", &["test:1:1", "every node has a `type` already"]),
        ("define(\"A\", #{ fields: #{ a: field(\"x\", #{ choices: [\"x\", \"x\"] }) } });", &["the choice `x` twice"]),
        ("define(\"A\", #{ fields: #{ a: field(\"x\", #{ range: [0, 1] }) } });", &["`a`", "range", "string do not have"]),
        ("let b = make(\"Box\");\nb.size.w = 1;", &["test:2:8", "type vec3 has no part `w` that takes"]),
        ("let b = make(\"Box\");\nlet w = b.size.w;", &["test:2:16", "type vec3 has no part `w`"]),
        ("let b = make(\"Box\");\nroute(b, \"size\", (), \"size\");", &["test:2:1", "does not take (Node, string, (), string)"]),
        ("let f = |a, b| a + b;\nf.call(1, 2, 3);", &["test:2:", "a closure of |a, b| does not take (int, int, int)"]),
        (
            "make(\"Expression\", #{ inputs: #{ let: 1.0 }, code: \"2\" });",
            &["test:1:1", "cannot read an input that is called `let`"],
        ),
    ] {
        let text = error_of(script);
        for piece in pieces {
            assert!(text.contains(piece), "{script}\nsays {text}\nwithout {piece}");
        }
    }
}
