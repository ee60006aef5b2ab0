//! Puts the views of a display side by side, on top of each other, or into layers.

use super::RigError;
use umbriel_scene::{Layout, Picture, PictureKind, Rect, View};

/// How a display shows its channels and eyes: the choices of the field `layout`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrangement {
    /// One eye; several screens stand in a row.
    Mono,
    /// The two eyes of each screen next to each other.
    SideBySide,
    /// The left eye above the right one; several screens stand in a row.
    TopBottom,
    /// Red and cyan, for one screen.
    Anaglyph,
    /// One layer per view.
    Layers,
    /// All views in a row, channel after channel.
    Row,
}

impl Arrangement {
    /// The choices of the field `layout`, as they are spelled.
    pub const NAMES: [(&'static str, Arrangement); 6] = [
        ("mono", Arrangement::Mono),
        ("side_by_side", Arrangement::SideBySide),
        ("top_bottom", Arrangement::TopBottom),
        ("anaglyph", Arrangement::Anaglyph),
        ("layers", Arrangement::Layers),
        ("row", Arrangement::Row),
    ];

    /// By its name.
    pub fn from_name(name: &str) -> Option<Arrangement> {
        Arrangement::NAMES.iter().find(|(n, _)| *n == name).map(|(_, a)| *a)
    }

    /// Does it show both eyes, whatever `stereo` says?
    pub fn is_stereo(self) -> bool {
        matches!(self, Arrangement::SideBySide | Arrangement::TopBottom | Arrangement::Anaglyph)
    }

    /// Rectangles across and down, for `screens` channels of `eyes` views each.
    pub fn grid(self, screens: usize, eyes: usize) -> [u32; 2] {
        let (screens, eyes) = (screens as u32, eyes as u32);
        match self {
            Arrangement::TopBottom => [screens, eyes],
            Arrangement::Anaglyph | Arrangement::Layers => [1, 1],
            Arrangement::Mono | Arrangement::SideBySide | Arrangement::Row => [screens * eyes, 1],
        }
    }

    /// Makes the picture. `views` are screen after screen, left eye first, all of the same size.
    ///
    /// # Errors
    /// Anaglyph with anything but two views.
    pub fn picture(self, name: String, views: Vec<View>, eyes: usize) -> Result<Picture, RigError> {
        let [width, height] = views.first().map_or([0, 0], |v| v.size);
        let screens = views.len() / eyes.max(1);
        let [columns, rows] = self.grid(screens, eyes);
        let layout = match self {
            Arrangement::Anaglyph if views.len() != 2 => return Err(RigError::Anaglyph { screens }),
            Arrangement::Anaglyph => Layout::Anaglyph,
            Arrangement::Layers => Layout::Layers,
            _ => {
                let place = |i: usize| match self {
                    Arrangement::TopBottom => [i / eyes, i % eyes],
                    _ => [i, 0],
                };
                let tile = |i: usize| {
                    let [x, y] = place(i).map(|p| p as u32);
                    Rect { x: x * width, y: y * height, width, height }
                };
                Layout::Tiles((0..views.len()).map(tile).collect())
            }
        };
        Ok(Picture { name, size: [columns * width, rows * height], views, layout, kind: PictureKind::Colour })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Mat4;
    use umbriel_scene::Frustum;

    fn views(n: usize) -> Vec<View> {
        let frustum = Frustum::symmetric(1.0, 2.0, 0.1);
        (0..n).map(|i| View { name: i.to_string(), view_from_world: Mat4::IDENTITY, frustum, size: [20, 10] }).collect()
    }

    #[test]
    fn tiles_cover_the_picture_once() {
        for (name, screens, eyes, size) in [
            ("mono", 1, 1, [20, 10]),
            ("mono", 3, 1, [60, 10]),
            ("row", 7, 1, [140, 10]),
            ("row", 2, 2, [80, 10]),
            ("side_by_side", 1, 2, [40, 10]),
            ("top_bottom", 1, 2, [20, 20]),
            ("top_bottom", 4, 2, [80, 20]),
        ] {
            let picture = Arrangement::from_name(name).unwrap().picture("d".into(), views(screens * eyes), eyes).unwrap();
            assert_eq!(picture.size, size, "{name}");
            let Layout::Tiles(tiles) = &picture.layout else { panic!("{name}") };
            assert_eq!(tiles.len(), picture.views.len());
            let mut covered = vec![0; (size[0] * size[1]) as usize];
            for t in tiles {
                for y in t.y..t.y + t.height {
                    (t.x..t.x + t.width).for_each(|x| covered[(y * size[0] + x) as usize] += 1);
                }
            }
            assert!(covered.iter().all(|c| *c == 1), "{name}");
        }
    }

    #[test]
    fn left_is_left_and_above() {
        for (name, second) in [("side_by_side", [20, 0]), ("top_bottom", [0, 10])] {
            let picture = Arrangement::from_name(name).unwrap().picture("d".into(), views(2), 2).unwrap();
            let Layout::Tiles(tiles) = picture.layout else { panic!("{name}") };
            assert_eq!([[tiles[0].x, tiles[0].y], [tiles[1].x, tiles[1].y]], [[0, 0], second], "{name}");
        }
    }

    #[test]
    fn anaglyph_and_layers_have_the_size_of_a_view() {
        let picture = Arrangement::Anaglyph.picture("d".into(), views(2), 2).unwrap();
        assert_eq!((picture.size, picture.layout), ([20, 10], Layout::Anaglyph));
        let picture = Arrangement::Layers.picture("d".into(), views(14), 2).unwrap();
        assert_eq!((picture.size, picture.layout), ([20, 10], Layout::Layers));
        assert!(Arrangement::Anaglyph.picture("d".into(), views(4), 2).unwrap_err().to_string().contains("2 screens"));
    }
}
