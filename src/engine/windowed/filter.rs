//! Which pieces of one cell can meet at all: a conservative test in f32, many pairs at a time.
//!
//! The filter never rejects a pair that the exact prediction ([`crate::collision::pair_time`]) accepts; it lets some through that
//! the exact test then rejects, so how wide the machine's vectors are changes the cost and never a collision. Its margins are
//! derived from the rounding of f32 at the largest coordinates and velocities it sees.
//!
//! All is in grid lengths and windows: the window lasts from time 0 to time 1.

use std::any::Any;

#[cfg(target_arch = "x86_64")]
use pulp::x86::V3;
use pulp::{Arch, Simd, WithSimd, bytemuck};

use super::pieces::Line;
use super::sheet::{LANES, Sheet};

/// Share of `|r|^2 |v|^2` by which f32 rounding can change `(r . v)^2 - |v|^2 |r|^2`: some twenty roundings of 2^-24 each at
/// the most, with a margin.
const ROUNDING: f64 = 2.5e-6;

/// Rounding of the times `r . v / v^2`, as a share of `|r| / |v|`: some four roundings of 2^-24, with a margin.
const TIME_ROUNDING: f32 = 1e-6;

/// The filter.
#[derive(Clone, Debug)]
pub struct Filter {
    machine: Arch,
    /// Vectors with hits: row, chunk of columns, lanes.
    hits: Vec<u64>,
    margins: Margins,
    /// Largest distance of a contact point, as seen here, from the middle.
    off_middle: f32,
    contact_squared: f32,
}

/// What the filter's margins are made from, in grid lengths.
#[derive(Clone, Copy, Debug, Default)]
pub struct Margins {
    /// Largest contact distance.
    pub contact: f64,
    /// Largest distance of a contact point from the middle between the two centres.
    pub off_middle: f64,
    /// By how much a position may be wrong.
    pub position: f64,
    /// Widths of a cell.
    pub edges: [f32; 3],
    /// Largest component of any piece's velocity.
    pub fastest: f32,
}

impl Default for Filter {
    fn default() -> Self {
        Self {
            machine: Arch::new(),
            hits: Vec::new(),
            margins: Margins::default(),
            off_middle: 0.0,
            contact_squared: 0.0,
        }
    }
}

impl Filter {
    /// Begins a window.
    pub fn begin_window(&mut self, margins: Margins) {
        self.margins = margins;
        let fastest = f64::from(margins.fastest);
        // Two positions, and two velocities for at most the window's length.
        let contact =
            margins.contact + 2.0 * margins.position + 4.0 * f64::from(f32::EPSILON) * fastest;
        // A piece passes the cell in the window, so at its beginning it is no farther than it flies in it.
        let farthest: f64 = margins
            .edges
            .iter()
            .map(|&edge| {
                let apart = f64::from(edge) + margins.contact + 2.0 * fastest;
                apart * apart
            })
            .sum();
        self.off_middle = (margins.off_middle + 4.0 * margins.position) as f32;
        self.contact_squared = (contact * contact + ROUNDING * farthest) as f32;
    }

    /// Allows for a piece as fast as this.
    #[inline]
    pub fn allow(&mut self, speed: f32) {
        if speed > self.margins.fastest {
            self.begin_window(Margins {
                fastest: speed,
                position: self.margins.position + f64::from(f32::EPSILON * speed),
                ..self.margins
            });
        }
    }

    /// Largest component of the velocities it allows for.
    pub fn fastest(&self) -> f32 {
        self.margins.fastest
    }

    /// Appends to `pairs` each pair of a piece of a cell from row `first` on and a piece before it that can meet in the cell in
    /// the window, the later row first.
    pub fn find(&mut self, sheet: &Sheet, first: usize, pairs: &mut Vec<(u32, u32)>) {
        let (columns, count) = (sheet.columns(), sheet.count());
        let found = self.machine.dispatch(Find {
            columns,
            first,
            count,
            contact_squared: self.contact_squared,
            hits: &mut self.hits,
        });
        for &hit in &self.hits[..found] {
            let (row, chunk) = ((hit >> 16 & 0xff_ffff) as u32, (hit >> 40) as u32);
            let mut lanes = (hit & 0xffff) as u32;
            while lanes != 0 {
                let other = chunk * LANES as u32 + lanes.trailing_zeros();
                lanes &= lanes - 1;
                if other < row && self.can_meet_here(columns, row as usize, other as usize) {
                    pairs.push((row, other));
                }
            }
        }
    }

    /// Whether two pieces whose lines touch may do so within the window and within the cell. In doubt they may.
    #[inline(always)]
    fn can_meet_here(&self, columns: [&[f32]; 6], row: usize, other: usize) -> bool {
        let [x, y, z, u, v, w] = columns;
        let apart = [x[row] - x[other], y[row] - y[other], z[row] - z[other]];
        let velocity = [u[row] - u[other], v[row] - v[other], w[row] - w[other]];
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (radial, speed_squared) = (dot(apart, velocity), dot(velocity, velocity));
        let distance_squared = dot(apart, apart);
        let beyond = distance_squared - self.contact_squared;
        let root = (radial * radial - speed_squared * beyond).max(0.0).sqrt();
        let closest = -radial / speed_squared;
        // For a pair without a relative velocity these are no numbers, and nothing is rejected.
        let time_margin = TIME_ROUNDING * (distance_squared / speed_squared).sqrt();
        // No later than the contact.
        let touch = (closest - root / speed_squared).max(0.0);
        if touch > 1.0 + time_margin {
            return false;
        }
        // The contact lies between the two times.
        let middle = [x[row] + x[other], y[row] + y[other], z[row] + z[other]];
        let drift = [u[row] + u[other], v[row] + v[other], w[row] + w[other]];
        !(0..3).any(|axis| {
            let margin = self.off_middle + time_margin * drift[axis].abs();
            let half = 0.5 * self.margins.edges[axis] + margin;
            let [one, two] = [touch, closest].map(|time| 0.5 * (middle[axis] + drift[axis] * time));
            one.min(two) > half || one.max(two) < -half
        })
    }
}

struct Find<'a> {
    columns: [&'a [f32]; 6],
    first: usize,
    count: usize,
    contact_squared: f32,
    hits: &'a mut Vec<u64>,
}

impl WithSimd for Find<'_> {
    /// How many vectors have hits.
    type Output = usize;

    /// Free of branches that depend on the pieces: a vector with hits is written down by advancing past it.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let lanes = size_of::<S::f32s>() / size_of::<f32>();
        let [x, y, z, u, v, w] = self.columns;
        let rows = |column: &'_ [f32]| column.len().min(self.count);
        let count = rows(x)
            .min(rows(y))
            .min(rows(z))
            .min(rows(u))
            .min(rows(v))
            .min(rows(w));
        let chunks = S::as_simd_f32s(x).0.iter().zip(S::as_simd_f32s(y).0);
        let chunks = chunks.zip(S::as_simd_f32s(z).0.iter().zip(S::as_simd_f32s(u).0));
        let chunks = chunks.zip(S::as_simd_f32s(v).0.iter().zip(S::as_simd_f32s(w).0));
        // Narrower vectors are more.
        let most = (count - self.first.min(count)) * count.div_ceil(lanes) + 1;
        if self.hits.len() < most {
            self.hits.resize(most + most / 2, 0);
        }
        let hits = &mut self.hits[..];
        let minus_contact_squared = simd.splat_f32s(-self.contact_squared);
        let zero = simd.splat_f32s(0.0);
        let mut found = 0;
        for (chunk, (((&cx, &cy), (&cz, &cu)), (&cv, &cw))) in chunks.enumerate() {
            let begin = chunk * lanes;
            let place = (begin / LANES) as u64;
            for row in self.first.max(begin + 1)..count {
                let rx = simd.sub_f32s(cx, simd.splat_f32s(x[row]));
                let ry = simd.sub_f32s(cy, simd.splat_f32s(y[row]));
                let rz = simd.sub_f32s(cz, simd.splat_f32s(z[row]));
                let vx = simd.sub_f32s(simd.splat_f32s(u[row]), cu);
                let vy = simd.sub_f32s(simd.splat_f32s(v[row]), cv);
                let vz = simd.sub_f32s(simd.splat_f32s(w[row]), cw);
                // Positive if they approach.
                let approach = simd.mul_f32s(rx, vx);
                let approach = simd.mul_add_e_f32s(ry, vy, approach);
                let approach = simd.mul_add_e_f32s(rz, vz, approach);
                let beyond = simd.mul_add_e_f32s(rx, rx, minus_contact_squared);
                let beyond = simd.mul_add_e_f32s(ry, ry, beyond);
                let beyond = simd.mul_add_e_f32s(rz, rz, beyond);
                let speed = simd.mul_f32s(vx, vx);
                let speed = simd.mul_add_e_f32s(vy, vy, speed);
                let speed = simd.mul_add_e_f32s(vz, vz, speed);
                // (r . v)^2 against |v|^2 (|r|^2 - contact^2): whether the lines touch.
                let closeness = simd.mul_f32s(approach, simd.max_f32s(approach, zero));
                let hit = simd.less_than_f32s(simd.mul_f32s(speed, beyond), closeness);
                let hit = lanes_of(simd, hit) << (begin % LANES);
                hits[found] = place << 40 | (row as u64) << 16 | hit;
                found += usize::from(hit != 0);
            }
        }
        found
    }
}

/// A comparison's outcome as a number with a bit for each lane.
#[inline(always)]
fn lanes_of<S: Simd>(simd: S, mask: S::m32s) -> u64 {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = (&simd as &dyn Any).downcast_ref::<V3>() {
        // Known when this is compiled: one instruction instead of eight.
        let lanes = simd.avx._mm256_movemask_ps(bytemuck::cast(mask));
        return u64::from(lanes.cast_unsigned());
    }
    const { assert!(size_of::<S::f32s>() <= LANES * size_of::<f32>()) };
    if const { size_of::<S::m32s>() == size_of::<u16>() } {
        u64::from(bytemuck::cast::<S::m32s, u16>(mask))
    } else if const { size_of::<S::m32s>() == size_of::<u8>() } {
        u64::from(bytemuck::cast::<S::m32s, u8>(mask)) & ((1 << S::F32_LANES) - 1)
    } else {
        let masks = [mask];
        let lanes: &[u32] = bytemuck::cast_slice(&masks);
        lanes
            .iter()
            .enumerate()
            .fold(0, |bits, (lane, &set)| bits | u64::from(set & 1) << lane)
    }
}

/// A piece as a column sees it.
#[inline(always)]
pub fn relative(line: &Line, origin: [f32; 3]) -> [f32; 6] {
    let [x, y, z] = line.position;
    let [u, v, w] = line.velocity;
    [x - origin[0], y - origin[1], z - origin[2], u, v, w]
}

#[cfg(test)]
mod tests {
    use pulp::{Scalar, Scalar128b, Scalar256b, Scalar512b};

    use super::*;

    /// Pieces on a line that all fly towards its middle, so that the lines of any two touch.
    fn crowd(count: usize) -> Sheet {
        let mut sheet = Sheet::default();
        sheet.fill(count, |row| {
            let place = row as f32 - 0.5 * (count as f32 - 1.0);
            [place, 0.0, 0.0, -place, 0.0, 0.0]
        });
        sheet
    }

    /// The pairs of rows that vectors of one width find.
    fn pairs(simd: impl Simd, sheet: &Sheet, first: usize) -> Vec<(u64, u64)> {
        let mut hits = Vec::new();
        let found = Find {
            columns: sheet.columns(),
            first,
            count: sheet.count(),
            contact_squared: 0.01,
            hits: &mut hits,
        }
        .with_simd(simd);
        let pairs = hits[..found].iter().flat_map(|hit| {
            let (row, begin) = (hit >> 16 & 0xff_ffff, (hit >> 40) * LANES as u64);
            let lanes = (0..LANES as u64).filter(move |lane| hit >> lane & 1 == 1);
            lanes.map(move |lane| (row, begin + lane))
        });
        let mut pairs: Vec<_> = pairs.filter(|(row, other)| other < row).collect();
        pairs.sort_unstable();
        pairs
    }

    #[test]
    fn vectors_of_every_width_find_all_pairs_of_a_crowd() {
        for count in [1, 2, 7, 16, 17, 45] {
            let sheet = crowd(count);
            for first in [0, count / 2, count] {
                let rows = first as u64..count as u64;
                let all: Vec<_> = rows
                    .flat_map(|row| (0..row).map(move |other| (row, other)))
                    .collect();
                assert_eq!(pairs(Scalar, &sheet, first), all);
                assert_eq!(pairs(Scalar128b, &sheet, first), all);
                assert_eq!(pairs(Scalar256b, &sheet, first), all);
                assert_eq!(pairs(Scalar512b, &sheet, first), all);
            }
        }
    }
}
