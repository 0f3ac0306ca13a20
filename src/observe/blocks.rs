//! Rates and their standard errors from averages over blocks of time.
//!
//! The run is cut into at most [`MOST_BLOCKS`] blocks of equal length; when there would be more, neighbours merge and the length
//! doubles. So a run of any length costs the same memory, and blocks grow longer than any correlation.
//!
//! Source: Flyvbjerg & Petersen, J. Chem. Phys. 91, 461 (1989), for errors from merged blocks.

use serde::{Deserialize, Serialize};

use crate::engine::Sums;
use crate::event::{Collision, Participants};
use crate::state::Time;

/// Most blocks kept; there are at least half as many once the run is longer than that.
pub const MOST_BLOCKS: usize = 128;

/// Length of the first blocks \[epochs\].
const FIRST_LENGTH: f64 = 1.0 / 64.0;

/// Share of the run, from its start, that averages leave out.
const UNSETTLED_SHARE: f64 = 0.1;

/// Fewest complete blocks that a standard error is computed from.
const FEWEST_BLOCKS: usize = 8;

/// What happened in a block of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Block {
    /// Momentum given to the walls, perpendicular to them.
    pub wall_impulse: f64,
    /// `sum of r . dp` over the pair collisions.
    pub pair_virial: f64,
    /// Pair collisions.
    pub pair_collisions: u64,
    /// Wall collisions.
    pub wall_collisions: u64,
}

impl Block {
    fn add(&mut self, other: &Self) {
        self.wall_impulse += other.wall_impulse;
        self.pair_virial += other.pair_virial;
        self.pair_collisions += other.pair_collisions;
        self.wall_collisions += other.wall_collisions;
    }
}

/// Averages over the settled part of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Averages {
    /// What happened in the settled part.
    pub settled: Block,
    /// Length of the settled part \[epochs\].
    pub duration: f64,
    /// Standard error of `settled.wall_impulse / duration`, from at least eight complete blocks.
    pub wall_error: Option<f64>,
    /// Standard error of `settled.pair_virial / duration`, likewise.
    pub virial_error: Option<f64>,
}

/// Blocks of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Blocks {
    length: f64,
    blocks: Vec<Block>,
}

impl Default for Blocks {
    fn default() -> Self {
        Self {
            length: FIRST_LENGTH,
            blocks: Vec::with_capacity(MOST_BLOCKS),
        }
    }
}

impl Blocks {
    /// Takes a collision into account.
    #[inline]
    pub fn record(&mut self, collision: &Collision) {
        match collision.participants {
            Participants::Pair(..) => {
                let block = self.block_at(collision.time);
                block.pair_collisions += 1;
                block.pair_virial += collision.virial;
            }
            Participants::Wall(..) => {
                let block = self.block_at(collision.time);
                block.wall_collisions += 1;
                block.wall_impulse += collision.impulse.length();
            }
            Participants::Plane(..) | Participants::Face(..) => {}
        }
    }

    /// Takes sums into account, spread evenly over their stretch of time.
    pub fn record_sums(&mut self, sums: &Sums) {
        let (begin, end) = (sums.begin.relative_to(0), sums.end.relative_to(0));
        self.block_at(sums.end); // so that the length is what it will stay
        let mut done = Sums {
            end: sums.begin,
            ..Sums::default()
        };
        let mut from = begin;
        while from < end {
            let index = (from / self.length) as usize;
            let next = (index + 1) as f64 * self.length;
            let until = if next < end { next } else { end };
            let so_far = if until < end {
                sums.share((until - begin) / (end - begin))
            } else {
                *sums
            };
            let part = so_far.since(&done);
            self.blocks[index].add(&Block {
                wall_impulse: part.wall_impulse,
                pair_virial: part.pair_virial,
                pair_collisions: part.pair_collisions,
                wall_collisions: part.wall_collisions,
            });
            (from, done) = (until, so_far);
        }
    }

    #[inline]
    fn block_at(&mut self, time: Time) -> &mut Block {
        let elapsed = time.relative_to(0);
        while elapsed / self.length >= MOST_BLOCKS as f64 {
            self.merge();
        }
        let index = (elapsed / self.length) as usize;
        if index >= self.blocks.len() {
            self.blocks.resize(index + 1, Block::default());
        }
        &mut self.blocks[index]
    }

    fn merge(&mut self) {
        let count = self.blocks.len().div_ceil(2);
        for index in 0..count {
            let mut sum = self.blocks[2 * index];
            if let Some(next) = self.blocks.get(2 * index + 1) {
                sum.add(next);
            }
            self.blocks[index] = sum;
        }
        self.blocks.truncate(count);
        self.length *= 2.0;
    }

    /// Averages at `now`, leaving out the first tenth of the run; `None` before any time has passed.
    pub fn averages(&self, now: Time) -> Option<Averages> {
        let elapsed = now.relative_to(0);
        let unsettled = (UNSETTLED_SHARE * elapsed / self.length).round() as usize;
        let duration = elapsed - unsettled as f64 * self.length;
        if duration <= 0.0 {
            return None;
        }
        let block = |index: usize| self.blocks.get(index).copied().unwrap_or_default();
        let mut settled = Block::default();
        (unsettled..self.blocks.len()).for_each(|index| settled.add(&self.blocks[index]));
        let complete = (elapsed / self.length) as usize;
        let count = complete.saturating_sub(unsettled);
        let error = |amount: fn(&Block) -> f64| {
            let rate = |index: usize| amount(&block(index)) / self.length;
            let mean = (unsettled..complete).map(rate).sum::<f64>() / count as f64;
            let squares: f64 = (unsettled..complete)
                .map(|index| (rate(index) - mean) * (rate(index) - mean))
                .sum();
            (count >= FEWEST_BLOCKS).then(|| (squares / (count * (count - 1)) as f64).sqrt())
        };
        let wall_error = error(|block| block.wall_impulse);
        let virial_error = error(|block| block.pair_virial);
        Some(Averages {
            settled,
            duration,
            wall_error,
            virial_error,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Wall;
    use glam::DVec3;

    fn hit(elapsed: f64, impulse: f64) -> Collision {
        Collision {
            time: Time::default().after(elapsed).expect("near"),
            participants: Participants::Wall(
                0,
                Wall {
                    axis: 0,
                    upper: true,
                },
            ),
            impulse: DVec3::X * -impulse,
            external: DVec3::ZERO,
            virial: 0.0,
            radial_jump: 0.0,
            gap: 0.0,
        }
    }

    #[test]
    fn a_steady_rate_is_found_in_constant_memory_with_no_error() {
        let mut blocks = Blocks::default();
        for tick in 0..4096 * 16 {
            blocks.record(&hit((f64::from(tick) + 0.5) / 256.0, 2.0));
        }
        assert!(blocks.blocks.len() <= MOST_BLOCKS);
        let averages = blocks
            .averages(Time {
                epoch: 256,
                local: 0.0,
            })
            .expect("time has passed");
        assert_eq!(averages.settled.wall_impulse / averages.duration, 512.0);
        assert_eq!(averages.wall_error, Some(0.0));
        assert!((averages.duration - 230.4).abs() < 4.0);
    }

    #[test]
    fn sums_are_spread_over_the_blocks_that_they_last() {
        let instant = |time: f64| Time::default().after(time).expect("near");
        let sums = Sums {
            begin: instant(0.5 * FIRST_LENGTH),
            end: instant(2.5 * FIRST_LENGTH),
            pair_collisions: 10,
            wall_collisions: 3,
            pair_virial: 8.0,
            wall_impulse: 4.0,
        };
        let mut blocks = Blocks::default();
        blocks.record_sums(&sums);
        let impulses: Vec<f64> = blocks
            .blocks
            .iter()
            .map(|block| block.wall_impulse)
            .collect();
        assert_eq!(impulses, [1.0, 2.0, 1.0]);
        let pairs: Vec<u64> = blocks
            .blocks
            .iter()
            .map(|block| block.pair_collisions)
            .collect();
        assert_eq!(pairs, [2, 5, 3]);
        let walls: u64 = blocks
            .blocks
            .iter()
            .map(|block| block.wall_collisions)
            .sum();
        assert_eq!(walls, 3);
    }

    #[test]
    fn the_unsettled_start_is_left_out() {
        let mut blocks = Blocks::default();
        blocks.record(&hit(0.01, 1e6));
        for tick in 0..1000 {
            blocks.record(&hit(1.0 + f64::from(tick) / 100.0, 1.0));
        }
        let averages = blocks
            .averages(Time {
                epoch: 11,
                local: 0.0,
            })
            .expect("time has passed");
        assert!((averages.settled.wall_impulse / averages.duration - 100.0).abs() < 2.0);
    }

    #[test]
    fn the_error_of_random_hits_is_that_of_their_number() {
        // A fixed pseudo-random pattern of hits with probability 1/2 per slot of 1/256 epoch.
        let mut blocks = Blocks::default();
        let mut word = 1_u64;
        for tick in 0..65_536 {
            word = word
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            if word >> 63 == 1 {
                blocks.record(&hit((f64::from(tick) + 0.5) / 256.0, 1.0));
            }
        }
        let averages = blocks
            .averages(Time {
                epoch: 256,
                local: 0.0,
            })
            .expect("time has passed");
        let slots = 256.0 * averages.duration;
        let expected = (slots * 0.25).sqrt() / averages.duration;
        let error = averages.wall_error.expect("many blocks");
        assert!((error / expected - 1.0).abs() < 0.25, "{error} {expected}");
    }
}
