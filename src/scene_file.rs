//! Scene files: models, one light and one camera in JSON, from which shadow masks are made.
//!
//! The keys are those of the format that the masks of reference were made from. Places are metres, y up.

use glam::{DMat4, DQuat, DVec3, Mat4, Quat, Vec3};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use umbriel_scene::{Frustum, Light, LightKind, TraceOptions, View};

/// Distance of the near plane of the views that are read, metres. The file's window is scaled to it.
const NEAR: f64 = 0.05;

/// A scene file, checked and in our own terms.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SceneFile {
    /// What is in the scene.
    pub(crate) models: Vec<PlacedModel>,
    /// The light; how it casts shadows is left to whoever draws.
    pub(crate) light: Light,
    /// The camera and the size of the picture.
    pub(crate) view: View,
    /// How its mask is traced.
    pub(crate) options: TraceOptions,
}

/// A model and its place.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlacedModel {
    /// Its file; relative paths have been joined to the folder of the scene file.
    pub(crate) file: PathBuf,
    /// Scaled, then turned about y, then moved.
    pub(crate) world_from_model: Mat4,
    /// Throws shadows.
    pub(crate) caster: bool,
    /// Shadows fall on it.
    pub(crate) receiver: bool,
    /// All its materials have two sides, whatever the file says.
    pub(crate) double_sided: bool,
}

/// Why a scene file cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SceneFileError {
    /// It cannot be read.
    #[error("{file}: {source}")]
    Read { file: String, source: std::io::Error },
    /// It is no JSON, a key is unknown or missing, or a value has the wrong type.
    #[error("{file}: {source}")]
    Json { file: String, source: serde_json::Error },
    /// A value makes no sense.
    #[error("{file}: '{key}' {problem}")]
    Value { file: String, key: &'static str, problem: String },
}

/// Reads and checks a scene file.
pub(crate) fn read(path: &Path) -> Result<SceneFile, SceneFileError> {
    let file = || path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|source| SceneFileError::Read { file: file(), source })?;
    parse(&text, path)
}

fn parse(text: &str, path: &Path) -> Result<SceneFile, SceneFileError> {
    let file = || path.display().to_string();
    let scene: SceneJson = serde_json::from_str(text).map_err(|source| SceneFileError::Json { file: file(), source })?;
    scene.checked(path).map_err(|Problem(key, problem)| SceneFileError::Value { file: file(), key, problem })
}

/// A key, and what is wrong with its value.
struct Problem(&'static str, String);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneJson {
    models: Vec<ModelJson>,
    light: LightJson,
    camera: CameraJson,
    size: [u32; 2],
    ss: Option<u32>,
    blend_casts: Option<bool>,
    cull: Option<bool>,
    eps: Option<f64>,
    graze: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelJson {
    file: PathBuf,
    #[serde(default)]
    t: [f64; 3],
    #[serde(default)]
    r_y_deg: f64,
    s: Option<f64>,
    caster: Option<bool>,
    receiver: Option<bool>,
    #[serde(default, rename = "doubleSided")]
    double_sided: bool,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum LightType {
    Directional,
    Point,
    Spot,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LightJson {
    #[serde(rename = "type")]
    kind: LightType,
    dir: Option<[f64; 3]>,
    pos: Option<[f64; 3]>,
    /// Half angle of the cone, radians.
    cutoff: Option<f64>,
    /// Lux or candela.
    intensity: Option<f32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraJson {
    eye: [f64; 3],
    target: Option<[f64; 3]>,
    up: Option<[f64; 3]>,
    fovy_deg: Option<f64>,
    /// Axis and angle in radians of the turn from looking along -z.
    orientation: Option<[f64; 4]>,
    /// Left, right, bottom, top at distance near, as `glFrustum`; goes with `right`, `up` and `fwd`.
    frustum: Option<[f64; 5]>,
    right: Option<[f64; 3]>,
    fwd: Option<[f64; 3]>,
}

impl SceneJson {
    fn checked(self, path: &Path) -> Result<SceneFile, Problem> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let defaults = TraceOptions::default();
        let options = TraceOptions {
            sub_samples: within("ss", self.ss.unwrap_or(defaults.sub_samples), 1, 64)?,
            fine_sub_samples: defaults.fine_sub_samples,
            graze: within("graze", self.graze.unwrap_or(defaults.graze), -1.0, 1.0)?,
            eps_scale: within("eps", self.eps.unwrap_or(defaults.eps_scale), 0.0, 1.0)?,
            eps_at_place: defaults.eps_at_place,
            cull: self.cull.unwrap_or(defaults.cull),
            blend_casts: self.blend_casts.unwrap_or(defaults.blend_casts),
        };
        for side in self.size {
            within("size", side, 1, 1 << 15)?;
        }
        let name = path.file_stem().map_or_else(|| "camera".into(), |stem| stem.to_string_lossy().into_owned());
        Ok(SceneFile {
            models: self.models.into_iter().map(|m| m.checked(folder)).collect::<Result<_, _>>()?,
            light: self.light.checked()?,
            view: self.camera.checked(name, self.size)?,
            options,
        })
    }
}

impl ModelJson {
    fn checked(self, folder: &Path) -> Result<PlacedModel, Problem> {
        let scale = self.s.unwrap_or(1.0) as f32;
        if scale == 0.0 || !scale.is_finite() {
            return Err(Problem("models.s", format!("is {scale}, it must be a number other than 0")));
        }
        let turn = Quat::from_rotation_y(within("models.r_y_deg", self.r_y_deg, -1e6, 1e6)?.to_radians() as f32);
        let place = point("models.t", self.t)?.as_vec3();
        Ok(PlacedModel {
            file: folder.join(self.file),
            world_from_model: Mat4::from_scale_rotation_translation(Vec3::splat(scale), turn, place),
            caster: self.caster.unwrap_or(true),
            receiver: self.receiver.unwrap_or(true),
            double_sided: self.double_sided,
        })
    }
}

impl LightJson {
    fn checked(self) -> Result<Light, Problem> {
        let needs = |key, what: &str| Problem(key, format!("is missing, {what} needs it"));
        let position = |what| point("light.pos", self.pos.ok_or_else(|| needs("light.pos", what))?);
        let direction = |what| unit("light.dir", self.dir.ok_or_else(|| needs("light.dir", what))?);
        let base = Light { name: "light".into(), ..Light::default() };
        let mut light = match self.kind {
            LightType::Directional => Light { direction: direction("a directional light")?.as_vec3(), ..base },
            LightType::Point => {
                Light { kind: LightKind::Point, position: position("a point light")?.as_vec3(), intensity: 100.0, ..base }
            }
            LightType::Spot => {
                let cutoff = self.cutoff.ok_or_else(|| needs("light.cutoff", "a spot"))?;
                let outer_rad = within("light.cutoff", cutoff, 1e-3, 3.1)? as f32;
                Light {
                    kind: LightKind::Spot { inner_rad: outer_rad * 0.75, outer_rad },
                    position: position("a spot")?.as_vec3(),
                    direction: direction("a spot")?.as_vec3(),
                    intensity: 100.0,
                    ..base
                }
            }
        };
        if let Some(intensity) = self.intensity {
            light.intensity = within("light.intensity", intensity, 0.0, f32::MAX)?;
        }
        Ok(light)
    }
}

impl CameraJson {
    fn checked(self, name: String, size: [u32; 2]) -> Result<View, Problem> {
        let eye = point("camera.eye", self.eye)?;
        let ([left, right, bottom, top, near], axes) = match self.frustum {
            Some(window) => (self.window(window)?, self.given_axes()?),
            None => (self.symmetric(size)?, self.turned_axes(eye)?),
        };
        let [right_axis, up_axis, forward] = axes;
        let [x, y, z] = [right_axis, up_axis, -forward].map(|axis| axis.extend(0.0));
        let world_from_view = DMat4::from_cols(x, y, z, eye.extend(1.0));
        if world_from_view.determinant().abs() < 1e-9 {
            return Err(Problem("camera", "has right, up and forward in one plane".into()));
        }
        // Where the axes are not at right angles the inverse is still what the rays need.
        let view_from_world = world_from_view.inverse().as_mat4();
        let [left, right, bottom, top] = [left, right, bottom, top].map(|edge| (edge * NEAR / near) as f32);
        Ok(View { name, view_from_world, frustum: Frustum { left, right, bottom, top, near: NEAR as f32 }, size })
    }

    fn window(&self, window: [f64; 5]) -> Result<[f64; 5], Problem> {
        let [left, right, bottom, top, near] = window;
        let sound = left < right && bottom < top && near > 0.0 && window.iter().all(|x| x.abs() < 1e9);
        sound.then_some(window).ok_or_else(|| {
            Problem("camera.frustum", format!("is {window:?}, it must be left < right, bottom < top and near above 0"))
        })
    }

    fn symmetric(&self, size: [u32; 2]) -> Result<[f64; 5], Problem> {
        let missing = || Problem("camera.fovy_deg", "is missing, a camera without frustum needs it".into());
        let angle = within("camera.fovy_deg", self.fovy_deg.ok_or_else(missing)?, 0.01, 179.0)?;
        let top = (angle.to_radians() / 2.0).tan();
        let right = top * f64::from(size[0]) / f64::from(size[1]);
        Ok([-right, right, -top, top, 1.0])
    }

    /// Right, up and forward as the file gives them.
    fn given_axes(&self) -> Result<[DVec3; 3], Problem> {
        let axis = |key, value: Option<[f64; 3]>| {
            unit(key, value.ok_or_else(|| Problem(key, "is missing, a camera with frustum needs it".into()))?)
        };
        Ok([axis("camera.right", self.right)?, axis("camera.up", self.up)?, axis("camera.fwd", self.fwd)?])
    }

    /// Right, up and forward from the orientation, or from the target and what is up.
    fn turned_axes(&self, eye: DVec3) -> Result<[DVec3; 3], Problem> {
        if let Some([x, y, z, angle]) = self.orientation {
            let axis = unit("camera.orientation", [x, y, z])?;
            let turn = DQuat::from_axis_angle(axis, within("camera.orientation", angle, -1e3, 1e3)?);
            return Ok([turn * DVec3::X, turn * DVec3::Y, turn * DVec3::NEG_Z]);
        }
        let ahead = point("camera.target", self.target.unwrap_or_default())? - eye;
        let forward = ahead.try_normalize().ok_or_else(|| Problem("camera.target", "is where the eye is".into()))?;
        let up = unit("camera.up", self.up.unwrap_or([0.0, 1.0, 0.0]))?;
        let across = forward.cross(up);
        if across.length() < 1e-6 {
            return Err(Problem("camera.up", "is along the view".into()));
        }
        let right = across.normalize();
        Ok([right, right.cross(forward), forward])
    }
}

fn within<T: PartialOrd + Copy + std::fmt::Display>(key: &'static str, value: T, low: T, high: T) -> Result<T, Problem> {
    let inside = value >= low && value <= high;
    inside.then_some(value).ok_or_else(|| Problem(key, format!("is {value}, it must be from {low} to {high}")))
}

fn point(key: &'static str, value: [f64; 3]) -> Result<DVec3, Problem> {
    let point = DVec3::from_array(value);
    let near = point.abs().max_element() < 1e9;
    near.then_some(point).ok_or_else(|| Problem(key, format!("is {value:?}, too far away")))
}

fn unit(key: &'static str, value: [f64; 3]) -> Result<DVec3, Problem> {
    let problem = || Problem(key, format!("is {value:?}, which is no direction"));
    DVec3::from_array(value).try_normalize().ok_or_else(problem)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn plain() -> Value {
        json!({
            "models": [{"file": "../town.glb"}],
            "light": {"type": "point", "pos": [3, 8, 3], "intensity": 800},
            "camera": {"eye": [1, 2, 3], "target": [1, 2, -7], "fovy_deg": 90},
            "size": [200, 100],
        })
    }

    fn with(path: &str, value: Value) -> Value {
        let mut scene = plain();
        *scene.pointer_mut(path).unwrap() = value;
        scene
    }

    fn parsed(scene: &Value) -> Result<SceneFile, SceneFileError> {
        parse(&serde_json::to_string_pretty(scene).unwrap(), Path::new("scenes/square.json"))
    }

    #[test]
    fn defaults_are_those_of_the_format() {
        let scene = parsed(&plain()).unwrap();
        assert_eq!(scene.options, TraceOptions::default());
        assert_eq!(scene.models[0].file, Path::new("scenes/../town.glb"));
        assert_eq!((scene.models[0].caster, scene.models[0].receiver, scene.models[0].double_sided), (true, true, false));
        assert_eq!((scene.view.name.as_str(), scene.view.size), ("square", [200, 100]));
        assert_eq!((scene.light.kind, scene.light.intensity), (LightKind::Point, 800.0));
    }

    #[test]
    fn models_are_scaled_then_turned_then_moved() {
        let model = json!([{"file": "a.glb", "t": [10, 0, 0], "r_y_deg": 90, "s": 2, "caster": false, "doubleSided": true}]);
        let scene = parsed(&with("/models", model)).unwrap();
        let at = scene.models[0].world_from_model.transform_point3(Vec3::X);
        assert!(at.abs_diff_eq(Vec3::new(10.0, 0.0, -2.0), 1e-6), "{at}");
        assert_eq!((scene.models[0].caster, scene.models[0].double_sided), (false, true));
    }

    #[test]
    fn cameras_see_points_at_their_places() {
        let half_turn = std::f64::consts::PI;
        // Camera, a point in the world, and its place in the picture: -1..1 to the right and up.
        let rows = [
            (json!({"eye": [1, 2, 3], "target": [1, 2, -7], "fovy_deg": 90}), [1.0, 2.0, -9.0], [0.0, 0.0]),
            (json!({"eye": [1, 2, 3], "target": [1, 2, -7], "fovy_deg": 90}), [5.0, 4.0, -1.0], [0.5, 0.5]),
            (json!({"eye": [0, 9, 0], "up": [0, 0, -1], "fovy_deg": 90}), [9.0, 0.0, -4.5], [0.5, 0.5]),
            (json!({"eye": [0, 0, 0], "orientation": [0, 2, 0, half_turn], "fovy_deg": 90}), [-1.0, 0.5, 1.0], [0.5, 0.5]),
            (
                json!({"eye": [0, 0, 1], "frustum": [-1, 3, 0, 2, 2], "right": [0, 0, -9], "up": [0, 1, 0], "fwd": [1, 0, 0]}),
                [2.0, 2.0, 1.0],
                [-0.5, 1.0],
            ),
        ];
        for (camera, point, expected) in rows {
            let view = parsed(&with("/camera", camera.clone())).unwrap().view;
            let clip = view.frustum.clip_from_view() * view.view_from_world * Vec3::from_array(point).extend(1.0);
            let found = [clip.x / clip.w, clip.y / clip.w];
            let near = clip.w > 0.0 && (0..2).all(|i| (found[i] - expected[i]).abs() < 1e-5);
            assert!(near, "{camera} {point:?}: {found:?}");
        }
    }

    #[test]
    fn lights_of_each_kind() {
        let spot = json!({"type": "spot", "pos": [0, 5, 0], "dir": [0, -3, 0], "cutoff": 0.6});
        let light = parsed(&with("/light", spot)).unwrap().light;
        assert!(matches!(light.kind, LightKind::Spot { outer_rad: 0.6, .. }), "{light:?}");
        assert_eq!((light.position, light.direction, light.intensity), (Vec3::Y * 5.0, Vec3::NEG_Y, 100.0));
        let sun = parsed(&with("/light", json!({"type": "directional", "dir": [0, 0, 2]}))).unwrap().light;
        assert_eq!((sun.kind, sun.direction), (LightKind::Directional, Vec3::Z));
    }

    #[test]
    fn errors_name_the_file_and_the_key() {
        let mut no_size = plain();
        no_size.as_object_mut().unwrap().remove("size");
        let eye = [0, 0, 0];
        let rows = [
            (json!([1]), "scenes/square.json: invalid type"),
            (no_size, "missing field `size`"),
            (with("/models/0", json!({"file": "a", "scale": 2})), "unknown field `scale`, expected one of `file`"),
            (with("/light", json!({"type": "spot", "cutof": 1})), "unknown field `cutof`"),
            (with("/light", json!({"type": "sun"})), "unknown variant `sun`"),
            (with("/light", json!({"type": "spot", "cutoff": 1, "pos": [0, 1, 0]})), "'light.dir' is missing, a spot needs it"),
            (with("/light", json!({"type": "spot", "dir": [0, 1, 0], "pos": eye})), "'light.cutoff' is missing"),
            (with("/light", json!({"type": "directional", "dir": eye})), "'light.dir' is [0.0, 0.0, 0.0], which is no direction"),
            (with("/light", json!({"type": "point", "dir": eye})), "'light.pos' is missing, a point light"),
            (with("/size", json!([0, 5])), "'size' is 0"),
            (with("/size", json!([5, 1e9 as u32])), "'size' is 1000000000, it must be from 1 to 32768"),
            (with("/models/0", json!({"file": "a", "s": 0})), "'models.s' is 0"),
            (with("/camera/fovy_deg", json!(180)), "'camera.fovy_deg' is 180"),
            (with("/camera/target", json!([1, 2, 3])), "'camera.target' is where the eye is"),
            (with("/camera", json!({"eye": [0, 9, 0], "fovy_deg": 40})), "'camera.up' is along the view"),
            (with("/camera", json!({"eye": eye})), "'camera.fovy_deg' is missing"),
            (with("/camera", json!({"eye": eye, "frustum": [1, -1, -1, 1, 1]})), "'camera.frustum'"),
            (with("/camera", json!({"eye": eye, "frustum": [-1, 1, -1, 1, 1], "up": [0, 1, 0]})), "'camera.right' is missing"),
        ];
        for (scene, expected) in rows {
            let message = parsed(&scene).expect_err(expected).to_string();
            assert!(message.starts_with("scenes/square.json: ") && message.contains(expected), "{message}");
        }
        let message = read(Path::new("no/such.json")).unwrap_err().to_string();
        assert!(message.starts_with("no/such.json: "), "{message}");
    }
}
