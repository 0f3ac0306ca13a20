//! The gas in integers, and beside it the same gas rounded to f64 for everyone who only looks.
//!
//! What always holds: between two calls every trajectory is its flight, rounded.

use glam::DVec3;

use crate::domain::Boundary;
use crate::engine::reversible::fixed::{Refusal, Scale, axis_of, tick_of, time_of};
use crate::engine::reversible::flight::{self, Approach, Flight, Origin};
use crate::engine::reversible::involution;
use crate::event::{Collision, Participants, Wall};
use crate::state::{State, Trajectory};

/// Position and velocity of a ball in integer units.
pub type Words = ([i128; 3], [i64; 3]);

/// The gas.
#[derive(Clone, Debug)]
pub struct Gas {
    /// Rounded to f64.
    pub state: State,
    /// Every ball's flight.
    pub flights: Vec<Flight>,
    scale: Scale,
    half_size: [i128; 3],
    period: [i128; 3],
}

impl Gas {
    /// Rounds a gas to integers.
    ///
    /// # Errors
    /// [`Refusal`] if it cannot be run exactly.
    pub fn new(mut state: State) -> Result<Self, Refusal> {
        let scale = Scale::of(&state)?;
        let now = tick_of(state.now);
        state.now = time_of(now);
        let lengths = |vector: DVec3| vector.to_array().map(|length| scale.length(length));
        let flight = |trajectory: &Trajectory| Flight {
            position: lengths(trajectory.position_at(state.now)),
            velocity: trajectory.velocity.to_array().map(|v| scale.velocity(v)),
            at: now,
            since: now,
            origin: Origin::Start,
        };
        let mut gas = Self {
            flights: state.trajectories.iter().map(flight).collect(),
            half_size: lengths(state.domain.half_size),
            period: lengths(state.domain.period()),
            scale,
            state,
        };
        (0..gas.flights.len()).for_each(|ball| gas.round(ball));
        Ok(gas)
    }

    /// The gas as it was, with its state the same flights rounded.
    pub fn restored(state: State, scale: Scale, flights: Vec<Flight>) -> Self {
        let lengths = |vector: DVec3| vector.to_array().map(|length| scale.length(length));
        Self {
            flights,
            half_size: lengths(state.domain.half_size),
            period: lengths(state.domain.period()),
            scale,
            state,
        }
    }

    /// The units of the integers.
    pub fn scale(&self) -> Scale {
        self.scale
    }

    /// Position and velocity of every ball at the present; in a periodic box the position counts the boxes moved on, modulo
    /// 2^128.
    pub fn words(&self) -> Vec<Words> {
        let now = self.now();
        let words = |(ball, flight): (usize, &Flight)| {
            let mut position = flight.position_at(now);
            if let Some(image) = self.state.images.get(ball) {
                for axis in 0..3 {
                    let moved = i128::from(image[axis]).wrapping_mul(self.period[axis]);
                    position[axis] = position[axis].wrapping_add(moved);
                }
            }
            (position, flight.velocity)
        };
        self.flights.iter().enumerate().map(words).collect()
    }

    /// The present, as the last tick at or before it.
    #[inline]
    pub fn now(&self) -> i128 {
        tick_of(self.state.now)
    }

    /// Makes every trajectory begin at the present: the integers' positions there, rounded. Changes no flight.
    pub fn settle(&mut self) {
        let now = self.now();
        for ball in 0..self.flights.len() {
            self.flights[ball].refer_to(now);
            self.round(ball);
        }
    }

    /// Negates all velocities at the present.
    pub fn reverse(&mut self) {
        let now = self.now();
        self.state.now = time_of(now);
        for ball in 0..self.flights.len() {
            let reversed = self.flights[ball].velocity.map(|component| -component);
            self.turn(ball, reversed, now, Origin::Start);
        }
    }

    /// Two balls as they approach each other, the first moved by whole boxes.
    #[inline]
    pub fn approach(&self, first: usize, second: usize, image: [i8; 3]) -> Approach {
        let shift = std::array::from_fn(|axis| i128::from(image[axis]) * self.period[axis]);
        let contact = self.radius(first) + self.radius(second);
        Approach::new(&self.flights[first], &self.flights[second], shift, contact)
    }

    /// When a ball turns at a wall of a container.
    #[inline]
    pub fn wall_tick(&self, ball: usize, wall: Wall) -> Option<i128> {
        let (limit, upwards) = self.wall(ball, wall);
        self.flights[ball].wall_tick(wall.axis, limit, upwards)
    }

    /// When a ball turns at a plane.
    pub fn plane_tick(&self, ball: usize, plane: usize) -> Option<i128> {
        let (axis, limit, upwards) = self.plane(ball, plane);
        self.flights[ball].wall_tick(axis, limit, upwards)
    }

    /// Whether a ball that has just changed course would turn at a wall or a plane if time were reversed now.
    pub fn turns_when_reversed(&self, ball: usize) -> bool {
        let mut reversed = self.flights[ball];
        reversed.velocity = reversed.velocity.map(|component| -component);
        let turns = |(axis, limit, upwards): (usize, i128, bool)| {
            reversed.wall_tick(axis, limit, upwards) == Some(reversed.at)
        };
        let wall = |side: usize| {
            let (axis, upper) = (side / 2, side % 2 == 1);
            let (limit, upwards) = self.wall(ball, Wall { axis, upper });
            (axis, limit, upwards)
        };
        let planes = 0..self.state.domain.planes.len();
        (self.state.domain.boundary == Boundary::Container && (0..6).map(wall).any(turns))
            || planes.map(|plane| self.plane(ball, plane)).any(turns)
    }

    /// How far a ball's centre gets towards a wall, and whether that is upwards.
    #[inline]
    fn wall(&self, ball: usize, wall: Wall) -> (i128, bool) {
        let limit = self.half_size[wall.axis] - self.radius(ball);
        (if wall.upper { limit } else { -limit }, wall.upper)
    }

    /// The axis of a plane, how far a ball's centre gets along it, and whether that is upwards.
    fn plane(&self, ball: usize, index: usize) -> (usize, i128, bool) {
        let domain = &self.state.domain;
        let plane = &domain.planes[index];
        let axis = axis_of(plane).expect("planes are perpendicular to an axis");
        let place = self.scale.length(plane.offset * plane.normal[axis]);
        // On the side that the normal points to, a ball flies upwards to the plane if the normal points downwards.
        let upwards =
            self.state.sides[ball * domain.planes.len() + index] == (plane.normal[axis] < 0.0);
        let radius = self.radius(ball);
        let limit = if upwards {
            place - radius
        } else {
            place + radius
        };
        (axis, limit, upwards)
    }

    #[inline]
    fn radius(&self, ball: usize) -> i128 {
        self.scale.length(self.state.bodies.of(ball).radius)
    }

    /// A ball's centre leaves a periodic box at the present: the same flight, called by another image.
    pub fn leave_box(&mut self, ball: usize, face: Wall) -> Collision {
        let axis = face.axis;
        let now = self.now();
        let left_at = self.state.trajectories[ball].position_at(self.state.now)[axis];
        let step = if face.upper { 1 } else { -1 };
        self.flights[ball].refer_to(now);
        self.flights[ball].position[axis] -= i128::from(step) * self.period[axis];
        self.state.images[ball][axis] += step;
        self.round(ball);
        let after = self.state.trajectories[ball];
        let momentum = self.state.bodies.of(ball).mass * after.velocity[axis];
        Collision {
            time: self.state.now,
            participants: Participants::Face(ball as u32, face),
            impulse: DVec3::ZERO,
            external: DVec3::ZERO,
            virial: 0.0,
            radial_jump: momentum * (after.position[axis] - left_at),
            gap: 0.0,
        }
    }

    /// A ball turns at the present at a wall or a plane that is perpendicular to `axis`.
    pub fn bounce(&mut self, ball: usize, axis: usize, participants: Participants) -> Collision {
        let before = self.state.trajectories[ball].velocity;
        let mut velocity = self.flights[ball].velocity;
        velocity[axis] = -velocity[axis];
        self.turn(ball, velocity, self.now(), Origin::Wall);
        self.state.collisions[ball] += 1;
        let after = self.state.trajectories[ball];
        let impulse = (after.velocity - before) * self.state.bodies.of(ball).mass;
        let virial = after.position.dot(impulse);
        Collision {
            time: self.state.now,
            participants,
            impulse,
            external: impulse,
            virial,
            radial_jump: virial,
            gap: 0.0,
        }
    }

    /// Two balls collide at the present; `separation` leads from the second to the first.
    pub fn collide(&mut self, balls: [usize; 2], separation: [i128; 3]) -> Collision {
        let tick = self.now();
        let contact = self.radius(balls[0]) + self.radius(balls[1]);
        let gap = flight::gap(separation, contact);
        let masses = balls.map(|ball| self.state.bodies.of(ball).mass);
        let before = balls.map(|ball| self.state.trajectories[ball].velocity);
        // The lighter ball takes the rounding, as it has the smaller momentum; both directions of time must agree on which.
        let swap = masses[0] > masses[1] || (masses[0] == masses[1] && balls[0] > balls[1]);
        let [first, second] = if swap { [1, 0] } else { [0, 1] };
        let velocities = involution::collide(
            separation.map(|component| component as f64),
            shares(masses[first], masses[second]),
            [first, second].map(|one| self.flights[balls[one]].velocity),
        );
        for (one, velocity) in [first, second].into_iter().zip(velocities) {
            if masses[one].is_finite() {
                self.turn(balls[one], velocity, tick, Origin::Ball);
            }
            self.state.collisions[balls[one]] += 1;
        }
        let received = [0, 1].map(|one| {
            let after = self.state.trajectories[balls[one]].velocity;
            // An obstacle keeps its flight; what it receives leaves the gas.
            if masses[one].is_finite() {
                (after - before[one]) * masses[one]
            } else {
                DVec3::ZERO
            }
        });
        let positions = balls.map(|ball| self.state.trajectories[ball].position);
        let separation =
            DVec3::from_array(separation.map(|component| self.scale.to_length(component)));
        let [lower, higher] = if balls[0] < balls[1] { [0, 1] } else { [1, 0] };
        let all_move = masses.iter().all(|mass| mass.is_finite());
        let impulse_on = |one: usize| {
            if masses[one].is_finite() {
                received[one]
            } else {
                -received[1 - one]
            }
        };
        Collision {
            time: self.state.now,
            participants: Participants::Pair(balls[lower] as u32, balls[higher] as u32),
            impulse: impulse_on(lower),
            external: if all_move {
                DVec3::ZERO
            } else {
                received[0] + received[1]
            },
            // From the lower one, whichever noticed the other: rounding must not tell who did.
            virial: if lower == 0 { separation } else { -separation }.dot(impulse_on(lower)),
            radial_jump: positions[0].dot(received[0]) + positions[1].dot(received[1]),
            gap,
        }
    }

    /// A ball begins another flight at a tick.
    #[inline]
    fn turn(&mut self, ball: usize, velocity: [i64; 3], tick: i128, origin: Origin) {
        let flight = &mut self.flights[ball];
        flight.refer_to(tick);
        flight.velocity = velocity;
        flight.since = tick;
        flight.origin = origin;
        self.round(ball);
    }

    /// Rounds a ball's flight into the state.
    #[inline]
    fn round(&mut self, ball: usize) {
        let flight = &self.flights[ball];
        self.state.trajectories[ball] = Trajectory {
            position: flight.position.map(|x| self.scale.to_length(x)).into(),
            velocity: flight.velocity.map(|v| self.scale.to_velocity(v)).into(),
            begin: time_of(flight.at),
        };
    }
}

/// The parts that a ball and a heavier one take of the change of their relative velocity.
fn shares(light: f64, heavy: f64) -> [f64; 2] {
    if heavy.is_infinite() {
        return [1.0, 0.0];
    }
    [heavy / (light + heavy), light / (light + heavy)]
}
