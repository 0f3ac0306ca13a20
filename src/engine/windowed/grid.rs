//! The windowed engine's cells: who passes where in a window of time.
//!
//! Each ball is listed in every cell that its straight path in the window reaches into, so two balls that touch in the window
//! are both in the list of the cell that holds their contact point. Cells are numbered along a Morton curve, so that cells near
//! each other in space are near each other in memory.

use glam::DVec3;

/// Margin around a ball, in cell widths: far above rounding, far below anything that costs.
const SLACK: f64 = 1.0 / (1 << 20) as f64;

/// Most cells along an axis: their Morton numbers interleave ten bits each.
const MOST_PER_AXIS: f64 = 1024.0;

/// A place on the grid.
pub type Place = [u16; 3];

/// A box of places, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// Lowest place along each axis.
    pub low: Place,
    /// Highest place along each axis.
    pub high: Place,
}

impl Range {
    /// Visits every place of the box.
    #[inline]
    pub fn for_each(self, mut visit: impl FnMut(Place)) {
        for x in self.low[0]..=self.high[0] {
            for y in self.low[1]..=self.high[1] {
                for z in self.low[2]..=self.high[2] {
                    visit([x, y, z]);
                }
            }
        }
    }
}

/// Cells over a container.
#[derive(Clone, Debug)]
pub struct Grid {
    counts: Place,
    half_size: DVec3,
    width: DVec3,
    per_width: DVec3,
    slack: f64,
    /// Number of each place on the Morton curve.
    cell_of: Vec<u32>,
}

impl Grid {
    /// An empty grid over the box from `-half_size` to `half_size`, with cells at least `width` wide, for `ball_count` balls.
    pub fn new(half_size: DVec3, width: f64, ball_count: usize) -> Self {
        let edges = 2.0 * half_size;
        let most = (ball_count + 1) as f64;
        let counts_at = |width: f64| {
            (edges / width)
                .floor()
                .clamp(DVec3::ONE, DVec3::splat(MOST_PER_AXIS))
        };
        let mut width = width;
        while counts_at(width).element_product() > most {
            width *= 1.05;
        }
        let counts = counts_at(width);
        let width = edges / counts;
        let counts = counts.to_array().map(|count| count as u16);
        let last = counts.map(|count| count - 1);
        let mut place_of = Vec::new();
        Range {
            low: [0; 3],
            high: last,
        }
        .for_each(|place| place_of.push(place));
        let raster_of = |[x, y, z]: Place| {
            let [_, count_y, count_z] = counts.map(usize::from);
            (usize::from(x) * count_y + usize::from(y)) * count_z + usize::from(z)
        };
        place_of.sort_unstable_by_key(|&place| morton(place));
        let mut cell_of = vec![0; place_of.len()];
        for (cell, &place) in place_of.iter().enumerate() {
            cell_of[raster_of(place)] = cell as u32;
        }
        Self {
            counts,
            half_size,
            width,
            per_width: 1.0 / width,
            slack: SLACK * width.min_element(),
            cell_of,
        }
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.cell_of.len()
    }

    /// Widths of a cell \[length\].
    pub fn width(&self) -> DVec3 {
        self.width
    }

    /// The cell that holds a position; one outside the box belongs to the nearest.
    #[inline]
    pub fn cell_at(&self, position: DVec3) -> usize {
        self.cell(self.place_at(position))
    }

    #[inline]
    fn place_at(&self, position: DVec3) -> Place {
        let place = (position + self.half_size) * self.per_width;
        std::array::from_fn(|axis| (place[axis] as u16).min(self.counts[axis] - 1))
    }

    /// The number of a place on the curve.
    #[inline]
    pub fn cell(&self, [x, y, z]: Place) -> usize {
        let [_, count_y, count_z] = self.counts.map(usize::from);
        self.cell_of[(usize::from(x) * count_y + usize::from(y)) * count_z + usize::from(z)]
            as usize
    }

    /// The places that a ball of this radius reaches into on its straight way from one position to another.
    #[inline]
    pub fn reach(&self, from: DVec3, to: DVec3, radius: f64) -> Range {
        let reach = radius + self.slack;
        Range {
            low: self.place_at(from.min(to) - reach),
            high: self.place_at(from.max(to) + reach),
        }
    }
}

/// Which pieces pass through the cells of a region.
#[derive(Clone, Debug)]
pub struct Lists {
    first: usize,
    /// Pieces of cell `first + c`: `pieces[c * capacity..][..lengths[c]]`.
    pieces: Vec<u32>,
    lengths: Vec<u32>,
    capacity: usize,
}

impl Lists {
    /// Empty lists for these cells, with room for `expected` pieces in each before they must grow.
    pub fn new(cells: std::ops::Range<usize>, expected: usize) -> Self {
        let capacity = expected.next_multiple_of(16).max(32);
        Self {
            first: cells.start,
            pieces: vec![0; cells.len() * capacity],
            lengths: vec![0; cells.len()],
            capacity,
        }
    }

    /// The cells that are listed here.
    pub fn cells(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.lengths.len()
    }

    /// The pieces listed in a cell.
    #[inline]
    pub fn pieces(&self, cell: usize) -> &[u32] {
        let cell = cell - self.first;
        &self.pieces[cell * self.capacity..][..self.lengths[cell] as usize]
    }

    /// Empties all lists.
    pub fn clear(&mut self) {
        self.lengths.fill(0);
    }

    /// Lists a piece in a cell.
    #[inline]
    pub fn insert(&mut self, cell: usize, piece: u32) {
        let cell = cell - self.first;
        let length = self.lengths[cell] as usize;
        if length == self.capacity {
            self.widen();
        }
        self.pieces[cell * self.capacity + length] = piece;
        self.lengths[cell] += 1;
    }

    /// Doubles the room of every cell.
    #[cold]
    fn widen(&mut self) {
        let mut pieces = vec![0; 2 * self.pieces.len()];
        for (from, to) in self
            .pieces
            .chunks_exact(self.capacity)
            .zip(pieces.chunks_exact_mut(2 * self.capacity))
        {
            to[..self.capacity].copy_from_slice(from);
        }
        self.pieces = pieces;
        self.capacity *= 2;
    }
}

/// The bits of three numbers below 1024, interleaved.
fn morton(place: Place) -> u32 {
    let spread = |number: u16| {
        (0..10).fold(0, |bits, bit| {
            bits | (u32::from(number) >> bit & 1) << (3 * bit)
        })
    };
    spread(place[0]) << 2 | spread(place[1]) << 1 | spread(place[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_has_one_number_and_neighbours_are_near() {
        let grid = Grid::new(DVec3::new(1.0, 1.5, 0.5), 0.25, 100_000);
        assert_eq!(grid.cell_count(), 8 * 12 * 4);
        let mut cells = Vec::new();
        Range {
            low: [0; 3],
            high: [7, 11, 3],
        }
        .for_each(|place| cells.push(grid.cell(place)));
        assert_eq!(cells[..2], [0, 1]);
        cells.sort_unstable();
        assert!(cells.into_iter().eq(0..grid.cell_count()));
        assert_eq!(grid.cell_at(DVec3::new(-0.9, -1.4, -0.4)), 0);
        assert_eq!(grid.cell_at(DVec3::splat(5.0)), grid.cell([7, 11, 3]));
    }

    #[test]
    fn a_path_reaches_the_cells_between_its_ends() {
        let grid = Grid::new(DVec3::splat(1.0), 0.25, 100_000);
        let range = grid.reach(DVec3::splat(-0.9), DVec3::new(-0.3, -0.9, -0.9), 0.06);
        assert_eq!(
            range,
            Range {
                low: [0; 3],
                high: [3, 0, 0]
            }
        );
        let range = grid.reach(DVec3::splat(5.0), DVec3::splat(-5.0), 0.0);
        assert_eq!(
            range,
            Range {
                low: [0; 3],
                high: [7; 3]
            }
        );
    }
}
