//! Event calendars: every ball's next event, the earliest first.
//!
//! Three kinds keep the same promise and give the same events in the same order, bit for bit; they differ in what they cost.
//! The engine is generic over them, so the choice costs nothing while it runs.
//!
//! * [`Indexed`]: a heap with one event per ball: small, and the fastest where the balls are few or dense.
//! * [`Lazy`]: a heap that everything is pushed into; what is outdated is thrown away when it comes to the top. It holds
//!   more than one event per ball, and is here to show that.
//! * [`Bounded`]: a ring of short lists over a window of time, with a heap for the list that is due. The cost of an event does
//!   not depend on the number of balls, and which events come next is known: the fastest in a large gas, where the memory they
//!   need is asked for ahead of their turn.

mod bounded;
mod indexed;
mod lazy;

pub use bounded::Bounded;
pub use indexed::Indexed;
pub use lazy::Lazy;

use crate::event::Event;

/// The next event of each ball, ordered as events are ([`Event::precedes`]).
pub trait Calendar: Send {
    /// An empty calendar for balls `0..ball_count`.
    fn new(ball_count: usize) -> Self;

    /// Number of events that it holds, outdated ones included.
    fn len(&self) -> usize;

    /// Whether it holds nothing.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The earliest event.
    fn first(&mut self) -> Option<Event>;

    /// The event that is likely to be the earliest once the present one is done, and one that draws near by then: nearly all are given
    /// as the second before they are as the first. None where that is not known.
    fn soon(&self) -> [Option<Event>; 2] {
        [None; 2]
    }

    /// One more of the events whose turn comes before long, in no strict order and each once; `None` where all of them have been
    /// given, or where they are not known. Not all events are given: some come unforeseen.
    fn approaching(&mut self) -> Option<Event> {
        None
    }

    /// Makes `event` the event of its ball, instead of any it had. Times are not negative.
    fn set(&mut self, event: Event);

    /// Takes a ball's event away, if it has one.
    fn remove(&mut self, ball: u32);

    /// Counts time from `epochs` later on: `events` are all events there are, counted so, at most one per ball. Takes time
    /// in proportion to the number of balls.
    fn rebase(&mut self, epochs: f64, events: impl Iterator<Item = Event>);
}
