//! Which pieces of one cell can meet at all: a conservative test in f32, many pairs at a time.
//!
//! The filter never rejects a pair that the exact prediction ([`crate::collision::pair_time`]) accepts; it lets some through that
//! the exact test then rejects, so how wide the machine's vectors are changes the cost and never a collision. Its margins are
//! derived from the rounding of f32 at the largest coordinates it sees.

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

/// Columns are padded to a multiple of the widest vectors.
const LANES: usize = 16;

/// Share of `|r|^2 |v|^2` by which f32 rounding can change `(r . v)^2`, with a margin: some ten roundings of 2^-24 each.
const ROUNDING: f32 = 4e-6;

/// A pair closer to tangential than this squared cosine may approach, whatever the sign of `r . v` in f32. What that lets through
/// of pairs that do not overlap is less than `ROUNDING` already allows, so only overlapping ones need it.
const GRAZING: f32 = 1e-8;

/// Share of the largest coordinate by which positions are off, with a margin.
const POSITION_ROUNDING: f64 = 1e-6;

/// The pieces of a cell, as columns.
#[derive(Clone, Debug)]
pub struct Filter {
    machine: Arch,
    /// `x, y, z` and the velocity's `x, y, z`.
    columns: [Vec<f32>; 6],
    length: usize,
    /// Squared distance below which a pair may touch.
    contact_squared: f32,
}

impl Default for Filter {
    fn default() -> Self {
        Self {
            machine: Arch::new(),
            columns: Default::default(),
            length: 0,
            contact_squared: 0.0,
        }
    }
}

impl Filter {
    /// Begins a cell of `count` pieces: `contact` is the largest contact distance, `extent` bounds the coordinates of all pieces
    /// relative to the middle of the cell.
    pub fn begin(&mut self, contact: f64, extent: f64, count: usize) {
        self.length = 0;
        self.make_room(count);
        let contact = (contact + POSITION_ROUNDING * extent) as f32;
        self.contact_squared = contact * contact;
    }

    fn make_room(&mut self, count: usize) {
        if self.columns[0].len() < count {
            self.columns
                .iter_mut()
                .for_each(|column| column.resize(count.next_multiple_of(LANES), 0.0));
        }
    }

    /// Adds a piece by its position at the beginning of the window, relative to the middle of the cell, and its velocity.
    #[inline]
    pub fn push(&mut self, position: DVec3, velocity: DVec3) {
        self.make_room(self.length + 1);
        let values = [
            position.x, position.y, position.z, velocity.x, velocity.y, velocity.z,
        ];
        for (column, value) in self.columns.iter_mut().zip(values) {
            column[self.length] = value as f32;
        }
        self.length += 1;
    }

    /// Number of pieces.
    pub fn len(&self) -> usize {
        self.length
    }

    /// Appends to `hits` each pair of a piece from `first` on and a piece before it that can meet, the later piece first.
    pub fn find(&self, first: usize, hits: &mut Vec<(u32, u32)>) {
        self.machine.dispatch(Find {
            filter: self,
            first,
            hits,
        });
    }
}

struct Find<'a> {
    filter: &'a Filter,
    first: usize,
    hits: &'a mut Vec<(u32, u32)>,
}

impl WithSimd for Find<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Filter {
            columns,
            length,
            contact_squared,
            ..
        } = self.filter;
        let [x, y, z, u, v, w] = columns.each_ref().map(|column| S::as_simd_f32s(column).0);
        let lanes = size_of::<S::f32s>() / size_of::<f32>();
        let dot = |a: [S::f32s; 3], b: [S::f32s; 3]| {
            simd.mul_add_e_f32s(
                a[2],
                b[2],
                simd.mul_add_e_f32s(a[1], b[1], simd.mul_f32s(a[0], b[0])),
            )
        };
        let minus_contact_squared = simd.splat_f32s(-contact_squared);
        let (shrunk, grazing) = (simd.splat_f32s(1.0 - ROUNDING), simd.splat_f32s(-GRAZING));
        let nothing = simd.splat_f32s(0.0);
        for row in self.first..*length {
            let own = columns
                .each_ref()
                .map(|column| simd.splat_f32s(column[row]));
            let mut most = nothing;
            for chunk in 0..row.div_ceil(lanes) {
                let r = [
                    simd.sub_f32s(x[chunk], own[0]),
                    simd.sub_f32s(y[chunk], own[1]),
                    simd.sub_f32s(z[chunk], own[2]),
                ];
                let v = [
                    simd.sub_f32s(u[chunk], own[3]),
                    simd.sub_f32s(v[chunk], own[4]),
                    simd.sub_f32s(w[chunk], own[5]),
                ];
                let radial = dot(r, v);
                let approach = simd.neg_f32s(simd.mul_f32s(radial, simd.abs_f32s(radial)));
                let distance_squared = dot(r, r);
                let beyond = simd.max_f32s(
                    simd.mul_add_e_f32s(distance_squared, shrunk, minus_contact_squared),
                    simd.mul_f32s(distance_squared, grazing),
                );
                let excess = simd.sub_f32s(approach, simd.mul_f32s(dot(v, v), beyond));
                most = simd.max_f32s(most, excess);
            }
            // Rows with a hit are rare; which piece it was is found one by one.
            if simd.reduce_max_f32s(most) > 0.0 {
                self.filter.look_through(row, self.hits);
            }
        }
    }
}

impl Filter {
    /// Appends a row's hits.
    #[inline(never)]
    fn look_through(&self, row: usize, hits: &mut Vec<(u32, u32)>) {
        let own: [f32; 6] = std::array::from_fn(|column| self.columns[column][row]);
        for other in 0..row {
            let between: [f32; 6] =
                std::array::from_fn(|column| self.columns[column][other] - own[column]);
            let (r, v) = between.split_at(3);
            let dot = |a: &[f32], b: &[f32]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let (radial, distance_squared) = (dot(r, v), dot(r, r));
            let beyond = (distance_squared * (1.0 - ROUNDING) - self.contact_squared)
                .max(distance_squared * -GRAZING);
            if -radial * radial.abs() > dot(v, v) * beyond {
                hits.push((row as u32, other as u32));
            }
        }
    }
}
