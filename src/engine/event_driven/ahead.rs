//! Memory is asked for before an event's turn comes, so that nobody waits for it: first that of the balls, then that of the places
//! where they will look, then that of whom they will see there. Each step needs what the one before has asked for.

use super::needs::Needs;
use super::surroundings::Surroundings;
use crate::event::{Event, EventKind};
use crate::state::State;

/// Events between the first step and the last.
const AHEAD: usize = 4;

/// The last events that have been seen ahead of their turn.
#[derive(Clone, Debug)]
pub struct Ahead {
    events: [Event; AHEAD],
    next: usize,
}

impl Ahead {
    /// Nothing has been seen yet.
    pub fn new() -> Self {
        Self {
            events: [Event::new(0.0, 0, EventKind::Crossing { axis: 0 }); AHEAD],
            next: 0,
        }
    }

    /// Sees one more event, whose balls have been asked for, and takes the next steps for those before it.
    #[inline]
    pub fn see<N: Needs>(
        &mut self,
        event: Event,
        state: &State,
        surroundings: &impl Surroundings<N>,
    ) {
        let first = std::mem::replace(&mut self.events[self.next], event);
        self.next = (self.next + 1) % AHEAD;
        let middle = self.events[(self.next + AHEAD / 2) % AHEAD];
        for ball in balls(&middle) {
            surroundings.prefetch_places(state, ball, crossing(&middle));
        }
        for ball in balls(&first) {
            surroundings.prefetch_known(state, ball, crossing(&first));
        }
    }
}

/// The balls of an event.
pub fn balls(event: &Event) -> impl Iterator<Item = usize> {
    let partner = match event.kind() {
        EventKind::Pair { partner } => Some(partner),
        _ => None,
    };
    [Some(event.ball), partner]
        .into_iter()
        .flatten()
        .map(|ball| ball as usize)
}

/// Along which axis an event's ball crosses, if that is what it does.
pub fn crossing(event: &Event) -> Option<usize> {
    match event.kind() {
        EventKind::Crossing { axis } => Some(axis),
        _ => None,
    }
}
