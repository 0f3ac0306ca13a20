//! A uniform grid over a container. Each ball is listed in every cell that it reaches into, so two balls that touch always
//! share a cell (the one that holds their contact point) and only balls of one cell need to be looked at together.
//!
//! What always holds: a ball's listed cells cover its reach, from its last update until it next reaches into a new cell.
//! Cells it has left are dropped at its next update; a cell listed too long costs time, never a collision.
//!
//! Idea: the dilated cells of the windowed method (derived here for event queues); it needs no neighbourhood of 27 cells, which
//! in a dilute gas, where cells are much wider than balls, leaves one or two lists to read where that scheme reads nine.

use glam::DVec3;

use crate::state::Trajectory;

/// Margin around a ball, in cell widths: far above rounding, far below anything that costs.
const SLACK: f64 = 1.0 / (1 << 20) as f64;

/// A box of cells, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellRange {
    /// Lowest cell along each axis.
    pub low: [u16; 3],
    /// Highest cell along each axis.
    pub high: [u16; 3],
}

impl CellRange {
    fn contains(&self, cell: [u16; 3]) -> bool {
        (0..3).all(|axis| self.low[axis] <= cell[axis] && cell[axis] <= self.high[axis])
    }

    fn cells(self) -> impl Iterator<Item = [u16; 3]> {
        let [x, y, z] = std::array::from_fn(|axis| self.low[axis]..=self.high[axis]);
        x.flat_map(move |x| {
            let z = z.clone();
            y.clone()
                .flat_map(move |y| z.clone().map(move |z| [x, y, z]))
        })
    }
}

/// Which balls reach into which cell.
#[derive(Clone, Debug)]
pub struct CellList {
    cell_counts: [u16; 3],
    half_size: DVec3,
    width: DVec3,
    per_width: DVec3,
    slack: f64,
    /// Balls of cell `c`: `balls[c * capacity..][..lengths[c]]`.
    balls: Vec<u32>,
    lengths: Vec<u32>,
    capacity: usize,
    ranges: Vec<CellRange>,
}

impl CellList {
    /// An empty grid over the box from `-half_size` to `half_size`, with cells at least `width` wide and at most
    /// `4 * ball_count + 1` in number.
    pub fn new(half_size: DVec3, width: f64, ball_count: usize) -> Self {
        let most_per_axis = ((4 * ball_count + 1) as f64).cbrt().max(1.0);
        let count = |axis: usize| {
            ((2.0 * half_size[axis] / width).floor()).clamp(1.0, most_per_axis.min(65_535.0)) as u16
        };
        let cell_counts: [u16; 3] = std::array::from_fn(count);
        let cells: usize = cell_counts
            .iter()
            .map(|&count| usize::from(count))
            .product();
        let width = 2.0 * half_size / DVec3::from_array(cell_counts.map(f64::from));
        let capacity = (3 * ball_count / cells).next_multiple_of(16).max(16);
        Self {
            cell_counts,
            half_size,
            width,
            per_width: 1.0 / width,
            slack: SLACK * width.min_element(),
            balls: vec![0; cells * capacity],
            lengths: vec![0; cells],
            capacity,
            ranges: Vec::with_capacity(ball_count),
        }
    }

    /// Smallest width of a cell \[length\].
    pub fn width(&self) -> f64 {
        self.width.min_element()
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.lengths.len()
    }

    /// The cells that a ball is listed in.
    #[inline]
    pub fn range(&self, ball: usize) -> CellRange {
        self.ranges[ball]
    }

    /// The cells that a ball of this radius reaches into at a position.
    #[inline]
    fn range_at(&self, position: DVec3, radius: f64) -> CellRange {
        let reach = DVec3::splat(radius + self.slack);
        let cell = |corner: DVec3| {
            let place = (corner + self.half_size) * self.per_width;
            std::array::from_fn(|axis| {
                (place[axis].max(0.0) as u16).min(self.cell_counts[axis] - 1)
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
        for cell in range.cells() {
            self.insert(cell, ball);
        }
    }

    /// Lists a ball exactly where it now reaches, after its flight has changed.
    pub fn relocate(&mut self, ball: usize, position: DVec3, radius: f64) {
        self.replace(ball, self.range_at(position, radius), |_, _| {});
    }

    /// When a flying ball reaches into the next cell along an axis, in epochs since the flight began; `None` if its next stop
    /// on that axis is the wall of the container, or if it does not move along it.
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
        let target = if speed > 0.0 {
            if range.high[axis] == self.cell_counts[axis] - 1 {
                return None;
            }
            f64::from(range.high[axis] + 1) * self.width[axis] - self.half_size[axis] - reach
        } else {
            if range.low[axis] == 0 || speed == 0.0 {
                return None;
            }
            f64::from(range.low[axis]) * self.width[axis] - self.half_size[axis] + reach
        };
        Some((target - trajectory.position[axis]) / speed)
    }

    /// Lists a ball in the cells it reaches into at a crossing along `axis`, drops those it has left, and hands each new
    /// cell's other balls to `meet`.
    #[inline]
    pub fn cross(
        &mut self,
        ball: usize,
        position: DVec3,
        velocity: DVec3,
        radius: f64,
        axis: usize,
        meet: impl FnMut(&[u32]),
    ) {
        let listed = self.ranges[ball];
        let mut range = self.range_at(position, radius);
        for other in 0..3 {
            // The leading side moves by counting, so that rounding can neither skip nor repeat a cell.
            let step = u16::from(other == axis);
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
        let mut meet = meet;
        self.replace(ball, range, |cells, place| meet(cells.balls_at(place)));
    }

    /// The balls of each cell that a ball is listed in, itself included.
    #[inline]
    pub fn companions(&self, ball: usize) -> impl Iterator<Item = &[u32]> {
        self.ranges[ball]
            .cells()
            .map(|cell| self.balls_at(self.place(cell)))
    }

    /// Moves a ball from its old cells to new ones; `entered` sees each new cell before the ball is in it.
    #[inline]
    fn replace(&mut self, ball: usize, range: CellRange, mut entered: impl FnMut(&Self, usize)) {
        let listed = self.ranges[ball];
        if listed == range {
            return;
        }
        for cell in listed.cells() {
            if !range.contains(cell) {
                self.remove(cell, ball as u32);
            }
        }
        for cell in range.cells() {
            if !listed.contains(cell) {
                entered(self, self.place(cell));
                self.insert(cell, ball as u32);
            }
        }
        self.ranges[ball] = range;
    }

    #[inline]
    fn place(&self, [x, y, z]: [u16; 3]) -> usize {
        let [_, count_y, count_z] = self.cell_counts.map(usize::from);
        (usize::from(x) * count_y + usize::from(y)) * count_z + usize::from(z)
    }

    #[inline]
    fn balls_at(&self, place: usize) -> &[u32] {
        &self.balls[place * self.capacity..][..self.lengths[place] as usize]
    }

    fn insert(&mut self, cell: [u16; 3], ball: u32) {
        let place = self.place(cell);
        if self.lengths[place] as usize == self.capacity {
            self.widen();
        }
        self.balls[place * self.capacity + self.lengths[place] as usize] = ball;
        self.lengths[place] += 1;
    }

    fn remove(&mut self, cell: [u16; 3], ball: u32) {
        let place = self.place(cell);
        let length = self.lengths[place] as usize;
        let balls = &mut self.balls[place * self.capacity..][..length];
        let index = balls
            .iter()
            .position(|&listed| listed == ball)
            .expect("a ball is in every cell that lists it");
        balls[index] = balls[length - 1];
        self.lengths[place] -= 1;
    }

    /// Doubles the room of every cell.
    #[cold]
    fn widen(&mut self) {
        let mut balls = vec![0; 2 * self.balls.len()];
        for (from, to) in self
            .balls
            .chunks_exact(self.capacity)
            .zip(balls.chunks_exact_mut(2 * self.capacity))
        {
            to[..self.capacity].copy_from_slice(from);
        }
        self.balls = balls;
        self.capacity *= 2;
    }
}
