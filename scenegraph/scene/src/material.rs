//! Materials, textures and their pictures, and shaders of authors.

use crate::Layer;
use glam::{Affine2, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// How a surface looks.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name, for messages.
    pub name: String,
    /// Reflection model.
    pub shading: Shading,
    /// Linear RGBA; multiplied by the texture and the vertex colour.
    pub base_color: Vec4,
    /// Picture of the base colour, sRGB with linear alpha.
    pub base_color_texture: Option<TextureRef>,
    /// Blue: metalness, green: roughness; linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals, linear.
    pub normal_texture: Option<TextureRef>,
    /// Factor of the x and y of `normal_texture`.
    pub normal_scale: f32,
    /// Red: occlusion of ambient light, linear.
    pub occlusion_texture: Option<TextureRef>,
    /// 0: `occlusion_texture` has no effect, 1: full effect.
    pub occlusion_strength: f32,
    /// Linear RGB that the surface emits.
    pub emissive: Vec3,
    /// Picture of the emission, sRGB; multiplied with `emissive`.
    pub emissive_texture: Option<TextureRef>,
    /// More textures, each put over the base colour in turn; at most [`Material::MOST_LAYERS`] count.
    pub layers: Vec<Layer>,
    /// What alpha means.
    pub alpha: AlphaMode,
    /// Visible and lit from both sides; otherwise the side from which a triangle winds counter-clockwise.
    pub double_sided: bool,
    /// Replaces parts of the shading.
    pub shader: Option<FragmentShader>,
}

/// WGSL that replaces parts of the shading of a surface (003 section 5 and future work).
#[derive(Clone, Debug, PartialEq)]
pub struct FragmentShader {
    /// The text; equal `Arc`s are compared quickly.
    pub source: Arc<ShaderSource>,
    /// Names and values that the text reads as `params.name`.
    pub params: Vec<(Arc<str>, ShaderParam)>,
}

/// A text in WGSL.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct ShaderSource {
    /// File or node, for messages; line and column follow it.
    pub name: String,
    /// The text.
    pub text: String,
}

/// A value that a shader reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShaderParam {
    /// `f32`
    Scalar(f32),
    /// `vec2<f32>`
    Vec2(Vec2),
    /// `vec3<f32>`; linear RGB where it is a colour.
    Vec3(Vec3),
    /// `vec4<f32>`
    Vec4(Vec4),
}

/// Reflection model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shading {
    /// glTF 2.0 metallic-roughness (Lambert and GGX).
    MetallicRoughness {
        /// 0: dielectric, 1: metal.
        metallic: f32,
        /// Perceptual roughness, 0..=1.
        roughness: f32,
    },
    /// Blinn-Phong as in X3D and OpenGL Performer.
    Phong {
        /// Linear RGB of the highlight.
        specular: Vec3,
        /// Specular exponent, 1..=128 and more.
        exponent: f32,
        /// Share of ambient light that is reflected.
        ambient_intensity: f32,
    },
    /// The base colour as it is (KHR_materials_unlit).
    Unlit,
}

/// What the alpha of the base colour means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Ignored.
    #[default]
    Opaque,
    /// Below the cutoff the surface is not there, for the eye and for shadows.
    Mask {
        /// Smallest alpha that is there.
        cutoff: f32,
    },
    /// Mixed over what is behind.
    Blend,
}

/// A picture on a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureRef {
    /// The picture.
    pub image: Arc<Image>,
    /// Filter and wrap modes.
    pub sampler: Sampler,
    /// Which texture coordinates: 0 or 1.
    pub uv_set: u8,
    /// Maps the mesh's coordinates to the picture's (KHR_texture_transform).
    pub uv_from_mesh: Affine2,
}

/// Filter and wrap modes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sampler {
    /// Along u.
    pub wrap_u: Wrap,
    /// Along v.
    pub wrap_v: Wrap,
    /// Magnification, and minification within a level.
    pub filter: Filter,
    /// Use smaller copies of the picture (mip maps) for far surfaces.
    pub mip_maps: bool,
}

impl Default for Sampler {
    fn default() -> Sampler {
        Sampler { wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, filter: Filter::Linear, mip_maps: true }
    }
}

/// What is outside of 0..1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The picture again.
    #[default]
    Repeat,
    /// The picture again, every second one mirrored.
    Mirror,
    /// The picture's border.
    Clamp,
}

/// How texels are interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Bilinear.
    #[default]
    Linear,
}

/// A picture in memory: RGBA, 8 bit, rows from the top, no padding.
#[derive(Clone, PartialEq, Eq)]
pub struct Image {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// `4 * width * height` bytes.
    pub rgba: Arc<[u8]>,
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image({}x{})", self.width, self.height)
    }
}

impl Default for Material {
    fn default() -> Material {
        Material {
            name: String::new(),
            shading: Shading::MetallicRoughness { metallic: 0.0, roughness: 0.8 },
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            layers: Vec::new(),
            alpha: AlphaMode::Opaque,
            double_sided: false,
            shader: None,
        }
    }
}
