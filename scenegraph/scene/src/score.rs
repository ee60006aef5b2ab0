//! How well a picture of shadows agrees with the truth.

use crate::{Mask, MaskError};

/// Agreement of a picture with a mask, over the pixels that are lit or in shadow in the mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Share of the pixels where the picture says otherwise, 0..=1; 0 if there are none.
    pub disagreement: f64,
    /// Intersection over union of the shadows, 0..=1; 1 if neither has any.
    pub iou: f64,
    /// Number of pixels that were compared.
    pub pixels: usize,
}

/// Scores `visibility`, one byte per pixel, lit where it is 128 or more.
pub fn score(truth: &Mask, visibility: &[u8]) -> Result<Score, MaskError> {
    truth.check_size(visibility.len())?;
    let (mut pixels, mut wrong, mut both, mut either) = (0, 0, 0, 0);
    for (class, byte) in truth.classes.iter().zip(visibility) {
        if !matches!(*class, Mask::LIT | Mask::SHADOW) {
            continue;
        }
        let (in_truth, in_picture) = (*class == Mask::SHADOW, *byte < 128);
        pixels += 1;
        wrong += usize::from(in_truth != in_picture);
        both += usize::from(in_truth && in_picture);
        either += usize::from(in_truth || in_picture);
    }
    let share = |part: usize, whole: usize, none: f64| if whole == 0 { none } else { part as f64 / whole as f64 };
    Ok(Score { disagreement: share(wrong, pixels, 0.0), iou: share(both, either, 1.0), pixels })
}

/// The differences as RGBA: light grey lit and dark grey shadow where both agree, red where shadow is missing, blue where
/// there is shadow that should not be, nearly black where nothing is compared.
pub fn difference(truth: &Mask, visibility: &[u8]) -> Result<Vec<u8>, MaskError> {
    truth.check_size(visibility.len())?;
    let color = |(class, byte): (&u8, &u8)| match (*class, *byte >= 128) {
        (Mask::LIT, true) => [200, 200, 200, 255],
        (Mask::LIT, false) => [40, 80, 255, 255],
        (Mask::SHADOW, false) => [90, 90, 90, 255],
        (Mask::SHADOW, true) => [255, 40, 40, 255],
        _ => [16, 16, 16, 255],
    };
    Ok(truth.classes.iter().zip(visibility).flat_map(color).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scores_are_counted_over_lit_and_shadow() {
        let truth = [0, 1, 1, 1, 2, 2, 3, 4, 255, 2];
        let rows: [(&str, [u8; 10], f64, f64); 5] = [
            ("perfect", [9, 255, 128, 200, 0, 127, 9, 9, 9, 5], 0.0, 1.0),
            ("others do not count", [255, 255, 128, 200, 0, 127, 255, 0, 255, 5], 0.0, 1.0),
            ("all lit", [255; 10], 0.5, 0.0),
            ("all dark", [0; 10], 0.5, 0.5),
            ("one missing, one wrong", [0, 0, 255, 255, 0, 0, 0, 0, 0, 255], 2.0 / 6.0, 0.5),
        ];
        let truth = Mask::from_grey(5, 2, &truth).unwrap();
        for (name, visibility, disagreement, iou) in rows {
            assert_eq!(score(&truth, &visibility), Ok(Score { disagreement, iou, pixels: 6 }), "{name}");
        }
        let nothing = score(&Mask::background(2, 1), &[0, 255]).unwrap();
        assert_eq!(nothing, Score { disagreement: 0.0, iou: 1.0, pixels: 0 });
        assert_eq!(score(&truth, &[0; 9]), Err(MaskError::Size { width: 5, height: 2, found: 9 }));
    }

    #[test]
    fn differences_are_coloured() {
        let truth = Mask::from_grey(5, 1, &[1, 1, 2, 2, 255]).unwrap();
        let picture = difference(&truth, &[255, 0, 0, 255, 0]).unwrap();
        let reds_and_blues: Vec<(u8, u8)> = picture.chunks_exact(4).map(|p| (p[0], p[2])).collect();
        assert_eq!(reds_and_blues, [(200, 200), (40, 255), (90, 90), (255, 40), (16, 16)]);
        assert!(difference(&truth, &[]).is_err());
    }
}
