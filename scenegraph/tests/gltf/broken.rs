//! Files that are wrong: each gives an error or a warning that names file, object and cause, and nothing panics.

use crate::tiny::{Folder, Tiny, glb, load_new, png};
use serde_json::{Value, json};
use umbriel_scenegraph::gltf::{Cause, LoadOptions, load};

enum Want {
    Error,
    Warning,
}
use Want::{Error, Warning};

/// An edit of the small model, and the parts of the message that it must lead to.
type Row = (&'static str, fn(&mut Tiny), Want, &'static [&'static str]);

fn put(json: &mut Value, pointer: &str, value: Value) {
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    match json.pointer_mut(parent).unwrap() {
        Value::Array(items) => items[key.parse::<usize>().unwrap()] = value,
        object => object[key] = value,
    }
}

const ROWS: &[Row] = &[
    ("version 1", |t| put(&mut t.json, "/asset/version", json!("1.0")), Error, &["asset", "1.0"]),
    ("later minVersion", |t| put(&mut t.json, "/asset/minVersion", json!("2.1")), Error, &["minVersion", "2.1"]),
    (
        "unknown required extension",
        |t| put(&mut t.json, "/extensionsRequired", json!(["KHR_draco_mesh_compression"])),
        Error,
        &["requires", "KHR_draco_mesh_compression"],
    ),
    (
        "meshopt",
        |t| put(&mut t.json, "/extensionsRequired", json!(["EXT_meshopt_compression"])),
        Error,
        &["EXT_meshopt_compression"],
    ),
    (
        "unknown used extension",
        |t| put(&mut t.json, "/extensionsUsed", json!(["KHR_materials_clearcoat"])),
        Warning,
        &["KHR_materials_clearcoat", "no effect"],
    ),
    ("json of another kind", |t| put(&mut t.json, "/nodes", json!("x")), Error, &["JSON", "line 1 column"]),
    ("no asset", |t| drop(t.json.as_object_mut().unwrap().remove("asset")), Error, &["JSON", "asset"]),
    (
        "matrix that is not finite",
        |t| put(&mut t.json, "/nodes/0", json!({"matrix": [1e300,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]})),
        Error,
        &["nodes[0].matrix[0]", "too large"],
    ),
    ("index that wraps", |t| put(&mut t.json, "/nodes/1/mesh", json!(4294967296u64)), Error, &["nodes[1].mesh"]),
    ("mesh out of range", |t| put(&mut t.json, "/nodes/1/mesh", json!(7)), Error, &["nodes[1].mesh", "out of range"]),
    (
        "child out of range",
        |t| put(&mut t.json, "/nodes/0/children/0", json!(70)),
        Error,
        &["nodes[0].children[0]", "out of range"],
    ),
    ("scene out of range", |t| put(&mut t.json, "/scene", json!(3)), Error, &["scene", "out of range"]),
    (
        "material out of range",
        |t| put(&mut t.json, "/meshes/0/primitives/0/material", json!(9)),
        Error,
        &["material", "out of range"],
    ),
    (
        "accessor out of range",
        |t| put(&mut t.json, "/meshes/0/primitives/0/attributes/POSITION", json!(99)),
        Error,
        &["mesh 0 'triangle mesh'", "accessor 99"],
    ),
    (
        "light out of range",
        |t| put(&mut t.json, "/nodes/3/extensions/KHR_lights_punctual/light", json!(5)),
        Error,
        &["nodes[3]", "light", "out of range"],
    ),
    ("light without list", |t| put(&mut t.json, "/extensions", json!({})), Error, &["nodes[3]", "out of range"]),
    (
        "spot without cone",
        |t| drop(t.json["extensions"]["KHR_lights_punctual"]["lights"][0].as_object_mut().unwrap().remove("spot")),
        Error,
        &["light 0 'lamp'", "without a spot"],
    ),
    (
        "light of no kind",
        |t| put(&mut t.json, "/extensions/KHR_lights_punctual/lights/0/type", json!("area")),
        Error,
        &["light 0 'lamp'", "none of"],
    ),
    (
        "cone turned inside out",
        |t| put(&mut t.json, "/extensions/KHR_lights_punctual/lights/0/spot/innerConeAngle", json!(1.0)),
        Warning,
        &["light 0 'lamp'", "clamped"],
    ),
    (
        "camera without description",
        |t| put(&mut t.json, "/cameras/0", json!({"type": "orthographic", "perspective": {"yfov": 1, "znear": 1}})),
        Error,
        &["camera 0"],
    ),
    (
        "orthographic camera",
        |t| {
            put(
                &mut t.json,
                "/cameras/0",
                json!({"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 9}}),
            )
        },
        Warning,
        &["camera 0", "orthographic"],
    ),
    (
        "animated node out of range",
        |t| put(&mut t.json, "/animations/0/channels/0/target/node", json!(40)),
        Error,
        &["animation 0 'move'", "node 40"],
    ),
    (
        "unknown animation path",
        |t| put(&mut t.json, "/animations/0/channels/0/target/path", json!("color")),
        Error,
        &["animation 0 'move'", "path"],
    ),
    (
        "animation sampler out of range",
        |t| put(&mut t.json, "/animations/0/channels/0/sampler", json!(4)),
        Error,
        &["animations[0].channels[0].sampler"],
    ),
    (
        "weights without targets",
        |t| put(&mut t.json, "/animations/0/channels/0/target/path", json!("weights")),
        Warning,
        &["animation 0 'move'", "without morph targets"],
    ),
    (
        "times that go back",
        |t| {
            let at = t.offset(3);
            t.binary[at + 4..at + 8].copy_from_slice(&9f32.to_le_bytes())
        },
        Error,
        &["accessor 3", "4 seconds comes after 9"],
    ),
    (
        "time that is no number",
        |t| {
            let at = t.offset(3);
            t.binary[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes())
        },
        Error,
        &["accessor 3", "not finite"],
    ),
    ("too few values", |t| put(&mut t.json, "/accessors/4/count", json!(2)), Error, &["accessor 4", "2 values", "3 for 3 keys"]),
    ("own child", |t| put(&mut t.json, "/nodes/1/children", json!([1])), Error, &["node 1 'triangle'", "own child"]),
    (
        "cycle",
        |t| {
            put(&mut t.json, "/nodes/2/children", json!([3]));
            put(&mut t.json, "/nodes/3/children", json!([2]));
            put(&mut t.json, "/nodes/0/children", json!([1]))
        },
        Error,
        &["node 2 'eye'", "cycle"],
    ),
    (
        "two parents",
        |t| put(&mut t.json, "/nodes/2/children", json!([1])),
        Error,
        &["node 1 'triangle'", "two parents", "0 and 2"],
    ),
    ("listed twice", |t| put(&mut t.json, "/nodes/0/children", json!([1, 1])), Error, &["node 1 'triangle'", "two parents"]),
    (
        "nested too deep",
        |t| {
            let n: Vec<_> = (0..600).map(|i| if i < 599 { json!({"children": [i + 1]}) } else { json!({}) }).collect();
            t.json["nodes"] = n.into();
            t.json["skins"] = json!([]);
        },
        Error,
        &["nested deeper than 512"],
    ),
    ("scene with a root and its child", |t| put(&mut t.json, "/scenes/0/nodes", json!([0, 1])), Warning, &["scene 0", "node 1"]),
    (
        "no binary chunk for a buffer",
        |t| t.json["buffers"].as_array_mut().unwrap().push(json!({"byteLength": 4})),
        Error,
        &["buffer 1", "no uri"],
    ),
    (
        "missing buffer file",
        |t| put(&mut t.json, "/buffers/0/uri", json!("gone.bin")),
        Error,
        &["buffer 0", "gone.bin", "does not exist"],
    ),
    (
        "buffer outside of the root",
        |t| put(&mut t.json, "/buffers/0/uri", json!("../../../etc/passwd")),
        Error,
        &["buffer 0", "../../../etc/passwd", "out of the asset root"],
    ),
    (
        "buffer from the net",
        |t| put(&mut t.json, "/buffers/0/uri", json!("http://localhost/x.bin")),
        Error,
        &["buffer 0", "scheme 'http'"],
    ),
    ("short buffer", |t| put(&mut t.json, "/buffers/0/byteLength", json!(100_000)), Error, &["buffer 0", "100000"]),
    ("view past the buffer", |t| put(&mut t.json, "/bufferViews/0/byteLength", json!(50_000)), Error, &["bufferView 0", "50000"]),
    ("view offset that overflows", |t| put(&mut t.json, "/bufferViews/0/byteOffset", json!(u64::MAX)), Error, &["bufferView 0"]),
    (
        "accessor past the end",
        |t| put(&mut t.json, "/accessors/0/count", json!(4)),
        Error,
        &["accessor 0", "48 bytes for 4", "has 36"],
    ),
    ("huge count", |t| put(&mut t.json, "/accessors/0/count", json!(u64::MAX)), Error, &["accessor 0", "more than all"]),
    (
        "huge count of zeros",
        |t| put(&mut t.json, "/accessors/0", json!({"componentType": 5126, "count": 1u64 << 40, "type": "VEC3"})),
        Error,
        &["accessor 0", "bytes"],
    ),
    ("stride below size", |t| put(&mut t.json, "/bufferViews/0/byteStride", json!(4)), Error, &["accessor 0", "stride"]),
    (
        "float indices",
        |t| put(&mut t.json, "/meshes/0/primitives/0/indices", json!(3)),
        Error,
        &["accessor 3", "F32 Scalar", "u16"],
    ),
    (
        "index out of range",
        |t| {
            let at = t.offset(1);
            t.binary[at + 4] = 3
        },
        Error,
        &["accessor 1", "index 3 at place 2", "3 vertices", "mesh 0 'triangle mesh'"],
    ),
    (
        "position that is no number",
        |t| {
            let at = t.offset(0);
            t.binary[at + 12..at + 16].copy_from_slice(&f32::NAN.to_le_bytes())
        },
        Error,
        &["accessor 0", "element 1", "not finite"],
    ),
    (
        "texture coordinate that is no number",
        |t| {
            let at = t.offset(2);
            t.binary[at..at + 4].copy_from_slice(&f32::INFINITY.to_le_bytes())
        },
        Warning,
        &["accessor 2", "element 0", "replaced"],
    ),
    (
        "attribute of another length",
        |t| put(&mut t.json, "/accessors/2/count", json!(2)),
        Error,
        &["accessor 2", "2 elements", "3 vertices"],
    ),
    (
        "attribute of another shape",
        |t| put(&mut t.json, "/meshes/0/primitives/0/attributes/NORMAL", json!(2)),
        Error,
        &["accessor 2", "F32 Vec2", "Vec3"],
    ),
    (
        "joint out of range",
        |t| {
            let at = t.offset(5);
            t.binary[at + 4] = 2
        },
        Error,
        &["node 1 'triangle'", "joint 2", "2 joints"],
    ),
    (
        "too few bind matrices",
        |t| put(&mut t.json, "/accessors/7/count", json!(1)),
        Error,
        &["accessor 7", "1 matrices", "2 joints"],
    ),
    (
        "bind matrix that is no number",
        |t| {
            let at = t.offset(7);
            t.binary[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes())
        },
        Error,
        &["accessor 7", "not finite"],
    ),
    ("skin without joints", |t| put(&mut t.json, "/skins/0/joints", json!([])), Error, &["skin 0", "no joints"]),
    (
        "mesh without primitives",
        |t| put(&mut t.json, "/meshes/0/primitives", json!([])),
        Warning,
        &["mesh 0 'triangle mesh'", "no primitives"],
    ),
    (
        "primitive without positions",
        |t| put(&mut t.json, "/meshes/0/primitives/0/attributes", json!({"TEXCOORD_0": 2})),
        Warning,
        &["mesh 0 'triangle mesh', primitive 0", "no POSITION"],
    ),
    (
        "primitive without triangles",
        |t| put(&mut t.json, "/accessors/1/count", json!(2)),
        Warning,
        &["mesh 0 'triangle mesh', primitive 0", "empty"],
    ),
    (
        "broken picture",
        |t| {
            let at = t.binary.len() - png().len();
            t.binary[at + 8..].fill(7)
        },
        Warning,
        &["image 0 'planks' of texture 0", "cannot be decoded"],
    ),
    (
        "picture of another kind",
        |t| {
            let at = t.binary.len() - png().len();
            t.binary[at..].fill(7)
        },
        Warning,
        &["image 0 'planks'", "neither PNG nor JPEG"],
    ),
    (
        "missing picture",
        |t| put(&mut t.json, "/images/0", json!({"uri": "gone.png"})),
        Warning,
        &["image 0 (gone.png) of texture 0", "does not exist"],
    ),
    (
        "picture outside of the root",
        |t| put(&mut t.json, "/images/0", json!({"uri": "../gone.png"})),
        Warning,
        &["../gone.png", "out of the asset root"],
    ),
    (
        "texture of an unknown format",
        |t| put(&mut t.json, "/textures/0", json!({"extensions": {"KHR_texture_basisu": {"source": 0}}})),
        Warning,
        &["texture 0"],
    ),
];

fn check(name: &str, tiny: &Tiny, want: &Want, parts: &[&str]) {
    let (_, model) = tiny.load();
    let message = match (model, want) {
        (Err(e), Error) => {
            assert!(!matches!(e.cause, Cause::Internal(_) | Cause::Graph(_)), "{name}: {e}");
            e.to_string()
        }
        (Ok(model), Warning) => model.warnings.join("\n"),
        (Ok(model), Error) => panic!("{name}: loaded, with warnings {:?}", model.warnings),
        (Err(e), Warning) => panic!("{name}: not loaded: {e}"),
    };
    for part in parts.iter().chain(&["tiny.glb"]) {
        assert!(message.contains(part), "{name}: '{part}' is not in: {message}");
    }
}

#[test]
fn every_fault_is_named() {
    let (_, whole) = Tiny::new().load();
    assert_eq!(whole.unwrap().warnings, [""; 0]);
    for (name, edit, want, parts) in ROWS {
        let mut tiny = Tiny::new();
        edit(&mut tiny);
        check(name, &tiny, want, parts);
    }
}

#[test]
fn files_that_are_no_models() {
    let folder = Folder::new();
    let whole = Tiny::new().glb();
    let mut version = whole.clone();
    version[4] = 1;
    let mut long = whole.clone();
    long[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    for (name, bytes, part) in [
        ("empty.glb", &b""[..], "empty"),
        ("magic.glb", b"PK\x03\x04 a zip", "neither with 'glTF' nor with '{'"),
        ("header.glb", &whole[..10], "within its header"),
        ("version.glb", &version, "version 1"),
        ("chunk.glb", &long, "chunk at byte 12"),
        ("cut.glb", &whole[..whole.len() - 1], "cut off"),
        ("nothing.glb", b"glTF\x02\0\0\0\x0c\0\0\0", "no JSON chunk"),
        ("small.glb", b"glTF\x02\0\0\0\x01\0\0\0", "no JSON chunk"),
        ("text.gltf", b"{\"asset\": oops}", "line 1 column"),
        ("nested.gltf", "[".repeat(100_000).replacen('[', "{\"a\":", 1).as_bytes(), "recursion limit"),
    ] {
        let file = folder.write(name, bytes);
        let error = load_new(&file).1.unwrap_err().to_string();
        assert!(error.contains(name) && error.contains(part), "{name}: {error}");
    }
    let error = load_new(&folder.0.join("absent.glb")).1.unwrap_err().to_string();
    assert!(error.contains("absent.glb") && error.contains("cannot be read"), "{error}");
    assert!(load_new(&folder.0).1.unwrap_err().to_string().contains("not a file"));
}

#[test]
fn cut_off_anywhere() {
    let whole = Tiny::new().glb();
    let folder = Folder::new();
    for end in (0..whole.len()).step_by(97) {
        let file = folder.write("cut.glb", &whole[..end]);
        let error = load_new(&file).1.unwrap_err();
        assert!(matches!(error.cause, Cause::Container(_)), "cut at {end}: {error}");
    }
    // With lengths that claim to be whole: what is missing is in the JSON or the buffer.
    let json = Tiny::new().json.to_string();
    for end in (0..json.len()).step_by(97) {
        let file = folder.write("cut.glb", glb(json.get(..end).unwrap_or(""), &[]));
        let error = load_new(&file).1.unwrap_err();
        assert!(matches!(error.cause, Cause::Json(_)), "JSON cut at {end}: {error}");
    }
    let tiny = Tiny::new();
    for end in (0..tiny.binary.len() - 4).step_by(97) {
        let file = folder.write("cut.glb", glb(&json, &tiny.binary[..end]));
        let error = load_new(&file).1.unwrap_err();
        assert!(matches!(error.cause, Cause::Data(_)), "buffer cut at {end}: {error}");
    }
}

/// Deterministic random numbers (splitmix64).
struct Random(u64);

impl Random {
    fn next(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % below as u64) as usize
    }
}

/// Changes a random value somewhere in `json`.
fn mutate(json: &mut Value, random: &mut Random) {
    let descend = random.next(6) > 0;
    match json {
        Value::Object(fields) if descend && !fields.is_empty() => {
            let n = random.next(fields.len());
            mutate(fields.iter_mut().nth(n).unwrap().1, random);
        }
        Value::Array(items) if descend && !items.is_empty() => {
            let n = random.next(items.len());
            mutate(&mut items[n], random);
        }
        value => {
            let others = [
                json!(0),
                json!(1),
                json!(2),
                json!(5126),
                json!(-1),
                json!(1e38),
                json!(255),
                json!(u64::MAX),
                json!("scale"),
                json!([]),
                json!({}),
                Value::Null,
                json!(0.5),
            ];
            *value = others[random.next(others.len())].clone();
        }
    }
}

#[test]
fn random_damage_never_panics() {
    let mut random = Random(20_260_101);
    let (mut loaded, mut refused) = (0, 0);
    for round in 0..1500 {
        let mut tiny = Tiny::new();
        for _ in 0..1 + random.next(3) {
            if random.next(4) == 0 {
                let at = random.next(tiny.binary.len());
                tiny.binary[at] = random.next(256) as u8;
            } else {
                mutate(&mut tiny.json, &mut random);
            }
        }
        match tiny.load().1 {
            Ok(_) => loaded += 1,
            Err(e) => {
                assert!(!matches!(e.cause, Cause::Internal(_) | Cause::Graph(_)), "round {round}: {e}\n{}", tiny.json);
                refused += 1;
            }
        }
    }
    assert!(loaded > 100 && refused > 100, "{loaded} loaded, {refused} refused: the damage is too weak or too strong");
}

#[test]
fn memory_is_limited() {
    let mut tiny = Tiny::new();
    // One large accessor that many primitives use as different attributes, each time with new indices.
    let primitive = tiny.json["meshes"][0]["primitives"][0].clone();
    tiny.json["meshes"][0]["primitives"] = vec![primitive; 2000].into();
    let folder = Folder::new();
    let file = folder.write("many.glb", tiny.glb());
    let mut graph = umbriel_scenegraph::new_graph();
    let options = LoadOptions { max_bytes: 300_000, ..LoadOptions::default() };
    let error = load(&mut graph, &file, &options).unwrap_err();
    assert!(matches!(error.cause, Cause::Limit(_)), "{error}");
    assert!(load(&mut graph, &file, &LoadOptions::default()).is_ok());
}

#[test]
fn a_graph_that_refuses_is_left_as_it_was() {
    let folder = Folder::new();
    let file = folder.write("tiny.glb", Tiny::new().glb());
    // Every type is missing once; what was made before it is needed must go.
    for missing in ["Group", "Transform", "Skin", "Appearance", "ImageTexture", "Mesh", "Shape", "SpotLight", "TimeSensor"] {
        let all = umbriel_scenegraph::node_types().into_iter().chain(umbriel_fields::builtin_types());
        let mut graph = umbriel_fields::Graph::new(all.filter(|t| &*t.name != missing).collect::<Vec<_>>());
        let error = load(&mut graph, &file, &LoadOptions::default()).unwrap_err();
        assert!(matches!(error.cause, Cause::Graph(_)) && error.to_string().contains(missing), "{error}");
        assert_eq!((graph.node_count(), graph.names().count(), graph.routes().count()), (0, 0, 0), "{missing}");
    }
}
