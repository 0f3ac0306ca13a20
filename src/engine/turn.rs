//! Eight rows of eight numbers turned into columns, or back: where the machine has vectors of eight, by shuffling them.

#[cfg(target_arch = "x86_64")]
use std::{any::Any, arch::x86_64::__m256};

use pulp::Simd;
#[cfg(target_arch = "x86_64")]
use pulp::{
    cast,
    x86::{V3, V4},
};

/// Rows that are turned at once, and numbers in each.
pub const SIDE: usize = 8;

/// Rows or columns.
pub type Square = [[f32; SIDE]; SIDE];

/// The columns of rows.
#[inline(always)]
pub fn turn<S: Simd>(simd: S, rows: Square) -> Square {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = as_v3(simd).or(as_v4(simd).map(|simd| *simd)) {
        return turn_wide(simd, rows);
    }
    std::array::from_fn(|column| rows.map(|row| row[column]))
}

/// The machine, if its vectors are of eight numbers in f32; known when this is compiled.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn as_v3<S: Simd>(simd: S) -> Option<V3> {
    (&simd as &dyn Any).downcast_ref::<V3>().copied()
}

/// The machine, if they are of sixteen.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn as_v4<S: Simd>(simd: S) -> Option<V4> {
    (&simd as &dyn Any).downcast_ref::<V4>().copied()
}

/// By pairs of rows, then by fours, then all eight.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn turn_wide(V3 { avx, .. }: V3, rows: Square) -> Square {
    const FIRST: i32 = 0b01_00_01_00;
    const SECOND: i32 = 0b11_10_11_10;
    const LOWER: i32 = 0x20;
    const UPPER: i32 = 0x31;
    let pair = |one: usize| {
        // One by one: what maps all rows is not always built into the caller's code.
        let [row, next]: [__m256; 2] = [cast(rows[one]), cast(rows[one + 1])];
        [
            avx._mm256_unpacklo_ps(row, next),
            avx._mm256_unpackhi_ps(row, next),
        ]
    };
    // Of four rows: each vector with what it has of a column and of the fourth one after it.
    let four = |[low, high]: [__m256; 2], [next_low, next_high]: [__m256; 2]| {
        [
            avx._mm256_shuffle_ps::<FIRST>(low, next_low),
            avx._mm256_shuffle_ps::<SECOND>(low, next_low),
            avx._mm256_shuffle_ps::<FIRST>(high, next_high),
            avx._mm256_shuffle_ps::<SECOND>(high, next_high),
        ]
    };
    let [a, b, c, d] = four(pair(0), pair(2));
    let [e, f, g, h] = four(pair(4), pair(6));
    [
        cast(avx._mm256_permute2f128_ps::<LOWER>(a, e)),
        cast(avx._mm256_permute2f128_ps::<LOWER>(b, f)),
        cast(avx._mm256_permute2f128_ps::<LOWER>(c, g)),
        cast(avx._mm256_permute2f128_ps::<LOWER>(d, h)),
        cast(avx._mm256_permute2f128_ps::<UPPER>(a, e)),
        cast(avx._mm256_permute2f128_ps::<UPPER>(b, f)),
        cast(avx._mm256_permute2f128_ps::<UPPER>(c, g)),
        cast(avx._mm256_permute2f128_ps::<UPPER>(d, h)),
    ]
}

#[cfg(test)]
mod tests {
    use pulp::{Arch, Scalar, WithSimd};

    use super::*;

    struct Turn(Square);

    impl WithSimd for Turn {
        type Output = Square;

        fn with_simd<S: Simd>(self, simd: S) -> Square {
            turn(simd, self.0)
        }
    }

    #[test]
    fn rows_become_columns_and_columns_rows() {
        let rows: Square =
            std::array::from_fn(|row| std::array::from_fn(|column| (10 * row + column) as f32));
        let columns = Arch::new().dispatch(Turn(rows));
        for (number, column) in columns.iter().enumerate() {
            for (lane, &value) in column.iter().enumerate() {
                assert_eq!(value, (10 * lane + number) as f32);
            }
        }
        assert_eq!(columns, Turn(rows).with_simd(Scalar::new()));
        assert_eq!(rows, Arch::new().dispatch(Turn(columns)));
    }
}
