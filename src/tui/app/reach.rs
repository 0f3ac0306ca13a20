//! Which keys can do what they are there for.

use super::{App, Panel};
use crate::feed::Access;
use crate::tui::keys::Action;

/// Whether an action is a command to the engine.
fn is_command(action: Action) -> bool {
    matches!(
        action,
        Action::Pause
            | Action::Reverse
            | Action::Step
            | Action::Slower
            | Action::Faster
            | Action::Checkpoint
    )
}

impl App {
    /// Why a key cannot do now what it is there for.
    pub(super) fn refusal(&self, action: Action) -> Option<&'static str> {
        let commands = is_command(action);
        let looks = action == Action::Observe && self.enlarged != Some(Panel::Observables);
        if !self.reaches(action) && !looks {
            Some(if self.access == Access::Replay {
                "the run has ended: `moltop RUN` goes on with it"
            } else {
                "read-only: this key does not reach the run"
            })
        } else if self.visit.is_some() && (commands || action == Action::Mark) {
            Some("this is the past: 0 comes back to the run")
        } else if !self.going_on() && (commands || action == Action::Goto) {
            Some("the run has ended")
        } else {
            None
        }
    }

    /// Whether what a key asks for is there to be had, or the run is out of its reach for good.
    pub fn reaches(&self, action: Action) -> bool {
        let changes = is_command(action) || action == Action::Observe;
        match self.access {
            Access::Owner | Access::Watcher => true,
            Access::ReadOnly => !changes && action != Action::Goto,
            Access::Replay => !changes,
        }
    }
}
