//! The radial distribution function: how many neighbours a ball has at each distance, over how many an ideal gas would have.
//!
//! Pairs are counted from the surface outwards, so that a bin's edge lies at contact. In a container the centres of the count
//! are balls far enough from the walls that every shell lies inside.
//!
//! Source: Allen & Tildesley, Computer Simulation of Liquids, on pair distribution functions.

use serde::{Deserialize, Serialize};

use std::f64::consts::PI;

use glam::DVec3;

use crate::domain::Boundary;
use crate::observe::block_sums::{BlockSums, Estimate};
use crate::state::State;

/// Pairs looked at in one look, about: a large gas is counted from some of its balls, others at every look.
const PAIRS_PER_LOOK: usize = 1_000_000;

/// Part of the diameter beyond contact over which the contact value is extrapolated.
const CONTACT_RANGE: f64 = 0.12;

/// Neighbours at each distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RadialDistribution {
    from: f64,
    width: f64,
    bins: usize,
    /// Where the next look begins among the balls.
    next: usize,
    /// Neighbours per bin, then centres times density.
    sums: BlockSums,
}

impl RadialDistribution {
    /// Counts from distance `from` on, bins of this width \[length\].
    pub fn new(from: f64, width: f64, bins: usize) -> Self {
        Self {
            from,
            width,
            bins,
            next: 0,
            sums: BlockSums::new(bins + 1),
        }
    }

    /// Farthest distance that is counted \[length\].
    fn reach(&self) -> f64 {
        self.from + self.bins as f64 * self.width
    }

    /// Counts the neighbours at the state's present.
    pub fn look(&mut self, state: &State) {
        let count = state.ball_count();
        let (reach, half) = (self.reach(), state.domain.half_size);
        let period = state.domain.period();
        let places: Vec<DVec3> = (state.trajectories.iter())
            .map(|flight| flight.position_at(state.now))
            .collect();
        let is_inner = |place: &DVec3| match state.domain.boundary {
            Boundary::Periodic => true,
            Boundary::Container | Boundary::Open => (half - place.abs()).min_element() >= reach,
        };
        let mut centers = 0;
        let (from, per_width) = (self.from, 1.0 / self.width);
        let sums = self.sums.open();
        for _ in 0..(PAIRS_PER_LOOK / count.max(1)).clamp(1, count) {
            let center = self.next;
            self.next = (self.next + 1) % count;
            if !is_inner(&places[center]) {
                continue;
            }
            centers += 1;
            for (other, place) in places.iter().enumerate() {
                let mut apart = (*place - places[center]).abs();
                if period.x > 0.0 {
                    apart = apart.min(period - apart);
                }
                let squared = apart.length_squared();
                if squared < reach * reach && other != center {
                    let bin = ((squared.sqrt() - from) * per_width).max(0.0) as usize;
                    sums[bin.min(self.bins - 1)] += 1.0;
                }
            }
        }
        let density = (count as f64 - 1.0) / state.domain.volume();
        sums[self.bins] += f64::from(centers) * density;
        self.sums.close_record();
    }

    /// Middle of each bin \[length\] and the function there.
    pub fn bins(&self) -> Vec<(f64, Estimate)> {
        let summed = self.sums.summed();
        let value = |bin: usize| {
            let (inner, shell) = self.shell(bin);
            let value = summed.estimate(|sums| {
                (sums[self.bins] > 0.0).then(|| sums[bin] / (sums[self.bins] * shell))
            });
            (inner + 0.5 * self.width, value)
        };
        (0..self.bins).map(value).collect()
    }

    /// Inner radius and volume of a bin's shell.
    fn shell(&self, bin: usize) -> (f64, f64) {
        let inner = self.from + bin as f64 * self.width;
        let outer = inner + self.width;
        (inner, 4.0 / 3.0 * PI * (outer.powi(3) - inner.powi(3)))
    }

    /// The value at contact: a parabola through the logarithms of the first bins, carried on to distance `from`.
    pub fn contact(&self) -> Estimate {
        let bins = ((CONTACT_RANGE * self.from / self.width) as usize).clamp(4, self.bins.max(4));
        self.sums.estimate(|sums| {
            let points: Vec<[f64; 3]> = (0..bins.min(self.bins))
                .filter(|&bin| sums[bin] > 0.0 && sums[self.bins] > 0.0)
                .map(|bin| {
                    let value = sums[bin] / (sums[self.bins] * self.shell(bin).1);
                    [(bin as f64 + 0.5) / bins as f64, value.ln(), sums[bin]]
                })
                .collect();
            parabola_at_zero(&points).map(f64::exp)
        })
    }
}

/// Value at 0 of the parabola that fits points `[x, y, weight]` best; `None` for fewer than four.
fn parabola_at_zero(points: &[[f64; 3]]) -> Option<f64> {
    if points.len() < 4 {
        return None;
    }
    let sum = |x_power: i32, y_power: i32| -> f64 {
        (points.iter())
            .map(|[x, y, weight]| weight * x.powi(x_power) * y.powi(y_power))
            .sum()
    };
    let moments = [0, 1, 2, 3, 4].map(|power| sum(power, 0));
    let [m0, m1, m2, m3, m4] = moments;
    let determinant = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| {
        DVec3::from_array(a).dot(DVec3::from_array(b).cross(DVec3::from_array(c)))
    };
    let right = [0, 1, 2].map(|power| sum(power, 1));
    let (second, third) = ([m1, m2, m3], [m2, m3, m4]);
    let all = determinant([m0, m1, m2], second, third);
    (all != 0.0).then(|| determinant(right, second, third) / all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_found_again() {
        let points: Vec<_> = (1..9)
            .map(f64::from)
            .map(|x| [x, 3.0 - 2.0 * x + 0.5 * x * x, x])
            .collect();
        assert!((parabola_at_zero(&points).expect("points") - 3.0).abs() < 1e-9);
        assert_eq!(parabola_at_zero(&points[..3]), None);
    }
}
