//! Balls alike in a container, every pair and every wall, in any precision: a reference that engines are held against, and a
//! look at what fewer digits would do.
//!
//! The same formulas as the engines', each ball on its own clock, but nothing else of theirs: no grid, no calendar, no internal
//! units, no epochs.

use std::ops::{Add, Div, Mul, Sub};

use crate::domain::Boundary;
use crate::experiment::double_double::DoubleDouble;
use crate::state::Placement;

/// A number to compute with.
pub trait Scalar:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// The nearest to an f64.
    fn nearest(value: f64) -> Self;

    /// The nearest f64.
    fn value(self) -> f64;

    /// The square root of a number that is not negative.
    #[must_use]
    fn root(self) -> Self;
}

impl Scalar for f32 {
    fn nearest(value: f64) -> Self {
        value as Self
    }

    fn value(self) -> f64 {
        f64::from(self)
    }

    fn root(self) -> Self {
        self.sqrt()
    }
}

impl Scalar for f64 {
    fn nearest(value: f64) -> Self {
        value
    }

    fn value(self) -> f64 {
        self
    }

    fn root(self) -> Self {
        self.sqrt()
    }
}

impl Scalar for DoubleDouble {
    fn nearest(value: f64) -> Self {
        value.into()
    }

    fn value(self) -> f64 {
        DoubleDouble::value(self)
    }

    fn root(self) -> Self {
        self.sqrt()
    }
}

type Vector<S> = [S; 3];

fn each<S: Copy>(make: impl Fn(usize) -> S) -> Vector<S> {
    [make(0), make(1), make(2)]
}

fn dot<S: Scalar>(a: &Vector<S>, b: &Vector<S>) -> S {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[derive(Clone, Copy)]
struct Ball<S> {
    position: Vector<S>,
    velocity: Vector<S>,
    begin: S,
}

impl<S: Scalar> Ball<S> {
    fn position_at(&self, time: S) -> Vector<S> {
        let flown = time - self.begin;
        each(|axis| self.position[axis] + self.velocity[axis] * flown)
    }
}

#[derive(Clone, Copy)]
enum Partner {
    Ball(usize),
    Wall(usize),
}

/// A gas, its clock, and the next event of each ball.
pub struct Precise<S> {
    balls: Vec<Ball<S>>,
    next: Vec<Option<(S, Partner)>>,
    limit: Vector<S>,
    contact: S,
    now: S,
    collisions: u64,
}

impl<S: Scalar> Precise<S> {
    /// A gas at time zero.
    ///
    /// # Panics
    /// If the balls are not alike, or not in a container without planes around the origin.
    pub fn new(gas: &Placement) -> Self {
        let [body] = gas.bodies.as_slice() else {
            panic!("the reference knows balls of one kind only");
        };
        let walls_only = gas.domain.boundary == Boundary::Container && gas.domain.planes.is_empty();
        assert!(walls_only, "the reference knows containers only");
        let vector = |vector: &glam::DVec3| each(|axis| S::nearest(vector[axis]));
        let ball = |(position, velocity)| Ball {
            position: vector(position),
            velocity: vector(velocity),
            begin: S::nearest(0.0),
        };
        let balls: Vec<_> = gas
            .positions
            .iter()
            .zip(&gas.velocities)
            .map(ball)
            .collect();
        let mut gas = Self {
            next: vec![None; balls.len()],
            limit: vector(&(gas.domain.half_size - body.radius)),
            contact: S::nearest(2.0 * body.radius),
            now: S::nearest(0.0),
            collisions: 0,
            balls,
        };
        gas.predict_all();
        gas
    }

    /// Collisions so far, with balls and walls.
    pub fn collisions(&self) -> u64 {
        self.collisions
    }

    /// Positions and velocities at the present.
    pub fn present(&self) -> Vec<(Vector<S>, Vector<S>)> {
        let present = |ball: &Ball<S>| (ball.position_at(self.now), ball.velocity);
        self.balls.iter().map(present).collect()
    }

    /// Turns all velocities round.
    pub fn reverse(&mut self) {
        let zero = S::nearest(0.0);
        for ball in &mut self.balls {
            *ball = Ball {
                position: ball.position_at(self.now),
                velocity: each(|axis| zero - ball.velocity[axis]),
                begin: self.now,
            };
        }
        self.predict_all();
    }

    /// Runs to a time.
    pub fn run(&mut self, until: f64) {
        let until = S::nearest(until);
        while let Some((ball, time, partner)) = self.first().filter(|event| event.1 <= until) {
            self.now = time;
            self.collisions += 1;
            match partner {
                Partner::Wall(axis) => self.reflect(ball, axis),
                Partner::Ball(other) => self.meet(ball, other),
            }
        }
        self.now = until;
    }

    fn first(&self) -> Option<(usize, S, Partner)> {
        let events = self.next.iter().enumerate();
        events
            .filter_map(|(ball, next)| next.map(|(time, partner)| (ball, time, partner)))
            .reduce(|first, other| if other.1 < first.1 { other } else { first })
    }

    fn predict_all(&mut self) {
        (0..self.balls.len()).for_each(|ball| self.predict(ball));
    }

    /// Finds what a ball meets first.
    fn predict(&mut self, ball: usize) {
        let walls =
            (0..3).filter_map(|axis| Some((self.wall_time(ball, axis)?, Partner::Wall(axis))));
        let others = (0..self.balls.len()).filter(|&other| other != ball);
        let pairs =
            others.filter_map(|other| Some((self.pair_time(ball, other)?, Partner::Ball(other))));
        self.next[ball] = walls
            .chain(pairs)
            .reduce(|first, other| if other.0 < first.0 { other } else { first });
    }

    /// After balls have changed course: finds what they meet, and what meets them.
    fn change(&mut self, changed: &[usize]) {
        for other in 0..self.balls.len() {
            if changed.contains(&other) {
                self.predict(other);
                continue;
            }
            match self.next[other] {
                Some((_, Partner::Ball(partner))) if changed.contains(&partner) => {
                    self.predict(other)
                }
                next => {
                    for &ball in changed {
                        let time = self.pair_time(ball, other);
                        if let Some(time) =
                            time.filter(|time| next.is_none_or(|next| *time < next.0))
                            && self.next[other].is_none_or(|next| time < next.0)
                        {
                            self.next[other] = Some((time, Partner::Ball(ball)));
                        }
                    }
                }
            }
        }
    }

    fn wall_time(&self, ball: usize, axis: usize) -> Option<S> {
        let (zero, ball) = (S::nearest(0.0), &self.balls[ball]);
        let speed = ball.velocity[axis];
        let limit = if speed > zero {
            self.limit[axis]
        } else {
            zero - self.limit[axis]
        };
        let flight = (speed != zero).then(|| (limit - ball.position[axis]) / speed)?;
        Some(ball.begin + if flight > zero { flight } else { zero })
    }

    fn pair_time(&self, first: usize, second: usize) -> Option<S> {
        let (first, second) = (&self.balls[first], &self.balls[second]);
        let begin = if first.begin > second.begin {
            first.begin
        } else {
            second.begin
        };
        let (a, b) = (first.position_at(begin), second.position_at(begin));
        let separation = each(|axis| a[axis] - b[axis]);
        let velocity = each(|axis| first.velocity[axis] - second.velocity[axis]);
        let zero = S::nearest(0.0);
        let radial = dot(&separation, &velocity);
        if !(radial < zero) {
            return None;
        }
        let speed_squared = dot(&velocity, &velocity);
        let distance_squared = dot(&separation, &separation);
        // Most pass by far: no root is needed to see that.
        let beyond = distance_squared - self.contact * self.contact;
        if radial.value() * radial.value() < 0.999 * speed_squared.value() * beyond.value() {
            return None;
        }
        let distance = distance_squared.root();
        let gap = distance - self.contact;
        if !(gap > zero) {
            return Some(begin);
        }
        let share = radial / speed_squared;
        let closest = each(|axis| separation[axis] - velocity[axis] * share);
        let depth = self.contact - dot(&closest, &closest).root();
        if !(depth > zero) {
            return None;
        }
        let discriminant = speed_squared * depth * (self.contact + (self.contact - depth));
        Some(begin + gap * (distance + self.contact) / (discriminant.root() - radial))
    }

    fn reflect(&mut self, ball: usize, axis: usize) {
        let zero = S::nearest(0.0);
        let mut after = Ball {
            position: self.balls[ball].position_at(self.now),
            begin: self.now,
            ..self.balls[ball]
        };
        let upper = after.velocity[axis] > zero;
        after.position[axis] = if upper {
            self.limit[axis]
        } else {
            zero - self.limit[axis]
        };
        after.velocity[axis] = zero - after.velocity[axis];
        self.balls[ball] = after;
        self.change(&[ball]);
    }

    fn meet(&mut self, ball: usize, other: usize) {
        let (low, high) = (ball.min(other), ball.max(other));
        let [first, second] = [low, high].map(|ball| &self.balls[ball]);
        let (a, b) = (first.position_at(self.now), second.position_at(self.now));
        let normal = each(|axis| a[axis] - b[axis]);
        let relative = each(|axis| first.velocity[axis] - second.velocity[axis]);
        let share = dot(&relative, &normal) / dot(&normal, &normal);
        let exchanged = each(|axis| normal[axis] * share);
        let after = [
            Ball {
                position: a,
                velocity: each(|axis| first.velocity[axis] - exchanged[axis]),
                begin: self.now,
            },
            Ball {
                position: b,
                velocity: each(|axis| second.velocity[axis] + exchanged[axis]),
                begin: self.now,
            },
        ];
        (self.balls[low], self.balls[high]) = (after[0], after[1]);
        self.change(&[low, high]);
    }
}

/// Length of the difference of two vectors, taken before anything is rounded to f64.
pub fn distance<S: Scalar>(a: &Vector<S>, b: &Vector<S>) -> f64 {
    let difference = each(|axis| a[axis] - b[axis]);
    dot(&difference, &difference).value().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::gases::seed_scene;
    use crate::experiment::trial::{EVENT, Trial};

    #[test]
    fn the_reference_agrees_with_engine_event_and_comes_back_with_its_digits() {
        let gas = seed_scene(3, 1);
        let mut trial = Trial::new(EVENT, &gas);
        trial.run(4.0);
        let engine = trial.state().placement();
        let mut reference = Precise::<DoubleDouble>::new(&gas);
        let start = reference.present();
        reference.run(4.0);
        assert_eq!(reference.collisions(), trial.events());
        for (precise, position) in reference.present().iter().zip(&engine.positions) {
            let position = each(|axis| DoubleDouble::from(position[axis]));
            assert!(distance(&precise.0, &position) < 1e-8);
        }
        reference.reverse();
        reference.run(8.0);
        for (start, end) in start.iter().zip(reference.present()) {
            assert!(distance(&start.0, &end.0) < 1e-22);
        }
    }
}
