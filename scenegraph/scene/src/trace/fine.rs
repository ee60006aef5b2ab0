//! More rays where shadows may be thinner than the rays of a pixel are apart.
//!
//! The rays of a pixel may all agree and yet pass on both sides of a wire or of the tip of a leaf. What is so thin goes on from
//! somewhere where it was met. So pixels beside others that are mixed, or of another class, are asked again with more rays; where
//! those disagree the pixel is mixed too, and its neighbours are asked. Thin things are followed wherever they go. Nothing but
//! the truth decides, each pixel is asked once more at most, and the order in which they are asked changes nothing.

use super::{Mask, by_rows};

/// Pixels that a thread takes at a time.
const BATCH: u32 = 64;

/// Asks `pixel` for the class of each pixel that is in doubt, until none is.
pub(super) fn refine(mask: &mut Mask, pixel: impl Fn([u32; 2]) -> u8 + Sync) {
    let (width, height) = (mask.width as usize, mask.height as usize);
    let mut was_asked = vec![false; mask.classes.len()];
    let mut doubtful: Vec<usize> = (0..mask.classes.len()).filter(|p| is_in_doubt(mask, *p)).collect();
    while !doubtful.is_empty() {
        let mut found = vec![Mask::MIXED; doubtful.len()];
        by_rows(&mut found, BATCH, &|_| (), |[x, y]| {
            let place = doubtful[(y * BATCH + x) as usize];
            pixel([(place % width) as u32, (place / width) as u32])
        });
        let changed: Vec<usize> = doubtful
            .iter()
            .zip(found)
            .filter(|(place, class)| mask.classes[**place] != *class)
            .map(|(place, _)| *place)
            .collect();
        doubtful.iter().for_each(|place| was_asked[*place] = true);
        changed.iter().for_each(|place| mask.classes[*place] = Mask::MIXED);
        doubtful = changed.into_iter().flat_map(|place| around(place, width, height)).collect();
        doubtful.sort_unstable();
        doubtful.dedup();
        doubtful.retain(|place| !was_asked[*place] && is_in_doubt(mask, *place));
    }
}

/// Is the pixel of one class, and one beside it not of that?
fn is_in_doubt(mask: &Mask, place: usize) -> bool {
    let class = mask.classes[place];
    let (width, height) = (mask.width as usize, mask.height as usize);
    class != Mask::MIXED && around(place, width, height).any(|p| mask.classes[p] != class)
}

/// The pixel and the up to eight beside it.
fn around(place: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let near = |at: usize, size: usize| at.saturating_sub(1)..(at + 2).min(size);
    let columns = near(place % width, width);
    near(place / width, height).flat_map(move |y| columns.clone().map(move |x| y * width + x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    /// Pictures of one letter per pixel: `.` lit, `#` in shadow, `?` mixed.
    fn mask(rows: &[&str]) -> Mask {
        let class = |letter: u8| match letter {
            b'.' => Mask::LIT,
            b'#' => Mask::SHADOW,
            _ => Mask::MIXED,
        };
        let classes = rows.iter().flat_map(|row| row.bytes().map(class)).collect();
        Mask { width: rows[0].len() as u32, height: rows.len() as u32, classes }
    }

    #[test]
    fn thin_shadows_are_followed_from_where_they_were_met() {
        // What few rays find, what many would find, the result, and how many pixels are asked again.
        type Rows = [&'static str; 4];
        let rows: [(Rows, Rows, Rows, usize); 5] = [
            // A wire that one pixel found, and one that none did.
            (
                ["......", "?.....", "......", "......"],
                ["?.....", "??....", "..???.", "......"],
                ["?.....", "??....", "..???.", "......"],
                19,
            ),
            (["......"; 4], ["......", "??....", "......", "......"], ["......"; 4], 0),
            // The edge of a shadow is asked on both sides, and no farther.
            (["..####"; 4], ["..####"; 4], ["..####"; 4], 8),
            (["..####"; 4], ["...###"; 4], ["..?###"; 4], 12),
            (["??????"; 4], ["......"; 4], ["??????"; 4], 0),
        ];
        for (few, many, expected, asked) in rows {
            let (mut found, many) = (mask(&few), mask(&many));
            let places = Mutex::new(Vec::new());
            refine(&mut found, |[x, y]| {
                places.lock().unwrap().push([x, y]);
                many.classes[(y * many.width + x) as usize]
            });
            let mut places = places.into_inner().unwrap();
            assert_eq!((&found, places.len()), (&mask(&expected), asked), "{few:?}");
            places.sort_unstable();
            places.dedup();
            assert_eq!(places.len(), asked, "{few:?}: some were asked twice");
        }
        refine(&mut Mask::background(0, 0), |_| Mask::LIT);
    }
}
