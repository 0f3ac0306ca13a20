//! Memory that is asked for while the filter is busy.

use prefetch_index::prefetch_index;

use crate::engine::image::number_of;
use crate::engine::windowed::grid::Entry;
use crate::engine::windowed::pieces::Line;

/// Lines that are asked for between the questions of some rows.
const FEW_LINES: usize = 3;

/// Lines that will be needed soon. Their memory is asked for in between, a few at a time: many at once would wait for each other.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReadAhead<'a> {
    /// All lines.
    pub lines: &'a [Line],
    /// A cell's list.
    pub entries: &'a [Entry],
}

impl ReadAhead<'_> {
    /// Asks for a few of them.
    #[inline(always)]
    pub fn read_some(&mut self) {
        if let Some((some, rest)) = self.entries.split_first_chunk::<FEW_LINES>() {
            for &entry in some {
                prefetch_index(self.lines, number_of(entry) as usize);
            }
            self.entries = rest;
        }
    }

    /// Asks for those that are left.
    #[inline(always)]
    pub fn read_rest(self) {
        for &entry in self.entries {
            prefetch_index(self.lines, number_of(entry) as usize);
        }
    }
}
