//! What is wrong with shadows where no edge excuses it.

use crate::{Mask, MaskError};

/// Pixels within this many of an edge, or of what is not compared, are not counted.
const EDGE: usize = 4;

/// Shares of the pixels away from edges of shadows that are wrong, 0..=1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Specks {
    /// Of the lit ones those that are dark: acne, lines in corners.
    pub dark: f64,
    /// Of the dark ones those that are lit: light that leaks.
    pub lit: f64,
}

/// Counts wrong pixels of `visibility`, one byte per pixel, lit where it is 128 or more.
///
/// # Errors
/// The picture has not as many pixels as the mask.
pub fn specks(truth: &Mask, visibility: &[u8]) -> Result<Specks, MaskError> {
    truth.check_size(visibility.len())?;
    let [width, height] = [truth.width, truth.height].map(|v| v as usize);
    let around = |place: usize, end: usize| place.saturating_sub(EDGE)..(place + EDGE + 1).min(end);
    let is_inside = |place: usize, class: u8| {
        let columns = around(place % width, width);
        around(place / width, height).all(|row| truth.classes[row * width..][columns.clone()].iter().all(|c| *c == class))
    };
    let share = |class: u8, is_wrong: fn(u8) -> bool| {
        let (mut wrong, mut all) = (0usize, 0usize);
        for (place, byte) in visibility.iter().enumerate() {
            if truth.classes[place] == class && is_inside(place, class) {
                all += 1;
                wrong += usize::from(is_wrong(*byte));
            }
        }
        wrong as f64 / all.max(1) as f64
    };
    Ok(Specks { dark: share(Mask::LIT, |v| v < 128), lit: share(Mask::SHADOW, |v| v >= 128) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_away_from_edges_counts() {
        // Left half lit, right half dark, 24 x 9: of each half 12 columns and 9 rows, all of which but the 4 next to the edge count.
        let classes: Vec<u8> = (0..24 * 9).map(|i| if i % 24 < 12 { Mask::LIT } else { Mask::SHADOW }).collect();
        let truth = Mask::from_grey(24, 9, &classes).unwrap();
        let picture = |wrong: &[(usize, usize)]| {
            let mut bytes = truth.visibility();
            for (x, y) in wrong {
                bytes[y * 24 + x] = 255 - bytes[y * 24 + x];
            }
            bytes
        };
        let inside = 8.0 * 9.0;
        for (name, wrong, dark, lit) in [
            ("right", &[][..], 0.0, 0.0),
            ("at the edge", &[(11, 4), (12, 4), (8, 0), (15, 8)], 0.0, 0.0),
            ("specks", &[(7, 4), (0, 0)], 2.0 / inside, 0.0),
            ("a leak", &[(16, 4)], 0.0, 1.0 / inside),
        ] {
            assert_eq!(specks(&truth, &picture(wrong)), Ok(Specks { dark, lit }), "{name}");
        }
        assert_eq!(specks(&Mask::background(3, 3), &[0; 9]), Ok(Specks::default()));
        assert!(specks(&truth, &[0; 9]).is_err());
    }
}
