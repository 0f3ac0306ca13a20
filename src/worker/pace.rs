//! How fast a run goes, how long it will take, and how long a slice should be.

use serde::{Deserialize, Serialize};

use std::collections::VecDeque;
use std::time::Duration;

/// Wall time that a slice should take: short beside the 50 ms in which commands are obeyed.
const SLICE_S: f64 = 0.008;

/// How much longer the next slice may be than the last.
const GROWTH: f64 = 2.0;

/// How much shorter a slice may be than the one before, at the most.
const SHRINKAGE: f64 = 8.0;

/// Wall time over which "lately" reaches back.
const LATELY_S: f64 = 3.0;

/// Wall time after which the usual rate of a run is known.
const USUAL_S: f64 = 30.0;

/// Wall time between two marks of the meter.
const MARK_S: f64 = 0.25;

/// Most marks for the estimate of the time left; when there are more, every second one goes.
const MOST_MARKS: usize = 256;

/// Share of the run, up to the present, whose rate tells the time left: the start may be of another kind.
const TELLING_SHARE: f64 = 0.5;

/// Blocks into which that share is cut, to see how much the rate varies.
const BLOCKS: usize = 10;

/// Fewest blocks with which the range is what varies between them.
const FEWEST_BLOCKS: usize = 4;

/// Half of the range, as a share of the rate, while there are fewer; and the widest later on.
const VAGUE: f64 = 0.5;

/// Mean of what was added since it was last taken.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mean {
    sum: f64,
    count: u32,
}

impl Mean {
    /// Adds a value.
    pub fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    /// The mean, if there is one; what comes next makes another.
    pub fn take(&mut self) -> Option<f64> {
        let Self { sum, count } = std::mem::take(self);
        (count > 0).then(|| sum / f64::from(count))
    }
}

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
    /// The last seconds.
    marks: VecDeque<Mark>,
    /// The whole run at its present pace, about `spacing` wall seconds apart.
    course: Vec<Mark>,
    spacing: f64,
}

impl Meter {
    /// Notes that the run went on for `spent` and is now at `time`.
    pub fn ran(&mut self, spent: Duration, time: f64, pair_collisions: u64) {
        self.wall_time += spent.as_secs_f64();
        let mark = Mark {
            wall_time: self.wall_time,
            time,
            pair_collisions,
        };
        let since = |last: Option<&Mark>| {
            last.map_or(f64::INFINITY, |last| mark.wall_time - last.wall_time)
        };
        if since(self.marks.back()) >= MARK_S {
            self.marks.push_back(mark);
            while self
                .marks
                .front()
                .is_some_and(|old| mark.wall_time - old.wall_time > LATELY_S + MARK_S)
            {
                self.marks.pop_front();
            }
        }
        if since(self.course.last()) >= self.spacing.max(MARK_S) {
            if self.course.len() == MOST_MARKS {
                let mut index = 0;
                self.course.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.spacing = 2.0 * self.spacing.max(MARK_S);
            }
            self.course.push(mark);
        }
    }

    /// Notes wall time spent on other work of the run: rows, observables, snapshots \[s\].
    pub fn spent(&mut self, wall_time: f64) {
        self.wall_time += wall_time.max(0.0);
    }

    /// Wall time spent running \[s\].
    pub fn wall_time(&self) -> f64 {
        self.wall_time
    }

    /// Forgets the past rates, when the run changes its pace.
    pub fn restart(&mut self) {
        self.marks.clear();
        self.course.clear();
        self.spacing = 0.0;
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

    /// Pair collisions per wall second over the run at its present pace; `None` until that is known well.
    pub fn usual_collision_rate(&self) -> Option<f64> {
        let (first, last) = (self.course.first()?, self.course.last()?);
        let span = last.wall_time - first.wall_time;
        let pairs = last.pair_collisions - first.pair_collisions;
        (span >= USUAL_S).then(|| pairs as f64 / span)
    }

    /// Wall seconds for `amount` of simulated time, low and high: from the rate over the newer half of the run at its present
    /// pace, and twice its standard error from blocks of it.
    pub fn time_for(&self, amount: f64) -> Option<(f64, f64)> {
        let (first, last) = (self.course.first()?, self.course.last()?);
        let from = last.wall_time - TELLING_SHARE * (last.wall_time - first.wall_time);
        let begin = self.course.partition_point(|mark| mark.wall_time < from);
        let telling = &self.course[begin.saturating_sub(1)..];
        let rate =
            |one: &Mark, other: &Mark| (other.time - one.time) / (other.wall_time - one.wall_time);
        let mean = rate(telling.first()?, last);
        if !(mean > 0.0) {
            return None; // also for a single mark
        }
        let stretch = telling.len().div_ceil(BLOCKS).max(1);
        let ends: Vec<&Mark> = telling.iter().step_by(stretch).collect();
        let rates: Vec<f64> = ends.windows(2).map(|ends| rate(ends[0], ends[1])).collect();
        let count = rates.len() as f64;
        let spread = if rates.len() < FEWEST_BLOCKS {
            VAGUE * mean
        } else {
            let squares: f64 = rates.iter().map(|rate| (rate - mean) * (rate - mean)).sum();
            (2.0 * (squares / (count * (count - 1.0))).sqrt()).min(VAGUE * mean)
        };
        Some((amount / (mean + spread), amount / (mean - spread)))
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
    ///
    /// A slice may be cut short to the last bit of its end, and the processor be away just then: that says nothing, and slices
    /// so short that time stood still would teach nothing else. So one slice shortens the next by a factor at the most.
    pub fn learn(&mut self, run: f64, spent: Duration) {
        let wanted = if run > 0.0 {
            run * SLICE_S / spent.as_secs_f64().max(1e-9)
        } else {
            f64::INFINITY
        };
        self.length = wanted.clamp(self.length / SHRINKAGE, self.length * GROWTH);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_goes_on_after_a_slice_of_one_bit_during_which_the_processor_was_away() {
        let (mut slices, mut time) = (Slices::new(1e-3), 60.0_f64);
        slices.learn(time.next_up() - time, Duration::from_millis(20));
        for _ in 0..40 {
            let end = time + slices.length();
            slices.learn(end - time, Duration::from_micros(1));
            time = end;
        }
        assert!(time > 61.0, "{time}");
        slices.learn(0.0, Duration::from_micros(1));
        assert!(slices.length() > 1e-3);
    }

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
        assert_eq!(meter.time_for(10.0), Some((20.0, 20.0)));
        assert_eq!(meter.wall_time(), 100.0);
    }

    /// Runs to time 1 at a rate that changes with the wall time, and looks at the estimates on the way.
    fn estimates(rate: impl Fn(f64) -> f64) -> Vec<(f64, f64, f64)> {
        let (mut meter, mut time, mut seen) = (Meter::default(), 0.0, Vec::new());
        while time < 1.0 {
            time += 0.01 * rate(meter.wall_time());
            meter.ran(Duration::from_millis(10), time, 0);
            let left = meter.time_for(1.0 - time);
            seen.extend(left.map(|(low, high)| (meter.wall_time(), low, high)));
        }
        seen
    }

    #[test]
    fn the_estimate_is_right_once_a_tenth_is_done_and_does_not_jump() {
        // Noise of 20 % from slice to slice, a slow start, and a slow change of the pace.
        let noise = |wall: f64| 0.2 * (wall * 7919.0).sin();
        let courses: [fn(f64) -> f64; 3] = [
            |_| 1.0,
            |wall| if wall < 2.0 { 0.3 } else { 1.0 },
            |wall| 1.0 - 0.1 * (wall / 400.0).min(1.0),
        ];
        for course in courses {
            let seen = estimates(|wall| (course(wall) + noise(wall)) / 400.0);
            let end = seen.last().expect("estimates").0;
            let settled = seen
                .iter()
                .filter(|(wall, ..)| *wall > 0.1 * end && *wall < 0.98 * end);
            let middle = |(_, low, high): &(f64, f64, f64)| f64::midpoint(*low, *high);
            let mut errors: Vec<f64> = (settled.clone())
                .map(|one| (middle(one) / (end - one.0) - 1.0).abs())
                .collect();
            errors.sort_by(f64::total_cmp);
            assert!(
                errors[errors.len() / 2] < 0.05,
                "{}",
                errors[errors.len() / 2]
            );
            let all: Vec<_> = settled.collect();
            for pair in all.windows(2) {
                let jump = middle(pair[1]) / middle(pair[0]) - 1.0;
                assert!(jump.abs() < 0.1, "{jump} at {}", pair[0].0);
            }
        }
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
