//! What kinetic theory says of a scene before it runs: Enskog's theory of hard spheres between hard walls.
//!
//! Bulk: the contact values of Boublik, Mansoori, Carnahan, Starling and Leland (BMCSL; Carnahan-Starling for balls alike)
//! give the pressure, and with it the rate of pair collisions `n_i n_j d_ij^2 sqrt(8 pi kT / mu_ij) g_ij`.
//!
//! Walls: the centres of balls of diameter d live in a box smaller by d, are drawn to the walls (adsorption) and feel less
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

use crate::snapshot::{Expected, Units};
use crate::state::Placement;

/// Beyond this bulk packing fraction the fluid may freeze (freezing begins at 0.494).
const DENSEST_FLUID: f64 = 0.5;

/// More kinds of balls than this are lumped into so many groups of like radius.
const MOST_KINDS: usize = 64;

/// Volume of the balls over the volume of the domain.
pub fn packing_fraction(placement: &Placement) -> f64 {
    let edges = 2.0 * placement.domain.half_size;
    let volume =
        |radius: f64| 4.0 / 3.0 * PI * (radius / edges.x) * (radius / edges.y) * (radius / edges.z);
    match placement.bodies.as_slice() {
        [body] => placement.positions.len() as f64 * volume(body.radius),
        bodies => placement
            .body_of
            .iter()
            .map(|&body| volume(bodies[body as usize].radius))
            .sum(),
    }
}

/// Temperature of the balls as placed, `2 K / (3 N k)`; `None` without balls.
pub fn temperature(placement: &Placement, units: Units) -> Option<f64> {
    let mass = |index: usize| {
        placement.bodies[placement
            .body_of
            .get(index)
            .map_or(0, |&body| body as usize)]
        .mass
    };
    let energies = placement
        .velocities
        .iter()
        .enumerate()
        .map(|(index, v)| 0.5 * mass(index) * v.length_squared());
    let count = placement.velocities.len() as f64;
    (count > 0.0).then(|| 2.0 * energies.sum::<f64>() / (3.0 * count * units.boltzmann()))
}

/// Theory of one scene: all that does not depend on the temperature, computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Theory {
    boltzmann: f64,
    /// Wall pressure over kT, pair rate and wall rate over sqrt(kT); `None` where the theory is silent.
    reduced: Option<[f64; 3]>,
}

impl Theory {
    /// The theory of a placed scene.
    pub fn new(placement: &Placement, units: Units) -> Self {
        Self {
            boltzmann: units.boltzmann(),
            reduced: reduced(placement),
        }
    }

    /// What to expect at a temperature. Cheap: a few multiplications.
    pub fn at(&self, temperature: f64) -> Expected {
        let energy = self.boltzmann * temperature; // kT
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        let Some([pressure, pair_rate, wall_rate]) = self.reduced else {
            return Expected::default();
        };
        Expected {
            pressure: finite(pressure * energy),
            pair_rate: finite(pair_rate * energy.sqrt()),
            wall_rate: finite(wall_rate * energy.sqrt()),
        }
    }
}

/// Balls alike, lengths in units of the largest edge.
#[derive(Clone, Copy)]
struct Kind {
    count: f64,
    diameter: f64,
    mass: f64,
    /// Number per volume of the bulk, far from the walls.
    density: f64,
}

fn reduced(placement: &Placement) -> Option<[f64; 3]> {
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

    // Sums over pairs of kinds: pressure beyond the ideal gas's over kT, collisions per volume over sqrt(kT).
    let free = 1.0 - xi3;
    let contact_value = |shape: f64| {
        1.0 / free + 3.0 * xi2 * shape / (free * free) + 2.0 * (xi2 * shape).powi(2) / free.powi(3)
    };
    let (mut excess, mut collisions) = (0.0, 0.0);
    for a in &kinds {
        for b in &kinds {
            let distance = 0.5 * (a.diameter + b.diameter);
            let contact = contact_value(0.5 * a.diameter * b.diameter / distance);
            let pairs = others * a.density * b.density * contact;
            excess += 2.0 * PI / 3.0 * pairs * distance.powi(3);
            collisions +=
                0.5 * pairs * distance.powi(2) * (8.0 * PI * (1.0 / a.mass + 1.0 / b.mass)).sqrt();
        }
    }

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

/// `pi / 6 sum n_i d_i^k` for k from 0 to 4.
fn moments(kinds: &[Kind]) -> [f64; 5] {
    [0, 1, 2, 3, 4].map(|k| {
        PI / 6.0
            * kinds
                .iter()
                .map(|kind| kind.density * kind.diameter.powi(k))
                .sum::<f64>()
    })
}

fn kinds(placement: &Placement, unit: f64) -> Vec<Kind> {
    let mut counts = vec![0_usize; placement.bodies.len()];
    match placement.body_of.as_slice() {
        [] => counts.fill(placement.positions.len()),
        body_of => body_of.iter().for_each(|&body| counts[body as usize] += 1),
    }
    let mut kinds: Vec<Kind> = (placement.bodies.iter().zip(counts))
        .map(|(body, count)| Kind {
            count: count as f64,
            diameter: 2.0 * body.radius / unit,
            mass: body.mass,
            density: 0.0,
        })
        .collect();
    if kinds.len() > MOST_KINDS {
        kinds.sort_by(|a, b| a.diameter.total_cmp(&b.diameter));
        kinds = kinds
            .chunks(kinds.len().div_ceil(MOST_KINDS))
            .map(lump)
            .collect();
    }
    kinds
}

/// One kind with the mean radius and mass of several.
fn lump(kinds: &[Kind]) -> Kind {
    let count: f64 = kinds.iter().map(|kind| kind.count).sum();
    let mean =
        |of: fn(&Kind) -> f64| kinds.iter().map(|kind| kind.count * of(kind)).sum::<f64>() / count;
    Kind {
        count,
        diameter: mean(|kind| kind.diameter),
        mass: mean(|kind| kind.mass),
        density: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::Scene;

    fn expected(scene: &Scene, temperature: f64) -> [f64; 3] {
        let placement = scene.place().expect("a good scene");
        let expected = Theory::new(&placement, scene.units).at(temperature);
        [expected.pressure, expected.pair_rate, expected.wall_rate]
            .map(|value| value.expect("a fluid"))
    }

    #[track_caller]
    fn near(found: f64, expected: f64, tolerance: f64) {
        assert!(
            (found / expected - 1.0).abs() <= tolerance,
            "{found} is not {expected} within {tolerance}"
        );
    }

    /// The gas of the embedded scene from first-order formulas: P = nkT (1 + 4 phi + d/L), and half of N nu pair collisions.
    #[test]
    fn oxygen_has_its_textbook_pressure_and_rates() {
        let [pressure, pair_rate, wall_rate] = expected(&Scene::oxygen(), 273.15);
        near(pressure, 98_804.0, 2e-5);
        near(pair_rate, 2.087e15, 2e-3); // the walls' first order adds 0.17 %
        near(wall_rate, 1.506e15, 5e-4);
    }

    /// Bands measured by independent simulations of the same box.
    #[test]
    fn five_hundred_balls_between_near_walls_lie_in_the_measured_bands() {
        let scene = Scene::load(Path::new("configs/seed-512.toml")).expect("a good scene");
        let [pressure, pair_rate, wall_rate] = expected(&scene, 1.0);
        near(pressure, 0.38, 0.03);
        near(pair_rate, 565.5, 0.015);
        near(wall_rate, 163.0, 0.01);
    }

    fn box_of(species: &str) -> Scene {
        let text = format!(
            "units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [20, 15, 30]\n{species}"
        );
        Scene::parse(Path::new("scene.toml"), &text).expect("a good scene")
    }

    #[test]
    fn a_gas_split_into_two_kinds_alike_in_radius_is_the_same_gas() {
        let one = "[[species]]\ncount = 1000\nradius = 0.5\nmass = 2\n";
        // A mass that differs in the last bit only makes another kind.
        let two = "[[species]]\ncount = 999\nradius = 0.5\nmass = 2\n\
                   [[ball]]\nposition = [9.4, 6.9, 14.4]\nradius = 0.5\nmass = 2.0000000000000004\n";
        let lattice = "placement = { kind = \"lattice\", spacing = 1.3 }\n";
        let one = expected(&box_of(&(one.to_owned() + lattice)), 0.7);
        let two = expected(
            &box_of(&two.replacen("[[ball]]", &(lattice.to_owned() + "[[ball]]"), 1)),
            0.7,
        );
        for (one, two) in one.into_iter().zip(two) {
            near(two, one, 1e-12);
        }
    }

    #[test]
    fn one_ball_hits_walls_only() {
        let scene = box_of("[[ball]]\nposition = [0, 0, 0]\nradius = 1e-4\nmass = 1\n");
        let [pressure, pair_rate, _] = expected(&scene, 1.0);
        near(pressure, 1.0 / 9000.0, 2e-5);
        assert_eq!(pair_rate, 0.0);
    }

    #[test]
    fn the_theory_is_silent_without_balls_and_where_balls_freeze() {
        let crystal = "units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [5, 5, 5]\n\
                       [[species]]\ncount = 125\nradius = 0.5\nmass = 1\n";
        let crystal = Scene::parse(Path::new("scene.toml"), crystal).expect("a good scene");
        for scene in [box_of(""), crystal] {
            let placement = scene.place().expect("a good scene");
            assert_eq!(
                Theory::new(&placement, scene.units).at(1.0),
                Expected::default()
            );
        }
    }

    #[test]
    fn polydisperse_balls_are_lumped_without_changing_the_gas_much() {
        let kind = |k: usize| {
            format!(
                "[[ball]]\nposition = [{}, 0, 0]\nradius = 0.1{k:03}\nmass = 1\n",
                k as f64 * 0.28 - 9.8
            )
        };
        let many: String = (0..70).map(kind).collect();
        let [pressure, ..] = expected(&box_of(&many), 1.0);
        near(pressure, 70.0 / 9000.0, 0.03);
    }
}
