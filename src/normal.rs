//! Normal deviates with the same bits on every machine.
//!
//! Marsaglia's polar method on `libm`: the logarithm of the system's mathematics library differs from machine to machine, and
//! a crate's choice between the two can change with the features that other crates ask for.
//!
//! Source: derived here from the density of two independent deviates in polar coordinates (Marsaglia & Bray 1964).

use glam::DVec3;
use rand::{Rng, RngExt};

/// A deviate of mean 0 and deviation 1.
pub fn standard_normal(random: &mut impl Rng) -> f64 {
    loop {
        let across = 2.0 * random.random::<f64>() - 1.0;
        let along = 2.0 * random.random::<f64>() - 1.0;
        let square = across * across + along * along;
        if square > 0.0 && square < 1.0 {
            return across * (-2.0 * libm::log(square) / square).sqrt();
        }
    }
}

/// Such a deviate in each component.
pub fn normal_vector(random: &mut impl Rng) -> DVec3 {
    DVec3::from_array([(); 3].map(|()| standard_normal(random)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn moments_are_those_of_the_normal_distribution() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        let count = 1_000_000;
        let mut moments = [0.0; 4];
        for _ in 0..count {
            let value = standard_normal(&mut random);
            for (power, moment) in (1..).zip(&mut moments) {
                *moment += value.powi(power) / f64::from(count);
            }
        }
        // Five standard errors of each.
        for (moment, expected, variance) in [
            (moments[0], 0.0, 1.0),
            (moments[1], 1.0, 2.0),
            (moments[2], 0.0, 15.0),
            (moments[3], 3.0, 96.0),
        ] {
            let error = 5.0 * (variance / f64::from(count)).sqrt();
            assert!((moment - expected).abs() < error, "{moment} {expected}");
        }
    }
}
