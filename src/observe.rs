//! What the gas does, measured: momentum given to the walls, the virial, conservation, speeds.
//!
//! Observers are fed each collision as it happens, or a whole state now and then. They are deterministic, take constant
//! memory, and change nothing. All in internal units.

pub mod block_sums;
pub mod blocks;
pub mod correlator;
pub mod density_profile;
pub mod flights;
pub mod ledger;
pub mod motion;
pub mod on_demand;
pub mod radial_distribution;
pub mod relaxation;
pub mod speeds;
pub mod transport;
pub mod velocities;

use serde::{Deserialize, Serialize};

use crate::engine::Report;
use crate::event::{Collision, Participants};
use crate::observe::blocks::Blocks;
use crate::observe::ledger::Ledger;
use crate::state::State;

/// Everything that is measured at collisions.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Observer {
    /// Averages over blocks of time.
    pub blocks: Blocks,
    /// Energy, momentum and virial accounts.
    pub ledger: Ledger,
    /// Largest overlap at a collision over the contact distance; `None` before the first pair collision.
    pub max_overlap: Option<f64>,
}

impl Observer {
    /// Opens the accounts at the state's present.
    pub fn new(state: &State) -> Self {
        Self {
            blocks: Blocks::default(),
            ledger: Ledger::new(state),
            max_overlap: None,
        }
    }

    /// Takes a report of an engine into account.
    #[inline]
    pub fn take(&mut self, report: Report) {
        match report {
            Report::One(collision) => self.record(collision),
            Report::Sums(sums) => {
                self.blocks.record_sums(sums);
                self.ledger.record_sums(sums);
            }
        }
    }

    /// Takes a collision into account.
    #[inline]
    pub fn record(&mut self, collision: &Collision) {
        self.blocks.record(collision);
        self.ledger.record(collision);
        // Where centres do not touch there is no gap, and so no overlap.
        if let Participants::Pair(..) = collision.participants
            && !collision.gap.is_nan()
        {
            self.max_overlap = Some(self.max_overlap.unwrap_or(0.0).max(-collision.gap));
        }
    }
}
