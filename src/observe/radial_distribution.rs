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
        let mut coordinates = [0, 1, 2].map(|_| Vec::with_capacity(count));
        for place in &places {
            for (axis, coordinate) in coordinates.iter_mut().zip(place.to_array()) {
                axis.push(coordinate);
            }
        }
        // Without walls every ball's shells lie inside, and a look at all of them sees each pair from both its ends: once is enough.
        let is_inner = |place: &DVec3| match state.domain.boundary {
            Boundary::Periodic => true,
            Boundary::Container | Boundary::Open => (half - place.abs()).min_element() >= reach,
        };
        let at_once = (PAIRS_PER_LOOK / count.max(1)).clamp(1, count);
        let all = at_once == count && state.domain.boundary == Boundary::Periodic;
        let (weight, mut centers) = (if all { 2.0 } else { 1.0 }, 0);
        let (from, per_width, last) = (self.from, 1.0 / self.width, self.bins - 1);
        let sums = self.sums.open();
        for _ in 0..at_once {
            let center = self.next;
            self.next = (self.next + 1) % count;
            if !is_inner(&places[center]) {
                continue;
            }
            centers += 1;
            let begin = if all { center + 1 } else { 0 };
            let others = coordinates.each_ref().map(|axis| &axis[begin..]);
            for_each_near(others, places[center], period, reach, |other, distance| {
                if begin + other != center {
                    let bin = ((distance - from) * per_width).max(0.0) as usize;
                    sums[bin.min(last)] += weight;
                }
            });
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

/// Calls `near` with the index and the distance of each place within `reach` of a center; `period` is zero without images.
///
/// Distances are made many at once and then looked through: few are near.
fn for_each_near(
    places: [&[f64]; 3],
    center: DVec3,
    period: DVec3,
    reach: f64,
    mut near: impl FnMut(usize, f64),
) {
    const AT_ONCE: usize = 64;
    let [xs, ys, zs] = places.map(|axis| axis.chunks(AT_ONCE));
    let mut squares = [0.0; AT_ONCE];
    for (chunk, ((x, y), z)) in xs.zip(ys).zip(zs).enumerate() {
        squares[..x.len()].fill(0.0);
        for (axis, coordinates) in [x, y, z].into_iter().enumerate() {
            let (middle, period) = (center[axis], period[axis]);
            if period > 0.0 {
                for (square, coordinate) in squares.iter_mut().zip(coordinates) {
                    let apart = (coordinate - middle).abs();
                    let image = period - apart;
                    let apart = if image < apart { image } else { apart };
                    *square += apart * apart;
                }
            } else {
                for (square, coordinate) in squares.iter_mut().zip(coordinates) {
                    *square += (coordinate - middle) * (coordinate - middle);
                }
            }
        }
        for (index, square) in squares[..x.len()].iter().enumerate() {
            if *square < reach * reach {
                near(chunk * AT_ONCE + index, square.sqrt());
            }
        }
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
    fn near_places_are_those_of_a_search_one_by_one() {
        let mut word = 1_u64;
        let mut random = || {
            word = word
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (word >> 11) as f64 / (1_u64 << 53) as f64 * 10.0 - 5.0
        };
        let places: Vec<DVec3> = (0..333)
            .map(|_| DVec3::new(random(), random(), random()))
            .collect();
        let axes = [0, 1, 2].map(|axis| places.iter().map(|place| place[axis]).collect::<Vec<_>>());
        for period in [DVec3::ZERO, DVec3::splat(10.0)] {
            for center in &places[..20] {
                let mut found = Vec::new();
                let axes = axes.each_ref().map(Vec::as_slice);
                for_each_near(axes, *center, period, 3.0, |index, distance| {
                    found.push((index, distance));
                });
                let apart = |place: &DVec3| {
                    let apart = (*place - *center).abs();
                    (if period.x > 0.0 {
                        apart.min(period - apart)
                    } else {
                        apart
                    })
                    .length()
                };
                let all = places.iter().map(apart).enumerate();
                let expected: Vec<_> = all.filter(|(_, distance)| *distance < 3.0).collect();
                assert!(expected.len() > 10);
                assert_eq!(found.len(), expected.len());
                for ((index, distance), (other, twin)) in found.iter().zip(&expected) {
                    assert!(index == other && (distance - twin).abs() < 1e-12);
                }
            }
        }
    }

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
