//! Checks of a document before anything trusts it. The `gltf` crate checks less than it relies on: it accepts cycles
//! and several parents, and panics on some references that are out of range.

use super::error::{Cause, Fault, label};
use gltf::json::extensions::scene::khr_lights_punctual::Type as LightType;
use gltf::json::validation::{Checked, Error as Invalid, Validate};
use gltf::json::{Path, Root, camera};

/// Extensions that a file may require.
const SUPPORTED: [&str; 6] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// How deep nodes may be nested; whatever walks the scene later may recurse.
const MAX_DEPTH: usize = 512;

/// How many shapes a model may have, instances counted.
const MAX_SHAPES: usize = 1_000_000;

/// Checks all references of `root`; returns warnings about what will be left out.
pub(crate) fn check(root: &Root) -> Result<Vec<String>, Fault> {
    check_version(root)?;
    if let Some(unknown) = root.extensions_required.iter().find(|e| !SUPPORTED.contains(&e.as_str())) {
        return Err(Fault::new("", Cause::Extension(unknown.clone())));
    }
    check_references(root)?;
    check_hierarchy(root)?;
    let unread = root.extensions_used.iter().filter(|e| !SUPPORTED.contains(&e.as_str()));
    Ok(unread.map(|e| format!("extensionsUsed: {e} is not supported and has no effect")).collect())
}

fn check_version(root: &Root) -> Result<(), Fault> {
    let asset = &root.asset;
    for (field, version) in [("version", Some(&asset.version)), ("minVersion", asset.min_version.as_ref())] {
        let Some(version) = version else { continue };
        let readable = if field == "version" { version.split('.').next() == Some("2") } else { version == "2.0" };
        if !readable {
            return Err(Fault::invalid("asset", format!("its {field} is '{version}'; glTF 2.0 is read")));
        }
    }
    Ok(())
}

fn check_references(root: &Root) -> Result<(), Fault> {
    check_what_panics(root)?;
    let mut first = None;
    root.validate(root, Path::new, &mut |path, error| {
        let path = path().to_string();
        // Bounds of positions are computed here anyway, an accessor without view is all zeros, and extensions were checked.
        let harmless = match error {
            Invalid::Missing => {
                path.ends_with(".min") || path.ends_with(".max") || path.ends_with("bufferView") || path.contains("\"POSITION\"")
            }
            Invalid::Unsupported => path.starts_with("extensionsRequired"),
            _ => false,
        };
        if !harmless && first.is_none() {
            first = Some((path, error));
        }
    });
    match first {
        Some((path, Invalid::IndexOutOfBounds)) => {
            Err(Fault::invalid(path, "names something that the file does not have (index out of range)"))
        }
        Some((path, error)) => Err(Fault::invalid(path, error.to_string().to_lowercase())),
        None => Ok(()),
    }
}

/// References and values that the crate's own validation passes over or panics on.
fn check_what_panics(root: &Root) -> Result<(), Fault> {
    for (m, mesh) in root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let accessors = primitive.attributes.values().chain(&primitive.indices);
            if let Some(a) = accessors.map(|a| a.value()).find(|a| *a >= root.accessors.len()) {
                let object = format!("{}, primitive {p}", label("mesh", m, mesh.name.as_deref()));
                return Err(Fault::invalid(object, format!("names accessor {a}, but there are {}", root.accessors.len())));
            }
        }
    }
    for (a, animation) in root.animations.iter().enumerate() {
        for (c, channel) in animation.channels.iter().enumerate() {
            let object = || format!("{}, channel {c}", label("animation", a, animation.name.as_deref()));
            let node = channel.target.node.value();
            if node >= root.nodes.len() {
                return Err(Fault::invalid(object(), format!("names node {node}, but there are {}", root.nodes.len())));
            }
            if let Checked::Invalid = channel.target.path {
                return Err(Fault::invalid(object(), "its path is none of translation, rotation, scale and weights"));
            }
        }
    }
    for (c, camera) in root.cameras.iter().enumerate() {
        let described = match camera.type_ {
            Checked::Valid(camera::Type::Perspective) => camera.perspective.is_some(),
            Checked::Valid(camera::Type::Orthographic) => camera.orthographic.is_some(),
            Checked::Invalid => false,
        };
        if !described {
            return Err(Fault::invalid(label("camera", c, camera.name.as_deref()), "its type has no description of that type"));
        }
    }
    let lights = root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
    for (l, light) in lights.iter().flat_map(|l| &l.lights).enumerate() {
        let object = label("light", l, light.name.as_deref());
        match light.type_ {
            Checked::Invalid => return Err(Fault::invalid(object, "its type is none of directional, point and spot")),
            Checked::Valid(LightType::Spot) if light.spot.is_none() => {
                return Err(Fault::invalid(object, "is a spot light without a spot"));
            }
            Checked::Valid(_) => {}
        }
    }
    Ok(())
}

/// The parent of each node; cycles, second parents, too deep nesting and too many instances are errors.
fn check_hierarchy(root: &Root) -> Result<(), Fault> {
    let count = root.nodes.len();
    let wrong = |node: usize, message: String| {
        Err(Fault::new(label("node", node, root.nodes[node].name.as_deref()), Cause::Hierarchy(message)))
    };
    let mut parents = vec![None; count];
    for (n, node) in root.nodes.iter().enumerate() {
        for child in node.children.iter().flatten().map(|c| c.value()) {
            if child == n {
                return wrong(n, "is its own child".into());
            }
            if let Some(other) = parents[child].replace(n) {
                return wrong(child, format!("has two parents, nodes {other} and {n}; glTF nodes form a tree"));
            }
        }
    }
    // Everything that hangs below a root is reached once; what is not reached is on a cycle or below one.
    let mut depths = vec![0usize; count];
    let mut pending: Vec<usize> = (0..count).filter(|n| parents[*n].is_none()).collect();
    while let Some(n) = pending.pop() {
        let depth = parents[n].map_or(0, |p| depths[p]) + 1;
        if depth > MAX_DEPTH {
            return wrong(n, format!("is nested deeper than {MAX_DEPTH} nodes"));
        }
        depths[n] = depth;
        pending.extend(root.nodes[n].children.iter().flatten().map(|c| c.value()));
    }
    if let Some(n) = depths.iter().position(|d| *d == 0) {
        return wrong(n, "is its own ancestor: its parents form a cycle".into());
    }
    let shapes: usize = root.nodes.iter().filter_map(|n| n.mesh).map(|m| root.meshes[m.value()].primitives.len()).sum();
    if shapes > MAX_SHAPES {
        return Err(Fault::new("", Cause::Limit(format!("it has {shapes} shapes; at most {MAX_SHAPES} are loaded"))));
    }
    Ok(())
}

/// Buffer views must lie within their buffers.
pub(crate) fn check_views(root: &Root, buffers: &[Vec<u8>]) -> Result<(), Fault> {
    for (v, view) in root.buffer_views.iter().enumerate() {
        let (start, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        let available = buffers[view.buffer.value()].len() as u64;
        if start.checked_add(length).is_none_or(|end| end > available) {
            let message =
                format!("takes {length} bytes from byte {start} of buffer {}, which has {available}", view.buffer.value());
            return Err(Fault::data(label("bufferView", v, view.name.as_deref()), message));
        }
    }
    Ok(())
}
