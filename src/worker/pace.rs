//! How fast a run goes, how long it will take, and how long a slice should be.

use serde::{Deserialize, Serialize};

use std::collections::VecDeque;
use std::time::Duration;

/// Wall time that a slice should take: short beside the 50 ms in which commands are obeyed.
const SLICE_S: f64 = 0.008;

/// How much longer the next slice may be than the last.
const GROWTH: f64 = 2.0;

/// Wall time over which "lately" reaches back.
const LATELY_S: f64 = 3.0;

/// Wall time between two marks of the meter.
const MARK_S: f64 = 0.25;

/// Marks kept for the estimate of the time left: two minutes.
const MOST_MARKS: usize = 480;

/// Where a run was at a moment of its wall time.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Mark {
    wall_time: f64,
    time: f64,
    pair_collisions: u64,
}

/// Measures a run against the wall clock, pauses excluded.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Meter {
    wall_time: f64,
    marks: VecDeque<Mark>,
}

impl Meter {
    /// Notes that the run went on for `spent` and is now at `time`.
    pub fn ran(&mut self, spent: Duration, time: f64, pair_collisions: u64) {
        self.wall_time += spent.as_secs_f64();
        if self
            .marks
            .back()
            .is_none_or(|mark| self.wall_time - mark.wall_time >= MARK_S)
        {
            self.marks.push_back(Mark {
                wall_time: self.wall_time,
                time,
                pair_collisions,
            });
            if self.marks.len() > MOST_MARKS {
                self.marks.pop_front();
            }
        }
    }

    /// Wall time spent running \[s\].
    pub fn wall_time(&self) -> f64 {
        self.wall_time
    }

    /// Forgets the past rates, when the run changes its pace.
    pub fn restart(&mut self) {
        self.marks.clear();
    }

    /// Simulated time and pair collisions per wall second, lately.
    pub fn rates(&self) -> Option<(f64, f64)> {
        let last = self.marks.back()?;
        let first = self
            .marks
            .iter()
            .rev()
            .take_while(|mark| last.wall_time - mark.wall_time <= LATELY_S)
            .last()?;
        let span = last.wall_time - first.wall_time;
        (span > 0.0).then(|| {
            (
                (last.time - first.time) / span,
                (last.pair_collisions - first.pair_collisions) as f64 / span,
            )
        })
    }

    /// Wall seconds to `until`, low and high: from the fastest and the slowest of the last tenths of the marks.
    pub fn time_left(&self, time: f64, until: f64) -> Option<(f64, f64)> {
        let (rate, _) = self.rates()?;
        let stretch = (self.marks.len() / 10).max(1);
        let stretches = || {
            let ends = self.marks.iter().step_by(stretch);
            ends.clone()
                .zip(ends.skip(1))
                .map(|(first, last)| (last.time - first.time) / (last.wall_time - first.wall_time))
        };
        let slowest = stretches().fold(rate, f64::min);
        let fastest = stretches().fold(rate, f64::max);
        (slowest > 0.0).then(|| ((until - time) / fastest, (until - time) / slowest))
    }
}

/// Chooses slices of simulated time that take [`SLICE_S`] of wall time.
#[derive(Clone, Debug)]
pub struct Slices {
    length: f64,
}

impl Slices {
    /// Begins with slices of simulated time `length`.
    pub fn new(length: f64) -> Self {
        Self { length }
    }

    /// Simulated time that the next slice should take.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Learns that a slice of simulated time `run` took `spent`.
    pub fn learn(&mut self, run: f64, spent: Duration) {
        let wanted = run * SLICE_S / spent.as_secs_f64().max(1e-9);
        // A slice cut short says little: it may not shorten the next one below what it shows, nor lengthen it at a stroke.
        if run > 0.0 && wanted.is_finite() {
            self.length = wanted.min(self.length * GROWTH);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_run_has_a_steady_rate_and_a_sharp_estimate() {
        let mut meter = Meter::default();
        assert_eq!(meter.rates(), None);
        for second in 1..=100 {
            meter.ran(
                Duration::from_secs(1),
                f64::from(second) * 0.5,
                second as u64 * 10,
            );
        }
        assert_eq!(meter.rates(), Some((0.5, 10.0)));
        assert_eq!(meter.time_left(50.0, 60.0), Some((20.0, 20.0)));
        assert_eq!(meter.wall_time(), 100.0);
    }

    #[test]
    fn slices_tend_to_their_wall_time() {
        let mut slices = Slices::new(1e-6);
        for _ in 0..60 {
            let run = slices.length();
            slices.learn(run, Duration::from_secs_f64(run * 0.1));
        }
        assert!((slices.length() * 0.1 / SLICE_S - 1.0).abs() < 1e-6);
    }
}
