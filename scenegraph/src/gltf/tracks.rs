//! Animations as keys and values for interpolators (glTF 2.0 specification, section 3.11 and appendix C).

use super::accessor::{Accessors, name_of};
use super::content::target_count;
use super::error::{Fault, label};
use super::surface::Surface;
use glam::{Quat, Vec3, Vec4};
use gltf::accessor::{Accessor, Dimensions};
use gltf::animation::{Channel, Interpolation, Property};
use std::collections::HashMap;

/// One animation: a clock and what it drives.
pub(crate) struct Animation {
    pub(crate) name: Option<String>,
    /// Seconds from 0 to the last key of all tracks; 1 where that is 0.
    pub(crate) duration_s: f32,
    pub(crate) tracks: Vec<Track>,
}

/// The course of one property of one node.
pub(crate) struct Track {
    pub(crate) node: usize,
    /// Fractions of the duration, ascending.
    pub(crate) keys: Vec<f32>,
    /// Value of the field `interpolation`.
    pub(crate) interpolation: &'static str,
    pub(crate) values: Values,
}

/// The property and its values; for cubic splines in-tangent, value and out-tangent of each key.
#[derive(Debug, PartialEq)]
pub(crate) enum Values {
    Translation(Vec<Vec3>),
    Rotation(Vec<Quat>),
    Scale(Vec<Vec3>),
    /// All weights of a key one after the other.
    Weights(Vec<f32>),
}

/// Decodes all animations; also says what was left out.
pub(crate) fn read_animations(
    accessors: &Accessors<'_>,
    meshes: &[Vec<Option<Surface>>],
) -> Result<(Vec<Animation>, Vec<String>), Fault> {
    let (mut out, mut warnings) = (Vec::new(), Vec::new());
    for animation in accessors.source.document.animations() {
        let object = label("animation", animation.index(), animation.name());
        let mut times = HashMap::new();
        let mut used = Vec::new();
        for (c, channel) in animation.channels().enumerate() {
            let place = format!("{object}, channel {c}");
            let targets = channel.target().node().mesh().map_or(0, |m| target_count(&meshes[m.index()]));
            if channel.target().property() == Property::MorphTargetWeights && targets == 0 {
                warnings.push(format!("{place}: it moves weights of a node without morph targets and is left out"));
                continue;
            }
            let input = channel.sampler().input();
            if let std::collections::hash_map::Entry::Vacant(entry) = times.entry(input.index()) {
                entry.insert(read_times(accessors, &input)?);
            }
            used.push((place, channel, input.index(), targets));
        }
        let last = times.values().filter_map(|t: &Vec<f32>| t.last().copied()).fold(0.0, f32::max);
        let duration_s = if last > 0.0 { last } else { 1.0 };
        let tracks: Result<_, _> = used
            .into_iter()
            .map(|(place, channel, input, targets)| read_track(accessors, &place, &channel, &times[&input], targets, duration_s))
            .collect();
        out.push(Animation { name: animation.name().map(str::to_owned), duration_s, tracks: tracks? });
    }
    Ok((out, warnings))
}

/// Ascending times, seconds.
fn read_times(accessors: &Accessors<'_>, input: &Accessor<'_>) -> Result<Vec<f32>, Fault> {
    let times: Vec<f32> = accessors.floats::<1>(input, &[Dimensions::Scalar])?.into_iter().map(|[t]| t).collect();
    if times.is_empty() {
        return Err(Fault::data(name_of(input), "has no keys"));
    }
    if times[0] < 0.0 {
        return Err(Fault::data(name_of(input), format!("its first key is at {} seconds, before 0", times[0])));
    }
    if let Some(i) = times.windows(2).position(|w| w[1] < w[0]) {
        let message = format!("key {} at {} seconds comes after {} seconds", i + 1, times[i + 1], times[i]);
        return Err(Fault::data(name_of(input), message));
    }
    Ok(times)
}

fn read_track(
    accessors: &Accessors<'_>,
    place: &str,
    channel: &Channel<'_>,
    times: &[f32],
    targets: usize,
    duration_s: f32,
) -> Result<Track, Fault> {
    let (target, sampler) = (channel.target(), channel.sampler());
    let output = sampler.output();
    let (interpolation, per_key) = match sampler.interpolation() {
        Interpolation::Linear => ("linear", 1),
        Interpolation::Step => ("step", 1),
        Interpolation::CubicSpline => ("cubic_spline", 3),
    };
    let lanes = if target.property() == Property::MorphTargetWeights { targets } else { 1 };
    let expected = times.len() * per_key * lanes;
    if output.count() != expected {
        let message = format!("has {} values where {place} needs {expected} for {} keys", output.count(), times.len());
        return Err(Fault::data(name_of(&output), message));
    }
    accessors.budget.take(4 * times.len() as u64, place)?;
    // Tangents are per second; interpolators take them per fraction of the cycle.
    let tangent = |i: usize| per_key == 3 && i / lanes % 3 != 1;
    let scale = |i: usize| if tangent(i) { duration_s } else { 1.0 };
    let vec3 = || -> Result<Vec<Vec3>, Fault> {
        let values = accessors.floats::<3>(&output, &[Dimensions::Vec3])?;
        Ok(values.into_iter().enumerate().map(|(i, v)| Vec3::from_array(v) * scale(i)).collect())
    };
    let values = match target.property() {
        Property::Translation => Values::Translation(vec3()?),
        Property::Scale => Values::Scale(vec3()?),
        Property::Rotation => {
            let values = accessors.floats::<4>(&output, &[Dimensions::Vec4])?.into_iter().enumerate();
            let quat = |(i, v)| {
                let v = Vec4::from_array(v) * scale(i);
                Quat::from_vec4(if tangent(i) { v } else { v.try_normalize().unwrap_or(Vec4::W) })
            };
            Values::Rotation(values.map(quat).collect())
        }
        Property::MorphTargetWeights => {
            let values = accessors.floats::<1>(&output, &[Dimensions::Scalar])?;
            Values::Weights(values.into_iter().enumerate().map(|(i, [w])| w * scale(i)).collect())
        }
    };
    let keys = times.iter().map(|t| t / duration_s).collect();
    Ok(Track { node: target.node().index(), keys, interpolation, values })
}
