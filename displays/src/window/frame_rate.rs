//! Counts frames.

use std::time::{Duration, Instant};

const EVERY: Duration = Duration::from_millis(500);

/// Frames per second, told now and then.
pub(super) struct FrameRate {
    since: Instant,
    frames: u32,
}

impl FrameRate {
    pub(super) fn new(now: Instant) -> FrameRate {
        FrameRate { since: now, frames: 0 }
    }

    /// One more frame. Gives the rate twice a second.
    pub(super) fn frame(&mut self, now: Instant) -> Option<f64> {
        self.frames += 1;
        let passed = now - self.since;
        if passed < EVERY {
            return None;
        }
        let rate = f64::from(self.frames) / passed.as_secs_f64();
        *self = FrameRate::new(now);
        Some(rate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tells_the_rate_twice_a_second() {
        let start = Instant::now();
        let mut rate = FrameRate::new(start);
        let told: Vec<_> = (1..=100).filter_map(|i| rate.frame(start + Duration::from_millis(20 * i))).collect();
        assert_eq!(told.len(), 4);
        assert!(told.iter().all(|r| (r - 50.0).abs() < 1e-9), "{told:?}");
    }
}
