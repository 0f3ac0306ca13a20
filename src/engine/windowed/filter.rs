//! Which pieces of one cell can meet at all: a conservative test in f32, many pairs at a time.
//!
//! The filter never rejects a pair that the exact prediction ([`crate::collision::pair_time`]) accepts; it lets some through that
//! the exact test then rejects. Its margins are derived from the rounding of f32 at the largest coordinates it sees.

use glam::{DVec3, Vec3};

/// Pairs looked at together; the rows are padded to a multiple.
const LANES: usize = 16;

/// Share of `|r|^2 |v|^2` by which f32 rounding can change `(r . v)^2`, with a margin: some ten roundings of 2^-24 each.
const ROUNDING: f32 = 4e-6;

/// A pair closer to tangential than this squared cosine counts as approaching, whatever the sign of `r . v` in f32.
const GRAZING: f32 = 1e-8;

/// Share of the largest coordinate by which positions are off, with a margin.
const POSITION_ROUNDING: f64 = 1e-6;

/// The pieces of a cell, as columns.
#[derive(Clone, Debug, Default)]
pub struct Filter {
    columns: [Vec<f32>; 6],
    length: usize,
    /// Squared distance below which a pair may touch.
    contact_squared: f32,
}

impl Filter {
    /// Begins a cell: `contact` is the largest contact distance, `extent` bounds the coordinates of all pieces relative to the
    /// middle of the cell.
    pub fn begin(&mut self, contact: f64, extent: f64) {
        self.length = 0;
        let contact = (contact + POSITION_ROUNDING * extent) as f32;
        self.contact_squared = contact * contact;
    }

    /// Adds a piece by its position at the beginning of the window, relative to the middle of the cell, and its velocity.
    #[inline]
    pub fn push(&mut self, position: DVec3, velocity: DVec3) {
        if self.length == self.columns[0].len() {
            for column in &mut self.columns {
                column.resize(self.length + LANES, 0.0);
            }
        }
        let (position, velocity) = (position.as_vec3(), velocity.as_vec3());
        let values = [
            position.x, position.y, position.z, velocity.x, velocity.y, velocity.z,
        ];
        for (column, value) in self.columns.iter_mut().zip(values) {
            column[self.length] = value;
        }
        self.length += 1;
    }

    /// Number of pieces.
    pub fn len(&self) -> usize {
        self.length
    }

    /// Hands every piece before `row` that can meet it to `meet`.
    #[inline]
    pub fn for_each_before(&self, row: usize, mut meet: impl FnMut(usize)) {
        let position = Vec3::from_array(std::array::from_fn(|axis| self.columns[axis][row]));
        let velocity = Vec3::from_array(std::array::from_fn(|axis| self.columns[3 + axis][row]));
        let [x, y, z, u, v, w] = self
            .columns
            .each_ref()
            .map(|column| column[..row.next_multiple_of(LANES)].as_chunks::<LANES>().0);
        // Chunks with a hit are rare: they are noted together and looked at one by one afterwards.
        for chunk in 0..x.len() {
            let mut hits = [0_u32; LANES];
            for lane in 0..LANES {
                let (rx, ry, rz) = (
                    x[chunk][lane] - position.x,
                    y[chunk][lane] - position.y,
                    z[chunk][lane] - position.z,
                );
                let (vx, vy, vz) = (
                    u[chunk][lane] - velocity.x,
                    v[chunk][lane] - velocity.y,
                    w[chunk][lane] - velocity.z,
                );
                hits[lane] = u32::from(can_meet([rx, ry, rz], [vx, vy, vz], self.contact_squared));
            }
            if hits.iter().fold(0, |any, hit| any | hit) != 0 {
                for (lane, &hit) in hits.iter().enumerate() {
                    let other = chunk * LANES + lane;
                    if hit != 0 && other < row {
                        meet(other);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn can_meet(r: [f32; 3], v: [f32; 3], contact_squared: f32) -> bool {
    let radial = r[0] * v[0] + r[1] * v[1] + r[2] * v[2];
    let speed_squared = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    let distance_squared = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
    let product = speed_squared * distance_squared;
    let radial_squared = radial * radial;
    let approaching = (radial < 0.0) | (radial_squared <= GRAZING * product); // without a branch
    let near =
        radial_squared + ROUNDING * product >= speed_squared * (distance_squared - contact_squared);
    approaching & near
}
