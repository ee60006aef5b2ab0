//! The shaders: each is a pass's own WGSL behind the snippets that it uses.

use umbriel_scene::Samples;

/// Name and parts of every shader but that of surfaces.
#[cfg(test)]
pub(crate) const ALL: &[(&str, &[&str])] = &[
    ("film", FILM),
    ("compose", COMPOSE),
    ("maps", MAPS),
    ("deform", DEFORM),
    ("silhouettes", SILHOUETTES),
    ("contours", CONTOURS),
    ("wedges", WEDGES),
    ("penumbra", PENUMBRA),
];

/// All that surfaces use, but the functions that a shape's own shader may replace ([`HOOKS`]) and what calls them.
pub(crate) const SURFACE_BEFORE_HOOKS: &[&str] = &[
    include_str!("shaders/position.wgsl"),
    include_str!("shaders/view.wgsl"),
    include_str!("shaders/instance.wgsl"),
    include_str!("shaders/material.wgsl"),
    include_str!("shaders/light.wgsl"),
    include_str!("shaders/shade.wgsl"),
    include_str!("shaders/brdf.wgsl"),
    include_str!("shaders/shadow_map.wgsl"),
    include_str!("shaders/samples.wgsl"),
    include_str!("shaders/shadow_filter.wgsl"),
    include_str!("shaders/shadow_disc.wgsl"),
    include_str!("shaders/soft_shadow.wgsl"),
    include_str!("shaders/projection.wgsl"),
];

/// What a shape's own shader may replace; see [`crate::author`].
pub(crate) const HOOKS: &str = include_str!("shaders/hooks.wgsl");

/// Layers and holes need the surface's fragment, which shaders of authors do not see.
pub(crate) const SURFACE_BEHIND_HOOKS: &str =
    concat!(include_str!("shaders/layers.wgsl"), include_str!("shaders/holes.wgsl"), include_str!("surface.wgsl"));

/// WGSL of surfaces that bring no shader of their own, as the renderer compiles it: for programs that measure themselves
/// against it.
pub fn surface() -> String {
    [&SURFACE_BEFORE_HOOKS.concat(), &crate::author::standard_hooks(), SURFACE_BEHIND_HOOKS].concat()
}

const BACKGROUND: &[&str] = &[
    include_str!("shaders/view.wgsl"),
    include_str!("shaders/light.wgsl"),
    include_str!("shaders/fullscreen.wgsl"),
    include_str!("background.wgsl"),
];

pub(crate) const FILM: &[&str] = &[include_str!("shaders/fullscreen.wgsl"), include_str!("film.wgsl")];

pub(crate) const COMPOSE: &[&str] =
    &[include_str!("shaders/view.wgsl"), include_str!("shaders/fullscreen.wgsl"), include_str!("compose.wgsl")];

pub(crate) const MAPS: &[&str] = &[
    include_str!("shaders/position.wgsl"),
    include_str!("shaders/view.wgsl"),
    include_str!("shaders/instance.wgsl"),
    include_str!("shaders/material.wgsl"),
    include_str!("maps.wgsl"),
];

pub(crate) const DEFORM: &[&str] = &[include_str!("deform.wgsl")];

pub(crate) const SILHOUETTES: &[&str] = &[
    include_str!("shaders/position.wgsl"),
    include_str!("volumes/silhouette.wgsl"),
    include_str!("volumes/caster.wgsl"),
    include_str!("soft/silhouettes.wgsl"),
];

pub(crate) const CONTOURS: &[&str] =
    &[include_str!("shaders/view.wgsl"), include_str!("shaders/position.wgsl"), include_str!("contours/contours.wgsl")];

pub(crate) const HARD_SHADOW: &[&str] = &[include_str!("shaders/fullscreen.wgsl"), include_str!("soft/hard.wgsl")];

pub(crate) const WEDGES: &[&str] =
    &[include_str!("shaders/view.wgsl"), include_str!("soft/source.wgsl"), include_str!("soft/wedges.wgsl")];

pub(crate) const PENUMBRA: &[&str] = &[
    include_str!("shaders/view.wgsl"),
    include_str!("soft/source.wgsl"),
    include_str!("shaders/fullscreen.wgsl"),
    include_str!("soft/penumbra.wgsl"),
];

pub(crate) const SOFT_FILM: &[&str] = &[
    include_str!("shaders/view.wgsl"),
    include_str!("shaders/soft_shadow.wgsl"),
    include_str!("shaders/fullscreen.wgsl"),
    include_str!("film.wgsl"),
    include_str!("soft/film.wgsl"),
];

/// What is behind everything. Its second bind group is what surfaces have as their fourth: in Vulkan, to bind a group behind groups that were
/// bound for other layouts may disturb the first one, the view, and on some cards it does.
pub(crate) fn background() -> String {
    BACKGROUND.concat().replace("@group(3)", "@group(1)")
}

/// A shader that reads the view's depth or stencil, for so many samples of them.
pub(crate) fn of_samples(samples: Samples, parts: &[&str]) -> String {
    let head = match samples {
        Samples::One => include_str!("shaders/one_sample.wgsl"),
        Samples::Four => include_str!("shaders/four_samples.wgsl"),
    };
    [head, &parts.concat()].concat()
}

/// Compiles the joined parts.
pub(crate) fn module(device: &wgpu::Device, name: &str, parts: &[&str]) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(parts.concat().into()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{contours, deform, soft, uniforms};
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use std::mem::offset_of;

    fn parsed(name: &str, source: &str) -> naga::Module {
        let module = naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(source)));
        let valid = Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module);
        valid.unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(source)));
        module
    }

    fn all() -> Vec<(&'static str, String)> {
        let others = ALL.iter().map(|(name, parts)| (*name, parts.concat()));
        let sampled = [("hard shadow", HARD_SHADOW), ("soft film", SOFT_FILM)]
            .into_iter()
            .flat_map(|(name, parts)| [Samples::One, Samples::Four].map(|samples| (name, of_samples(samples, parts))));
        others.chain(sampled).chain([("surface", surface()), ("background", background())]).collect()
    }

    #[test]
    fn all_are_valid() {
        for (name, source) in all() {
            assert!(!parsed(name, &source).entry_points.is_empty(), "{name}");
        }
    }

    /// Size of a Rust struct, and the offsets of its fields.
    struct Ours(&'static str, &'static str, usize, Vec<(&'static str, usize)>);

    macro_rules! ours {
        ($shader:literal, $name:literal, $ty:ty, $($field:ident)*) => {
            Ours($shader, $name, size_of::<$ty>(), vec![$((stringify!($field), offset_of!($ty, $field))),*])
        };
    }

    #[test]
    fn structs_are_laid_out_alike() {
        for Ours(shader, name, size, fields) in [
            ours!("surface", "View", uniforms::View, clip_from_world world_from_clip view_from_world eye_in_world viewport window
                first_light light_count exposure shown_light first_sample lights),
            ours!("surface", "Instance", uniforms::Instance, world_from_object world_from_object_normal flags),
            ours!("surface", "Texture", uniforms::Texture, linear offset uv_set present),
            ours!("surface", "Material", uniforms::Material, base_color emissive alpha_cutoff specular exponent metallic
                roughness normal_scale occlusion_strength ambient shading alpha_mode layer_count textures params layers),
            ours!("surface", "Layer", uniforms::Layer, linear offset uv_set kind mode projector shadow_texture flags factor),
            ours!("surface", "ShadowTexture", uniforms::ShadowTexture, light near far),
            ours!("surface", "Light", uniforms::Light, position kind direction range color shadow_intensity ambient cos_outer
                attenuation cone_scale first_face face_count filter_width slope_bias constant_bias map_flags size flags),
            ours!("surface", "MapFace", uniforms::MapFace, map_from_world world_from_map tile light texel depth),
            ours!("surface", "Frame", uniforms::Frame, ambient zenith horizon nadir fog_color fog_range fog_kind light_count
                receive_words world_from_room),
            ours!("contours", "Contour", contours::Uniform, world_from_object color line_px outline_px crease_cos),
            ours!("film", "Film", uniforms::Film, color),
            ours!("penumbra", "Source", soft::Source, toward_light size),
            ours!("deform", "Deformation", deform::Uniform, vertex_count target_count joint_count),
        ] {
            let (_, source) = all().into_iter().find(|(n, _)| *n == shader).unwrap();
            let module = parsed(shader, &source);
            let (_, theirs) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name)).unwrap();
            let naga::TypeInner::Struct { members, span } = &theirs.inner else { panic!("{name} is no struct") };
            let members: Vec<_> = members.iter().map(|m| (m.name.clone().unwrap(), m.offset as usize)).collect();
            let fields: Vec<_> = fields.into_iter().map(|(n, o)| (n.to_owned(), o)).collect();
            assert_eq!(members, fields, "{name}");
            // What follows the last field is padding, but an array's stride counts.
            let rounded = size.next_multiple_of(16);
            assert!(
                *span as usize == size || *span as usize == rounded || matches!(name, "Deformation" | "ShadowTexture"),
                "{name}: {span} {size}"
            );
        }
    }
}
