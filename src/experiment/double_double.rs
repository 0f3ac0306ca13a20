//! Numbers of twice the precision, as a reference: the unevaluated sum of two f64.
//!
//! Source: Dekker, Numer. Math. 18, 224 (1971); Knuth, The Art of Computer Programming, vol. 2, 4.2.2, for the sum.

use std::ops::{Add, Div, Mul, Sub};

/// A number with some 106 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct DoubleDouble {
    high: f64,
    low: f64,
}

impl DoubleDouble {
    /// The nearest f64.
    pub fn value(self) -> f64 {
        self.high + self.low
    }

    /// The square root of a number that is not negative.
    #[must_use]
    pub fn sqrt(self) -> Self {
        if self.high <= 0.0 {
            return Self::default();
        }
        // One step of Newton from the rounded root doubles its digits.
        let root = Self::from(self.high.sqrt());
        let rest = self - root * root;
        root + Self::from(rest.value() / (2.0 * root.high))
    }
}

impl From<f64> for DoubleDouble {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

/// The sum, and what its rounding lost.
fn exact_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let part = high - a;
    DoubleDouble {
        high,
        low: (a - (high - part)) + (b - part),
    }
}

/// Two halves of 26 bits each.
fn split(a: f64) -> (f64, f64) {
    const SPLITTER: f64 = 134_217_729.0; // 2^27 + 1
    let scaled = SPLITTER * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

/// The product, and what its rounding lost.
fn exact_product(a: f64, b: f64) -> DoubleDouble {
    let high = a * b;
    let ((a1, a2), (b1, b2)) = (split(a), split(b));
    DoubleDouble {
        high,
        low: ((a1 * b1 - high) + a1 * b2 + a2 * b1) + a2 * b2,
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let high = exact_sum(self.high, other.high);
        let low = exact_sum(self.low, other.low);
        let sum = exact_sum(high.high, high.low + low.high);
        exact_sum(sum.high, sum.low + low.low)
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        let negative = Self {
            high: -other.high,
            low: -other.low,
        };
        self + negative
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let product = exact_product(self.high, other.high);
        exact_sum(
            product.high,
            product.low + (self.high * other.low + self.low * other.high),
        )
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - Self::from(first) * other;
        exact_sum(first, rest.value() / other.high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirty_digits_are_kept() {
        let third = DoubleDouble::from(1.0) / DoubleDouble::from(3.0);
        let one = third * DoubleDouble::from(3.0) - DoubleDouble::from(1.0);
        assert!(one.value().abs() < 1e-30);
        let two = DoubleDouble::from(2.0);
        assert!((two.sqrt() * two.sqrt() - two).value().abs() < 1e-30);
        let tiny = DoubleDouble::from(1.0) + DoubleDouble::from(1e-25);
        assert_eq!((tiny - DoubleDouble::from(1.0)).value(), 1e-25);
    }
}
