//! A gas between six hard walls.
//!
//! The centres of balls of diameter d live in a box smaller by d, are drawn to the walls (adsorption) and feel less
//! pressure at the edges (wall tension). Scaled-particle theory gives both for balls alike; for mixtures the adsorption is
//! exact at low density and borrows the dense factor of balls alike. The pair rate is scaled so that the virial theorem holds:
//! `3 (P_wall V' - N kT)` is what the pair collisions transfer.
//!
//! How good it is: exact to first order in density and in d / L; within 1 % for the pressure and 2 % for the rates in gases of
//! some hundred balls up to a packing fraction of 0.15, mixtures included (`tests/theory.rs`). Where walls are everywhere it
//! is coarser: a few per cent for 27 balls in a box of 5 diameters or for a dense fluid (0.39) in a box of 11. Beyond a bulk
//! packing fraction of 0.5 balls may freeze; the theory is silent there.
//!
//! Sources: Mansoori et al., J. Chem. Phys. 54, 1523 (1971); Reiss, Frisch, Helfand & Lebowitz, J. Chem. Phys. 32, 119 (1960);
//! Chapman & Cowling, The Mathematical Theory of Non-Uniform Gases.

use std::f64::consts::PI;

use super::kinds::{Kind, Pairs, kinds, mixture_contact_value, moments};
use crate::state::Placement;

/// Beyond this bulk packing fraction the fluid may freeze (freezing begins at 0.494).
const DENSEST_FLUID: f64 = 0.5;

/// Wall pressure over kT, pair rate and wall rate over sqrt(kT); `None` where balls may freeze.
pub(super) fn reduced(placement: &Placement) -> Option<[f64; 3]> {
    let size = 2.0 * placement.domain.half_size;
    let unit = size.max_element();
    let edges = (size / unit).to_array();
    let mut kinds = kinds(placement, unit);
    let count = placement.positions.len() as f64;
    // A ball does not collide with itself: of N^2 pairs, N are none.
    let others = 1.0 - 1.0 / count;

    // Bulk densities: the walls' layers hold more than the bulk does.
    let open = |diameter: f64| Open::new(edges.map(|edge| edge - diameter));
    for _ in 0..200 {
        let [_, _, _, xi3, xi4] = moments(&kinds);
        for kind in &mut kinds {
            let layer = others * (kind.diameter * xi3 + 0.5 * xi4) / (1.0 + 2.0 * xi3);
            let open = open(kind.diameter);
            kind.density = kind.count / (open.volume + open.area * layer);
        }
    }
    let [xi0, xi1, xi2, xi3, _] = moments(&kinds);
    if !(0.0..DENSEST_FLUID).contains(&xi3) || xi0 <= 0.0 {
        return None; // also when a ball fills the container, and without balls
    }

    let contact_value = mixture_contact_value(&kinds);
    let Pairs { excess, collisions } = Pairs::of(&kinds, others, &contact_value);
    let free = 1.0 - xi3;

    // Tension of a wall through the outermost centres, over kT; the ideal gas has none. Negative: crowding at the wall.
    let mean_diameter = xi1 / xi0;
    let tension = others / (4.0 * PI)
        * (18.0 * xi2 * xi2 / (free * free)
            - 36.0 * mean_diameter * (xi1 * xi2 / (free * free) + xi2.powi(3) / free.powi(3)));
    let mean = open(mean_diameter);
    let ideal_force: f64 = kinds
        .iter()
        .map(|kind| kind.density * open(kind.diameter).area)
        .sum();
    let edge_force = 8.0 * tension * mean.edges;
    let force = ideal_force + excess * mean.area - edge_force;

    let adsorbed: f64 = kinds
        .iter()
        .map(|kind| kind.count - kind.density * open(kind.diameter).volume)
        .sum();
    let pair_virial = excess * mean.volume - adsorbed - edge_force * mean.volume / mean.area;
    let near_walls = if excess > 0.0 {
        pair_virial / (excess * mean.volume)
    } else {
        1.0
    };
    let pair_rate = near_walls * collisions * mean.volume;

    // Each kind has its share of the force; a hit transfers sqrt(2 pi m kT) on average.
    let weight = |kind: &Kind| kind.density * contact_value(kind.diameter);
    let weights: f64 = kinds.iter().map(weight).sum();
    let wall_rate: f64 = kinds
        .iter()
        .map(|kind| force * weight(kind) / weights / (2.0 * PI * kind.mass).sqrt())
        .sum();

    let wall_area = Open::new(edges).area;
    Some([
        force / wall_area / unit.powi(3),
        pair_rate / unit,
        wall_rate / unit,
    ])
}

/// A box open to centres.
struct Open {
    volume: f64,
    area: f64,
    /// Sum of its three edges.
    edges: f64,
}

impl Open {
    fn new([x, y, z]: [f64; 3]) -> Self {
        Self {
            volume: x * y * z,
            area: 2.0 * (x * y + y * z + z * x),
            edges: x + y + z,
        }
    }
}
