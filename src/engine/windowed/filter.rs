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

/// Where a piece is at the beginning of the window, if need be drawn back to it, and its velocity; in f32.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub struct Start([f32; 8]);

impl Start {
    /// From a position at the beginning of the window.
    #[inline]
    pub fn new(position: DVec3, velocity: DVec3) -> Self {
        let [x, y, z] = position.as_vec3().to_array();
        let [u, v, w] = velocity.as_vec3().to_array();
        Self([x, y, z, u, v, w, 0.0, 0.0])
    }
}

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
    /// Begins a window: `contact` is the largest contact distance, `extent` bounds the coordinates of all pieces.
    pub fn begin_window(&mut self, contact: f64, extent: f64) {
        let contact = (contact + POSITION_ROUNDING * extent) as f32;
        self.contact_squared = contact * contact;
    }

    /// Begins a cell of `count` pieces.
    #[inline]
    pub fn begin_cell<'s>(&mut self, count: usize, pieces: impl Iterator<Item = &'s Start>) {
        self.length = count;
        self.make_room(count);
        let [x, y, z, u, v, w] = self.columns.each_mut().map(|column| &mut column[..count]);
        for (index, piece) in pieces.enumerate() {
            [
                x[index],
                y[index],
                z[index],
                u[index],
                v[index],
                w[index],
                ..,
            ] = piece.0;
        }
    }

    fn make_room(&mut self, count: usize) {
        if self.columns[0].len() < count {
            self.columns
                .iter_mut()
                .for_each(|column| column.resize(count.next_multiple_of(LANES), 0.0));
        }
    }

    /// Adds a piece.
    #[inline]
    pub fn push(&mut self, piece: &Start) {
        self.make_room(self.length + 1);
        for (column, &value) in self.columns.iter_mut().zip(&piece.0) {
            column[self.length] = value;
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
        let [x, y, z, u, v, w] = columns;
        let wide = [
            S::as_simd_f32s(x).0,
            S::as_simd_f32s(y).0,
            S::as_simd_f32s(z).0,
            S::as_simd_f32s(u).0,
            S::as_simd_f32s(v).0,
            S::as_simd_f32s(w).0,
        ];
        let lanes = size_of::<S::f32s>() / size_of::<f32>();
        let minus_contact_squared = simd.splat_f32s(-contact_squared);
        for row in self.first..*length {
            let own = [
                simd.splat_f32s(x[row]),
                simd.splat_f32s(y[row]),
                simd.splat_f32s(z[row]),
                simd.splat_f32s(u[row]),
                simd.splat_f32s(v[row]),
                simd.splat_f32s(w[row]),
            ];
            let chunks = row.div_ceil(lanes);
            let mut most = simd.splat_f32s(0.0);
            for chunk in 0..chunks {
                most = simd.max_f32s(most, excess(simd, wide, chunk, own, minus_contact_squared));
            }
            // Rows with a hit are rare; which piece it was is found in a second pass.
            if simd.reduce_max_f32s(most) > 0.0 {
                for chunk in 0..chunks {
                    let excess = [excess(simd, wide, chunk, own, minus_contact_squared)];
                    let excess = pulp::bytemuck::cast_slice::<S::f32s, f32>(&excess);
                    for (lane, &excess) in excess.iter().enumerate() {
                        let other = chunk * lanes + lane;
                        if excess > 0.0 && other < row {
                            self.hits.push((row as u32, other as u32));
                        }
                    }
                }
            }
        }
    }
}

/// By how much the pieces of a chunk approach one piece more closely than contact: positive for those that can meet it.
///
/// Spelled out without closures: those would not be compiled for the wide vectors.
#[inline(always)]
fn excess<S: Simd>(
    simd: S,
    [x, y, z, u, v, w]: [&[S::f32s]; 6],
    chunk: usize,
    own: [S::f32s; 6],
    minus_contact_squared: S::f32s,
) -> S::f32s {
    let rx = simd.sub_f32s(x[chunk], own[0]);
    let ry = simd.sub_f32s(y[chunk], own[1]);
    let rz = simd.sub_f32s(z[chunk], own[2]);
    let vx = simd.sub_f32s(u[chunk], own[3]);
    let vy = simd.sub_f32s(v[chunk], own[4]);
    let vz = simd.sub_f32s(w[chunk], own[5]);
    let radial = dot(simd, [rx, ry, rz], [vx, vy, vz]);
    let distance_squared = dot(simd, [rx, ry, rz], [rx, ry, rz]);
    let speed_squared = dot(simd, [vx, vy, vz], [vx, vy, vz]);
    // (r.v)^2 with the sign of approach, against |v|^2 (|r|^2 - contact^2), less what rounding may do.
    let approach = simd.neg_f32s(simd.mul_f32s(radial, simd.abs_f32s(radial)));
    let beyond = simd.max_f32s(
        simd.mul_add_e_f32s(
            distance_squared,
            simd.splat_f32s(1.0 - ROUNDING),
            minus_contact_squared,
        ),
        simd.mul_f32s(distance_squared, simd.splat_f32s(-GRAZING)),
    );
    simd.sub_f32s(approach, simd.mul_f32s(speed_squared, beyond))
}

#[inline(always)]
fn dot<S: Simd>(simd: S, a: [S::f32s; 3], b: [S::f32s; 3]) -> S::f32s {
    simd.mul_add_e_f32s(
        a[2],
        b[2],
        simd.mul_add_e_f32s(a[1], b[1], simd.mul_f32s(a[0], b[0])),
    )
}
