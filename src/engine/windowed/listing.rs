//! Lists a region's flights in the cells that they pass in a window: the pass that reads every ball.
//!
//! Flights are taken in blocks. What cells a straight path touches is found for all flights of a block at once, without
//! branches, if it reaches into at most three cells along each axis; the few others, and those that may meet a wall, a plane or
//! a face, are put aside.

use pulp::{Arch, Simd, WithSimd};

use super::grid::{Grid, Lists};
use super::paths::Gas;
use super::pieces::{Id, Line, NONE, Numbering, Past};
use super::region::Passage;
use crate::engine::image::{image_of, number_of};

/// Flights in a block.
const BLOCK: usize = 64;

/// Cells of a flight's path that are written down without a branch.
const WITHOUT_BRANCHES: usize = 4;

/// How many blocks before its turn the memory for the cells of a block's flights is asked for.
const BLOCKS_AHEAD: usize = 16;

/// Most cells along an axis that are told apart.
const SPAN: usize = 3;

/// Bit of a path that reaches into more cells than that along an axis; the bits below it stand for cells.
const WIDE: u32 = 1 << CUBE;

/// Cells of which a path may touch each.
const CUBE: usize = SPAN * SPAN * SPAN;

/// Bit of a path that may meet what bounds the domain.
const NEAR_BOUNDARY: u32 = WIDE << 1;

/// Added to a small whole number, it leaves the number in the low bits.
const WHOLE: f32 = 8_388_608.0;

/// What the pass knows of the domain, in grid lengths.
struct Bounds {
    /// How far beyond its centre a ball is listed, but for its radius.
    slack: f32,
    /// Every ball's radius, if all are alike.
    radius: f32,
    lowest: f32,
    highest: [f32; 3],
    edges: [f32; 3],
    per_edge: [f32; 3],
    strides: [u32; 3],
    /// Coordinates between which the centre of a ball without radius meets nothing, for each axis.
    inside: [(f32, f32); 3],
    /// Whether a ball meets a face with its surface.
    hard: f32,
    /// Normals and offsets.
    planes: Vec<([f32; 3], f32)>,
}

impl Bounds {
    fn new(gas: &Gas) -> Self {
        let Grid {
            lowest,
            highest,
            edges,
            scale,
            strides,
            ..
        } = *gas.grid;
        let domain = &gas.state.domain;
        let slack = gas.slack as f32;
        let size = (2.0 * domain.half_size * scale).as_vec3().to_array();
        let plane = |plane: &crate::domain::Plane| {
            let offset = plane.offset + plane.normal.dot(domain.half_size);
            (plane.normal.as_vec3().to_array(), (offset * scale) as f32)
        };
        Self {
            slack,
            radius: (gas.state.bodies.largest_radius() * scale) as f32,
            lowest: lowest as f32,
            highest: highest.map(|place| place as f32),
            edges,
            per_edge: edges.map(|edge| 1.0 / edge),
            strides,
            inside: size.map(|size| (slack, size - slack)),
            hard: if gas.is_periodic() { 0.0 } else { 1.0 },
            planes: domain.planes.iter().map(plane).collect(),
        }
    }
}

/// A block of flights.
struct Block {
    position: [[f32; BLOCK]; 3],
    velocity: [[f32; BLOCK]; 3],
    radius: [f32; BLOCK],
    /// Which of the cells from the lowest on are touched; or why that is not known.
    touched: [u32; BLOCK],
    /// The lowest place along each axis.
    lower: [[f32; BLOCK]; 3],
    /// Its number.
    place: [u32; BLOCK],
}

/// Which flights of a block left the last window along another piece.
struct Turned {
    lanes: [u8; BLOCK],
    count: usize,
}

impl Turned {
    /// Finds them among a block's lines and asks for the memory of their pieces.
    #[inline(always)]
    fn read_ahead(lines: &[Line], past: &Past, numbering: Numbering) -> Self {
        let mut turned = Self {
            lanes: [0; BLOCK],
            count: 0,
        };
        for (lane, line) in lines.iter().enumerate().take(BLOCK) {
            turned.lanes[turned.count] = lane as u8;
            turned.count += usize::from(line.link != NONE);
        }
        for &lane in turned.lanes() {
            past.read_ahead(numbering, lines[lane as usize].link);
        }
        turned
    }

    #[inline(always)]
    fn lanes(&self) -> &[u8] {
        &self.lanes[..self.count]
    }
}

/// A region's flights.
pub struct Flights<'a> {
    /// Their lines.
    pub lines: &'a mut [Line],
    /// Their radii in grid lengths, if not all are alike.
    pub radii: &'a [f32],
    /// The pieces with which balls left the last window.
    pub past: &'a Past,
    /// One to move all on by a window, zero if they are at its beginning.
    pub advance: f32,
}

/// The pass through a region's flights.
pub struct Listing<'a, 'f> {
    /// What all threads read.
    pub gas: Gas<'a>,
    /// Index of the first flight.
    pub first: usize,
    /// The flights.
    pub flights: Flights<'f>,
    /// Where flights are listed.
    pub lists: &'a mut Lists,
    /// Passages through other regions' cells.
    pub outbox: &'a mut Vec<Passage>,
    /// Receives flights that need a closer look.
    pub aside: &'a mut Vec<u32>,
}

impl<'f> Listing<'_, 'f> {
    /// Moves all flights to the window's beginning and lists them. Gives back their lines.
    pub fn run(self, machine: Arch) -> &'f [Line] {
        machine.dispatch(self)
    }
}

impl<'f> WithSimd for Listing<'_, 'f> {
    type Output = &'f [Line];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> &'f [Line] {
        let bounds = Bounds::new(&self.gas);
        let mut block = Block {
            position: [[0.0; BLOCK]; 3],
            velocity: [[0.0; BLOCK]; 3],
            radius: [bounds.radius; BLOCK],
            touched: [0; BLOCK],
            lower: [[0.0; BLOCK]; 3],
            place: [0; BLOCK],
        };
        let targets = &self.gas.grid.targets[..];
        let [stride_x, stride_y, stride_z] = bounds.strides;
        let offsets: [u32; 32] = std::array::from_fn(|bit| {
            let step = |per: usize| (bit / per % SPAN) as u32;
            step(SPAN * SPAN) * stride_x + step(SPAN) * stride_y + step(1) * stride_z
        });
        let mut tails = self.lists.tails();
        let cells = tails.cells();
        let mut first = self.first as u32;
        let Flights {
            lines: all,
            radii,
            past,
            advance,
        } = self.flights;
        let blocks = all.len().div_ceil(BLOCK);
        // About where a block's flights are.
        let cell_of = |block: usize| cells.start + cells.len() * block / blocks;
        let read_ahead = |lines: &[Line]| {
            let lines = &lines[..BLOCK.min(lines.len())];
            Turned::read_ahead(lines, past, self.gas.numbering)
        };
        let mut next_turned = read_ahead(all);
        let mut passages = [(0, 0); BLOCK * CUBE + WITHOUT_BRANCHES];
        for number in 0..blocks {
            let (_, lines) = all.split_at_mut(number * BLOCK);
            let (lines, next) = lines.split_at_mut(BLOCK.min(lines.len()));
            let turned = std::mem::replace(&mut next_turned, read_ahead(next));
            for cell in cell_of(number + BLOCKS_AHEAD)..cell_of(number + BLOCKS_AHEAD + 1) {
                tails.read_ahead(cell);
            }
            for &lane in turned.lanes() {
                let line = &mut lines[lane as usize];
                let past = past.line(self.gas.numbering, line.link);
                let Line {
                    position, velocity, ..
                } = *past;
                (line.position, line.velocity, line.link) = (position, velocity, NONE);
            }
            for (lane, line) in lines.iter_mut().enumerate().take(BLOCK) {
                for axis in 0..3 {
                    line.position[axis] += line.velocity[axis] * advance;
                    block.position[axis][lane] = line.position[axis];
                    block.velocity[axis][lane] = line.velocity[axis];
                }
            }
            if !radii.is_empty() {
                let radii = &radii[number * BLOCK..][..lines.len()];
                block.radius[..lines.len()].copy_from_slice(radii);
            }
            touch(simd, &mut block, &bounds);
            for plane in &bounds.planes {
                avoid(&mut block, *plane, bounds.slack);
            }
            let mut count = 0;
            for lane in 0..lines.len() {
                let mut touched = block.touched[lane];
                let id = first + lane as Id;
                if touched >= WIDE {
                    self.aside.push(id);
                    continue;
                }
                // How many cells it is cannot be foreseen: most flights are done in so many steps without a branch.
                for step in 0.. {
                    if step >= WITHOUT_BRANCHES && touched == 0 {
                        break;
                    }
                    let bit = touched.trailing_zeros() as usize % offsets.len();
                    passages[count] = (block.place[lane] + offsets[bit], id);
                    count += usize::from(touched != 0);
                    touched &= touched.wrapping_sub(1);
                }
            }
            for &(place, id) in &passages[..count] {
                let target = targets[place as usize];
                let (cell, entry) = (
                    number_of(target) as usize,
                    id | (target - number_of(target)),
                );
                debug_assert!(image_of(target) < 27);
                if cells.contains(&cell) {
                    if !tails.insert(cell, entry) {
                        self.lists.widen();
                        tails = self.lists.tails();
                        tails.insert(cell, entry);
                    }
                } else {
                    self.outbox.push((entry, cell as u32));
                }
            }
            first += lines.len() as u32;
        }
        all
    }
}

/// Finds the cells that the paths of a block touch.
#[inline(always)]
fn touch<S: Simd>(simd: S, block: &mut Block, bounds: &Bounds) {
    let lanes = size_of::<S::f32s>() / size_of::<f32>();
    for vector in 0..BLOCK / lanes {
        touch_vector(simd, block, bounds, vector);
    }
    for lane in 0..BLOCK {
        let place = |axis: usize| {
            let lower = block.lower[axis][lane] + 1.0 + WHOLE;
            (lower.to_bits() & 0xffff) * bounds.strides[axis]
        };
        block.place[lane] = place(0) + place(1) + place(2);
    }
}

/// Finds the cells that as many paths touch as a vector holds; `vector` says which of the block's.
#[inline(always)]
fn touch_vector<S: Simd>(simd: S, block: &mut Block, bounds: &Bounds, vector: usize) {
    let all = |value: f32| simd.splat_f32s(value);
    let zero = all(0.0);
    let bit =
        |mask: S::m32s, bit: u32| simd.select_u32s(mask, simd.splat_u32s(bit), simd.splat_u32s(0));
    // As shares of the path: when each of the cells along an axis is entered and left.
    let (mut enter, mut leave) = ([[zero; SPAN]; 3], [[zero; SPAN]; 3]);
    let mut touched = simd.splat_u32s(0);
    let radius = S::as_simd_f32s(&block.radius).0[vector];
    let reach = simd.add_f32s(radius, all(bounds.slack));
    let margin = simd.mul_f32s(radius, all(bounds.hard));
    for axis in 0..3 {
        let from = S::as_simd_f32s(&block.position[axis]).0[vector];
        let way = S::as_simd_f32s(&block.velocity[axis]).0[vector];
        let to = simd.add_f32s(from, way);
        let back = simd.less_than_f32s(way, zero);
        let (low, high) = (
            simd.select_f32s(back, to, from),
            simd.select_f32s(back, from, to),
        );
        let per_edge = all(bounds.per_edge[axis]);
        let cell = |place: S::f32s| floor(simd, simd.mul_f32s(place, per_edge));
        let lower = simd.max_f32s(cell(simd.sub_f32s(low, reach)), all(bounds.lowest));
        let upper = cell(simd.add_f32s(high, reach));
        let upper = simd.min_f32s(upper, all(bounds.highest[axis]));
        let cells = simd.sub_f32s(upper, lower);
        let wide = simd.greater_than_f32s(cells, all(SPAN as f32 - 0.5));
        touched = simd.or_u32s(touched, bit(wide, WIDE));
        let (least, most) = bounds.inside[axis];
        let below = simd.less_than_f32s(low, simd.add_f32s(all(least), margin));
        let above = simd.greater_than_f32s(high, simd.sub_f32s(all(most), margin));
        let near = simd.or_m32s(below, above);
        touched = simd.or_u32s(touched, bit(near, NEAR_BOUNDARY));
        S::as_mut_simd_f32s(&mut block.lower[axis]).0[vector] = lower;

        // The path begins and ends in the outermost cells, or beyond the last there are and near a boundary.
        let least = all(1e-30);
        let rests = simd.less_than_f32s(simd.abs_f32s(way), least);
        let per_way = simd.div_f32s(all(1.0), simd.select_f32s(rests, least, way));
        let edge = all(bounds.edges[axis]);
        let face = simd.mul_f32s(simd.add_f32s(lower, all(1.0)), edge);
        let face = simd.sub_f32s(face, from);
        let next_face = simd.add_f32s(face, edge);
        let share = |way: S::f32s| simd.mul_f32s(way, per_way);
        let near = [face, next_face].map(|face| share(simd.sub_f32s(face, reach)));
        let far = [face, next_face].map(|face| share(simd.add_f32s(face, reach)));
        let turned =
            |back_value: S::f32s, value: S::f32s| simd.select_f32s(back, back_value, value);
        let never = all(3.0);
        let from_cell = |count: f32, entered: S::f32s| {
            let reached = simd.greater_than_f32s(cells, all(count));
            simd.select_f32s(reached, entered, never)
        };
        enter[axis] = [
            turned(far[0], all(-1.0)),
            from_cell(0.5, turned(far[1], near[0])),
            from_cell(1.5, turned(all(-1.0), near[1])),
        ];
        leave[axis] = [
            turned(all(2.0), far[0]),
            turned(near[0], far[1]),
            turned(near[1], all(2.0)),
        ];
    }
    for x in 0..SPAN {
        let (entered, left) = (
            simd.max_f32s(enter[0][x], zero),
            simd.min_f32s(leave[0][x], all(1.0)),
        );
        for y in 0..SPAN {
            let (entered, left) = (
                simd.max_f32s(enter[1][y], entered),
                simd.min_f32s(leave[1][y], left),
            );
            for z in 0..SPAN {
                let (entered, left) = (
                    simd.max_f32s(enter[2][z], entered),
                    simd.min_f32s(leave[2][z], left),
                );
                let passes = simd.less_than_or_equal_f32s(entered, left);
                touched = simd.or_u32s(touched, bit(passes, 1 << ((x * SPAN + y) * SPAN + z)));
            }
        }
    }
    S::as_mut_simd_u32s(&mut block.touched).0[vector] = touched;
}

/// Marks the paths of a block that may meet a plane.
#[inline(always)]
fn avoid(block: &mut Block, (normal, offset): ([f32; 3], f32), slack: f32) {
    for lane in 0..BLOCK {
        let along = |vector: &[[f32; BLOCK]; 3]| {
            vector[0][lane] * normal[0] + vector[1][lane] * normal[1] + vector[2][lane] * normal[2]
        };
        let before = along(&block.position) - offset;
        let after = before + along(&block.velocity);
        let margin = block.radius[lane] + 8.0 * slack;
        let clear = (before > margin && after > margin) || (before < -margin && after < -margin);
        block.touched[lane] |= if clear { 0 } else { NEAR_BOUNDARY };
    }
}

/// The largest whole number that is no larger; of what lies beyond four million, some number beyond that.
#[inline(always)]
fn floor<S: Simd>(simd: S, place: S::f32s) -> S::f32s {
    // In its neighbourhood numbers have no digits after the point.
    let whole = simd.splat_f32s(1.5 * WHOLE);
    let nearest = simd.sub_f32s(simd.add_f32s(place, whole), whole);
    let one_less = simd.sub_f32s(nearest, simd.splat_f32s(1.0));
    simd.select_f32s(simd.greater_than_f32s(nearest, place), one_less, nearest)
}

#[cfg(test)]
mod tests {
    use pulp::{Scalar, Scalar128b, Scalar256b, Scalar512b};
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    const EDGES: [f32; 3] = [1.0, 1.1, 0.9];

    fn bounds() -> Bounds {
        Bounds {
            slack: 1e-4,
            radius: 0.1,
            lowest: -1.0,
            highest: [10.0; 3],
            edges: EDGES,
            per_edge: EDGES.map(|edge| 1.0 / edge),
            strides: [144, 12, 1],
            inside: EDGES.map(|edge| (1e-4, 10.0 * edge - 1e-4)),
            hard: 1.0,
            planes: Vec::new(),
        }
    }

    fn touched<S: Simd>(
        simd: S,
        positions: &[[f32; BLOCK]; 3],
        velocities: &[[f32; BLOCK]; 3],
    ) -> Block {
        let mut block = Block {
            position: *positions,
            velocity: *velocities,
            radius: [0.1; BLOCK],
            touched: [0; BLOCK],
            lower: [[0.0; BLOCK]; 3],
            place: [0; BLOCK],
        };
        touch(simd, &mut block, &bounds());
        block
    }

    #[test]
    fn vectors_of_every_width_list_a_path_wherever_it_comes() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
        for _ in 0..20 {
            let mut draw = |from: f32, to: f32| {
                std::array::from_fn(|_| std::array::from_fn(|_| random.random_range(from..to)))
            };
            let (positions, velocities) = (draw(1.7, 7.0), draw(-1.4, 1.4));
            let one = touched(Scalar, &positions, &velocities);
            let others = [
                touched(Scalar128b, &positions, &velocities),
                touched(Scalar256b, &positions, &velocities),
                touched(Scalar512b, &positions, &velocities),
            ];
            for other in others {
                assert_eq!((one.touched, one.place), (other.touched, other.place));
            }
            for lane in 0..BLOCK {
                assert_eq!(one.touched[lane] & NEAR_BOUNDARY, 0);
                if one.touched[lane] & WIDE != 0 {
                    continue;
                }
                for step in 0..=100 {
                    let cell = [0, 1, 2].map(|axis| {
                        let way = velocities[axis][lane] * step as f32 / 100.0;
                        ((positions[axis][lane] + way) / EDGES[axis]).floor()
                    });
                    let [x, y, z] =
                        [0, 1, 2].map(|axis| (cell[axis] - one.lower[axis][lane]) as usize);
                    let bit = (x * SPAN + y) * SPAN + z;
                    assert_ne!(
                        one.touched[lane] >> bit & 1,
                        0,
                        "{positions:?} {velocities:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn whole_numbers_are_those_below() {
        for place in [
            -1.5_f32,
            -1.0,
            -0.25,
            0.0,
            0.5,
            0.999_999_94,
            1.0,
            7.5,
            65_535.996,
        ] {
            assert_eq!(floor(Scalar, place), place.floor());
        }
    }
}
