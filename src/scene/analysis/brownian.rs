//! What kinetic theory expects of a heavy ball among light ones: Brownian motion after Langevin.
//!
//! Friction of a heavy sphere in a dilute gas, with the contact value for a denser one:
//! `zeta = sum over kinds of (8/3) n d_12^2 sqrt(2 pi kT mu) g_12`; the velocity is forgotten in `tau = m / zeta`, and after
//! that the ball diffuses with `D = kT / zeta`.
//!
//! Sources: Chapman & Cowling, The Mathematical Theory of Non-Uniform Gases; Uhlenbeck & Ornstein, Phys. Rev. 36, 823 (1930).

use serde::{Deserialize, Serialize};

use std::f64::consts::PI;

use super::body;
use super::kinds::{kinds, mixture_contact_value};
use crate::domain::Boundary;
use crate::snapshot::Units;
use crate::state::Placement;

/// A ball at least this many times as heavy as those that strike it forgets its velocity slowly enough for this theory.
const HEAVY: f64 = 20.0;

/// Brownian motion of one ball.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Brownian {
    boltzmann: f64,
    mass: f64,
    /// Friction over sqrt(kT).
    friction: f64,
    /// Square of the speed at the start.
    speed_squared: f64,
}

impl Brownian {
    /// The motion of a ball of a placed scene; `None` where theory knows none: for light and fixed balls, and where walls or
    /// planes stand in the way.
    pub fn new(placement: &Placement, units: Units, ball: usize) -> Option<Self> {
        let own = body(placement, ball);
        let gas: Vec<_> = (0..placement.positions.len())
            .filter(|&other| other != ball)
            .collect();
        let heaviest = gas
            .iter()
            .map(|&other| body(placement, other).mass)
            .fold(0.0, f64::max);
        let is_known = placement.domain.boundary == Boundary::Periodic
            && placement.domain.planes.is_empty()
            && own.mass.is_finite()
            && heaviest > 0.0
            && own.mass >= HEAVY * heaviest;
        if !is_known {
            return None;
        }
        let edges = placement.domain.period();
        let unit = edges.max_element();
        let mut kinds = kinds(placement, unit);
        for kind in &mut kinds {
            kind.density = kind.count / (edges / unit).element_product();
        }
        let contact_value = mixture_contact_value(&kinds);
        let diameter = 2.0 * own.radius / unit;
        // The ball itself is among the kinds; it does not strike itself.
        let friction = kinds
            .iter()
            .filter(|kind| kind.mass < own.mass)
            .map(|kind| {
                let distance = 0.5 * (diameter + kind.diameter);
                let contact =
                    contact_value(0.5 * diameter * kind.diameter / distance.max(f64::MIN_POSITIVE));
                let reduced_mass = kind.mass / (1.0 + kind.mass / own.mass);
                8.0 / 3.0
                    * kind.density
                    * distance.powi(2)
                    * (2.0 * PI * reduced_mass).sqrt()
                    * contact
            });
        let friction = friction.sum::<f64>() / unit;
        (friction > 0.0).then(|| Self {
            boltzmann: units.boltzmann(),
            mass: own.mass,
            friction,
            speed_squared: placement.velocities[ball].length_squared(),
        })
    }

    /// Mean of the squared displacement after a time, over all that may happen to a ball with its speed at the start.
    pub fn displacement_squared(&self, temperature: f64, time: f64) -> f64 {
        let energy = self.boltzmann * temperature;
        let relaxation = self.mass / (self.friction * energy.sqrt());
        let (steps, gone) = (time / relaxation, -(-time / relaxation).exp_m1());
        let flight = self.speed_squared * (relaxation * gone).powi(2);
        // 2 s - 3 + 4 exp(-s) - exp(-2 s), which is 2 s^3 / 3 for small s, where the terms cancel.
        let spread = if steps < 1e-3 {
            2.0 / 3.0 * steps.powi(3)
        } else {
            2.0 * (steps - gone) - gone * gone
        };
        flight + 3.0 * energy / self.mass * relaxation * relaxation * spread
    }

    /// The same, averaged over all moments of a long run, at which it has any of its thermal speeds.
    pub fn mean_square_displacement(&self, temperature: f64, time: f64) -> f64 {
        let thermal = Self {
            speed_squared: 3.0 * self.boltzmann * temperature / self.mass,
            ..*self
        };
        thermal.displacement_squared(temperature, time)
    }

    /// Mass of the ball.
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// Time in which the ball forgets its velocity.
    pub fn relaxation_time(&self, temperature: f64) -> f64 {
        self.mass / (self.friction * (self.boltzmann * temperature).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::Scene;

    #[test]
    fn a_grain_flies_then_diffuses() {
        let scene = Scene::load(Path::new("configs/brownian.toml")).expect("a good scene");
        let mut balls = scene.place().expect("a good scene");
        let grain = Brownian::new(&balls, scene.units, 27_000).expect("it is heavy");
        let tau = grain.relaxation_time(273.15);
        let energy = scene.units.boltzmann() * 273.15;
        // n = 2.7e25, d = 5.173 nm: the formula by hand, contact value 1 within 0.5 %.
        let zeta =
            8.0 / 3.0 * 2.7e25 * 5.173e-9_f64.powi(2) * (2.0 * PI * energy * 5.297e-26).sqrt();
        assert!((1e-22 / zeta / tau - 1.0).abs() < 0.005, "{tau}");
        let late = grain.displacement_squared(273.15, 1e4 * tau);
        assert!((late / (6.0 * energy / zeta * 1e4 * tau) - 1.0).abs() < 0.005);
        // The two branches meet, and with a thermal speed the flight is ballistic at first.
        let [below, above] =
            [0.999e-3, 1.001e-3].map(|s| grain.displacement_squared(273.15, s * tau));
        assert!((above / below - (1.001_f64 / 0.999).powi(3)).abs() < 1e-3);
        balls.velocities[27_000].x = (3.0 * energy / 1e-22).sqrt();
        let moving = Brownian::new(&balls, scene.units, 27_000).expect("it is heavy");
        let time = 0.5 * tau;
        let textbook = 6.0 * energy * tau / 1e-22 * (time - tau * (1.0 - (-time / tau).exp()));
        assert!((moving.displacement_squared(273.15, time) / textbook - 1.0).abs() < 1e-12);
        assert_eq!(Brownian::new(&balls, scene.units, 0), None, "a light ball");
    }
}
