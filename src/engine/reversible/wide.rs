//! Squares of 128-bit numbers, which need 256 bits, so that "do these balls overlap" has an exact answer.

/// A number below 2^256.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Wide {
    high: u128,
    low: u128,
}

impl Wide {
    /// The square of a number.
    #[inline]
    pub fn square(number: i128) -> Self {
        let number = number.unsigned_abs();
        let (high, low) = (
            u128::from((number >> 64) as u64),
            u128::from(number as u64), // the lower half
        );
        // (2^64 h + l)^2 = 2^128 h^2 + 2^65 h l + l^2
        let cross = high * low;
        let (sum, carry) = (low * low).overflowing_add(cross << 65);
        Self {
            high: high * high + (cross >> 63) + u128::from(carry),
            low: sum,
        }
    }

    /// The square of a vector's length, which must be below 2^128.
    #[inline]
    pub fn length_squared(vector: [i128; 3]) -> Self {
        let [x, y, z] = vector.map(Self::square);
        x.plus(y).plus(z)
    }

    #[inline]
    fn plus(self, other: Self) -> Self {
        let (low, carry) = self.low.overflowing_add(other.low);
        Self {
            high: self.high + other.high + u128::from(carry),
            low,
        }
    }

    /// `self - other`, rounded, but with the exact sign: zero only if the two are equal.
    #[inline]
    pub fn minus(self, other: Self) -> f64 {
        const TWO_TO_128: f64 = (1_u128 << 127) as f64 * 2.0;
        if self < other {
            return -other.minus(self);
        }
        let (low, borrow) = self.low.overflowing_sub(other.low);
        let high = self.high - other.high - u128::from(borrow);
        // Most differences are those of a contact to within a few ticks; both halves are exact to 53 bits.
        high as f64 * TWO_TO_128 + low as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_those_of_small_numbers_and_of_sums() {
        for number in [0, 1, -3, 1 << 40, (1 << 63) - 1, -(1 << 63)] {
            let square = Wide {
                high: 0,
                low: (number * number) as u128,
            };
            assert_eq!(Wide::square(number), square);
        }
        // (a + 1)^2 - a^2 = 2 a + 1, across every carry.
        for bits in 1..127 {
            for number in [1_i128 << bits, (1 << bits) - 1, (1 << bits) / 3] {
                let next = Wide::square(number + 1);
                let expected = Wide::square(number).plus(Wide {
                    high: 0,
                    low: 2 * number as u128 + 1,
                });
                assert_eq!(next, expected, "{number}");
            }
        }
    }

    #[test]
    fn a_difference_of_one_is_seen_at_any_size() {
        let large = Wide::square(i128::MAX);
        let larger = large.plus(Wide { high: 0, low: 1 });
        assert_eq!(larger.minus(large), 1.0);
        assert_eq!(large.minus(larger), -1.0);
        assert_eq!(large.minus(large), 0.0);
    }
}
