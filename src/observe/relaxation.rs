//! How a gas becomes Maxwellian: Boltzmann's H and the fourth moment of the velocities against time.
//!
//! `H = sum over bins of p ln(p / v)`, with `p` the share of the balls whose speed lies in the bin and `v` the bin's volume in
//! velocity space, speeds in units of `sqrt(kT / m)`: Boltzmann's integral of `f ln f`, as fine as the bins. Maxwell's
//! distribution has the least H of all with its energy. The fourth moment `<v^4> / <v^2>^2` is 1 for equal speeds and 5/3 for
//! Maxwell's.
//!
//! Source: Boltzmann, Wiener Berichte 66, 275 (1872); the excess `(bins - 1) / 2 N` of a sample of N balls: Miller (1955).

use serde::{Deserialize, Serialize};

use std::f64::consts::PI;

use crate::observe::speeds::Speeds;
use crate::state::{State, Time};

/// Most points kept; when there would be more, every other one is dropped.
const MOST_POINTS: usize = 512;

/// The gas at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// When.
    pub time: Time,
    /// Collisions of a ball until then, with balls, walls and planes, on average.
    pub collisions: f64,
    /// Boltzmann's H, per ball.
    pub h: f64,
    /// H of Maxwell's distribution in the same bins, with the excess that a sample of so many balls has.
    pub maxwell: f64,
    /// Fourth moment over the square of the second.
    pub fourth_moment: f64,
}

/// The course of the relaxation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Relaxation {
    points: Vec<Point>,
    looks: u64,
    looks_per_point: u64,
}

impl Default for Relaxation {
    fn default() -> Self {
        Self {
            points: Vec::new(),
            looks: 0,
            looks_per_point: 1,
        }
    }
}

impl Relaxation {
    /// Measures the gas at its present.
    pub fn look(&mut self, state: &State) {
        self.looks += 1;
        if !(self.looks - 1).is_multiple_of(self.looks_per_point) {
            return;
        }
        let Some(point) = point(state) else { return };
        self.points.push(point);
        if self.points.len() == MOST_POINTS {
            let mut index = 0;
            self.points.retain(|_| (index % 2 == 0, index += 1).0);
            self.looks_per_point *= 2;
        }
    }

    /// The points so far, oldest first.
    pub fn points(&self) -> &[Point] {
        &self.points
    }
}

fn point(state: &State) -> Option<Point> {
    let (mut second, mut fourth) = (0.0, 0.0);
    for (ball, flight) in state.trajectories.iter().enumerate() {
        let squared = flight.velocity.length_squared() * state.bodies.of(ball).mass;
        if squared.is_finite() {
            second += squared;
            fourth += squared * squared;
        }
    }
    let speeds = Speeds::at_energy(state, 0.5 * second)?;
    let count = state.ball_count() as f64;
    let mass = state.bodies.of(0).mass;
    let deviation = (second / (3.0 * count * mass)).sqrt();
    let width = speeds.bin_width / deviation;
    let entropy = |share: f64, bin: usize| {
        let (inner, outer) = (bin as f64 * width, (bin as f64 + 1.0) * width);
        let volume = 4.0 / 3.0 * PI * (outer.powi(3) - inner.powi(3));
        if share > 0.0 {
            share * libm::log(share / volume)
        } else {
            0.0
        }
    };
    let counts = speeds.counts.iter().map(|&balls| balls as f64 / count);
    let expected = speeds.maxwell.iter().map(|balls| balls / count);
    let occupied = speeds.maxwell.iter().filter(|balls| **balls >= 1.0).count() as f64;
    let collisions: u64 = state.collisions.iter().sum();
    Some(Point {
        time: state.now,
        collisions: collisions as f64 / count,
        h: counts
            .enumerate()
            .map(|(bin, share)| entropy(share, bin))
            .sum(),
        maxwell: expected
            .enumerate()
            .map(|(bin, share)| entropy(share, bin))
            .sum::<f64>()
            + (occupied - 1.0).max(0.0) / (2.0 * count),
        fourth_moment: count * fourth / (second * second),
    })
}
