//! Several textures on one surface, and textures that are projected (003).

use crate::{Material, TextureRef};
use glam::{Mat4, Vec4};

impl Material {
    /// Layers of a material that are drawn.
    pub const MOST_LAYERS: usize = 4;
}

/// A stage of multi-texturing (X3D MultiTexture): its texture is combined with the base colour so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// What it shows.
    pub source: LayerSource,
    /// Where on the surface.
    pub coordinates: Coordinates,
    /// How it is combined.
    pub mode: LayerMode,
    /// Linear RGBA; the alpha of [`LayerMode::BlendFactorAlpha`].
    pub factor: Vec4,
}

/// What a layer shows.
#[derive(Clone, Debug, PartialEq)]
pub enum LayerSource {
    /// A picture, sRGB with linear alpha. With `border` there is nothing outside of 0..1: the layer is left out there.
    Picture {
        /// The picture.
        texture: TextureRef,
        /// Along u and v.
        border: [bool; 2],
    },
    /// A shadow map (003 section 4.4).
    ShadowMap {
        /// A place in [`crate::Scene::shadow_textures`].
        texture: usize,
        /// What it gives.
        compare: MapCompare,
    },
}

/// What a shadow map gives as a texture (003 section 4.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MapCompare {
    /// 1 where the light shines, 0 in shadow.
    #[default]
    LessEqual,
    /// 0 where the light shines, 1 in shadow.
    GreaterEqual,
    /// The depth as grey: 0 at the near, 1 at the far distance and where nothing is.
    None,
}

/// Where a texture lies on a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coordinates {
    /// Where the mesh says.
    #[default]
    Mesh,
    /// Where it falls from a projector, a place in [`crate::Scene::projectors`]. Nothing falls behind the projector.
    Projected(usize),
}

/// How the texture T of a layer is combined with the colour C so far (X3D MultiTexture `mode`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LayerMode {
    /// T C.
    #[default]
    Modulate,
    /// 2 T C.
    Modulate2x,
    /// 4 T C.
    Modulate4x,
    /// T.
    Replace,
    /// T + C.
    Add,
    /// T + C - 0.5.
    AddSigned,
    /// 2 (T + C - 0.5).
    AddSigned2x,
    /// T - C.
    Subtract,
    /// T + C - T C.
    AddSmooth,
    /// Mixed by the alpha of the material: 1 shows T.
    BlendDiffuseAlpha,
    /// Mixed by the alpha of T: 1 shows T.
    BlendTextureAlpha,
    /// Mixed by [`Layer::factor`]: 1 shows T.
    BlendFactorAlpha,
    /// Mixed by the alpha of C: 1 shows T.
    BlendCurrentAlpha,
    /// C.
    Off,
}

impl LayerMode {
    /// All, in the order of the shaders' numbers.
    pub const ALL: [LayerMode; 14] = [
        LayerMode::Modulate,
        LayerMode::Modulate2x,
        LayerMode::Modulate4x,
        LayerMode::Replace,
        LayerMode::Add,
        LayerMode::AddSigned,
        LayerMode::AddSigned2x,
        LayerMode::Subtract,
        LayerMode::AddSmooth,
        LayerMode::BlendDiffuseAlpha,
        LayerMode::BlendTextureAlpha,
        LayerMode::BlendFactorAlpha,
        LayerMode::BlendCurrentAlpha,
        LayerMode::Off,
    ];
}

/// What textures are projected from (003 section 4.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projector {
    /// A light, a place in [`crate::Scene::lights`]: as its shadow map is drawn. No light into all directions.
    Light(usize),
    /// A viewpoint.
    Viewpoint {
        /// Its pose, without scale; it looks along -z.
        world_from_view: Mat4,
        /// Both angles of view, radians. While a camera looks through the viewpoint its window counts instead.
        angle_rad: f32,
        /// Where a camera stands that looks through it: elsewhere than the viewpoint, if the world moved.
        world_from_camera: Mat4,
    },
}
