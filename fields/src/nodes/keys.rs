//! Key frames: where in a list of keys a fraction lies, and what is wrong with a list.

/// Between which keys a fraction lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    /// The key before, or the first.
    pub(super) from: usize,
    /// The key after, or the last.
    pub(super) to: usize,
    /// 0 at `from`, 1 at `to`.
    pub(super) share: f32,
    /// Distance of the two keys.
    pub(super) length: f32,
}

/// The span of a fraction, at the ends beyond them; None without keys and for NaN.
pub(super) fn span(keys: &[f32], fraction: f32) -> Option<Span> {
    let last = keys.len().checked_sub(1)?;
    let at = |key| Some(Span { from: key, to: key, share: 0.0, length: 0.0 });
    if fraction.is_nan() {
        return None;
    }
    match keys.partition_point(|key| *key <= fraction) {
        0 => at(0),
        next if next > last => at(last),
        next => {
            let length = keys[next] - keys[next - 1];
            let share = if length > 0.0 { (fraction - keys[next - 1]) / length } else { 1.0 };
            Some(Span { from: next - 1, to: next, share, length })
        }
    }
}

/// What is wrong with keys of which each has a number of values; nothing is wrong with no keys and no values.
pub(super) fn fault(keys: &[f32], values: usize, per_key: Option<usize>, stride: usize) -> Option<String> {
    if let Some(at) = keys.iter().position(|key| !key.is_finite()) {
        return Some(format!("key[{at}] is {}", keys[at]));
    }
    if let Some(at) = keys.windows(2).position(|pair| pair[1] < pair[0]) {
        return Some(format!(
            "the keys must not descend: key[{}] = {} comes after key[{at}] = {}",
            at + 1,
            keys[at + 1],
            keys[at]
        ));
    }
    let fits = match per_key {
        Some(per_key) => values == keys.len() * per_key * stride,
        None if keys.is_empty() => values == 0,
        None => values > 0 && values.is_multiple_of(keys.len() * stride),
    };
    if fits {
        return None;
    }
    let needed = match per_key {
        Some(per_key) => (keys.len() * per_key * stride).to_string(),
        None => format!("a multiple of {}", keys.len() * stride),
    };
    Some(format!("{} keys need {needed} key_values, there are {values}", keys.len()))
}
