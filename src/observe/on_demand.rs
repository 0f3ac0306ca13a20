//! The observers that a scene asks for, fed together: by collisions, and by states at equally spaced instants.

use serde::{Deserialize, Serialize};

use crate::event::Collision;
use crate::observe::density_profile::DensityProfile;
use crate::observe::flights::Flights;
use crate::observe::motion::Motion;
use crate::observe::radial_distribution::RadialDistribution;
use crate::observe::relaxation::Relaxation;
use crate::observe::transport::Transport;
use crate::observe::velocities::Velocities;
use crate::state::State;

/// Looks at the state from one at which every ball is counted to the next: balls must have moved on, and it takes time.
pub const LOOKS_PER_COUNT: u64 = 10;

/// Observers that a scene asks for; `None` where it does not.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OnDemand {
    /// Neighbours at each distance.
    pub radial_distribution: Option<RadialDistribution>,
    /// Balls along each axis.
    pub density_profile: Option<DensityProfile>,
    /// Displacements and velocities.
    pub motion: Option<Motion>,
    /// Boltzmann's H.
    pub relaxation: Option<Relaxation>,
    /// Free paths and walls.
    pub flights: Option<Flights>,
    /// Viscosity and conductivity.
    pub transport: Option<Transport>,
    /// For those that need them; else `None`.
    pub velocities: Option<Velocities>,
    /// Looks at the state so far.
    pub looks: u64,
}

impl OnDemand {
    /// Whether nothing is observed.
    pub fn is_idle(&self) -> bool {
        let Self {
            radial_distribution,
            density_profile,
            motion,
            relaxation,
            flights,
            transport,
            velocities: _,
            looks: _,
        } = self;
        radial_distribution.is_none()
            && density_profile.is_none()
            && motion.is_none()
            && relaxation.is_none()
            && flights.is_none()
            && transport.is_none()
    }

    /// Whether collisions are of any use.
    pub fn wants_collisions(&self) -> bool {
        self.velocities.is_some()
    }

    /// Takes a collision into account.
    #[inline]
    pub fn record(&mut self, collision: &Collision) {
        let Some(velocities) = &mut self.velocities else {
            return;
        };
        if let Some(flights) = &mut self.flights {
            flights.record(collision, velocities);
        }
        if let Some(transport) = &mut self.transport {
            transport.record(collision, velocities);
        }
        velocities.follow(collision);
    }

    /// Looks at the state's present, the next of equally spaced instants.
    pub fn look(&mut self, state: &State) {
        let counts = self.looks.is_multiple_of(LOOKS_PER_COUNT);
        if counts {
            if let Some(radial_distribution) = &mut self.radial_distribution {
                radial_distribution.look(state);
            }
            if let Some(density_profile) = &mut self.density_profile {
                density_profile.look(state);
            }
        }
        self.looks += 1;
        if let Some(motion) = &mut self.motion {
            motion.look(state);
        }
        if let Some(relaxation) = &mut self.relaxation {
            relaxation.look(state);
        }
        if let Some(transport) = &mut self.transport {
            transport.look(state);
        }
        if let Some(velocities) = self.velocities.as_mut().filter(|_| counts) {
            velocities.set_right(state);
            if let Some(flights) = &mut self.flights {
                flights.look(state, velocities);
            }
            if let Some(transport) = &mut self.transport {
                transport.set_right(velocities);
            }
        }
    }

    /// Follows a reversal of all velocities; `state` is the gas just after it.
    pub fn reverse(&mut self, state: &State) {
        if let Some(velocities) = &mut self.velocities {
            velocities.reverse(state);
            if let Some(flights) = &mut self.flights {
                flights.interrupt(state, velocities);
            }
            if let Some(transport) = &mut self.transport {
                transport.reverse(state, velocities);
            }
        }
        if let Some(motion) = &mut self.motion {
            motion.reverse(state);
        }
    }
}
