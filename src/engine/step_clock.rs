//! When steps end: at whole multiples of their length, each computed anew, so that no rounding adds up.

use serde::{Deserialize, Serialize};

use crate::time::Time;

/// Ticks of the time grid in an epoch, as a power of two.
const TICK_BITS: i32 = 49;

/// Shortest step \[epochs\]: one tick of the time grid.
const SHORTEST: f64 = 1.0 / (1_u64 << TICK_BITS) as f64;

/// Longest step \[epochs\]: longer than any run.
const LONGEST: f64 = (1_u64 << 52) as f64;

/// Share of a step by which it may end after a given instant and still count as done by then: `0.1` added up a hundred times
/// is not ten.
const TOLERANCE: f64 = 1.0 / (1 << 20) as f64;

/// The ends of the steps.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct StepClock {
    /// Where the steps count from; a step ends here, too.
    origin: Time,
    length: f64,
    next: u64,
}

impl StepClock {
    /// Steps of `length` epochs from time zero on; the next is the first that ends after `now`.
    ///
    /// Lengths below one tick of the time grid are taken for one tick.
    pub fn new(length: f64, now: Time) -> Self {
        let length = length.clamp(SHORTEST, LONGEST);
        let mut clock = Self {
            origin: Time::default(),
            length,
            next: (now.relative_to(0) / length) as u64,
        };
        while clock.next > 0 && clock.next_end() > now {
            clock.next -= 1;
        }
        while clock.next_end() <= now {
            clock.next += 1;
        }
        clock
    }

    /// When the next step ends.
    pub fn next_end(&self) -> Time {
        self.end_of(self.next)
    }

    /// Whether the next step ends at or before `until`, or a millionth of a step after it.
    pub fn is_due(&self, until: Time) -> bool {
        self.next_end().since(until) <= TOLERANCE * self.length
    }

    /// Which step ends next, counted from the origin.
    pub fn number(&self) -> u64 {
        self.next
    }

    /// Goes on to the next step.
    pub fn tick(&mut self) {
        self.next += 1;
    }

    /// Mirrors the ends of the steps at `now`, which lies between the last and the next: a gas that flies back meets them
    /// again. A step that ends right now ends again, to undo what it did.
    ///
    /// # Panics
    /// If a step is longer than any run.
    pub fn reverse(&mut self, now: Time) {
        let since_last = if self.next > 0 {
            now.since(self.end_of(self.next - 1))
        } else {
            self.length - self.next_end().since(now)
        };
        self.origin = now
            .after(since_last.max(0.0))
            .expect("a step is not longer than a run");
        self.next = 0;
    }

    /// End of step `number`: `number * length` after the origin, rounded once, to the time grid.
    fn end_of(&self, number: u64) -> Time {
        // length = significand * 2^exponent, and the product of two 64-bit numbers fits 128 bits.
        let bits = self.length.to_bits();
        let significand = (bits & ((1 << 52) - 1)) | (1 << 52);
        let exponent = (bits >> 52) as i32 - 1075 + TICK_BITS;
        let product = u128::from(significand) * u128::from(number);
        let ticks = if exponent >= 0 {
            product << exponent
        } else {
            let half = 1_u128 << (-exponent - 1);
            (product + half) >> -exponent
        };
        let local = (ticks & ((1 << TICK_BITS) - 1)) as f64 * SHORTEST + self.origin.local;
        let whole = local as u64;
        Time {
            epoch: self.origin.epoch + (ticks >> TICK_BITS) as u64 + whole,
            local: local - whole as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn instant(time: f64) -> Time {
        Time::default().after(time).expect("near")
    }

    #[test]
    fn a_hundred_tenths_are_ten_and_a_million_thirds_a_third_of_a_million() {
        for (length, number, end) in [
            (0.1, 100, 10.0),
            (1.0 / 3.0, 3_000_000, 1e6),
            (0.25, 7, 1.75),
        ] {
            let mut clock = StepClock::new(length, Time::default());
            let mut count = 0;
            while clock.is_due(instant(end)) {
                count += 1;
                clock.tick();
            }
            assert_eq!(count, number, "{length}");
        }
    }

    #[test]
    fn steps_are_as_exact_after_a_million_epochs_as_at_the_start() {
        let clock = |next| StepClock {
            origin: Time::default(),
            length: 0.1,
            next,
        };
        // 0.1 as a double is 0.1 + 5.55e-18: after 1e7 steps that is 5.55e-11, which is no rounding of ours.
        let late = clock(10_000_001).next_end();
        assert_eq!(late.epoch, 1_000_000);
        assert!((late.local - 0.1 - 5.551e-11).abs() < 1e-14, "{late:?}");
    }

    #[test]
    fn a_clock_goes_on_after_the_present() {
        let ends = |now: f64| StepClock::new(0.25, instant(now)).next_end();
        assert_eq!(ends(0.0), instant(0.25));
        assert_eq!(ends(0.3), instant(0.5));
        assert_eq!(ends(0.5), instant(0.75));
    }

    #[test]
    fn a_reversed_clock_meets_the_same_instants_and_twice_reversed_goes_on() {
        let mut clock = StepClock::new(0.25, instant(0.625));
        clock.reverse(instant(0.625));
        assert_eq!(clock.next_end(), instant(0.75), "0.5, seen in the mirror");
        clock.reverse(instant(0.625));
        assert_eq!(clock.next_end(), instant(0.75));
        let mut clock = StepClock::new(0.25, instant(0.5));
        clock.reverse(instant(0.5));
        assert_eq!(clock.next_end(), instant(0.5), "what it did is undone");
        clock.tick();
        assert_eq!(clock.next_end(), instant(0.75));
    }
}
