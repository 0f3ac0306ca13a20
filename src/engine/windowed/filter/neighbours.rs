//! Which pieces of one cell are neighbours, and which of a ball's neighbours it may touch: the questions of windows in which every
//! ball knows its neighbours.

use pulp::{Simd, WithSimd};

use super::{Filter, Hits, lanes_of, pairs_that_pass, write_down};
use crate::engine::turn::SIDE;
use crate::engine::windowed::questions::{BallsTouch, Limits, Near};
use crate::engine::windowed::sheet::{Block, LANES, Row, Rows, Sheet};

impl Filter {
    /// Fills `sheet` with the flights of a cell and gives each pair of neighbours that are to be noted in it, the later row first;
    /// and for each whether they may touch in the window.
    ///
    /// Of all the cells in which two are listed they are noted in the lowest: the one that along each axis is the first for either
    /// of them. `firsts` are the least coordinates of those for which the cell is the first one.
    pub fn neighbours(
        &mut self,
        sheet: &mut Sheet,
        flights: impl Rows,
        firsts: [f32; 3],
    ) -> (&[(u32, u32)], &[bool]) {
        let count = self.machine.dispatch(FindNeighbours {
            sheet,
            flights,
            firsts,
            limits: &self.limits,
            hits: &mut self.hits,
            pairs: &mut self.pairs,
            touching: &mut self.touching,
        });
        (&self.pairs[..count], &self.touching[..count])
    }

    /// Which of some neighbours a ball may touch in the window, whose flight begins in it where it has met a `partner`: a bit for each.
    #[inline]
    pub fn touching(&self, row: &Row, partner: u32, others: &[Row; LANES]) -> u64 {
        self.machine.dispatch(Touching {
            row,
            partner,
            others,
            limits: &self.limits,
        })
    }
}

struct FindNeighbours<'a, P> {
    sheet: &'a mut Sheet,
    flights: P,
    firsts: [f32; 3],
    limits: &'a Limits,
    hits: &'a mut Vec<Hits>,
    pairs: &'a mut Vec<(u32, u32)>,
    touching: &'a mut Vec<bool>,
}

impl<P: Rows> WithSimd for FindNeighbours<'_, P> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let Self {
            sheet,
            flights,
            firsts,
            limits,
            hits,
            pairs,
            touching,
        } = self;
        sheet.fill(simd, &flights, flights.entries());
        sheet.mark(simd, firsts);
        let found = pairs_that_pass(simd, sheet, hits, &Near::new(simd, limits));
        let count = write_down(&hits[..found], pairs);
        if touching.len() < count + LANES {
            touching.resize(2 * count + LANES, false);
        }
        let rows = sheet.rows();
        let test = BallsTouch::new(simd, limits);
        let (mut ones, mut others) = (Block::default(), Block::default());
        for first in (0..count).step_by(LANES) {
            let some = &pairs[first..count.next_multiple_of(SIDE).min(first + LANES)];
            for (part, pairs) in some.as_chunks::<SIDE>().0.iter().enumerate() {
                ones.turn(simd, part, &pairs.map(|(row, _)| rows[row as usize]));
                others.turn(simd, part, &pairs.map(|(_, row)| rows[row as usize]));
            }
            let mut touch = 0;
            for vector in 0..some.len().div_ceil(S::F32_LANES) {
                let [one, other] = [&ones, &others].map(|block| block.columns(simd, vector));
                touch |= lanes_of(simd, test.at_first(simd, one, other)) << (vector * S::F32_LANES);
            }
            for (lane, touching) in touching[first..][..LANES].iter_mut().enumerate() {
                *touching = touch >> lane & 1 == 1;
            }
        }
        count
    }
}

struct Touching<'a> {
    row: &'a Row,
    partner: u32,
    others: &'a [Row; LANES],
    limits: &'a Limits,
}

impl WithSimd for Touching<'_> {
    type Output = u64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> u64 {
        let test = BallsTouch::<S>::new(simd, self.limits);
        let mut block = Block::default();
        for (part, rows) in self.others.as_chunks::<SIDE>().0.iter().enumerate() {
            block.turn(simd, part, rows);
        }
        let mut touching = 0;
        for vector in 0..LANES / S::F32_LANES {
            let columns = block.columns(simd, vector);
            let lanes = lanes_of(simd, test.passes(simd, self.row, self.partner, columns));
            touching |= lanes << (vector * S::F32_LANES);
        }
        touching
    }
}
