//! How long frames waited for displays, in memory that does not grow with the frames.

use std::time::Duration;

use hdrhistogram::Histogram;

/// Longer waits count as this one: an hour, in microseconds.
const LONGEST_US: u64 = 3_600_000_000;

/// Waits of any number of frames, each to a thousandth of itself.
#[derive(Clone, Debug)]
pub struct Waits {
    /// In microseconds; none where the library refuses its own settings, which it does not.
    all: Option<Histogram<u64>>,
}

impl Default for Waits {
    fn default() -> Waits {
        Waits { all: Histogram::new_with_bounds(1, LONGEST_US, 3).ok() }
    }
}

impl Waits {
    pub(super) fn note(&mut self, wait: Duration) {
        if let Some(all) = &mut self.all {
            all.saturating_record(wait.as_micros().try_into().unwrap_or(LONGEST_US));
        }
    }

    /// How many frames there were.
    pub fn count(&self) -> u64 {
        self.all.as_ref().map_or(0, Histogram::len)
    }

    /// The longest wait.
    pub fn longest(&self) -> Duration {
        Duration::from_micros(self.all.as_ref().map_or(0, Histogram::max))
    }

    /// The wait that this part of the frames does not exceed; 0.5 for half of them.
    pub fn quantile(&self, part: f64) -> Duration {
        Duration::from_micros(self.all.as_ref().map_or(0, |all| all.value_at_quantile(part)))
    }

    /// Those that came after what was noted `before`, an earlier state of the same.
    pub fn since(&self, before: &Waits) -> Waits {
        let mut later = self.clone();
        if let (Some(all), Some(before)) = (&mut later.all, &before.all) {
            // What is subtracted was counted before.
            let _ = all.subtract(before);
        }
        later
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_are_told_to_a_thousandth() {
        let mut waits = Waits::default();
        assert_eq!((waits.count(), waits.longest(), waits.quantile(0.5)), (0, Duration::ZERO, Duration::ZERO));
        (1..=1000).for_each(|ms| waits.note(Duration::from_millis(ms)));
        let before = waits.clone();
        [3, 5000, 7, 3].into_iter().for_each(|ms| waits.note(Duration::from_millis(ms)));
        waits.note(Duration::from_secs(100_000));
        let is_near = |found: Duration, ms: u64| found.as_millis().abs_diff(ms.into()) <= u128::from(ms / 1000 + 1);
        assert!(is_near(before.quantile(0.5), 500) && is_near(before.quantile(0.99), 990) && is_near(before.longest(), 1000));
        let later = waits.since(&before);
        assert_eq!((later.count(), waits.count()), (5, 1005));
        assert!(is_near(later.quantile(0.2), 3) && is_near(later.quantile(0.8), 5000), "{later:?}");
        assert!(is_near(later.longest(), 3_600_000), "{:?}", later.longest());
    }
}
