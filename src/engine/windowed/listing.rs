//! Lists a region's flights in the cells that they pass in a window: the pass that reads every ball.
//!
//! Flights are taken in blocks. What cells a straight path touches is found for all flights of a block at once, without
//! branches, if it reaches into at most three cells along each axis; the few others, and those that may meet a wall, a plane or
//! a face, are put aside.

use pulp::{Arch, Simd, WithSimd};

use super::grid::{Grid, Lists, image_of, piece_of};
use super::paths::Gas;
use super::pieces::{Id, Line, NONE, Past};
use super::region::Passage;

/// Flights in a block.
const BLOCK: usize = 64;

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
    /// Number of the lowest place.
    place: [u32; BLOCK],
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
    fn with_simd<S: Simd>(self, _: S) -> &'f [Line] {
        let bounds = Bounds::new(&self.gas);
        let mut block = Block {
            position: [[0.0; BLOCK]; 3],
            velocity: [[0.0; BLOCK]; 3],
            radius: [bounds.radius; BLOCK],
            touched: [0; BLOCK],
            place: [0; BLOCK],
        };
        let targets = &self.gas.grid.targets[..];
        let [stride_x, stride_y, stride_z] = bounds.strides;
        let offsets: [u32; 32] = std::array::from_fn(|bit| {
            let step = |per: usize| (bit / per % SPAN) as u32;
            step(SPAN * SPAN) * stride_x + step(SPAN) * stride_y + step(1) * stride_z
        });
        let cells = self.lists.cells();
        let mut first = self.first as u32;
        let Flights {
            lines: all,
            radii,
            past,
            advance,
        } = self.flights;
        for (number, lines) in all.chunks_mut(BLOCK).enumerate() {
            for (lane, line) in lines.iter_mut().enumerate() {
                if line.link != NONE {
                    let past = past.line(self.gas.numbering, line.link);
                    let Line {
                        position, velocity, ..
                    } = *past;
                    (line.position, line.velocity, line.link) = (position, velocity, NONE);
                }
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
            touch(&mut block, &bounds);
            for plane in &bounds.planes {
                avoid(&mut block, *plane, bounds.slack);
            }
            for lane in 0..lines.len() {
                let mut touched = block.touched[lane];
                let id = first + lane as Id;
                if touched >= WIDE {
                    self.aside.push(id);
                    continue;
                }
                while touched != 0 {
                    let bit = touched.trailing_zeros() as usize;
                    touched &= touched - 1;
                    let target = targets[(block.place[lane] + offsets[bit]) as usize];
                    let (cell, entry) =
                        (piece_of(target) as usize, id | (target - piece_of(target)));
                    debug_assert!(image_of(target) < 27);
                    if cells.contains(&cell) {
                        self.lists.insert(cell, entry);
                    } else {
                        self.outbox.push((entry, cell as u32));
                    }
                }
            }
            first += lines.len() as u32;
        }
        all
    }
}

/// Finds the cells that the paths of a block touch.
#[inline(always)]
fn touch(block: &mut Block, bounds: &Bounds) {
    for lane in 0..BLOCK {
        // As shares of the path: when each of the cells along an axis is entered and left.
        let (mut enter, mut leave) = ([[0.0_f32; SPAN]; 3], [[0.0_f32; SPAN]; 3]);
        let mut touched = 0;
        let mut place = 0;
        let reach = block.radius[lane] + bounds.slack;
        for axis in 0..3 {
            let (from, way) = (block.position[axis][lane], block.velocity[axis][lane]);
            let to = from + way;
            let back = way < 0.0;
            let (low, high) = if back { (to, from) } else { (from, to) };
            let lower = floor(low - reach, bounds.per_edge[axis]);
            let lower = max(lower, bounds.lowest);
            let upper = floor(high + reach, bounds.per_edge[axis]);
            let upper = min(upper, bounds.highest[axis]);
            touched |= if upper - lower > SPAN as f32 - 0.5 {
                WIDE
            } else {
                0
            };
            let margin = block.radius[lane] * bounds.hard;
            let (least, most) = bounds.inside[axis];
            touched |= if low < least + margin || high > most - margin {
                NEAR_BOUNDARY
            } else {
                0
            };
            place += ((lower + 1.0 + WHOLE).to_bits() & 0xffff) * bounds.strides[axis];

            // The path begins and ends in the outermost cells, or beyond the last there are and near a boundary.
            let per_way = 1.0 / if way.abs() < 1e-30 { 1e-30 } else { way };
            let face = (lower + 1.0) * bounds.edges[axis] - from;
            let next_face = face + bounds.edges[axis];
            let near = [(face - reach) * per_way, (next_face - reach) * per_way];
            let far = [(face + reach) * per_way, (next_face + reach) * per_way];
            enter[axis] = if back {
                [far[0], far[1], -1.0]
            } else {
                [-1.0, near[0], near[1]]
            };
            leave[axis] = if back {
                [2.0, near[0], near[1]]
            } else {
                [far[0], far[1], 2.0]
            };
            let cells = upper - lower;
            enter[axis][1] = if cells > 0.5 { enter[axis][1] } else { 3.0 };
            enter[axis][2] = if cells > 1.5 { enter[axis][2] } else { 3.0 };
        }
        for x in 0..SPAN {
            let (entered, left) = (max(enter[0][x], 0.0), min(leave[0][x], 1.0));
            for y in 0..SPAN {
                let (entered, left) = (max(enter[1][y], entered), min(leave[1][y], left));
                for z in 0..SPAN {
                    let (entered, left) = (max(enter[2][z], entered), min(leave[2][z], left));
                    let bit = (x * SPAN + y) * SPAN + z;
                    touched |= if entered <= left { 1 << bit } else { 0 };
                }
            }
        }
        block.touched[lane] = touched;
        block.place[lane] = place;
    }
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

#[inline(always)]
fn floor(coordinate: f32, per_edge: f32) -> f32 {
    (coordinate * per_edge).floor()
}

#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
