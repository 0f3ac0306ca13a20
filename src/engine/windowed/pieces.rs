//! Pieces of trajectory: what a ball's path in a window is made of, and the numbers that name them.
//!
//! Flights are the paths with which the balls enter the window. First pieces follow their wall hits. Fresh pieces follow pair
//! collisions, foreseen or carried out. Each region of cells keeps its own, so that threads can add to them side by side.

use super::filter::Start;
use crate::state::Trajectory;

/// The number of a piece.
pub type Id = u32;

/// Names no piece.
pub const NONE: Id = Id::MAX;

/// Most regions.
pub const MOST_REGIONS: usize = 1 << REGION_BITS;

/// Most balls.
pub const MOST_BALLS: usize = 1 << KIND_SHIFT;

const REGION_BITS: u32 = 6;
const KIND_SHIFT: u32 = 30;

/// What a number names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Piece {
    /// The flight of this index.
    Flight(usize),
    /// A first piece: its region, and its place there.
    First(usize, usize),
    /// A fresh piece: its region, and its place there.
    Fresh(usize, usize),
}

impl Piece {
    /// What a number names.
    #[inline]
    pub fn of(id: Id) -> Self {
        let index = (id & ((1 << KIND_SHIFT) - 1)) as usize;
        let (region, place) = (index % MOST_REGIONS, index / MOST_REGIONS);
        match id >> KIND_SHIFT {
            0 => Self::Flight(index),
            1 => Self::First(region, place),
            _ => Self::Fresh(region, place),
        }
    }

    /// The number that names it.
    #[inline]
    pub fn id(self) -> Id {
        let numbered = |kind: u32, region: usize, place: usize| {
            let index = place * MOST_REGIONS + region;
            assert!(
                index < 1 << KIND_SHIFT,
                "a window is short enough that its pieces can be numbered"
            );
            kind << KIND_SHIFT | index as u32
        };
        match self {
            Self::Flight(index) => index as u32,
            Self::First(region, place) => numbered(1, region, place),
            Self::Fresh(region, place) => numbered(2, region, place),
        }
    }
}

/// The pieces of a region, as columns.
#[derive(Clone, Debug, Default)]
pub struct Pieces {
    /// The pieces themselves.
    pub trajectories: Vec<Trajectory>,
    /// Where each would be at the window's beginning.
    pub starts: Vec<Start>,
    /// The flight each belongs to.
    pub owners: Vec<u32>,
    /// The two pieces whose meeting each began at, which it cannot meet again.
    pub parents: Vec<[Id; 2]>,
}

impl Pieces {
    /// Adds a piece; gives its place.
    pub fn push(
        &mut self,
        trajectory: Trajectory,
        start: Start,
        owner: u32,
        parents: [Id; 2],
    ) -> usize {
        self.trajectories.push(trajectory);
        self.starts.push(start);
        self.owners.push(owner);
        self.parents.push(parents);
        self.owners.len() - 1
    }

    /// Forgets all pieces.
    pub fn clear(&mut self) {
        self.trajectories.clear();
        self.starts.clear();
        self.owners.clear();
        self.parents.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_piece_has_its_own_number() {
        for piece in [
            Piece::Flight(0),
            Piece::Flight(MOST_BALLS - 1),
            Piece::First(0, 0),
            Piece::First(63, 1_000_000),
            Piece::Fresh(0, 0),
            Piece::Fresh(63, 16_000_000),
        ] {
            assert_eq!(Piece::of(piece.id()), piece);
        }
    }
}
