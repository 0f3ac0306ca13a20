//! The engine's thread: commands in, newest snapshot out. The only place where simulation time meets the wall clock.

use std::sync::{Arc, mpsc};
use std::time::Instant;

use crate::feed::{Command, Feed};
use crate::scene::Scene;
use crate::snapshot::{SeriesRow, Snapshot};
use crate::state::Placement;

/// How a run is to be driven.
pub struct Options {
    /// Simulated time at which the run ends; `None` runs until it is stopped.
    pub until: Option<f64>,
    /// Where the rows of the series go.
    pub series: Option<mpsc::Sender<SeriesRow>>,
    /// When the program started, for `setup_time_s`.
    pub program_start: Instant,
}

/// What remains of a run.
pub struct Outcome {
    /// The last snapshot; the summary is made from it.
    pub snapshot: Arc<Snapshot>,
    /// All balls at the last instant in the scene's units and order, and the collisions of each; `None` if the engine failed.
    pub balls: Option<(Placement, Vec<u64>)>,
}

/// A run on its own thread.
pub struct Worker {}

/// The feed of a run in this process.
#[derive(Clone)]
pub struct LocalFeed {}

impl Worker {
    /// Starts a run; returns at once, with the first snapshot in phase `Starting`.
    pub fn start(_scene: &Scene, _placement: Placement, _options: Options) -> Self {
        unimplemented!("lands with the engine")
    }

    /// The run as watchers see it.
    pub fn feed(&self) -> LocalFeed {
        LocalFeed {}
    }

    /// Waits for the run to end (after `Command::Stop`, when `until` is reached, or on failure).
    ///
    /// A run that has reached `until` ends by itself; its last snapshot has phase `Finished`.
    pub fn join(self) -> Outcome {
        unimplemented!("lands with the engine")
    }
}

impl Feed for LocalFeed {
    fn latest(&self) -> Arc<Snapshot> {
        unimplemented!("lands with the engine")
    }

    fn send(&self, _command: Command) {}
}
