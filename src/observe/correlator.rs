//! Correlations over many decades of time in one pass and constant memory: the multiple-tau correlator.
//!
//! Level `l` keeps the last `POINTS` of every `2^l`-th record, so lags grow like powers of two and the work per record does
//! not grow with the run. Records are thinned, not averaged: every lag is exact, only its number of pairs is smaller.
//!
//! Source: Ramirez, Sukumaran, Vorselaars & Likhtman, J. Chem. Phys. 133, 154103 (2010), there with averaging.

use std::ops::Range;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::observe::block_sums::{BlockSums, Estimate};

/// Records kept on each level.
const POINTS: usize = 16;

/// Levels: lags up to `15 * 2^29` records.
const LEVELS: usize = 30;

/// Lags of all levels: 0 to 15, then 8 to 15 times each power of two.
const LAG_COUNT: usize = POINTS + (LEVELS - 1) * POINTS / 2;

/// What is correlated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// Mean of `|x(t) - x(0)|^2`.
    Displacement,
    /// Mean of `x(t) . x(0)`.
    Product,
}

/// Correlations of several vectors, averaged over groups of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correlator {
    kind: Kind,
    /// Group of each vector.
    groups: Vec<u16>,
    group_sizes: Vec<u32>,
    levels: Vec<Level>,
    /// Records since the start or the last interruption.
    records: u64,
    /// For each lag: how many pairs of records, then the sum of each group.
    sums: BlockSums,
}

/// The last records of one level, the oldest overwritten first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Level {
    ring: Vec<DVec3>,
    filled: usize,
    next: usize,
}

impl Correlator {
    /// Nothing recorded yet; `groups` has the group of each vector, from 0 to `group_count`.
    pub fn new(kind: Kind, groups: Vec<u16>, group_count: usize) -> Self {
        let mut group_sizes = vec![0; group_count];
        for &group in &groups {
            group_sizes[usize::from(group)] += 1;
        }
        Self {
            kind,
            groups,
            levels: Vec::new(),
            records: 0,
            sums: BlockSums::new(LAG_COUNT * (1 + group_count)),
            group_sizes,
        }
    }

    /// Takes the vectors of one instant; instants follow one another at equal intervals.
    pub fn record(&mut self, vectors: &[DVec3]) {
        let width = 1 + self.group_sizes.len();
        let mut end = 0;
        let stretches = self.groups.chunk_by(|one, next| one == next);
        let stretches: Vec<(usize, Range<usize>)> = stretches
            .map(|alike| {
                let begin = end;
                end += alike.len();
                (usize::from(alike[0]), begin..end)
            })
            .collect();
        for level in 0..LEVELS {
            if self.records.trailing_zeros() < level as u32 && self.records > 0 {
                break;
            }
            if level == self.levels.len() {
                self.levels.push(Level::default());
            }
            let Level { ring, filled, next } = &mut self.levels[level];
            if ring.is_empty() {
                ring.resize(POINTS * vectors.len(), DVec3::ZERO);
            }
            ring[*next * vectors.len()..][..vectors.len()].copy_from_slice(vectors);
            *filled = (*filled + 1).min(POINTS);
            let first = if level == 0 { 0 } else { POINTS / 2 };
            for lag in first..*filled {
                let index = if level == 0 {
                    lag
                } else {
                    POINTS + (level - 1) * POINTS / 2 + lag - POINTS / 2
                };
                let earlier = &ring[(*next + POINTS - lag) % POINTS * vectors.len()..];
                let sums = &mut self.sums.open()[index * width..][..width];
                sums[0] += 1.0;
                for (group, range) in &stretches {
                    let (now, then) = (&vectors[range.clone()], &earlier[range.clone()]);
                    sums[1 + group] += match self.kind {
                        Kind::Displacement => sum(now, then, |a, b| (a - b).length_squared()),
                        Kind::Product => sum(now, then, DVec3::dot),
                    };
                }
            }
            *next = (*next + 1) % POINTS;
            // The first record stays on the first level: the others are made when they are needed.
            if self.records == 0 {
                break;
            }
        }
        self.records += 1;
        self.sums.close_record();
    }

    /// Forgets the past but not the sums: what follows is no continuation, as after a reversal.
    pub fn interrupt(&mut self) {
        self.levels.clear();
        self.records = 0;
    }

    /// The lags that have been seen, in records, and where they stand.
    pub fn lags(&self) -> Vec<(usize, f64)> {
        let total = self.sums.total();
        let width = 1 + self.group_sizes.len();
        (0..LAG_COUNT)
            .filter(|index| total[index * width] > 0.0)
            .map(|index| (index, lag(index)))
            .collect()
    }

    /// Records of the settled part of the run.
    pub fn records(&self) -> f64 {
        self.sums.total()[0]
    }

    /// The mean over a group at a lag, by where the lag stands.
    pub fn mean(&self, group: usize, index: usize) -> Estimate {
        self.sums.estimate(|sums| self.mean_of(sums, group, index))
    }

    /// The means over a group at several lags, by where these stand.
    pub fn means(&self, group: usize, indices: impl Iterator<Item = usize>) -> Vec<Estimate> {
        let summed = self.sums.summed();
        indices
            .map(|index| summed.estimate(|sums| self.mean_of(sums, group, index)))
            .collect()
    }

    /// Slope of a group's mean between two lags, per record.
    pub fn slope(&self, group: usize, [from, to]: [usize; 2]) -> Estimate {
        self.sums.estimate(|sums| {
            let rise = self.mean_of(sums, group, to)? - self.mean_of(sums, group, from)?;
            Some(rise / (lag(to) - lag(from)))
        })
    }

    /// Integral of a group's mean from lag 0 to a lag, in records (trapezoids).
    pub fn integral(&self, group: usize, to: usize) -> Estimate {
        self.sums.estimate(|sums| {
            (1..=to).try_fold(0.0, |integral, index| {
                let ends =
                    self.mean_of(sums, group, index)? + self.mean_of(sums, group, index - 1)?;
                Some(integral + 0.5 * ends * (lag(index) - lag(index - 1)))
            })
        })
    }

    fn mean_of(&self, sums: &[f64], group: usize, index: usize) -> Option<f64> {
        let row = &sums[index * (1 + self.group_sizes.len())..];
        (row[0] > 0.0).then(|| row[1 + group] / row[0] / f64::from(self.group_sizes[group]))
    }
}

/// Sum over pairs, in four sums side by side, so that none has to wait for the one before.
fn sum(now: &[DVec3], then: &[DVec3], of: impl Fn(DVec3, DVec3) -> f64) -> f64 {
    let (now_fours, now_rest) = now.as_chunks::<4>();
    let (then_fours, then_rest) = then.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (now, then) in now_fours.iter().zip(then_fours) {
        for lane in 0..4 {
            sums[lane] += of(now[lane], then[lane]);
        }
    }
    let rest = now_rest.iter().zip(then_rest).map(|(a, b)| of(*a, *b));
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest.sum::<f64>()
}

/// Lag by its place, in records.
fn lag(index: usize) -> f64 {
    if index < POINTS {
        return index as f64;
    }
    let level = 1 + (index - POINTS) / (POINTS / 2);
    let point = POINTS / 2 + (index - POINTS) % (POINTS / 2);
    point as f64 * (1_u64 << level) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_flight_has_the_square_of_its_length_at_every_lag() {
        let mut correlator = Correlator::new(Kind::Displacement, vec![0, 1], 2);
        for step in 0..5000 {
            let along = DVec3::X * f64::from(step);
            correlator.record(&[along, 2.0 * along]);
        }
        let lags = correlator.lags();
        assert!(lags.len() > 60 && lags.last().expect("lags").1 > 1500.0);
        for (index, lag) in lags {
            for (group, factor) in [(0, 1.0), (1, 4.0)] {
                let mean = correlator.mean(group, index).value.expect("seen");
                assert!(
                    (mean - factor * lag * lag).abs() < 1e-6 * (1.0 + mean),
                    "{lag}: {mean}"
                );
            }
        }
    }

    /// The slow twin: every pair of records at the same lag, of every `2^l`-th record.
    #[test]
    fn products_are_those_of_all_pairs_of_records() {
        let mut word = 7_u64;
        let mut record = || {
            word = word
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            DVec3::new((word >> 40) as f64 / 1e7 - 0.8, 0.3, 0.0)
        };
        let series: Vec<DVec3> = (0..40).map(|_| record()).collect();
        let mut correlator = Correlator::new(Kind::Product, vec![0], 1);
        for vector in &series {
            correlator.record(&[*vector]);
        }
        // Blocks of the settled part: what was recorded at all is what the sums of one block of a short run hold.
        let whole: Vec<f64> = correlator.sums.total();
        assert!(whole[0] > 30.0);
        let twin = |lag: usize, stride: usize, from: usize| -> f64 {
            // Levels above the first begin with the second record.
            let first = lag + usize::from(stride > 1);
            let ends = (from..40).filter(|end| end % stride == 0 && *end >= first);
            let pairs: Vec<f64> = ends.map(|end| series[end].dot(series[end - lag])).collect();
            pairs.iter().sum::<f64>() / pairs.len() as f64
        };
        let settled = 40 - whole[0] as usize;
        for (index, lag) in [(1, 1), (5, 5), (15, 15)] {
            let mean = correlator.mean(0, index).value.expect("seen");
            assert!((mean - twin(lag, 1, settled)).abs() < 1e-12, "{lag}");
        }
        let mean = correlator.mean(0, POINTS).value.expect("seen");
        assert!((mean - twin(16, 2, settled)).abs() < 1e-12);
    }

    #[test]
    fn an_interruption_correlates_nothing_across_it() {
        let mut correlator = Correlator::new(Kind::Displacement, vec![0], 1);
        for part in [0.0, 1e6] {
            correlator.interrupt();
            for step in 0..200 {
                correlator.record(&[DVec3::X * (part + f64::from(step))]);
            }
        }
        let mean = correlator.mean(0, 3).value.expect("seen");
        assert!((mean - 9.0).abs() < 1e-9, "{mean}");
    }
}
