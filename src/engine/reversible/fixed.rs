//! Fixed-point state: positions, velocities and time as integers, on which free flight is exact.
//!
//! A tick is 2^-49 epochs, the step of [`Time`]; a velocity is a number of position units per tick. The unit of velocity is
//! the finest power of two for which no ball can become so fast that a product overflows: no ball is ever faster than
//! `sqrt(2 E / m)` with the energy E of the whole gas and the smallest mass.

use serde::{Deserialize, Serialize};

use std::fmt;

use crate::domain::{Boundary, Plane};
use crate::engine::reversible::involution::SPEED_BITS;
use crate::state::{State, Time};

/// Bits of a tick: an epoch has 2^49 of them.
const TICK_BITS: i32 = 49;

/// Finest unit of velocity, in bits after the point. Positions then have 113, and what is made from them stays below 2^127.
const MOST_VELOCITY_BITS: i32 = 64;

/// Largest coordinate \[length\]; a scene in internal units stays below 2.
const MOST_COORDINATE: f64 = 4.0;

/// Largest ball count times ratio of masses: the heaviest balls then still move by 2^40 units of velocity.
const MOST_SPREAD: f64 = (1_u64 << 40) as f64;

/// Smallest radius, in ways that the fastest ball can fly in a tick.
const LEAST_RADIUS: f64 = 1024.0;

/// Ticks since time zero at the start of an epoch.
pub fn epoch_start(epoch: u64) -> i128 {
    i128::from(epoch) << TICK_BITS
}

/// The last tick at or before an instant.
pub fn tick_of(time: Time) -> i128 {
    const TICKS: f64 = (1_u64 << TICK_BITS) as f64;
    epoch_start(time.epoch) + i128::from((time.local * TICKS) as i64)
}

/// The instant of a tick.
pub fn time_of(tick: i128) -> Time {
    let whole = tick >> TICK_BITS;
    Time {
        epoch: whole as u64,
        local: epochs(tick - (whole << TICK_BITS)),
    }
}

/// A number of ticks in epochs; exact up to 16 epochs.
#[inline]
pub fn epochs(ticks: i128) -> f64 {
    const EPOCH: f64 = (1_u64 << TICK_BITS) as f64;
    ticks as f64 / EPOCH
}

/// What an integer length and velocity are in internal units.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Scale {
    per_length: f64,
    per_velocity: f64,
}

impl Scale {
    /// Chooses the units for a gas.
    ///
    /// # Errors
    /// [`Refusal`] if the gas cannot be run exactly.
    pub fn of(state: &State) -> Result<Self, Refusal> {
        let masses = (0..state.ball_count()).map(|ball| state.bodies.of(ball).mass);
        let finite = masses.filter(|mass| mass.is_finite());
        let (light, heavy) = finite.fold((f64::INFINITY, 0.0_f64), |(light, heavy), mass| {
            (light.min(mass), heavy.max(mass))
        });
        let speed_bound = if heavy > 0.0 {
            (2.0 * state.totals().kinetic_energy / light).sqrt()
        } else {
            0.0
        };
        refuse(state, light, heavy, speed_bound)?;
        let mut velocity_bits = MOST_VELOCITY_BITS;
        while speed_bound * power_of_two(velocity_bits) >= power_of_two(SPEED_BITS.cast_signed()) {
            velocity_bits -= 1;
        }
        Ok(Self {
            per_length: power_of_two(velocity_bits + TICK_BITS),
            per_velocity: power_of_two(velocity_bits),
        })
    }

    /// A length in integer units, rounded.
    #[inline]
    pub fn length(self, length: f64) -> i128 {
        (length * self.per_length).round() as i128
    }

    /// A velocity in integer units, rounded.
    #[inline]
    pub fn velocity(self, velocity: f64) -> i64 {
        (velocity * self.per_velocity).round() as i64
    }

    /// An integer length in internal units, rounded.
    #[inline]
    pub fn to_length(self, length: i128) -> f64 {
        length as f64 / self.per_length
    }

    /// An integer velocity in internal units, rounded.
    #[inline]
    pub fn to_velocity(self, velocity: i64) -> f64 {
        velocity as f64 / self.per_velocity
    }
}

/// Why a gas cannot be run with exact reversal.
#[derive(Clone, Debug, PartialEq)]
pub enum Refusal {
    /// Open space: no fixed-point range holds a ball that flies away.
    Open,
    /// A plane that is not perpendicular to an axis: its reflection would round.
    ObliquePlane(usize),
    /// A plane in a periodic box.
    PlaneInPeriodicBox(usize),
    /// A ball outside the range of coordinates.
    OutOfRange(usize),
    /// A ball of infinite mass that moves.
    MovingObstacle(usize),
    /// Ball count times ratio of the masses, too large for one unit of velocity.
    Masses(f64),
    /// A ball so small that the fastest ball could pass it within a few ticks.
    SmallBall(usize),
}

impl std::error::Error for Refusal {}

impl fmt::Display for Refusal {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        write!(formatter, "engine `reversible` cannot run this scene: ")?;
        match self {
            Self::Open => write!(
                formatter,
                "in open space balls leave every fixed-point range; use a container or a periodic box"
            ),
            Self::ObliquePlane(plane) => write!(
                formatter,
                "plane {plane} is not perpendicular to an axis, so reflecting from it cannot be exact"
            ),
            Self::PlaneInPeriodicBox(plane) => {
                write!(formatter, "plane {plane} is in a periodic box")
            }
            Self::OutOfRange(ball) => write!(
                formatter,
                "ball {ball} is outside the fixed-point range, {MOST_COORDINATE} internal units from the centre"
            ),
            Self::MovingObstacle(ball) => {
                write!(formatter, "ball {ball} has an infinite mass and moves")
            }
            Self::Masses(spread) => write!(
                formatter,
                "ball count times largest over smallest mass = {spread:e}: must be below {MOST_SPREAD:e}"
            ),
            Self::SmallBall(ball) => write!(
                formatter,
                "ball {ball} is too small beside the box and the energy of the gas for the tick of the clock"
            ),
        }
    }
}

fn refuse(state: &State, light: f64, heavy: f64, speed_bound: f64) -> Result<(), Refusal> {
    let domain = &state.domain;
    if domain.boundary == Boundary::Open {
        return Err(Refusal::Open);
    }
    for (index, plane) in domain.planes.iter().enumerate() {
        if domain.boundary == Boundary::Periodic {
            return Err(Refusal::PlaneInPeriodicBox(index));
        }
        if axis_of(plane).is_none() {
            return Err(Refusal::ObliquePlane(index));
        }
    }
    let spread = state.ball_count() as f64 * (heavy / light);
    if !(spread < MOST_SPREAD) {
        return Err(Refusal::Masses(spread));
    }
    let least_radius = LEAST_RADIUS * speed_bound / power_of_two(TICK_BITS);
    for (ball, trajectory) in state.trajectories.iter().enumerate() {
        let body = state.bodies.of(ball);
        if !(trajectory.position_at(state.now).abs().max_element() < MOST_COORDINATE) {
            return Err(Refusal::OutOfRange(ball));
        }
        if body.mass.is_infinite() && trajectory.velocity.length_squared() > 0.0 {
            return Err(Refusal::MovingObstacle(ball));
        }
        if body.radius > 0.0 && body.radius < least_radius {
            return Err(Refusal::SmallBall(ball));
        }
    }
    Ok(())
}

/// The axis that a plane is perpendicular to, if any.
pub fn axis_of(plane: &Plane) -> Option<usize> {
    (0..3).find(|&axis| plane.normal[axis].abs() == 1.0)
}

fn power_of_two(exponent: i32) -> f64 {
    2.0_f64.powi(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_and_times_are_the_same_thing() {
        for tick in [
            0,
            1,
            (1 << TICK_BITS) - 1,
            1 << TICK_BITS,
            (7 << 80) + 12345,
        ] {
            assert_eq!(tick_of(time_of(tick)), tick);
        }
        let between = Time {
            epoch: 3,
            local: 0.25 + 2.0_f64.powi(-52),
        };
        assert_eq!(tick_of(between), (3 << 49) + (1 << 47));
    }
}
