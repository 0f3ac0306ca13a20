//! Engine `event`: from collision to collision, each ball on its own clock.
//!
//! Every ball has one event in the calendar: the earliest of its next cell crossing, its next wall or plane and the earliest
//! pair collision it knows of. A ball looks for partners among the balls of each cell it enters, and among all its cells
//! after each of its own collisions. In a dense gas lists of neighbours take the place of the cells (`shells.rs`).
//!
//! What always holds: of two balls that share a cell, the one that looked last knows a pair collision at or before theirs.
//! A known collision is checked when its turn comes: a prediction is a pure function of two trajectories, so it holds if
//! predicting again gives the same instant. If the partner has changed course meanwhile, the ball looks again; whatever it
//! had put aside for the earlier collision lies later, so nothing is missed.
//!
//! A ball whose centre leaves a periodic box changes its trajectory as at a wall: it goes on from the opposite face. A pair
//! is then looked at with one of the two moved by whole boxes.

mod ahead;
mod centers;
mod needs;
mod search;
mod shells;
mod sieve;
mod surroundings;

use std::marker::PhantomData;

use prefetch_index::prefetch_index;

use crate::calendar::{Bounded, Calendar, Indexed};
use crate::cell_list::CellList;
use crate::collision::{image_pair_time, plane_time, wall_time};
use crate::domain::{Boundary, Walls, Wrapped};
use crate::engine::contact::{self, InstantWatch};
use crate::engine::{Counters, Engine, Saved, Stuck, Tally};
use crate::event::{Collision, Event, EventKind, Wall};
use crate::state::{Body, State, Time, Trajectory};
use ahead::{Ahead, balls, crossing};
pub use needs::General;
use needs::{Needs, Plain};
use search::Candidate;
use shells::Shells;
pub use shells::{radius_for as shell_radius, words_for as record_words};
use surroundings::Surroundings;

/// Epochs after which the calendar's base moves on. Times up to 16 epochs from the base are exact in the calendar.
const REBASE_AFTER: f64 = 4.0;

/// Cell width in mean spacings of the balls; measured to be best, and flat around, for the dilute gas.
const SPACINGS_PER_CELL: f64 = 1.5;

/// Cell width in mean diameters, at least.
const DIAMETERS_PER_CELL: f64 = 1.75;

/// Balls from which on the memory that an event needs is asked for before its turn; fewer are at hand anyway (measured).
const BEYOND_CACHES: usize = 20_000;

/// Width of the cells that the engine makes for `count` balls in a volume \[length\], unless it is told another.
pub fn cell_width(volume: f64, count: usize, mean_radius: f64) -> f64 {
    let spacing = (volume / count.max(1) as f64).cbrt();
    (SPACINGS_PER_CELL * spacing).max(DIAMETERS_PER_CELL * 2.0 * mean_radius)
}

/// The engine for a state with the faster calendar, otherwise as [`fitting`]: bins where the memory of the events must be asked for
/// ahead of their turn, and a heap for few balls or dense ones, whose neighbours are at hand (measured).
pub fn usual(state: State, tally: Option<Tally>) -> Box<dyn Engine> {
    let (volume, count) = (state.domain.volume(), state.ball_count());
    let dense = shell_radius(volume, count, state.bodies.mean_radius()).is_some();
    if count > BEYOND_CACHES && !dense {
        fitting::<Bounded>(state, tally)
    } else {
        fitting::<Indexed>(state, tally)
    }
}

/// The engine for a state, with what its scene does not need left out of the loop; goes on from a tally if there is one.
///
/// The collisions are those of [`EventDriven`] in general, bit for bit.
pub fn fitting<C: Calendar + 'static>(state: State, tally: Option<Tally>) -> Box<dyn Engine> {
    match needs::plain(&state) {
        Some(Boundary::Container) => fitting_plain::<C, Walls>(state, tally),
        Some(Boundary::Periodic) => fitting_plain::<C, Wrapped>(state, tally),
        Some(Boundary::Open) | None => {
            Box::new(EventDriven::<C, General>::with_calendar(state).resumed(tally))
        }
    }
}

fn fitting_plain<C: Calendar + 'static, P: Plain + 'static>(
    state: State,
    tally: Option<Tally>,
) -> Box<dyn Engine> {
    match Shells::fitting(&state) {
        Some(shells) => Box::new(EventDriven::<C, P, _>::among(state, shells).resumed(tally)),
        None => Box::new(EventDriven::<C, P>::with_calendar(state).resumed(tally)),
    }
}

/// Engine `event` with lists of neighbours in shells of this radius \[length\], whether they pay or not; `None` where the scene
/// needs more than they can do.
pub fn with_shells(state: State, shell: f64) -> Option<Box<dyn Engine>> {
    fn plain<P: Plain + 'static>(state: State, shell: f64) -> Option<Box<dyn Engine>> {
        let shells = Shells::with_shell(&state, shell)?;
        Some(Box::new(EventDriven::<Indexed, P, _>::among(state, shells)))
    }
    match needs::plain(&state)? {
        Boundary::Container => plain::<Walls>(state, shell),
        Boundary::Periodic => plain::<Wrapped>(state, shell),
        Boundary::Open => None,
    }
}

/// The event-driven engine, with one of the calendars, for scenes with certain needs, in cells or other surroundings.
#[derive(Clone, Debug)]
pub struct EventDriven<C: Calendar = Indexed, N: Needs = General, S = CellList<N>> {
    state: State,
    /// Whether any two balls can collide; if not, there is nothing to look for and no cell to cross.
    interacting: bool,
    surroundings: S,
    needs: PhantomData<N>,
    calendar: C,
    /// The epoch from which the calendar counts.
    base: u64,
    candidates: Vec<Candidate>,
    reads_ahead: bool,
    ahead: Ahead,
    instants: InstantWatch,
    counters: Counters,
}

impl EventDriven {
    /// Predicts the first events of every ball; with the default calendar.
    pub fn new(state: State) -> Self {
        Self::with_calendar(state)
    }

    /// Like [`Self::new`], with cells at least `width` wide \[length\]. The collisions do not depend on it, their cost does.
    pub fn with_cell_width(state: State, width: f64) -> Self {
        Self::with_calendar_and_cell_width(state, width)
    }
}

impl<C: Calendar, N: Needs> EventDriven<C, N> {
    /// Predicts the first events of every ball. The collisions do not depend on the calendar, their cost does.
    pub fn with_calendar(state: State) -> Self {
        let width = cell_width(
            state.domain.volume(),
            state.ball_count(),
            state.bodies.mean_radius(),
        );
        Self::with_calendar_and_cell_width(state, width)
    }

    fn with_calendar_and_cell_width(state: State, width: f64) -> Self {
        let interacting = state.bodies.largest_radius() > 0.0 && state.ball_count() > 1;
        let count = if interacting { state.ball_count() } else { 0 };
        let cells = CellList::new(&state.domain, width, count);
        Self::among(state, cells)
    }

    /// Cells of the grid.
    pub fn cell_count(&self) -> usize {
        self.surroundings.cell_count()
    }
}

impl<C: Calendar, N: Needs, S: Surroundings<N>> EventDriven<C, N, S> {
    /// Predicts the first events of every ball, in surroundings that know nobody yet.
    fn among(state: State, surroundings: S) -> Self {
        let count = state.ball_count();
        let mut engine = Self {
            surroundings,
            needs: PhantomData,
            calendar: C::new(count),
            base: 0,
            candidates: Vec::new(),
            reads_ahead: count > BEYOND_CACHES,
            ahead: Ahead::new(),
            instants: InstantWatch::default(),
            counters: Counters::default(),
            interacting: state.bodies.largest_radius() > 0.0 && count > 1,
            state,
        };
        engine.predict_everything();
        engine
    }

    /// Goes on from what an event-driven or windowed engine has saved, if there is anything.
    fn resumed(mut self, tally: Option<Tally>) -> Self {
        if let Some(tally) = tally {
            self.counters = tally.counters;
            self.instants = tally.instants;
        }
        self
    }

    #[inline(always)]
    fn body(&self, ball: usize) -> Body {
        N::body(&self.state.bodies, ball)
    }

    #[inline(always)]
    fn interacting(&self) -> bool {
        N::interacting(self.interacting)
    }

    /// Makes cells, candidates and calendar from the state alone.
    fn predict_everything(&mut self) {
        let count = self.state.ball_count();
        self.candidates.clear();
        self.candidates.resize(count, Candidate::NONE);
        if self.interacting() {
            self.surroundings.clear(&self.state);
            for ball in 0..count {
                self.surroundings.push(&self.state, ball);
                // It looks among the balls before it; those after it will look for it.
                self.candidates[ball] = self.surroundings.look(&self.state, ball);
            }
        }
        self.rebase(self.state.now.epoch);
    }

    /// Moves the calendar's base to a later epoch.
    fn rebase(&mut self, epoch: u64) {
        let epochs = epoch.wrapping_sub(self.base).cast_signed() as f64;
        self.base = epoch;
        let mut calendar = std::mem::replace(&mut self.calendar, C::new(0));
        let events = (0..self.state.ball_count()).filter_map(|ball| self.next_event(ball));
        calendar.rebase(epochs, events);
        self.calendar = calendar;
        self.note_queue_length();
    }

    fn note_queue_length(&mut self) {
        self.counters.queue_length_max = self
            .counters
            .queue_length_max
            .max(self.calendar.len() as u64);
    }

    /// The earliest of a ball's crossings, walls, planes and known pair collision.
    #[inline]
    fn next_event(&self, ball: usize) -> Option<Event> {
        let trajectory = &self.state.trajectories[ball];
        let radius = self.body(ball).radius;
        let domain = &self.state.domain;
        let begin = trajectory.begin.relative_to(self.base);
        let mut next = (f64::INFINITY, EventKind::Crossing { axis: 0 });
        let mut offer = |time: f64, kind: EventKind| {
            if time < next.0 {
                next = (time, kind);
            }
        };
        if self.interacting()
            && let Some((flight, axis)) = self.surroundings.crossing(&self.state, ball)
        {
            offer(begin + flight, EventKind::Crossing { axis });
        }
        for axis in 0..3 {
            let speed = trajectory.velocity[axis];
            let face = Wall {
                axis,
                upper: speed > 0.0,
            };
            let limit = match N::of(domain.boundary) {
                Boundary::Container => domain.half_size[axis] - radius,
                Boundary::Periodic => domain.half_size[axis],
                Boundary::Open => continue,
            };
            if self.interacting() && !self.surroundings.may_reach(&self.state, ball, face) {
                continue;
            }
            if let Some(time) = wall_time(trajectory, axis, limit.copysign(speed)) {
                offer(time.relative_to(self.base), EventKind::Wall(face));
            }
        }
        for (index, plane) in N::planes(domain).iter().enumerate() {
            if let Some(time) = plane_time(trajectory, plane, self.is_above(ball, index), radius) {
                offer(
                    time.relative_to(self.base),
                    EventKind::Plane {
                        plane: index as u32,
                    },
                );
            }
        }
        // Walls and planes at the same instant come first, as the order of events has it.
        let candidate = &self.candidates[ball];
        if candidate.partner != u32::MAX {
            offer(
                candidate.time.relative_to(self.base),
                EventKind::Pair {
                    partner: candidate.partner,
                },
            );
        }
        let now = self.state.now.relative_to(self.base);
        (next.0 < f64::INFINITY).then(|| Event::new(next.0.max(now), ball as u32, next.1))
    }

    /// Whether a ball is on the side of a plane that its normal points to.
    fn is_above(&self, ball: usize, plane: usize) -> bool {
        self.state.sides[ball * self.state.domain.planes.len() + plane]
    }

    #[inline]
    fn schedule(&mut self, ball: usize) {
        match self.next_event(ball) {
            Some(event) => self.calendar.set(event),
            None => self.calendar.remove(ball as u32),
        }
    }

    /// Asks for the memory of the events that come before long: the calendar knows them by name, or just some of which one is next.
    #[inline]
    fn read_ahead(&mut self) {
        // A step more than one for each event keeps up with bins of any length.
        for _ in 0..2 {
            if let Some(event) = self.calendar.approaching() {
                self.prefetch(&event);
                self.ahead.see(event, &self.state, &self.surroundings);
            }
        }
        let [next, later] = self.calendar.soon();
        if let Some(event) = later {
            self.prefetch(&event);
        }
        if let Some(event) = next {
            for ball in balls(&event) {
                let axis = crossing(&event);
                self.surroundings.prefetch_places(&self.state, ball, axis);
                self.surroundings.prefetch_known(&self.state, ball, axis);
            }
        }
    }

    /// Asks for the memory of an event's balls.
    #[inline]
    fn prefetch(&self, event: &Event) {
        for ball in balls(event) {
            prefetch_index(&self.state.trajectories, ball);
            prefetch_index(&self.candidates, ball);
            self.surroundings.prefetch(ball);
            if crossing(event).is_none() {
                prefetch_index(&self.state.collisions, ball);
            }
        }
    }

    /// A ball reaches into new surroundings: it looks for partners there.
    #[inline]
    fn cross(&mut self, ball: usize, axis: usize) {
        self.counters.cell_crossings += 1;
        let best = &mut self.candidates[ball];
        self.surroundings.cross(&self.state, ball, axis, best);
        self.schedule(ball);
    }

    /// A ball's centre leaves the periodic box and enters at the opposite face.
    fn leave_box(&mut self, ball: usize, face: Wall, report: &mut dyn FnMut(&Collision)) {
        let half_size = self.state.domain.half_size[face.axis];
        let before = self.state.trajectories[ball];
        let (after, passage) = contact::face(
            ball as u32,
            before,
            self.body(ball),
            face,
            half_size,
            self.state.now,
        );
        self.state.images[ball][face.axis] += if face.upper { 1 } else { -1 };
        self.state.trajectories[ball] = after;
        if self.interacting() {
            self.surroundings.wrap(&self.state, ball);
        }
        self.look_again(ball);
        report(&passage);
    }

    fn hit_wall(
        &mut self,
        ball: usize,
        wall: Wall,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let body = self.body(ball);
        let limit = self.state.domain.half_size[wall.axis] - body.radius;
        let contact = contact::wall(
            ball as u32,
            self.state.trajectories[ball],
            body,
            wall,
            limit,
            self.state.now,
        );
        self.counters.wall_collisions += 1;
        self.bounce(ball, contact, report)
    }

    fn hit_plane(
        &mut self,
        ball: usize,
        index: usize,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let plane = (
            index as u32,
            &self.state.domain.planes[index],
            self.is_above(ball, index),
        );
        let body = self.body(ball);
        let contact = contact::plane(
            ball as u32,
            self.state.trajectories[ball],
            body,
            plane,
            self.state.now,
        );
        self.counters.plane_collisions += 1;
        self.bounce(ball, contact, report)
    }

    /// A ball goes on after meeting something that does not move.
    fn bounce(
        &mut self,
        ball: usize,
        (after, collision): (Trajectory, Collision),
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        self.instants.note(
            &collision,
            &[(ball as u32, self.last_contact(ball))],
            &mut self.counters,
        )?;
        self.state.trajectories[ball] = after;
        self.state.collisions[ball] += 1;
        self.look_around(ball);
        report(&collision);
        Ok(())
    }

    /// When a ball's last collision was, if it had one.
    fn last_contact(&self, ball: usize) -> Option<Time> {
        (self.state.collisions[ball] > 0).then(|| self.state.trajectories[ball].begin)
    }

    /// The pair collision that `ball` knows of is due; it happens if it still holds.
    fn meet(
        &mut self,
        ball: usize,
        partner: usize,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let now = self.state.now;
        let planned = self.candidates[ball];
        let pair = [ball.min(partner), ball.max(partner)];
        let shift = planned.shift(self.state.domain.period());
        let shift = if ball == pair[0] { shift } else { -shift };
        let before = pair.map(|ball| self.state.trajectories[ball]);
        let bodies = pair.map(|ball| self.body(ball));
        let distance = bodies[0].radius + bodies[1].radius;
        if image_pair_time(&before[0], &before[1], distance, shift) != Some(planned.time) {
            self.counters.stale_events += 1;
            self.look_again(ball);
            return Ok(());
        }
        self.counters.late_events += u64::from(planned.time < now);
        self.counters.pair_collisions += 1;
        let (after, collision) =
            contact::pair(pair.map(|ball| ball as u32), before, bodies, shift, now);
        let balls = pair.map(|ball| (ball as u32, self.last_contact(ball)));
        self.instants.note(&collision, &balls, &mut self.counters)?;
        for (ball, after) in pair.into_iter().zip(after) {
            self.state.trajectories[ball] = after;
            self.state.collisions[ball] += 1;
        }
        self.look_around(pair[0]);
        self.look_around(pair[1]);
        report(&collision);
        Ok(())
    }

    /// After a change of course: finds the ball's surroundings and its next collision anew.
    fn look_around(&mut self, ball: usize) {
        if self.interacting() {
            self.surroundings.turn(&self.state, ball);
        }
        self.look_again(ball);
    }

    /// Finds a ball's next collision anew.
    fn look_again(&mut self, ball: usize) {
        if self.interacting() {
            self.candidates[ball] = self.surroundings.look(&self.state, ball);
        }
        self.schedule(ball);
        self.note_queue_length();
    }
}

impl<C: Calendar, N: Needs, S: Surroundings<N>> Engine for EventDriven<C, N, S> {
    fn name(&self) -> &'static str {
        "event"
    }

    fn advance(&mut self, until: Time, report: &mut dyn FnMut(&Collision)) -> Result<(), Stuck> {
        while let Some(event) = self.calendar.first() {
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
            self.state.now = Time {
                epoch: self.base + whole,
                local: event.time - whole as f64,
            };
            let ball = event.ball as usize;
            if self.reads_ahead {
                self.read_ahead();
            }
            match event.kind() {
                EventKind::Crossing { axis } => self.cross(ball, axis),
                EventKind::Wall(face)
                    if N::of(self.state.domain.boundary) == Boundary::Periodic =>
                {
                    self.leave_box(ball, face, report);
                }
                EventKind::Wall(wall) => self.hit_wall(ball, wall, report)?,
                EventKind::Plane { plane } => self.hit_plane(ball, plane as usize, report)?,
                EventKind::Pair { partner } => self.meet(ball, partner as usize, report)?,
            }
        }
        if until > self.state.now {
            self.state.now = until;
        }
        Ok(())
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn reverse(&mut self) {
        self.state.reverse();
        self.instants.clear();
        self.calendar = C::new(self.state.ball_count());
        self.predict_everything();
    }

    fn save(&self) -> Saved {
        Saved::Exact(Tally {
            counters: self.counters,
            instants: self.instants.clone(),
        })
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn queue_length(&self) -> usize {
        self.calendar.len()
    }
}
