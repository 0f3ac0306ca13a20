//! The balls of a cell while they collide and fly: by columns, some side by side.

use pulp::Simd;

use super::bins::Row;
use crate::engine::turn::{SIDE, turn};

/// Some balls, by columns.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub struct Block {
    /// Where their centres are.
    pub position: [[f32; SIDE]; 3],
    /// Their velocities.
    pub velocity: [[f32; SIDE]; 3],
    /// Which balls they are, and their collisions, as bits.
    others: [[f32; SIDE]; 2],
}

impl Block {
    #[inline(always)]
    fn new<S: Simd>(simd: S, rows: &[Row; SIDE]) -> Self {
        let [a, b, c, d, e, f, g, h] = rows;
        let rows = [a.0, b.0, c.0, d.0, e.0, f.0, g.0, h.0];
        let [x, y, z, u, v, w, ball, collisions] = turn(simd, rows);
        Self {
            position: [x, y, z],
            velocity: [u, v, w],
            others: [ball, collisions],
        }
    }

    /// The balls.
    #[inline(always)]
    pub fn rows<S: Simd>(&self, simd: S) -> [Row; SIDE] {
        let ([x, y, z], [u, v, w]) = (self.position, self.velocity);
        let [ball, collisions] = self.others;
        turn(simd, [x, y, z, u, v, w, ball, collisions]).map(Row)
    }
}

/// All balls of a cell.
#[derive(Clone, Debug, Default)]
pub struct Columns {
    /// As they come; what fills up the last block is meaningless.
    rows: Vec<Row>,
    blocks: Vec<Block>,
    count: usize,
}

impl Columns {
    /// Takes the balls that are gathered instead of those it has.
    #[inline(always)]
    pub fn fill<S: Simd>(&mut self, simd: S, gather: impl FnOnce(&mut Vec<Row>)) {
        self.rows.clear();
        gather(&mut self.rows);
        self.count = self.rows.len();
        let blocks = self.count.div_ceil(SIDE);
        self.rows.resize(blocks * SIDE, Row::default());
        self.blocks.resize(blocks, Block::default());
        let rows = self.rows.as_chunks::<SIDE>().0;
        for (block, rows) in self.blocks.iter_mut().zip(rows) {
            *block = Block::new(simd, rows);
        }
    }

    /// How many they are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The blocks; in the last one the lanes beyond the count have no meaning.
    #[inline(always)]
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// The blocks, to be changed.
    #[inline(always)]
    pub fn blocks_mut(&mut self) -> &mut [Block] {
        &mut self.blocks
    }

    /// Where a ball's centre is.
    #[inline(always)]
    pub fn position(&self, place: usize) -> [f32; 3] {
        let block = &self.blocks[place / SIDE];
        [0, 1, 2].map(|axis| block.position[axis][place % SIDE])
    }

    /// A ball's velocity.
    #[inline(always)]
    pub fn velocity(&self, place: usize) -> [f32; 3] {
        let block = &self.blocks[place / SIDE];
        [0, 1, 2].map(|axis| block.velocity[axis][place % SIDE])
    }

    /// Which ball it is.
    #[inline(always)]
    pub fn ball(&self, place: usize) -> u32 {
        self.blocks[place / SIDE].others[0][place % SIDE].to_bits()
    }

    /// Moves a ball and changes its velocity, in a collision.
    #[inline(always)]
    pub fn collide(&mut self, place: usize, position: [f32; 3], velocity: [f32; 3]) {
        let (block, lane) = (&mut self.blocks[place / SIDE], place % SIDE);
        for axis in 0..3 {
            block.position[axis][lane] = position[axis];
            block.velocity[axis][lane] = velocity[axis];
        }
        let collisions = &mut block.others[1][lane];
        *collisions = f32::from_bits(collisions.to_bits() + 1);
    }
}
