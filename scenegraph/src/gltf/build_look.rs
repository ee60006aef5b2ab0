//! Materials and textures of a model.

use super::build::{Builder, color};
use super::container::UvTransform;
use super::error::{Fault, label};
use glam::{Vec2, Vec3, Vec4};
use gltf::material::{AlphaMode, Material};
use gltf::texture::{Info, MagFilter, MinFilter, Texture, WrappingMode};
use std::collections::HashMap;
use umbriel_fields::NodeId;

/// The ImageTexture nodes that were made; equal uses of a texture share one.
type Textures = HashMap<(usize, u32, [u32; 5]), Option<NodeId>>;

/// How a material uses a texture.
struct Use<'a> {
    texture: Texture<'a>,
    uv_set: u32,
    translation: Vec2,
    rotation: f32,
    scale: Vec2,
}

impl<'a> Use<'a> {
    /// Of a base colour, metal and roughness, or emission.
    fn of(info: Info<'a>) -> Use<'a> {
        let plain = Use::plain(info.texture(), info.tex_coord());
        match info.texture_transform() {
            Some(t) => plain.transformed(&UvTransform {
                offset: t.offset(),
                rotation: t.rotation(),
                scale: t.scale(),
                tex_coord: t.tex_coord(),
            }),
            None => plain,
        }
    }

    /// Of normals or occlusion.
    fn with(texture: Texture<'a>, uv_set: u32, transform: Option<&UvTransform>) -> Use<'a> {
        let plain = Use::plain(texture, uv_set);
        match transform {
            Some(t) => plain.transformed(t),
            None => plain,
        }
    }

    fn plain(texture: Texture<'a>, uv_set: u32) -> Use<'a> {
        Use { texture, uv_set, translation: Vec2::ZERO, rotation: 0.0, scale: Vec2::ONE }
    }

    fn transformed(self, t: &UvTransform) -> Use<'a> {
        Use {
            texture: self.texture,
            uv_set: t.tex_coord.unwrap_or(self.uv_set),
            translation: t.offset.into(),
            rotation: t.rotation,
            scale: t.scale.into(),
        }
    }

    /// Two uses with the same key look the same.
    fn key(&self) -> (usize, u32, [u32; 5]) {
        let Use { translation: t, rotation: r, scale: s, .. } = self;
        (self.texture.index(), self.uv_set, [t.x, t.y, *r, s.x, s.y].map(f32::to_bits))
    }
}

impl Builder<'_> {
    /// An Appearance for each material, and one for shapes without any.
    pub(super) fn make_appearances(&mut self) -> Result<HashMap<Option<usize>, NodeId>, Fault> {
        let document = &self.content.source.document;
        let mut textures = Textures::new();
        let mut out = HashMap::new();
        for material in document.materials() {
            out.insert(material.index(), self.make_appearance(&material, &mut textures)?);
        }
        let bare = document.meshes().flat_map(|m| m.primitives()).find(|p| p.material().index().is_none());
        if let Some(primitive) = bare {
            out.insert(None, self.make_appearance(&primitive.material(), &mut textures)?);
        }
        Ok(out)
    }

    fn make_appearance(&mut self, material: &Material<'_>, textures: &mut Textures) -> Result<NodeId, Fault> {
        let appearance = self.create("Appearance", material.name())?;
        let look = if material.unlit() { self.make_unlit(material, textures)? } else { self.make_lit(material, textures)? };
        self.set(appearance, "material", look)?;
        let mode = match material.alpha_mode() {
            AlphaMode::Opaque => "opaque",
            AlphaMode::Mask => "mask",
            AlphaMode::Blend => "blend",
        };
        self.set(appearance, "alpha_mode", mode)?;
        self.set(appearance, "alpha_cutoff", material.alpha_cutoff().unwrap_or(0.5).clamp(0.0, 1.0))?;
        self.set(appearance, "double_sided", material.double_sided())?;
        Ok(appearance)
    }

    fn make_unlit(&mut self, material: &Material<'_>, textures: &mut Textures) -> Result<NodeId, Fault> {
        let look = self.create("UnlitMaterial", None)?;
        let pbr = material.pbr_metallic_roughness();
        let base = Vec4::from_array(pbr.base_color_factor());
        self.set(look, "emissive_color", color(base.truncate()))?;
        self.set(look, "transparency", (1.0 - base.w).clamp(0.0, 1.0))?;
        self.set_texture(look, "emissive_texture", pbr.base_color_texture().map(Use::of), textures)?;
        Ok(look)
    }

    fn make_lit(&mut self, material: &Material<'_>, textures: &mut Textures) -> Result<NodeId, Fault> {
        let look = self.create("PhysicalMaterial", None)?;
        let pbr = material.pbr_metallic_roughness();
        let (base, metallic, roughness, base_texture) = match material.pbr_specular_glossiness() {
            Some(sg) => {
                let object = label("material", material.index().unwrap_or(0), material.name());
                let lost =
                    if sg.specular_glossiness_texture().is_some() { " without its specular-glossiness texture" } else { "" };
                self.warnings.push(format!("{object}: KHR_materials_pbrSpecularGlossiness is approximated{lost}"));
                let diffuse = Vec4::from_array(sg.diffuse_factor());
                let (base, metallic) = metal_from_specular(diffuse.truncate(), Vec3::from_array(sg.specular_factor()));
                (base.extend(diffuse.w), metallic, 1.0 - sg.glossiness_factor(), sg.diffuse_texture())
            }
            None => {
                let base = Vec4::from_array(pbr.base_color_factor());
                self.set_texture(look, "metallic_roughness_texture", pbr.metallic_roughness_texture().map(Use::of), textures)?;
                (base, pbr.metallic_factor(), pbr.roughness_factor(), pbr.base_color_texture())
            }
        };
        self.set(look, "base_color", color(base.truncate()))?;
        self.set(look, "transparency", (1.0 - base.w).clamp(0.0, 1.0))?;
        self.set(look, "metallic", metallic.clamp(0.0, 1.0))?;
        self.set(look, "roughness", roughness.clamp(0.0, 1.0))?;
        self.set_texture(look, "base_texture", base_texture.map(Use::of), textures)?;
        let emission = Vec3::from_array(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0);
        self.set(look, "emissive_color", color(emission))?;
        self.set_texture(look, "emissive_texture", material.emissive_texture().map(Use::of), textures)?;
        let source = &self.content.source;
        let own = material.index().unwrap_or(usize::MAX);
        if let Some(normal) = material.normal_texture() {
            self.set(look, "normal_scale", normal.scale())?;
            let transform = source.normal_transforms.get(own).and_then(Option::as_ref);
            let used = Use::with(normal.texture(), normal.tex_coord(), transform);
            self.set_texture(look, "normal_texture", Some(used), textures)?;
        }
        if let Some(occlusion) = material.occlusion_texture() {
            self.set(look, "occlusion_strength", occlusion.strength().clamp(0.0, 1.0))?;
            let transform = source.occlusion_transforms.get(own).and_then(Option::as_ref);
            let used = Use::with(occlusion.texture(), occlusion.tex_coord(), transform);
            self.set_texture(look, "occlusion_texture", Some(used), textures)?;
        }
        Ok(look)
    }

    fn set_texture(&mut self, look: NodeId, field: &str, used: Option<Use<'_>>, textures: &mut Textures) -> Result<(), Fault> {
        let Some(used) = used else { return Ok(()) };
        let key = used.key();
        let node = match textures.get(&key) {
            Some(known) => *known,
            None => {
                let made = self.make_texture(&used)?;
                textures.insert(key, made);
                made
            }
        };
        node.map_or(Ok(()), |node| self.set(look, field, node))
    }

    /// None where the picture could not be had; that was warned about.
    fn make_texture(&mut self, used: &Use<'_>) -> Result<Option<NodeId>, Fault> {
        let texture = &used.texture;
        let Some(picture) = self.content.source.pictures[texture.source().index()].clone() else { return Ok(None) };
        let node = self.create("ImageTexture", texture.name().or(texture.source().name()))?;
        self.set(node, "image", picture)?;
        if used.uv_set > 1 {
            let object = label("texture", texture.index(), texture.name());
            self.warnings.push(format!("{object}: texture coordinates {} are not read; the first are used", used.uv_set));
        }
        self.set(node, "uv_set", i32::from(used.uv_set == 1))?;
        self.set(node, "translation", used.translation)?;
        self.set(node, "rotation", used.rotation)?;
        self.set(node, "scale", used.scale)?;
        let sampler = texture.sampler();
        self.set(node, "wrap_s", wrap(sampler.wrap_s()))?;
        self.set(node, "wrap_t", wrap(sampler.wrap_t()))?;
        self.set(node, "filter", if sampler.mag_filter() == Some(MagFilter::Nearest) { "nearest" } else { "linear" })?;
        self.set(node, "mip_maps", !matches!(sampler.min_filter(), Some(MinFilter::Nearest | MinFilter::Linear)))?;
        Ok(Some(node))
    }
}

fn wrap(mode: WrappingMode) -> &'static str {
    match mode {
        WrappingMode::ClampToEdge => "clamp",
        WrappingMode::MirroredRepeat => "mirror",
        WrappingMode::Repeat => "repeat",
    }
}

/// Base colour and metalness with nearly the same diffuse and specular reflection. With `base` and `metallic` m, diffuse is
/// base (1 - 0.04) (1 - m) and specular is mix(0.04, base, m); solved for m by perceived brightness, as the Khronos
/// group's conversion of KHR_materials_pbrSpecularGlossiness does.
fn metal_from_specular(diffuse: Vec3, specular: Vec3) -> (Vec3, f32) {
    const DIELECTRIC: f32 = 0.04;
    let brightness = |c: Vec3| Vec3::new(0.299, 0.587, 0.114).dot(c * c).sqrt();
    let (d, s, rest) = (brightness(diffuse), brightness(specular), 1.0 - specular.max_element().clamp(0.0, 1.0));
    let metallic = if s < DIELECTRIC {
        0.0
    } else {
        let b = d * rest / (1.0 - DIELECTRIC) + s - 2.0 * DIELECTRIC;
        let discriminant = (b * b - 4.0 * DIELECTRIC * (DIELECTRIC - s)).max(0.0);
        ((discriminant.sqrt() - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
    };
    let from_diffuse = diffuse * rest / (1.0 - DIELECTRIC) / (1.0 - metallic).max(1e-6);
    let from_specular = (specular - DIELECTRIC * (1.0 - metallic)) / metallic.max(1e-6);
    (from_diffuse.lerp(from_specular, metallic * metallic).clamp(Vec3::ZERO, Vec3::ONE), metallic)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specular_glossiness_to_metal() {
        for (diffuse, specular, base, metallic) in [
            (Vec3::new(0.5, 0.2, 0.1), Vec3::splat(0.04), Vec3::new(0.5, 0.2, 0.1), 0.0),
            (Vec3::ZERO, Vec3::new(1.0, 0.77, 0.34), Vec3::new(1.0, 0.77, 0.34), 1.0),
            (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, 0.0),
        ] {
            let (b, m) = metal_from_specular(diffuse, specular);
            assert!((b - base).abs().max_element() < 0.02 && (m - metallic).abs() < 0.02, "{diffuse} {specular}: {b} {m}");
        }
    }
}
