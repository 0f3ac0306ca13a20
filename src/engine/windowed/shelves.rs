//! Where a window's pieces are found by their numbers, one by one or those that pass a cell.

use super::grid::Entry;
use super::paths::Gas;
use super::pieces::{Id, Line, Origin, Piece, Pieces};
use super::sheet::{Row, Rows};
use crate::engine::image::{image_of, number_of};
use crate::state::Trajectory;

/// Where pieces are found by their numbers.
#[derive(Clone, Copy)]
pub struct Shelves<'a> {
    /// What all threads read.
    pub gas: Gas<'a>,
    /// The flights.
    pub lines: &'a [Line],
    /// The other pieces, by kind and region.
    pub kinds: [&'a [Pieces]; 3],
}

/// Where pieces are found while one region adds to its own.
#[derive(Clone, Copy)]
pub struct View<'a> {
    pub shelves: &'a Shelves<'a>,
    /// Those of the region's own, and their kind.
    pub own: Option<(usize, &'a Pieces)>,
}

impl<'a> View<'a> {
    #[inline(always)]
    fn pieces(&self, kind: usize, region: usize) -> &'a Pieces {
        match self.own {
            Some((own, pieces)) if own == kind => pieces,
            _ => &self.shelves.kinds[kind][region],
        }
    }

    /// A piece as the filter sees it.
    #[inline(always)]
    pub fn line(&self, id: Id) -> &'a Line {
        match self.shelves.gas.numbering.piece(id) {
            Piece::Flight(flight) => &self.shelves.lines[flight],
            Piece::Other(kind, region, place) => &self.pieces(kind, region).lines[place],
        }
    }

    /// A piece that belongs to a ball.
    #[inline(always)]
    pub fn trajectory(&self, id: Id, ball: u32) -> &'a Trajectory {
        match self.shelves.gas.numbering.piece(id) {
            Piece::Flight(_) => &self.shelves.gas.state.trajectories[ball as usize],
            Piece::Other(kind, region, place) => &self.pieces(kind, region).trajectories[place],
        }
    }

    /// Where a piece comes from; a flight, from itself.
    #[inline(always)]
    pub fn origin(&self, id: Id) -> Origin {
        match self.shelves.gas.numbering.piece(id) {
            Piece::Flight(_) => Origin::of_flight(id),
            Piece::Other(kind, region, place) => self.pieces(kind, region).origins[place],
        }
    }
}

/// The pieces that pass a cell of a container.
pub struct Passers<'a> {
    /// Where they are found.
    pub view: View<'a>,
    /// The cell's list.
    pub entries: &'a [Entry],
}

impl Rows for Passers<'_> {
    #[inline(always)]
    fn entries(&self) -> &[Entry] {
        self.entries
    }

    #[inline(always)]
    fn row(&self, entry: Entry) -> Row {
        *self.view.line(entry)
    }

    #[inline(always)]
    fn partner(&self, entry: Entry) -> u32 {
        self.view.origin(number_of(entry)).partner
    }
}

/// The pieces that pass a cell of a periodic box.
pub struct Images<'a>(pub Passers<'a>);

impl Rows for Images<'_> {
    #[inline(always)]
    fn entries(&self) -> &[Entry] {
        self.0.entries
    }

    #[inline(always)]
    fn row(&self, entry: Entry) -> Row {
        let view = self.0.view;
        let line = view.line(number_of(entry));
        if image_of(entry) == 0 {
            return *line;
        }
        line.moved(view.shelves.gas.grid.shift(image_of(entry)))
    }

    #[inline(always)]
    fn partner(&self, entry: Entry) -> u32 {
        self.0.partner(entry)
    }
}
