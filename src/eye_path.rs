//! Scores shadows from many places of the eye: a path that leads through casters and their shadows.

use crate::headless::progress;
use crate::shadow_error::Subject;
use glam::{Vec3, camera::rh::view::look_at_mat4};
use std::f32::consts::TAU;
use std::fmt;
use umbriel_render::{Gpu, Renderer};
use umbriel_scene::{Frustum, Mask, Picture, PictureKind, Scene, Tracer, View};

type Failure = Box<dyn std::error::Error>;

/// Pixels where nobody says how many.
pub(crate) const SIZE: [u32; 2] = [160, 120];
/// A score of shadows needs some; with less of the picture in shadow, intersection over union is not counted.
const LEAST_SHADOW: f64 = 0.005;
/// A picture of which more than this is wrong is inverted.
const INVERTED: f64 = 0.25;

/// The worst of all places.
#[derive(Clone, Debug, Default)]
pub(crate) struct PathScore {
    places: u32,
    /// Share of the pixels that are wrong, and the place.
    disagreement: (f64, u32),
    /// Intersection over union of the shadow, and the place.
    iou: (f64, u32),
    with_shadow: u32,
    inverted: u32,
    pixels: usize,
    /// Casters counted in front of what is seen and behind it, in all pictures.
    counted: [u32; 2],
}

impl fmt::Display for PathScore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [z_pass, z_fail] = self.counted;
        writeln!(f, "volumes counted in front {z_pass} times, behind {z_fail} times; shadow at {} places", self.with_shadow)?;
        write!(
            f,
            "places={} worst disagreement={:.4}% at {} worst iou={:.4} at {} inverted={} pixels={}",
            self.places,
            100.0 * self.disagreement.0,
            self.disagreement.1,
            self.iou.0,
            self.iou.1,
            self.inverted,
            self.pixels
        )
    }
}

/// Draws and traces every place.
pub(crate) fn score(subject: &mut Subject, places: u32) -> Result<PathScore, Failure> {
    let gpu = Gpu::new(None)?;
    let mut renderer = Renderer::new(&gpu)?;
    let tracer = Tracer::new(&subject.scene.with_full_casters());
    let mut found = PathScore { places, iou: (1.0, 0), ..PathScore::default() };
    let bar = progress(places, "places");
    for (place, view) in (0..places).zip(path(&subject.scene, &subject.view, places)) {
        let light = &subject.scene.lights[subject.light];
        let truth = tracer.visibility(light, &view, &subject.options, &|_| {})?;
        let picture = Picture { kind: PictureKind::LightVisibility(subject.light), ..Picture::mono(view) };
        let stats = renderer.render(&subject.scene, &[picture])?;
        let pixels = renderer.read_back(0)?.pop().ok_or("the renderer gave no picture")?;
        let visibility: Vec<u8> = pixels.rgba.chunks_exact(4).map(|p| p[0]).collect();
        let score = umbriel_scene::score(&truth, &visibility)?;
        let dark = truth.count(Mask::SHADOW);
        found.counted = [found.counted[0] + stats.volumes.z_pass, found.counted[1] + stats.volumes.z_fail];
        found.pixels += score.pixels;
        found.inverted += u32::from(score.disagreement > INVERTED);
        if score.disagreement > found.disagreement.0 {
            found.disagreement = (score.disagreement, place);
        }
        if dark as f64 >= LEAST_SHADOW * visibility.len() as f64 && score.pixels > 0 {
            found.with_shadow += 1;
            if score.iou < found.iou.0 {
                found.iou = (score.iou, place);
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    subject.problems.extend(renderer.problems());
    Ok(found)
}

/// Views along a closed path around the middle of the casters, low and high, in and out of what they shade.
fn path(scene: &Scene, from: &View, places: u32) -> impl Iterator<Item = View> {
    let boxes: Vec<_> = scene.drawables.iter().filter(|d| d.visible && d.casts_shadow).map(|d| d.bounds_in_world).collect();
    let count = boxes.len().max(1) as f32;
    let middle = boxes.iter().map(|b| b.centre()).sum::<Vec3>() / count;
    let spread = (boxes.iter().map(|b| (b.centre() - middle).powf(2.0)).sum::<Vec3>() / count).powf(0.5);
    let mut sizes: Vec<f32> = boxes.iter().map(|b| b.radius()).collect();
    sizes.sort_by(f32::total_cmp);
    let least = sizes.get(sizes.len() / 2).copied().unwrap_or(1.0);
    let reach = (1.5 * spread).max(Vec3::splat(0.75 * least));
    let (size, near) = (from.size, from.frustum.near.min(0.02 * reach.max_element()).max(1e-3));
    let at = move |t: f32| {
        let turn = TAU * t;
        middle + reach * Vec3::new(turn.sin(), 0.25 + 0.5 * (3.0 * turn).sin(), (2.0 * turn + 0.5).sin())
    };
    (0..places).map(move |place| {
        let t = place as f32 / places as f32;
        let eye = at(t);
        // Ahead, and now and then to the middle.
        let ahead = at(t + 0.03) - eye;
        let inward = middle - eye;
        let to = ahead.normalize_or(Vec3::Z).lerp(inward.normalize_or(Vec3::Z), 0.5 + 0.5 * (5.0 * TAU * t).sin());
        let up = if to.normalize_or(Vec3::Z).y.abs() > 0.98 { Vec3::X } else { Vec3::Y };
        View {
            name: format!("place {place}"),
            view_from_world: look_at_mat4(eye, eye + to, up),
            frustum: Frustum::symmetric(0.9, size[0] as f32 / size[1] as f32, near),
            size,
        }
    })
}
