//! Light sources and how each casts its shadows.

use crate::VolumeSettings;
use glam::Vec3;

/// A light source in world space.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Name of the node it came from, for messages.
    pub name: String,
    /// Kind and the cone, where it has one.
    pub kind: LightKind,
    /// Position in the world, metres. Of a directional light: the place its projection is centred on when set by hand.
    pub position: Vec3,
    /// Unit vector along which the light travels (from the light into the scene).
    pub direction: Vec3,
    /// What is above in its map and in what it projects (003 section 4.3); need not be at right angles to `direction`.
    /// `None`: up in the world.
    pub up: Option<Vec3>,
    /// False for a light that only draws its map, for a texture of it (003 section 4.4).
    pub shines: bool,
    /// Linear RGB colour.
    pub color: Vec3,
    /// Lux for directional lights, candela for the others (as KHR_lights_punctual). A white surface that a directional
    /// light of intensity pi meets at right angles reflects exactly 1.
    pub intensity: f32,
    /// Share of `color` that reaches every surface in reach, shadowed or not (X3D `ambientIntensity`).
    pub ambient_intensity: f32,
    /// Constant, linear and quadratic attenuation. (0, 0, 1) is the inverse square law.
    pub attenuation: Vec3,
    /// Beyond this distance the light has no effect, metres; infinite where unlimited. Unused by directional lights.
    pub range: f32,
    /// How it casts shadows.
    pub shadows: ShadowMethod,
    /// Share of the light that a shadow takes away, 0..=1.
    pub shadow_intensity: f32,
    /// Size of the source, from which penumbrae follow: of a directional light the tangent of half the angle under which
    /// it is seen, of the others the radius, metres. The sun's is [`Light::SUN_SIZE`].
    pub size: f32,
    /// Its shadow volumes have penumbrae (004).
    pub soft: bool,
    /// Settings of the shadow map, read when `shadows` is [`ShadowMethod::Map`].
    pub map: MapSettings,
    /// Settings of the shadow volumes, read when `shadows` is [`ShadowMethod::Volume`] and by stencil groups.
    pub volume: VolumeSettings,
}

/// Kind of a light source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel light, such as the sun.
    Directional,
    /// A cone of light. Full strength inside `inner_rad`, none outside `outer_rad`; both are half angles.
    Spot {
        /// Half angle of the cone of full strength, radians.
        inner_rad: f32,
        /// Half angle of the whole cone, radians, below pi.
        outer_rad: f32,
    },
    /// Light into all directions.
    Point,
}

/// How a light casts shadows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ShadowMethod {
    /// Shines through everything.
    #[default]
    None,
    /// Shadow map.
    Map,
    /// Stencil shadow volumes.
    Volume,
}

/// Filter of a shadow map look-up (003 section 4.2, `fpLightSource` of 000).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MapFilter {
    /// One comparison, nearest texel.
    None,
    /// Hardware 2x2 comparison, bilinear.
    Hardware,
    /// 4 bilinear comparisons.
    Pcf4,
    /// 16 bilinear comparisons.
    #[default]
    Pcf16,
    /// 16 bilinear comparisons over a disc that is turned from place to place.
    Poisson,
    /// Penumbrae that follow from [`Light::size`]: hard at the contact, wider with the distance to the caster
    /// (Fernando 2005, Percentage-closer soft shadows).
    Pcss,
}

/// When a shadow map is drawn anew (003 section 4.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MapUpdate {
    /// When the light and a caster in its reach moved relative to each other, or a caster changed.
    #[default]
    Auto,
    /// Never: it stays as it was drawn. It is drawn where there is none yet.
    Never,
    /// In every frame.
    Always,
    /// In this frame. Whoever keeps the scene says [`MapUpdate::Never`] from the next frame on.
    Next,
}

/// Settings of a shadow map. `None` means fitted to the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapSettings {
    /// Side of the square map, texels. The renderer reports a size it cannot make and uses the nearest it can.
    pub size: u32,
    /// Left, right, bottom, top of the light's frustum at distance 1 (spot) or in metres (directional), by hand.
    pub frustum: Option<[f32; 4]>,
    /// Near and far distance of the light's frustum, metres, by hand. One that is not finite is fitted.
    pub near_far: Option<[f32; 2]>,
    /// A change of this number draws the map once, whatever `update` says. 0: where that says [`MapUpdate::Never`], the map was
    /// never asked for and starts empty. `None`: it starts drawn.
    pub request: Option<u32>,
    /// Manual bias that grows with the depth slope, texels (000 displace scale); `None` tunes itself.
    pub slope_bias: Option<f32>,
    /// Manual constant bias, metres (000 displace offset); `None` tunes itself.
    pub constant_bias: Option<f32>,
    /// Filter of look-ups.
    pub filter: MapFilter,
    /// When the map is drawn anew.
    pub update: MapUpdate,
    /// What is outside of a `frustum` set by hand is in shadow (003) instead of lit.
    pub outside_in_shadow: bool,
}

impl Default for MapSettings {
    fn default() -> MapSettings {
        MapSettings {
            size: 2048,
            frustum: None,
            near_far: None,
            request: None,
            slope_bias: None,
            constant_bias: None,
            filter: MapFilter::default(),
            update: MapUpdate::default(),
            outside_in_shadow: false,
        }
    }
}

impl Light {
    /// Tangent of half the angle under which the sun is seen (0.533 degrees).
    pub const SUN_SIZE: f32 = 0.00465;
}

impl Default for Light {
    fn default() -> Light {
        Light {
            name: String::new(),
            kind: LightKind::Directional,
            position: Vec3::ZERO,
            direction: Vec3::NEG_Z,
            up: None,
            shines: true,
            color: Vec3::ONE,
            intensity: std::f32::consts::PI,
            ambient_intensity: 0.0,
            attenuation: Vec3::Z,
            range: f32::INFINITY,
            shadows: ShadowMethod::None,
            shadow_intensity: 1.0,
            size: 0.0,
            soft: false,
            map: MapSettings::default(),
            volume: VolumeSettings::default(),
        }
    }
}
