//! Engine `event`: from collision to collision, each ball on its own clock.
//!
//! Every ball has one event in the calendar: the earliest of its next cell crossing, its next wall and the earliest pair
//! collision it knows of. A ball looks for partners among the balls of each cell it enters, and among all its cells after
//! each of its own collisions.
//!
//! What always holds: of two balls that share a cell, the one that looked last knows a pair collision at or before theirs.
//! A known collision is checked when its turn comes: a prediction is a pure function of two trajectories, so it holds if
//! predicting again gives the same instant. If the partner has changed course meanwhile, the ball looks again; whatever it
//! had put aside for the earlier collision lies later, so nothing is missed.

use crate::calendar::Calendar;
use crate::cell_list::CellList;
use crate::collision::{collide, pair_time, wall_time};
use crate::engine::{Counters, Stuck};
use crate::event::{Collision, Event, EventKind, Participants, Wall};
use crate::state::{State, Time};

/// Epochs after which the calendar's base moves on. Times up to 16 epochs from the base are exact in the calendar.
const REBASE_AFTER: f64 = 4.0;

/// Collisions of one ball at one instant before the engine gives up.
const MOST_REPEATS: u32 = 10_000;

/// Cell width in mean spacings of the balls; measured to be best, and flat around, for the dilute gas.
const SPACINGS_PER_CELL: f64 = 1.5;

/// Cell width in largest diameters, at least.
const DIAMETERS_PER_CELL: f64 = 1.75;

/// The earliest pair collision that a ball knows of.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    time: Time,
    partner: u32,
}

/// Later than any collision.
const NO_CANDIDATE: Candidate = Candidate {
    time: Time {
        epoch: u64::MAX,
        local: 0.0,
    },
    partner: u32::MAX,
};

/// The event-driven engine.
#[derive(Clone, Debug)]
pub struct EventDriven {
    state: State,
    cells: CellList,
    calendar: Calendar,
    /// The epoch from which the calendar counts.
    base: u64,
    candidates: Vec<Candidate>,
    /// How often each ball has collided at the instant of its last collision before this one.
    repeats: Vec<u16>,
    last_collision: Option<Time>,
    counters: Counters,
}

impl EventDriven {
    /// Predicts the first events of every ball.
    pub fn new(state: State) -> Self {
        let spacing = (state.domain.volume() / state.ball_count().max(1) as f64).cbrt();
        let width = (SPACINGS_PER_CELL * spacing)
            .max(DIAMETERS_PER_CELL * 2.0 * state.bodies.largest_radius());
        Self::with_cell_width(state, width)
    }

    /// Like [`Self::new`], with cells at least `width` wide \[length\]. The collisions do not depend on it, their cost does.
    pub fn with_cell_width(state: State, width: f64) -> Self {
        let count = state.ball_count();
        let mut engine = Self {
            cells: CellList::new(state.domain.half_size(), width, count),
            calendar: Calendar::new(count),
            base: 0,
            candidates: Vec::new(),
            repeats: vec![0; count],
            last_collision: None,
            counters: Counters::default(),
            state,
        };
        engine.predict_everything(width);
        engine
    }

    /// The gas.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// What has been counted.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Events in the calendar; at most one per ball.
    pub fn queue_length(&self) -> usize {
        self.calendar.len()
    }

    /// Negates all velocities.
    pub fn reverse(&mut self) {
        self.state.reverse();
        self.last_collision = None;
        self.repeats.fill(0);
        self.predict_everything(self.cells.width());
    }

    /// Runs up to and including `until`, reporting each collision.
    ///
    /// # Errors
    /// [`Stuck`] if a ball collides without end at one instant, as in a packing without room.
    pub fn advance(
        &mut self,
        until: Time,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
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
            match event.kind() {
                EventKind::Crossing { axis } => self.cross(event.ball as usize, axis),
                EventKind::Wall(wall) => self.hit_wall(event.ball as usize, wall, report)?,
                EventKind::Pair { partner } => {
                    self.meet(event.ball as usize, partner as usize, report)?;
                }
            }
        }
        if until > self.state.now {
            self.state.now = until;
        }
        Ok(())
    }

    /// Makes cells, candidates and calendar from the state alone.
    fn predict_everything(&mut self, width: f64) {
        let count = self.state.ball_count();
        self.cells = CellList::new(self.state.domain.half_size(), width, count);
        for ball in 0..count {
            let position = self.state.trajectories[ball].position_at(self.state.now);
            self.cells.push(position, self.state.bodies.of(ball).radius);
        }
        self.candidates.clear();
        self.candidates.resize(count, NO_CANDIDATE);
        for ball in 0..count {
            // The lower ball of each pair knows of their collision: one is enough.
            let mut best = NO_CANDIDATE;
            for balls in self.cells.companions(ball) {
                look(
                    &self.state,
                    ball,
                    balls.iter().copied().filter(|&other| other as usize > ball),
                    &mut best,
                );
            }
            self.candidates[ball] = best;
        }
        self.rebase(self.state.now.epoch);
    }

    /// Moves the calendar's base to a later epoch.
    fn rebase(&mut self, epoch: u64) {
        self.base = epoch;
        let mut calendar = std::mem::replace(&mut self.calendar, Calendar::new(0));
        calendar.rebuild((0..self.state.ball_count()).filter_map(|ball| self.next_event(ball)));
        self.calendar = calendar;
        self.note_queue_length();
    }

    fn note_queue_length(&mut self) {
        self.counters.queue_length_max = self
            .counters
            .queue_length_max
            .max(self.calendar.len() as u64);
    }

    /// The earliest of a ball's crossings, walls and known pair collision.
    #[inline]
    fn next_event(&self, ball: usize) -> Option<Event> {
        let trajectory = &self.state.trajectories[ball];
        let radius = self.state.bodies.of(ball).radius;
        let half_size = self.state.domain.half_size();
        let now = self.state.now.relative_to(self.base);
        let begin = trajectory.begin.relative_to(self.base);
        let candidate = self.candidates[ball];
        let mut next = (f64::INFINITY, EventKind::Crossing { axis: 0 });
        for axis in 0..3 {
            let speed = trajectory.velocity[axis];
            let (time, kind) =
                if let Some(flight) = self.cells.crossing(ball, trajectory, radius, axis) {
                    (begin + flight, EventKind::Crossing { axis })
                } else {
                    let limit = (half_size[axis] - radius).copysign(speed);
                    let Some(time) = wall_time(trajectory, axis, limit) else {
                        continue;
                    };
                    (
                        time.relative_to(self.base),
                        EventKind::Wall(Wall {
                            axis,
                            upper: speed > 0.0,
                        }),
                    )
                };
            if time < next.0 {
                next = (time, kind);
            }
        }
        // A wall at the same instant comes first, as the order of events has it.
        if candidate.partner != u32::MAX {
            let time = candidate.time.relative_to(self.base);
            if time < next.0 {
                next = (
                    time,
                    EventKind::Pair {
                        partner: candidate.partner,
                    },
                );
            }
        }
        (next.0 < f64::INFINITY).then(|| Event::new(next.0.max(now), ball as u32, next.1))
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
        let trajectory = self.state.trajectories[ball];
        let position = trajectory.position_at(self.state.now);
        let radius = self.state.bodies.of(ball).radius;
        let mut best = self.candidates[ball];
        let state = &self.state;
        self.cells
            .cross(ball, position, trajectory.velocity, radius, axis, |balls| {
                look(state, ball, balls.iter().copied(), &mut best);
            });
        self.candidates[ball] = best;
        self.schedule(ball);
    }

    fn hit_wall(
        &mut self,
        ball: usize,
        wall: Wall,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let now = self.state.now;
        let body = self.state.bodies.of(ball);
        let limit = self.state.domain.half_size()[wall.axis] - body.radius;
        let limit = if wall.upper { limit } else { -limit };
        let before = self.state.trajectories[ball];
        let mut after = before.synchronized(now);
        // The wall's coordinate itself, and a velocity with the inward sign: a repeated event cannot throw the ball out.
        after.position[wall.axis] = limit;
        after.velocity[wall.axis] = -before.velocity[wall.axis].abs().copysign(limit);
        let impulse = (after.velocity - before.velocity) * body.mass;
        let collision = Collision {
            time: now,
            participants: Participants::Wall(ball as u32, wall),
            impulse,
            virial: after.position.dot(impulse),
            gap: 0.0,
        };
        self.counters.wall_collisions += 1;
        self.note_instant(&collision, &[ball])?;
        self.state.trajectories[ball] = after;
        self.state.collisions[ball] += 1;
        self.look_around(ball);
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
        let now = self.state.now;
        let (first, second) = (ball.min(partner), ball.max(partner));
        let before = [
            self.state.trajectories[first],
            self.state.trajectories[second],
        ];
        let bodies = [self.state.bodies.of(first), self.state.bodies.of(second)];
        let contact = bodies[0].radius + bodies[1].radius;
        let planned = self.candidates[ball].time;
        if pair_time(&before[0], &before[1], contact) != Some(planned) {
            self.counters.stale_events += 1;
            self.look_around_from_same_flight(ball);
            return Ok(());
        }
        self.counters.late_events += u64::from(planned < now);
        let mut after = before.map(|trajectory| trajectory.synchronized(now));
        let separation = after[0].position - after[1].position;
        let masses = bodies.map(|body| body.mass);
        [after[0].velocity, after[1].velocity] = collide(
            separation,
            before.map(|trajectory| trajectory.velocity),
            masses,
        );
        let impulse = (after[0].velocity - before[0].velocity) * masses[0];
        let collision = Collision {
            time: now,
            participants: Participants::Pair(first as u32, second as u32),
            impulse,
            virial: separation.dot(impulse),
            gap: (separation.length() - contact) / contact,
        };
        self.counters.pair_collisions += 1;
        self.note_instant(&collision, &[first, second])?;
        for (ball, after) in [first, second].into_iter().zip(after) {
            self.state.trajectories[ball] = after;
            self.state.collisions[ball] += 1;
        }
        self.look_around(first);
        self.look_around(second);
        report(&collision);
        Ok(())
    }

    /// Counts collisions at one instant, and stops a ball that collides there without end.
    fn note_instant(&mut self, collision: &Collision, balls: &[usize]) -> Result<(), Stuck> {
        self.counters.ties += u64::from(self.last_collision == Some(collision.time));
        self.last_collision = Some(collision.time);
        for &ball in balls {
            let again = self.state.trajectories[ball].begin == collision.time
                && self.state.collisions[ball] > 0;
            self.repeats[ball] = if again { self.repeats[ball] + 1 } else { 0 };
            self.counters.zero_time_events += u64::from(again);
            let repeats = u32::from(self.repeats[ball]);
            if repeats >= MOST_REPEATS {
                return Err(Stuck {
                    time: collision.time,
                    participants: collision.participants,
                    repeats,
                });
            }
        }
        Ok(())
    }

    /// After a change of course: finds the ball's cells and its next collision anew.
    fn look_around(&mut self, ball: usize) {
        self.cells.relocate(
            ball,
            self.state.trajectories[ball].position,
            self.state.bodies.of(ball).radius,
        );
        self.look_around_from_same_flight(ball);
    }

    /// Finds a ball's next collision anew.
    fn look_around_from_same_flight(&mut self, ball: usize) {
        let mut best = NO_CANDIDATE;
        for balls in self.cells.companions(ball) {
            look(&self.state, ball, balls.iter().copied(), &mut best);
        }
        self.candidates[ball] = best;
        self.schedule(ball);
        self.note_queue_length();
    }
}

/// Improves a ball's candidate by its collisions with `others`.
#[inline]
fn look(state: &State, ball: usize, others: impl Iterator<Item = u32>, best: &mut Candidate) {
    let trajectory = state.trajectories[ball];
    let radius = state.bodies.of(ball).radius;
    for other in others {
        if other as usize == ball {
            continue;
        }
        let contact = radius + state.bodies.of(other as usize).radius;
        if let Some(time) = pair_time(&trajectory, &state.trajectories[other as usize], contact)
            && (time < best.time
                || (time == best.time && pair_precedes(ball as u32, other, best.partner)))
        {
            *best = Candidate {
                time,
                partner: other,
            };
        }
    }
}

/// Whether the pair of `ball` and `other` comes before that of `ball` and `rival` at the same instant.
fn pair_precedes(ball: u32, other: u32, rival: u32) -> bool {
    (ball.min(other), ball.max(other)) < (ball.min(rival), ball.max(rival))
}
