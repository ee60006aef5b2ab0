//! What can go wrong, told so that a world's author can act on it.

use std::path::PathBuf;

/// Everything that this crate reports.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A node of the rig cannot be used as it stands.
    #[error("{type_name} `{node}`, field `{field}`: {reason}")]
    Rig {
        /// Type of the node.
        type_name: &'static str,
        /// Name of the node, or its number where it has none.
        node: String,
        /// The field to look at.
        field: &'static str,
        /// What is wrong with it.
        reason: RigError,
    },
    /// Nothing can be seen under that name.
    #[error("there is no display or viewpoint `{name}`{}{}", nearest.as_ref().map(|n| format!("; did you mean `{n}`?")).unwrap_or_default(), listed(known))]
    UnknownView {
        /// What was asked for.
        name: String,
        /// The name that is most like it.
        nearest: Option<String>,
        /// All names, sorted.
        known: Vec<String>,
    },
    /// A field could not be read or written.
    #[error(transparent)]
    Fields(#[from] umbriel_fields::Error),
    /// A file cannot be watched.
    #[error("cannot watch {}: {reason}", path.display())]
    Watch {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// There is no window system, or it refused a window.
    #[error("cannot open a window: {0}")]
    Window(String),
    /// The renderer gave up.
    #[error(transparent)]
    Render(#[from] umbriel_render::Error),
}

/// Why a rig gives no picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RigError {
    /// NaN or infinity.
    #[error("a number is not finite")]
    NotFinite,
    /// A screen whose corners are in one line or one point.
    #[error("the corners of the screen span no area")]
    NoArea,
    /// A screen that is no rectangle.
    #[error("the sides of the screen are not at a right angle: they meet at {angle_deg:.1} degrees")]
    NotRectangular {
        /// Angle at the lower left corner.
        angle_deg: f64,
    },
    /// An eye from which the front of the screen is not seen.
    #[error("the eye is not in front of the screen ({distance_m:.3} m): check the order of the corners")]
    EyeNotInFront {
        /// Distance to the plane of the screen, negative behind it.
        distance_m: f64,
    },
    /// A near plane at or behind the eye.
    #[error("the near plane must be at a positive distance, not {near}")]
    Near {
        /// What it is.
        near: f32,
    },
    /// An angle that spans nothing, or half of everything.
    #[error("the field of view must be between 0 and pi, not {fov_rad}")]
    FieldOfView {
        /// What it is.
        fov_rad: f32,
    },
    /// A frustum without width or height.
    #[error("entry {index} is no frustum: left < right and bottom < top are needed, not {value}")]
    Frustum {
        /// Place in the field.
        index: usize,
        /// Tangents: left, right, bottom, top.
        value: glam::Vec4,
    },
    /// A headset has one or two eyes.
    #[error("one frustum or a left and a right one are needed, not {count}")]
    FrustumCount {
        /// How many there are.
        count: usize,
    },
    /// A size in pixels that cannot be drawn.
    #[error("a view must be 1 to {max} pixels across and down, not {width} x {height}")]
    Size {
        /// Across.
        width: f32,
        /// Down.
        height: f32,
        /// Largest that can be.
        max: u32,
    },
    /// A display that shows nothing.
    #[error("the display has nothing to show: give it screens, frusta or a viewpoint")]
    NoScreens,
    /// A display without somebody to look at it.
    #[error("the display needs a User, and there is none")]
    NoUser,
    /// A reference to a node that is gone or of another type.
    #[error("a {expected} is needed, not {found}")]
    WrongNode {
        /// Type that the field refers to.
        expected: &'static str,
        /// What is there instead.
        found: String,
    },
    /// A viewpoint that nothing in the world has as a child.
    #[error("the viewpoint is not in the world: add it to the children of the world or of a group")]
    NotInWorld,
    /// Red and cyan are two views.
    #[error("anaglyph shows one screen, not {screens} screens: use one display for each")]
    Anaglyph {
        /// How many the display has.
        screens: usize,
    },
    /// Two eyes cannot be shown.
    #[error("`mono` shows one eye only: choose side_by_side, top_bottom, anaglyph, row or layers for stereo")]
    MonoStereo,
}

fn listed(known: &[String]) -> String {
    if known.is_empty() { "; there are none".to_owned() } else { format!("; there are: {}", known.join(", ")) }
}
