//! A run's history in constant memory: fine for the recent past, coarser the longer ago, with lowest, mean and highest value.
//!
//! What always holds: level 0 has the newest stretches as they were measured, each further level has stretches four times as
//! long, merged from those of the level before. Each level forgets its oldest stretches when it is full; the last level that
//! exists reaches back to the start of the run. Nothing is lost in merging but the order within a stretch.
//!
//! Time is simulated time, which grows also after a reversal. Stretches take equal wall times of the run, pauses excluded.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// Stretches of one level that merge into one of the next.
const MERGE: usize = 4;

/// Most stretches of a level: a quarter to all of these tell the whole run.
pub const MOST_STRETCHES: usize = 512;

/// Most levels: with stretches of half a second the last one holds 16 000 years.
const MOST_LEVELS: usize = 16;

/// What the history follows, in the scene's units.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Observable {
    /// Temperature.
    Temperature,
    /// Force on the walls per area, over the stretch.
    PressureWall,
    /// Pressure from the virial of the pair collisions, over the stretch.
    PressureVirial,
    /// `p V / (N k T)`, over the stretch.
    CompressibilityFactor,
    /// Pair collisions per simulated time.
    PairRate,
    /// Wall collisions per simulated time.
    WallRate,
    /// Relative change of energy since the start.
    EnergyDrift,
    /// Relative momentum that the walls do not explain.
    MomentumDrift,
    /// Relative error of the virial ledger.
    VirialResidual,
    /// Largest overlap so far, in contact distances.
    MaxOverlap,
    /// Distance of the speeds from Maxwell's distribution, over the distance that one run in a thousand exceeds by chance.
    SpeedDeviation,
    /// Events waiting.
    QueueLength,
    /// Pair collisions per wall second.
    Speed,
    /// Resident memory \[bytes\].
    Memory,
}

impl Observable {
    /// All of them, in the order of the columns of a file.
    pub const ALL: [Self; COUNT] = [
        Self::Temperature,
        Self::PressureWall,
        Self::PressureVirial,
        Self::CompressibilityFactor,
        Self::PairRate,
        Self::WallRate,
        Self::EnergyDrift,
        Self::MomentumDrift,
        Self::VirialResidual,
        Self::MaxOverlap,
        Self::SpeedDeviation,
        Self::QueueLength,
        Self::Speed,
        Self::Memory,
    ];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Temperature => "temperature",
            Self::PressureWall => "pressure_wall",
            Self::PressureVirial => "pressure_virial",
            Self::CompressibilityFactor => "compressibility_factor",
            Self::PairRate => "pair_rate",
            Self::WallRate => "wall_rate",
            Self::EnergyDrift => "energy_drift",
            Self::MomentumDrift => "momentum_drift",
            Self::VirialResidual => "virial_residual",
            Self::MaxOverlap => "max_overlap",
            Self::SpeedDeviation => "speed_deviation",
            Self::QueueLength => "queue_length",
            Self::Speed => "collisions_per_wall_second",
            Self::Memory => "memory_bytes",
        }
    }
}

/// Number of observables.
pub const COUNT: usize = 14;

/// A quantity over a stretch of time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// Lowest value.
    pub low: f64,
    /// Mean value.
    pub mean: f64,
    /// Highest value.
    pub high: f64,
}

impl Range {
    /// A value that was measured once.
    pub fn of(value: f64) -> Self {
        Self {
            low: value,
            mean: value,
            high: value,
        }
    }

    /// Both, with their means weighted.
    fn merged(self, weight: f64, other: Self, other_weight: f64) -> Self {
        let share = if weight + other_weight > 0.0 {
            other_weight / (weight + other_weight)
        } else {
            0.5
        };
        Self {
            low: self.low.min(other.low),
            mean: self.mean + share * (other.mean - self.mean),
            high: self.high.max(other.high),
        }
    }
}

/// A stretch of the run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stretch {
    /// Simulated time at its beginning.
    pub begin: f64,
    /// Simulated time at its end.
    pub end: f64,
    /// Wall time of the run at its end, pauses excluded \[s\].
    pub wall_time_s: f64,
    values: [Option<Range>; COUNT],
}

impl Stretch {
    /// A stretch without values.
    pub fn new(begin: f64, end: f64, wall_time_s: f64) -> Self {
        Self {
            begin,
            end,
            wall_time_s,
            values: [None; COUNT],
        }
    }

    /// Notes a value; one that does not exist leaves a gap.
    #[must_use]
    pub fn with(mut self, observable: Observable, value: Option<f64>) -> Self {
        self.values[observable as usize] = value.filter(|value| value.is_finite()).map(Range::of);
        self
    }

    /// An observable over this stretch; `None` if it did not exist.
    pub fn get(&self, observable: Observable) -> Option<Range> {
        self.values[observable as usize]
    }

    /// This stretch and the next one.
    fn merged(&self, next: &Self) -> Self {
        let weights = (self.end - self.begin, next.end - next.begin);
        let both = |index: usize| match (self.values[index], next.values[index]) {
            (Some(mine), Some(other)) => Some(mine.merged(weights.0, other, weights.1)),
            (mine, other) => mine.or(other),
        };
        Self {
            begin: self.begin,
            end: next.end,
            wall_time_s: next.wall_time_s,
            values: std::array::from_fn(both),
        }
    }
}

/// Stretches of about equal length, and those that wait to be merged into one of the next level.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Level {
    stretches: VecDeque<Stretch>,
    waiting: usize,
    merging: Option<Stretch>,
    /// Whether its oldest stretch is no longer the run's first.
    forgetful: bool,
}

/// The history of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct History {
    levels: Vec<Level>,
    pushed: u64,
}

impl History {
    /// Adds what was measured since the stretch before.
    pub fn push(&mut self, stretch: Stretch) {
        self.pushed += 1;
        let mut next = Some(stretch);
        let mut index = 0;
        while let Some(stretch) = next.take().filter(|_| index < MOST_LEVELS) {
            if index == self.levels.len() {
                self.levels.push(Level::default());
            }
            let level = &mut self.levels[index];
            if level.stretches.len() == MOST_STRETCHES {
                level.stretches.pop_front();
                level.forgetful = true;
            }
            level.stretches.push_back(stretch);
            let merging = level
                .merging
                .map_or(stretch, |before| before.merged(&stretch));
            level.merging = Some(merging);
            level.waiting += 1;
            if level.waiting == MERGE {
                (level.waiting, level.merging, next) = (0, None, Some(merging));
            }
            index += 1;
        }
    }

    /// How many stretches have been added since the run began: grows by one with each.
    pub fn pushed(&self) -> u64 {
        self.pushed
    }

    /// What was added after the first `pushed` stretches, oldest first: whoever has the history as it was then, and pushes
    /// these, has it as it is now. `None` if that is too long ago.
    pub fn since(&self, pushed: u64) -> Option<Vec<Stretch>> {
        let missing = self.pushed.checked_sub(pushed)? as usize;
        let newest = self.levels.first().map(|level| &level.stretches);
        let available = newest.map_or(0, VecDeque::len);
        (missing <= available).then(|| {
            let newest = newest.into_iter().flatten();
            newest.skip(available - missing).copied().collect()
        })
    }

    /// Simulated times at which the history begins and ends; `None` while it is empty.
    pub fn bounds(&self) -> Option<(f64, f64)> {
        let begin = self.levels.last()?.stretches.front()?.begin;
        let end = self.levels.first()?.stretches.back()?.end;
        Some((begin, end))
    }

    /// The stretches that overlap `from..to` of the simulated time, oldest first and without gaps, as fine as they are still
    /// known for all of that time: at most [`MOST_STRETCHES`] and a few.
    pub fn stretches(&self, from: f64, to: f64) -> Vec<Stretch> {
        let reaches = |level: &Level| {
            let first = level.stretches.front();
            first.is_some_and(|first| first.begin <= from || !level.forgetful)
        };
        let Some(coarsest) = self.levels.len().checked_sub(1) else {
            return Vec::new();
        };
        let finest = self.levels.iter().position(reaches);
        self.at_level(finest.unwrap_or(coarsest))
            .filter(|stretch| stretch.end > from && stretch.begin < to)
            .collect()
    }

    /// The whole run, each time once and as fine as it is still known, oldest first.
    pub fn whole(&self) -> Vec<Stretch> {
        let mut whole: Vec<Stretch> = Vec::new();
        for level in self.levels.iter().rev() {
            // Of two levels that tell the same time the finer one is believed, but for the coarse stretch that it begins within.
            let Some(first) = level.stretches.front() else {
                continue;
            };
            whole.truncate(whole.partition_point(|known| known.begin < first.begin));
            let end = whole.last().map_or(f64::NEG_INFINITY, |last| last.end);
            let new = level.stretches.iter();
            whole.extend(new.filter(|stretch| stretch.begin >= end));
        }
        whole
    }

    /// An observable in `columns` equal spans of `from..=to`, for a chart: lowest, mean and highest value in each. A span that
    /// no stretch ends in shows the stretch it lies in; where nothing is known it is `None`.
    pub fn columns(
        &self,
        observable: Observable,
        (from, to): (f64, f64),
        columns: usize,
    ) -> Vec<Option<Range>> {
        let mut spans: Vec<Option<(Range, f64)>> = vec![None; columns];
        let width = (to - from) / columns as f64;
        if !(width > 0.0) || !width.is_finite() {
            return vec![None; columns];
        }
        let place = |time: f64| ((time - from) / width).clamp(0.0, columns as f64);
        for stretch in self.stretches(from, to) {
            let Some(range) = stretch.get(observable) else {
                continue;
            };
            let (begin, end) = (place(stretch.begin), place(stretch.end));
            // Any span that it touches by more than rounding.
            let first = (begin + 1e-9) as usize;
            let last = ((end - 1e-9).ceil() as usize).clamp(first + 1, columns.max(first + 1));
            for (index, span) in spans.iter_mut().enumerate().take(last).skip(first) {
                let part = (end.min(index as f64 + 1.0) - begin.max(index as f64)).max(0.0);
                *span = Some(match *span {
                    Some((known, weight)) => (known.merged(weight, range, part), weight + part),
                    None => (range, part),
                });
            }
        }
        let range = |span: Option<(Range, f64)>| span.map(|(range, _)| range);
        spans.into_iter().map(range).collect()
    }

    /// The means of an observable over the whole run, each at the end of its stretch: at most [`MOST_STRETCHES`] and a few.
    pub fn means(&self, observable: Observable) -> Vec<(f64, f64)> {
        let mean = |stretch: Stretch| Some((stretch.end, stretch.get(observable)?.mean));
        let whole = self.stretches(f64::NEG_INFINITY, f64::INFINITY);
        whole.into_iter().filter_map(mean).collect()
    }

    /// The stretches of a level, and after them those not yet merged into it, from the finer levels.
    fn at_level(&self, level: usize) -> impl Iterator<Item = Stretch> {
        let newer = self.levels[..level].iter().rev().flat_map(|finer| {
            let skipped = finer.stretches.len() - finer.waiting;
            finer.stretches.iter().skip(skipped)
        });
        self.levels[level].stretches.iter().chain(newer).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run whose temperature is the number of the stretch.
    fn counting(stretches: usize) -> History {
        let mut history = History::default();
        for number in 0..stretches {
            let time = number as f64;
            let stretch = Stretch::new(time, time + 1.0, time)
                .with(Observable::Temperature, Some(time))
                .with(Observable::MaxOverlap, None);
            history.push(stretch);
        }
        history
    }

    #[test]
    fn a_long_history_stays_bounded_and_keeps_mean_and_extremes() {
        let count = 100_000;
        let history = counting(count);
        let whole = history.stretches(0.0, count as f64);
        assert!(
            whole.len() <= MOST_STRETCHES + MOST_LEVELS * MERGE && whole.len() > MOST_STRETCHES / 4
        );
        assert!(whole.windows(2).all(|pair| pair[0].end == pair[1].begin));
        assert_eq!(
            (whole[0].begin, whole[whole.len() - 1].end),
            (0.0, count as f64)
        );
        let one = history.columns(Observable::Temperature, (0.0, count as f64), 1);
        let range = one[0].expect("all of the run");
        assert_eq!((range.low, range.high), (0.0, (count - 1) as f64));
        assert!(
            (range.mean / (0.5 * (count - 1) as f64) - 1.0).abs() < 1e-12,
            "{range:?}"
        );
        let kept: usize = history
            .levels
            .iter()
            .map(|level| level.stretches.len())
            .sum();
        assert!(kept < 6 * MOST_STRETCHES, "{kept}");
    }

    #[test]
    fn the_recent_past_is_fine_and_the_distant_past_is_coarse() {
        let history = counting(100_000);
        let recent = history.stretches(99_900.0, 100_000.0);
        assert!(
            recent
                .iter()
                .all(|stretch| stretch.end - stretch.begin == 1.0)
        );
        assert_eq!(recent.len(), 100);
        let whole = history.whole();
        assert!(whole.windows(2).all(|pair| pair[0].end == pair[1].begin));
        assert_eq!(
            (whole[0].begin, whole[whole.len() - 1].end),
            (0.0, 100_000.0)
        );
        assert!(whole[0].end - whole[0].begin >= 256.0);
    }

    #[test]
    fn a_column_has_the_values_that_lie_in_it_and_a_gap_where_nothing_is_known() {
        let history = counting(8);
        let columns = history.columns(Observable::Temperature, (0.0, 16.0), 4);
        let range = |low: f64, mean: f64, high: f64| Some(Range { low, mean, high });
        assert_eq!(
            columns,
            [range(0.0, 1.5, 3.0), range(4.0, 5.5, 7.0), None, None]
        );
        let narrow = history.columns(Observable::Temperature, (2.0, 4.0), 4);
        let each = |value: f64| Some(Range::of(value));
        assert_eq!(narrow, [each(2.0), each(2.0), each(3.0), each(3.0)]);
        assert_eq!(
            history.columns(Observable::MaxOverlap, (0.0, 8.0), 2),
            [None, None]
        );
        assert_eq!(
            history.columns(Observable::Temperature, (3.0, 3.0), 2),
            [None, None]
        );
    }

    #[test]
    fn whoever_has_the_past_needs_only_what_was_added() {
        let (mut old, new) = (counting(700), counting(1000));
        let added = new.since(old.pushed()).expect("not long ago");
        assert_eq!(added.len(), 300);
        for stretch in added {
            old.push(stretch);
        }
        assert_eq!(old, new);
        assert_eq!(new.since(10), None, "too long ago");
        assert_eq!(History::default().since(0), Some(Vec::new()));
    }
}
