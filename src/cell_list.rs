//! A uniform grid over the box. Each ball is listed in every cell that it reaches into, so two balls that touch always
//! share a cell (the one that holds their contact point) and only balls of one cell need to be looked at together.
//!
//! What always holds: a ball's listed cells cover its reach, from its last update until it next reaches into a new cell.
//! Cells it has left are dropped at its next update; a cell listed too long costs time, never a collision. A large ball is
//! listed in many cells, so balls of very different sizes share one grid. In a periodic box cells are counted on beyond the
//! faces and stored where they wrap to; in open space the outermost cells reach to infinity.
//!
//! Idea: the dilated cells of the windowed method (derived here for event queues); it needs no neighbourhood of 27 cells, which
//! in a dilute gas, where cells are much wider than balls, leaves one or two lists to read where that scheme reads nine.

use std::marker::PhantomData;

use glam::{DVec3, IVec3};
use prefetch_index::prefetch_index;

use crate::domain::{AnyBoundary, Boundary, Domain, KnownBoundary};
use crate::event::Wall;
use crate::state::Trajectory;

/// Margin around a ball, in cell widths: far above rounding, far below anything that costs.
const SLACK: f64 = 1.0 / (1 << 20) as f64;

/// Most cells along an axis.
const MOST_PER_AXIS: f64 = 16_000.0;

/// A cell by its place along each axis; in a periodic box it may lie beyond the faces.
pub type Cell = [i16; 3];

/// A box of cells, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct CellRange {
    low: Cell,
    high: Cell,
}

impl CellRange {
    #[inline]
    fn for_each(self, mut visit: impl FnMut(Cell)) {
        for x in self.low[0]..=self.high[0] {
            for y in self.low[1]..=self.high[1] {
                for z in self.low[2]..=self.high[2] {
                    visit([x, y, z]);
                }
            }
        }
    }

    /// Visits the cells of this box that are not in `other`, as up to six boxes.
    #[inline]
    fn for_each_outside(mut self, other: Self, mut visit: impl FnMut(Cell)) {
        for axis in 0..3 {
            if self.high[axis] < other.low[axis] || other.high[axis] < self.low[axis] {
                return self.for_each(visit);
            }
            if self.low[axis] < other.low[axis] {
                let mut part = self;
                part.high[axis] = other.low[axis] - 1;
                part.for_each(&mut visit);
                self.low[axis] = other.low[axis];
            }
            if self.high[axis] > other.high[axis] {
                let mut part = self;
                part.low[axis] = other.high[axis] + 1;
                part.for_each(&mut visit);
                self.high[axis] = other.high[axis];
            }
        }
    }
}

/// The balls of one cell, as a ball that reaches into it sees them.
#[derive(Clone, Copy, Debug)]
pub struct Company<'a> {
    /// The balls, the looking one perhaps among them, some perhaps twice.
    pub balls: &'a [u32],
    /// The cell as the looking ball counts it, if balls in it may be seen at an image; `None` where none can.
    pub at_face: Option<Cell>,
}

/// Which balls reach into which cell, in a domain whose boundary is known as `B`.
#[derive(Clone, Debug)]
pub struct CellList<B = AnyBoundary> {
    boundary: Boundary,
    known: PhantomData<B>,
    cell_counts: Cell,
    half_size: DVec3,
    width: DVec3,
    per_width: DVec3,
    slack: f64,
    /// Of each cell a record of so many words: the number of its balls, and these. Side by side, because memory comes in lines.
    records: Vec<u32>,
    words: usize,
    ranges: Vec<CellRange>,
}

impl<B: KnownBoundary> CellList<B> {
    /// An empty grid over a domain's box, with cells at least `width` wide and at most `4 * ball_count + 1` in number.
    pub fn new(domain: &Domain, width: f64, ball_count: usize) -> Self {
        let edges = 2.0 * domain.half_size;
        let most = (4 * ball_count + 1) as f64;
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
        let cells = counts.element_product() as usize;
        let width = edges / counts;
        let words = (1 + 3 * ball_count / cells).next_multiple_of(16);
        Self {
            boundary: domain.boundary,
            known: PhantomData,
            cell_counts: counts.to_array().map(|count| count as i16),
            half_size: domain.half_size,
            width,
            per_width: 1.0 / width,
            slack: SLACK * width.min_element(),
            records: vec![0; cells * words],
            words,
            ranges: Vec::with_capacity(ball_count),
        }
    }

    #[inline(always)]
    fn boundary(&self) -> Boundary {
        B::of(self.boundary)
    }

    /// Smallest width of a cell \[length\].
    pub fn width(&self) -> f64 {
        self.width.min_element()
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.records.len() / self.words
    }

    /// The cells that a ball of this radius reaches into at a position.
    #[inline]
    fn range_at(&self, position: DVec3, radius: f64) -> CellRange {
        let reach = DVec3::splat(radius + self.slack);
        let cell = |corner: DVec3| {
            let place = (corner + self.half_size) * self.per_width;
            let periodic = self.boundary() == Boundary::Periodic;
            std::array::from_fn(|axis| {
                if periodic {
                    place[axis].floor() as i16
                } else {
                    (place[axis].max(0.0) as i16).min(self.cell_counts[axis] - 1)
                }
            })
        };
        CellRange {
            low: cell(position - reach),
            high: cell(position + reach),
        }
    }

    /// Adds the next ball, which gets the next index.
    pub fn push(&mut self, position: DVec3, radius: f64) {
        let ball = self.ranges.len() as u32;
        let range = self.range_at(position, radius);
        self.ranges.push(range);
        range.for_each(|cell| self.insert(cell, ball));
    }

    /// Lists a ball exactly where it now reaches, after its flight has changed.
    pub fn relocate(&mut self, ball: usize, position: DVec3, radius: f64) {
        self.replace(ball, self.range_at(position, radius), |_, _| {});
    }

    /// When a flying ball reaches into the next cell along an axis, in epochs since the flight began; `None` if there is no
    /// further cell on that axis, or if it does not move along it.
    #[inline]
    pub fn crossing(
        &self,
        ball: usize,
        trajectory: &Trajectory,
        radius: f64,
        axis: usize,
    ) -> Option<f64> {
        let range = &self.ranges[ball];
        let speed = trajectory.velocity[axis];
        let reach = radius + self.slack;
        let endless = self.boundary() == Boundary::Periodic;
        let target = if speed > 0.0 {
            if !endless && range.high[axis] == self.cell_counts[axis] - 1 {
                return None;
            }
            f64::from(range.high[axis] + 1) * self.width[axis] - self.half_size[axis] - reach
        } else {
            if (!endless && range.low[axis] == 0) || speed == 0.0 {
                return None;
            }
            f64::from(range.low[axis]) * self.width[axis] - self.half_size[axis] + reach
        };
        Some((target - trajectory.position[axis]) / speed)
    }

    /// Whether a ball reaches into the last cell before a face of the box.
    #[inline]
    pub fn is_outermost(&self, ball: usize, Wall { axis, upper }: Wall) -> bool {
        let range = &self.ranges[ball];
        if upper {
            range.high[axis] == self.cell_counts[axis] - 1
        } else {
            range.low[axis] == 0
        }
    }

    /// Lists a ball in the cells it reaches into at a crossing along `axis`, drops those it has left, and hands each new
    /// cell's company to `meet`.
    #[inline]
    pub fn cross(
        &mut self,
        ball: usize,
        (position, velocity): (DVec3, DVec3),
        radius: f64,
        axis: usize,
        meet: impl FnMut(&Self, Company),
    ) {
        let listed = self.ranges[ball];
        let mut range = self.range_at(position, radius);
        for other in 0..3 {
            // The leading side moves by counting, so that rounding can neither skip nor repeat a cell.
            let step = i16::from(other == axis);
            let (low, high) = (listed.low[other], listed.high[other]);
            if velocity[other] > 0.0 {
                range.high[other] = high + step;
                range.low[other] = range.low[other].clamp(low, high);
            } else if velocity[other] < 0.0 {
                range.low[other] = low - step;
                range.high[other] = range.high[other].clamp(low, high);
            } else {
                (range.low[other], range.high[other]) = (low, high);
            }
        }
        self.replace(ball, range, meet);
    }

    /// Visits the company in each cell that a ball is listed in.
    #[inline]
    pub fn for_each_company(&self, ball: usize, mut visit: impl FnMut(Company)) {
        self.ranges[ball].for_each(|cell| visit(self.company(cell)));
    }

    /// Visits the company in each cell that lies within a distance of a position.
    #[inline]
    pub fn for_each_company_near(
        &self,
        position: DVec3,
        distance: f64,
        mut visit: impl FnMut(Company),
    ) {
        self.range_at(position, distance)
            .for_each(|cell| visit(self.company(cell)));
    }

    /// Visits the images at which a ball listed in a cell is seen by one that counts the cell as `cell`: how many boxes to move
    /// the looking ball so that both are counted alike.
    #[inline]
    pub fn for_each_image(&self, cell: Cell, ball: u32, mut visit: impl FnMut(IVec3)) {
        let range = self.ranges[ball as usize];
        let [x, y, z] = std::array::from_fn(|axis| {
            let count = i32::from(self.cell_counts[axis]);
            let from = i32::from(range.low[axis]) - i32::from(cell[axis]);
            let to = i32::from(range.high[axis]) - i32::from(cell[axis]);
            whole_boxes(from + count - 1, count)..=whole_boxes(to, count)
        });
        for x in x {
            for y in y.clone() {
                for z in z.clone() {
                    visit(IVec3::new(x, y, z));
                }
            }
        }
    }

    /// The image of [`Self::for_each_image`] where there is just one, as nearly always; `None` where there may be several. Found
    /// without a branch that depends on the ball.
    #[inline]
    pub fn only_image(&self, cell: Cell, ball: u32) -> Option<IVec3> {
        let range = self.ranges[ball as usize];
        let mut only = true;
        let image = std::array::from_fn(|axis| {
            let count = i32::from(self.cell_counts[axis]);
            let [low, high] =
                [range.low, range.high].map(|end| i32::from(end[axis]) - i32::from(cell[axis]));
            only &= (high - low < count) & (-count <= high) & (high < 2 * count);
            i32::from(high >= count) - i32::from(high < 0)
        });
        only.then_some(IVec3::from_array(image))
    }

    /// Asks for the memory of the range of a ball.
    #[inline]
    pub fn prefetch_range(&self, ball: usize) {
        prefetch_index(&self.ranges, ball);
    }

    /// Asks for the memory of the cells of a ball, and of those it reaches into when it next crosses along an axis.
    #[inline]
    pub fn prefetch_cells(&self, ball: usize, crossing: Option<(usize, f64)>) {
        let mut range = self.ranges[ball];
        if let Some((axis, velocity)) = crossing {
            range.low[axis] -= i16::from(velocity < 0.0);
            range.high[axis] += i16::from(velocity > 0.0);
        }
        range.for_each(|cell| {
            prefetch_index(&self.records, self.place(cell) * self.words);
        });
    }

    /// Visits the company that a ball will look at: in all its cells, or in those it reaches into when it next crosses along an axis.
    #[inline]
    pub fn for_each_company_ahead(
        &self,
        ball: usize,
        crossing: Option<(usize, f64)>,
        mut visit: impl FnMut(Company),
    ) {
        let mut range = self.ranges[ball];
        if let Some((axis, velocity)) = crossing {
            let next = if velocity > 0.0 {
                range.high[axis] + 1
            } else {
                range.low[axis] - 1
            };
            (range.low[axis], range.high[axis]) = (next, next);
        }
        range.for_each(|cell| visit(self.company(cell)));
    }

    #[inline]
    fn company(&self, cell: Cell) -> Company<'_> {
        let inside = |axis: usize| 0 < cell[axis] && cell[axis] < self.cell_counts[axis] - 1;
        let at_face = self.boundary() == Boundary::Periodic && !(0..3).all(inside);
        let record = &self.records[self.place(cell) * self.words..][..self.words];
        Company {
            balls: &record[1..=record[0] as usize],
            at_face: at_face.then_some(cell),
        }
    }

    /// Moves a ball from its old cells to new ones; `entered` sees each new cell before the ball is in it.
    #[inline]
    fn replace(&mut self, ball: usize, range: CellRange, mut entered: impl FnMut(&Self, Company)) {
        let listed = self.ranges[ball];
        if listed == range {
            return;
        }
        listed.for_each_outside(range, |cell| self.remove(cell, ball as u32));
        range.for_each_outside(listed, |cell| {
            entered(self, self.company(cell));
            self.insert(cell, ball as u32);
        });
        self.ranges[ball] = range;
    }

    #[inline]
    fn place(&self, cell: Cell) -> usize {
        let [x, y, z] = std::array::from_fn(|axis| {
            let (place, count) = (cell[axis], self.cell_counts[axis]);
            (if 0 <= place && place < count {
                place
            } else {
                place.rem_euclid(count)
            }) as usize
        });
        let [_, count_y, count_z] = self.cell_counts.map(|count| count as usize);
        (x * count_y + y) * count_z + z
    }

    #[inline]
    fn record_mut(&mut self, cell: Cell) -> &mut [u32] {
        let first = self.place(cell) * self.words;
        &mut self.records[first..][..self.words]
    }

    fn insert(&mut self, cell: Cell, ball: u32) {
        let mut record = self.record_mut(cell);
        if record[0] as usize + 1 == record.len() {
            self.widen();
            record = self.record_mut(cell);
        }
        record[0] += 1;
        record[record[0] as usize] = ball;
    }

    fn remove(&mut self, cell: Cell, ball: u32) {
        let record = self.record_mut(cell);
        let last = record[0] as usize;
        let index = record[1..=last]
            .iter()
            .position(|&listed| listed == ball)
            .expect("a ball is in every cell that lists it");
        record[1 + index] = record[last];
        record[0] -= 1;
    }

    /// Doubles the room of every cell.
    #[cold]
    fn widen(&mut self) {
        self.records = widened(&self.records, self.words, 2 * self.words);
        self.words *= 2;
    }
}

/// Lists that stand side by side with so much room for each, moved to where each has more.
pub fn widened<T: Copy + Default>(lists: &[T], room: usize, more: usize) -> Vec<T> {
    let mut wide = vec![T::default(); lists.len() / room * more];
    let moves = lists.chunks_exact(room).zip(wide.chunks_exact_mut(more));
    moves.for_each(|(from, to)| to[..room].copy_from_slice(from));
    wide
}

/// Whole boxes of `count` cells in a number of cells, rounded down; seldom more than one, so seldom a division.
#[inline]
fn whole_boxes(cells: i32, count: i32) -> i32 {
    if 0 <= cells && cells < count {
        0
    } else if count <= cells && cells < 2 * count {
        1
    } else if -count <= cells && cells < 0 {
        -1
    } else {
        cells.div_euclid(count)
    }
}
