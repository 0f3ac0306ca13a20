//! Which cells the paths of a block of flights touch, found for many at a time and without branches.

use pulp::Simd;
#[cfg(target_arch = "x86_64")]
use pulp::bytemuck;

use super::grid::Grid;
use super::paths::Gas;
use super::pieces::Line;
use crate::engine::turn::{SIDE, turn};
#[cfg(target_arch = "x86_64")]
use crate::engine::turn::{as_v3, as_v4};

/// Flights in a block.
pub const BLOCK: usize = 64;

/// Parts of a block that are turned one by one.
pub const PARTS: usize = BLOCK / SIDE;

/// Most cells along an axis that are told apart.
const SPAN: usize = 3;

/// Bit of a path that reaches into more cells than that along an axis; the bits below it stand for cells.
pub const WIDE: u32 = 1 << CUBE;

/// Cells of which a path may touch each.
pub const CUBE: usize = SPAN * SPAN * SPAN;

/// Bit of a path that may meet what bounds the domain.
pub const NEAR_BOUNDARY: u32 = WIDE << 1;

/// The bits from here on say along which axes a path goes back, `x` first.
const BACK_SHIFT: u32 = CUBE as u32 + 2;

/// Added to a small whole number, it leaves the number in the low bits.
const WHOLE: f32 = 8_388_608.0;

/// What the pass knows of the domain, in grid lengths.
pub struct Bounds {
    /// How far beyond its centre a ball is listed, but for its radius.
    pub slack: f32,
    /// Every ball's radius, if all are alike.
    pub radius: f32,
    edges: [f32; 3],
    per_edge: [f32; 3],
    pub strides: [u32; 3],
    /// Coordinates between which the centre of a ball without radius meets nothing, for each axis.
    inside: [(f32, f32); 3],
    /// Whether a ball meets a face with its surface.
    hard: f32,
    /// One if a ball is listed along its path; zero if it is listed where it begins, as far around as it may get.
    sweep: f32,
}

impl Bounds {
    /// Of the domain of a gas.
    pub fn new(gas: &Gas) -> Self {
        let Grid {
            edges,
            scale,
            strides,
            ..
        } = *gas.grid;
        let domain = &gas.state.domain;
        let slack = (gas.slack + gas.drift.unwrap_or(0.0)) as f32;
        let size = (2.0 * domain.half_size * scale).as_vec3().to_array();
        Self {
            slack,
            radius: (gas.state.bodies.largest_radius() * scale) as f32,
            edges,
            per_edge: edges.map(|edge| 1.0 / edge),
            strides,
            inside: size.map(|size| (slack, size - slack)),
            hard: if gas.is_periodic() { 0.0 } else { 1.0 },
            sweep: if gas.drift.is_some() { 0.0 } else { 1.0 },
        }
    }
}

/// Normals and offsets of the domain's planes, in grid lengths.
pub fn planes(gas: &Gas) -> Vec<([f32; 3], f32)> {
    let domain = &gas.state.domain;
    let plane = |plane: &crate::domain::Plane| {
        let offset = plane.offset + plane.normal.dot(domain.half_size);
        let offset = (offset * gas.grid.scale) as f32;
        (plane.normal.as_vec3().to_array(), offset)
    };
    domain.planes.iter().map(plane).collect()
}

/// A block of flights.
pub struct Block {
    position: [[f32; BLOCK]; 3],
    velocity: [[f32; BLOCK]; 3],
    /// Which balls they are, and their links, as bits.
    others: [[f32; BLOCK]; 2],
    pub radius: [f32; BLOCK],
    /// Which cells are touched, from the first one along each axis on the way: in the lowest of [`CUBE`] bits the first, in the
    /// next one the next along `z`. Or why that is not known. And which way the path goes.
    pub touched: [u32; BLOCK],
    /// The first place along each axis on the way.
    first: [[f32; BLOCK]; 3],
    /// Its number.
    pub place: [u32; BLOCK],
}

impl Block {
    /// Of balls of this radius, if all are alike.
    pub fn new(radius: f32) -> Self {
        Self {
            position: [[0.0; BLOCK]; 3],
            velocity: [[0.0; BLOCK]; 3],
            others: [[0.0; BLOCK]; 2],
            radius: [radius; BLOCK],
            touched: [0; BLOCK],
            first: [[0.0; BLOCK]; 3],
            place: [0; BLOCK],
        }
    }

    /// Takes in some flights.
    #[inline(always)]
    pub fn read<S: Simd>(&mut self, simd: S, part: usize, lines: &[Line; SIDE]) {
        let [a, b, c, d, e, f, g, h] = lines;
        let columns = turn(simd, [a.0, b.0, c.0, d.0, e.0, f.0, g.0, h.0]);
        for (column, values) in self.columns().zip(columns) {
            column[part * SIDE..][..SIDE].copy_from_slice(&values);
        }
    }

    /// Gives them back.
    #[inline(always)]
    pub fn write<S: Simd>(&mut self, simd: S, part: usize, lines: &mut [Line; SIDE]) {
        let mut columns = [[0.0; SIDE]; SIDE];
        for (values, column) in columns.iter_mut().zip(self.columns()) {
            values.copy_from_slice(&column[part * SIDE..][..SIDE]);
        }
        for (line, row) in lines.iter_mut().zip(turn(simd, columns)) {
            line.0 = row;
        }
    }

    /// Which ball one of the flights is of.
    #[inline(always)]
    pub fn ball(&self, lane: usize) -> u32 {
        self.others[0][lane].to_bits()
    }

    /// The columns of lines.
    #[inline(always)]
    fn columns(&mut self) -> impl Iterator<Item = &mut [f32; BLOCK]> {
        let moving = self.position.iter_mut().chain(&mut self.velocity);
        moving.chain(&mut self.others)
    }
}

/// For each way that a path can go, for each bit of a cell it touches: how much farther that cell's place is than the first one's.
#[derive(Clone, Debug)]
pub struct Offsets([[u32; u32::BITS as usize]; 8]);

impl Offsets {
    /// On a grid with these strides.
    pub fn new(strides: [u32; 3]) -> Self {
        let offset = |way: usize, bit: usize| {
            let steps = [bit / (SPAN * SPAN), bit / SPAN % SPAN, bit % SPAN];
            (0..3).fold(0_u32, |sum, axis| {
                let step = steps[axis] as u32 * strides[axis];
                let back = way >> axis & 1 == 1;
                sum.wrapping_add(if back { step.wrapping_neg() } else { step })
            })
        };
        Self(std::array::from_fn(|way| {
            std::array::from_fn(|bit| offset(way, bit))
        }))
    }

    /// Those of paths that go the way that a path's bits say.
    #[inline(always)]
    pub fn of_way(&self, touched: u32) -> &[u32; u32::BITS as usize] {
        &self.0[(touched >> BACK_SHIFT) as usize]
    }
}

/// Moves the first so many flights of a block on by so many windows and finds the cells that their paths touch.
#[inline(always)]
pub fn touch<S: Simd>(simd: S, block: &mut Block, bounds: &Bounds, advance: f32, count: usize) {
    let lanes = size_of::<S::f32s>() / size_of::<f32>();
    for vector in 0..count.div_ceil(lanes) {
        touch_vector(simd, block, bounds, vector, advance);
    }
    for lane in 0..count {
        let place = |axis: usize| {
            let first = block.first[axis][lane] + 1.0 + WHOLE;
            (first.to_bits() & 0xffff) * bounds.strides[axis]
        };
        block.place[lane] = place(0) + place(1) + place(2);
    }
}

/// When a path enters and leaves some things in a row, as shares of the path.
type Span<S> = (<S as Simd>::f32s, <S as Simd>::f32s);

/// Does so for as many flights as a vector holds; `vector` says which of the block's.
///
/// A path that goes back along an axis is looked at in a mirror: there it goes forth, through places with the numbers
/// `-1 - place`.
#[inline(always)]
fn touch_vector<S: Simd>(simd: S, block: &mut Block, bounds: &Bounds, vector: usize, advance: f32) {
    let all = |value: f32| simd.splat_f32s(value);
    let (zero, one) = (all(0.0), all(1.0));
    let bits = |mask: S::m32s, bits: u32| {
        simd.select_u32s(mask, simd.splat_u32s(bits), simd.splat_u32s(0))
    };
    let radius = S::as_simd_f32s(&block.radius).0[vector];
    let reach = simd.add_f32s(radius, all(bounds.slack));
    let mut inside: [[Span<S>; SPAN]; 3] = [[(zero, one); SPAN]; 3];
    let mut most_cells = zero;
    let mut beyond = all(f32::MIN);
    let mut ways = simd.splat_u32s(0);
    for (axis, inside) in inside.iter_mut().enumerate() {
        let way = S::as_simd_f32s(&block.velocity[axis]).0[vector];
        let from = S::as_simd_f32s(&block.position[axis]).0[vector];
        let from = simd.add_f32s(from, simd.mul_f32s(way, all(advance)));
        S::as_mut_simd_f32s(&mut block.position[axis]).0[vector] = from;
        let way = simd.mul_f32s(way, all(bounds.sweep));
        let to = simd.add_f32s(from, way);
        let (least, most) = bounds.inside[axis];
        let below = simd.sub_f32s(all(least), simd.min_f32s(from, to));
        let above = simd.sub_f32s(simd.max_f32s(from, to), all(most));
        beyond = simd.max_f32s(beyond, simd.max_f32s(below, above));

        let back = simd.less_than_f32s(way, zero);
        ways = simd.or_u32s(ways, bits(back, 1 << (BACK_SHIFT + axis as u32)));
        let from = simd.select_f32s(back, simd.neg_f32s(from), from);
        let way = simd.abs_f32s(way);
        let (edge, per_edge) = (all(bounds.edges[axis]), all(bounds.per_edge[axis]));
        let place = |at: S::f32s| floor(simd, simd.mul_f32s(at, per_edge));
        let first = place(simd.sub_f32s(from, reach));
        let last = place(simd.add_f32s(simd.add_f32s(from, way), reach));
        most_cells = simd.max_f32s(most_cells, simd.sub_f32s(last, first));
        let mirrored = simd.sub_f32s(all(-1.0), first);
        S::as_mut_simd_f32s(&mut block.first[axis]).0[vector] =
            simd.select_f32s(back, mirrored, first);

        let per_way = simd.div_f32s(one, simd.max_f32s(way, all(1e-30)));
        let face = simd.sub_f32s(simd.mul_f32s(simd.add_f32s(first, one), edge), from);
        let next_face = simd.add_f32s(face, edge);
        let enter = |face: S::f32s| {
            let share = simd.mul_f32s(simd.sub_f32s(face, reach), per_way);
            simd.max_f32s(share, zero)
        };
        let leave = |face: S::f32s| {
            let share = simd.mul_f32s(simd.add_f32s(face, reach), per_way);
            simd.min_f32s(share, one)
        };
        *inside = [
            (zero, leave(face)),
            (enter(face), leave(next_face)),
            (enter(next_face), one),
        ];
    }
    let both = |one: Span<S>, other: Span<S>| {
        (simd.max_f32s(one.0, other.0), simd.min_f32s(one.1, other.1))
    };
    let mut touched = simd.splat_u32s(0);
    // The first cell's bit comes last.
    for in_x in inside[0].into_iter().rev() {
        for in_y in inside[1].into_iter().rev() {
            let in_xy = both(in_x, in_y);
            for in_z in inside[2].into_iter().rev() {
                let (entered, left) = both(in_xy, in_z);
                let passes = simd.less_than_or_equal_f32s(entered, left);
                touched = simd.add_u32s(touched, touched);
                touched = simd.sub_u32s(touched, bits(passes, u32::MAX));
            }
        }
    }
    let wide = simd.greater_than_f32s(most_cells, all(SPAN as f32 - 0.5));
    touched = simd.or_u32s(touched, bits(wide, WIDE));
    let margin = simd.mul_f32s(radius, all(-bounds.hard));
    let near = simd.greater_than_f32s(beyond, margin);
    touched = simd.or_u32s(touched, bits(near, NEAR_BOUNDARY));
    S::as_mut_simd_u32s(&mut block.touched).0[vector] = simd.or_u32s(touched, ways);
}

/// Marks the paths of a block that may meet a plane.
#[inline(always)]
pub fn avoid(block: &mut Block, (normal, offset): ([f32; 3], f32), slack: f32) {
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
    #[cfg(target_arch = "x86_64")]
    if let Some(v3) = as_v3(simd) {
        return bytemuck::cast(v3.avx._mm256_floor_ps(bytemuck::cast(place)));
    }
    #[cfg(target_arch = "x86_64")]
    if let Some(v4) = as_v4(simd) {
        // To no digits after the point, downwards.
        const DOWN: i32 = 0b0000_1001;
        return bytemuck::cast(
            v4.avx512f
                ._mm512_roundscale_ps::<DOWN>(bytemuck::cast(place)),
        );
    }
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
            edges: EDGES,
            per_edge: EDGES.map(|edge| 1.0 / edge),
            strides: [144, 12, 1],
            inside: EDGES.map(|edge| (1e-4, 10.0 * edge - 1e-4)),
            hard: 1.0,
            sweep: 1.0,
        }
    }

    fn touched<S: Simd>(
        simd: S,
        positions: &[[f32; BLOCK]; 3],
        velocities: &[[f32; BLOCK]; 3],
    ) -> Block {
        let mut block = Block::new(0.1);
        (block.position, block.velocity) = (*positions, *velocities);
        touch(simd, &mut block, &bounds(), 0.0, BLOCK);
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
                let offsets = Offsets::new(bounds().strides);
                let offsets = offsets.of_way(one.touched[lane]);
                let cells = (0..CUBE).filter(|bit| one.touched[lane] >> bit & 1 == 1);
                let places: Vec<u32> = cells
                    .map(|bit| one.place[lane].wrapping_add(offsets[bit]))
                    .collect();
                for step in 0..=100 {
                    let place: u32 = (0..3)
                        .map(|axis| {
                            let way = velocities[axis][lane] * step as f32 / 100.0;
                            let cell = ((positions[axis][lane] + way) / EDGES[axis]).floor();
                            (cell as u32 + 1) * bounds().strides[axis]
                        })
                        .sum();
                    assert!(places.contains(&place), "{positions:?} {velocities:?}");
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
