//! Vectors, turns, matrices and colours.

use glam::{EulerRot, Mat3, Mat4, Quat, Vec2, Vec3, Vec4};
use rhai::{Dynamic, ImmutableString};
use umbriel_fields::{Color, ColorA, Rotation};

use super::Words;
use crate::error::{Outcome, fail};
use crate::values::{number, parse_hex, show, shown, single};

/// Operators and components of one vector type.
macro_rules! vectors {
    ($words:ident, $type:ident $name:literal $($component:ident)+) => {{
        $words.engine.register_type_with_name::<$type>($name);
        $(
            $words.engine.register_get(stringify!($component), |v: &mut $type| shown(v.$component));
            let write = |v: &mut $type, given: Dynamic| -> Outcome<()> { Ok(v.$component = component(&given)?) };
            $words.engine.register_set(stringify!($component), write);
        )+
        $words.form("+", |a: $type, b: $type| a + b).form("-", |a: $type, b: $type| a - b);
        $words.form("*", |a: $type, b: $type| a * b).form("/", |a: $type, b: $type| a / b);
        $words.form("*", |a: $type, b: f64| a * b as f32).form("*", |a: f64, b: $type| b * a as f32);
        $words.form("*", |a: $type, b: i64| a * b as f32).form("*", |a: i64, b: $type| b * a as f32);
        $words.form("/", |a: $type, b: f64| a / b as f32).form("/", |a: $type, b: i64| a / b as f32);
        $words.form("-", |a: $type| -a).form("+", |a: $type| a);
        $words.form("==", |a: $type, b: $type| a == b).form("!=", |a: $type, b: $type| a != b);
        $words.form("dot", |a: $type, b: $type| shown(a.dot(b)));
        $words.form("length", |a: $type| shown(a.length())).form("distance", |a: $type, b: $type| shown(a.distance(b)));
        $words.form("normalize", |a: $type| a.normalize_or_zero());
        $words.form("min", |a: $type, b: $type| a.min(b)).form("max", |a: $type, b: $type| a.max(b)).form("abs", |a: $type| a.abs());
        $words.form("mix", |a: $type, b: $type, t: Dynamic| -> Outcome<$type> { Ok(a.lerp(b, component(&t)?)) });
        $words.form("lerp", |a: $type, b: $type, t: Dynamic| -> Outcome<$type> { Ok(a.lerp(b, component(&t)?)) });
        $words.form("to_string", |v: &mut $type| format!(concat!($name, "({})"), list(&v.to_array())));
        $words.form("to_debug", |v: &mut $type| format!(concat!($name, "({})"), list(&v.to_array())));
    }};
}
pub(super) fn teach(words: &mut Words<'_>) {
    make_vectors(words);
    make_turns(words);
    make_colors(words);
    vectors!(words, Vec2 "vec2" x y);
    vectors!(words, Vec3 "vec3" x y z);
    vectors!(words, Vec4 "vec4" x y z w);
    geometry(words);
    turns(words);
    matrices(words);
    colors(words);
}

/// A number of either kind in single precision.
pub(super) fn component(given: &Dynamic) -> Outcome<f32> {
    match number(given).map(single) {
        Some(Ok(number)) => Ok(number),
        Some(Err(why)) => fail(why),
        None => fail(format!("expected a number, found {}", show(given))),
    }
}

/// Numbers as a script shows them: `1`, `0.25`.
fn list(components: &[f32]) -> String {
    components.iter().map(|c| shown(*c).to_string()).collect::<Vec<_>>().join(", ")
}

fn make_vectors(words: &mut Words<'_>) {
    words.word("vec2(x: number, y: number) -> vec2", "Two numbers.", |x: Dynamic, y: Dynamic| -> Outcome<Vec2> {
        Ok(Vec2::new(component(&x)?, component(&y)?))
    });
    words.word(
        "vec3(x: number, y: number, z: number) -> vec3",
        "Three numbers: right, up, back.",
        |x: Dynamic, y: Dynamic, z: Dynamic| Ok(Vec3::new(component(&x)?, component(&y)?, component(&z)?)) as Outcome<Vec3>,
    );
    words.word("vec3(all: number) -> vec3", "Three times the same number.", |all: Dynamic| -> Outcome<Vec3> {
        Ok(Vec3::splat(component(&all)?))
    });
    words.word(
        "vec4(x: number, y: number, z: number, w: number) -> vec4",
        "Four numbers.",
        |x: Dynamic, y: Dynamic, z: Dynamic, w: Dynamic| -> Outcome<Vec4> {
            Ok(Vec4::new(component(&x)?, component(&y)?, component(&z)?, component(&w)?))
        },
    );
    words.form("vec4(xyz, w)", |xyz: Vec3, w: Dynamic| -> Outcome<Vec4> { Ok(xyz.extend(component(&w)?)) });
}

fn make_turns(words: &mut Words<'_>) {
    words.engine.register_type_with_name::<Quat>("quat");
    words.engine.register_type_with_name::<Rotation>("rotation");
    words.word(
        "axis_angle(axis: vec3, angle: number) -> quat",
        "A turn about an axis, in radians: `axis_angle(vec3(0, 1, 0), deg(90))`.",
        |axis: Vec3, angle: Dynamic| -> Outcome<Quat> { Ok(Rotation { axis, angle_rad: component(&angle)? }.into()) },
    );
    words.word(
        "rotation(axis: vec3, angle: number) -> rotation",
        "The same, kept as axis and angle.",
        |axis: Vec3, angle: Dynamic| Ok(Rotation { axis, angle_rad: component(&angle)? }) as Outcome<Rotation>,
    );
    words.word(
        "euler(x: number, y: number, z: number) -> quat",
        "A turn as a head makes it, in radians: first y (to the left), then x (up), then z (roll).",
        |x: Dynamic, y: Dynamic, z: Dynamic| -> Outcome<Quat> {
            Ok(Quat::from_euler(EulerRot::YXZ, component(&y)?, component(&x)?, component(&z)?))
        },
    );
    words.word(
        "quat(x: number, y: number, z: number, w: number) -> quat",
        "A turn as a quaternion; it is made one long.",
        |x: Dynamic, y: Dynamic, z: Dynamic, w: Dynamic| -> Outcome<Quat> {
            let quat = Quat::from_xyzw(component(&x)?, component(&y)?, component(&z)?, component(&w)?);
            if quat.length_squared() > 0.0 && quat.is_finite() {
                Ok(quat.normalize())
            } else {
                fail("a quaternion cannot be zero")
            }
        },
    );
    words.word(
        "look(from: vec3, to: vec3) -> quat",
        "The turn of a viewpoint at `from` that looks to `to`, upright.",
        |from: Vec3, to: Vec3| -> Quat { looking(to - from) },
    );
    words.word("deg(degrees: number) -> number", "Degrees as radians.", |degrees: Dynamic| -> Outcome<f64> {
        Ok(f64::from(component(&degrees)?).to_radians())
    });
}

/// The upright turn of -z into a direction; straight up and down keep x.
fn looking(direction: Vec3) -> Quat {
    let Some(back) = (-direction).try_normalize() else { return Quat::IDENTITY };
    let right = Vec3::Y.cross(back).try_normalize().unwrap_or(Vec3::X);
    Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back))
}

fn make_colors(words: &mut Words<'_>) {
    words.engine.register_type_with_name::<Color>("color");
    words.engine.register_type_with_name::<ColorA>("color_a");
    words.word("color(red: number, green: number, blue: number) -> color", "A linear colour; 1 is white.", {
        |r: Dynamic, g: Dynamic, b: Dynamic| -> Outcome<Color> {
            Ok(Color(Vec3::new(component(&r)?, component(&g)?, component(&b)?)))
        }
    });
    words.form("color(r, g, b, a)", |r: Dynamic, g: Dynamic, b: Dynamic, a: Dynamic| -> Outcome<ColorA> {
        Ok(ColorA(Vec4::new(component(&r)?, component(&g)?, component(&b)?, component(&a)?)))
    });
    words.word(
        "color(hex: string) -> color",
        "A colour as web pages write it, `\"#ff8800\"`, made linear.",
        |hex: &str| -> Outcome<Color> {
            match parse_hex(hex) {
                Some(color) => Ok(Color(color)),
                None => fail(format!("\"{hex}\" is no colour; write it as \"#ff8800\"")),
            }
        },
    );
    words.word("gray(value: number) -> color", "A colour without hue.", |value: Dynamic| -> Outcome<Color> {
        Ok(Color(Vec3::splat(component(&value)?)))
    });
}

fn geometry(words: &mut Words<'_>) {
    words.word("cross(a: vec3, b: vec3) -> vec3", "The vector at right angles to both.", |a: Vec3, b: Vec3| a.cross(b));
    words.word("dot(a: vec, b: vec) -> number", "The sum of the products.", |a: Quat, b: Quat| shown(a.dot(b)));
    words.word("length(v: vec) -> number", "How long a vector is.", |q: Quat| shown(q.length()));
    words.word("normalize(v: vec) -> vec", "The same direction, one long; zero stays zero.", |q: Quat| q.normalize());
    words.word("distance(a: vec, b: vec) -> number", "How far apart two points are.", |a: Color, b: Color| {
        shown(a.0.distance(b.0))
    });
}

fn turns(words: &mut Words<'_>) {
    words.form("*", |a: Quat, b: Quat| a * b).form("*", |q: Quat, v: Vec3| q * v);
    words.form("==", |a: Quat, b: Quat| a == b).form("!=", |a: Quat, b: Quat| a != b);
    words.word("inverse(turn: quat) -> quat", "The turn back.", |q: Quat| q.inverse());
    words.form("mix", |a: Quat, b: Quat, t: Dynamic| -> Outcome<Quat> { Ok(a.slerp(b, component(&t)?)) });
    words.form("lerp", |a: Quat, b: Quat, t: Dynamic| -> Outcome<Quat> { Ok(a.slerp(b, component(&t)?)) });
    words.engine.register_get("axis", |q: &mut Quat| Rotation::from(*q).axis);
    words.engine.register_get("angle", |q: &mut Quat| shown(Rotation::from(*q).angle_rad));
    words.engine.register_get("axis", |r: &mut Rotation| r.axis);
    words.engine.register_get("angle", |r: &mut Rotation| shown(r.angle_rad));
    for (index, name) in ["x", "y", "z", "w"].into_iter().enumerate() {
        words.engine.register_get(name, move |q: &mut Quat| shown(q.to_array()[index]));
    }
    words.form("to_string", |q: &mut Quat| format!("quat({})", list(&q.to_array())));
    words.form("to_debug", |q: &mut Quat| format!("quat({})", list(&q.to_array())));
    let text = |r: &mut Rotation| format!("rotation(vec3({}), {})", list(&r.axis.to_array()), shown(r.angle_rad));
    words.form("to_string", text).form("to_debug", text);
    words.form("==", |a: Rotation, b: Rotation| a == b).form("!=", |a: Rotation, b: Rotation| a != b);
}

fn matrices(words: &mut Words<'_>) {
    words.engine.register_type_with_name::<Mat4>("mat4");
    words.word("mat4() -> mat4", "The matrix that changes nothing.", || Mat4::IDENTITY);
    words.word("mat4(translation: vec3, rotation: quat, scale: vec3) -> mat4", "First scales, then turns, then moves.", {
        |translation: Vec3, rotation: Quat, scale: Vec3| Mat4::from_scale_rotation_translation(scale, rotation, translation)
    });
    words.form("*", |a: Mat4, b: Mat4| a * b).form("*", |m: Mat4, v: Vec4| m * v);
    words.form("*", |m: Mat4, point: Vec3| m.project_point3(point));
    words.form("==", |a: Mat4, b: Mat4| a == b).form("!=", |a: Mat4, b: Mat4| a != b);
    words.form("inverse", |m: Mat4| -> Outcome<Mat4> {
        if m.determinant() == 0.0 { fail("the matrix is flat and has no inverse") } else { Ok(m.inverse()) }
    });
    words.form("to_string", |m: &mut Mat4| format!("mat4({})", list(&m.to_cols_array())));
    words.form("to_debug", |m: &mut Mat4| format!("mat4({})", list(&m.to_cols_array())));
}

fn colors(words: &mut Words<'_>) {
    for (index, name) in ["red", "green", "blue"].into_iter().enumerate() {
        words.engine.register_get(name, move |c: &mut Color| shown(c.0[index]));
        words.engine.register_get(name, move |c: &mut ColorA| shown(c.0[index]));
    }
    words.engine.register_get("alpha", |c: &mut ColorA| shown(c.0.w));
    words.form("*", |c: Color, f: f64| Color(c.0 * f as f32)).form("*", |f: f64, c: Color| Color(c.0 * f as f32));
    words.form("*", |c: Color, f: i64| Color(c.0 * f as f32)).form("*", |a: Color, b: Color| Color(a.0 * b.0));
    words.form("+", |a: Color, b: Color| Color(a.0 + b.0));
    words.form("==", |a: Color, b: Color| a == b).form("!=", |a: Color, b: Color| a != b);
    words.form("==", |a: ColorA, b: ColorA| a == b).form("!=", |a: ColorA, b: ColorA| a != b);
    words.form("mix", |a: Color, b: Color, t: Dynamic| -> Outcome<Color> { Ok(Color(a.0.lerp(b.0, component(&t)?))) });
    words.form("lerp", |a: Color, b: Color, t: Dynamic| -> Outcome<Color> { Ok(Color(a.0.lerp(b.0, component(&t)?))) });
    words.form("to_string", |c: &mut Color| format!("color({})", list(&c.0.to_array())));
    words.form("to_debug", |c: &mut Color| format!("color({})", list(&c.0.to_array())));
    let text = |c: &mut ColorA| ImmutableString::from(format!("color({})", list(&c.0.to_array())));
    words.form("to_string", text).form("to_debug", text);
}
