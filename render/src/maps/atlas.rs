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

/// Puts squares into layers of the given side as [`pack`] does, but those that lie somewhere already stay there. Gives the
/// number of layers and each square's place.
pub(crate) fn pack_around(layer_side: u32, sides: &[u32], lying: &[Option<Place>]) -> (u32, Vec<Place>) {
    let mut taken: Vec<(u32, Place)> = sides.iter().zip(lying).filter_map(|(side, place)| Some((*side, (*place)?))).collect();
    let mut order: Vec<usize> = (0..sides.len()).filter(|i| lying[*i].is_none()).collect();
    order.sort_by_key(|i| std::cmp::Reverse(sides[*i]));
    let mut places: Vec<Place> = lying.iter().map(|place| place.unwrap_or_default()).collect();
    for i in order {
        let side = sides[i];
        let is_free = |[x, y, layer]: Place| {
            let is_apart = |(other, at): &(u32, Place)| {
                at[2] != layer || x + side <= at[0] || at[0] + other <= x || y + side <= at[1] || at[1] + other <= y
            };
            x + side <= layer_side && y + side <= layer_side && taken.iter().all(is_apart)
        };
        let layers = taken.iter().map(|(_, at)| at[2] + 1).max().unwrap_or(0);
        // The lowest free corner: of a layer, or beside what lies there.
        let beside = taken.iter().flat_map(|(other, [x, y, layer])| [[x + other, *y, *layer], [*x, y + other, *layer]]);
        let corners = (0..=layers).map(|layer| [0, 0, layer]).chain(beside).filter(|place| is_free(*place));
        places[i] = corners.min_by_key(|[x, y, layer]| [*layer, *y, *x]).unwrap_or([0, 0, layers]);
        taken.push((side, places[i]));
    }
    (places.iter().map(|place| place[2] + 1).max().unwrap_or(1), places)
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
            assert_apart(side, count, &sides, &places);
        }
    }

    fn assert_apart(side: u32, layers: u32, sides: &[u32], places: &[Place]) {
        for (i, a) in places.iter().enumerate() {
            assert!(a[0] + sides[i] <= side && a[1] + sides[i] <= side && a[2] < layers, "{sides:?} {places:?}");
            for (j, b) in places.iter().enumerate().take(i) {
                let apart = |k: usize| a[k] + sides[i] <= b[k] || b[k] + sides[j] <= a[k];
                assert!(a[2] != b[2] || apart(0) || apart(1), "{sides:?} {i} {j}");
            }
        }
    }

    #[test]
    fn squares_stay_where_they_lie() {
        // Sides before and now, and the layers now.
        for (before, now, layers) in [
            (vec![64, 64], vec![64, 64], 2),
            (vec![64, 32, 32, 32, 32], vec![64, 32, 16, 32, 32], 2),
            (vec![64, 32, 32, 32], vec![64, 32, 32, 32, 32], 2),
            (vec![64, 16, 16], vec![64, 16, 32], 2),
            (vec![64, 32, 32, 32, 32], vec![64, 64, 32, 32, 32], 3),
            (vec![64, 7, 9, 11], vec![64, 7, 30, 11, 9, 9], 2),
            (vec![], vec![5, 64], 1 + 1),
        ] {
            let (_, _, places) = pack(&before);
            let stays = |i: usize| (before.get(i) == Some(&now[i])).then(|| places[i]);
            let lying: Vec<Option<Place>> = (0..now.len()).map(stays).collect();
            let (count, found) = pack_around(64, &now, &lying);
            assert_eq!(count, layers, "{before:?} {now:?}");
            assert_apart(64, count, &now, &found);
            assert!(found.iter().zip(&lying).all(|(now, before)| before.is_none_or(|before| before == *now)));
        }
    }
}
