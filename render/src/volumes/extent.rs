//! Where the shadow of a caster is looked for, for passes that find it in a way of their own.

use super::choose::{Sight, Watch};
use super::reach::{self, Reach};
use super::{Surface, TurnedBox, VolumeLight};
use crate::sheets::SCISSOR_STEP;
use umbriel_scene::Aabb;

/// How far a caster's shadow may fall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    bounds: TurnedBox,
    reach: Reach,
}

impl Extent {
    /// `None` where it falls on nothing that receives.
    pub(crate) fn new(light: &VolumeLight, bounds: &TurnedBox, receivers: &Aabb) -> Option<Extent> {
        let reach = reach::reach(light, bounds, receivers)?;
        Some(Extent { bounds: *bounds, reach })
    }

    /// 1 / how far it is thrown, as in volumes/thrown.wgsl.
    pub(crate) fn w(&self) -> f32 {
        self.reach.w()
    }
}

impl Sight {
    /// Left, top, width and height, in the target, of what each of these may darken in the view; `None` for nothing.
    pub(crate) fn pixels_of<'a>(
        &'a self,
        light: &'a VolumeLight,
        extents: impl Iterator<Item = &'a Extent>,
    ) -> impl Iterator<Item = Option<[u32; 4]>> {
        let watch = Watch::new(self, light);
        extents.map(move |e| watch.choose(&e.bounds, Surface::InParts, &e.reach).map(|choice| self.placed(choice.scissor)))
    }

    /// The whole view in its target.
    pub(crate) fn in_target(&self) -> [u32; 4] {
        self.placed(self.whole())
    }

    /// A rectangle of the view in its target, grown to where it may begin.
    pub(super) fn placed(&self, [left, top, width, height]: [u32; 4]) -> [u32; 4] {
        let begin = |at: u32, origin: u32| ((at + origin) / SCISSOR_STEP * SCISSOR_STEP).max(origin);
        let (x, y) = (begin(left, self.origin[0]), begin(top, self.origin[1]));
        [x, y, left + self.origin[0] + width - x, top + self.origin[1] + height - y]
    }
}
