//! Enskog's theory of transport in a gas of balls alike: self-diffusion, shear viscosity, thermal conductivity, and the
//! distribution of free flights.
//!
//! Sources: Chapman & Cowling, The Mathematical Theory of Non-Uniform Gases, on dense gases, with the prefactors of the higher
//! Sonine approximations. Computer experiments lie above Enskog's diffusion by up to a fifth at intermediate density (Alder,
//! Gass & Wainwright, J. Chem. Phys. 53, 3813, 1970), and below it near freezing.

use serde::{Deserialize, Serialize};

use std::f64::consts::PI;

use super::{bulk, packing_fraction};
use crate::snapshot::Units;
use crate::state::{Body, Placement};

/// Steps of the integral over speeds.
const SPEED_STEPS: usize = 400;

/// A gas of balls alike.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Enskog {
    boltzmann: f64,
    body: Body,
    density: f64,
    contact_value: f64,
}

impl Enskog {
    /// The theory of a placed scene; `None` unless it is a fluid of balls alike, of one radius greater than zero.
    pub fn new(placement: &Placement, units: Units) -> Option<Self> {
        let [body] = placement.bodies.as_slice() else {
            return None;
        };
        let known =
            body.radius > 0.0 && body.mass.is_finite() && placement.domain.planes.is_empty();
        let contact_value =
            bulk::fluid_contact_value(packing_fraction(placement)).filter(|_| known)?;
        Some(Self {
            boltzmann: units.boltzmann(),
            body: *body,
            density: placement.positions.len() as f64 / placement.domain.volume(),
            contact_value,
        })
    }

    /// Value of the radial distribution function at contact.
    pub fn contact_value(&self) -> f64 {
        self.contact_value
    }

    /// The contact value that a rate of collisions per ball stands for.
    pub fn contact_value_of_rate(&self, collision_rate: f64, temperature: f64) -> f64 {
        let per_contact = 4.0 * PI.sqrt() * self.density * self.diameter() * self.diameter();
        collision_rate / (per_contact * (self.energy(temperature) / self.body.mass).sqrt())
    }

    /// The contact value that a compressibility factor stands for.
    pub fn contact_value_of_pressure(&self, compressibility_factor: f64) -> f64 {
        (compressibility_factor - 1.0) / self.covolume()
    }

    /// Self-diffusion coefficient \[length^2 per time\].
    pub fn diffusion(&self, temperature: f64) -> f64 {
        let speed = (self.energy(temperature) / (PI * self.body.mass)).sqrt();
        let diameter = self.diameter();
        1.018_96 * 3.0 / (8.0 * self.density * diameter * diameter) * speed / self.contact_value
    }

    /// Shear viscosity \[pressure times time\].
    pub fn viscosity(&self, temperature: f64) -> f64 {
        let dilute = 1.016_034 * 5.0 / (16.0 * self.diameter().powi(2))
            * (self.body.mass * self.energy(temperature) / PI).sqrt();
        dilute * self.dense(0.8, 0.7614)
    }

    /// Thermal conductivity \[energy per length, time and temperature\].
    pub fn conductivity(&self, temperature: f64) -> f64 {
        let dilute = 1.025_218 * 75.0 / (64.0 * self.diameter().powi(2))
            * (self.energy(temperature) / (PI * self.body.mass)).sqrt()
            * self.boltzmann;
        dilute * self.dense(1.2, 0.7574)
    }

    fn dense(&self, linear: f64, quadratic: f64) -> f64 {
        let covolume = self.covolume();
        1.0 / self.contact_value
            + linear * covolume
            + quadratic * covolume * covolume * self.contact_value
    }

    /// Four times the packing fraction.
    fn covolume(&self) -> f64 {
        2.0 / 3.0 * PI * self.density * self.diameter().powi(3)
    }

    fn energy(&self, temperature: f64) -> f64 {
        self.boltzmann * temperature
    }

    fn diameter(&self) -> f64 {
        2.0 * self.body.radius
    }
}

/// Share of the free paths in each of `count` bins, each `width` mean free paths wide, and of the free times in bins as many
/// mean free times wide: a ball of speed `v` collides at the rate that its speed makes, at any moment.
pub fn free_flights(count: usize, width: f64) -> Vec<[f64; 2]> {
    // Speeds in units of sqrt(2 kT / m), rates in units of their mean.
    let speeds = (0..SPEED_STEPS).map(|step| (step as f64 + 0.5) * 5.0 / SPEED_STEPS as f64);
    let flights: Vec<[f64; 3]> = speeds
        .map(|speed| {
            let gauss = libm::exp(-speed * speed);
            let rate = gauss + (2.0 * speed + 1.0 / speed) * 0.5 * PI.sqrt() * libm::erf(speed);
            [speed, rate, speed * speed * gauss * rate]
        })
        .collect();
    let weights: f64 = flights.iter().map(|flight| flight[2]).sum();
    let balls: f64 = flights.iter().map(|[_, rate, weight]| weight / rate).sum();
    let mean_rate = weights / balls;
    let mean_path = flights
        .iter()
        .map(|[speed, rate, weight]| weight * speed / rate)
        .sum::<f64>()
        / weights;
    let beyond = |bin: usize, of_speed: fn(f64) -> f64, unit: f64| {
        let distance = bin as f64 * width * unit;
        let still = |[speed, rate, weight]: &[f64; 3]| {
            weight * libm::exp(-distance * rate / of_speed(*speed))
        };
        flights.iter().map(still).sum::<f64>() / weights
    };
    (0..count)
        .map(|bin| {
            let share = |of_speed: fn(f64) -> f64, unit: f64| {
                let end = if bin + 1 == count {
                    0.0
                } else {
                    beyond(bin + 1, of_speed, unit)
                };
                beyond(bin, of_speed, unit) - end
            };
            [
                share(|speed| speed, mean_path),
                share(|_| 1.0, 1.0 / mean_rate),
            ]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_density(density: f64) -> Enskog {
        Enskog {
            boltzmann: 1.0,
            body: Body {
                radius: 0.5,
                mass: 1.0,
            },
            density,
            contact_value: bulk::fluid_contact_value(density * PI / 6.0).expect("a fluid"),
        }
    }

    #[track_caller]
    fn check(density: f64, viscosity: f64, conductivity: f64) {
        let gas = at_density(density);
        for (found, expected) in [
            (gas.viscosity(1.0), viscosity),
            (gas.conductivity(1.0), conductivity),
        ] {
            assert!((found / expected - 1.0).abs() < 5e-3, "{found} {expected}");
        }
    }

    /// Published values of Enskog's theory.
    #[test]
    fn transport_coefficients_are_enskogs() {
        check(0.1, 0.193, 0.788);
        check(0.5, 0.557, 2.384);
        check(0.9, 2.81, 11.1);
        let diffusion = at_density(0.5).diffusion(1.0);
        assert!(
            (diffusion / (0.240 / 1.20) - 1.0).abs() < 0.01,
            "{diffusion}"
        );
        let gas = at_density(0.5);
        assert!((gas.contact_value_of_rate(7.68227, 1.0) / 2.1671 - 1.0).abs() < 1e-4);
        assert!((gas.contact_value_of_pressure(3.269_41) / 2.1671 - 1.0).abs() < 1e-4);
    }

    #[test]
    fn free_flights_have_all_shares_and_their_mean() {
        let shares = free_flights(160, 0.05);
        for which in [0, 1] {
            let total: f64 = shares.iter().map(|share| share[which]).sum();
            assert!((total - 1.0).abs() < 1e-9, "{total}");
            let mean: f64 = (shares.iter().enumerate())
                .map(|(bin, share)| share[which] * (bin as f64 + 0.5) * 0.05)
                .sum();
            assert!((mean - 1.0).abs() < 0.01, "{mean}");
        }
    }
}
