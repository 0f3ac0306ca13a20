//! The seed's lazy queue: after each collision every ball that the two might meet, ever, goes into one heap.
//!
//! What became untrue stays in the heap until its time comes and is thrown away then. Nothing but the heap's length is wanted
//! here; what happens in the gas is what happens in every exact engine.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::collision::{pair_time, wall_time};
use crate::engine::contact;
use crate::event::Wall;
use crate::state::{State, Time};

/// A predicted collision: true if both balls have changed course as often as they had then. The earlier is the smaller.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    epoch: u64,
    /// Bits of the local time: those of numbers that are not negative are in the numbers' order.
    local: u64,
    ball: u32,
    changes: u32,
    partner: Partner,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Partner {
    /// A ball, and how often it had changed course.
    Ball(u32, u32),
    /// A wall, by its axis and whether it is the upper one.
    Wall(usize, bool),
}

impl Entry {
    fn time(&self) -> Time {
        Time {
            epoch: self.epoch,
            local: f64::from_bits(self.local),
        }
    }
}

/// A gas in a container and its heap.
pub struct EveryPrediction {
    state: State,
    heap: BinaryHeap<Reverse<Entry>>,
    changes: Vec<u32>,
    collisions: u64,
}

impl EveryPrediction {
    /// Predicts every ball against every other.
    pub fn new(state: State) -> Self {
        let count = state.ball_count();
        let mut twin = Self {
            heap: BinaryHeap::new(),
            changes: vec![0; count],
            collisions: 0,
            state,
        };
        (0..count).for_each(|ball| twin.predict(ball, ball));
        twin
    }

    /// Entries, true or not.
    pub fn len(&self) -> usize {
        self.heap.len()
    }

    /// Collisions so far.
    pub fn collisions(&self) -> u64 {
        self.collisions
    }

    /// Pushes the ball's next wall and every ball below `others` that it might meet.
    fn predict(&mut self, ball: usize, others: usize) {
        let state = &self.state;
        let flight = state.trajectories[ball];
        let radius = state.bodies.of(ball).radius;
        let changes = self.changes[ball];
        let entry = |time: Time, partner| Entry {
            epoch: time.epoch,
            local: time.local.to_bits(),
            ball: ball as u32,
            changes,
            partner,
        };
        let wall = (0..3)
            .filter_map(|axis| {
                let upper = flight.velocity[axis] > 0.0;
                let limit = state.domain.half_size[axis] - radius;
                let time = wall_time(&flight, axis, if upper { limit } else { -limit })?;
                Some(entry(time, Partner::Wall(axis, upper)))
            })
            .min();
        self.heap.extend(wall.map(Reverse));
        for other in (0..others).filter(|&other| other != ball) {
            let contact = radius + state.bodies.of(other).radius;
            if let Some(time) = pair_time(&flight, &state.trajectories[other], contact) {
                let partner = Partner::Ball(other as u32, self.changes[other]);
                self.heap.push(Reverse(entry(time, partner)));
            }
        }
    }

    /// Runs to a simulated time in the scene's units.
    pub fn run(&mut self, until: f64) {
        let until = self.state.units.instant(until);
        while let Some(&Reverse(entry)) = self.heap.peek().filter(|entry| entry.0.time() <= until) {
            self.heap.pop();
            let ball = entry.ball as usize;
            let true_still = self.changes[ball] == entry.changes
                && match entry.partner {
                    Partner::Ball(other, changes) => self.changes[other as usize] == changes,
                    Partner::Wall(..) => true,
                };
            if true_still {
                self.state.now = entry.time();
                self.collisions += 1;
                match entry.partner {
                    Partner::Ball(other, _) => {
                        self.meet([ball.min(other as usize), ball.max(other as usize)])
                    }
                    Partner::Wall(axis, upper) => self.reflect(ball, Wall { axis, upper }),
                }
            }
        }
        self.state.now = until;
    }

    fn change(&mut self, ball: usize) {
        self.changes[ball] += 1;
        self.predict(ball, self.state.ball_count());
    }

    fn reflect(&mut self, ball: usize, wall: Wall) {
        let body = self.state.bodies.of(ball);
        let limit = self.state.domain.half_size[wall.axis] - body.radius;
        let before = self.state.trajectories[ball];
        let (after, _) = contact::wall(ball as u32, before, body, wall, limit, self.state.now);
        self.state.trajectories[ball] = after;
        self.change(ball);
    }

    fn meet(&mut self, pair: [usize; 2]) {
        let before = pair.map(|ball| self.state.trajectories[ball]);
        let bodies = pair.map(|ball| self.state.bodies.of(ball));
        let balls = pair.map(|ball| ball as u32);
        let (after, _) = contact::pair(balls, before, bodies, glam::DVec3::ZERO, self.state.now);
        for one in [0, 1] {
            self.state.trajectories[pair[one]] = after[one];
        }
        // The first is predicted against the second's new flight: once is enough.
        self.changes[pair[0]] += 1;
        self.changes[pair[1]] += 1;
        let others = self.state.ball_count();
        self.predict(pair[0], others);
        self.predict(pair[1], others);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::gases::seed_scene;
    use crate::experiment::trial::{EVENT, Trial};

    #[test]
    fn the_seeds_way_has_the_collisions_of_engine_event_and_a_growing_queue() {
        let gas = seed_scene(4, 1);
        let mut twin = EveryPrediction::new(State::new(&gas));
        let start = twin.len();
        twin.run(10.0);
        let mut trial = Trial::new(EVENT, &gas);
        trial.run(10.0);
        assert_eq!(twin.state.hash(), trial.state().hash());
        assert_eq!(twin.collisions(), trial.events());
        assert!(twin.len() > start);
    }
}
