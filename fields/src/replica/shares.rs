//! What each field and route adds to the one hash of all values: a sum, so that order plays no part and a frame costs what was written
//! in it.

use xxhash_rust::xxh3::xxh3_64_with_seed;

/// Odd numbers with as many ones as zeros in each byte, of wyhash.
const SECRETS: [u64; 3] = [0x2d35_8dcc_aa6c_78a5, 0x8bb8_4b93_962e_acc9, 0x4b33_a62e_d433_d4a3];

#[inline]
fn seed_of(number: u64, index: u16) -> u64 {
    number.wrapping_mul(SECRETS[0]) ^ (index as u64 + 1).wrapping_mul(SECRETS[1])
}

/// What a field adds. `number` is its node's in the application, `index` the field's place there.
pub(super) fn field_share(number: u64, index: u16, bytes: &[u8]) -> u64 {
    xxh3_64_with_seed(bytes, seed_of(number, index)).max(1)
}

/// What a field of a few floats adds, by their bits.
#[inline]
pub(super) fn flat_share<const COUNT: usize>(number: u64, index: u16, floats: [u32; COUNT]) -> u64 {
    share(seed_of(number, index), floats)
}

/// Products of halves, as in XXH3 (Yann Collet): all of it can be done for several values at once.
#[inline(always)]
fn share<const COUNT: usize>(seed: u64, floats: [u32; COUNT]) -> u64 {
    let pair = |place: usize| {
        let word = |place: usize| floats.get(place).map_or(0, |float| *float as u64);
        word(place) | word(place + 1) << 32
    };
    let halves = |pair: u64| (pair & 0xffff_ffff) * (pair >> 32);
    let mut state = seed ^ (COUNT as u64).wrapping_mul(SECRETS[2]);
    for place in (0..COUNT).step_by(4) {
        let (low, high) = (pair(place) ^ state, pair(place + 2) ^ state.rotate_left(32) ^ SECRETS[2]);
        state = halves(low).wrapping_add(high) ^ halves(high).wrapping_add(low).rotate_left(32);
    }
    state ^= state >> 37;
    state = state.wrapping_mul(SECRETS[0]);
    state ^= state >> 32;
    state + (state == 0) as u64
}

/// Sets what a field adds to what stands there now; gives the difference.
#[inline(always)]
pub(super) fn exchange(share: &mut u64, stands: u64) -> u64 {
    stands.wrapping_sub(std::mem::replace(share, stands))
}

/// Sets what values of a field add whose nodes' numbers begin somewhere and go on in equal steps; gives the difference.
pub(super) fn share_evenly<const COUNT: usize>(
    (first, step): (u64, u64),
    index: u16,
    values: impl Iterator<Item = [u32; COUNT]>,
    shares: &mut [u64],
) -> u64 {
    // For all that this processor can do.
    pulp::Arch::new().dispatch(
        #[inline(always)]
        || {
            let (mut scaled, own) = (first.wrapping_mul(SECRETS[0]), seed_of(0, index));
            let step = step.wrapping_mul(SECRETS[0]);
            let mut added = 0u64;
            for (before, floats) in shares.iter_mut().zip(values) {
                let stands = share(scaled ^ own, floats);
                added = added.wrapping_add(exchange(before, stands));
                scaled = scaled.wrapping_add(step);
            }
            added
        },
    )
}

/// What a node adds by its type and name.
pub(super) fn own_share(number: u64, type_name: &str, name: &str) -> u64 {
    xxh3_64_with_seed(name.as_bytes(), !number) ^ xxh3_64_with_seed(type_name.as_bytes(), number)
}

/// What a route adds.
pub(super) fn route_share(from: (u64, u16), to: (u64, u16), weak: bool) -> u64 {
    let words = [from.0, from.1 as u64, to.0, to.1 as u64, weak as u64];
    xxh3_64_with_seed(&words.map(u64::to_le_bytes).concat(), 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn values_places_and_single_bits_all_count() {
        let mut seen = HashSet::new();
        let mut check = |share: u64| assert!(seen.insert(share) && share != 0);
        let values = [[0.0f32, 0.0, 0.0], [0.0, -0.0, 0.0], [1.0, 2.0, 3.0], [3.0, 2.0, 1.0], [2.0, 1.0, 3.0]];
        for number in [1 << 32, 1 << 32 | 1, 3 << 32 | 1] {
            for index in [0, 1, 255] {
                values.iter().for_each(|value| check(flat_share(number, index, value.map(f32::to_bits))));
                check(flat_share(number, index, [0; 4]));
                check(flat_share(number, index, [0; 16]));
            }
        }
        for bit in 0..512 {
            let mut words = [0u32; 16];
            words[bit / 32] = 1 << (bit % 32);
            check(flat_share(7, 0, words));
        }
    }

    #[test]
    fn many_in_equal_steps_are_as_one_by_one() {
        let (first, step, index) = (3 << 32 | 70, (1u64 << 32) + 5, 4);
        for count in 0..70u64 {
            let values: Vec<[u32; 3]> = (0..count as u32).map(|word| [word, word.wrapping_mul(0x9e37_79b9), !word]).collect();
            let mut shares: Vec<u64> = (1..=count).collect();
            let before = shares.clone();
            let added = share_evenly((first, step), index, values.iter().copied(), &mut shares);
            let expected: Vec<u64> =
                values.iter().zip(0..).map(|(value, place)| flat_share(first + step * place, index, *value)).collect();
            assert_eq!(shares, expected);
            let sum = |shares: &[u64]| shares.iter().fold(0u64, |sum, share| sum.wrapping_add(*share));
            assert_eq!(added, sum(&expected).wrapping_sub(sum(&before)));
        }
    }

    #[test]
    fn half_of_the_bits_change_with_one() {
        let mut changed = 0;
        for bit in 0..96 {
            let of = |word: usize| if bit / 32 == word { 1 << (bit % 32) } else { 0 };
            changed += (flat_share(5, 2, [0; 3]) ^ flat_share(5, 2, [of(0), of(1), of(2)])).count_ones();
        }
        assert!((2500..3650).contains(&changed), "{changed} of 96 * 64");
    }
}
