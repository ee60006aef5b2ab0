//! How stencil shadow volumes are made and counted.

use glam::Vec4;

/// Settings of stencil shadow volumes. None of them changes what is in shadow, but for `length`, `lower_plane` and, within the
/// texels of a map, `holes_by_map`; they say how it is found, so that each can be measured against the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeSettings {
    /// Where volumes are counted.
    pub counting: VolumeCounting,
    /// How silhouettes are found.
    pub silhouettes: Silhouettes,
    /// Leaves out volumes, caps and parts of the screen that cannot show a shadow (001 section 5.2).
    pub culling: bool,
    /// Draws a volume only where something is seen in it that receives (001 section 5.3). Only with `culling`.
    pub depth_bounds: bool,
    /// Volumes end behind the last surface that receives, instead of at infinity.
    pub fitted: bool,
    /// Shadows end this far behind what casts them, metres; infinite where unlimited. A lamp's volumes widen, so it holds
    /// for what casts nearest to it.
    pub length: f32,
    /// Nothing is seen below this plane, such as the surface of the sea: (normal, distance) with `normal . p + distance < 0`
    /// below.
    pub lower_plane: Option<Vec4>,
    /// What alpha cuts holes into casts by a map of the light instead of by rays through its texture, as it does wherever volumes
    /// have penumbrae.
    pub holes_by_map: bool,
}

/// Where shadow volumes are counted (000 section 3.2, 001 section 5.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum VolumeCounting {
    /// In front of what is seen where no part of the near plane can be in the caster's shadow, else behind it.
    #[default]
    Auto,
    /// Behind what is seen, always.
    ZFail,
}

/// How the silhouettes of casters are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Silhouettes {
    /// By a compute pass, once for all views.
    #[default]
    Compute,
    /// By degenerate quads that the vertex shader pulls apart, in each view (000 section 4.2).
    Quads,
}

impl Default for VolumeSettings {
    fn default() -> VolumeSettings {
        VolumeSettings {
            counting: VolumeCounting::default(),
            silhouettes: Silhouettes::default(),
            culling: true,
            depth_bounds: true,
            fitted: true,
            length: f32::INFINITY,
            lower_plane: None,
            holes_by_map: false,
        }
    }
}
