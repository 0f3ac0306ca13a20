//! Sums over blocks of a run, from which any quantity made of sums has a mean and a standard error.
//!
//! The run is cut into at most `MOST_BLOCKS` blocks of equally many records; when there would be more, neighbours merge. So a
//! run of any length costs the same memory, and blocks grow longer than any correlation.
//!
//! Source: Flyvbjerg & Petersen, J. Chem. Phys. 91, 461 (1989), for errors from merged blocks.

use serde::{Deserialize, Serialize};

/// Most blocks kept; there are at least half as many once the run is long.
const MOST_BLOCKS: usize = 32;

/// Fewest complete blocks that a standard error is computed from.
const FEWEST_BLOCKS: usize = 8;

/// Share of the run, from its start, that averages leave out.
const UNSETTLED_SHARE: f64 = 0.1;

/// A mean and its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The mean; `None` before anything was recorded.
    pub value: Option<f64>,
    /// Its standard error; `None` before there are eight complete blocks.
    pub error: Option<f64>,
}

impl Estimate {
    /// The same in a unit that is `1 / factor` of this one's.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self {
            value: self.value.map(|value| value * factor),
            error: self.error.map(|error| error * factor.abs()),
        }
    }
}

/// Sums of several values over blocks of records.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BlockSums {
    width: usize,
    records_per_block: u64,
    /// Records in the last block.
    records: u64,
    /// One row of `width` sums per block, the last one perhaps incomplete.
    sums: Vec<f64>,
}

impl BlockSums {
    /// No records yet, of `width` values each.
    pub fn new(width: usize) -> Self {
        Self {
            width,
            records_per_block: 1,
            records: 0,
            sums: vec![0.0; width],
        }
    }

    /// The sums of the block that is being filled: add a record's values here, then call [`Self::close_record`].
    pub fn open(&mut self) -> &mut [f64] {
        let begin = self.sums.len() - self.width;
        &mut self.sums[begin..]
    }

    /// Ends a record.
    pub fn close_record(&mut self) {
        self.records += 1;
        if self.records < self.records_per_block {
            return;
        }
        if self.sums.len() == MOST_BLOCKS * self.width {
            self.merge();
        }
        if self.records == self.records_per_block {
            self.sums.resize(self.sums.len() + self.width, 0.0);
            self.records = 0;
        }
    }

    fn merge(&mut self) {
        for block in 0..MOST_BLOCKS / 2 {
            for value in 0..self.width {
                let first = 2 * block * self.width + value;
                self.sums[block * self.width + value] =
                    self.sums[first] + self.sums[first + self.width];
            }
        }
        self.sums.truncate(MOST_BLOCKS / 2 * self.width);
        self.records_per_block *= 2;
        self.records = self.records_per_block;
    }

    /// Blocks of the settled part of the run; the flag says whether a block is complete.
    fn settled(&self) -> impl Iterator<Item = (&[f64], bool)> {
        let blocks = self.sums.len() / self.width;
        let unsettled = (UNSETTLED_SHARE * blocks as f64).round() as usize;
        self.sums
            .chunks_exact(self.width)
            .enumerate()
            .skip(unsettled)
            .map(move |(index, sums)| (sums, index + 1 < blocks))
    }

    /// Sums over the settled part of the run.
    pub fn total(&self) -> Vec<f64> {
        let mut total = vec![0.0; self.width];
        for (sums, _) in self.settled() {
            for (total, sum) in total.iter_mut().zip(sums) {
                *total += sum;
            }
        }
        total
    }

    /// A quantity made of sums, over the settled part of the run; its error from how it differs between blocks.
    pub fn estimate(&self, quantity: impl Fn(&[f64]) -> Option<f64>) -> Estimate {
        self.summed().estimate(quantity)
    }

    /// The sums for several quantities.
    pub fn summed(&self) -> Summed<'_> {
        let complete = self.settled().filter(|(_, complete)| *complete);
        Summed {
            total: self.total(),
            blocks: complete.map(|(sums, _)| sums).collect(),
        }
    }
}

/// The settled part of a run, summed up once for several quantities.
pub struct Summed<'s> {
    total: Vec<f64>,
    /// The complete blocks.
    blocks: Vec<&'s [f64]>,
}

impl Summed<'_> {
    /// As [`BlockSums::estimate`].
    pub fn estimate(&self, quantity: impl Fn(&[f64]) -> Option<f64>) -> Estimate {
        let blocks = self.blocks.iter();
        let values: Vec<f64> = blocks.filter_map(|sums| quantity(sums)).collect();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values
            .iter()
            .map(|value| (value - mean) * (value - mean))
            .sum();
        Estimate {
            value: quantity(&self.total).filter(|value| value.is_finite()),
            error: (values.len() >= FEWEST_BLOCKS)
                .then(|| (squares / (count * (count - 1.0))).sqrt())
                .filter(|error| error.is_finite()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_has_the_error_of_its_spread_in_constant_memory() {
        let mut sums = BlockSums::new(2);
        let mut word = 1_u64;
        for _ in 0..100_000 {
            word = word
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let open = sums.open();
            open[0] += (word >> 63) as f64;
            open[1] += 1.0;
            sums.close_record();
        }
        assert!(sums.sums.len() <= 2 * MOST_BLOCKS);
        let mean = sums.estimate(|sums| (sums[1] > 0.0).then(|| sums[0] / sums[1]));
        let expected = 0.5 / 90_000_f64.sqrt();
        let (value, error) = (mean.value.expect("records"), mean.error.expect("blocks"));
        assert!((value - 0.5).abs() < 4.0 * expected, "{value}");
        assert!((error / expected - 1.0).abs() < 0.5, "{error} {expected}");
        let total = sums.total();
        assert!((total[1] - 90_000.0).abs() < 5000.0, "{}", total[1]);
    }
}
