//! Masks: one class per pixel.

/// What a light does in each pixel. Masks are kept as grey pictures whose bytes are the classes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// One class per pixel, rows from the top.
    pub classes: Vec<u8>,
}

/// Why bytes are no mask, or a picture cannot be compared with one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MaskError {
    /// The number of bytes does not fit the size.
    #[error("{found} bytes where {width} x {height} pixels need {}", u64::from(*width) * u64::from(*height))]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// Number of bytes.
        found: usize,
    },
    /// A byte is no class.
    #[error("pixel ({x}, {y}) is {value}, which is no class of a mask (0 to 4, 255)")]
    Class {
        /// From the left.
        x: u32,
        /// From the top.
        y: u32,
        /// The byte.
        value: u8,
    },
}

impl Mask {
    /// Nothing is there.
    pub const BACKGROUND: u8 = 0;
    /// The light reaches the surface.
    pub const LIT: u8 = 1;
    /// Something is between the surface and the light.
    pub const SHADOW: u8 = 2;
    /// The surface faces away from the light, or grazes it.
    pub const AWAY: u8 = 3;
    /// Outside of the spot's cone, or beyond the light's range.
    pub const OUTSIDE: u8 = 4;
    /// The samples of the pixel disagree.
    pub const MIXED: u8 = 255;

    /// A mask of background.
    pub fn background(width: u32, height: u32) -> Mask {
        Mask { width, height, classes: vec![Mask::BACKGROUND; width as usize * height as usize] }
    }

    /// Reads the bytes of a grey picture, rows from the top.
    pub fn from_grey(width: u32, height: u32, bytes: &[u8]) -> Result<Mask, MaskError> {
        let mask = Mask { width, height, classes: bytes.to_vec() };
        mask.check_size(bytes.len())?;
        match bytes.iter().position(|b| !matches!(*b, Mask::BACKGROUND..=Mask::OUTSIDE | Mask::MIXED)) {
            Some(place) => {
                let (x, y) = (place as u32 % width, place as u32 / width);
                Err(MaskError::Class { x, y, value: bytes[place] })
            }
            None => Ok(mask),
        }
    }

    /// Number of pixels of a class.
    pub fn count(&self, class: u8) -> usize {
        self.classes.iter().filter(|c| **c == class).count()
    }

    /// White where the light reaches the surface, black elsewhere: as the light visibility picture of a renderer.
    pub fn visibility(&self) -> Vec<u8> {
        self.classes.iter().map(|c| if *c == Mask::LIT { 255 } else { 0 }).collect()
    }

    /// The mask in colours for people, RGBA: background dark, lit cream, shadow blue, away brown, outside green, mixed grey.
    pub fn picture(&self) -> Vec<u8> {
        let color = |class: &u8| match *class {
            Mask::BACKGROUND => [20, 20, 30, 255],
            Mask::LIT => [230, 220, 180, 255],
            Mask::SHADOW => [60, 60, 110, 255],
            Mask::AWAY => [110, 80, 80, 255],
            Mask::OUTSIDE => [40, 90, 40, 255],
            _ => [150, 150, 150, 255],
        };
        self.classes.iter().flat_map(color).collect()
    }

    pub(crate) fn check_size(&self, found: usize) -> Result<(), MaskError> {
        let Mask { width, height, .. } = *self;
        if found as u64 == u64::from(width) * u64::from(height) { Ok(()) } else { Err(MaskError::Size { width, height, found }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_grey_bytes() {
        let mask = Mask::from_grey(3, 2, &[0, 1, 2, 3, 4, 255]).unwrap();
        assert_eq!((mask.count(Mask::SHADOW), mask.visibility()), (1, vec![0, 255, 0, 0, 0, 0]));
        assert_eq!(mask.picture().len(), 24);
        assert_eq!(Mask::from_grey(2, 2, &[0; 3]), Err(MaskError::Size { width: 2, height: 2, found: 3 }));
        assert_eq!(Mask::from_grey(2, 2, &[0, 1, 2, 77]), Err(MaskError::Class { x: 1, y: 1, value: 77 }));
        assert_eq!(Mask::from_grey(0, 0, &[]).unwrap(), Mask::background(0, 0));
    }
}
