//! How balls move on: mean square displacement and velocity autocorrelation of species and of named balls.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::observe::correlator::{Correlator, Kind};
use crate::state::{State, Time};

/// Motion of chosen balls, relative to the drift of the whole gas.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    balls: Vec<u32>,
    drift: DVec3,
    /// What the drift has moved everything by, since the start.
    drifted: DVec3,
    last_look: Time,
    /// Mean square displacement of each group.
    pub displacement: Correlator,
    /// Velocity autocorrelation of each group.
    pub velocity: Correlator,
}

impl Motion {
    /// Follows these balls, each with its group, from 0 to `group_count`.
    pub fn new(state: &State, tracked: &[(u32, u16)], group_count: usize) -> Self {
        let groups: Vec<u16> = tracked.iter().map(|&(_, group)| group).collect();
        Self {
            balls: tracked.iter().map(|&(ball, _)| ball).collect(),
            drift: state.totals().drift(),
            drifted: DVec3::ZERO,
            last_look: state.now,
            displacement: Correlator::new(Kind::Displacement, groups.clone(), group_count),
            velocity: Correlator::new(Kind::Product, groups, group_count),
        }
    }

    /// Takes the state's present as the next of equally spaced instants.
    pub fn look(&mut self, state: &State) {
        self.drifted += self.drift * state.now.since(self.last_look);
        self.last_look = state.now;
        let place = |&ball: &u32| state.unwrapped_position(ball as usize) - self.drifted;
        let velocity = |&ball: &u32| state.trajectories[ball as usize].velocity - self.drift;
        let places: Vec<DVec3> = self.balls.iter().map(place).collect();
        let velocities: Vec<DVec3> = self.balls.iter().map(velocity).collect();
        self.displacement.record(&places);
        self.velocity.record(&velocities);
    }

    /// Follows a reversal: what comes after it is not correlated with what came before.
    pub fn reverse(&mut self, state: &State) {
        self.drifted += self.drift * state.now.since(self.last_look);
        self.last_look = state.now;
        self.drift = -self.drift;
        self.displacement.interrupt();
        self.velocity.interrupt();
    }
}
