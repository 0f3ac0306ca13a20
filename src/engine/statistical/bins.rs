//! Where the balls are kept: one bin for each cell, a chain of chunks in one stretch of memory.
//!
//! Balls lie in the order in which they were put in. A bin takes any number of them, so no gas is too uneven. The chunks of a
//! bin that has been emptied are the next to be filled, while they are still in the caches.

use glam::DVec3;
use prefetch_index::prefetch_index;
use serde::{Deserialize, Serialize};

use crate::engine::turn::SIDE;

/// Balls in a chunk: half a kibibyte.
const CHUNK: usize = 16;

/// Balls in a line of memory.
const PER_LINE: usize = 2;

/// Most balls: indices have 32 bits.
pub const MOST_BALLS: usize = u32::MAX as usize;

/// A ball between two rounds of collisions. Internal units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Where its centre is at the next collisions.
    pub position: [f32; 3],
    /// Its velocity.
    pub velocity: [f32; 3],
    /// Which ball of the scene it is.
    pub ball: u32,
    /// Its collisions since they were last added to the state's.
    pub collisions: u32,
}

impl Record {
    /// A ball that has not collided yet.
    pub fn new(ball: usize, position: DVec3, velocity: DVec3) -> Self {
        Self {
            position: position.as_vec3().to_array(),
            velocity: velocity.as_vec3().to_array(),
            ball: ball as u32,
            collisions: 0,
        }
    }
}

/// The same as a row of eight numbers, the whole ones by their bits: half a cache line, always moved as a whole.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub struct Row(pub [f32; SIDE]);

impl From<Record> for Row {
    fn from(record: Record) -> Self {
        let ([x, y, z], [u, v, w]) = (record.position, record.velocity);
        let [ball, collisions] = [record.ball, record.collisions].map(f32::from_bits);
        Self([x, y, z, u, v, w, ball, collisions])
    }
}

impl From<Row> for Record {
    fn from(Row([x, y, z, u, v, w, ball, collisions]): Row) -> Self {
        Self {
            position: [x, y, z],
            velocity: [u, v, w],
            ball: ball.to_bits(),
            collisions: collisions.to_bits(),
        }
    }
}

/// The ends of all bins' chains.
#[derive(Clone, Debug)]
struct Chains {
    /// For each cell, its first chunk.
    heads: Vec<u32>,
    /// For each cell, the place behind its last ball; zero for an empty bin.
    tails: Vec<u32>,
}

impl Chains {
    fn new(cells: usize) -> Self {
        Self {
            heads: vec![0; cells],
            tails: vec![0; cells],
        }
    }

    /// The places of a cell's balls, chunk by chunk.
    #[inline(always)]
    fn of<'a>(&self, cell: usize, next: &'a [u32]) -> impl Iterator<Item = (usize, usize)> + 'a {
        let tail = self.tails[cell] as usize;
        let mut following = (tail > 0).then_some(self.heads[cell]);
        std::iter::from_fn(move || {
            let chunk = following? as usize;
            let begin = chunk * CHUNK;
            let is_last = tail <= begin + CHUNK && tail > begin;
            following = (!is_last).then(|| next[chunk]);
            Some((begin, if is_last { tail } else { begin + CHUNK }))
        })
    }
}

/// The bins of all cells.
#[derive(Clone, Debug)]
pub struct Bins {
    /// Chunks side by side; the first is never used.
    rows: Vec<Row>,
    /// For each chunk, the one that follows it in its bin.
    next: Vec<u32>,
    /// What is put in.
    filling: Chains,
    /// What is taken out.
    emptying: Chains,
    /// Chunks from here on have not been used.
    used: usize,
    /// Chunks that have been emptied.
    free: Vec<u32>,
}

impl Bins {
    /// Empty bins with room for about so many balls; they grow where that is not enough.
    pub fn new(cells: usize, balls: usize) -> Self {
        let chunks = 1 + balls / CHUNK + if balls > 0 { cells / 2 } else { 0 };
        Self {
            rows: vec![Row::default(); chunks * CHUNK],
            next: vec![0; chunks],
            filling: Chains::new(cells),
            emptying: Chains::new(cells),
            used: 1,
            free: Vec::new(),
        }
    }

    /// Empties all bins.
    pub fn clear(&mut self) {
        self.filling.tails.fill(0);
        self.free.clear();
        self.used = 1;
    }

    /// What has been put in is from now on to be taken out; all has been taken out before.
    pub fn turn_over(&mut self) {
        std::mem::swap(&mut self.filling, &mut self.emptying);
        self.filling.tails.fill(0);
    }

    /// Takes the balls of a cell out, after [`Self::turn_over`].
    #[inline(always)]
    pub fn take(&mut self, cell: usize, balls: &mut Vec<Row>) {
        for (begin, end) in self.emptying.of(cell, &self.next) {
            balls.extend_from_slice(&self.rows[begin..end]);
            self.free.push((begin / CHUNK) as u32);
        }
    }

    /// Asks for the memory of balls that are to be taken out.
    #[inline(always)]
    pub fn read_ahead(&self, cell: usize) {
        for (begin, end) in self.emptying.of(cell, &self.next) {
            for line in (begin..end).step_by(PER_LINE) {
                prefetch_index(&self.rows[..], line);
            }
        }
    }

    /// Where so many more balls are put.
    #[inline(always)]
    pub fn writer(&mut self, balls: usize) -> Writer<'_> {
        if self.used + balls > self.next.len() + self.free.len() {
            let chunks = self.used + balls + self.used / 4;
            self.next.resize(chunks, 0);
            self.rows.resize(chunks * CHUNK, Row::default());
        }
        Writer {
            rows: &mut self.rows,
            next: &mut self.next,
            heads: &mut self.filling.heads,
            tails: &mut self.filling.tails,
            used: &mut self.used,
            free: &mut self.free,
        }
    }

    /// The balls that were put into the bin of a cell, in stretches.
    pub fn of(&self, cell: usize) -> impl Iterator<Item = &[Row]> {
        let places = self.filling.of(cell, &self.next);
        places.map(|(begin, end)| &self.rows[begin..end])
    }

    /// Every ball that was put in, bin by bin, to be changed in place.
    pub fn for_each_mut(&mut self, mut change: impl FnMut(&mut Record)) {
        for cell in 0..self.filling.heads.len() {
            for (begin, end) in self.filling.of(cell, &self.next) {
                for row in &mut self.rows[begin..end] {
                    let mut record = Record::from(*row);
                    change(&mut record);
                    *row = record.into();
                }
            }
        }
    }
}

/// The ends of the bins, with room.
pub struct Writer<'a> {
    rows: &'a mut [Row],
    next: &'a mut [u32],
    heads: &'a mut [u32],
    tails: &'a mut [u32],
    used: &'a mut usize,
    free: &'a mut Vec<u32>,
}

impl Writer<'_> {
    /// Puts a ball into the bin of a cell.
    #[inline(always)]
    pub fn put(&mut self, cell: usize, row: Row) {
        let mut tail = self.tails[cell] as usize;
        if tail.is_multiple_of(CHUNK) {
            let fresh = self.free.pop().unwrap_or_else(|| {
                *self.used += 1;
                *self.used as u32 - 1
            });
            if tail == 0 {
                self.heads[cell] = fresh;
            } else {
                self.next[tail / CHUNK - 1] = fresh;
            }
            tail = fresh as usize * CHUNK;
        }
        self.tails[cell] = tail as u32 + 1;
        self.rows[tail] = row;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_keep_all_balls_in_order_like_plain_vectors() {
        let mut bins = Bins::new(3, 4);
        let mut twin = vec![Vec::new(); 3];
        for round in 0..4_u32 {
            bins.turn_over();
            let before = std::mem::replace(&mut twin, vec![Vec::new(); 3]);
            for (cell, before) in before.iter().enumerate() {
                let mut taken = Vec::new();
                bins.take(cell, &mut taken);
                let taken: Vec<Record> = taken.into_iter().map(Record::from).collect();
                assert_eq!(&taken, before);
                // As in a step: balls are put in while others are still to be taken out.
                for ball in 0..400_u32 + 100 * round {
                    let place = ball.wrapping_mul(2_654_435_769) >> 28;
                    let target = place as usize % (2 + round as usize % 2);
                    let number = (1000 * cell) as u32 + ball;
                    let record = Record::new(number as usize, DVec3::ZERO, DVec3::ZERO);
                    bins.writer(1).put(target, record.into());
                    twin[target].push(record);
                }
            }
            for (cell, twin) in twin.iter().enumerate() {
                let found = bins.of(cell).flatten().copied().map(Record::from);
                assert_eq!(&found.collect::<Vec<_>>(), twin);
            }
        }
        let most = 3 * 700 / CHUNK + 3;
        assert!(bins.used < 3 * most, "chunks are used again");
    }
}
