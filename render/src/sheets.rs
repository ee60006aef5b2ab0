//! Views side by side in one target.
//!
//! Small views cost more in beginnings and ends than in pixels: clearing, resolving and waiting for what is read next. So
//! neighbours share a target of at most the pixels of one large view, and these are paid once. Mesa's software driver even
//! waits for all that was drawn wherever a pass begins or ends.

use umbriel_scene::{Layout, Picture, PictureKind, Samples};

/// Pixels up to which views come together.
const MOST_PIXELS: u64 = 1920 * 1080;

/// Pixels, across and down, where a scissor rectangle may begin. With four samples, Mesa's software driver (llvmpipe of 25.0.7) draws into
/// the row above a rectangle and the column before it, unless it begins with one of the driver's tiles: samples beyond the
/// middle of the pixel, of triangles that reach into the rectangle, but not of those beside them.
pub(crate) const SCISSOR_STEP: u32 = 64;

/// A target of the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sheet {
    pub(crate) size: [u32; 2],
    /// Number of its views, which follow each other in the frame's list.
    pub(crate) views: usize,
    is_full: bool,
}

/// The targets of a frame, in the order in which they are drawn.
#[derive(Debug, Default)]
pub(crate) struct Sheets(pub(crate) Vec<Sheet>);

impl Sheets {
    /// Left and top of the next view in its sheet. `is_alone` gives it one of its own; `widest` is what the device takes.
    pub(crate) fn place(&mut self, [width, height]: [u32; 2], samples: Samples, is_alone: bool, widest: u32) -> [u32; 2] {
        let step = if samples == Samples::One { 1 } else { SCISSOR_STEP };
        let last = self.0.last_mut().filter(|sheet| {
            let wide = u64::from(sheet.size[0].next_multiple_of(step)) + u64::from(width);
            !is_alone
                && !sheet.is_full
                && sheet.size[1] == height
                && wide <= u64::from(widest)
                && wide * u64::from(height) <= MOST_PIXELS
        });
        let Some(sheet) = last else {
            self.0.push(Sheet { size: [width, height], views: 1, is_full: is_alone });
            return [0, 0];
        };
        let left = sheet.size[0].next_multiple_of(step);
        sheet.size[0] = left + width;
        sheet.views += 1;
        [left, 0]
    }
}

/// Do the views of a picture lie in it as they come in a sheet, and fill it?
pub(crate) fn is_row(picture: &Picture) -> bool {
    let Layout::Tiles(rects) = &picture.layout else { return false };
    let [width, height] = picture.size;
    let mut left = 0;
    let fits = picture.views.len() == rects.len()
        && picture.views.iter().zip(rects).all(|(view, rect)| {
            let at = std::mem::replace(&mut left, rect.x.saturating_add(rect.width));
            (rect.x, rect.y, [rect.width, rect.height]) == (at, 0, view.size) && rect.height == height
        });
    let is_small = rects.len() == 1 || u64::from(width) * u64::from(height) <= MOST_PIXELS;
    fits && left == width && is_small && picture.kind == PictureKind::Colour
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_share_a_target() {
        /// Name, size of each view and whether it is alone, size and views of each sheet.
        type Row = (&'static str, &'static [([u32; 2], bool)], &'static [([u32; 2], usize)]);
        let rows: [Row; 6] = [
            ("seven channels", &[([300, 256], false); 7], &[([2100, 256], 7)]),
            ("large ones", &[([1920, 1080], false); 2], &[([1920, 1080], 1); 2]),
            ("of two heights", &[([64, 64], false), ([64, 32], false), ([64, 32], false)], &[([64, 64], 1), ([128, 32], 2)]),
            ("one alone", &[([64, 64], false), ([64, 64], true), ([64, 64], false)], &[([64, 64], 1); 3]),
            ("as wide as can be", &[([3000, 16], false); 3], &[([6000, 16], 2), ([3000, 16], 1)]),
            ("none", &[], &[]),
        ];
        for (name, views, expected) in rows {
            let mut sheets = Sheets::default();
            let places: Vec<_> = views.iter().map(|(size, alone)| sheets.place(*size, Samples::One, *alone, 8192)).collect();
            let found: Vec<_> = sheets.0.iter().map(|s| (s.size, s.views)).collect();
            assert_eq!(found, expected, "{name}");
            let mut next = places.into_iter().zip(views);
            for sheet in &sheets.0 {
                let mut left = 0;
                for (place, (size, _)) in next.by_ref().take(sheet.views) {
                    assert_eq!(place, [left, 0], "{name}");
                    left += size[0];
                }
                assert_eq!(left, sheet.size[0], "{name}");
            }
        }
        let mut sheets = Sheets::default();
        let lefts = [(); 3].map(|()| sheets.place([300, 256], Samples::Four, false, 8192)[0]);
        assert_eq!((lefts, sheets.0[0].size), ([0, 320, 640], [940, 256]), "four samples");
    }
}
