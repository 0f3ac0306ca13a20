//! Pieces of trajectory: what a ball's path in a window is made of, and the numbers that name them.
//!
//! Flights are the paths with which the balls enter the window; the exact ones are in the state, by ball. First pieces follow
//! their hits of walls and the like. Fresh pieces follow pair collisions foreseen by the region's own search, later ones those
//! found after the regions' exchange and during the commits. Each region keeps its own, so that threads add side by side.

use glam::{DVec3, Vec3};
use prefetch_index::prefetch_index;

use super::scratch::Scratch;
use crate::engine::turn::SIDE;
use crate::state::Trajectory;

/// The number of a piece.
pub type Id = u32;

/// Names no piece.
pub const NONE: Id = Id::MAX;

/// Most regions.
pub const MOST_REGIONS: usize = 64;

/// Most balls.
pub const MOST_BALLS: usize = 1 << 25;

/// How many pieces ahead the memory for a piece is asked for.
const PIECES_AHEAD: usize = 4;

/// Numbers from this bit on are pieces other than flights: the next bits are their kind.
const PIECE_BIT: u32 = 26;
const KIND_SHIFT: u32 = 24;

/// First pieces: which of the three kinds of pieces that are no flights.
pub const FIRST: usize = 0;
/// Fresh pieces.
pub const FRESH: usize = 1;
/// Later pieces.
pub const LATER: usize = 2;

/// What a number names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Piece {
    /// The flight of this index.
    Flight(usize),
    /// A piece of a kind, of a region: its place there.
    Other(usize, usize, usize),
}

/// The number of a piece that is no flight, of which so many have begun; where every ball has one at a time.
///
/// Taken for f32 it is as good as zero.
#[inline(always)]
pub fn first_other(begun: usize) -> Id {
    (1 << PIECE_BIT) + begun as Id
}

/// How pieces are numbered: the low bits of those that are no flights say whose they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numbering {
    region_bits: u32,
}

impl Numbering {
    /// For so many regions.
    pub fn new(regions: usize) -> Self {
        Self {
            region_bits: regions.next_power_of_two().trailing_zeros(),
        }
    }

    /// What a number names.
    #[inline(always)]
    pub fn piece(self, id: Id) -> Piece {
        if id < 1 << PIECE_BIT {
            return Piece::Flight(id as usize);
        }
        let kind = (id >> KIND_SHIFT & 3) as usize;
        let index = id & ((1 << KIND_SHIFT) - 1);
        let region = index & ((1 << self.region_bits) - 1);
        Piece::Other(kind, region as usize, (index >> self.region_bits) as usize)
    }

    /// The number of a piece that is no flight.
    ///
    /// # Panics
    /// If a region has more pieces than there are numbers: a window is too short for that.
    #[inline]
    pub fn id(self, kind: usize, region: usize, place: usize) -> Id {
        let index = place << self.region_bits | region;
        assert!(
            index < 1 << KIND_SHIFT,
            "a window is short enough that its pieces can be numbered"
        );
        1 << PIECE_BIT | (kind as u32) << KIND_SHIFT | index as u32
    }
}

/// A piece as the filter sees it, in f32: the straight line it lies on.
///
/// A row of eight numbers, the whole ones by their bits: half a cache line, always moved as a whole. The last number of a flight is
/// its link, that of another piece its begin; taken for a begin, a link is no number ([`NONE`]) or as good as zero.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub struct Line(pub [f32; SIDE]);

impl Line {
    /// From a position at the beginning of the window and a velocity, both in the grid's lengths; without a link.
    #[inline]
    pub fn new(position: DVec3, velocity: DVec3, ball: u32) -> Self {
        let ([x, y, z], [u, v, w]) = (position.as_vec3().into(), velocity.as_vec3().into());
        let [ball, link] = [ball, NONE].map(f32::from_bits);
        Self([x, y, z, u, v, w, ball, link])
    }

    /// Where it is at the beginning of the window, if need be drawn back to it: in grid lengths from the box's lower corner.
    #[inline(always)]
    pub fn position(&self) -> [f32; 3] {
        let Self([x, y, z, ..]) = *self;
        [x, y, z]
    }

    /// Its velocity, in grid lengths per window.
    #[inline(always)]
    pub fn velocity(&self) -> [f32; 3] {
        let Self([_, _, _, u, v, w, ..]) = *self;
        [u, v, w]
    }

    /// The ball it belongs to.
    #[inline(always)]
    pub fn ball(&self) -> u32 {
        self.0[6].to_bits()
    }

    /// For a flight, the piece along which the ball goes on; [`NONE`] as long as it is the flight itself.
    #[inline(always)]
    pub fn link(&self) -> Id {
        self.0[7].to_bits()
    }

    /// Changes that.
    #[inline(always)]
    pub fn set_link(&mut self, link: Id) {
        self.0[7] = f32::from_bits(link);
    }

    /// The same for a piece that is no flight, which begins then, in windows from the beginning of the window.
    #[inline(always)]
    pub fn beginning(mut self, begin: f64) -> Self {
        self.0[7] = begin as f32;
        self
    }

    /// When it begins, in windows; zero for a flight.
    #[inline(always)]
    pub fn begin(&self) -> f32 {
        self.0[7].max(0.0)
    }

    /// The same elsewhere.
    // A function of its own, that a line that stays where it is is copied as a whole.
    #[inline(never)]
    pub fn moved(&self, shift: [f32; 3]) -> Self {
        let mut moved = *self;
        for (axis, shift) in shift.into_iter().enumerate() {
            moved.0[axis] += shift;
        }
        moved
    }

    /// How fast it moves.
    #[inline(always)]
    pub fn speed(&self) -> f32 {
        Vec3::from_array(self.velocity()).length()
    }
}

/// Where a piece comes from.
#[derive(Clone, Copy, Debug)]
pub struct Origin {
    /// The flight it follows.
    pub owner: Id,
    /// The two pieces at whose meeting it began, which it cannot meet again.
    pub parents: [Id; 2],
    /// The other one's ball; [`NONE`] without such a meeting.
    pub partner: u32,
    /// How many collisions were foreseen on the way to it.
    pub generation: u32,
}

impl Origin {
    /// That of what follows a flight's hits of walls and the like.
    #[inline]
    pub fn of_flight(owner: Id) -> Self {
        Self {
            owner,
            parents: [NONE; 2],
            partner: NONE,
            generation: 0,
        }
    }
}

/// The pieces of a region, as columns.
#[derive(Clone, Debug, Default)]
pub struct Pieces {
    /// As the filter sees them.
    pub lines: Scratch<Line>,
    /// The pieces themselves.
    pub trajectories: Scratch<Trajectory>,
    /// Where they come from.
    pub origins: Scratch<Origin>,
    /// When each first meets another piece, as far as is known, in epochs from the window's first epoch.
    pub first_meetings: Scratch<f64>,
}

impl Pieces {
    /// Adds a piece; gives its place.
    #[inline]
    pub fn push(&mut self, trajectory: Trajectory, line: Line, origin: Origin) -> usize {
        self.lines.push(line);
        self.trajectories.push(trajectory);
        self.origins.push(origin);
        self.first_meetings.push(f64::INFINITY);
        let count = self.lines.len();
        // Where the columns go on in a while.
        prefetch_index(self.lines.as_slice(), count + PIECES_AHEAD);
        prefetch_index(self.trajectories.as_slice(), count + PIECES_AHEAD);
        prefetch_index(self.origins.as_slice(), count + PIECES_AHEAD);
        count - 1
    }

    /// Forgets all pieces.
    pub fn clear(&mut self) {
        self.lines.empty();
        self.trajectories.empty();
        self.origins.empty();
        self.first_meetings.empty();
    }
}

/// The pieces along which balls left the last window: their lines, by kind and region.
#[derive(Clone, Debug, Default)]
pub struct Past(pub [Vec<Scratch<Line>>; 3]);

impl Past {
    /// The line of a piece that is no flight.
    #[inline]
    pub fn line(&self, numbering: Numbering, id: Id) -> &Line {
        let Piece::Other(kind, region, place) = numbering.piece(id) else {
            unreachable!("a ball leaves its flight along another piece")
        };
        &self.0[kind][region][place]
    }

    /// Asks for the memory of that line.
    #[inline]
    pub fn read_ahead(&self, numbering: Numbering, id: Id) {
        if let Piece::Other(kind, region, place) = numbering.piece(id) {
            prefetch_index(self.0[kind][region].as_slice(), place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::image::IMAGE_SHIFT;

    #[test]
    fn every_piece_has_its_own_number() {
        for (regions, region, most) in [(1, 0, 16_000_000), (3, 2, 4_000_000), (64, 63, 260_000)] {
            let numbering = Numbering::new(regions);
            for kind in [FIRST, FRESH, LATER] {
                for place in [0, most] {
                    let id = numbering.id(kind, region, place);
                    assert_eq!(numbering.piece(id), Piece::Other(kind, region, place));
                    assert!(id < 1 << IMAGE_SHIFT);
                }
            }
        }
        let last = MOST_BALLS - 1;
        assert_eq!(Numbering::new(2).piece(last as Id), Piece::Flight(last));
    }
}
