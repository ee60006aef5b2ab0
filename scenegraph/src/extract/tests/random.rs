//! Random edits: following the revisions must give what a fresh extraction gives.

use super::World;
use crate::extract::Extractor;
use glam::{Mat4, Quat, Vec3, vec3};
use std::sync::Arc;
use umbriel_fields::{Color, NodeId, Value};
use umbriel_scene::{Drawable, Scene, StencilGroup};

struct Random(u64);

impl Random {
    /// splitmix64
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32 * 2.0 - 1.0
    }

    fn vec3(&mut self) -> Vec3 {
        vec3(self.unit(), self.unit(), self.unit())
    }

    fn pick<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }
}

const TYPES: [&str; 24] = [
    "Group",
    "Group",
    "Transform",
    "Transform",
    "Switch",
    "LOD",
    "Shape",
    "Shape",
    "Shape",
    "Box",
    "Sphere",
    "Mesh",
    "Appearance",
    "Material",
    "UnlitMaterial",
    "SpotLight",
    "PointLight",
    "LightSource",
    "StencilShadow",
    "Viewpoint",
    "Skin",
    "Navigation",
    "User",
    "Background",
];

fn of_type(w: &World, nodes: &[NodeId], types: &[&str]) -> Vec<NodeId> {
    nodes.iter().copied().filter(|n| types.contains(&&*w.graph.type_of(*n).name)).collect()
}

/// Some of the nodes, as the value of a reference field; at times dead ones and cycles are among them.
fn some(r: &mut Random, nodes: &[NodeId], most: usize) -> Vec<NodeId> {
    (0..r.below(most + 1)).filter(|_| !nodes.is_empty()).map(|_| nodes[r.below(nodes.len())]).collect()
}

fn one(r: &mut Random, nodes: &[NodeId]) -> Value {
    if nodes.is_empty() || r.below(5) == 0 { Value::Node(None) } else { r.pick(nodes).into() }
}

fn edit(w: &mut World, r: &mut Random, nodes: &mut Vec<NodeId>, count: &mut usize) {
    if r.below(12) == 0 || nodes.len() < 30 {
        *count += 1;
        let kind = r.pick(&TYPES);
        let id = w.node(kind, &format!("{kind}{count}"));
        nodes.push(id);
        if kind == "Shape" {
            let geometry = w.node("Box", "");
            w.set(id, "geometry", geometry);
            nodes.push(geometry);
        }
    }
    if r.below(60) == 0 {
        let dead = nodes[r.below(nodes.len())];
        if dead != w.root() && w.graph.contains(dead) {
            w.graph.delete(dead).unwrap();
        }
    }
    let node = nodes[r.below(nodes.len())];
    if !w.graph.contains(node) {
        return;
    }
    let sick = r.below(25) == 0;
    let length = if sick { f32::NAN } else { 1.0 };
    let kind = w.graph.type_of(node).name.to_string();
    let (field, value): (&str, Value) = match (&*kind, r.below(6)) {
        ("Transform" | "StencilShadow", 0) => ("translation", (r.vec3() * 9.0 * length).into()),
        ("Transform", 1) => ("rotation", Quat::from_rotation_y(r.unit() * 3.0).into()),
        ("Transform", 2) => ("scale", (r.vec3() * 2.0).into()),
        ("Transform", 3) => ("matrix", Mat4::from_rotation_x(r.unit()).into()),
        ("StencilShadow", 1 | 2) => ("caster", some(r, nodes, 2).into()),
        ("StencilShadow", 3) => ("light", one(r, &of_type(w, nodes, &["SpotLight", "PointLight", "Box"]))),
        ("Switch", 0..3) => ("which_choice", (r.below(4) as i32 - 1).into()),
        ("LOD", 0..3) => ("range", [r.unit().abs() * 5.0, 5.0 + r.unit().abs() * 5.0].into()),
        ("Group" | "Transform" | "StencilShadow" | "Switch" | "LOD", _) => {
            let most = if node == w.root() { 12 } else { 4 };
            let mut children = some(r, &of_type(w, nodes, &PLACED), most);
            children.extend(some(r, nodes, 1));
            ("children", children.into())
        }

        ("Shape", 0..2) => ("geometry", one(r, &of_type(w, nodes, &["Box", "Sphere", "Mesh", "Group"]))),
        ("Shape", 2) => ("appearance", one(r, &of_type(w, nodes, &["Appearance"]))),
        ("Shape", 3) => ("skin", one(r, &of_type(w, nodes, &["Skin"]))),
        ("Shape", 4) => ("visible", (r.below(4) > 0).into()),
        ("Shape", _) => ("cast_shadow", (r.below(2) == 0).into()),
        ("Box", _) => ("size", (r.vec3().abs() * length).into()),
        ("Sphere", _) => ("segments", (3 + r.below(5) as i32).into()),
        ("Mesh", 0) => ("index", if sick { vec![0, 1, 9] } else { vec![0, 1, 2] }.into()),
        ("Mesh", 1) => ("joint", [0, r.below(3) as i32, 0, 0].repeat(3).into()),
        ("Mesh", 2) => ("weight", vec![glam::vec4(0.5, 0.5, 0.0, 0.0); 3].into()),
        ("Mesh", _) => ("position", vec![r.vec3(), r.vec3(), r.vec3() * length].into()),
        ("Skin", _) => ("joints", [some(r, &of_type(w, nodes, &["Transform"]), 2), some(r, nodes, 2)].concat().into()),
        ("Appearance", 0..3) => ("material", one(r, &of_type(w, nodes, &["Material", "UnlitMaterial"]))),
        ("Appearance", _) => ("shadow_caster", (r.below(2) == 0).into()),
        ("Material" | "UnlitMaterial", 0) => ("emissive_color", Color(r.vec3().abs() * length).into()),
        ("Material" | "UnlitMaterial", _) => ("transparency", r.unit().abs().into()),
        ("SpotLight" | "PointLight" | "LightSource", 0..2) => ("on", (r.below(3) > 0).into()),
        ("SpotLight" | "PointLight", _) => ("location", (r.vec3() * length).into()),
        ("LightSource", _) => ("position", r.vec3().extend(r.below(2) as f32).into()),
        ("Viewpoint" | "User", _) => ("position", (r.vec3() * 5.0 * length).into()),
        ("Navigation", 0) => ("scale", (r.unit().abs() * length).into()),
        ("Navigation", _) => ("position", r.vec3().into()),
        ("Background", 0) => ("bound", (r.below(2) == 0).into()),
        ("Background", _) => ("zenith_color", Color(r.vec3().abs()).into()),
        _ => return,
    };
    w.graph.set_named(node, field, value).unwrap_or_else(|e| panic!("{e}"));
}

const PLACED: [&str; 10] =
    ["Group", "Transform", "Transform", "Switch", "LOD", "Shape", "StencilShadow", "Viewpoint", "SpotLight", "LightSource"];

/// Everything but revisions and the pose of what is not drawn.
fn described(extractor: &Extractor, scene: &Scene, root: NodeId) -> Vec<String> {
    let drawable = |d: &Drawable| {
        let mesh = (d.mesh.positions.clone(), d.mesh.indices.clone(), d.mesh.bounds);
        let flags = (d.casts_shadow, d.receives_shadow, d.pose.clone());
        format!("{} {mesh:?} {:?} {:?} {:?} {flags:?}", d.name, d.material, d.world_from_object, d.bounds_in_world)
    };
    let group = |g: &StencilGroup| {
        let casters: Vec<&str> = g.casters.iter().map(|i| scene.drawables[*i].name.as_str()).collect();
        format!("{} {} {casters:?} {:?}", g.name, scene.lights[g.light].name, g.mode)
    };
    let drawn = extractor.drawables_of(root).into_iter().map(|i| &scene.drawables[i]).filter(|d| d.visible);
    let mut out: Vec<String> = drawn.map(drawable).collect();
    out.extend(scene.lights.iter().map(|l| format!("{l:?}")));
    out.extend(scene.stencil_groups.iter().map(group));
    out.extend(extractor.viewpoints().iter().map(|v| format!("{v:?}")));
    out.push(format!("{:?} {:?} {} {:?}", scene.ambient, scene.background, scene.exposure, scene.fog));
    out
}

fn verify_invariants(w: &World) {
    let placed: Vec<usize> = w.extractor.drawables_of(w.root());
    let mut seen = std::collections::HashSet::new();
    assert!(placed.iter().all(|i| seen.insert(*i)), "two shapes in one place");
    for (i, d) in w.scene.drawables.iter().enumerate() {
        assert!(!d.visible || seen.contains(&i), "a vacant place is drawn: {}", d.name);
        assert!(d.world_from_object.is_finite());
        assert!(d.pose.as_ref().is_none_or(|p| p.object_from_bind.iter().all(Mat4::is_finite)));
    }
    for group in &w.scene.stencil_groups {
        assert!(group.light < w.scene.lights.len() && group.casters.iter().all(|i| w.scene.drawables[*i].visible));
    }
}

#[test]
fn following_gives_what_a_fresh_extraction_gives() {
    let mut drawn = 0;
    let mut rebuilt = 0;
    for seed in 0..6 {
        let mut r = Random(seed);
        let mut w = World::new();
        w.extractor = Extractor::new().with_place_limit(2_000);
        let mut nodes = vec![w.root()];
        let mut count = 0;
        for step in 0..400 {
            for _ in 0..1 + r.below(4) {
                edit(&mut w, &mut r, &mut nodes, &mut count);
            }
            rebuilt += usize::from(w.update().rebuilt);
            verify_invariants(&w);
            let mut fresh = Extractor::new().with_place_limit(2_000);
            let mut scene = Scene::default();
            fresh.update(&w.graph, &mut scene);
            let root = w.root();
            let (found, expected) = (described(&w.extractor, &w.scene, root), described(&fresh, &scene, root));
            assert!(found == expected, "seed {seed}, step {step}:\n{:#?}", difference(&found, &expected));
            drawn += w.visible().len();
        }
    }
    assert!(
        drawn > 2_000 && rebuilt > 400 && rebuilt < 2_000,
        "{drawn} drawn, {rebuilt} rebuilt: the edits must reach everything"
    );
}

fn difference(found: &[String], expected: &[String]) -> Vec<String> {
    let only = |a: &[String], b: &[String], sign: &str| -> Vec<String> {
        a.iter().filter(|x| !b.contains(x)).map(|x| format!("{sign} {x}")).collect()
    };
    [only(found, expected, "found"), only(expected, found, "expected")].concat()
}

/// The same Arcs as long as nothing they were made of is written.
#[test]
fn meshes_keep_their_identity() {
    let mut r = Random(99);
    let mut w = World::new();
    let root = w.root();
    let shape = w.below(&[root], "Shape", "kept");
    let mesh = w.node("Mesh", "");
    w.set(mesh, "position", [Vec3::ZERO, Vec3::X, Vec3::Y]);
    w.set(shape, "geometry", mesh);
    w.update();
    let arc = w.drawable("kept").mesh.clone();
    let mut nodes = Vec::new();
    let mut count = 0;
    for _ in 0..100 {
        edit(&mut w, &mut r, &mut nodes, &mut count);
        w.update();
        assert!(Arc::ptr_eq(&arc, &w.drawable("kept").mesh));
    }
}
