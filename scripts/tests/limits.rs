//! No script can hang or exhaust the process (R3): each of these ends with a message, in bounded time.

use std::time::{Duration, Instant};

use umbriel_scripts::{Limits, Settings, World};

fn tight() -> Limits {
    Limits {
        main: Duration::from_millis(3000),
        handler: Duration::from_millis(3000),
        memory: 16 << 20,
        nodes: 2000,
        field_memory: 1 << 20,
        handlers: 100,
        text: 100_000,
        ..Limits::default()
    }
}

#[test]
fn everything_ends() {
    let deep = |open: &str, close: &str| format!("let x = {}1{};", open.repeat(20_000), close.repeat(20_000));
    let rows: Vec<(String, &str)> = vec![
        ("loop { }".into(), "longer than 3000 ms"),
        ("let x = 0; while true { x += 1; }".into(), "longer than"),
        ("each(1000, |i| each(1000, |j| each(1000, |k| k)))".into(), ""),
        ("fn f(x) { f(x + 1) + 1 } f(0);".into(), "too deeply"),
        ("fn f(x) { g(|y| f(y), x) } fn g(h, x) { h.call(x) } f(0);".into(), "too deeply"),
        ("let f = (); f = |x| f.call(x + 1); f.call(0);".into(), ""),
        ("let a = [1]; loop { a += a; }".into(), "array"),
        ("let a = []; loop { a.push(a); }".into(), ""),
        ("let a = []; loop { a = [a]; }".into(), ""),
        ("let m = #{}; loop { m = #{ m: m }; }".into(), ""),
        ("let f = || 1; loop { let g = f; f = || g.call(); }".into(), ""),
        ("let s = \"x\"; loop { s += s; }".into(), "string"),
        ("let s = \"x\"; s.pad(1000000000, 'x');".into(), "string"),
        ("let a = []; a.pad(1000000000, 0);".into(), "array"),
        ("let m = #{}; let i = 0; loop { m[i.to_string()] = i; i += 1; }".into(), "need more than 16 MB"),
        (
            "let m = #{}; let s = \"x\"; s.pad(900000, 'y'); let i = 0; loop { m[i.to_string()] = s + i; i += 1; }".into(),
            "need more than 16 MB",
        ),
        (
            "let m = #{}; let a = []; a.pad(900000, 0); let i = 0; loop { m[i.to_string()] = a; i += 1; }".into(),
            "need more than 16 MB",
        ),
        (
            "fn grow(m, n) { let i = 0; loop { m[i.to_string()] = n; i += 1; if i > 100000 { grow(m, n + 1); } } } grow(#{}, 0);"
                .into(),
            "",
        ),
        ("each(100000000, |i| i);".into(), "elements"),
        ("grid(1000000, 1000000, |u, v| u);".into(), "elements"),
        ("grid(9223372036854775807, 9223372036854775807, |u, v| u);".into(), "elements"),
        ("loop { make(\"Group\"); }".into(), "2000 nodes"),
        ("let a = []; a.pad(10000, vec3(1)); loop { make(\"Mesh\", #{ position: a }); }".into(), "arrays in the fields"),
        ("loop { on_frame(|| 1); }".into(), "handlers"),
        ("let a = []; a.pad(500000, 1); loop { a.sort(|x, y| y - x); }".into(), "longer than"),
        (deep("(", ")"), ""),
        (deep("[", "]"), ""),
        (deep("-", ""), ""),
        (format!("let x = 1{};", " + 1".repeat(20_000)), ""),
        ("{".repeat(20_000), ""),
        ("let x = 1;\n".repeat(20_000), "bytes"),
        ("\"".into(), "Syntax"),
        ("/*".into(), ""),
        ("\u{0}".into(), "Syntax"),
    ];
    for (script, piece) in rows {
        let start = Instant::now();
        let settings = Settings { limits: tight(), ..Settings::default() };
        let result = World::load_source_with("test", &script, settings).map(drop);
        let short: String = script.chars().take(100).collect();
        let took = start.elapsed();
        match result {
            Ok(()) => assert!(piece.is_empty(), "{short}: no error"),
            Err(error) => assert!(error.to_string().contains(piece), "{short}\nsays {error}"),
        }
        assert!(took < Duration::from_secs(10), "{short}: took {took:?}");
    }
}

/// What a handler gathers from frame to frame is bounded too.
#[test]
fn handlers_cannot_gather_without_end() {
    let script = "let m = #{}; let i = 0; on_frame(|| { for k in 0..5000 { m[i.to_string()] = i; i += 1; } });";
    let mut world = World::load_source_with("test", script, Settings { limits: tight(), ..Settings::default() }).expect(script);
    let mut frames = 0;
    let problems = loop {
        world.step(f64::from(frames));
        frames += 1;
        let problems = crate::support::problems(&mut world);
        if !problems.is_empty() || frames > 1000 {
            break problems;
        }
    };
    assert!(problems.iter().any(|p| p.contains("16 MB")), "{problems:?} after {frames} frames");
}
