//! Accounts that must balance: energy, momentum and the virial.
//!
//! The virial ledger is an identity, not a law: `G = sum of m r . v` changes by `2 K` per time in free flight and by `r . dp`
//! at each collision. If `G(t) - G(0)` is not the sum of all that, an event was lost, doubled or misplaced.
//!
//! Source: derived here from `dG/dt = 2 K + sum of r . F` (the virial theorem before averaging).

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::engine::Sums;
use crate::event::{Collision, Participants};
use crate::state::{State, Time, Totals};
use crate::sum::Sum;

/// The accounts of a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Ledger {
    kinetic_energy: f64,
    radial_momentum: Sum,
    momentum: [Sum; 3],
    opened: Time,
    pair_virial: Sum,
    wall_impulse: Sum,
    /// Whether some collisions are known in sums only, so that momentum and virial cannot be balanced.
    summed: bool,
}

/// What does not balance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Kinetic energy over that at the start, minus one.
    pub energy: Option<f64>,
    /// Change of momentum that walls, planes and fixed balls do not explain, over the sum of the magnitudes of all momenta;
    /// `None` where collisions are known in sums only.
    pub momentum: Option<f64>,
    /// What the virial ledger misses, over `2 K t`; `None` likewise.
    pub virial: Option<f64>,
}

impl Ledger {
    /// Opens the accounts at the state's present.
    pub fn new(state: &State) -> Self {
        let sum = |value: f64| Sum::from_iter([value]);
        let totals = state.totals();
        Self {
            kinetic_energy: totals.kinetic_energy,
            radial_momentum: sum(totals.radial_momentum),
            momentum: totals.momentum.to_array().map(sum),
            opened: state.now,
            pair_virial: Sum::default(),
            wall_impulse: Sum::default(),
            summed: false,
        }
    }

    /// Kinetic energy at the start.
    pub fn kinetic_energy(&self) -> f64 {
        self.kinetic_energy
    }

    /// Sum of `r . dp` over all pair collisions so far.
    pub fn pair_virial(&self) -> f64 {
        self.pair_virial.value()
    }

    /// Momentum given to the walls so far, perpendicular to them.
    pub fn wall_impulse(&self) -> f64 {
        self.wall_impulse.value()
    }

    /// Takes a collision into account.
    #[inline]
    pub fn record(&mut self, collision: &Collision) {
        self.radial_momentum.add(collision.radial_jump);
        match collision.participants {
            Participants::Pair(..) => self.pair_virial.add(collision.virial),
            Participants::Wall(..) => self.wall_impulse.add(collision.impulse.length()),
            Participants::Plane(..) | Participants::Face(..) => {}
        }
        if collision.external != DVec3::ZERO {
            for axis in 0..3 {
                self.momentum[axis].add(collision.external[axis]);
            }
        }
    }

    /// Takes sums into account.
    pub fn record_sums(&mut self, sums: &Sums) {
        self.pair_virial.add(sums.pair_virial);
        self.wall_impulse.add(sums.wall_impulse);
        self.summed = true;
    }

    /// Follows a reversal of all velocities; `state` is the gas just after it.
    pub fn reverse(&mut self, state: &State) {
        for momentum in &mut self.momentum {
            *momentum = Sum::from_iter([-momentum.value()]);
        }
        // The reversal turns G into -G: what the gas has now, less what it had.
        self.radial_momentum
            .add(2.0 * state.totals().radial_momentum);
    }

    /// Compares the accounts with what the balls have at a time.
    pub fn drift(&self, now: Time, totals: &Totals) -> Drift {
        let flight = 2.0 * self.kinetic_energy * now.since(self.opened);
        let expected = DVec3::from_array(self.momentum.map(|sum| sum.value()));
        let missing = totals.radial_momentum - self.radial_momentum.value() - flight;
        let scale = totals.momentum_scale;
        Drift {
            energy: (self.kinetic_energy > 0.0)
                .then(|| totals.kinetic_energy / self.kinetic_energy - 1.0),
            momentum: (scale > 0.0 && !self.summed)
                .then(|| (totals.momentum - expected).length() / scale),
            virial: (flight > 0.0 && !self.summed).then(|| missing.abs() / flight),
        }
    }
}
