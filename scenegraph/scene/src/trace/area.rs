//! Lights of a size: which share of the source a place sees.

use super::camera::Camera;
use super::ray::Ray;
use super::{Beam, Mask, TraceError, TraceOptions, Tracer};
use crate::{Light, View};

/// Rays that decide whether the others are needed.
const FIRST_RAYS: usize = 24;
/// Turn from one sample of the disc to the next, radians: the golden angle, which spreads any number of them evenly.
const GOLDEN_RAD: f64 = 2.399_963_229_728_653;

/// Which share of a light of a size each pixel sees.
#[derive(Clone, Debug, PartialEq)]
pub struct Shares {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// 0 in the umbra, 1 in full light; `None` where nothing is seen, or it faces away or is outside of the cone. Rows
    /// from the top.
    pub shares: Vec<Option<f32>>,
}

impl Tracer {
    /// Traces the share of `light`'s disc ([`Light::size`]) that each pixel of `view` sees, with `rays` rays to the disc
    /// where it is partly hidden. `progress` as for [`Tracer::visibility`].
    pub fn shares(
        &self,
        light: &Light,
        view: &View,
        options: &TraceOptions,
        rays: usize,
        progress: &(dyn Fn(u32) + Sync),
    ) -> Result<Shares, TraceError> {
        let beam = Beam::new(light)?;
        let camera = Camera::new(view, options.sub_samples.max(1))?;
        let disc = disc(f64::from(light.size), rays.max(FIRST_RAYS));
        let [width, height] = view.size;
        let mut shares = vec![None; width as usize * height as usize];
        super::by_rows(&mut shares, width, progress, |pixel| {
            let mut sum = (0.0, 0.0);
            for ray in camera.rays(pixel) {
                sum = (sum.0 + self.share(&ray, &beam, options, &disc)?, sum.1 + 1.0);
            }
            Some((sum.0 / sum.1) as f32)
        });
        Ok(Shares { width, height, shares })
    }

    /// The share of the disc that is seen from where a ray ends.
    pub(super) fn share(&self, ray: &Ray, beam: &Beam, options: &TraceOptions, disc: &[(f64, f64)]) -> Option<f64> {
        let place = self.place(ray, beam, options)?;
        match place.class {
            Mask::LIT if !place.receives => return Some(1.0),
            Mask::LIT => (),
            _ => return None,
        }
        let (across, up) = place.to_light.any_orthonormal_pair();
        let is_seen = |(x, y): &(f64, f64)| {
            let offset = across * *x + up * *y;
            let (to, far) = match place.far.is_finite() {
                true => (place.to_light * place.far + offset, place.far),
                false => (place.to_light + offset, f64::INFINITY),
            };
            let ray = Ray::new(place.start, to.normalize());
            !self.is_blocked(&ray, far - 2.0 * place.eps, options)
        };
        let step = disc.len() / FIRST_RAYS;
        let first = disc.iter().step_by(step).filter(|s| is_seen(s)).count();
        let asked = disc.len().div_ceil(step);
        if first == 0 || first == asked {
            return Some(if first == 0 { 0.0 } else { 1.0 });
        }
        Some(disc.iter().filter(|s| is_seen(s)).count() as f64 / disc.len() as f64)
    }
}

/// Places spread evenly over a disc (Vogel 1979).
pub(super) fn disc(radius: f64, count: usize) -> Vec<(f64, f64)> {
    let place = |i: usize| {
        let (r, turn) = (radius * ((i as f64 + 0.5) / count as f64).sqrt(), i as f64 * GOLDEN_RAD);
        (r * turn.cos(), r * turn.sin())
    };
    (0..count).map(place).collect()
}

/// How far a picture of penumbrae is from the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PenumbraScore {
    /// Mean difference of the share of light over the pixels that see a part of the light, 0..=1.
    pub penumbra: f64,
    /// The same over all pixels that count.
    pub overall: f64,
    /// Number of pixels in penumbrae.
    pub penumbra_pixels: usize,
    /// Number of pixels that count.
    pub pixels: usize,
}

impl Shares {
    /// Scores `visibility`, one byte per pixel, 255 in full light.
    pub fn score(&self, visibility: &[u8]) -> Result<PenumbraScore, super::MaskError> {
        Mask::background(self.width, self.height).check_size(visibility.len())?;
        let (mut inside, mut all) = ((0.0, 0), (0.0, 0));
        for (truth, byte) in self.shares.iter().zip(visibility) {
            let Some(truth) = truth else { continue };
            let wrong = f64::from((truth - f32::from(*byte) / 255.0).abs());
            all = (all.0 + wrong, all.1 + 1);
            if *truth > 0.0 && *truth < 1.0 {
                inside = (inside.0 + wrong, inside.1 + 1);
            }
        }
        let mean = |(sum, count): (f64, usize)| if count == 0 { 0.0 } else { sum / count as f64 };
        Ok(PenumbraScore { penumbra: mean(inside), overall: mean(all), penumbra_pixels: inside.1, pixels: all.1 })
    }

    /// One byte per pixel: 255 in full light, 0 where nothing counts.
    pub fn visibility(&self) -> Vec<u8> {
        self.shares.iter().map(|s| (s.unwrap_or(0.0) * 255.0).round() as u8).collect()
    }
}
