//! What the literature expects of a fluid of hard spheres, in units of diameter, mass and `k T`.

use std::f64::consts::PI;

/// Compressibility factor `P V / N k T` of the fluid at a packing fraction.
///
/// Source: Pieprzyk, Bannerman, Branka, Chudak, Heyes, PCCP 21, 6886 (2019), their refit of Kolafa, Labik and Malijevsky.
pub fn compressibility(packing_fraction: f64) -> f64 {
    const TERMS: [(i32, f64); 12] = [
        (1, 4.0),
        (2, 6.0),
        (3, 2.364_768_4),
        (4, -0.869_855_1),
        (5, 1.106_280_3),
        (6, -1.101_422_1),
        (7, 0.666_058_66),
        (8, -0.036_334_31),
        (10, -0.209_651_64),
        (14, 0.105_555_69),
        (22, -0.008_723_80),
        (0, 1.0),
    ];
    let x = packing_fraction / (1.0 - packing_fraction);
    TERMS
        .iter()
        .map(|&(power, coefficient)| coefficient * x.powi(power))
        .sum()
}

/// Packing fraction of a number density.
pub fn packing_fraction(density: f64) -> f64 {
    PI / 6.0 * density
}

/// Collisions per ball and time at a number density: Enskog's rate with the contact value from the compressibility factor.
///
/// Source: Chapman & Cowling, The Mathematical Theory of Non-Uniform Gases.
pub fn collision_rate(density: f64) -> f64 {
    let packing = packing_fraction(density);
    4.0 * PI.sqrt() * density * (compressibility(packing) - 1.0) / (4.0 * packing)
}

/// Self-diffusion coefficient at a number density, as computer experiments with some hundred balls have it.
///
/// Source: Speedy, Mol. Phys. 62, 509 (1987): a fit from the dilute gas up to 1.08.
pub fn diffusion(density: f64) -> f64 {
    let squared = density * density;
    let dilute = 3.0 / (8.0 * density * PI.sqrt());
    dilute * (1.0 - density / 1.09) * (1.0 + squared * (0.4 - 0.83 * squared))
}

/// Contact value of the pair distribution in a mixture, for diameters `pair`; `moments` are the sums of `diameter^k` per volume
/// for k = 1, 2, 3 over all balls, times pi / 6.
///
/// Source: Boublik, J. Chem. Phys. 53, 471 (1970); Mansoori, Carnahan, Starling, Leland, J. Chem. Phys. 54, 1523 (1971).
pub fn mixture_contact_value(pair: [f64; 2], moments: [f64; 3]) -> f64 {
    let free = 1.0 - moments[2];
    let reduced = pair[0] * pair[1] / (pair[0] + pair[1]);
    1.0 / free
        + 3.0 * moments[1] * reduced / (free * free)
        + 2.0 * moments[1] * moments[1] * reduced * reduced / (free * free * free)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(density: f64, compressibility_factor: f64, rate: f64) {
        let found = compressibility(packing_fraction(density));
        assert!(
            (found - compressibility_factor).abs() < 1e-5 * found,
            "{found}"
        );
        let found = collision_rate(density);
        assert!((found / rate - 1.0).abs() < 1e-5, "{found}");
    }

    #[test]
    fn the_fluid_has_the_tabulated_pressure_and_rate() {
        check(0.1, 1.239_720, 0.811_49);
        check(0.5, 3.269_410, 7.682_27);
        check(0.9, 10.762_74, 33.048_2);
    }

    #[test]
    fn diffusion_is_as_tabulated() {
        for (density, expected) in [(0.2, 0.876), (0.5, 0.240), (0.7, 0.108), (0.9, 0.0319)] {
            let found = diffusion(density);
            assert!((found / expected - 1.0).abs() < 5e-3, "{found}");
        }
    }

    #[test]
    fn a_mixture_of_one_kind_has_the_contact_value_of_carnahan_and_starling() {
        let packing: f64 = 0.3;
        let value = mixture_contact_value([1.0, 1.0], [packing; 3]);
        let expected = (1.0 - 0.5 * packing) / (1.0 - packing).powi(3);
        assert!((value / expected - 1.0).abs() < 1e-12);
    }
}
