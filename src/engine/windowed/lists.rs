//! Lists of the pieces that pass through each cell of a region.

use std::ops::{AddAssign, Range};

use prefetch_index::prefetch_index;

use super::grid::{Entry, Grid};
use crate::cell_list::widened;
use crate::engine::image::number_of;

/// How many entries before its turn the memory for an entry is asked for: a line of memory.
const ENTRIES_AHEAD: usize = 16;

/// Pieces that are foreseen in a cell before it is crowded: hardly ever as many, where balls are not on a lattice.
const ROOM_FOR_FORESEEN: u32 = 32;

/// Who passes cells, counted. It does not depend on the number of regions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Census {
    /// Entries in lists.
    pub passages: u64,
    /// Pairs of entries in one list.
    pub pairs: u64,
}

impl AddAssign for Census {
    fn add_assign(&mut self, other: Self) {
        self.passages += other.passages;
        self.pairs += other.pairs;
    }
}

/// Which pieces pass through the cells of a region.
#[derive(Clone, Debug, Default)]
pub struct Lists {
    first: usize,
    /// Entries of cell `first + c`: `entries[c * capacity..][..lengths[c]]`.
    entries: Vec<Entry>,
    lengths: Vec<u32>,
    /// How many entries of each cell have been tested against each other.
    tested: Vec<u32>,
    /// How many there were before anything was foreseen.
    unforeseen: Vec<u32>,
    capacity: usize,
    /// Entries in the fullest list so far.
    fullest: usize,
}

impl Lists {
    /// Makes these the empty lists of these cells, with room for `expected` entries in each before they must grow.
    pub fn reset(&mut self, cells: Range<usize>, expected: usize) {
        // Room for the fullest cells that chance brings about, so that the lists need not grow later.
        let most = (expected + 8 * expected.isqrt()).max(self.fullest + 6 * self.fullest.isqrt());
        self.first = cells.start;
        self.capacity = self.capacity.max(odd_lines(most));
        let room = cells.len() * self.capacity;
        if room > self.entries.capacity() {
            // Nothing of it is needed any more; a little more than that, as regions vary.
            self.entries = Vec::new();
            self.entries.reserve_exact(room + room / 32);
        }
        self.entries.resize(room, 0);
        self.lengths.clear();
        self.lengths.resize(cells.len(), 0);
        self.tested.clear();
        self.tested.resize(cells.len(), 0);
    }

    /// The cells that are listed here.
    pub fn cells(&self) -> Range<usize> {
        self.first..self.first + self.lengths.len()
    }

    /// The entries of a cell.
    #[inline]
    pub fn entries(&self, cell: usize) -> &[Entry] {
        let cell = cell - self.first;
        &self.entries[cell * self.capacity..][..self.lengths[cell] as usize]
    }

    /// The same; none if the cell is listed elsewhere.
    #[inline]
    pub fn entries_if_here(&self, cell: usize) -> &[Entry] {
        let is_here = self.cells().contains(&cell);
        if is_here { self.entries(cell) } else { &[] }
    }

    /// Asks for the memory of a cell's list.
    #[inline]
    pub fn read_ahead(&self, cell: usize) {
        let cell = cell - self.first;
        if let Some(&length) = self.lengths.get(cell) {
            for entry in (0..length as usize).step_by(ENTRIES_AHEAD) {
                prefetch_index(&*self.entries, cell * self.capacity + entry);
            }
        }
    }

    /// How many entries of a cell have been tested against each other.
    #[inline]
    pub fn tested(&self, cell: usize) -> usize {
        self.tested[cell - self.first] as usize
    }

    /// Notes that all entries of a cell are tested against each other.
    #[inline]
    pub fn set_tested(&mut self, cell: usize) {
        let cell = cell - self.first;
        self.tested[cell] = self.lengths[cell];
    }

    /// Counts what is listed before anything is foreseen.
    pub fn take_census(&mut self) -> Census {
        self.unforeseen.clone_from(&self.lengths);
        let mut census = Census::default();
        for &length in &self.lengths {
            let length = u64::from(length);
            census.passages += length;
            census.pairs += length * length.saturating_sub(1) / 2;
        }
        census
    }

    /// Whether so much has been foreseen in a cell that more would hardly come about: each piece that is foreseen there may meet
    /// all others, and what begins at these meetings may meet them again.
    #[inline]
    pub fn is_crowded(&self, cell: usize) -> bool {
        let cell = cell - self.first;
        self.lengths[cell] > self.unforeseen[cell] + ROOM_FOR_FORESEEN
    }

    /// Entries in the fullest list before those of this window.
    #[cfg(test)]
    pub fn fullest(&self) -> usize {
        self.fullest
    }

    /// Empties all lists.
    pub fn clear(&mut self) {
        let fullest = self
            .lengths
            .iter()
            .max()
            .map_or(0, |&length| length as usize);
        self.fullest = self.fullest.max(fullest);
        self.lengths.fill(0);
        self.tested.fill(0);
    }

    /// Lists an entry in a cell. Gives whether it is the first since the cell's entries were tested.
    #[inline]
    pub fn insert(&mut self, cell: usize, entry: Entry) -> bool {
        if self.tails().insert(cell, entry) == Inserted::NoRoom {
            self.widen();
            self.tails().insert(cell, entry);
        }
        let cell = cell - self.first;
        self.tested[cell] + 1 == self.lengths[cell]
    }

    /// Where entries are added.
    #[inline(always)]
    pub fn tails(&mut self) -> Tails<'_> {
        Tails {
            first: self.first,
            entries: &mut self.entries,
            lengths: &mut self.lengths,
            capacity: self.capacity,
        }
    }

    /// Enlarges the room of every cell.
    #[cold]
    pub fn widen(&mut self) {
        let capacity = odd_lines(self.capacity + self.capacity / 4);
        self.entries = widened(&self.entries, self.capacity, capacity);
        self.capacity = capacity;
    }
}

/// Room for so many entries, in an odd number of lines of memory: so lists that are equally long do not share the same few places
/// of the processor's cache.
fn odd_lines(count: usize) -> usize {
    (count.div_ceil(ENTRIES_AHEAD) | 1) * ENTRIES_AHEAD
}

/// The ends of the lists.
pub struct Tails<'a> {
    first: usize,
    entries: &'a mut [Entry],
    lengths: &'a mut [u32],
    capacity: usize,
}

/// Whether an entry is listed now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inserted {
    /// It is.
    Yes,
    /// Its cell is listed elsewhere.
    Elsewhere,
    /// Its cell's list must be widened first.
    NoRoom,
}

impl Tails<'_> {
    /// The cells that are listed here.
    #[inline(always)]
    pub fn cells(&self) -> Range<usize> {
        self.first..self.first + self.lengths.len()
    }

    /// Lists an entry in a cell, if it is here and there is room.
    #[inline(always)]
    pub fn insert(&mut self, cell: usize, entry: Entry) -> Inserted {
        let cell = cell.wrapping_sub(self.first);
        let Some(length) = self.lengths.get_mut(cell) else {
            return Inserted::Elsewhere;
        };
        let end = cell * self.capacity + *length as usize;
        match self.entries.get_mut(end) {
            Some(place) if (*length as usize) < self.capacity => *place = entry,
            _ => return Inserted::NoRoom,
        }
        *length += 1;
        // Where the list goes on when this line of memory is full.
        prefetch_index(&*self.entries, end + ENTRIES_AHEAD);
        Inserted::Yes
    }

    /// Asks for the memory where the lists of a cell and of those around it go on.
    #[inline(always)]
    pub fn read_ahead(&self, grid: &Grid, cell: usize) {
        let Some(&place) = grid.places.get(cell) else {
            return;
        };
        let [x, y, z] = grid.strides;
        for way in [
            0,
            x,
            y,
            z,
            x.wrapping_neg(),
            y.wrapping_neg(),
            z.wrapping_neg(),
        ] {
            let target = grid.targets[place.wrapping_add(way) as usize];
            self.read_end_ahead(number_of(target) as usize);
        }
    }

    /// Asks for the memory where the list of a cell goes on, if it is here.
    #[inline(always)]
    pub fn read_end_ahead(&self, cell: usize) {
        let cell = cell.wrapping_sub(self.first);
        if let Some(&length) = self.lengths.get(cell) {
            prefetch_index(&*self.entries, cell * self.capacity + length as usize);
        }
    }
}
