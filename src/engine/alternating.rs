//! Engine `windowed` for any gas that it supports: where its windows do not pay, it hands the gas over to engine `event` for a
//! while.
//!
//! The two agree collision for collision, bit for bit, so who has the gas changes nothing but the time it takes. What decides is
//! counted, never timed (`windowed/tuning.rs`): a window that is full long before its end, as where no time passes, or windows
//! that took more work than the other engine's cells. `event` then has the gas for a fixed simulated time, longer each time
//! that `windowed` could not keep it for as long as that.

use serde::{Deserialize, Serialize};

use crate::engine::windowed::Windowed;
use crate::engine::{self, Counters, Engine, Stuck, Tally, event_driven};
use crate::event::Collision;
use crate::state::{State, Time};

/// How long engine `event` has the gas the first time, in windows.
const FIRST_WHILE: f64 = 256.0;

/// Longest that it may have the gas \[epochs\].
const LONGEST_WHILE: f64 = (1_u64 << 40) as f64;

/// The engine.
pub struct Alternating {
    method: Method,
    threads: usize,
    turns: Turns,
}

enum Method {
    Windowed(Box<Windowed>),
    Event(Box<dyn Engine>),
}

/// Who has the gas.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Turns {
    /// Since when the one that has the gas has it.
    since: Time,
    /// Until when engine `event` has the gas, if it has it.
    until: Option<Time>,
    /// How long it had it the last time \[epochs\]; zero if it never had it.
    last_while: f64,
}

/// What the engine must be given beside its state to go on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Saved {
    tally: Tally,
    turns: Turns,
}

impl Saved {
    /// Whether it belongs to a gas of so many balls.
    pub fn fits(&self, ball_count: usize) -> bool {
        self.tally.instants.fits(ball_count)
    }
}

impl From<Tally> for Saved {
    /// What engine `event` has saved, or `windowed` alone: from now on, `windowed` has the gas.
    fn from(tally: Tally) -> Self {
        Self {
            tally,
            turns: Turns::default(),
        }
    }
}

impl Alternating {
    /// Prepares a gas that engine `windowed` supports, to be run by so many threads at the most. Their number changes no collision.
    ///
    /// # Panics
    /// If [`Windowed::supports`] does not hold.
    pub fn new(state: State, threads: usize) -> Self {
        Self {
            turns: Turns {
                since: state.now,
                ..Turns::default()
            },
            method: Method::Windowed(Box::new(Windowed::new(state, threads))),
            threads,
        }
    }

    /// Goes on from what one of its kind has saved.
    ///
    /// # Panics
    /// If [`Windowed::supports`] does not hold.
    pub fn resume(state: State, threads: usize, saved: Saved) -> Self {
        let Saved { tally, turns } = saved;
        Self {
            method: match turns.until {
                None => Method::windowed(state, threads, tally),
                Some(_) => Method::event(state, tally),
            },
            threads,
            turns,
        }
    }

    fn engine(&self) -> &dyn Engine {
        match &self.method {
            Method::Windowed(windowed) => &**windowed,
            Method::Event(event) => &**event,
        }
    }

    fn tally(&self) -> Tally {
        match self.engine().save() {
            engine::Saved::Exact(tally) => tally,
            _ => unreachable!("both engines save a tally"),
        }
    }

    /// Hands the gas to the other engine.
    fn change(&mut self) {
        let (state, tally) = (self.state().clone(), self.tally());
        let now = state.now;
        if let Method::Windowed(windowed) = &self.method {
            let Turns {
                since, last_while, ..
            } = self.turns;
            let first = FIRST_WHILE * windowed.window_length();
            let kept = now.since(since) >= last_while && last_while > 0.0;
            let next = if kept {
                first
            } else {
                first.max(2.0 * last_while).min(LONGEST_WHILE)
            };
            self.turns.last_while = next;
            let until = now.after(next);
            self.turns.until = Some(until.expect("a while is short against all of time"));
            self.method = Method::event(state, tally);
        } else {
            self.turns.until = None;
            self.method = Method::windowed(state, self.threads, tally);
        }
        self.turns.since = now;
    }
}

impl Method {
    fn windowed(state: State, threads: usize, tally: Tally) -> Self {
        Self::Windowed(Box::new(Windowed::resume(state, threads, tally)))
    }

    fn event(state: State, tally: Tally) -> Self {
        Self::Event(event_driven::usual(state, Some(tally)))
    }
}

impl Engine for Alternating {
    /// The name of the one that has the gas.
    fn name(&self) -> &'static str {
        self.engine().name()
    }

    fn advance(&mut self, until: Time, report: &mut dyn FnMut(&Collision)) -> Result<(), Stuck> {
        while self.state().now < until {
            let change = match &mut self.method {
                Method::Windowed(windowed) => !windowed.advance_while_it_pays(until, report)?,
                Method::Event(event) => {
                    let end = self.turns.until.filter(|&end| end <= until);
                    event.advance(end.unwrap_or(until), report)?;
                    end.is_some()
                }
            };
            if change {
                self.change();
            }
        }
        Ok(())
    }

    fn state(&self) -> &State {
        self.engine().state()
    }

    fn reverse(&mut self) {
        match &mut self.method {
            Method::Windowed(windowed) => windowed.reverse(),
            Method::Event(event) => event.reverse(),
        }
    }

    fn save(&self) -> engine::Saved {
        engine::Saved::Alternating(Saved {
            tally: self.tally(),
            turns: self.turns,
        })
    }

    fn counters(&self) -> Counters {
        self.engine().counters()
    }

    fn queue_length(&self) -> usize {
        self.engine().queue_length()
    }

    fn last_change(&self) -> Option<Time> {
        (self.turns.last_while > 0.0).then_some(self.turns.since)
    }
}
