//! Places of all maps in the layers of one array of textures.

/// Where a map is: left, top, layer.
pub(crate) type Place = [u32; 3];

/// Puts squares of the given sides into as few layers of the greatest side as rows of equal squares allow.
/// Gives the side and number of the layers, and each square's place.
pub(crate) fn pack(sides: &[u32]) -> (u32, u32, Vec<Place>) {
    let layer_side = sides.iter().copied().max().unwrap_or(1);
    let mut order: Vec<usize> = (0..sides.len()).collect();
    order.sort_by_key(|i| std::cmp::Reverse(sides[*i]));
    let mut places = vec![[0; 3]; sides.len()];
    let (mut x, mut y, mut row, mut layer) = (0, 0, 0, 0);
    for i in order {
        let side = sides[i];
        if x + side > layer_side {
            (x, y, row) = (0, y + row, 0);
        }
        if y + side > layer_side {
            (x, y, row, layer) = (0, 0, 0, layer + 1);
        }
        places[i] = [x, y, layer];
        x += side;
        row = row.max(side);
    }
    (layer_side, layer + 1, places)
}

/// Memory of the texture of so many layers; there are two at least, since some back ends take one for no array.
pub(crate) fn bytes(side: u32, layers: u32) -> u64 {
    4 * u64::from(side) * u64::from(side) * u64::from(layers.max(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_lie_inside_and_apart() {
        for (sides, layers) in [
            (vec![], 1),
            (vec![64], 1),
            (vec![64, 64], 2),
            (vec![64, 32, 32, 32, 32], 2),
            (vec![32, 64, 16, 48, 1, 7, 32], 3),
            (vec![128; 6], 6),
        ] {
            let (side, count, places) = pack(&sides);
            assert_eq!(count, layers, "{sides:?}");
            for (i, a) in places.iter().enumerate() {
                assert!(a[0] + sides[i] <= side && a[1] + sides[i] <= side && a[2] < count);
                for (j, b) in places.iter().enumerate().take(i) {
                    let apart = |k: usize| a[k] + sides[i] <= b[k] || b[k] + sides[j] <= a[k];
                    assert!(a[2] != b[2] || apart(0) || apart(1), "{sides:?} {i} {j}");
                }
            }
        }
    }
}
