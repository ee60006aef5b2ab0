//! What a frame cost, and what was wrong with it.

use crate::volumes::{VolumeDraws, VolumeStats};
use std::collections::HashSet;

/// Numbers of one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameStats {
    /// Views drawn, of all pictures.
    pub views: u32,
    /// Those of them that were drawn in linear light and composed into their pictures afterwards; others were drawn in these.
    pub composed: u32,
    /// Draw calls of surfaces and casters.
    pub draws: u32,
    /// Instances in those draws.
    pub instances: u32,
    /// Triangles in those draws.
    pub triangles: u64,
    /// Drawables that a view left out because they are outside of it, summed over views.
    pub culled: u32,
    /// Shadow maps of the frame.
    pub maps: u32,
    /// How many of them were drawn anew.
    pub map_redraws: u32,
    /// Draw calls of those.
    pub map_draws: u32,
    /// What each light with maps got.
    pub map_shares: Vec<MapShare>,
    /// Meshes deformed.
    pub deformed: u32,
    /// Jobs of the shadow volumes: lights and groups.
    pub volume_jobs: u32,
    /// How the frame's volumes were made.
    pub volumes_made: VolumeStats,
    /// How they were drawn, summed over views.
    pub volumes: VolumeDraws,
    /// Shapes whose holes shadow volumes kept, summed over views.
    pub cutouts: u32,
    /// CPU time until everything is sent to the GPU, seconds.
    pub prepare_s: f64,
    /// CPU time of recording and submitting, seconds.
    pub encode_s: f64,
    /// GPU time of each kind of pass in an earlier frame, seconds; empty where the device has no clock.
    pub gpu_s: Vec<(&'static str, f64)>,
}

/// The shadow maps of one light in a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MapShare {
    /// Name of the light.
    pub light: String,
    /// Number of its maps.
    pub maps: u32,
    /// How many of them were drawn anew.
    pub redrawn: u32,
    /// Side that was asked for, texels.
    pub asked: u32,
    /// Side of each map: less than asked where memory is short.
    pub side: u32,
}

/// Messages, told once each.
#[derive(Default)]
pub(crate) struct Problems {
    told: HashSet<String>,
    untold: Vec<String>,
    /// What comes and goes: of the last frame, and of this one so far.
    stood: HashSet<String>,
    stands: HashSet<String>,
}

impl Problems {
    pub(crate) fn report(&mut self, message: String) {
        if self.told.insert(message.clone()) {
            self.untold.push(message);
        }
    }

    /// The same for what may be mended and come back: it is told anew each time.
    pub(crate) fn report_again(&mut self, message: String) {
        if !self.untold.contains(&message) {
            self.untold.push(message);
        }
    }

    /// A frame begins, in which all that still stands is reported again.
    pub(crate) fn begin_standing(&mut self) {
        self.stood = std::mem::take(&mut self.stands);
    }

    /// The same for what is looked at in every frame: it is told when it was not so in the frame before.
    pub(crate) fn report_standing(&mut self, message: String) {
        if !self.stood.contains(&message) {
            self.report_again(message.clone());
        }
        self.stands.insert(message);
    }

    pub(crate) fn drain(&mut self) -> Vec<String> {
        std::mem::take(&mut self.untold)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_is_told_when_it_comes() {
        let mut problems = Problems::default();
        let told = |stands: &[&str]| {
            problems.begin_standing();
            stands.iter().for_each(|message| problems.report_standing((*message).to_owned()));
            problems.drain()
        };
        let frames: [&[&str]; 5] = [&["a", "a"], &["a", "b"], &["b"], &[], &["a", "b"]];
        assert_eq!(frames.map(told), [vec!["a"], vec!["b"], vec![], vec![], vec!["a", "b"]]);
    }
}
