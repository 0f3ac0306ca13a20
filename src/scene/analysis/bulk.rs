//! A gas without walls: Enskog's theory in a periodic box.
//!
//! Pressure and collision rate follow from the contact values: exact to what the equation of state is good for. Balls alike
//! have the mKLM equation of state as a fluid (up to freezing, packing fraction 0.494) and Speedy's as a face-centred cubic
//! crystal (from melting, 0.545); in between both phases live side by side, and the theory is silent. Mixtures have BMCSL.
//!
//! Sources: Pieprzyk, Bannerman, Branka, Chudak & Heyes, Phys. Chem. Chem. Phys. 21, 6886 (2019), a refit of Kolafa, Labik &
//! Malijevsky (2004); Speedy, J. Phys.: Condens. Matter 10, 4387 (1998); Mansoori et al., J. Chem. Phys. 54, 1523 (1971).

use std::f64::consts::{PI, SQRT_2};

use super::kinds::{Pairs, kinds, mixture_contact_value, moments};
use crate::state::Placement;

/// Packing fraction at which a fluid of balls alike begins to freeze.
const FREEZING: f64 = 0.494;

/// Packing fraction at which a crystal of balls alike begins to melt.
const MELTING: f64 = 0.545;

/// Pressure over kT and pair rate over sqrt(kT); `None` where the phase is not known.
pub(super) fn reduced(placement: &Placement) -> Option<[f64; 2]> {
    let size = 2.0 * placement.domain.half_size;
    let unit = size.max_element();
    let edges = size / unit;
    let volume = edges.element_product();
    let mut kinds = kinds(placement, unit);
    for kind in &mut kinds {
        kind.density = kind.count / volume;
    }
    let count = placement.positions.len() as f64;
    let others = 1.0 - 1.0 / count;
    let [_, _, _, packing_fraction, _] = moments(&kinds);
    let density: f64 = kinds.iter().map(|kind| kind.density).sum();
    let alike = kinds.iter().all(|kind| kind.diameter == kinds[0].diameter);
    let pairs = if packing_fraction == 0.0 {
        Pairs::of(&kinds, others, |_| 1.0) // points among themselves: none meet
    } else if alike {
        let contact = (compressibility_factor(packing_fraction)? - 1.0) / (4.0 * packing_fraction);
        Pairs::of(&kinds, others, |_| contact)
    } else if packing_fraction < FREEZING {
        Pairs::of(&kinds, others, mixture_contact_value(&kinds))
    } else {
        return None;
    };
    (count > 0.0).then(|| {
        [
            (density + pairs.excess) / unit.powi(3),
            pairs.collisions * volume / unit,
        ]
    })
}

/// Value of the radial distribution function at contact in a fluid of balls alike; `None` where they may freeze.
pub(super) fn fluid_contact_value(packing_fraction: f64) -> Option<f64> {
    (0.0 < packing_fraction && packing_fraction <= FREEZING)
        .then(|| (fluid(packing_fraction) - 1.0) / (4.0 * packing_fraction))
}

/// `P V / (N k T)` of balls alike; `None` between freezing and melting and beyond close packing.
fn compressibility_factor(packing_fraction: f64) -> Option<f64> {
    let closest = PI / (3.0 * SQRT_2);
    if packing_fraction <= FREEZING {
        Some(fluid(packing_fraction))
    } else if (MELTING..closest).contains(&packing_fraction) {
        Some(crystal(packing_fraction / closest))
    } else {
        None
    }
}

/// Equation of state of the fluid (mKLM).
fn fluid(packing_fraction: f64) -> f64 {
    const TERMS: [(i32, f64); 12] = [
        (0, 1.0),
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
        (22, -0.008_723_8),
    ];
    let x = packing_fraction / (1.0 - packing_fraction);
    TERMS
        .iter()
        .map(|(power, term)| term * x.powi(*power))
        .sum()
}

/// Equation of state of the face-centred cubic crystal by its density over that of close packing (Speedy).
fn crystal(density: f64) -> f64 {
    3.0 / (1.0 - density) - 0.5921 * (density - 0.7072) / (density - 0.601)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(packing_fraction: f64, expected: f64) {
        let found = compressibility_factor(packing_fraction).expect("one phase");
        assert!((found / expected - 1.0).abs() < 3e-4, "{found}");
    }

    /// The published values: molecular dynamics within 4e-5 for the fluid.
    #[test]
    fn fluid_and_crystal_have_their_published_pressures() {
        let reduced_density = |density: f64| density * PI / 6.0;
        check(reduced_density(0.1), 1.239_720);
        check(reduced_density(0.5), 3.269_410);
        check(reduced_density(0.75), 6.655_081);
        check(reduced_density(0.943), 12.479_46);
        check(0.6, 15.52);
        check(0.7, 54.47);
    }

    #[test]
    fn between_freezing_and_melting_nothing_is_promised() {
        assert_eq!([0.52, 0.75].map(compressibility_factor), [None; 2]);
    }
}
