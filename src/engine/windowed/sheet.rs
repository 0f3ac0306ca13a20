//! The pieces that pass a cell, as the filter reads them: by rows, and as columns that it takes many at a time.

#[cfg(target_arch = "x86_64")]
use std::{any::Any, arch::x86_64::__m256};

use pulp::Simd;
#[cfg(target_arch = "x86_64")]
use pulp::{cast, x86::V3};

use super::pieces::Line;

/// Rows of a block: a multiple of the widest vectors.
pub const LANES: usize = 16;

/// Rows that are turned into columns at once.
const TURNED: usize = 8;

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
        let (first, second) = rows.split_at(TURNED);
        self.turn_half(simd, 0, first.try_into().expect("a half"));
        self.turn_half(simd, TURNED, second.try_into().expect("a half"));
    }

    #[inline(always)]
    fn turn_half<S: Simd>(&mut self, simd: S, first: usize, rows: [&Row; TURNED]) {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = as_v3(simd) {
            for (column, values) in self.0.iter_mut().zip(turn_wide(simd, rows)) {
                column[first..first + TURNED]
                    .copy_from_slice(&cast::<__m256, [f32; TURNED]>(values));
            }
            return;
        }
        for (row, lane) in rows.into_iter().zip(first..) {
            for axis in 0..3 {
                self.0[axis][lane] = row.position[axis];
                self.0[3 + axis][lane] = row.velocity[axis];
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

/// The machine, if its vectors are of eight; known when this is compiled.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn as_v3<S: Simd>(simd: S) -> Option<V3> {
    (&simd as &dyn Any).downcast_ref::<V3>().copied()
}

/// The columns of rows: by pairs of rows, then by fours, then all eight.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn turn_wide(V3 { avx, .. }: V3, rows: [&Row; TURNED]) -> [__m256; 6] {
    const FIRST: i32 = 0b01_00_01_00;
    const SECOND: i32 = 0b11_10_11_10;
    const LOWER: i32 = 0x20;
    const UPPER: i32 = 0x31;
    let [a, b, c, d, e, f, g, h] = rows;
    let [a, b, c, d] = [wide(a), wide(b), wide(c), wide(d)];
    let [e, f, g, h] = [wide(e), wide(f), wide(g), wide(h)];
    let low = [
        avx._mm256_unpacklo_ps(a, b),
        avx._mm256_unpacklo_ps(c, d),
        avx._mm256_unpacklo_ps(e, f),
        avx._mm256_unpacklo_ps(g, h),
    ];
    let high = [
        avx._mm256_unpackhi_ps(a, b),
        avx._mm256_unpackhi_ps(c, d),
        avx._mm256_unpackhi_ps(e, f),
        avx._mm256_unpackhi_ps(g, h),
    ];
    // Each with what it has of a column and of the fourth one after it.
    let x = [
        avx._mm256_shuffle_ps::<FIRST>(low[0], low[1]),
        avx._mm256_shuffle_ps::<FIRST>(low[2], low[3]),
    ];
    let y = [
        avx._mm256_shuffle_ps::<SECOND>(low[0], low[1]),
        avx._mm256_shuffle_ps::<SECOND>(low[2], low[3]),
    ];
    let z = [
        avx._mm256_shuffle_ps::<FIRST>(high[0], high[1]),
        avx._mm256_shuffle_ps::<FIRST>(high[2], high[3]),
    ];
    let u = [
        avx._mm256_shuffle_ps::<SECOND>(high[0], high[1]),
        avx._mm256_shuffle_ps::<SECOND>(high[2], high[3]),
    ];
    [
        avx._mm256_permute2f128_ps::<LOWER>(x[0], x[1]),
        avx._mm256_permute2f128_ps::<LOWER>(y[0], y[1]),
        avx._mm256_permute2f128_ps::<LOWER>(z[0], z[1]),
        avx._mm256_permute2f128_ps::<LOWER>(u[0], u[1]),
        avx._mm256_permute2f128_ps::<UPPER>(x[0], x[1]),
        avx._mm256_permute2f128_ps::<UPPER>(y[0], y[1]),
    ]
}

/// A row as a vector.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn wide(row: &Row) -> __m256 {
    let ([x, y, z], [u, v, w]) = (row.position, row.velocity);
    let [ball, link] = [f32::from_bits(row.ball), f32::from_bits(row.link)];
    cast([x, y, z, u, v, w, ball, link])
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
