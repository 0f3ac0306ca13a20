//! A run inside an experiment: an engine, its observer, and simulated time in the scene's units.

use std::fs::File;
use std::io::Read;

use serde::{Deserialize, Serialize};

use crate::engine::{Engine, Saved, Stuck};
use crate::event::{Collision, Participants};
use crate::observe::Observer;
use crate::observe::ledger::Drift;
use crate::state::{Placement, State, Time};
use crate::worker::engines::{CalendarName, Choice};

/// The event-driven engine with its usual calendar.
pub const EVENT: Choice = Choice::Event(CalendarName::Auto);

/// The windowed engine on one thread: the same collisions, for containers only.
pub const WINDOWED: Choice = Choice::Windowed(1);

/// The exactly reversible engine.
pub const REVERSIBLE: Choice = Choice::Reversible;

/// When and who.
pub type Record = (Time, Participants);

/// A run that is going on.
pub struct Trial {
    /// The engine.
    pub engine: Box<dyn Engine>,
    /// What was measured so far.
    pub observer: Observer,
}

/// A run at one moment, all that it needs to go on bit for bit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SavedTrial {
    state: State,
    engine: Saved,
    observer: Observer,
}

impl SavedTrial {
    /// Goes on; `None` if another kind of engine has saved it.
    pub fn resume(self, choice: Choice) -> Option<Trial> {
        Some(Trial {
            engine: choice.resume(self.state, self.engine)?,
            observer: self.observer,
        })
    }
}

impl Trial {
    /// A run of a gas from time zero.
    pub fn new(choice: Choice, gas: &Placement) -> Self {
        Self::resume(choice, State::new(gas))
    }

    /// A run that goes on from a state.
    pub fn resume(choice: Choice, state: State) -> Self {
        let observer = Observer::new(&state);
        Self {
            engine: choice.engine(state),
            observer,
        }
    }

    /// The gas.
    pub fn state(&self) -> &State {
        self.engine.state()
    }

    /// The run as it is now.
    pub fn save(&mut self) -> SavedTrial {
        self.engine.settle();
        SavedTrial {
            state: self.state().clone(),
            engine: self.engine.save(),
            observer: self.observer.clone(),
        }
    }

    /// Simulated time so far.
    pub fn time(&self) -> f64 {
        self.state().units.scene_time(self.state().now)
    }

    /// Collisions so far, of all kinds.
    pub fn events(&self) -> u64 {
        let counters = self.engine.counters();
        counters.pair_collisions + counters.wall_collisions + counters.plane_collisions
    }

    /// Runs to a simulated time and reports each collision.
    ///
    /// # Errors
    /// [`Stuck`] when the gas has no room.
    pub fn try_run(&mut self, until: f64, report: &mut dyn FnMut(&Collision)) -> Result<(), Stuck> {
        let until = self.state().units.instant(until);
        let observer = &mut self.observer;
        let done = self.engine.advance(until, &mut |collision| {
            observer.record(collision);
            report(collision);
        });
        self.engine.settle();
        done
    }

    /// Runs to a simulated time.
    ///
    /// # Panics
    /// When the gas has no room.
    pub fn run(&mut self, until: f64) {
        let until = self.state().units.instant(until);
        let observer = &mut self.observer;
        self.engine
            .advance_in_sums(until, &mut |report| observer.take(report))
            .expect("room to move");
        self.engine.settle();
    }

    /// Runs to a simulated time and keeps every collision.
    ///
    /// # Panics
    /// When the gas has no room.
    pub fn records(&mut self, until: f64) -> Vec<Record> {
        let mut records = Vec::new();
        self.try_run(until, &mut |collision| {
            records.push((collision.time, collision.participants));
        })
        .expect("room to move");
        records
    }

    /// Runs in slices of simulated time until there have been that many collisions in all.
    ///
    /// # Panics
    /// When the gas has no room.
    pub fn run_for_events(&mut self, events: u64, slice: f64) {
        let (start, mut slices) = (self.time(), 0_u32);
        while self.events() < events {
            slices += 1;
            self.run(start + slice * f64::from(slices));
        }
    }

    /// Turns all velocities round.
    pub fn reverse(&mut self) {
        self.engine.reverse();
        self.observer.ledger.reverse(self.engine.state());
    }

    /// What does not balance.
    pub fn drift(&self) -> Drift {
        self.observer
            .ledger
            .drift(self.state().now, &self.state().totals())
    }

    /// Relative change of the kinetic energy, without sign.
    pub fn energy_drift(&self) -> f64 {
        self.drift().energy.unwrap_or(0.0).abs()
    }

    /// Largest overlap at a collision over the contact distance.
    pub fn max_overlap(&self) -> f64 {
        self.observer.max_overlap.unwrap_or(0.0)
    }
}

/// Time that the processor has spent on this thread \[s\].
pub fn processor_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Resident memory of this process now, where the system tells \[bytes\]. Allocates none itself.
pub fn resident_memory() -> Option<u64> {
    let mut text = [0; 4096];
    let count = File::open("/proc/self/status").ok()?.read(&mut text).ok()?;
    let line = str::from_utf8(&text[..count])
        .ok()?
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kibibytes)
}
