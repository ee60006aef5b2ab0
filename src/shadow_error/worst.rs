//! The worst of several views under one light.

use super::{Failure, Subject};
use std::fmt;
use umbriel_render::Renderer;
use umbriel_scene::{Mask, Picture, PictureKind, Tracer, View};

/// A score of shadows needs some; with less of the picture in shadow, intersection over union is not counted.
const LEAST_SHADOW: f64 = 0.005;
/// A picture of which more than this is wrong is inverted.
const INVERTED: f64 = 0.25;

/// What was found in several views, and in which of them it was worst.
#[derive(Clone, Debug)]
pub(super) struct Worst {
    pub(super) places: u32,
    /// Share of the pixels that are wrong, and the place.
    pub(super) disagreement: (f64, u32),
    /// Intersection over union of the shadow, and the place.
    pub(super) iou: (f64, u32),
    /// Places with enough shadow for an intersection over union.
    pub(super) with_shadow: u32,
    pub(super) inverted: u32,
    pub(super) pixels: usize,
    /// Casters counted in front of what is seen and behind it, in all views.
    pub(super) counted: [u32; 2],
}

impl Worst {
    /// Nothing was looked at yet.
    pub(super) fn new() -> Worst {
        let (disagreement, iou) = ((0.0, 0), (1.0, 0));
        Worst { places: 0, disagreement, iou, with_shadow: 0, inverted: 0, pixels: 0, counted: [0; 2] }
    }

    /// Draws and traces every view. `done` hears when one is.
    pub(super) fn of(renderer: &mut Renderer, subject: &mut Subject, views: &[View], done: &dyn Fn()) -> Result<Worst, Failure> {
        let tracer = Tracer::new(&subject.scene.with_full_casters());
        let mut found = Worst::new();
        for view in views {
            found.look(renderer, &tracer, subject, view.clone())?;
            done();
        }
        subject.problems.extend(renderer.problems());
        Ok(found)
    }

    fn look(&mut self, renderer: &mut Renderer, tracer: &Tracer, subject: &Subject, view: View) -> Result<(), Failure> {
        let light = &subject.scene.lights[subject.light];
        let truth = tracer.visibility(light, &view, &subject.options, &|_| {})?;
        let picture = Picture { kind: PictureKind::LightVisibility(subject.light), ..Picture::mono(view) };
        let stats = renderer.render(&subject.scene, &[picture])?;
        let pixels = renderer.read_back(0)?.pop().ok_or("the renderer gave no picture")?;
        let visibility: Vec<u8> = pixels.rgba.chunks_exact(4).map(|p| p[0]).collect();
        let score = umbriel_scene::score(&truth, &visibility)?;
        let dark = truth.count(Mask::SHADOW);
        let has_shadow = dark as f64 >= LEAST_SHADOW * visibility.len() as f64 && score.pixels > 0;
        self.add(&Worst {
            places: 1,
            disagreement: (score.disagreement, 0),
            iou: (if has_shadow { score.iou } else { 1.0 }, 0),
            with_shadow: has_shadow.into(),
            inverted: u32::from(score.disagreement > INVERTED),
            pixels: score.pixels,
            counted: [stats.volumes.z_pass, stats.volumes.z_fail],
        });
        Ok(())
    }

    /// Takes what was found elsewhere as further places.
    pub(super) fn add(&mut self, other: &Worst) {
        let at = |place: (f64, u32)| (place.0, self.places + place.1);
        let (disagreement, iou) = (at(other.disagreement), at(other.iou));
        self.disagreement = if disagreement.0 > self.disagreement.0 { disagreement } else { self.disagreement };
        self.iou = if iou.0 < self.iou.0 { iou } else { self.iou };
        self.places += other.places;
        self.with_shadow += other.with_shadow;
        self.inverted += other.inverted;
        self.pixels += other.pixels;
        self.counted = [0, 1].map(|i| self.counted[i] + other.counted[i]);
    }
}

impl fmt::Display for Worst {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_place_is_told_by_its_number() {
        let one = |wrong: f64, iou: f64| Worst { places: 1, disagreement: (wrong, 0), iou: (iou, 0), pixels: 10, ..Worst::new() };
        let mut found = Worst::new();
        for (wrong, iou) in [(0.0, 1.0), (0.3, 0.9), (0.1, 0.5), (0.3, 0.5)] {
            found.add(&one(wrong, iou));
        }
        assert_eq!((found.places, found.disagreement, found.iou, found.pixels), (4, (0.3, 1), (0.5, 2), 40));
    }
}
