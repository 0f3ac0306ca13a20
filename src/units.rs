//! Internal units: the scene's times powers of two, so that converting is exact.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::state::Placement;
use crate::time::Time;

/// Epochs that an internal unit of length takes at the root mean square speed, at least. With 8, the step of the time grid
/// moves a ball by at most the spacing of f64 coordinates near the walls, so time adds no error that space does not have.
const EPOCHS_PER_CROSSING: f64 = 8.0;

/// Powers of two that turn internal units into the scene's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnitScale {
    /// Scene length of one internal length.
    pub length: f64,
    /// Scene time of one epoch.
    pub time: f64,
    /// Scene mass of one internal mass.
    pub mass: f64,
}

impl UnitScale {
    /// The units that put the largest coordinate into `[1, 2)` and the root mean square speed at or below 1/8.
    pub fn of(placement: &Placement) -> Self {
        let length = power_of_two_below(placement.domain.half_size.max_element());
        let finite = placement
            .bodies
            .iter()
            .map(|body| body.mass)
            .filter(|mass| mass.is_finite());
        let largest_mass = finite.fold(0.0, f64::max);
        let mass = if largest_mass > 0.0 {
            power_of_two_below(largest_mass)
        } else {
            1.0
        };
        let speed = root_mean_square_speed(&placement.velocities);
        // A gas at rest has no time scale of its own.
        let time = if speed > 0.0 {
            power_of_two_below(length / speed) / EPOCHS_PER_CROSSING
        } else {
            1.0
        };
        Self { length, time, mass }
    }

    /// Scene velocity of one internal velocity.
    pub fn velocity(&self) -> f64 {
        self.length / self.time
    }

    /// Scene energy of one internal energy.
    pub fn energy(&self) -> f64 {
        self.mass * self.velocity() * self.velocity()
    }

    /// Scene pressure of one internal pressure.
    pub fn pressure(&self) -> f64 {
        self.energy() / self.length / self.length / self.length
    }

    /// The instant at scene time `time` after the start.
    ///
    /// Times beyond 2^52 epochs are cut there: no run gets that far.
    pub fn instant(&self, time: f64) -> Time {
        const FAR: Time = Time {
            epoch: 1 << 52,
            local: 0.0,
        };
        Time::default()
            .after((time / self.time).max(0.0))
            .unwrap_or(FAR)
    }

    /// Scene time between the start and an instant.
    pub fn scene_time(&self, time: Time) -> f64 {
        (time.epoch as f64 + time.local) * self.time
    }
}

/// The largest power of two that is not above `value`, which must be positive and normal.
fn power_of_two_below(value: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    f64::from_bits(value.to_bits() & EXPONENT)
}

/// Root mean square of the speeds, without overflow or underflow of the squares.
fn root_mean_square_speed(velocities: &[DVec3]) -> f64 {
    let largest = velocities.iter().fold(0.0_f64, |largest, velocity| {
        largest.max(velocity.abs().max_element())
    });
    if largest < f64::MIN_POSITIVE {
        return 0.0;
    }
    let scale = power_of_two_below(largest);
    let sum: f64 = velocities
        .iter()
        .map(|velocity| (*velocity / scale).length_squared())
        .sum();
    scale * (sum / velocities.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_are_found_below() {
        assert_eq!(power_of_two_below(6.75), 4.0);
        assert_eq!(power_of_two_below(0.3), 0.25);
        assert_eq!(
            power_of_two_below(2.0_f64.powi(-500) * 1.5),
            2.0_f64.powi(-500)
        );
    }
}
