//! Simulated time that keeps its precision: an epoch count plus a local time on a fixed grid.

use serde::{Deserialize, Serialize};

/// Added to a local time and taken away again, it leaves a multiple of 2^-49: f64 numbers in `[8, 16)` have that spacing.
const ROUND_TO_GRID: f64 = 12.0;

/// An instant: whole epochs plus a local time in `[0, 1)` epochs, a multiple of 2^-49.
///
/// The smallest step stays the same however long a run lasts (an f64 second would coarsen), and moving to another epoch
/// is exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd, Serialize, Deserialize)]
pub struct Time {
    /// Whole epochs.
    pub epoch: u64,
    /// Rest, in `[0, 1)` epochs.
    pub local: f64,
}

impl Time {
    /// The instant `duration` epochs later, rounded to the grid; `None` where that is too far away to matter (2^52 epochs).
    ///
    /// `duration` must not be negative. Monotone: a longer duration never gives an earlier instant.
    #[inline]
    pub fn after(self, duration: f64) -> Option<Self> {
        const FAR: f64 = (1_u64 << 52) as f64;
        let local = (self.local + duration + ROUND_TO_GRID) - ROUND_TO_GRID;
        (local < FAR).then(|| {
            let whole = local as u64;
            Self {
                epoch: self.epoch + whole,
                local: local - whole as f64,
            }
        })
    }

    /// Epochs from `earlier` to `self`; negative if `self` is the earlier one.
    #[inline]
    pub fn since(self, earlier: Self) -> f64 {
        self.epoch.wrapping_sub(earlier.epoch).cast_signed() as f64 + (self.local - earlier.local)
    }

    /// Epochs from the beginning of epoch `base`; exact up to 16 epochs.
    #[inline]
    pub fn relative_to(self, base: u64) -> f64 {
        self.since(Self {
            epoch: base,
            local: 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn later_instants_are_on_the_grid_and_in_order() {
        let start = Time {
            epoch: 3,
            local: 0.75,
        };
        assert_eq!(
            start.after(0.5),
            Some(Time {
                epoch: 4,
                local: 0.25
            })
        );
        let mut last = start;
        for step in 0..1000 {
            let next = start
                .after(f64::from(step) * 0.001_234_567_89)
                .expect("near");
            assert!(next >= last);
            assert_eq!((next.local * 2.0_f64.powi(49)).fract(), 0.0);
            last = next;
        }
    }

    #[test]
    fn an_instant_beyond_reach_is_none() {
        assert_eq!(Time::default().after(f64::INFINITY), None);
        assert_eq!(Time::default().after(1e300), None);
    }

    #[test]
    fn differences_are_exact_at_any_epoch() {
        let tick = 2.0_f64.powi(-49);
        let early = Time {
            epoch: 1 << 40,
            local: tick,
        };
        let late = Time {
            epoch: (1 << 40) + 2,
            local: 3.0 * tick,
        };
        assert_eq!(late.since(early), 2.0 + 2.0 * tick);
        assert_eq!(early.since(late), -2.0 - 2.0 * tick);
    }
}
