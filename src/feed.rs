//! The seam between a run and whoever watches it, in the same process or through a socket.

mod place;

pub mod message;
pub mod server;
pub mod socket;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::snapshot::{ObservableName, Phase, Snapshot};

/// What a watcher may ask of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Write a checkpoint now.
    Checkpoint,
    /// Mark a simulated time in the charts, for all watchers.
    Mark(f64),
    /// Make the state at a past simulated time again, beside the run, in [`Snapshot::past`]; `None` lets it go.
    Goto(Option<f64>),
    /// End the run; the last snapshot is the summary's.
    Stop,
    /// Observe this from now on, or no more; what it had found is dropped then.
    Observe(ObservableName, bool),
}

/// What a watcher may do with a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Access {
    /// The run ends with it: both are one process.
    #[default]
    Owner,
    /// It may command the run and leave it running.
    Watcher,
    /// It may only look.
    ReadOnly,
    /// The run has ended: its last checkpoint is looked at, and the past that it can be followed through.
    Replay,
}

/// A run as its watchers see it: the newest snapshot wins, and the engine never waits.
pub trait Feed {
    /// The newest snapshot.
    fn latest(&self) -> Arc<Snapshot>;
    /// Hands a command to the run; it is obeyed within 50 ms.
    fn send(&self, command: Command);
    /// Whether the run has been stopped before its end: there will be no more news.
    fn was_stopped(&self) -> bool {
        let latest = self.latest();
        latest.state_hash.is_some() && !matches!(latest.phase, Phase::Finished | Phase::Failed(_))
    }
}

/// The past that a run was asked for ([`Command::Goto`]), as a feed of its own: nothing that is sent to it reaches the run.
pub struct PastFeed<'f>(pub &'f dyn Feed);

impl Feed for PastFeed<'_> {
    /// The past, or the present while there is no past.
    fn latest(&self) -> Arc<Snapshot> {
        let now = self.0.latest();
        now.past.clone().unwrap_or(now)
    }

    fn send(&self, _: Command) {}
}
