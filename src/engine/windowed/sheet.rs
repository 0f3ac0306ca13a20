//! The pieces that pass a cell, as columns that the filter reads many at a time.

/// Columns are padded to a multiple of the widest vectors.
pub const LANES: usize = 16;

/// A coordinate that nothing comes near to, whose square still is a number.
const FAR: f32 = 1e15;

/// The pieces of a cell, in the order of its list: `x, y, z` relative to the cell's centre and the velocity's `x, y, z`.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    /// The columns one after the other.
    floats: Vec<f32>,
    /// Rows that a column has room for.
    room: usize,
    /// Rows in use.
    count: usize,
}

impl Sheet {
    /// Empties it.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Rows in use.
    #[inline]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Adds what is not in it yet of so many pieces in all; `place` gives a piece's row.
    #[inline(always)]
    pub fn fill(&mut self, count: usize, place: impl Fn(usize) -> [f32; 6]) {
        if count > self.room {
            self.room = (count + count / 2).next_multiple_of(LANES);
            self.floats.resize(6 * self.room, 0.0);
            self.count = 0;
        }
        let first = self.count;
        let padded = count.next_multiple_of(LANES);
        self.count = count;
        let [x, y, z, u, v, w] = self.columns_mut().map(|column| &mut column[..padded]);
        for row in first..count {
            [x[row], y[row], z[row], u[row], v[row], w[row]] = place(row);
        }
        for column in [x, y, z] {
            column[count..].fill(FAR);
        }
        for column in [u, v, w] {
            column[count..].fill(0.0);
        }
    }

    /// The columns, padded with rows that meet nothing.
    #[inline(always)]
    pub fn columns(&self) -> [&[f32]; 6] {
        let padded = self.count.next_multiple_of(LANES);
        std::array::from_fn(|column| &self.floats[column * self.room..][..padded])
    }

    #[inline(always)]
    fn columns_mut(&mut self) -> [&mut [f32]; 6] {
        let mut rest = &mut self.floats[..];
        std::array::from_fn(|_| {
            rest.split_off_mut(..self.room)
                .expect("a sheet has six columns")
        })
    }
}
