//! The slow twin of the exact engines, for gases in containers: every pair and every wall, without grid or calendar.
//!
//! The time at which a pair meets is kept until one of the two changes course, which is allowed because a prediction is a pure
//! function of two trajectories. Everything else is as plain as it can be.

use crate::collision::{collide, pair_time, wall_time};
use crate::event::{Participants, Wall};
use crate::experiment::trial::Record;
use crate::state::{State, Time, Trajectory};

/// Each ball's earliest known meeting with a wall or with a ball of higher index.
struct Twin {
    state: State,
    walls: Vec<Option<(Time, Wall)>>,
    /// For each ball, when it meets each ball of higher index.
    meetings: Vec<Vec<Option<Time>>>,
    /// For each ball, the ball of higher index that it meets first.
    earliest: Vec<Option<(Time, usize)>>,
}

/// The first collisions of a gas in a container.
///
/// # Panics
/// If the container has planes.
pub fn collisions(state: State, count: usize) -> Vec<Record> {
    assert!(state.domain.planes.is_empty(), "the twin knows no planes");
    let balls = state.ball_count();
    let mut twin = Twin {
        state,
        walls: vec![None; balls],
        meetings: (0..balls)
            .map(|ball| vec![None; balls - ball - 1])
            .collect(),
        earliest: vec![None; balls],
    };
    (0..balls).for_each(|ball| twin.predict(ball));
    let mut records = Vec::with_capacity(count);
    while records.len() < count {
        let Some(record) = twin.step() else { break };
        records.push(record);
    }
    records
}

impl Twin {
    /// Looks at everything that a ball may meet.
    fn predict(&mut self, ball: usize) {
        let state = &self.state;
        let flight = &state.trajectories[ball];
        let radius = state.bodies.of(ball).radius;
        self.walls[ball] = (0..3)
            .filter_map(|axis| {
                let upper = flight.velocity[axis] > 0.0;
                let limit = state.domain.half_size[axis] - radius;
                let time = wall_time(flight, axis, if upper { limit } else { -limit })?;
                Some((time, Wall { axis, upper }))
            })
            .reduce(|best, other| if other.0 < best.0 { other } else { best });
        for other in (0..self.state.ball_count()).filter(|&other| other != ball) {
            let (low, high) = (ball.min(other), ball.max(other));
            let flights = &self.state.trajectories;
            let contact = radius + self.state.bodies.of(other).radius;
            let time = pair_time(&flights[low], &flights[high], contact);
            self.meetings[low][high - low - 1] = time;
            if low == ball {
                continue; // looked at together below
            }
            let known = self.earliest[low];
            if known.is_some_and(|(_, partner)| partner == ball) {
                self.find_earliest(low);
            } else if let Some(time) = time
                && known.is_none_or(|known| (time, ball) < known)
            {
                self.earliest[low] = Some((time, ball));
            }
        }
        self.find_earliest(ball);
    }

    fn find_earliest(&mut self, ball: usize) {
        self.earliest[ball] = self.meetings[ball]
            .iter()
            .enumerate()
            .filter_map(|(place, time)| Some(((*time)?, ball + 1 + place)))
            .reduce(|best, other| if other.0 < best.0 { other } else { best });
    }

    /// The next collision: walls before pairs, lower indices first.
    fn step(&mut self) -> Option<Record> {
        let present = self.state.now;
        let mut best: Option<(Time, Participants)> = None;
        let mut offer = |time: Time, who| {
            // A collision found late happens now.
            let time = if time > present { time } else { present };
            if best.is_none_or(|(earliest, _)| time < earliest) {
                best = Some((time, who));
            }
        };
        for (ball, wall) in self.walls.iter().enumerate() {
            if let Some((time, wall)) = *wall {
                offer(time, Participants::Wall(ball as u32, wall));
            }
        }
        for (ball, meeting) in self.earliest.iter().enumerate() {
            if let Some((time, partner)) = *meeting {
                offer(time, Participants::Pair(ball as u32, partner as u32));
            }
        }
        let (now, participants) = best?;
        self.state.now = now;
        match participants {
            Participants::Wall(ball, wall) => self.reflect(ball as usize, wall),
            Participants::Pair(first, second) => self.meet([first as usize, second as usize]),
            _ => unreachable!("only walls and pairs were offered"),
        }
        Some((now, participants))
    }

    fn reflect(&mut self, ball: usize, wall: Wall) {
        let limit = self.state.domain.half_size[wall.axis] - self.state.bodies.of(ball).radius;
        let mut flight = self.state.trajectories[ball].synchronized(self.state.now);
        let inwards = if wall.upper { -1.0 } else { 1.0 };
        flight.position[wall.axis] = -inwards * limit;
        flight.velocity[wall.axis] = inwards * flight.velocity[wall.axis].abs();
        self.state.trajectories[ball] = flight;
        self.predict(ball);
    }

    fn meet(&mut self, pair: [usize; 2]) {
        let now = self.state.now;
        let flights = pair.map(|ball| self.state.trajectories[ball].synchronized(now));
        let masses = pair.map(|ball| self.state.bodies.of(ball).mass);
        let separation = flights[0].position - flights[1].position;
        let velocities = collide(separation, flights.map(|flight| flight.velocity), masses);
        for one in [0, 1] {
            if masses[one].is_finite() {
                self.state.trajectories[pair[one]] = Trajectory {
                    velocity: velocities[one],
                    ..flights[one]
                };
            }
        }
        self.predict(pair[0]);
        self.predict(pair[1]);
    }
}
