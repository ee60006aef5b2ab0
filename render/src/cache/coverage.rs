//! Smaller copies of pictures that alpha cuts out, with as much of them left as at full size.
//!
//! A mean of alphas falls below the cutoff where what is there is thinner than a texel, so that nets and leaves vanish from afar. Each
//! copy's alphas are scaled until the same share of its area is above the cutoff (Castano 2010, Computing Alpha Mipmaps).

/// Places per texel and axis where a copy is looked at, as a bilinear filter shows it.
const LOOKS: u32 = 2;

/// Alphas of a copy, row by row.
pub(super) struct Alphas {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) texels: Vec<f32>,
}

impl Alphas {
    /// Share of the area that is above the cutoff.
    pub(super) fn coverage(&self, cutoff: f32) -> f32 {
        let (mut all, mut above) = (0u32, 0u32);
        self.look(|alpha| {
            all += 1;
            above += u32::from(alpha >= cutoff);
        });
        above as f32 / all as f32
    }

    /// What alphas have to be multiplied by, so that this share of the area is above the cutoff, or as near to it as can be.
    pub(super) fn scale(&self, cutoff: f32, coverage: f32) -> f32 {
        let mut seen = Vec::new();
        self.look(|alpha| seen.push(alpha));
        let wanted = (coverage * seen.len() as f32).round() as usize;
        let last = seen.len() - 1;
        let at = *seen.select_nth_unstable_by(wanted.min(last), |a, b| b.total_cmp(a)).1;
        // Equal alphas stay together, on the side where fewer of them are wrong.
        let above = seen.iter().filter(|a| **a > at).count();
        let below = seen.iter().filter(|a| **a < at).count();
        let is_left_out = 2 * wanted <= above + seen.len() - below;
        let limit = if is_left_out {
            let next = seen.iter().copied().filter(|a| *a > at).reduce(f32::min);
            0.5 * (at + next.unwrap_or(3.0 * at))
        } else {
            let next = seen.iter().copied().filter(|a| *a < at).reduce(f32::max);
            0.5 * (at + next.unwrap_or(0.0))
        };
        if limit > 0.0 { cutoff / limit } else { 1.0 }
    }

    fn look(&self, mut take: impl FnMut(f32)) {
        let columns = places(self.width);
        for (above, below, down) in places(self.height) {
            let row = |y: u32| &self.texels[(y * self.width) as usize..][..self.width as usize];
            let (above, below) = (row(above), row(below));
            for (left, right, across) in &columns {
                let mix = |row: &[f32]| row[*left as usize] * (1.0 - across) + row[*right as usize] * across;
                take(mix(above) * (1.0 - down) + mix(below) * down);
            }
        }
    }
}

/// Along one axis: the two texels around each place, and the share of the second. Pictures repeat.
fn places(size: u32) -> Vec<(u32, u32, f32)> {
    let place = |i: u32| {
        let along = (i as f32 + 0.5) / LOOKS as f32 - 0.5;
        let first = along.floor();
        let wrapped = |texel: f32| (texel as i64).rem_euclid(i64::from(size)) as u32;
        (wrapped(first), wrapped(first + 1.0), along - first)
    };
    (0..size * LOOKS).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alphas(width: u32, texels: &[f32]) -> Alphas {
        Alphas { width, height: texels.len() as u32 / width, texels: texels.to_vec() }
    }

    #[test]
    fn as_much_is_left_as_was() {
        let ramp: Vec<f32> = (0..64).map(|i| i as f32 / 63.0).collect();
        let wires: Vec<f32> = (0..64).map(|i| if i % 8 == 0 { 0.3 } else { 0.05 }).collect();
        let rows = [
            ("ramp", alphas(64, &ramp), 0.5, 0.25),
            ("ramp, low cutoff", alphas(8, &ramp), 0.1, 0.5),
            ("wires", alphas(8, &wires), 0.5, 0.2),
            ("all", alphas(8, &ramp), 0.5, 1.0),
            ("nothing", alphas(8, &ramp), 0.5, 0.0),
        ];
        for (name, alphas, cutoff, coverage) in rows {
            let scale = alphas.scale(cutoff, coverage);
            let scaled = Alphas { texels: alphas.texels.iter().map(|a| a * scale).collect(), ..alphas };
            let left = scaled.coverage(cutoff);
            assert!((left - coverage).abs() < 0.08, "{name}: {left} where {coverage} was wanted");
        }
    }

    #[test]
    fn what_is_everywhere_alike_is_there_or_not() {
        for (coverage, expected) in [(0.1, 0.0), (0.4, 0.0), (0.6, 1.0), (1.0, 1.0)] {
            let even = alphas(2, &[0.3; 4]);
            let scale = even.scale(0.5, coverage);
            assert_eq!(alphas(2, &[0.3 * scale; 4]).coverage(0.5), expected, "{coverage}");
        }
        assert_eq!(alphas(1, &[0.0]).scale(0.5, 0.7), 1.0);
    }
}
