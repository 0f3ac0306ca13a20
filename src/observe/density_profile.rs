//! Where the balls' centres are along each axis: walls gather them in layers.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::observe::block_sums::{BlockSums, Estimate};
use crate::state::State;

/// Slices across each axis.
pub const SLICES: usize = 200;

/// Balls per slice of the box, along each axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DensityProfile {
    /// Slices of x, y and z, then the number of looks.
    sums: BlockSums,
}

impl Default for DensityProfile {
    fn default() -> Self {
        Self {
            sums: BlockSums::new(3 * SLICES + 1),
        }
    }
}

impl DensityProfile {
    /// Counts the balls at the state's present.
    pub fn look(&mut self, state: &State) {
        let per_slice = SLICES as f64 / (2.0 * state.domain.half_size);
        let sums = self.sums.open();
        for flight in &state.trajectories {
            let place: DVec3 = (flight.position_at(state.now) + state.domain.half_size) * per_slice;
            for axis in 0..3 {
                if (0.0..=SLICES as f64).contains(&place[axis]) {
                    sums[axis * SLICES + (place[axis] as usize).min(SLICES - 1)] += 1.0;
                }
            }
        }
        sums[3 * SLICES] += 1.0;
        self.sums.close_record();
    }

    /// Balls in each slice across an axis.
    pub fn slices(&self, axis: usize) -> Vec<Estimate> {
        let summed = self.sums.summed();
        let slice = |slice: usize| {
            summed.estimate(|sums| {
                let looks = sums[3 * SLICES];
                (looks > 0.0).then(|| sums[axis * SLICES + slice] / looks)
            })
        };
        (0..SLICES).map(slice).collect()
    }
}
