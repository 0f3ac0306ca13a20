//! The velocity of every ball, followed from collision to collision for those observers that need it.
//!
//! An engine reports what a collision gave to the balls, not what they had; whoever needs both keeps account here. Rounding is
//! set right at some looks at the state.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::event::{Collision, Participants};
use crate::state::{Bodies, State};

/// Velocities and masses of all balls, relative to a drift of the whole gas.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Velocities {
    bodies: Bodies,
    drift: DVec3,
    of_balls: Vec<DVec3>,
}

impl Velocities {
    /// The velocities of the present.
    pub fn of(state: &State) -> Self {
        let mut followed = Self {
            bodies: state.bodies.clone(),
            drift: state.totals().drift(),
            of_balls: vec![DVec3::ZERO; state.ball_count()],
        };
        followed.set_right(state);
        followed
    }

    /// Takes the velocities from the state, which has them exactly.
    pub fn set_right(&mut self, state: &State) {
        for (velocity, flight) in self.of_balls.iter_mut().zip(&state.trajectories) {
            *velocity = flight.velocity - self.drift;
        }
    }

    /// Follows a reversal of all velocities.
    pub fn reverse(&mut self, state: &State) {
        self.drift = -self.drift;
        self.set_right(state);
    }

    /// Velocity of a ball.
    #[inline]
    pub fn of_ball(&self, ball: u32) -> DVec3 {
        self.of_balls[ball as usize]
    }

    /// Mass of a ball.
    #[inline]
    pub fn mass(&self, ball: u32) -> f64 {
        self.bodies.of(ball as usize).mass
    }

    /// Velocities and masses of all balls.
    pub fn all(&self) -> impl Iterator<Item = (DVec3, f64)> {
        let masses = (0..self.of_balls.len()).map(|ball| self.bodies.of(ball).mass);
        self.of_balls.iter().copied().zip(masses)
    }

    /// Follows a collision. A fixed ball's mass is infinite, so nothing moves it.
    #[inline]
    pub fn follow(&mut self, collision: &Collision) {
        match collision.participants {
            Participants::Pair(first, second) => {
                self.push(first, collision.impulse);
                self.push(second, -collision.impulse);
            }
            Participants::Wall(ball, _) | Participants::Plane(ball, _) => {
                self.push(ball, collision.impulse);
            }
            Participants::Face(..) => {}
        }
    }

    #[inline]
    fn push(&mut self, ball: u32, impulse: DVec3) {
        let mass = self.mass(ball);
        self.of_balls[ball as usize] += impulse / mass;
    }
}
