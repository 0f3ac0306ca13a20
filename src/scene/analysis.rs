//! What a scene is before it runs: how full and how hot, what of it will be modelled, and what kinetic theory says of it.
//!
//! Bulk: contact values from the best equations of state at hand give the pressure, and with it the rate of pair collisions
//! `n_i n_j d_ij^2 sqrt(8 pi kT / mu_ij) g_ij` (Enskog's theory). In a container walls add their share. Where theory knows
//! nothing it says nothing: of a handful of balls, in open space, beside planes and obstacles, between freezing and melting.

mod brownian;
mod bulk;
mod choices;
mod container;
mod enskog;
mod kinds;

use serde::{Deserialize, Serialize};

use std::f64::consts::PI;

use glam::DVec3;

use crate::domain::Boundary;
use crate::snapshot::{Expected, Units};
use crate::state::{Body, Placement};

pub use brownian::Brownian;
pub use choices::choices;
pub use enskog::{Enskog, free_flights};

/// Fewer balls than this have no averages that theory could know.
pub const FEWEST: usize = 10;

/// Radius and mass of a ball.
fn body(placement: &Placement, ball: usize) -> Body {
    placement.bodies[placement.body_of.get(ball).map_or(0, |&body| body as usize)]
}

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

/// Temperature of the balls as placed, `2 K / (3 N k)`; `None` without balls that can move.
///
/// In a periodic box the motion of the centre of mass is left out, and its three degrees of freedom with it.
pub fn temperature(placement: &Placement, units: Units) -> Option<f64> {
    let moving = (placement.velocities.iter().enumerate())
        .map(|(ball, velocity)| (body(placement, ball).mass, *velocity))
        .filter(|(mass, _)| mass.is_finite());
    let (mut count, mut mass, mut momentum) = (0.0, 0.0, DVec3::ZERO);
    for (ball_mass, velocity) in moving.clone() {
        count += 1.0;
        mass += ball_mass;
        momentum += ball_mass * velocity;
    }
    let (drift, freedom) = if placement.domain.boundary == Boundary::Periodic {
        (momentum / mass, 3.0 * (count - 1.0))
    } else {
        (DVec3::ZERO, 3.0 * count)
    };
    let twice_energy: f64 = moving
        .map(|(mass, velocity)| mass * (velocity - drift).length_squared())
        .sum();
    (freedom > 0.0).then(|| twice_energy / (freedom * units.boltzmann()))
}

/// Theory of one scene: all that does not depend on the temperature, computed once.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Theory {
    boltzmann: f64,
    /// Pressure over kT.
    pressure: Option<f64>,
    /// Pair rate over sqrt(kT).
    pair_rate: Option<f64>,
    /// Wall rate over sqrt(kT).
    wall_rate: Option<f64>,
}

impl Theory {
    /// The theory of a placed scene.
    pub fn new(placement: &Placement, units: Units) -> Self {
        let known = placement.positions.len() >= FEWEST
            && placement.domain.planes.is_empty()
            && placement.bodies.iter().all(|body| body.mass.is_finite());
        let (pressure, pair_rate, wall_rate) = match placement.domain.boundary {
            _ if !known => (None, None, None),
            Boundary::Container => container::reduced(placement)
                .map_or((None, None, None), |[pressure, pairs, walls]| {
                    (Some(pressure), Some(pairs), Some(walls))
                }),
            Boundary::Periodic => bulk::reduced(placement)
                .map_or((None, None, None), |[pressure, pairs]| {
                    (Some(pressure), Some(pairs), None)
                }),
            Boundary::Open => (None, None, None),
        };
        Self {
            boltzmann: units.boltzmann(),
            pressure,
            pair_rate,
            wall_rate,
        }
    }

    /// What to expect at a temperature. Cheap: a few multiplications.
    pub fn at(&self, temperature: f64) -> Expected {
        let energy = self.boltzmann * temperature; // kT
        let times = |reduced: Option<f64>, factor: f64| {
            Some(reduced? * factor).filter(|value| value.is_finite())
        };
        Expected {
            pressure: times(self.pressure, energy),
            pair_rate: times(self.pair_rate, energy.sqrt()),
            wall_rate: times(self.wall_rate, energy.sqrt()),
        }
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
    fn points_hit_walls_only() {
        let scene = box_of("[[species]]\ncount = 10\nradius = 0\nmass = 1\n");
        let [pressure, pair_rate, _] = expected(&scene, 1.0);
        near(pressure, 10.0 / 9000.0, 1e-14);
        assert_eq!(pair_rate, 0.0);
    }

    #[test]
    fn the_theory_is_silent_without_balls_and_where_balls_freeze() {
        let crystal = "units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [5, 5, 5]\n\
                       [[species]]\ncount = 125\nradius = 0.5\nmass = 1\n";
        let crystal = Scene::parse(Path::new("scene.toml"), crystal).expect("a good scene");
        let one = box_of("[[ball]]\nposition = [0, 0, 0]\nradius = 1\nmass = 1\n");
        for scene in [box_of(""), one, crystal] {
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
