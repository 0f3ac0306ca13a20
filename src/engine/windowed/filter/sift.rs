//! The second question: which pairs of pieces, whose lines touch, can meet in their cells in the window.
//!
//! There are a few of them in each cell, so they are gathered from many cells and asked together.

use pulp::{Simd, WithSimd};

use super::{Filter, lanes_of};
use crate::engine::turn::SIDE;
use crate::engine::windowed::grid::Entry;
use crate::engine::windowed::questions::{Limits, cannot_meet_here};
use crate::engine::windowed::sheet::{Block, LANES, PARTS, Row};

/// Two pieces that may meet in a cell.
#[derive(Clone, Copy, Debug)]
pub struct Doubt {
    /// The pieces, the later row first.
    pub rows: [Row; 2],
    /// Their entries in the cell's list.
    pub entries: [Entry; 2],
    /// The cell.
    pub cell: u32,
    /// Its middle.
    pub middle: [f32; 3],
}

impl Doubt {
    /// Their balls.
    #[inline(always)]
    pub fn balls(&self) -> [u32; 2] {
        self.rows.map(|row| row.ball())
    }
}

impl Filter {
    /// How many pairs are to be sifted.
    #[inline]
    pub fn doubts(&self) -> usize {
        self.doubts.len()
    }

    /// Gives those of the pairs in doubt that can meet in their cells in the window, and forgets all.
    #[inline]
    pub fn sift(&mut self, mut keep: impl FnMut(&Doubt)) {
        for doubts in self.doubts.chunks(LANES) {
            let mut can_meet = self.machine.dispatch(Sift {
                doubts,
                limits: &self.limits,
            });
            while can_meet != 0 {
                keep(&doubts[can_meet.trailing_zeros() as usize]);
                can_meet &= can_meet - 1;
            }
        }
        self.doubts.empty();
    }
}

/// Which of some pairs, no more than [`LANES`], can meet: a bit for each.
pub struct Sift<'a> {
    /// The pairs.
    pub doubts: &'a [Doubt],
    pub limits: &'a Limits,
}

impl WithSimd for Sift<'_> {
    type Output = u64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> u64 {
        let Self { doubts, limits } = self;
        let (mut ones, mut others) = (Block::default(), Block::default());
        let mut middles = [[0.0; LANES]; 3];
        for (lane, doubt) in doubts.iter().enumerate().take(LANES) {
            for (middles, middle) in middles.iter_mut().zip(doubt.middle) {
                middles[lane] = middle;
            }
        }
        for part in 0..doubts.len().div_ceil(SIDE).min(PARTS) {
            let pair = |lane: usize| &doubts[(part * SIDE + lane).min(doubts.len() - 1)].rows;
            ones.turn(simd, part, &std::array::from_fn(|lane| pair(lane)[0]));
            others.turn(simd, part, &std::array::from_fn(|lane| pair(lane)[1]));
        }
        let mut miss = 0;
        for vector in 0..doubts.len().div_ceil(S::F32_LANES) {
            let [one, other] = [&ones, &others].map(|block| block.columns(simd, vector));
            let middle = middles
                .each_ref()
                .map(|middles| S::as_simd_f32s(middles).0[vector]);
            let cannot = cannot_meet_here(simd, one, other, middle, limits);
            miss |= lanes_of(simd, cannot) << (vector * S::F32_LANES);
        }
        !miss & ((1 << doubts.len()) - 1)
    }
}
