//! Types with a field of every kind, and what makes two graphs the same.

use umbriel_fields::{Field, FieldType, Graph, Kind, NodeId, NodeType, SetRule, Strength, Value, builtin_types};

pub(crate) const CHOICES: [&str; 3] = ["none", "shadow map", "Volume"];

/// One of each kind single and multiple, nodes that evaluate themselves, and one that a script would.
pub(crate) fn types() -> Vec<NodeType> {
    let mut all = NodeType::new("All", "A field of every type.").alias("Everything");
    for kind in Kind::ALL.iter().filter(|kind| **kind != Kind::Enum) {
        all = all.field(Field::of_type(format!("{kind}_one"), FieldType::one(*kind)));
        all = all.field(Field::of_type(format!("{kind}_many"), FieldType::many(*kind)));
    }
    let mut many = Field::choice("enum_many", &CHOICES, "none");
    (many.field_type, many.default) = (FieldType::many(Kind::Enum), Value::empty(FieldType::many(Kind::Enum)));
    let all = all.field(Field::choice("enum_one", &CHOICES, "shadow map")).field(many).field(Field::nodes("children"));
    let sum = NodeType::new("Adder", "Adds.")
        .field(Field::new("a", 0.0f64))
        .field(Field::new("b", 0.0f64).on_set(SetRule::Pulse))
        .field(Field::new("count", 0i64).output())
        .field(Field::new("sum", 0.0f64).output())
        .evaluate(|evaluation| {
            let (a, b): (f64, f64) = (evaluation.get(0), evaluation.get(1));
            let count: i64 = evaluation.get(2);
            evaluation.set(2, count.wrapping_add(1));
            evaluation.set(3, a + b);
        });
    let script = NodeType::new("Script", "The host evaluates it.")
        .field(Field::new("in", 0.0f64).range(-1e9, 1e9))
        .field(Field::new("out", 0.0f64))
        .host_evaluated();
    let mut types = builtin_types();
    types.extend([all, sum, script]);
    types
}

/// Node references as places in the order of creation, the rest as it prints; NaN prints as NaN whatever its payload.
fn shown(order: &[NodeId], field: &Field, value: &Value) -> String {
    let place = |node: &Option<NodeId>| node.and_then(|node| order.iter().position(|other| *other == node));
    match value {
        Value::Node(node) => format!("{:?}", place(node)),
        Value::Nodes(nodes) => format!("{:?}", nodes.iter().map(place).collect::<Vec<_>>()),
        Value::Image(Some(image)) => format!("{} x {}: {:?}", image.width, image.height, image.rgba),
        Value::Images(images) => {
            let one = |image: &Option<_>| shown(order, field, &Value::Image(image.clone()));
            format!("{:?}", images.iter().map(one).collect::<Vec<_>>())
        }
        Value::Enum(choice) => field.choice_name(*choice).unwrap_or("?").into(),
        other => format!("{other:?}"),
    }
}

/// Everything that a save keeps, in words, nodes in the order of their creation: equal if and only if two graphs are.
pub(crate) fn described(graph: &Graph, order: &[NodeId]) -> Vec<String> {
    let mut lines = Vec::new();
    for (place, node) in order.iter().enumerate() {
        lines.push(format!("node {place}: {} {:?}", graph.type_of(*node).name, graph.name(*node)));
        for (number, (id, field)) in graph.field_ids(*node).enumerate() {
            let value = graph.value(id).unwrap();
            let dynamic = number >= graph.type_of(*node).fields.len();
            let mut line = format!("{place}.{} = {}", field.name, shown(order, field, &value));
            if dynamic {
                let default = shown(order, field, &field.default);
                let Field { field_type, doc, unit, range, aliases, on_set, choices, output, .. } = field;
                line +=
                    &format!(" {field_type} {default} {doc:?} {unit:?} {range:?} {aliases:?} {on_set:?} {choices:?} {output}");
            }
            lines.push(line);
        }
    }
    let mut routes: Vec<_> = graph.routes().map(|(_, route)| *route).collect();
    routes.sort_by_key(|route| route.ordinal);
    for route in routes {
        let end = |field: umbriel_fields::FieldId| {
            let place = order.iter().position(|other| *other == field.node);
            format!("{place:?}.{}", graph.declaration(field).unwrap().name)
        };
        let arrow = if route.strength == Strength::Weak { "~>" } else { "->" };
        lines.push(format!("{} {arrow} {}", end(route.from), end(route.to)));
    }
    lines
}
