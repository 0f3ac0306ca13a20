//! What contacts do to flights, and how they are reported: the same arithmetic for every exact engine, so that all of them
//! agree bit for bit.

use std::collections::BTreeMap;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::collision::{collide, reflect};
use crate::domain::Plane;
use crate::engine::{Counters, Stuck};
use crate::event::{Collision, Participants, Wall};
use crate::state::{Body, Time, Trajectory};

/// Collisions of one ball at one instant before an engine gives up.
const MOST_REPEATS: u32 = 10_000;

/// Two balls collide at `now`, the lower index first; `shift` moves the first to the image that touches the second.
#[inline(always)]
pub fn pair(
    balls: [u32; 2],
    before: [Trajectory; 2],
    bodies: [Body; 2],
    shift: DVec3,
    now: Time,
) -> ([Trajectory; 2], Collision) {
    let mut after = before.map(|trajectory| trajectory.synchronized(now));
    let separation = after[0].position - after[1].position + shift;
    let masses = bodies.map(|body| body.mass);
    let velocities = collide(
        separation,
        before.map(|trajectory| trajectory.velocity),
        masses,
    );
    let mut received = [DVec3::ZERO; 2];
    for one in [0, 1] {
        if masses[one].is_finite() {
            after[one].velocity = velocities[one];
            received[one] = (after[one].velocity - before[one].velocity) * masses[one];
        } else {
            // An obstacle keeps its flight; what it receives leaves the gas.
            after[one] = before[one];
        }
    }
    let all_move = masses[0].is_finite() && masses[1].is_finite();
    let impulse = if masses[0].is_finite() {
        received[0]
    } else {
        -received[1]
    };
    let contact = bodies[0].radius + bodies[1].radius;
    let collision = Collision {
        time: now,
        participants: Participants::Pair(balls[0], balls[1]),
        impulse,
        external: if all_move {
            DVec3::ZERO
        } else {
            received[0] + received[1]
        },
        virial: separation.dot(impulse),
        radial_jump: after[0].position.dot(received[0]) + after[1].position.dot(received[1]),
        gap: (separation.length() - contact) / contact,
    };
    (after, collision)
}

/// A ball hits a wall of a container at `now`; `limit` is how far its centre gets along the wall's axis, without sign.
#[inline]
pub fn wall(
    ball: u32,
    before: Trajectory,
    body: Body,
    wall: Wall,
    limit: f64,
    now: Time,
) -> (Trajectory, Collision) {
    let mut after = before.synchronized(now);
    // The wall's coordinate itself, and a velocity with the inward sign: a repeated event cannot throw the ball out.
    after.position[wall.axis] = if wall.upper { limit } else { -limit };
    let speed = after.velocity[wall.axis].abs();
    after.velocity[wall.axis] = if wall.upper { -speed } else { speed };
    let collision = bounce(&before, &after, body, Participants::Wall(ball, wall));
    (after, collision)
}

/// A ball hits a plane at `now`, from the side that the normal points to (`upper`) or from the other.
#[inline]
pub fn plane(
    ball: u32,
    before: Trajectory,
    body: Body,
    (index, plane, upper): (u32, &Plane, bool),
    now: Time,
) -> (Trajectory, Collision) {
    let mut after = before.synchronized(now);
    after.velocity = reflect(after.velocity, plane, upper);
    let collision = bounce(&before, &after, body, Participants::Plane(ball, index));
    (after, collision)
}

/// A ball's centre leaves a periodic box through a face at `now` and enters at the opposite one.
#[inline]
pub fn face(
    ball: u32,
    before: Trajectory,
    body: Body,
    face: Wall,
    half_size: f64,
    now: Time,
) -> (Trajectory, Collision) {
    let mut after = before.synchronized(now);
    let left_at = after.position[face.axis];
    after.position[face.axis] = if face.upper { -half_size } else { half_size };
    let collision = Collision {
        time: now,
        participants: Participants::Face(ball, face),
        impulse: DVec3::ZERO,
        external: DVec3::ZERO,
        virial: 0.0,
        radial_jump: body.mass * before.velocity[face.axis] * (after.position[face.axis] - left_at),
        gap: 0.0,
    };
    (after, collision)
}

fn bounce(
    before: &Trajectory,
    after: &Trajectory,
    body: Body,
    participants: Participants,
) -> Collision {
    let impulse = (after.velocity - before.velocity) * body.mass;
    let virial = after.position.dot(impulse);
    Collision {
        time: after.begin,
        participants,
        impulse,
        external: impulse,
        virial,
        radial_jump: virial,
        gap: 0.0,
    }
}

/// Watches for collisions that repeat at one instant.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct InstantWatch {
    last_collision: Option<Time>,
    /// How often balls have collided again at that instant.
    repeats: BTreeMap<u32, u32>,
}

impl InstantWatch {
    /// Whether it knows of no balls but so many.
    pub fn fits(&self, ball_count: usize) -> bool {
        let last = self.repeats.last_key_value();
        last.is_none_or(|(&ball, _)| (ball as usize) < ball_count)
    }

    /// Forgets everything, as after a reversal.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Counts a collision of balls whose flights began at `begins` (`None` for one that has never collided).
    ///
    /// # Errors
    /// [`Stuck`] when a ball has collided too often at one instant.
    #[inline]
    pub fn note(
        &mut self,
        collision: &Collision,
        balls: &[(u32, Option<Time>)],
        counters: &mut Counters,
    ) -> Result<(), Stuck> {
        if self.last_collision == Some(collision.time) {
            counters.ties += 1;
            return self.note_tie(collision, balls, counters);
        }
        self.last_collision = Some(collision.time);
        self.repeats.clear();
        Ok(())
    }

    #[cold]
    fn note_tie(
        &mut self,
        collision: &Collision,
        balls: &[(u32, Option<Time>)],
        counters: &mut Counters,
    ) -> Result<(), Stuck> {
        for &(ball, begin) in balls {
            if begin != Some(collision.time) {
                continue;
            }
            counters.zero_time_events += 1;
            let repeats = self.repeats.entry(ball).or_default();
            *repeats += 1;
            if *repeats >= MOST_REPEATS {
                return Err(Stuck {
                    time: collision.time,
                    participants: collision.participants,
                    repeats: *repeats,
                });
            }
        }
        Ok(())
    }
}
