//! What there is to draw.

use crate::{Aabb, Drawables, Light, Material, Mesh, Projector};
use glam::{Mat4, Vec3, Vec4};
use std::sync::Arc;

/// Everything that is drawn in a frame, in world space. Kept from frame to frame and updated in place.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Shapes. A place may be vacant ([`Drawable::visible`] false); places keep their shape as long as it lives.
    pub drawables: Drawables,
    /// Which of them are reduced casters: never seen, they throw the shadows of others.
    pub stand_ins: Vec<StandIn>,
    /// Light sources that are switched on, then those that only draw maps ([`Light::shines`]).
    pub lights: Vec<Light>,
    /// Lists of lights, as places in `lights`, that [`Drawable::receives`] names.
    pub receive_lists: Vec<Vec<usize>>,
    /// Projectors of textures, that [`crate::Coordinates::Projected`] names. A place may be vacant.
    pub projectors: Vec<Option<Projector>>,
    /// Shadow maps that are textures, that [`crate::LayerSource::ShadowMap`] names: places in `lights`. A place may be vacant.
    pub shadow_textures: Vec<Option<usize>>,
    /// Groups of casters made by `StencilShadow` nodes.
    pub stencil_groups: Vec<StencilGroup>,
    /// Shapes that are drawn with their contours. Of a shape in several of them, the last counts.
    pub contours: Vec<ContourGroup>,
    /// Light that reaches every surface from everywhere, linear RGB.
    pub ambient: Vec3,
    /// What is behind everything.
    pub background: Background,
    /// Haze, where there is any.
    pub fog: Option<Fog>,
    /// Factor of the linear picture before it is encoded; 1 leaves it.
    pub exposure: f32,
    /// How finely views are sampled.
    pub samples: Samples,
    /// Texture memory for all shadow maps, bytes. Where it is short, the least important lights get smaller maps.
    pub map_memory_bytes: u64,
    /// Where this scene's space is in a world that moves, for shaders that draw patterns in the world.
    pub world_from_room: Mat4,
}

impl Default for Scene {
    /// Nothing, as a camera without correction sees it.
    fn default() -> Scene {
        Scene {
            drawables: Drawables::default(),
            stand_ins: Vec::new(),
            lights: Vec::new(),
            receive_lists: Vec::new(),
            projectors: Vec::new(),
            shadow_textures: Vec::new(),
            stencil_groups: Vec::new(),
            contours: Vec::new(),
            ambient: Vec3::ZERO,
            background: Background::default(),
            fog: None,
            exposure: 1.0,
            samples: Samples::default(),
            map_memory_bytes: 1 << 30,
            world_from_room: Mat4::IDENTITY,
        }
    }
}

/// Samples of depth, stencil and colour per pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Samples {
    /// Edges are steps.
    One,
    /// Edges of shapes and of shadow volumes are smooth.
    #[default]
    Four,
}

impl Samples {
    /// Their number.
    pub fn count(self) -> u32 {
        match self {
            Samples::One => 1,
            Samples::Four => 4,
        }
    }

    /// Those of a number, where there are such.
    pub fn of(count: u32) -> Option<Samples> {
        [Samples::One, Samples::Four].into_iter().find(|s| s.count() == count)
    }
}

/// One shape at one place.
#[derive(Clone, Debug)]
pub struct Drawable {
    /// Name of its node, for messages and statistics.
    pub name: String,
    /// Its triangles; equal `Arc`s are drawn as instances.
    pub mesh: Arc<Mesh>,
    /// How it looks.
    pub material: Arc<Material>,
    /// Where it is. A mirroring matrix is fine.
    pub world_from_object: Mat4,
    /// Skin and morph weights, where the mesh has any.
    pub pose: Option<Arc<Pose>>,
    /// Box around it in the world, deformation included.
    pub bounds_in_world: Aabb,
    /// Drawn at all.
    pub visible: bool,
    /// Throws shadows.
    pub casts_shadow: bool,
    /// Shadows fall on it.
    pub receives_shadow: bool,
    /// The only lights whose shadows fall on it, a place in [`Scene::receive_lists`]: whether they cast on others or not, and
    /// their ambient light is shadowed too (003 section 4.1). `None`: those of all lights that cast.
    pub receives: Option<usize>,
    /// Grows with every change of this entry.
    pub revision: u64,
}

/// A drawable that throws a shadow in place of another one, and is not seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandIn {
    /// The one that casts: a place in [`Scene::drawables`].
    pub place: usize,
    /// The one that is seen, and does not cast.
    pub of: usize,
    /// How far the two surfaces are apart at most, in the space of the object, metres; NaN where nobody measured it.
    pub error_m: f32,
}

impl Scene {
    /// Shadows as if there were no reduced casters: what these are scored against.
    pub fn with_full_casters(&self) -> Scene {
        let mut scene = self.clone();
        for stand_in in scene.stand_ins.drain(..) {
            if let Some(d) = scene.drawables.get_mut(stand_in.place) {
                d.visible = false;
            }
            if let Some(d) = scene.drawables.get_mut(stand_in.of) {
                d.casts_shadow = true;
            }
        }
        scene
    }
}

/// Deformation of one drawable.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// `object_from_bind` matrix of each joint: the joint's present pose times its inverse bind matrix, in the space of
    /// the drawable's object. Empty where the mesh has no skin.
    pub object_from_bind: Vec<Mat4>,
    /// One weight per morph target of the mesh.
    pub morph_weights: Vec<f32>,
}

/// Casters that a `StencilShadow` node gathers (000 section 4.2).
#[derive(Clone, Debug, PartialEq)]
pub struct StencilGroup {
    /// Name of the node, for messages.
    pub name: String,
    /// Its light: a place in [`Scene::lights`].
    pub light: usize,
    /// Its casters: places in [`Scene::drawables`].
    pub casters: Vec<usize>,
    /// How its shadow is brought into the picture.
    pub mode: StencilMode,
}

/// How a stencil shadow is brought into the picture (000 section 3.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StencilMode {
    /// Additive light masking: the group's light is added outside its shadow only.
    Additive,
    /// The picture is tinted by a film where the group's shadow falls; the light itself shines everywhere.
    Modulative(Film),
}

/// Shapes and the lines that are drawn over them (001 section 4.3).
#[derive(Clone, Debug, PartialEq)]
pub struct ContourGroup {
    /// Places in [`Scene::drawables`].
    pub drawables: Vec<usize>,
    /// How lines look.
    pub style: ContourStyle,
}

/// Lines over the edges of a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContourStyle {
    /// Linear RGB.
    pub color: Vec3,
    /// Width of contours, pixels: edges between a triangle that the eye sees from its front and one that it sees from behind,
    /// and open edges; 0 draws none.
    pub line_px: f32,
    /// Width of the stroke around the silhouette, pixels, all of it outside of the shape; 0 draws none.
    pub outline_px: f32,
    /// Edges whose triangles turn by more than this are contours too, radians; infinite for none.
    pub crease_rad: f32,
}

/// The half-transparent film of the paper's `ShadowQuad`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// Linear RGB and opacity.
    pub color: Vec4,
}

impl Default for Film {
    /// Black at alpha 0.5, as in 000.
    fn default() -> Film {
        Film { color: Vec4::new(0.0, 0.0, 0.0, 0.5) }
    }
}

/// What is behind everything: a vertical gradient, linear RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Background {
    /// Straight up.
    pub zenith: Vec3,
    /// At the horizon, from above.
    pub horizon: Vec3,
    /// Straight down.
    pub nadir: Vec3,
}

/// Haze that hides what is far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fog {
    /// Linear RGB.
    pub color: Vec3,
    /// How it thickens.
    pub kind: FogKind,
    /// Distance at which nothing but fog is seen, metres (X3D `visibilityRange`).
    pub visibility_range: f32,
}

/// How fog thickens with distance (X3D Fog).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FogKind {
    /// Linearly.
    #[default]
    Linear,
    /// As `exp(-d / (range - d))`.
    Exponential,
}
