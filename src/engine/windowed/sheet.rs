//! The pieces that pass a cell, as the filter reads them: by rows, and as columns that it takes many at a time.

use pulp::Simd;

use super::pieces::Line;
use crate::engine::turn::{SIDE, turn};

/// Rows of a block: a multiple of the widest vectors.
pub const LANES: usize = 16;

/// A coordinate that nothing comes near to, whose square still is a number.
const FAR: f32 = 1e15;

/// A piece in a cell: as a [`Line`], with its position relative to the cell's centre.
pub type Row = Line;

/// The pieces of a cell.
pub trait Rows {
    /// How many there are.
    fn count(&self) -> usize;

    /// One of them.
    fn row(&self, number: usize) -> Row;
}

/// What stands for no piece.
const NOBODY: Row = Row {
    position: [FAR; 3],
    velocity: [0.0; 3],
    ball: 0,
    link: 0,
};

/// The columns of some rows: `x, y, z` and the velocity's `x, y, z`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct Block([[f32; LANES]; 6]);

impl Block {
    /// Fills it from rows.
    #[inline(always)]
    pub fn turn<S: Simd>(&mut self, simd: S, rows: [&Row; LANES]) {
        for (number, rows) in rows.as_chunks::<SIDE>().0.iter().enumerate() {
            let columns = turn(simd, rows.map(numbers));
            for (column, values) in self.0.iter_mut().zip(columns) {
                column[number * SIDE..][..SIDE].copy_from_slice(&values);
            }
        }
    }

    /// A vector of each column: the positions' and the velocities'.
    #[inline(always)]
    pub fn vectors<S: Simd>(&self, _simd: S, vector: usize) -> [[S::f32s; 3]; 2] {
        let [x, y, z, u, v, w] = &self.0;
        [
            [
                S::as_simd_f32s(x).0[vector],
                S::as_simd_f32s(y).0[vector],
                S::as_simd_f32s(z).0[vector],
            ],
            [
                S::as_simd_f32s(u).0[vector],
                S::as_simd_f32s(v).0[vector],
                S::as_simd_f32s(w).0[vector],
            ],
        ]
    }
}

/// A row's numbers, side by side.
#[inline(always)]
fn numbers(row: &Row) -> [f32; SIDE] {
    let ([x, y, z], [u, v, w]) = (row.position, row.velocity);
    let [ball, link] = [f32::from_bits(row.ball), f32::from_bits(row.link)];
    [x, y, z, u, v, w, ball, link]
}

/// The pieces of a cell, in the order of its list.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    /// The rows, and then what fills up the last block.
    rows: Vec<Row>,
    /// Rows in use.
    count: usize,
    blocks: Vec<Block>,
}

impl Sheet {
    /// Empties it.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// The rows.
    #[inline(always)]
    pub fn rows(&self) -> &[Row] {
        &self.rows[..self.count]
    }

    /// The rows' columns, padded with rows that meet nothing.
    #[inline(always)]
    pub fn blocks(&self) -> &[Block] {
        &self.blocks[..self.count.div_ceil(LANES)]
    }

    /// Adds those pieces of a cell that are not in it yet.
    #[inline(always)]
    pub fn fill<S: Simd>(&mut self, simd: S, pieces: &impl Rows) {
        let count = pieces.count();
        let padded = count.next_multiple_of(LANES);
        if padded > self.rows.len() {
            self.rows.resize(padded, NOBODY);
            self.blocks.resize(padded / LANES, Block::default());
        }
        let first = self.count;
        self.count = count;
        let (rows, nobody) = self.rows[..padded].split_at_mut(count);
        for (number, row) in rows.iter_mut().enumerate().skip(first) {
            *row = pieces.row(number);
        }
        nobody.fill(NOBODY);
        let block = first / LANES;
        let rows = self.rows[block * LANES..padded].as_chunks::<LANES>().0;
        for (block, rows) in self.blocks[block..].iter_mut().zip(rows) {
            block.turn(simd, rows.each_ref());
        }
    }
}

#[cfg(test)]
mod tests {
    use pulp::{Arch, Scalar, WithSimd};

    use super::*;

    struct Fill<'a>(&'a mut Sheet, Numbers);

    /// Rows that hold numbers.
    #[derive(Clone, Copy)]
    struct Numbers(usize);

    impl Rows for Numbers {
        fn count(&self) -> usize {
            self.0
        }

        fn row(&self, number: usize) -> Row {
            let value = |column: usize| (10 * number + column) as f32;
            Row {
                position: std::array::from_fn(value),
                velocity: std::array::from_fn(|axis| value(3 + axis)),
                ball: number as u32,
                link: 7,
            }
        }
    }

    impl WithSimd for Fill<'_> {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            self.0.fill(simd, &self.1);
        }
    }

    #[test]
    fn columns_hold_the_rows_and_then_nobody() {
        let counts = [3, 8, 21, 40, 41, 5];
        let (mut fast, mut plain) = (Sheet::default(), Sheet::default());
        for (last, count) in std::iter::once(0).chain(counts).zip(counts) {
            if count < last {
                fast.clear();
                plain.clear();
            }
            Arch::new().dispatch(Fill(&mut fast, Numbers(count)));
            Fill(&mut plain, Numbers(count)).with_simd(Scalar::new());
            for sheet in [&fast, &plain] {
                assert_eq!(sheet.rows().len(), count);
                for (place, block) in sheet.blocks().iter().enumerate() {
                    for (column, values) in block.0.iter().enumerate() {
                        for (lane, &value) in values.iter().enumerate() {
                            let number = place * LANES + lane;
                            let expected = match (number < count, column) {
                                (true, _) => (10 * number + column) as f32,
                                (false, 0..3) => FAR,
                                (false, _) => 0.0,
                            };
                            assert_eq!(value, expected);
                        }
                    }
                }
            }
        }
    }
}
