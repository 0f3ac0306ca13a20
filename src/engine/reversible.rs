//! Engine `reversible`: the event-driven engine on integers, so that time can be reversed exactly.
//!
//! Positions, velocities and times are integers (`fixed`). Free flight `x += v n` is exact, walls negate a component, and the
//! collision of two balls is an involution that commutes with reversal (`involution`). Events happen at the last tick before
//! an overlap (`flight`); a collision mirrors the next step into the previous one, so after a reversal every event is found
//! again at the mirrored tick, and every bit of the state comes back.
//!
//! What always holds: [`State`] is the gas rounded to f64, each trajectory made from the integers when its flight begins.
//! Cells, quick rejections, observers and screens read it; what happens follows from the integers alone. Cells, candidates
//! and calendar work as in [`crate::engine::event_driven`].
//!
//! Two events of one ball at the same tick have to be undone in the opposite order, which a reversed run could not know, and
//! rounding could spoil a mirrored step. Both are looked for at every event, counted and remembered (`memory`). By chance they do
//! not occur (a tick is 2^-49 epochs); symmetric scenes have them.
//!
//! Source: exact reversal on integers after Levesque & Verlet (J. Stat. Phys. 72, 519, 1993); the events of hard spheres and
//! the rule of the last tick before contact derived here.

mod fixed;
mod flight;
mod gas;
mod involution;
mod memory;
mod search;
mod wide;

use serde::{Deserialize, Serialize};

use crate::calendar::{Calendar, Indexed};
use crate::cell_list::CellList;
use crate::collision::wall_time;
use crate::domain::Boundary;
use crate::engine::contact::InstantWatch;
use crate::engine::{self, Counters, Engine, Stuck};
use crate::event::{Collision, Event, EventKind, Participants, Wall};
use crate::state::{State, Time};
use fixed::{Scale, axis_of, epoch_start, epochs, tick_of, time_of};
use flight::{Flight, Origin};
use gas::Gas;
use memory::{Deed, Memory};
use search::{Candidate, Search};

pub use fixed::Refusal;
pub use gas::Words;

/// Epochs after which the calendar's base moves on. Times up to 16 epochs from the base are exact in the calendar.
const REBASE_AFTER: f64 = 4.0;

/// Cell width in mean spacings of the balls, as in the event-driven engine.
const SPACINGS_PER_CELL: f64 = 1.5;

/// Cell width in mean diameters, at least.
const DIAMETERS_PER_CELL: f64 = 1.75;

/// The reversible engine.
#[derive(Clone, Debug)]
pub struct Reversible {
    gas: Gas,
    /// Whether any two balls can collide; if not, there is nothing to look for and no cell to cross.
    interacting: bool,
    cells: CellList,
    calendar: Indexed,
    /// The epoch from which the calendar counts.
    base: u64,
    candidates: Vec<Candidate>,
    instants: InstantWatch,
    memory: Memory,
    counters: Counters,
}

/// What the engine knows beyond its state: the integers.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Saved {
    scale: Scale,
    flights: Vec<Flight>,
    memory: Memory,
    instants: InstantWatch,
    counters: Counters,
}

impl Saved {
    /// Whether it belongs to a gas of so many balls.
    pub fn fits(&self, ball_count: usize) -> bool {
        self.flights.len() == ball_count
            && self.instants.fits(ball_count)
            && self.memory.fits(ball_count)
    }
}

impl Reversible {
    /// Rounds the gas to integers and predicts the first events of every ball.
    ///
    /// # Errors
    /// [`Refusal`] if the scene cannot be run exactly.
    pub fn new(state: State) -> Result<Self, Refusal> {
        let width = cell_width(&state);
        Self::with_cell_width(state, width)
    }

    /// Like [`Self::new`], with cells at least `width` wide \[length\]. The collisions do not depend on it, their cost does.
    ///
    /// # Errors
    /// [`Refusal`] if the scene cannot be run exactly.
    pub fn with_cell_width(state: State, width: f64) -> Result<Self, Refusal> {
        let mut engine = Self::around(Gas::new(state)?, width);
        engine.predict_everything();
        // Balls that overlap, or part from a touch just as the run starts, would collide there in a reversed run.
        let disturbed = |&ball: &usize| {
            engine.search(ball, None).disturbed || engine.gas.turns_when_reversed(ball)
        };
        let count = engine.gas.flights.len();
        engine.counters.irreversible_starts = (0..count).filter(disturbed).count() as u64;
        Ok(engine)
    }

    /// Goes on from what an engine has saved.
    pub fn resume(state: State, saved: Saved) -> Self {
        let width = cell_width(&state);
        let gas = Gas::restored(state, saved.scale, saved.flights);
        let mut engine = Self::around(gas, width);
        engine.memory = saved.memory;
        engine.predict_everything();
        engine.instants = saved.instants;
        engine.counters = saved.counters;
        engine
    }

    fn around(gas: Gas, width: f64) -> Self {
        let state = &gas.state;
        let count = state.ball_count();
        let interacting = state.bodies.largest_radius() > 0.0 && count > 1;
        Self {
            cells: CellList::new(&state.domain, width, if interacting { count } else { 0 }),
            calendar: Indexed::new(count),
            base: 0,
            candidates: Vec::new(),
            instants: InstantWatch::default(),
            memory: Memory::default(),
            counters: Counters::default(),
            interacting,
            gas,
        }
    }

    /// Position and velocity of every ball at the present in integer units: the words that a reversal brings back. In a
    /// periodic box the position counts the boxes moved on, modulo 2^128.
    pub fn words(&self) -> Vec<Words> {
        self.gas.words()
    }

    /// A 64-bit hash of those words.
    ///
    /// Source: FNV-1a (Fowler, Noll, Vo; RFC 9923), on words instead of bytes and with a rotation.
    pub fn hash(&self) -> u64 {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut add =
            |word: u64| hash = (hash ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
        for (position, velocity) in self.words() {
            for component in position {
                add(component as u64);
                add((component >> 64) as u64);
            }
            for component in velocity {
                add(component.cast_unsigned());
            }
        }
        hash
    }

    /// Makes cells, candidates and calendar from the gas alone.
    fn predict_everything(&mut self) {
        let count = self.gas.flights.len();
        self.candidates.clear();
        self.candidates.resize(count, Candidate::NONE);
        if self.interacting {
            let state = &self.gas.state;
            self.cells = CellList::new(&state.domain, self.cells.width(), count);
            for ball in 0..count {
                let position = state.trajectories[ball].position_at(state.now);
                self.cells.push(position, state.bodies.of(ball).radius);
                // It looks among the balls before it; those after it will look for it.
                self.candidates[ball] = self.search(ball, None).best;
            }
        }
        self.rebase(self.gas.state.now.epoch);
    }

    /// Moves the calendar's base to a later epoch.
    fn rebase(&mut self, epoch: u64) {
        let later = epoch.wrapping_sub(self.base).cast_signed() as f64;
        self.base = epoch;
        let mut calendar = std::mem::replace(&mut self.calendar, Indexed::new(0));
        let events = (0..self.gas.flights.len()).filter_map(|ball| self.next_event(ball));
        calendar.rebase(later, events);
        self.calendar = calendar;
        self.note_queue_length();
    }

    fn note_queue_length(&mut self) {
        let length = self.calendar.len() as u64;
        self.counters.queue_length_max = self.counters.queue_length_max.max(length);
    }

    /// The earliest of a ball's crossings, walls, planes and known pair collision.
    #[inline]
    fn next_event(&self, ball: usize) -> Option<Event> {
        let state = &self.gas.state;
        let trajectory = &state.trajectories[ball];
        let radius = state.bodies.of(ball).radius;
        let begin = trajectory.begin.relative_to(self.base);
        let mut next = (f64::INFINITY, EventKind::Crossing { axis: 0 });
        let mut offer = |time: f64, kind: EventKind| {
            if time < next.0 {
                next = (time, kind);
            }
        };
        for axis in 0..3 {
            let crossing = if self.interacting {
                self.cells.crossing(ball, trajectory, radius, axis)
            } else {
                None
            };
            if let Some(flight) = crossing {
                offer(begin + flight, EventKind::Crossing { axis });
            }
            let speed = trajectory.velocity[axis];
            let wall = Wall {
                axis,
                upper: speed > 0.0,
            };
            if state.domain.boundary == Boundary::Periodic {
                // By which of its images a ball is called changes nothing, so a rounded time will do.
                let face = state.domain.half_size[axis].copysign(speed);
                if let Some(time) = wall_time(trajectory, axis, face) {
                    offer(time.relative_to(self.base), EventKind::Wall(wall));
                }
            } else if crossing.is_none()
                && let Some(tick) = self.gas.wall_tick(ball, wall)
            {
                offer(self.relative(tick), EventKind::Wall(wall));
            }
        }
        for plane in 0..state.domain.planes.len() {
            if let Some(tick) = self.gas.plane_tick(ball, plane) {
                let plane = plane as u32;
                offer(self.relative(tick), EventKind::Plane { plane });
            }
        }
        // Walls and planes at the same instant come first, as the order of events has it.
        let Candidate { tick, partner, .. } = self.candidates[ball];
        if partner != u32::MAX {
            offer(self.relative(tick), EventKind::Pair { partner });
        }
        let now = state.now.relative_to(self.base);
        (next.0 < f64::INFINITY).then(|| Event::new(next.0.max(now), ball as u32, next.1))
    }

    /// A tick in epochs from the calendar's base.
    #[inline]
    fn relative(&self, tick: i128) -> f64 {
        epochs(tick - epoch_start(self.base))
    }

    #[inline]
    fn schedule(&mut self, ball: usize) {
        match self.next_event(ball) {
            Some(event) => self.calendar.set(event),
            None => self.calendar.remove(ball as u32),
        }
    }

    /// A ball reaches into new cells: it looks for partners there.
    #[inline]
    fn cross(&mut self, ball: usize, axis: usize) {
        self.counters.cell_crossings += 1;
        let gas = &self.gas;
        let trajectory = gas.state.trajectories[ball];
        let place = (trajectory.position_at(gas.state.now), trajectory.velocity);
        let radius = gas.state.bodies.of(ball).radius;
        let mut search = Search::new(ball, self.candidates[ball], None);
        self.cells
            .cross(ball, place, radius, axis, |cells, company| {
                search.look(gas, cells, company);
            });
        self.candidates[ball] = search.best;
        self.schedule(ball);
    }

    /// A ball turns at a wall or a plane that is perpendicular to `axis`.
    fn bounce(
        &mut self,
        ball: usize,
        axis: usize,
        participants: Participants,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let now = self.gas.now();
        let before = self.gas.flights[ball];
        let deed = Deed::Bounce {
            ball,
            axis,
            participants,
        };
        let collision = self.execute(deed)?;
        let search = self.look_around(ball, None);
        // Bounces along different axes may be undone in any order.
        let tied = before.since == now && before.origin == Origin::Ball;
        self.remember(now, deed, tied || search.disturbed);
        report(&collision);
        Ok(())
    }

    /// The pair collision that `ball` knows of is due; it happens if it still holds.
    fn meet(
        &mut self,
        ball: usize,
        partner: usize,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let Candidate { tick, image, .. } = self.candidates[ball];
        let approach = self.gas.approach(ball, partner, image);
        if approach.meeting() != Some(tick) {
            self.counters.stale_events += 1;
            self.look_again(ball, None);
            return Ok(());
        }
        let now = self.gas.now();
        self.counters.late_events += u64::from(tick < now);
        let tied = |ball: usize| {
            let before = &self.gas.flights[ball];
            before.since == now && before.origin != Origin::Start
        };
        let mut keep = tied(ball) || tied(partner);
        let deed = Deed::Pair {
            balls: [ball, partner],
            separation: approach.separation_at(now),
        };
        let collision = self.execute(deed)?;
        for (one, other) in [(ball, partner), (partner, ball)] {
            let search = self.look_around(one, Some(other));
            keep |= !search.parts || search.disturbed || self.gas.turns_when_reversed(one);
        }
        self.remember(now, deed, keep);
        report(&collision);
        Ok(())
    }

    /// Changes the velocities at the present and counts.
    fn execute(&mut self, deed: Deed) -> Result<Collision, Stuck> {
        let balls = deed.balls();
        let begins = balls.map(|ball| {
            let flight = &self.gas.flights[ball];
            let begin = (flight.origin != Origin::Start).then(|| time_of(flight.since));
            (ball as u32, begin)
        });
        let counters = &mut self.counters;
        let (collision, changed) = match deed {
            Deed::Bounce {
                ball,
                axis,
                participants,
            } => {
                match participants {
                    Participants::Plane(..) => counters.plane_collisions += 1,
                    _ => counters.wall_collisions += 1,
                }
                (self.gas.bounce(ball, axis, participants), &begins[..1])
            }
            Deed::Pair { balls, separation } => {
                counters.pair_collisions += 1;
                (self.gas.collide(balls, separation), &begins[..])
            }
        };
        self.instants.note(&collision, changed, counters)?;
        Ok(collision)
    }

    /// Takes note of what has been done at a tick; `keep` if a reversed run could not work it out.
    fn remember(&mut self, now: i128, deed: Deed, keep: bool) {
        self.counters.remembered_events += u64::from(keep);
        self.memory.add(now, deed, keep);
    }

    /// Undoes what is remembered of a tick, which is now.
    fn undo(&mut self, report: &mut dyn FnMut(&Collision)) -> Result<(), Stuck> {
        let happening = self.memory.recall();
        self.gas.state.now = time_of(happening.tick);
        for &deed in &happening.deeds {
            report(&self.execute(deed)?);
        }
        for ball in happening.deeds.iter().flat_map(Deed::balls) {
            self.look_around(ball, None);
        }
        Ok(())
    }

    /// After a change of course: finds the ball's cells and its next collision anew.
    fn look_around(&mut self, ball: usize, partner: Option<usize>) -> Search {
        if self.interacting {
            let state = &self.gas.state;
            let position = state.trajectories[ball].position;
            self.cells
                .relocate(ball, position, state.bodies.of(ball).radius);
        }
        self.look_again(ball, partner)
    }

    /// Finds a ball's next collision anew.
    fn look_again(&mut self, ball: usize, partner: Option<usize>) -> Search {
        let search = self.search(ball, partner);
        self.candidates[ball] = search.best;
        self.schedule(ball);
        self.note_queue_length();
        search
    }

    fn search(&self, ball: usize, partner: Option<usize>) -> Search {
        let mut search = Search::new(ball, Candidate::NONE, partner);
        if self.interacting {
            self.cells.for_each_company(ball, |company| {
                search.look(&self.gas, &self.cells, company);
            });
        }
        search
    }
}

fn cell_width(state: &State) -> f64 {
    let count = state.ball_count().max(1) as f64;
    let spacing = (state.domain.volume() / count).cbrt();
    (SPACINGS_PER_CELL * spacing).max(DIAMETERS_PER_CELL * 2.0 * state.bodies.mean_radius())
}

impl Engine for Reversible {
    fn name(&self) -> &'static str {
        "reversible"
    }

    fn advance(&mut self, until: Time, report: &mut dyn FnMut(&Collision)) -> Result<(), Stuck> {
        let end = tick_of(until);
        loop {
            let event = self.calendar.first();
            if let Some(tick) = self.memory.next_tick()
                && tick <= end
                && event.is_none_or(|event| event.time >= self.relative(tick))
            {
                self.undo(report)?;
                continue;
            }
            let Some(event) = event else { break };
            if event.time >= REBASE_AFTER {
                let next = self.base.saturating_add(event.time as u64).min(until.epoch);
                if next > self.base {
                    self.rebase(next);
                    continue;
                }
            }
            if event.time > until.relative_to(self.base) {
                break;
            }
            let whole = event.time as u64;
            self.gas.state.now = Time {
                epoch: self.base + whole,
                local: event.time - whole as f64,
            };
            let ball = event.ball as usize;
            match event.kind() {
                EventKind::Crossing { axis } => self.cross(ball, axis),
                EventKind::Wall(face) if self.gas.state.domain.boundary == Boundary::Periodic => {
                    report(&self.gas.leave_box(ball, face));
                    self.look_around(ball, None);
                }
                EventKind::Wall(wall) => {
                    let participants = Participants::Wall(event.ball, wall);
                    self.bounce(ball, wall.axis, participants, report)?;
                }
                EventKind::Plane { plane } => {
                    let axis = axis_of(&self.gas.state.domain.planes[plane as usize])
                        .expect("planes are perpendicular to an axis");
                    let participants = Participants::Plane(event.ball, plane);
                    self.bounce(ball, axis, participants, report)?;
                }
                EventKind::Pair { partner } => self.meet(ball, partner as usize, report)?,
            }
        }
        if until > self.gas.state.now {
            self.gas.state.now = until;
        }
        Ok(())
    }

    fn state(&self) -> &State {
        &self.gas.state
    }

    fn settle(&mut self) {
        self.gas.settle();
    }

    /// At the present. What happened at this very tick is done again, as the mirror has it: first thing in the next advance.
    fn reverse(&mut self) {
        self.gas.reverse();
        self.memory.reverse(self.gas.now());
        self.instants.clear();
        self.predict_everything();
    }

    fn save(&self) -> engine::Saved {
        engine::Saved::Reversible(Saved {
            scale: self.gas.scale(),
            flights: self.gas.flights.clone(),
            memory: self.memory.clone(),
            instants: self.instants.clone(),
            counters: self.counters,
        })
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn queue_length(&self) -> usize {
        self.calendar.len()
    }
}
