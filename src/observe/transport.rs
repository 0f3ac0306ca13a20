//! Shear viscosity and thermal conductivity of a periodic gas, from the moments that Einstein's relation wants.
//!
//! `W` is the integral over time of the off-diagonal stress (times the volume), `Q` that of the energy current: both grow
//! steadily between collisions and jump at each one, by `r_ij dp` and `r_ij dE`. Their mean square displacements grow with
//! slopes `2 V kT eta` and `2 V k T^2 lambda` per component.
//!
//! Source: Helfand, Phys. Rev. 119, 1 (1960); Alder, Gass & Wainwright, J. Chem. Phys. 53, 3813 (1970).

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::event::{Collision, Participants};
use crate::observe::correlator::{Correlator, Kind};
use crate::observe::velocities::Velocities;
use crate::state::{State, Time};
use crate::sum::Sum;

/// The group of the stress in [`Transport::moments`].
pub const STRESS: usize = 0;

/// The group of the energy current in [`Transport::moments`].
pub const HEAT: usize = 1;

/// Integrals of stress and energy current.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Transport {
    /// Rates of `W` (xy, yz, zx) and `Q` between collisions.
    rates: [DVec3; 2],
    integrals: [[Sum; 3]; 2],
    since: Time,
    /// Mean square displacements of both integrals, the sum of three components each.
    pub moments: Correlator,
}

impl Transport {
    /// Begins at the state's present.
    pub fn new(state: &State, velocities: &Velocities) -> Self {
        Self {
            rates: rates(velocities),
            integrals: Default::default(),
            since: state.now,
            moments: Correlator::new(Kind::Displacement, vec![STRESS as u16, HEAT as u16], 2),
        }
    }

    /// Takes a collision into account; the velocities are those before it.
    #[inline]
    pub fn record(&mut self, collision: &Collision, velocities: &Velocities) {
        let Participants::Pair(first, second) = collision.participants else {
            return;
        };
        self.fly_until(collision.time);
        let impulse = collision.impulse;
        let squared = impulse.length_squared();
        if squared == 0.0 {
            return;
        }
        // The line of centres is that of the impulse, and the virial is their product.
        let separation = impulse * (collision.virial / squared);
        let mut gained = 0.0;
        for (ball, impulse) in [(first, impulse), (second, -impulse)] {
            let (before, mass) = (velocities.of_ball(ball), velocities.mass(ball));
            let after = before + impulse / mass;
            let (had, has) = (rates_of(before, mass), rates_of(after, mass));
            self.rates[STRESS] += has[STRESS] - had[STRESS];
            self.rates[HEAT] += has[HEAT] - had[HEAT];
            if ball == first {
                gained = before.dot(impulse) + 0.5 * impulse.length_squared() / mass;
            }
        }
        self.jump(STRESS, off_diagonal(separation, impulse));
        self.jump(HEAT, separation * gained);
    }

    fn jump(&mut self, which: usize, by: DVec3) {
        for (sum, by) in self.integrals[which].iter_mut().zip(by.to_array()) {
            sum.add(by);
        }
    }

    fn fly_until(&mut self, time: Time) {
        let elapsed = time.since(self.since);
        self.since = time;
        for which in [STRESS, HEAT] {
            self.jump(which, self.rates[which] * elapsed);
        }
    }

    /// Takes the state's present as the next of equally spaced instants.
    pub fn look(&mut self, state: &State) {
        self.fly_until(state.now);
        let moments = self
            .integrals
            .map(|sums| DVec3::from_array(sums.map(|sum| sum.value())));
        self.moments.record(&moments);
    }

    /// Takes the rates from velocities that have just been set right, so that rounding does not gather; after a look.
    pub fn set_right(&mut self, velocities: &Velocities) {
        self.rates = rates(velocities);
    }

    /// Follows a reversal of all velocities.
    pub fn reverse(&mut self, state: &State, velocities: &Velocities) {
        self.fly_until(state.now);
        self.rates = rates(velocities);
        self.moments.interrupt();
    }
}

fn rates(velocities: &Velocities) -> [DVec3; 2] {
    let mut total = [DVec3::ZERO; 2];
    for (velocity, mass) in velocities.all() {
        let [stress, heat] = rates_of(velocity, mass);
        total[STRESS] += stress;
        total[HEAT] += heat;
    }
    total
}

fn rates_of(velocity: DVec3, mass: f64) -> [DVec3; 2] {
    [
        mass * off_diagonal(velocity, velocity),
        0.5 * mass * velocity.length_squared() * velocity,
    ]
}

fn off_diagonal(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(a.x * b.y, a.y * b.z, a.z * b.x)
}
