//! What kinetic theory says of a gas, from which step, cells and rates are made, and what the method gets wrong.
//!
//! Sources: Chapman & Cowling, The Mathematical Theory of Non-Uniform Gases, for rates; Boublik, J. Chem. Phys. 53, 471 (1970),
//! and Mansoori, Carnahan, Starling, Leland, J. Chem. Phys. 54, 1523 (1971), for contact values (Carnahan and Starling's for
//! balls alike).

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::domain::Boundary;
use crate::state::{Body, State};

/// Mean speed in units of `sqrt(k T / m)`: `sqrt(8 / pi)`.
const MEAN_SPEED: f64 = 1.595_769_121_605_730_8;

/// The gas as a mixture of kinds, in internal units.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Mixture {
    /// The kinds: how many balls of which body.
    kinds: Vec<(f64, Body)>,
    /// Volume of the balls over that of the domain.
    pub packing_fraction: f64,
    /// `pi / 6 sum n d^2`, over the volume of the domain: what the contact values need.
    second_moment: f64,
    /// Volume open to the centres of the mean ball \[length^3\].
    open_volume: f64,
    /// Share of the collisions that walls leave: a ball at a wall has no partners behind it.
    ///
    /// Within a diameter of a wall, the part of the sphere of contact behind it falls from a half to nothing: a quarter on
    /// average (derived here).
    pub shielding: f64,
    /// `k T` \[energy\].
    thermal_energy: f64,
}

/// Mean free time \[epochs\] and mean free path \[length\] of the gas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Free {
    /// Mean time between two collisions of a ball.
    pub time: f64,
    /// Mean way between two collisions of a ball.
    pub path: f64,
}

impl Mixture {
    /// The mixture of a state; `None` if nothing moves.
    pub fn of(state: &State) -> Option<Self> {
        let mut counts = vec![0_u64; state.bodies.kinds().len()];
        (0..state.ball_count()).for_each(|ball| counts[state.bodies.kind(ball)] += 1);
        let kinds: Vec<(f64, Body)> = counts
            .iter()
            .zip(state.bodies.kinds())
            .map(|(&count, &body)| (count as f64, body))
            .collect();
        let volume = state.domain.volume();
        let moment = |power: i32| {
            let term = |(count, body): &(f64, Body)| count * (2.0 * body.radius).powi(power);
            PI / 6.0 * kinds.iter().map(term).sum::<f64>() / volume
        };
        let diameter = 2.0 * state.bodies.mean_radius();
        let edges = 2.0 * state.domain.half_size;
        let (open_volume, shielding) = if state.domain.boundary == Boundary::Container {
            let shielded = 0.5 * diameter * edges.recip().element_sum();
            ((edges - diameter).element_product(), 1.0 - shielded)
        } else {
            (volume, 1.0)
        };
        Some(Self {
            packing_fraction: moment(3),
            second_moment: moment(2),
            kinds,
            open_volume,
            shielding,
            thermal_energy: state
                .totals()
                .thermal_energy()
                .filter(|&energy| energy > 0.0)?,
        })
    }

    /// How much more often two balls touch than in a gas of points.
    pub fn contact_value(&self, radii: [f64; 2]) -> f64 {
        let free = 1.0 - self.packing_fraction;
        let shape = self.second_moment * 2.0 * radii[0] * radii[1] / (radii[0] + radii[1]);
        1.0 / free + 3.0 * shape / (free * free) + 2.0 * shape * shape / (free * free * free)
    }

    fn largest_of(&self, of: impl Fn(&Body, &Body) -> f64) -> f64 {
        let bodies = || self.kinds.iter().map(|(_, body)| body);
        bodies()
            .flat_map(|a| bodies().map(move |b| (a, b)))
            .map(|(a, b)| of(a, b))
            .fold(0.0, f64::max)
    }

    /// Largest product of cross section and contact value of two kinds.
    pub fn largest_section(&self) -> f64 {
        self.largest_of(|a, b| section(a, b) * self.contact_value([a.radius, b.radius]))
    }

    /// Largest product of cross section, contact value and deviation of the relative velocity's components.
    pub fn fastest_meeting(&self) -> f64 {
        self.largest_of(|a, b| {
            let deviation = (self.thermal_energy * (1.0 / a.mass + 1.0 / b.mass)).sqrt();
            section(a, b) * self.contact_value([a.radius, b.radius]) * deviation
        })
    }

    /// Mean free time and path; `None` if no two balls can meet.
    pub fn free(&self) -> Option<Free> {
        let (mut collisions, mut way, mut balls) = (0.0, 0.0, 0.0);
        for (count, a) in &self.kinds {
            for (others, b) in &self.kinds {
                let speed =
                    MEAN_SPEED * (self.thermal_energy * (1.0 / a.mass + 1.0 / b.mass)).sqrt();
                let density = others / self.open_volume;
                collisions += count
                    * density
                    * section(a, b)
                    * self.contact_value([a.radius, b.radius])
                    * speed;
            }
            balls += count;
            way += count * MEAN_SPEED * (self.thermal_energy / a.mass).sqrt();
        }
        let collisions = self.shielding * collisions;
        (collisions > 0.0).then(|| Free {
            time: balls / collisions,
            path: way / collisions,
        })
    }
}

/// Cross section of two balls \[length^2\].
pub fn section(a: &Body, b: &Body) -> f64 {
    let contact = a.radius + b.radius;
    PI * contact * contact
}
