//! Short forms for what nearly every world makes. All of them only call `make`.

use std::rc::Rc;

use rhai::{Array, Dynamic, Map, NativeCallContext};

use super::Words;
use super::nodes::{add, make_with};
use crate::error::Outcome;
use crate::stage::{Node, Stage};

pub(super) fn teach(words: &mut Words<'_>) {
    groups(words);
    shapes(words);
    geometries(words);
    short_form(words, "mesh(fields: map) -> Node", "A Mesh from arrays: `mesh(#{ position: [...], index: [0, 1, 2] })`.", "Mesh");
    short_form(words, "material(fields: map) -> Node", "A PhysicalMaterial. Also called `physical`.", "PhysicalMaterial");
    let stage = words.stage.clone();
    words.form("physical", move |context: Context<'_>, fields: Map| made(&stage, &context, "PhysicalMaterial", &fields));
    short_form(words, "phong(fields: map) -> Node", "A Material of the Phong model.", "Material");
    short_form(words, "unlit(fields: map) -> Node", "An UnlitMaterial.", "UnlitMaterial");
    short_form(words, "texture(fields: map) -> Node", "An ImageTexture.", "ImageTexture");
    short_form(words, "appearance(fields: map) -> Node", "An Appearance.", "Appearance");
    shaders(words);
}

fn shaders(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "shader(file: string, params: map) -> Node",
        "A FragmentShader from a file of the world's folder. Each entry of the map becomes a field, which the WGSL reads as \
         `params.name`: `shader(\"toon.wgsl\", #{ bands: 3.0 })`.",
        move |context: Context<'_>, file: &str, params: Map| {
            let node = made(&stage, &context, "FragmentShader", &Map::from([("url".into(), file.to_string().into())]))?;
            match params.iter().try_for_each(|(name, value)| stage.add_field(node, name, value)) {
                Ok(()) => Ok(node),
                Err(error) => {
                    stage.delete(node)?;
                    Err(error)
                }
            }
        },
    );
}

type Context<'a> = NativeCallContext<'a>;

/// A node with fields set, made where the script calls.
fn made(stage: &Stage, context: &Context<'_>, node_type: &str, fields: &Map) -> Outcome<Node> {
    stage.making_at(context.call_position(), || make_with(stage, node_type, fields))
}

fn short_form(words: &mut Words<'_>, signature: &'static str, doc: &'static str, node_type: &'static str) {
    let stage = words.stage.clone();
    words.word(signature, doc, move |context: Context<'_>, fields: Map| made(&stage, &context, node_type, &fields));
}

fn groups(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word("group(children: array) -> Node", "A Group of nodes.", move |context: Context<'_>, children: Array| {
        parent(&stage, &context, "Group", &Map::new(), &children)
    });
    let stage = words.stage.clone();
    words.word(
        "transform(fields: map, children: array) -> Node",
        "A Transform of nodes.",
        move |context: Context<'_>, fields: Map, children: Array| parent(&stage, &context, "Transform", &fields, &children),
    );
    let stage = words.stage.clone();
    words.word(
        "transform(fields: map, child: Node) -> Node",
        "A Transform of one node.",
        move |context: Context<'_>, fields: Map, child: Node| parent(&stage, &context, "Transform", &fields, &[child.into()]),
    );
    let stage = words.stage.clone();
    words.word(
        "transform(fields: map) -> Node",
        "A Transform without children yet.",
        move |context: Context<'_>, fields: Map| parent(&stage, &context, "Transform", &fields, &[]),
    );
}

fn parent(stage: &Stage, context: &Context<'_>, node_type: &str, fields: &Map, children: &[Dynamic]) -> Outcome<Node> {
    let node = made(stage, context, node_type, fields)?;
    add(stage, node, children)?;
    Ok(node)
}

fn shapes(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "shape(geometry: Node) -> Node",
        "A Shape that looks as shapes without a material do.",
        move |context: Context<'_>, geometry: Node| shape(&stage, &context, geometry, None, &Map::new()),
    );
    let stage = words.stage.clone();
    words.word(
        "shape(geometry: Node, material: Node) -> Node",
        "A Shape; the second node is a material, or an Appearance.",
        move |context: Context<'_>, geometry: Node, look: Node| shape(&stage, &context, geometry, Some(look), &Map::new()),
    );
    let stage = words.stage.clone();
    words.word(
        "shape(geometry: Node, material: Node, fields: map) -> Node",
        "A Shape with fields of its own, such as `cast_shadow: false`.",
        move |context: Context<'_>, geometry: Node, look: Node, fields: Map| {
            shape(&stage, &context, geometry, Some(look), &fields)
        },
    );
}

fn shape(stage: &Rc<Stage>, context: &Context<'_>, geometry: Node, look: Option<Node>, fields: &Map) -> Outcome<Node> {
    let node = made(stage, context, "Shape", fields)?;
    stage.set(node, "geometry", &geometry.into())?;
    let Some(look) = look else { return Ok(node) };
    let is_appearance = stage.read(|graph| graph.contains(look.0) && &*graph.type_of(look.0).name == "Appearance");
    let appearance = match is_appearance {
        true => look,
        false => {
            let appearance = stage.create("Appearance")?;
            stage.set(appearance, "material", &look.into())?;
            appearance
        }
    };
    stage.set(node, "appearance", &appearance.into())?;
    Ok(node)
}

fn geometries(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word("cuboid(size: vec3) -> Node", "A Box of this size.", move |context: Context<'_>, size: Dynamic| {
        made(&stage, &context, "Box", &Map::from([("size".into(), size)]))
    });
    let stage = words.stage.clone();
    words.word("sphere(radius: number) -> Node", "A Sphere.", move |context: Context<'_>, radius: Dynamic| {
        made(&stage, &context, "Sphere", &Map::from([("radius".into(), radius)]))
    });
    let stage = words.stage.clone();
    words.word(
        "cylinder(radius: number, height: number) -> Node",
        "A Cylinder along y.",
        move |context: Context<'_>, radius: Dynamic, height: Dynamic| {
            made(&stage, &context, "Cylinder", &Map::from([("radius".into(), radius), ("height".into(), height)]))
        },
    );
    let stage = words.stage.clone();
    words.word(
        "cone(radius: number, height: number) -> Node",
        "A Cone along y.",
        move |context: Context<'_>, radius: Dynamic, height: Dynamic| {
            made(&stage, &context, "Cone", &Map::from([("bottom_radius".into(), radius), ("height".into(), height)]))
        },
    );
    let stage = words.stage.clone();
    words.word(
        "plane(width: number, depth: number) -> Node",
        "A Plane in x and z that faces up.",
        move |context: Context<'_>, width: Dynamic, depth: Dynamic| {
            made(&stage, &context, "Plane", &Map::from([("size".into(), Array::from([width, depth]).into())]))
        },
    );
}
