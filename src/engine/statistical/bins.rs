//! Where the balls are kept: one bin for each cell, a chain of chunks in one stretch of memory.
//!
//! Balls lie in the order in which they were put in. A bin takes any number of them, so no gas is too uneven.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Balls in a chunk: half a kibibyte.
const CHUNK: usize = 16;

/// Most balls: indices have 32 bits.
pub const MOST_BALLS: usize = u32::MAX as usize;

/// A ball between two rounds of collisions, half a cache line. Internal units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[repr(C, align(32))]
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

/// The bins of all cells.
#[derive(Clone, Debug)]
pub struct Bins {
    /// Chunks side by side; the first is never used.
    records: Vec<Record>,
    /// For each chunk, the one that follows it in its bin.
    next: Vec<u32>,
    /// For each cell, its first chunk.
    heads: Vec<u32>,
    /// For each cell, the place behind its last ball; zero for an empty bin.
    tails: Vec<u32>,
    used: usize,
}

impl Bins {
    /// Empty bins with room for about so many balls; they grow where that is not enough.
    pub fn new(cells: usize, balls: usize) -> Self {
        let chunks = 1 + balls / CHUNK + cells / 2;
        Self {
            records: vec![Record::default(); chunks * CHUNK],
            next: vec![0; chunks],
            heads: vec![0; cells],
            tails: vec![0; cells],
            used: 1,
        }
    }

    /// Empties all bins.
    pub fn clear(&mut self) {
        self.tails.fill(0);
        self.used = 1;
    }

    /// A place for one more ball in the bin of a cell.
    #[inline(always)]
    pub fn slot(&mut self, cell: usize) -> &mut Record {
        let mut tail = self.tails[cell] as usize;
        if tail.is_multiple_of(CHUNK) {
            tail = self.extend(cell, tail);
        }
        self.tails[cell] = tail as u32 + 1;
        &mut self.records[tail]
    }

    /// Gives the bin a new chunk, and says where it begins.
    #[inline(never)]
    fn extend(&mut self, cell: usize, tail: usize) -> usize {
        let fresh = self.used;
        self.used += 1;
        if fresh == self.next.len() {
            let chunks = fresh + fresh / 4 + 1;
            self.next.resize(chunks, 0);
            self.records.resize(chunks * CHUNK, Record::default());
        }
        if tail == 0 {
            self.heads[cell] = fresh as u32;
        } else {
            self.next[tail / CHUNK - 1] = fresh as u32;
        }
        fresh * CHUNK
    }

    /// The balls of a cell, in stretches.
    pub fn of(&self, cell: usize) -> impl Iterator<Item = &[Record]> {
        let tail = self.tails[cell] as usize;
        let mut following = (tail > 0).then(|| self.heads[cell] as usize);
        std::iter::from_fn(move || {
            let chunk = following?;
            let begin = chunk * CHUNK;
            let is_last = tail <= begin + CHUNK && tail > begin;
            following = (!is_last).then(|| self.next[chunk] as usize);
            Some(&self.records[begin..if is_last { tail } else { begin + CHUNK }])
        })
    }

    /// Every ball, bin by bin, to be changed in place.
    pub fn for_each_mut(&mut self, mut change: impl FnMut(&mut Record)) {
        for cell in 0..self.heads.len() {
            let tail = self.tails[cell] as usize;
            if tail == 0 {
                continue;
            }
            let mut chunk = self.heads[cell] as usize;
            loop {
                let begin = chunk * CHUNK;
                let is_last = tail <= begin + CHUNK && tail > begin;
                let end = if is_last { tail } else { begin + CHUNK };
                self.records[begin..end].iter_mut().for_each(&mut change);
                if is_last {
                    break;
                }
                chunk = self.next[chunk] as usize;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_keep_all_balls_in_order_like_plain_vectors() {
        let mut bins = Bins::new(3, 4);
        for round in 0..2 {
            bins.clear();
            let mut twin = vec![Vec::new(); 3];
            for ball in 0..1000_u32 {
                let cell = (ball.wrapping_mul(2_654_435_769) >> 28) as usize % (2 + round);
                let record = Record::new(ball as usize, DVec3::ZERO, DVec3::ZERO);
                *bins.slot(cell) = record;
                twin[cell].push(record);
            }
            for (cell, twin) in twin.iter().enumerate() {
                let found: Vec<Record> = bins.of(cell).flatten().copied().collect();
                assert_eq!(&found, twin);
            }
        }
    }
}
