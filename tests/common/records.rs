//! What two engines must have in common.

use moltop::engine::{Counters, Engine};
use moltop::event::Participants;
use moltop::state::Time;

/// Collisions in their order.
pub type Records = Vec<(Time, Participants)>;

/// Runs to a time; gives the collisions.
pub fn advance(engine: &mut dyn Engine, until: f64) -> Records {
    let until = engine.state().units.instant(until);
    let mut records = Vec::new();
    engine
        .advance(until, &mut |collision| {
            records.push((collision.time, collision.participants))
        })
        .expect("room");
    records
}

/// What an engine has counted of the gas itself, and not of how it finds collisions.
pub fn counted(engine: &dyn Engine) -> Counters {
    Counters {
        cell_crossings: 0,
        stale_events: 0,
        queue_length_max: 0,
        ..engine.counters()
    }
}
