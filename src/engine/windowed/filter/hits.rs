//! What the first question finds: for each vector of pairs which of them pass, and then the pairs themselves.

use crate::engine::turn::SIDE;
use crate::engine::windowed::sheet::LANES;

/// Some rows and a vector of columns, or some rotations of a block's columns and these columns themselves, of which some pairs pass.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hits {
    /// The first of the rows, or by how many lanes the first rotation is.
    row: u32,
    /// The first of the columns.
    column: u32,
    /// For each row or rotation [`LANES`] bits, one for each column.
    lanes: u64,
}

impl Hits {
    #[inline(always)]
    pub fn new(row: usize, column: usize, lanes: u64) -> Self {
        Self {
            row: row as u32,
            column: column as u32,
            lanes,
        }
    }

    /// Where its first row is on the sheet.
    #[inline(always)]
    pub fn row(&self) -> usize {
        self.row as usize
    }

    /// Where its first column is.
    #[inline(always)]
    pub fn column(&self) -> usize {
        self.column as usize
    }

    /// Keeps only these lanes.
    #[inline(always)]
    pub fn keep(&mut self, lanes: u64) {
        self.lanes &= lanes;
    }

    /// The lanes of one of its rows.
    #[inline(always)]
    pub fn lanes_of_row(&self, place: usize) -> u64 {
        self.lanes >> (place * LANES) & ((1 << LANES) - 1)
    }

    /// Whether any pair passes.
    #[inline(always)]
    pub fn any(&self) -> bool {
        self.lanes != 0
    }
}

/// Rows of which the hits are written down together.
pub const ROWS_AT_ONCE: usize = u64::BITS as usize / LANES;

/// The lanes of columns before each row, for rows and columns of which the first ones stand at these places of a sheet.
#[inline(always)]
pub fn before(row: usize, column: usize) -> u64 {
    BEFORE[(row + ROWS_AT_ONCE)
        .saturating_sub(column)
        .min(LANES + ROWS_AT_ONCE)]
}

/// The same by how far the first row is behind the first column, [`ROWS_AT_ONCE`] added.
const BEFORE: [u64; LANES + ROWS_AT_ONCE + 1] = {
    let mut before = [0; LANES + ROWS_AT_ONCE + 1];
    let mut behind = 0;
    while behind < before.len() {
        let mut place = 0;
        while place < ROWS_AT_ONCE {
            let columns = (behind + place).saturating_sub(ROWS_AT_ONCE);
            let columns = if columns < LANES { columns } else { LANES };
            before[behind] |= ((1 << columns) - 1) << (place * LANES);
            place += 1;
        }
        behind += 1;
    }
    before
};

/// A piece and itself, which cannot meet.
const NO_PAIR: (u32, u32) = (0, 0);

/// Writes down the pairs that hits stand for, of which the first ones are of so many rotated columns: the later row first. Then some
/// that cannot meet, up to a multiple of [`SIDE`]. Gives how many pairs they are.
#[inline(always)]
pub fn write_down(hits: &[Hits], rotated: usize, pairs: &mut Vec<(u32, u32)>) -> usize {
    let counts = hits.iter().map(|hits| hits.lanes.count_ones() as usize);
    let count: usize = counts.sum();
    if pairs.len() < count + SIDE {
        pairs.resize(2 * count + SIDE, NO_PAIR);
    }
    let (of_rotated, of_rows) = hits.split_at(rotated);
    let place = write_some(of_rotated, pairs, 0, |hits, number, lane| {
        let other = lane.wrapping_sub(hits.row + number) % LANES as u32;
        let (one, other) = (hits.column + lane, hits.column + other);
        (one.max(other), one.min(other))
    });
    write_some(of_rows, pairs, place, |hits, number, lane| {
        (hits.row + number, hits.column + lane)
    });
    pairs[count..count + SIDE].fill(NO_PAIR);
    count
}

/// Writes down pairs from a place on, as `pair` gives them by the number of the row or rotation among the hits' and the lane. Gives the
/// place after them.
#[inline(always)]
fn write_some(
    hits: &[Hits],
    pairs: &mut [(u32, u32)],
    mut place: usize,
    pair: impl Fn(&Hits, u32, u32) -> (u32, u32),
) -> usize {
    for hits in hits {
        let mut lanes = hits.lanes;
        let mut next = |lanes: &mut u64| {
            let bit = lanes.trailing_zeros();
            pairs[place] = pair(hits, bit / LANES as u32, bit % LANES as u32);
            place += usize::from(*lanes != 0);
            *lanes &= lanes.wrapping_sub(1);
        };
        // How many they are cannot be foreseen: two are written down without a branch.
        next(&mut lanes);
        next(&mut lanes);
        while lanes != 0 {
            next(&mut lanes);
        }
    }
    place
}

/// Room for so many hits, and one that is not taken.
pub fn room_for(hits: &mut Vec<Hits>, count: usize) -> &mut [Hits] {
    if hits.len() <= count {
        hits.resize(count + count / 2 + 1, Hits::default());
    }
    hits
}
