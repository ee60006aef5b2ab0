//! Types, names, values and conversions.

use std::sync::Arc;

use glam::{Quat, Vec3, Vec4};
use umbriel_fields::{
    Changes, Color, ColorA, EnumValue, Error, Field, FieldType, Graph, Image, Kind, NodeId, NodeType, Rotation, Strength, Time,
    TypeRegistry, Value, converts,
};

use crate::support::{at, create, frame, graph, strong};

fn all_kinds() -> Graph {
    let mut node_type = NodeType::new("All", "A field of every type.");
    for kind in Kind::ALL.iter().filter(|kind| **kind != Kind::Enum) {
        node_type = node_type.field(Field::of_type(format!("{kind}_one"), FieldType::one(*kind)));
        node_type = node_type.field(Field::of_type(format!("{kind}_many"), FieldType::many(*kind)));
    }
    let node_type = node_type.field(Field::choice("choice", &["none", "map", "volume"], "map"));
    Graph::new(vec![node_type])
}

#[test]
fn every_type_keeps_its_values_exactly() {
    let mut graph = all_kinds();
    let node = graph.create("All").unwrap();
    let image = Image { width: 1, height: 1, rgba: Arc::from([1, 2, 3, 4]) };
    let values: Vec<Value> = vec![
        true.into(),
        i32::MIN.into(),
        i64::MAX.into(),
        (-0.0f32).into(),
        f64::MIN_POSITIVE.into(),
        "quote \" nul \0 \u{1F319}".into(),
        glam::Vec2::new(1.0, f32::INFINITY).into(),
        Vec3::MAX.into(),
        Vec4::ONE.into(),
        Quat::from_rotation_x(1.0).into(),
        Rotation { axis: Vec3::X, angle_rad: 2.0 }.into(),
        glam::Mat4::from_translation(Vec3::ONE).into(),
        Color(Vec3::X).into(),
        ColorA(Vec4::X).into(),
        Time(1e9).into(),
        node.into(),
        image.into(),
        vec![1.5f32, -0.0].into(),
        vec![i64::MAX, i64::MIN].into(),
        vec!["a".to_string(), String::new()].into(),
        vec![node].into(),
        Value::empty(FieldType::many(Kind::Mat4)),
    ];
    for value in values {
        let field_type = value.field_type();
        let suffix = if field_type.multiple { "many" } else { "one" };
        let field = at(&graph, node, &format!("{}_{suffix}", field_type.kind));
        graph.set(field, value.clone()).unwrap();
        assert_eq!(format!("{:?}", graph.value(field).unwrap()), format!("{value:?}"));
    }
    graph.verify_invariants().unwrap();
}

#[test]
fn multiple_values_are_shared_by_routes() {
    let mut graph = all_kinds();
    let [a, b] = create(&mut graph, "All");
    strong(&mut graph, (a, "vec3_many"), (b, "vec3_many"));
    let vertices: Arc<[Vec3]> = vec![Vec3::ONE; 1000].into();
    graph.set_named(a, "vec3_many", vertices.clone()).unwrap();
    frame(&mut graph);
    assert!(Arc::ptr_eq(&vertices, &graph.get_named(b, "vec3_many").unwrap()));
}

#[test]
fn values_convert_by_one_rule() {
    let rows: Vec<(Value, Kind, Option<Value>)> = vec![
        (true.into(), Kind::I32, Some(1i32.into())),
        (0.0f32.into(), Kind::Bool, Some(false.into())),
        (f32::NAN.into(), Kind::Bool, Some(false.into())),
        (2.9f64.into(), Kind::I32, Some(2i32.into())),
        (1e30f64.into(), Kind::I32, Some(i32::MAX.into())),
        (i64::MAX.into(), Kind::I32, Some(i32::MAX.into())),
        (1.5f64.into(), Kind::Time, Some(Time(1.5).into())),
        (Time(2.0).into(), Kind::F32, Some(2.0f32.into())),
        (Vec3::X.into(), Kind::Color, Some(Color(Vec3::X).into())),
        (Color(Vec3::X).into(), Kind::Vec3, Some(Vec3::X.into())),
        (Vec4::X.into(), Kind::ColorA, Some(ColorA(Vec4::X).into())),
        (Color(Vec3::X).into(), Kind::ColorA, Some(ColorA(Vec4::new(1.0, 0.0, 0.0, 1.0)).into())),
        (Rotation { axis: Vec3::ZERO, angle_rad: 1.0 }.into(), Kind::Quat, Some(Quat::IDENTITY.into())),
        (Quat::IDENTITY.into(), Kind::Rotation, Some(Rotation { axis: Vec3::X, angle_rad: 0.0 }.into())),
        (Quat::from_xyzw(0.0, 0.0, 0.0, 0.0).into(), Kind::Rotation, Some(Rotation::default().into())),
        (EnumValue(2).into(), Kind::I64, Some(2i64.into())),
        ("1".into(), Kind::I32, None),
        (Vec3::X.into(), Kind::Vec4, None),
        (1i32.into(), Kind::Enum, None),
        (1i32.into(), Kind::String, None),
    ];
    for (value, kind, expected) in rows {
        assert_eq!(value.convert(FieldType::one(kind)), expected, "{value:?} to {kind}");
        assert_eq!(converts(value.field_type(), FieldType::one(kind)), expected.is_some());
        assert_eq!(value.convert(FieldType::many(kind)), None, "one {value:?} to many {kind}");
        let many = Value::collect(value.field_type().kind, [value.clone(), value.clone()].into_iter()).unwrap();
        let expected = expected.map(|one| Value::collect(kind, [one.clone(), one].into_iter()).unwrap());
        assert_eq!(many.convert(FieldType::many(kind)), expected, "{many:?} to many {kind}");
    }
}

#[test]
fn what_does_not_convert_is_neither_set_nor_connected() {
    let mut graph = all_kinds();
    let [a, b] = create(&mut graph, "All");
    graph.set_name(a, "lamp").unwrap();
    for (from, to, words) in [
        ("vec3_one", "vec3_many", "one value does not become a list"),
        ("vec3_many", "vec3_one", "a list does not become one value"),
        ("string_one", "f32_one", "cannot connect `lamp.string_one` (string)"),
        ("f32_one", "choice", "do not convert"),
    ] {
        let (source, target) = (at(&graph, a, from), at(&graph, b, to));
        let error = graph.connect(source, target, Strength::Weak).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let error = graph.set_named(a, "f32_one", "text").unwrap_err().to_string();
    assert_eq!(error, "`lamp.f32_one` is of type f32; string does not convert to it");
    let error = graph.get_named::<Vec3>(a, "f32_one").unwrap_err();
    assert!(matches!(error, Error::WrongType { .. }), "{error}");
}

#[test]
fn enums_take_names_and_numbers_and_list_what_is_valid() {
    let mut graph = all_kinds();
    let node = graph.create("All").unwrap();
    let choice = at(&graph, node, "choice");
    assert_eq!(graph.get::<Arc<str>>(choice).unwrap().as_ref(), "map");
    for (value, expected) in
        [(Value::from("volume"), 2), ("None".into(), 0), (true.into(), 1), (2i32.into(), 2), (EnumValue(0).into(), 0)]
    {
        graph.set(choice, value).unwrap();
        assert_eq!(graph.get::<EnumValue>(choice).unwrap(), EnumValue(expected));
    }
    for (value, words) in [
        (Value::from("volumes"), "none, map, volume; there is no `volumes`; did you mean `volume`?"),
        (3i32.into(), "no `3`"),
        (EnumValue(9).into(), "no `9`"),
        ((-1i32).into(), "no `-1`"),
    ] {
        let error = graph.set(choice, value).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    assert_eq!(graph.get::<EnumValue>(choice).unwrap(), EnumValue(0), "a refused write changes nothing");
    assert_eq!(graph.choice(choice, "volume").unwrap(), EnumValue(2));
}

#[test]
fn enums_connect_only_to_the_same_choices() {
    let declare =
        |name: &'static str, last: &'static str| NodeType::new(name, "").field(Field::choice("mode", &["a", last], "a"));
    let mut graph = Graph::new(vec![declare("One", "b"), declare("Two", "b"), declare("Three", "c")]);
    let [one, two, three] = ["One", "Two", "Three"].map(|name| graph.create(name).unwrap());
    strong(&mut graph, (one, "mode"), (two, "mode"));
    let (from, to) = (at(&graph, one, "mode"), at(&graph, three, "mode"));
    assert!(graph.connect(from, to, Strength::Strong).unwrap_err().to_string().contains("different choices"));
}

#[test]
fn a_range_refuses_writes_and_clamps_what_routes_bring() {
    let mut graph = graph();
    let [a, b] = create(&mut graph, "Plain");
    let error = graph.set_named(a, "ranged", 6i64).unwrap_err().to_string();
    assert_eq!(error, "`ranged` of an unnamed Plain takes values from -5 to 5; 6 is outside");
    strong(&mut graph, (a, "x"), (b, "ranged"));
    graph.set_named(a, "x", 100i64).unwrap();
    frame(&mut graph);
    assert_eq!(graph.get_named::<i64>(b, "ranged").unwrap(), 5);
}

#[test]
fn ranges_hold_for_components_and_their_own_rounding() {
    let node_type = NodeType::new("Lamp", "")
        .field(Field::new("tint", Color(Vec3::ZERO)).range(0.0, 1.0))
        .field(Field::new("angle", 0.785f32).range(0.0, 0.785))
        .field(Field::many::<f32>("steps").range(0.0, 1.0));
    let mut graph = Graph::new(vec![node_type]);
    let lamp = graph.create("Lamp").unwrap();
    for (field, value, fits) in [
        ("tint", Value::from(Color(Vec3::new(0.0, 1.0, 0.5))), true),
        ("tint", Color(Vec3::new(0.0, 1.0, 1.5)).into(), false),
        ("tint", Color(Vec3::NAN).into(), false),
        ("angle", 0.785f32.into(), true),
        ("angle", f32::NAN.into(), false),
        ("steps", vec![0.0f32, 1.0].into(), true),
        ("steps", vec![0.0f32, 1.1].into(), false),
    ] {
        assert_eq!(graph.set_named(lamp, field, value.clone()).is_ok(), fits, "{field} {value:?}");
    }
}

#[test]
fn types_and_fields_are_found_in_any_spelling_and_by_alias() {
    let light =
        NodeType::new("SpotLight", "").alias("fpLightSource").field(Field::new("cut_off_angle", 0.5f32).alias("spotCone"));
    let mut graph = Graph::new(vec![light]);
    for name in ["SpotLight", "spot_light", "spotLight", "fpLightSource", "FpLightSource"] {
        let node = graph.create(name).unwrap();
        for field in ["cut_off_angle", "cutOffAngle", "CutOffAngle", "cut-off-angle", "spot_cone", "spotCone"] {
            assert_eq!(graph.get_named::<f32>(node, field).unwrap(), 0.5, "{field}");
        }
    }
    for (name, expected) in
        [("SpotLihgt", "there is no node type `SpotLihgt`; did you mean `SpotLight`?"), ("Q", "there is no node type `Q`")]
    {
        assert_eq!(graph.create(name).unwrap_err().to_string(), expected);
    }
    let node = graph.create("SpotLight").unwrap();
    let error = graph.field(node, "cutOfAngle").unwrap_err().to_string();
    assert_eq!(error, "an unnamed SpotLight has no field `cutOfAngle`; did you mean `cut_off_angle`?");
}

#[test]
fn a_registry_refuses_what_contradicts_itself() {
    let registry = TypeRegistry::new();
    registry.register(NodeType::new("Lamp", "").alias("Light")).unwrap();
    for (node_type, words) in [
        (NodeType::new("lamp", ""), "the name `lamp` belongs to `Lamp`"),
        (NodeType::new("X", "").alias("light"), "the name `light` belongs to `Lamp`"),
        (NodeType::new("", ""), "it has no name"),
        (NodeType::new("X", "").field(Field::new("aB", 0i32)).field(Field::new("a_b", 0i32)), "two fields are called `a_b`"),
        (NodeType::new("X", "").field(Field::new("", 0i32)), "a field has no name"),
        (NodeType::new("X", "").field(Field::choice("c", &["a", "b"], "z")), "none of its choices: a, b"),
        (NodeType::new("X", "").field(Field::choice("c", &["a", "b", "a"], "a")), "has the choice `a` twice"),
        (NodeType::new("X", "").field(Field::new("t", "text").range(0.0, 1.0)), "which fields of type string do not have"),
        (NodeType::new("X", "").field(Field::new("a", 0i32).range(2.0, 1.0)), "empty range"),
        (NodeType::new("X", "").field(Field::new("a", 0i32).range(1.0, 2.0)), "default 0 of field `a` is outside"),
    ] {
        let error = registry.register(node_type).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    assert_eq!(registry.iter().count(), 1);
}

#[test]
fn a_replaced_type_is_for_new_nodes_only() {
    let mut graph = Graph::new(vec![NodeType::new("Lamp", "").alias("Light").field(Field::new("old", 1i32))]);
    let old = graph.create("Lamp").unwrap();
    graph.types().replace(NodeType::new("Lamp", "").field(Field::new("new", 2i32))).unwrap();
    let new = graph.create("lamp").unwrap();
    assert_eq!((graph.get_named::<i32>(old, "old").unwrap(), graph.get_named::<i32>(new, "new").unwrap()), (1, 2));
    assert!(graph.create("Light").is_err(), "the alias went with the old type");
}

#[test]
fn names_are_unique_and_the_error_names_both() {
    let mut graph = graph();
    let [a, b] = create(&mut graph, "Plain");
    graph.set_name(a, "door").unwrap();
    graph.set_name(b, "window").unwrap();
    let error = graph.set_name(b, "door").unwrap_err().to_string();
    assert_eq!(error, "`window` (Plain) cannot be named `door`: that is `door` (Plain)");
    assert_eq!((graph.find("door"), graph.name(b)), (Some(a), Some("window")));
    graph.set_name(a, "gate").unwrap();
    graph.set_name(b, "door").unwrap();
    graph.set_name(b, "").unwrap();
    assert_eq!((graph.find("door"), graph.name(b)), (None, None));
    graph.delete(a).unwrap();
    assert_eq!(graph.find("gate"), None);
    graph.verify_invariants().unwrap();
}

#[test]
fn paths_walk_children_by_name() {
    let mut graph = graph();
    let [world, house, door] = create(&mut graph, "Plain");
    for (node, name) in [(world, "world"), (house, "house"), (door, "door")] {
        graph.set_name(node, name).unwrap();
    }
    graph.set_named(world, "children", vec![house]).unwrap();
    graph.set_named(house, "children", vec![door]).unwrap();
    for (path, expected) in [
        ("/world/house/door", Some(door)),
        ("world/house", Some(house)),
        ("/world", Some(world)),
        ("/world/door", None),
        ("/house/door", Some(door)),
        ("/world/roof", None),
        ("", None),
        ("///", None),
    ] {
        assert_eq!(graph.find_path(path), expected, "{path}");
    }
}

#[test]
fn dynamic_fields_come_and_go_with_their_routes() {
    let mut graph = graph();
    let [a, b] = create(&mut graph, "Plain");
    let extra = graph.add_field(a, Field::new("extraSpeed", 3i64)).unwrap();
    assert_eq!(graph.get_named::<i64>(a, "extra_speed").unwrap(), 3);
    assert!(matches!(graph.add_field(a, Field::new("extra_speed", 0i32)), Err(Error::DuplicateField { .. })));
    assert!(matches!(graph.add_field(a, Field::new("x", 0i32)), Err(Error::DuplicateField { .. })));
    assert!(graph.field(b, "extra_speed").is_err(), "only one node has it");
    strong(&mut graph, (a, "extra_speed"), (b, "x"));
    graph.observe(extra, 1).unwrap();
    graph.set(extra, 9i64).unwrap();
    frame(&mut graph);
    assert_eq!(graph.get_named::<i64>(b, "x").unwrap(), 9);
    assert_eq!(graph.fields_of(a).count(), graph.fields_of(b).count() + 1);
    graph.remove_field(extra).unwrap();
    assert_eq!((graph.routes().count(), graph.field_revision(extra)), (0, 0));
    assert!(matches!(graph.value(extra), Err(Error::DeadField { .. })));
    let x = at(&graph, a, "x");
    assert!(matches!(graph.remove_field(x), Err(Error::NotDynamic { .. })));
    frame(&mut graph);
}

#[test]
fn dead_ids_are_errors_not_other_nodes() {
    let mut graph = graph();
    let [node] = create(&mut graph, "Plain");
    let field = at(&graph, node, "x");
    graph.delete(node).unwrap();
    let [other] = create(&mut graph, "Plain");
    assert_ne!(node, other);
    assert!(!graph.contains(node));
    assert_eq!(graph.get::<i64>(field), Err(Error::DeadNode));
    assert_eq!(graph.set(field, 1i64), Err(Error::DeadNode));
    assert_eq!(graph.touch(field), Err(Error::DeadNode));
    assert_eq!(graph.delete(node), Err(Error::DeadNode));
    assert_eq!(graph.connect(field, field, Strength::Weak), Err(Error::DeadNode));
    assert_eq!((graph.node_revision(node), graph.field_revision(field), graph.name(node)), (0, 0, None));
    assert_eq!(&*graph.type_of(node).name, "(deleted)");
    assert_eq!(graph.fields_of(NodeId::default()).count(), 0);
}

#[test]
fn changes_are_exact_for_any_revision() {
    let mut graph = graph();
    let [a, b, c] = create(&mut graph, "Plain");
    let mut marks = vec![graph.revision()];
    for node in [a, b, a, c, a] {
        let x = graph.get_named::<i64>(node, "x").unwrap();
        graph.set_named(node, "x", x + 1).unwrap();
        marks.push(graph.node_revision(node));
    }
    for (mark, mut expected) in marks.into_iter().zip([vec![a, b, c], vec![a, b, c], vec![a, c], vec![a, c], vec![a], vec![]]) {
        let Changes::Nodes(mut found) = graph.changes_since(mark) else { panic!("the log is short") };
        found.sort();
        expected.sort();
        assert_eq!(found, expected, "since {mark}");
    }
    let before = graph.revision();
    graph.delete(b).unwrap();
    let [d] = create(&mut graph, "Plain");
    let Changes::Nodes(mut found) = graph.changes_since(before) else { panic!("the log is short") };
    found.sort();
    let mut expected = vec![b, d];
    expected.sort();
    assert_eq!(found, expected, "the dead and the new one in its place");
}

#[test]
fn a_very_old_revision_answers_all_and_the_log_stays_bounded() {
    let mut graph = graph();
    let [a, b] = create(&mut graph, "Plain");
    let start = graph.revision();
    let (x, y) = (at(&graph, a, "x"), at(&graph, b, "x"));
    for number in 0..200_000i64 {
        graph.revision();
        graph.set(x, number + 1).unwrap();
    }
    graph.verify_invariants().unwrap();
    let late = graph.revision();
    graph.set(y, 1i64).unwrap();
    assert_eq!(graph.changes_since(start), Changes::All);
    assert_eq!(graph.changes_since(late), Changes::Nodes(vec![b]));
    for _ in 0..200_000 {
        let node = graph.create("Plain").unwrap();
        graph.delete(node).unwrap();
    }
    graph.verify_invariants().unwrap();
    assert_eq!(graph.changes_since(late), Changes::All);
}
