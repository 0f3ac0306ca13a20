//! The seam between a run and whoever watches it.

use std::sync::Arc;

use crate::snapshot::Snapshot;

/// What a watcher may ask of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Hold the engine.
    Pause,
    /// Let the engine go on.
    Resume,
    /// Negate all velocities.
    Reverse,
    /// Run to the next multiple of the scene's `sample`, then pause.
    Step,
    /// Simulated time per wall second at the most; `None` for as fast as it goes.
    LimitTimeRate(Option<f64>),
    /// Whether snapshots carry a sample of the balls for a picture.
    Watch(bool),
    /// End the run; the last snapshot is the summary's.
    Stop,
}

/// A run as its watchers see it: the newest snapshot wins, and the engine never waits.
pub trait Feed {
    /// The newest snapshot.
    fn latest(&self) -> Arc<Snapshot>;
    /// Hands a command to the run; it is obeyed within 50 ms.
    fn send(&self, command: Command);
}
