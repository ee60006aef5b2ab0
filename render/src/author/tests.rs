//! Wrong shaders, and what is said of them.

use super::check::check;
use std::sync::Arc;
use umbriel_scene::ShaderSource;

#[test]
fn wrong_shaders_are_told_in_their_own_lines() {
    let shade = |body: &str| format!("// A shader\n\nfn shade(s: Surface, light: LightSample) -> vec3<f32> {{\n    {body}\n}}\n");
    let calls = |n: u32| {
        (1..n).map(|i| format!("fn g{i}(x: f32) -> f32 {{ return g{0}(x) + g{0}(x + 1.0); }}\n", i - 1)).collect::<String>()
    };
    let rows: Vec<(&str, String, &str)> = vec![
        ("syntax", shade("let x = ;"), "own.wgsl:4:13: expected expression"),
        ("type", shade("return 1;"), "own.wgsl:4:"),
        (
            "unknown name",
            shade("return s.normal * brightness;"),
            "own.wgsl:4:23: no definition in scope for identifier: `brightness`",
        ),
        ("unknown member", shade("return s.colour;"), "own.wgsl:4:14: invalid field accessor `colour`"),
        (
            "wrong parameter",
            shade("return s.normal * params.brigth;"),
            "own.wgsl:4:30: invalid field accessor `brigth`; `params` has bright",
        ),
        (
            "no function",
            "fn help() -> f32 { return 1.0; }".into(),
            "own.wgsl: it has none of the functions surface, shade, ambient, finish",
        ),
        ("empty", String::new(), "own.wgsl: it has none of the functions"),
        (
            "wrong signature",
            "\nfn shade(s: Surface) -> vec3<f32> { return s.normal; }".into(),
            "own.wgsl:2:1: it must be `fn shade(s: Surface, light: LightSample) -> vec3<f32>`",
        ),
        ("too long", " ".repeat(70_000), "own.wgsl:1:1: it has 70000 bytes"),
        (
            "too deep",
            shade(&format!("return {}s.normal{};", "(".repeat(80), ")".repeat(80))),
            "own.wgsl:4:75: it is nested deeper than 64",
        ),
        ("else without end", shade(&format!("if s.is_unlit {{}} {}", "else if s.is_unlit {} ".repeat(2500))), "`else`"),
        ("endless sum", shade(&format!("return {}s.normal;", "s.normal + ".repeat(5000))), "words"),
        (
            "taken name",
            format!("fn incidence() {{}}\n{}", shade("return s.normal;")),
            "own.wgsl:1:4: redefinition of `incidence`",
        ),
        ("hidden variable", shade("return lights[0].color;"), "`lights` is not for shaders of shapes"),
        (
            "hidden function",
            shade("return vec3<f32>(map_visibility(lights[0], s.position, s.normal));"),
            "not for shaders of shapes",
        ),
        ("binding", format!("@group(0) @binding(7) var<uniform> mine: vec4<f32>;\n{}", shade("return mine.xyz;")), "own.wgsl:1:"),
        ("entry point", format!("{}@fragment fn main() {{}}", shade("return s.normal;")), "`main` is an entry point"),
        ("recursion", format!("fn f(x: f32) -> f32 {{ return f(x); }}\n{}", shade("return vec3<f32>(f(1.0));")), "own.wgsl:1:"),
        (
            "calls that multiply",
            format!("fn g0(x: f32) -> f32 {{ return x; }}\n{}{}", calls(40), shade("return vec3<f32>(g39(1.0));")),
            "operations; at most",
        ),
        ("too much memory", shade("var a: array<f32, 100000>; return s.normal * a[1];"), "400000 bytes"),
    ];
    for (name, text, expected) in rows {
        let source = ShaderSource { name: "own.wgsl".into(), text };
        // As the renderer does it: parsers need a deep stack.
        let check = move || check(&source, &[(Arc::from("bright"), "f32")]).map(|_| ());
        let thread = std::thread::Builder::new().stack_size(super::STACK_BYTES).spawn(check).unwrap();
        let message = thread.join().unwrap().expect_err(name);
        println!("{name}: {message}");
        assert!(message.contains(expected), "{name}: {message}\nwithout {expected}");
        assert!(message.starts_with("own.wgsl"), "{name}: {message}");
    }
}
