//! Values of fields as values of scripts, and back. Fields decide: what a script gives is converted to the field's type.

use std::sync::Arc;

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use rhai::{Array, Dynamic, ImmutableString};
use umbriel_fields::{Color, ColorA, FieldType, Image, Kind, NodeId, Rotation, Time, Value};

use crate::stage::Node;

/// A multiple value without elements; an empty array does not say of what.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EmptyList(pub(crate) Kind);

/// The picture of a field, which scripts only hand on.
#[derive(Clone, Debug)]
pub(crate) struct Picture(pub(crate) Arc<Image>);

/// The value for a field of the type, or what was expected and what was found.
pub(crate) fn to_value(given: &Dynamic, wanted: FieldType) -> Result<Value, String> {
    let mismatch = |found: &Dynamic| Err(format!("expected {}, found {}", described(wanted), show(found)));
    if !wanted.multiple {
        return match element(given, wanted.kind) {
            Some(Ok(value)) => Ok(value),
            Some(Err(why)) => Err(why),
            None => mismatch(given),
        };
    }
    if let Some(list) = given.read_lock::<EmptyList>() {
        return if list.0 == wanted.kind { Ok(Value::empty(wanted)) } else { mismatch(given) };
    }
    if let Some(node) = cast::<Node>(given).filter(|_| wanted.kind == Kind::Node) {
        return Ok(Value::from([node.0]));
    }
    let Some(array) = given.read_lock::<Array>() else { return mismatch(given) };
    let mut elements = Vec::with_capacity(array.len());
    for (index, item) in array.iter().enumerate() {
        match element(item, wanted.kind) {
            Some(Ok(value)) => elements.push(value),
            Some(Err(why)) => return Err(format!("element {index}: {why}")),
            None => return Err(format!("expected {}, found {} as element {index}", described(wanted), show(item))),
        }
    }
    Value::collect(wanted.kind, elements.into_iter()).ok_or_else(|| format!("expected {}", described(wanted)))
}

/// One element; None if the given value has nothing to do with the kind.
fn element(given: &Dynamic, kind: Kind) -> Option<Result<Value, String>> {
    if let Some(why) = too_large(given, kind) {
        return Some(Err(why));
    }
    let value = match kind {
        Kind::Bool => Value::Bool(given.as_bool().ok().or_else(|| given.as_int().ok().map(|i| i != 0))?),
        Kind::I32 => match i32::try_from(whole(given)?) {
            Ok(int) => Value::I32(int),
            Err(_) => return Some(Err(format!("{given} does not fit into 32 bits"))),
        },
        Kind::I64 => Value::I64(whole(given)?),
        Kind::F32 => match single(number(given)?) {
            Ok(float) => Value::F32(float),
            Err(why) => return Some(Err(why)),
        },
        Kind::F64 => Value::F64(number(given)?),
        Kind::Time => Value::Time(Time(number(given)?)),
        Kind::String => Value::String(Arc::from(text(given)?.as_str())),
        Kind::Enum => Value::String(Arc::from(text(given)?.as_str())),
        Kind::Vec2 => Value::Vec2(cast(given).or_else(|| floats(given).map(Vec2::from))?),
        Kind::Vec3 => Value::Vec3(vec3(given)?),
        Kind::Vec4 => Value::Vec4(vec4(given)?),
        Kind::Quat => Value::Quat(quat(given)?),
        Kind::Rotation => Value::Rotation(cast(given).or_else(|| cast::<Quat>(given).map(Rotation::from))?),
        Kind::Mat4 => Value::Mat4(cast::<Mat4>(given)?),
        Kind::Color => Value::Color(Color(vec3(given).or_else(|| hex(given))?)),
        Kind::ColorA => Value::ColorA(ColorA(vec4(given).or_else(|| Some(vec3(given).or_else(|| hex(given))?.extend(1.0)))?)),
        Kind::Node if given.is_unit() => Value::Node(None),
        Kind::Node => Value::Node(Some(cast::<Node>(given)?.0)),
        Kind::Image if given.is_unit() => Value::Image(None),
        Kind::Image => Value::Image(Some(cast::<Picture>(given)?.0)),
    };
    Some(Ok(value))
}

fn cast<T: rhai::Variant + Clone>(given: &Dynamic) -> Option<T> {
    given.read_lock::<T>().map(|value| value.clone())
}

fn text(given: &Dynamic) -> Option<ImmutableString> {
    cast::<ImmutableString>(given).or_else(|| given.as_char().ok().map(|c| ImmutableString::from(c.to_string())))
}

/// A number of either kind.
pub(crate) fn number(given: &Dynamic) -> Option<f64> {
    given.as_float().ok().or_else(|| given.as_int().ok().map(|i| i as f64))
}

fn whole(given: &Dynamic) -> Option<i64> {
    let exact = |f: f64| (f.fract() == 0.0 && f.abs() < 9.0e15).then_some(f as i64);
    given.as_int().ok().or_else(|| exact(given.as_float().ok()?)).or_else(|| given.as_bool().ok().map(i64::from))
}

/// The number in single precision; one that is too large for it is refused.
pub(crate) fn single(number: f64) -> Result<f32, String> {
    let float = number as f32;
    match number.is_finite() && !float.is_finite() {
        true => Err(format!("{number:e} is too large for a number of single precision")),
        false => Ok(float),
    }
}

/// The number that a script shows for a single: 0.1, not 0.10000000149011612. Gives the same single when written back.
pub(crate) fn shown(single: f32) -> f64 {
    match single.fract() == 0.0 || !single.is_finite() {
        true => f64::from(single),
        false => single.to_string().parse().unwrap_or(f64::from(single)),
    }
}

/// Why an array of numbers cannot be a vector or a colour, though it looks like one.
fn too_large(given: &Dynamic, kind: Kind) -> Option<String> {
    let array = given.read_lock::<Array>()?;
    let of_singles = matches!(kind, Kind::Vec2 | Kind::Vec3 | Kind::Vec4 | Kind::Color | Kind::ColorA);
    array.iter().filter(|_| of_singles).filter_map(number).find_map(|number| single(number).err())
}

fn floats<const N: usize>(given: &Dynamic) -> Option<[f32; N]> {
    let array = given.read_lock::<Array>()?;
    let numbers: Vec<f32> = array.iter().map(|n| number(n).map(|n| n as f32)).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

fn vec3(given: &Dynamic) -> Option<Vec3> {
    cast(given).or_else(|| cast::<Color>(given).map(|c| c.0)).or_else(|| floats(given).map(Vec3::from))
}

fn vec4(given: &Dynamic) -> Option<Vec4> {
    cast(given).or_else(|| cast::<ColorA>(given).map(|c| c.0)).or_else(|| floats(given).map(Vec4::from))
}

fn quat(given: &Dynamic) -> Option<Quat> {
    cast(given).or_else(|| cast::<Rotation>(given).map(Quat::from))
}

fn hex(given: &Dynamic) -> Option<Vec3> {
    parse_hex(&cast::<ImmutableString>(given)?)
}

/// A colour as web pages write it, `#rgb` or `#rrggbb` in sRGB, made linear.
pub(crate) fn parse_hex(text: &str) -> Option<Vec3> {
    let digits = text.strip_prefix('#').filter(|d| d.bytes().all(|b| b.is_ascii_hexdigit()))?;
    let channel = |i: usize| -> Option<f32> {
        let byte = match digits.len() {
            3 => 17 * u8::from_str_radix(digits.get(i..=i)?, 16).ok()?,
            6 => u8::from_str_radix(digits.get(2 * i..2 * i + 2)?, 16).ok()?,
            _ => return None,
        };
        let srgb = f32::from(byte) / 255.0;
        Some(if srgb <= 0.04045 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) })
    };
    Some(Vec3::new(channel(0)?, channel(1)?, channel(2)?))
}

/// The value of a field as a script sees it; `choice` names the value of an enum.
pub(crate) fn to_dynamic(value: &Value, choice: &dyn Fn(u16) -> String) -> Dynamic {
    match value {
        Value::Bool(v) => (*v).into(),
        Value::I32(v) => i64::from(*v).into(),
        Value::I64(v) => (*v).into(),
        Value::F32(v) => shown(*v).into(),
        Value::F64(v) => (*v).into(),
        Value::Time(v) => v.0.into(),
        Value::String(v) => v.to_string().into(),
        Value::Enum(v) => choice(v.0).into(),
        Value::Vec2(v) => Dynamic::from(*v),
        Value::Vec3(v) => Dynamic::from(*v),
        Value::Vec4(v) => Dynamic::from(*v),
        Value::Quat(v) => Dynamic::from(*v),
        Value::Rotation(v) => Dynamic::from(*v),
        Value::Mat4(v) => Dynamic::from(*v),
        Value::Color(v) => Dynamic::from(*v),
        Value::ColorA(v) => Dynamic::from(*v),
        Value::Node(v) => node_or_unit(*v),
        Value::Image(v) => v.clone().map_or(Dynamic::UNIT, |image| Dynamic::from(Picture(image))),
        many => (0..many.len()).filter_map(|i| many.element(i)).map(|one| to_dynamic(&one, choice)).collect::<Array>().into(),
    }
}

/// A node, or `()` for none.
pub(crate) fn node_or_unit(id: Option<NodeId>) -> Dynamic {
    id.map_or(Dynamic::UNIT, |id| Dynamic::from(Node(id)))
}

/// The default of a field that a script declares by a value: the type that keeps the value exactly.
pub(crate) fn natural(given: &Dynamic) -> Result<Value, String> {
    if let Some(list) = given.read_lock::<EmptyList>() {
        return Ok(Value::empty(FieldType::many(list.0)));
    }
    if let Some(array) = given.read_lock::<Array>() {
        let Some(first) = array.first() else {
            return Err("an empty array does not say of what: give list(\"vec3\") or the like".into());
        };
        let floats = array.iter().any(Dynamic::is_float);
        let kind = natural_kind(first).map(|kind| if kind == Kind::I64 && floats { Kind::F64 } else { kind });
        let kind = kind.ok_or_else(|| format!("a field cannot hold {}", show(first)))?;
        return to_value(given, FieldType::many(kind));
    }
    let kind = natural_kind(given).ok_or_else(|| format!("a field cannot hold {}", show(given)))?;
    to_value(given, FieldType::one(kind))
}

fn natural_kind(given: &Dynamic) -> Option<Kind> {
    let kinds: [(Kind, bool); 13] = [
        (Kind::Bool, given.is_bool()),
        (Kind::I64, given.is_int()),
        (Kind::F64, given.is_float()),
        (Kind::String, given.is_string() || given.is_char()),
        (Kind::Vec2, given.is::<Vec2>()),
        (Kind::Vec3, given.is::<Vec3>()),
        (Kind::Vec4, given.is::<Vec4>()),
        (Kind::Quat, given.is::<Quat>()),
        (Kind::Rotation, given.is::<Rotation>()),
        (Kind::Mat4, given.is::<Mat4>()),
        (Kind::Color, given.is::<Color>()),
        (Kind::ColorA, given.is::<ColorA>()),
        (Kind::Node, given.is::<Node>() || given.is_unit()),
    ];
    kinds.into_iter().find_map(|(kind, fits)| fits.then_some(kind))
}

fn described(wanted: FieldType) -> String {
    let word = match wanted.kind {
        Kind::F32 | Kind::F64 => "number",
        Kind::I32 | Kind::I64 => "whole number",
        Kind::Time => "number of seconds",
        Kind::Node => "node",
        Kind::Enum => "name of a choice",
        kind => kind.name(),
    };
    if wanted.multiple { format!("an array of {word}") } else { format!("{} {word}", article(word)) }
}

fn article(word: &str) -> &'static str {
    if word.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" }
}

/// A value of a script with the name of its type, for messages.
pub(crate) fn show(given: &Dynamic) -> String {
    let short =
        |text: String| if text.chars().count() > 40 { format!("{}...", text.chars().take(37).collect::<String>()) } else { text };
    if let Some(text) = given.read_lock::<ImmutableString>() {
        return short(format!("string {:?}", text.as_str()));
    }
    if let Some(array) = given.read_lock::<Array>() {
        return format!("an array of {}", array.len());
    }
    match given.type_name() {
        "i64" => format!("whole number {given}"),
        "f64" => format!("number {given}"),
        "()" => "nothing".into(),
        "bool" => format!("bool {given}"),
        "map" => "a map".into(),
        "Fn" => "a function".into(),
        _ => type_word(given).into(),
    }
}

fn type_word(given: &Dynamic) -> &'static str {
    match natural_kind(given) {
        Some(Kind::Node) => "a node",
        Some(kind) => kind.name(),
        None => "a value of another type",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn singles_are_shown_short_and_come_back_exactly() {
        for single in [0.1f32, 1.0 / 3.0, f32::MIN_POSITIVE, f32::MAX, -0.0, 1e-40, 16_777_217.0, f32::INFINITY] {
            assert_eq!((shown(single) as f32).to_bits(), single.to_bits(), "{single}");
        }
        assert_eq!(shown(0.1), 0.1);
    }

    #[test]
    fn hex_colours() {
        assert_eq!(parse_hex("#fff"), Some(Vec3::ONE));
        assert_eq!(parse_hex("#ff0000"), Some(Vec3::X));
        assert!(parse_hex("#808080").is_some_and(|c| (c.x - 0.2158605).abs() < 1e-6));
        for wrong in ["fff", "#ff", "#gggggg", "#ffffffff", "#é9"] {
            assert_eq!(parse_hex(wrong), None, "{wrong}");
        }
    }
}
