//! The pieces that pass a cell, as the filter reads them: by rows, and as columns that it takes many at a time.

use pulp::{Simd, bytemuck};

use super::grid::Entry;
use super::pieces::Line;
#[cfg(doc)]
use super::pieces::NONE;
use crate::engine::turn::{SIDE, turn};

/// Rows of a block: a multiple of the widest vectors.
pub const LANES: usize = 16;

/// Parts of a block that are turned one by one.
pub const PARTS: usize = LANES / SIDE;

/// The column of begins, or of marks.
const MARK: usize = 7;

/// A piece in a cell, at the image that is there.
pub type Row = Line;

/// The pieces of a cell.
pub trait Rows {
    /// The cell's list.
    fn entries(&self) -> &[Entry];

    /// A piece of the list.
    fn row(&self, entry: Entry) -> Row;

    /// The ball at whose meeting with the piece's own the piece began, or [`NONE`].
    fn partner(&self, entry: Entry) -> u32;
}

impl Row {
    /// What stands for no piece: no comparison with what is no number holds.
    pub const NOBODY: Self = Line([f32::NAN, f32::NAN, f32::NAN, 0.0, 0.0, 0.0, 0.0, 0.0]);
}

/// The columns of some rows, as those are.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct Block([[f32; LANES]; SIDE]);

/// What stands for no pieces.
const NOBODIES: Block = {
    let mut columns = [[0.0; LANES]; SIDE];
    let mut column = 0;
    while column < SIDE {
        columns[column] = [Row::NOBODY.0[column]; LANES];
        column += 1;
    }
    Block(columns)
};

/// A vector of each column.
#[derive(Clone, Copy)]
pub struct Columns<S: Simd> {
    pub position: [S::f32s; 3],
    pub velocity: [S::f32s; 3],
    pub ball: S::u32s,
    /// Of a flight no number, or as good as zero; or its marks, by their bits.
    pub begin: S::f32s,
}

impl<S: Simd> Columns<S> {
    /// The same row in all lanes.
    #[inline(always)]
    pub fn all_like(simd: S, row: &Row) -> Self {
        let Line([x, y, z, u, v, w, _, mark]) = *row;
        Self {
            position: [simd.splat_f32s(x), simd.splat_f32s(y), simd.splat_f32s(z)],
            velocity: [simd.splat_f32s(u), simd.splat_f32s(v), simd.splat_f32s(w)],
            ball: simd.splat_u32s(row.ball()),
            begin: simd.splat_f32s(mark),
        }
    }

    /// Each row so many lanes further on, the last ones in the first lanes.
    #[inline(always)]
    pub fn rotated(self, simd: S, by: usize) -> Self {
        let ([x, y, z], [u, v, w]) = (self.position, self.velocity);
        Self {
            position: [
                simd.rotate_right_f32s(x, by),
                simd.rotate_right_f32s(y, by),
                simd.rotate_right_f32s(z, by),
            ],
            velocity: [
                simd.rotate_right_f32s(u, by),
                simd.rotate_right_f32s(v, by),
                simd.rotate_right_f32s(w, by),
            ],
            ball: simd.rotate_right_u32s(self.ball, by),
            begin: simd.rotate_right_f32s(self.begin, by),
        }
    }
}

/// All that a row may be marked with.
pub const ALL_MARKS: u32 = 0b111;

impl Block {
    /// Fills one of its parts from rows.
    #[inline(always)]
    pub fn turn<S: Simd>(&mut self, simd: S, part: usize, rows: &[Row; SIDE]) {
        let [a, b, c, d, e, f, g, h] = rows;
        let columns = turn(simd, [a.0, b.0, c.0, d.0, e.0, f.0, g.0, h.0]);
        for (column, values) in self.0.iter_mut().zip(columns) {
            column[part * SIDE..][..SIDE].copy_from_slice(&values);
        }
    }

    /// Fills one of its lanes.
    #[inline(always)]
    fn set(&mut self, lane: usize, row: &Row) {
        for (column, value) in self.0.iter_mut().zip(row.0) {
            column[lane] = value;
        }
    }

    /// Vectors of its columns.
    #[inline(always)]
    pub fn columns<S: Simd>(&self, _simd: S, vector: usize) -> Columns<S> {
        let column = |column: usize| S::as_simd_f32s(&self.0[column]).0[vector];
        let balls: &[u32; LANES] = bytemuck::cast_ref(&self.0[6]);
        Columns {
            position: [column(0), column(1), column(2)],
            velocity: [column(3), column(4), column(5)],
            ball: S::as_simd_u32s(balls).0[vector],
            begin: column(MARK),
        }
    }
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

    /// Makes it that of some entries of a cell's list.
    #[inline(always)]
    pub fn fill<S: Simd>(&mut self, simd: S, pieces: &impl Rows, entries: &[Entry]) {
        let padded = entries.len().next_multiple_of(LANES);
        if padded > self.rows.len() {
            self.rows.resize(padded, Row::NOBODY);
            self.blocks.resize(padded / LANES, Block::default());
        }
        self.count = entries.len();
        let (rows, nobody) = self.rows[..padded].split_at_mut(entries.len());
        for (row, &entry) in rows.iter_mut().zip(entries) {
            *row = pieces.row(entry);
        }
        nobody.fill(Row::NOBODY);
        let rows = self.rows[..padded].as_chunks::<SIDE>().0;
        for (number, rows) in rows.iter().enumerate() {
            let block = &mut self.blocks[number / PARTS];
            block.turn(simd, number % PARTS, rows);
        }
    }

    /// Notes of each row along which axes its coordinate is no less than that of `firsts`, `x` in the lowest bit: in place of its
    /// begin.
    #[inline(always)]
    pub fn mark<S: Simd>(&mut self, simd: S, firsts: [f32; 3]) {
        let blocks = &mut self.blocks[..self.count.div_ceil(LANES)];
        for (block, rows) in blocks.iter_mut().zip(self.rows.chunks_mut(LANES)) {
            for vector in 0..LANES / S::F32_LANES {
                let mut marks = simd.splat_u32s(0);
                for (axis, first) in firsts.into_iter().enumerate() {
                    let place = S::as_simd_f32s(&block.0[axis]).0[vector];
                    let is_first = simd.greater_than_or_equal_f32s(place, simd.splat_f32s(first));
                    let mark =
                        simd.select_u32s(is_first, simd.splat_u32s(1 << axis), simd.splat_u32s(0));
                    marks = simd.or_u32s(marks, mark);
                }
                let marks = simd.transmute_f32s_u32s(marks);
                S::as_mut_simd_f32s(&mut block.0[MARK]).0[vector] = marks;
            }
            for (row, &mark) in rows.iter_mut().zip(&block.0[MARK]) {
                row.0[MARK] = mark;
            }
        }
    }

    /// Adds a row.
    #[inline(always)]
    pub fn push(&mut self, row: Row) {
        let (block, lane) = (self.count / LANES, self.count % LANES);
        if lane == 0 {
            let padded = self.count + LANES;
            if padded > self.rows.len() {
                self.rows.resize(padded, Row::NOBODY);
                self.blocks.resize(padded / LANES, Block::default());
            }
            self.blocks[block] = NOBODIES;
        }
        self.rows[self.count] = row;
        self.blocks[block].set(lane, &row);
        self.count += 1;
    }
}

#[cfg(test)]
mod tests {
    use pulp::{Arch, Scalar, WithSimd};

    use super::*;

    struct Fill<'a>(&'a mut Sheet, Numbers);

    /// Rows that hold numbers.
    struct Numbers(Vec<Entry>);

    impl Rows for Numbers {
        fn entries(&self) -> &[Entry] {
            &self.0
        }

        fn row(&self, entry: Entry) -> Row {
            Line(std::array::from_fn(|column| {
                (10 * entry as usize + column) as f32
            }))
        }

        fn partner(&self, _: Entry) -> u32 {
            unreachable!("a sheet holds rows alone")
        }
    }

    impl WithSimd for Fill<'_> {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            self.0.fill(simd, &self.1, self.1.entries());
        }
    }

    #[test]
    fn columns_hold_the_rows_and_then_nobody() {
        let (mut fast, mut plain) = (Sheet::default(), Sheet::default());
        // So many at once and one by one.
        for (first, count) in [(3, 8), (0, 3), (21, 40), (40, 41), (16, 49), (5, 5)] {
            let numbers = |count: u32| Numbers((0..count).collect());
            Arch::new().dispatch(Fill(&mut fast, numbers(first)));
            Fill(&mut plain, numbers(first)).with_simd(Scalar::new());
            for sheet in [&mut fast, &mut plain] {
                for entry in first..count {
                    sheet.push(numbers(count).row(entry));
                }
                let count = count as usize;
                assert_eq!(sheet.rows().len(), count);
                for (place, block) in sheet.blocks().iter().enumerate() {
                    for (column, values) in block.0.iter().enumerate() {
                        for (lane, &value) in values.iter().enumerate() {
                            let number = place * LANES + lane;
                            match (number < count, column) {
                                (true, _) => assert_eq!(value, (10 * number + column) as f32),
                                (false, 0..3) => assert!(value.is_nan()),
                                (false, _) => assert_eq!(value, 0.0),
                            }
                        }
                    }
                }
            }
        }
    }
}
