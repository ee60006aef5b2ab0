//! What each field and route adds to the one hash of all values: a sum, so that order plays no part and a frame costs what was written
//! in it.

use xxhash_rust::xxh3::xxh3_64_with_seed;

/// Odd numbers with as many ones as zeros in each byte, of wyhash.
const SECRETS: [u64; 3] = [0x2d35_8dcc_aa6c_78a5, 0x8bb8_4b93_962e_acc9, 0x4b33_a62e_d433_d4a3];

/// Both halves of a product: the step of wyhash (Wang Yi, final version 4).
#[inline]
fn fold(a: u64, b: u64) -> u64 {
    let product = a as u128 * b as u128;
    product as u64 ^ (product >> 64) as u64
}

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
    let word = |place: usize| floats.get(place).map_or(0, |float| *float as u64);
    let mut state = seed_of(number, index) ^ (COUNT as u64).wrapping_mul(SECRETS[2]);
    for place in (0..COUNT).step_by(4) {
        let (low, high) = (word(place) | word(place + 1) << 32, word(place + 2) | word(place + 3) << 32);
        state = fold(low ^ state, high ^ SECRETS[2] ^ state.rotate_left(32));
    }
    state.max(1)
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
    fn half_of_the_bits_change_with_one() {
        let mut changed = 0;
        for bit in 0..96 {
            let of = |word: usize| if bit / 32 == word { 1 << (bit % 32) } else { 0 };
            changed += (flat_share(5, 2, [0; 3]) ^ flat_share(5, 2, [of(0), of(1), of(2)])).count_ones();
        }
        assert!((2500..3650).contains(&changed), "{changed} of 96 * 64");
    }
}
