//! The windowed engine's cells, and which of them a ball reaches into on its way.
//!
//! Each ball is listed in every cell that its straight path in the window reaches into, so two balls that touch in the window
//! are both in the list of the cell that holds their contact point. Cells are numbered along a Morton curve, so that cells near
//! each other in space are near each other in memory.
//!
//! Around the cells lies a layer of places one wide. In a container nothing is listed there. In a periodic box each of these
//! places is an image of a cell at the opposite face: a ball that reaches out there is listed in that cell, as its image.

use glam::DVec3;

use super::pieces::Id;
use crate::domain::{Boundary, Domain};
use crate::engine::image::{IMAGE_SHIFT, IMAGES, Seen, image_at, number_of, steps_of};

/// Margin around a ball, in cell widths: far above rounding, far below anything that costs.
pub const SLACK: f64 = 1.0 / (1 << 20) as f64;

/// Most cells along an axis: their Morton numbers interleave ten bits each, the layer around them included.
const MOST_PER_AXIS: f64 = 1022.0;

/// Side of the cube that the Morton curve fills. The longest side of the box is as long, so that half of the curve is half of it.
const CURVE_SIDE: i32 = 1024;

/// Places along an axis of a ball's way that are few.
const FEW_PLACES: i32 = 4;

/// What stands for no cell, in the layer around those of a container.
pub const NOWHERE: u32 = u32::MAX;

/// A place on the grid; the layer around the cells is at -1 and at the count of cells.
pub type Place = [i32; 3];

/// A piece of path as a cell lists it: the piece's number, and which image of it.
pub type Entry = Seen;

/// The cell that a target of the grid stands for, and how it lists a piece there.
#[inline(always)]
pub fn listed_at(target: u32, piece: Id) -> (u32, Entry) {
    let cell = number_of(target);
    (cell, piece | (target - cell))
}

/// Cells over a box.
#[derive(Clone, Debug)]
pub struct Grid {
    counts: Place,
    /// Places at which balls are listed, both ends included: with the layer around the cells in a periodic box.
    lowest: i32,
    /// See `lowest`.
    highest: Place,
    half_size: DVec3,
    /// By how much each image is moved, in grid lengths.
    shifts: [[f32; 3]; IMAGES],
    width: DVec3,
    per_width: DVec3,
    slack: f64,
    /// Grid lengths per length: the unit of the filter's coordinates is the smallest width of a cell.
    pub scale: f64,
    /// Widths of a cell, in grid lengths.
    pub edges: [f32; 3],
    /// For each place in raster order: the cell there and, as in an [`Entry`], which image of it; or [`NOWHERE`].
    pub targets: Vec<u32>,
    /// What one step along each axis adds to a place's number in raster order.
    pub strides: [u32; 3],
    /// The numbers of the cells' places in raster order.
    pub places: Vec<u32>,
    /// Centres of the cells, in grid lengths from the box's lower corner.
    centers: Vec<[f32; 3]>,
}

impl Grid {
    /// An empty grid over a domain's box, with cells at least `width` wide, for `ball_count` balls.
    pub fn new(domain: &Domain, width: f64, ball_count: usize) -> Self {
        let half_size = domain.half_size;
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
        let counts = counts.to_array().map(|count| count as i32);
        let scale = 1.0 / width.min_element();
        let periodic = domain.boundary == Boundary::Periodic;
        let margin = i32::from(periodic);

        let strides = [
            ((counts[1] + 2) * (counts[2] + 2)) as u32,
            (counts[2] + 2) as u32,
            1,
        ];
        let mut places = Vec::new();
        for x in 0..counts[0] {
            for y in 0..counts[1] {
                for z in 0..counts[2] {
                    places.push([x, y, z]);
                }
            }
        }
        let longest = counts.into_iter().fold(1, i32::max);
        let on_curve = |place: Place| morton(place.map(|cell| cell * CURVE_SIDE / longest));
        places.sort_unstable_by_key(|&place| on_curve(place));
        let edge_lengths = width * scale;
        let center = |place: &Place| {
            let center: [f64; 3] =
                std::array::from_fn(|axis| (f64::from(place[axis]) + 0.5) * edge_lengths[axis]);
            center.map(|coordinate| coordinate as f32)
        };
        let mut grid = Self {
            counts,
            lowest: -margin,
            highest: counts.map(|count| count - 1 + margin),
            half_size,
            shifts: std::array::from_fn(|image| {
                let steps = DVec3::from_array(steps_of(image).map(f64::from));
                (steps * domain.period() * scale).as_vec3().to_array()
            }),
            width,
            per_width: 1.0 / width,
            slack: SLACK * width.min_element(),
            scale,
            edges: edge_lengths.as_vec3().to_array(),
            targets: vec![NOWHERE; counts.iter().map(|&count| count as usize + 2).product()],
            strides,
            places: Vec::new(),
            centers: places.iter().map(center).collect(),
        };
        for (cell, &place) in places.iter().enumerate() {
            let at = grid.raster(place);
            grid.places.push(at as u32);
            grid.targets[at] = cell as u32;
        }
        if periodic {
            grid.link_images();
        }
        grid
    }

    /// Gives each place of the layer around the cells its cell at the opposite face.
    fn link_images(&mut self) {
        let [x, y, z] = self.highest;
        for place in
            (-1..=x).flat_map(|x| (-1..=y).flat_map(move |y| (-1..=z).map(move |z| [x, y, z])))
        {
            let mut inside = place;
            let mut steps = [0; 3];
            for axis in 0..3 {
                let count = self.counts[axis];
                // A ball beyond the upper face is seen from the cell at the lower one as moved down.
                if place[axis] < 0 {
                    (inside[axis], steps[axis]) = (place[axis] + count, 1);
                } else if place[axis] >= count {
                    (inside[axis], steps[axis]) = (place[axis] - count, -1);
                }
            }
            let at = self.raster(place);
            self.targets[at] = self.targets[self.raster(inside)] | image_at(steps) << IMAGE_SHIFT;
        }
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.centers.len()
    }

    /// Widths of a cell \[length\].
    pub fn width(&self) -> DVec3 {
        self.width
    }

    /// Largest coordinate in the box, in grid lengths.
    pub fn extent(&self) -> f64 {
        (2.0 * self.half_size * self.scale).max_element()
    }

    /// A position from the box's lower corner, in grid lengths.
    #[inline]
    pub fn to_grid(&self, position: DVec3) -> DVec3 {
        (position + self.half_size) * self.scale
    }

    /// The centre of a cell, in grid lengths from the box's lower corner.
    #[inline]
    pub fn center(&self, cell: usize) -> [f32; 3] {
        self.centers[cell]
    }

    /// By how much an image is moved, in grid lengths.
    #[inline]
    pub fn shift(&self, image: usize) -> [f32; 3] {
        self.shifts[image]
    }

    /// The cell that holds a position in grid lengths; one outside the box belongs to the nearest.
    #[inline]
    pub fn cell_at(&self, position: [f32; 3]) -> usize {
        let place = std::array::from_fn(|axis| {
            ((position[axis] / self.edges[axis]) as i32).clamp(0, self.counts[axis] - 1)
        });
        self.targets[self.raster(place)] as usize
    }

    /// The cell that holds a contact point, and which image of a piece that is there: as listed, but for the piece.
    #[inline]
    pub fn target_at(&self, position: DVec3) -> u32 {
        self.targets[self.raster(self.place_at(position))]
    }

    #[inline]
    fn place_at(&self, position: DVec3) -> Place {
        let place = (position + self.half_size) * self.per_width;
        std::array::from_fn(|axis| {
            // Rounded down without a call: what lies below -1 is clamped anyway.
            ((place[axis] + 1.0) as i32 - 1).clamp(self.lowest, self.highest[axis])
        })
    }

    #[inline]
    fn raster(&self, place: Place) -> usize {
        let [x, y, z] = place.map(|number| (number + 1) as usize);
        let [stride_x, stride_y, _] = self.strides.map(|stride| stride as usize);
        x * stride_x + y * stride_y + z
    }

    /// Visits the cells that a ball of this radius reaches into on its straight way from one position to another.
    #[inline]
    pub fn for_each_on_way(&self, from: DVec3, to: DVec3, radius: f64, mut visit: impl FnMut(u32)) {
        let reach = radius + self.slack;
        let low = self.place_at(from.min(to) - reach);
        let high = self.place_at(from.max(to) + reach);
        if low == high {
            return visit(self.targets[self.raster(low)]);
        }
        // When the ball reaches into a slab of places, as a share of the way.
        let way = to - from;
        let per_way = 1.0 / way;
        let inside = |axis: usize, number: i32| {
            if low[axis] == high[axis] || !per_way[axis].is_finite() {
                return (0.0, 1.0);
            }
            let lower = f64::from(number) * self.width[axis] - self.half_size[axis];
            let enter = (lower - reach - from[axis]) * per_way[axis];
            let leave = (lower + self.width[axis] + reach - from[axis]) * per_way[axis];
            let (enter, leave) = (enter.min(leave), enter.max(leave));
            // The outermost places reach to infinity.
            let (first, last) = if way[axis] > 0.0 {
                (low[axis], high[axis])
            } else {
                (high[axis], low[axis])
            };
            (
                if number == first { 0.0 } else { enter },
                if number == last { 1.0 } else { leave },
            )
        };
        // Those of an axis are needed again and again: where they are few, they are kept.
        let few = (0..3).all(|axis| high[axis] - low[axis] < FEW_PLACES);
        let mut kept = [[(0.0, 1.0); FEW_PLACES as usize]; 3];
        if few {
            for (axis, kept) in kept.iter_mut().enumerate() {
                for (kept, number) in kept.iter_mut().zip(low[axis]..=high[axis]) {
                    *kept = inside(axis, number);
                }
            }
        }
        let inside = |axis: usize, number: i32| {
            if few {
                kept[axis][((number - low[axis]) % FEW_PLACES) as usize]
            } else {
                inside(axis, number)
            }
        };
        let both = |a: (f64, f64), b: (f64, f64)| (a.0.max(b.0), a.1.min(b.1));
        for x in low[0]..=high[0] {
            let in_x = inside(0, x);
            for y in low[1]..=high[1] {
                let in_xy = both(in_x, inside(1, y));
                if in_xy.0 > in_xy.1 {
                    continue;
                }
                for z in low[2]..=high[2] {
                    let in_all = both(in_xy, inside(2, z));
                    if in_all.0 <= in_all.1 {
                        visit(self.targets[self.raster([x, y, z])]);
                    }
                }
            }
        }
    }
}

/// The bits of three numbers below 1024, interleaved.
fn morton(place: Place) -> u32 {
    let spread = |number: i32| {
        (0..10).fold(0, |bits, bit| {
            bits | (number.cast_unsigned() >> bit & 1) << (3 * bit)
        })
    };
    spread(place[0]) << 2 | spread(place[1]) << 1 | spread(place[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::image::{image_of, number_of};

    fn on_way(grid: &Grid, from: [f64; 3], to: [f64; 3], radius: f64) -> Vec<u32> {
        let mut cells = Vec::new();
        grid.for_each_on_way(from.into(), to.into(), radius, |cell| cells.push(cell));
        cells.sort_unstable();
        cells
    }

    #[test]
    fn every_place_has_one_number_and_neighbours_are_near() {
        let domain = Domain::container(DVec3::new(1.0, 1.5, 0.5));
        let grid = Grid::new(&domain, 0.25, 100_000);
        assert_eq!(grid.cell_count(), 8 * 12 * 4);
        let mut cells = on_way(&grid, [-9.0, -9.0, -9.0], [9.0, 9.0, 9.0], 9.0);
        assert!(cells.iter().copied().eq(0..grid.cell_count() as u32));
        cells = on_way(&grid, [-0.9, -1.4, -0.2], [-0.9, -1.4, -0.4], 0.01);
        assert_eq!(cells, [0, 1]);
        assert_eq!(grid.target_at(DVec3::new(-0.9, -1.4, -0.4)), 0);
        assert_eq!(
            grid.target_at(DVec3::splat(5.0)),
            grid.target_at(DVec3::new(0.9, 1.4, 0.4))
        );
    }

    #[test]
    fn a_path_reaches_the_cells_that_it_touches_and_no_others() {
        let grid = Grid::new(&Domain::container(DVec3::splat(1.0)), 0.25, 100_000);
        // Along an axis, through four cells.
        let cells = on_way(&grid, [-0.9, -0.9, -0.9], [-0.3, -0.9, -0.9], 0.06);
        assert_eq!(cells.len(), 4);
        // Past an edge: of the four cells around it, one is not touched.
        let cells = on_way(&grid, [-0.95, -0.85, -0.9], [-0.65, -0.6, -0.9], 0.01);
        assert_eq!(cells.len(), 3);
    }

    #[test]
    fn in_a_periodic_box_a_ball_at_a_face_is_listed_as_an_image_at_the_other() {
        let domain = Domain {
            boundary: Boundary::Periodic,
            ..Domain::container(DVec3::splat(1.0))
        };
        let grid = Grid::new(&domain, 0.25, 100_000);
        let cells = on_way(&grid, [0.95, 0.1, 0.1], [0.97, 0.1, 0.1], 0.06);
        assert_eq!(cells.len(), 2);
        let opposite = grid.target_at(DVec3::new(-0.99, 0.1, 0.1));
        assert_eq!(number_of(cells[1]), opposite);
        assert_eq!(steps_of(image_of(cells[1])), [-1, 0, 0]);
        assert_eq!(grid.shift(image_of(cells[1])), [-8.0, 0.0, 0.0]);
    }
}
