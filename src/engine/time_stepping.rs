//! Engine `step`: in steps of fixed length, as the student paper's second method, with its errors counted.
//!
//! In a step all balls fly straight on; at its end balls that touch or overlap collide if they approach, and balls at or
//! beyond a wall or plane turn back if they move outwards. Nobody is moved out of an overlap: energy is kept to rounding, and
//! balls that part on their own are left alone. A ball may be beyond a wall by what it flies in a step.
//!
//! Its errors fall with the step: pressure `-1.25 sigma dt / d` at a packing fraction of a tenth, less in a thinner gas;
//! largest overlap below `8 sigma dt`; collisions missed because a pair met and parted within a step `2/3 (sigma dt / d)^2` of
//! all (`sigma` the thermal velocity, `d` the diameter; measured here).
//!
//! What always holds: a ball's trajectory changes at the ends of steps only, and only if it collides or leaves a periodic box,
//! so the state is right at any present and no rounding adds up in free flight. In a step, walls come before planes before
//! pairs, lower indices first; after a reversal the other way round, so that a step undoes what it did.

mod near_pairs;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::collision::approach_time;
use crate::domain::Boundary;
use crate::engine::step_clock::StepClock;
use crate::engine::time_stepping::near_pairs::NearPairs;
use crate::engine::{self, Counters, Engine, Stuck, contact};
use crate::event::{Collision, Participants, Wall};
use crate::state::{State, Time, Trajectory};

/// The time-driven engine.
#[derive(Clone, Debug)]
pub struct TimeStepping {
    state: State,
    clock: StepClock,
    /// Where the balls were at `placed_at`: the end of the last step, the start or the last reversal.
    places: Vec<DVec3>,
    placed_at: Time,
    /// `None` if no two balls can collide.
    near: Option<NearPairs>,
    /// No ball is faster.
    fastest: f64,
    /// Whether steps are undone rather than done.
    backwards: bool,
    /// Pairs that overlap at the end of this step, in ascending order, and of the step before.
    overlaps: Vec<Overlap>,
    overlaps_before: Vec<Overlap>,
    last_collision: Option<Time>,
    counters: Counters,
}

/// A pair that overlaps at the end of a step.
#[derive(Clone, Copy, Debug)]
struct Overlap {
    pair: [u32; 2],
    /// Its place in the list of near pairs.
    index: usize,
    /// Whether it has collided since it began to overlap.
    collided: bool,
}

/// What the engine knows beyond its state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Saved {
    clock: StepClock,
    placed_at: Time,
    /// How far the list of near pairs is good; negative if there is none.
    margin: f64,
    fastest: f64,
    backwards: bool,
    /// Pairs that overlap, and whether they have collided since they began to.
    overlaps: Vec<([u32; 2], bool)>,
    last_collision: Option<Time>,
    counters: Counters,
}

impl Saved {
    /// Whether it belongs to a gas of so many balls.
    pub fn fits(&self, ball_count: usize) -> bool {
        let known = |ball: u32| (ball as usize) < ball_count;
        (self.overlaps.iter()).all(|(pair, _)| pair[0] < pair[1] && known(pair[1]))
            && self.overlaps.is_sorted_by_key(|(pair, _)| *pair)
            && self.fastest.is_finite()
    }
}

impl TimeStepping {
    /// Steps of `step` scene times, which end at multiples of it; `step` must be positive.
    pub fn new(state: State, step: f64) -> Self {
        let places = places_at(&state);
        let interacting = state.bodies.largest_radius() > 0.0 && state.ball_count() > 1;
        Self {
            clock: StepClock::new(step / state.units.time, state.now),
            near: interacting.then(|| NearPairs::new(&state, &places)),
            fastest: fastest(&state),
            places,
            placed_at: state.now,
            backwards: false,
            overlaps: Vec::new(),
            overlaps_before: Vec::new(),
            last_collision: None,
            counters: Counters::default(),
            state,
        }
    }

    /// Goes on from what an engine has saved.
    pub fn resume(state: State, saved: Saved) -> Self {
        // A ball's flight has not changed since the end of the last step, so it says where the ball was then.
        let place = |flight: &Trajectory| flight.position_at(saved.placed_at);
        let places: Vec<_> = state.trajectories.iter().map(place).collect();
        let interacting = state.bodies.largest_radius() > 0.0 && state.ball_count() > 1;
        let near = interacting.then(|| {
            let mut near = NearPairs::new(&state, &places);
            near.restore(saved.margin, &state, &places);
            near
        });
        let overlap = |(pair, collided)| Overlap {
            pair,
            index: usize::MAX, // of the list before; nobody asks for it any more
            collided,
        };
        Self {
            clock: saved.clock,
            near,
            fastest: saved.fastest,
            places,
            placed_at: saved.placed_at,
            backwards: saved.backwards,
            overlaps: saved.overlaps.into_iter().map(overlap).collect(),
            overlaps_before: Vec::new(),
            last_collision: saved.last_collision,
            counters: saved.counters,
            state,
        }
    }

    /// One step, to its end at `time`.
    fn step(&mut self, time: Time, report: &mut dyn FnMut(&Collision)) {
        let length = time.since(self.placed_at);
        let covered = self.prepare_list(length);
        self.state.now = time;
        self.placed_at = time;
        for (place, flight) in self.places.iter_mut().zip(&self.state.trajectories) {
            *place = flight.position_at(time);
        }
        if self.state.domain.boundary == Boundary::Periodic {
            (0..self.places.len()).for_each(|ball| self.enter_box(ball, report));
        }
        std::mem::swap(&mut self.overlaps, &mut self.overlaps_before);
        self.overlaps.clear();
        if let Some(mut near) = self.near.take() {
            if !covered {
                near.list_touching(&self.state, &self.places);
            }
            self.find_overlaps(&near, length, covered);
            if self.backwards {
                self.collide_overlaps(&near, report);
                self.turn_back(report);
            } else {
                self.turn_back(report);
                self.collide_overlaps(&near, report);
            }
            self.near = Some(near);
        } else {
            self.turn_back(report);
        }
        self.counters.steps += 1;
        self.counters.audited_steps += u64::from(covered);
    }

    /// Sees to it that the list holds all pairs that may touch within a step of `length`; false if the step is too long.
    fn prepare_list(&mut self, length: f64) -> bool {
        let Some(near) = &mut self.near else {
            return true;
        };
        if near.take(2.0 * self.fastest * length) {
            return true;
        }
        self.fastest = fastest(&self.state);
        let way = 2.0 * self.fastest * length;
        if !near.can_cover(way) {
            return false;
        }
        near.list_for(way, &self.state, &self.places);
        near.take(way)
    }

    /// Finds the pairs that overlap, and counts those that met within the step and have parted again.
    fn find_overlaps(&mut self, near: &NearPairs, length: f64, audit: bool) {
        let way = if audit {
            2.0 * self.fastest * length
        } else {
            0.0
        };
        let period = self.state.domain.period();
        let periodic = period != DVec3::ZERO;
        let uniform = self.state.bodies.uniform().map(|body| 2.0 * body.radius);
        for (index, &pair) in near.pairs().iter().enumerate() {
            let [first, second] = pair.map(|ball| ball as usize);
            let contact = uniform.unwrap_or_else(|| {
                self.state.bodies.of(first).radius + self.state.bodies.of(second).radius
            });
            let mut separation = self.places[first] - self.places[second];
            if periodic {
                separation += near.image(index, &self.state).as_dvec3() * period;
            }
            let distance_squared = separation.length_squared();
            if distance_squared > (contact + way) * (contact + way) {
                continue; // nearly all pairs, when steps are short
            }
            if distance_squared <= contact * contact {
                self.overlaps.push(Overlap {
                    pair,
                    index,
                    collided: self.collided_before(pair),
                });
            } else {
                let velocity = self.state.trajectories[first].velocity
                    - self.state.trajectories[second].velocity;
                let before = separation - velocity * length;
                // Zero: they overlapped when the step began.
                let met = approach_time(before, velocity, contact)
                    .is_some_and(|time| 0.0 < time && time < length);
                self.counters.missed_collisions += u64::from(met);
            }
        }
    }

    /// Whether a pair overlapped at the end of the step before, too, and has collided since it began to.
    fn collided_before(&self, pair: [u32; 2]) -> bool {
        self.overlaps_before
            .binary_search_by_key(&pair, |overlap| overlap.pair)
            .is_ok_and(|found| self.overlaps_before[found].collided)
    }

    /// Pairs that overlap and approach collide.
    fn collide_overlaps(&mut self, near: &NearPairs, report: &mut dyn FnMut(&Collision)) {
        for turn in 0..self.overlaps.len() {
            let place = if self.backwards {
                self.overlaps.len() - 1 - turn
            } else {
                turn
            };
            let Overlap { pair, index, .. } = self.overlaps[place];
            let shift = near.image(index, &self.state).as_dvec3() * self.state.domain.period();
            if self.meet(pair, shift, report) {
                self.counters.double_bounces += u64::from(self.overlaps[place].collided);
                self.overlaps[place].collided = true;
            }
        }
    }

    /// Two balls that overlap collide, if they approach, the first moved by `shift` to the image that overlaps the second.
    fn meet(&mut self, pair: [u32; 2], shift: DVec3, report: &mut dyn FnMut(&Collision)) -> bool {
        let balls = pair.map(|ball| ball as usize);
        let before = balls.map(|ball| self.state.trajectories[ball]);
        let separation = self.places[balls[0]] - self.places[balls[1]] + shift;
        // Not so for two centres at one place, which have no direction to part in.
        if !(separation.dot(before[0].velocity - before[1].velocity) < 0.0) {
            return false;
        }
        let bodies = balls.map(|ball| self.state.bodies.of(ball));
        let (after, collision) = contact::pair(pair, before, bodies, shift, self.state.now);
        self.counters.pair_collisions += 1;
        self.note_instant(&balls);
        for (ball, after) in balls.into_iter().zip(after) {
            self.change_course(ball, after);
        }
        report(&collision);
        true
    }

    /// Balls at or beyond a wall or plane turn back, if they move outwards.
    fn turn_back(&mut self, report: &mut dyn FnMut(&Collision)) {
        let walls = self.state.domain.boundary == Boundary::Container;
        let planes = self.state.domain.planes.len();
        if !walls && planes == 0 {
            return;
        }
        let half_size = self.state.domain.half_size;
        for turn in 0..self.places.len() {
            let ball = if self.backwards {
                self.places.len() - 1 - turn
            } else {
                turn
            };
            let at_wall = walls && {
                let limit = half_size - self.state.bodies.of(ball).radius;
                self.places[ball].abs().cmpge(limit).any()
            };
            if self.backwards {
                (0..planes)
                    .rev()
                    .for_each(|plane| self.hit_plane(ball, plane, report));
            }
            if at_wall {
                (0..3).for_each(|axis| self.hit_wall(ball, axis, report));
            }
            if !self.backwards {
                (0..planes).for_each(|plane| self.hit_plane(ball, plane, report));
            }
        }
    }

    fn hit_wall(&mut self, ball: usize, axis: usize, report: &mut dyn FnMut(&Collision)) {
        let flight = self.state.trajectories[ball];
        let body = self.state.bodies.of(ball);
        let speed = flight.velocity[axis];
        let upper = speed > 0.0;
        let outwards = if upper { 1.0 } else { -1.0 };
        let reached = outwards * self.places[ball][axis];
        if speed == 0.0 || reached < self.state.domain.half_size[axis] - body.radius {
            return;
        }
        self.counters.wall_collisions += 1;
        let wall = Wall { axis, upper };
        // It turns back where it is, not where the wall is.
        let bounce = contact::wall(ball as u32, flight, body, wall, reached, self.state.now);
        self.bounce(ball, bounce, report);
    }

    fn hit_plane(&mut self, ball: usize, index: usize, report: &mut dyn FnMut(&Collision)) {
        let plane = &self.state.domain.planes[index];
        let upper = self.state.sides[ball * self.state.domain.planes.len() + index];
        let side = if upper { 1.0 } else { -1.0 };
        let flight = self.state.trajectories[ball];
        let body = self.state.bodies.of(ball);
        let gap = side * plane.distance(self.places[ball]) - body.radius;
        if gap > 0.0 || side * plane.normal.dot(flight.velocity) >= 0.0 {
            return;
        }
        self.counters.plane_collisions += 1;
        let met = (index as u32, plane, upper);
        let bounce = contact::plane(ball as u32, flight, body, met, self.state.now);
        self.bounce(ball, bounce, report);
    }

    /// A ball goes on after meeting something that does not move.
    fn bounce(
        &mut self,
        ball: usize,
        (after, collision): (Trajectory, Collision),
        report: &mut dyn FnMut(&Collision),
    ) {
        self.note_instant(&[ball]);
        self.change_course(ball, after);
        report(&collision);
    }

    /// A ball whose centre has left the periodic box comes in at the opposite face.
    fn enter_box(&mut self, ball: usize, report: &mut dyn FnMut(&Collision)) {
        let half_size = self.state.domain.half_size;
        if self.places[ball].abs().cmplt(half_size).all() {
            return;
        }
        for axis in 0..3 {
            let edge = 2.0 * half_size[axis];
            let left_at = self.places[ball][axis];
            // A long step may pass several boxes.
            let boxes = ((left_at + half_size[axis]) / edge).floor();
            if boxes == 0.0 {
                continue;
            }
            self.places[ball][axis] = left_at - boxes * edge;
            self.state.images[ball][axis] += boxes as i32;
            let velocity = self.state.trajectories[ball].velocity;
            self.state.trajectories[ball] = Trajectory {
                position: self.places[ball],
                velocity,
                begin: self.state.now,
            };
            let face = Wall {
                axis,
                upper: boxes > 0.0,
            };
            let momentum = self.state.bodies.of(ball).mass * velocity[axis];
            report(&Collision {
                time: self.state.now,
                participants: Participants::Face(ball as u32, face),
                impulse: DVec3::ZERO,
                external: DVec3::ZERO,
                virial: 0.0,
                radial_jump: momentum * (self.places[ball][axis] - left_at),
                gap: 0.0,
            });
        }
    }

    fn change_course(&mut self, ball: usize, flight: Trajectory) {
        self.fastest = self.fastest.max(flight.velocity.length());
        self.state.trajectories[ball] = flight;
        self.state.collisions[ball] += 1;
    }

    /// Counts collisions at one instant.
    fn note_instant(&mut self, balls: &[usize]) {
        let now = self.state.now;
        self.counters.ties += u64::from(self.last_collision == Some(now));
        self.last_collision = Some(now);
        for &ball in balls {
            let again =
                self.state.trajectories[ball].begin == now && self.state.collisions[ball] > 0;
            self.counters.zero_time_events += u64::from(again);
        }
    }
}

impl Engine for TimeStepping {
    fn name(&self) -> &'static str {
        "step"
    }

    fn advance(&mut self, until: Time, report: &mut dyn FnMut(&Collision)) -> Result<(), Stuck> {
        if until < self.state.now {
            return Ok(());
        }
        while self.clock.is_due(until) {
            self.step(self.clock.next_end(), report);
            self.clock.tick();
        }
        self.state.now = until;
        Ok(())
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn reverse(&mut self) {
        self.clock.reverse(self.state.now);
        self.state.reverse();
        self.places = places_at(&self.state);
        self.placed_at = self.state.now;
        self.backwards = !self.backwards;
        self.overlaps.clear();
        self.last_collision = None;
        if let Some(near) = &mut self.near {
            near.invalidate();
        }
    }

    fn save(&self) -> engine::Saved {
        engine::Saved::Step(Saved {
            clock: self.clock,
            placed_at: self.placed_at,
            margin: self.near.as_ref().map_or(-1.0, NearPairs::margin),
            fastest: self.fastest,
            backwards: self.backwards,
            overlaps: (self.overlaps.iter())
                .map(|overlap| (overlap.pair, overlap.collided))
                .collect(),
            last_collision: self.last_collision,
            counters: self.counters,
        })
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn queue_length(&self) -> usize {
        0
    }
}

/// Where all balls are at the present.
fn places_at(state: &State) -> Vec<DVec3> {
    let place = |flight: &Trajectory| flight.position_at(state.now);
    state.trajectories.iter().map(place).collect()
}

/// The largest speed.
fn fastest(state: &State) -> f64 {
    state
        .trajectories
        .iter()
        .fold(0.0_f64, |fastest, flight| {
            fastest.max(flight.velocity.length_squared())
        })
        .sqrt()
}
