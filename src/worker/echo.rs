//! The echo: how well a reversed run finds its way back to where it started.

use std::sync::Arc;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::snapshot::Echo;
use crate::state::State;

/// Most balls whose start is kept: 24 bytes each.
const MOST_BALLS: usize = 10_000_000;

/// Pair collisions per ball after which rounding in f64 has grown to a tenth of a diameter, against the packing fraction.
///
/// Source: measured (Loschmidt echoes of 216 and 512 balls between walls; the growth exponent per collision falls with density).
const HORIZON: [(f64, f64); 9] = [
    (5.7e-4, 3.5),
    (0.0024, 4.0),
    (0.019, 8.5),
    (0.065, 15.0),
    (0.109, 22.0),
    (0.153, 31.0),
    (0.235, 46.0),
    (0.338, 65.0),
    (0.444, 120.0),
];

/// Keeps the start of a run, and what has become of the way back.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct EchoWatch {
    start: Option<Arc<Vec<DVec3>>>,
    turned_at: Option<f64>,
    error: Option<f64>,
}

impl EchoWatch {
    /// Keeps where the balls are now, if they are not too many.
    pub fn new(state: &State) -> Self {
        let start =
            (state.ball_count() <= MOST_BALLS).then(|| Arc::new(positions(state).collect()));
        Self {
            start,
            turned_at: None,
            error: None,
        }
    }

    /// Whether it watches so many balls.
    pub fn fits(&self, ball_count: usize) -> bool {
        (self.start.as_ref()).is_none_or(|start| start.len() == ball_count)
    }

    /// Notes a reversal at this time. A second one ends the way back.
    pub fn turn(&mut self, time: f64) {
        self.turned_at = if self.turned_at.is_none() {
            Some(time)
        } else {
            None
        };
        self.error = None;
    }

    /// When the run will be back at its start, if it is on its way and not there yet.
    pub fn back_at(&self) -> Option<f64> {
        self.turned_at
            .filter(|_| self.error.is_none())
            .map(|time| 2.0 * time)
    }

    /// Compares the gas with its start, at the time [`Self::back_at`].
    pub fn arrive(&mut self, state: &State) {
        let Some(start) = &self.start else { return };
        let apart = start
            .iter()
            .zip(positions(state))
            .map(|(start, now)| start.distance(now));
        let mean = apart.sum::<f64>() / start.len().max(1) as f64;
        self.error = Some(mean / (2.0 * state.bodies.largest_radius()).max(f64::MIN_POSITIVE));
    }

    /// What the snapshot says of it at this time.
    pub fn at(&self, time: f64) -> Option<Echo> {
        self.turned_at.map(|turned_at| Echo {
            turned_at,
            retraced: if turned_at > 0.0 {
                ((time - turned_at) / turned_at).clamp(0.0, 1.0)
            } else {
                1.0
            },
            error: self.error,
        })
    }
}

fn positions(state: &State) -> impl Iterator<Item = DVec3> {
    (0..state.ball_count()).map(|ball| state.unwrapped_position(ball))
}

/// Simulated time after which a reversed run in f64 no longer finds back, for a packing fraction and a rate of pair collisions
/// per ball; `None` outside of what was measured.
pub fn horizon(packing_fraction: f64, collision_rate: f64) -> Option<f64> {
    let above = HORIZON
        .iter()
        .position(|&(fraction, _)| fraction >= packing_fraction * 0.99)?
        .max(1);
    let ((x0, y0), (x1, y1)) = (HORIZON[above - 1], HORIZON[above]);
    let share = (packing_fraction / x0).ln() / (x1 / x0).ln();
    (share > -0.1 && collision_rate > 0.0)
        .then(|| (y0.ln() + share * (y1 / y0).ln()).exp() / collision_rate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_horizon_of_the_oxygen_is_half_a_nanosecond_and_that_of_the_seed_eleven_seconds() {
        let oxygen = horizon(5.663e-4, 5.92e9).expect("measured");
        assert!((5e-10..7e-10).contains(&oxygen), "{oxygen}");
        let seed = horizon(0.109, 2.2).expect("measured");
        assert!((9.0..12.0).contains(&seed), "{seed}");
        assert_eq!(horizon(0.6, 1.0), None);
        assert_eq!(horizon(1e-8, 1.0), None);
    }
}
