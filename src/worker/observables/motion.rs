//! Motion: which balls are followed, their mean square displacement, their forgotten velocity, their diffusion.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::{Known, Plan, column, figure};
use crate::domain::{Boundary, Domain};
use crate::observe::block_sums::Estimate;
use crate::observe::motion::Motion;
use crate::scene::Scene;
use crate::scene::analysis::Brownian;
use crate::snapshot::{Column, Figure};
use crate::state::{Placement, State};

/// Most balls of the species whose motion is followed, named ones apart.
const MOST_TRACKED: usize = 1024;

/// Mean free times between which diffusion is read off, first of all and at the last.
///
/// A ball forgets its own velocity in a few of them, but what it has set in motion around it pushes it on for long: at
/// intermediate densities diffusion still rises by several percent after ten of them (Alder & Wainwright, Phys. Rev. A 1, 18,
/// 1970), and near freezing it still falls, as cages open late. Boxes of 500 balls have their value after a hundred.
const DIFFUSIVE: [[f64; 2]; 2] = [[10.0, 20.0], [100.0, 200.0]];

/// Share of a diffusion coefficient that walls may take; where they take more there is none.
const MOST_HELD_BACK: f64 = 0.01;

/// By what share walls lower the slope of a mean square displacement when it has come to `square`, if that is little.
///
/// Between reflecting walls `L` apart the slope along their axis is `2 D (1 - 4 sqrt(D t / pi) / L)` at first, derived here from
/// the diffusion equation. With planes the walls are taken to be as far apart as those of the box.
fn held_back(domain: &Domain, square: f64) -> f64 {
    if domain.boundary != Boundary::Container && domain.planes.is_empty() {
        return 0.0;
    }
    let way = (square / 6.0).sqrt();
    let per_length = (0.5 / domain.half_size).element_sum() / 3.0;
    4.0 / PI.sqrt() * way * per_length
}

/// Lags that a run has room for, at least: each then fits into a block, and blocks know little of one another.
const LAGS_PER_RUN: f64 = 32.0;

/// Mean free times between which diffusion is read off, after a run of so many.
fn diffusive(elapsed: f64) -> [f64; 2] {
    let [first, last] = DIFFUSIVE;
    let to = (elapsed / LAGS_PER_RUN).clamp(first[1], last[1]);
    [to * first[0] / first[1], to]
}

/// Balls whose motion is averaged together.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Group {
    name: String,
    brownian: Option<Brownian>,
}

/// Species and named balls, and the balls whose motion stands for them.
pub(super) fn groups(scene: &Scene, placement: &Placement) -> (Vec<Group>, Vec<(u32, u16)>) {
    let (mut groups, mut tracked) = (Vec::new(), Vec::new());
    let moving = |ball: usize| {
        let body = placement.body_of.get(ball).map_or(0, |&body| body as usize);
        placement.bodies[body].mass.is_finite()
    };
    let mut first = 0;
    let share = MOST_TRACKED / scene.species.len().clamp(1, MOST_TRACKED);
    for (index, species) in scene.species.iter().enumerate() {
        let balls = first..first + species.count;
        first += species.count;
        if species.count == 0 || !moving(balls.start) {
            continue;
        }
        let taken = species.count.min(share);
        let evenly = (0..taken).map(|ball| balls.start + ball * species.count / taken);
        tracked.extend(evenly.map(|ball| (ball as u32, groups.len() as u16)));
        let name = species
            .name
            .clone()
            .unwrap_or_else(|| format!("species_{}", index + 1));
        groups.push(Group {
            name,
            brownian: None,
        });
    }
    let named = scene.named_balls();
    let others = (first..placement.positions.len())
        .filter(|&ball| moving(ball) && named.iter().all(|(_, named)| *named != ball));
    let others: Vec<usize> = others.take(MOST_TRACKED).collect();
    if !others.is_empty() {
        tracked.extend(
            others
                .iter()
                .map(|&ball| (ball as u32, groups.len() as u16)),
        );
        groups.push(Group {
            name: "balls".to_owned(),
            brownian: None,
        });
    }
    for (name, ball) in named.into_iter().filter(|(_, ball)| moving(*ball)) {
        tracked.push((ball as u32, groups.len() as u16));
        groups.push(Group {
            name,
            brownian: Brownian::new(placement, scene.units, ball),
        });
    }
    (groups, tracked)
}

impl Plan {
    pub(super) fn motion_result(
        &self,
        motion: &Motion,
        state: &State,
        known: Known,
    ) -> (Vec<Figure>, Vec<Column>) {
        let (length, every) = (state.units.length, self.every);
        let area = length * length;
        let squared_speed = state.units.velocity() * state.units.velocity();
        let lags = motion.displacement.lags();
        let plateau = known.collision_rate.and_then(|rate| {
            let window = diffusive(motion.displacement.records() * every * rate);
            self.lags_at(&motion.displacement, window, 1.0 / rate)
        });
        let mut figures = Vec::new();
        let mut columns = vec![column(
            "time",
            lags.iter().map(|(_, lag)| Some(lag * every)),
        )];
        for (index, group) in self.groups.iter().enumerate() {
            let name = &group.name;
            let heavy = group.brownian.zip(known.temperature);
            if heavy.is_none()
                && let Some(plateau) = plateau
            {
                let expected = self
                    .enskog
                    .zip(known.temperature)
                    .map(|(enskog, temperature)| enskog.diffusion(temperature));
                let unit = || self.unit("m²/s");
                let square = motion.displacement.means(index, [plateau[1]].into_iter())[0].value;
                let held_back = square.map(|square| held_back(&state.domain, square));
                let unless_held_back = |found: Estimate| match held_back {
                    Some(share) if share <= MOST_HELD_BACK => found,
                    _ => Estimate::default(),
                };
                let slope = motion
                    .displacement
                    .slope(index, plateau)
                    .times(area / every / 6.0);
                figures.push(figure(
                    &format!("diffusion_coefficient.{name}"),
                    unless_held_back(slope),
                    expected,
                    unit(),
                ));
                let integral = motion
                    .velocity
                    .integral(index, plateau[1])
                    .times(squared_speed * every / 3.0);
                figures.push(figure(
                    &format!("diffusion_coefficient_from_velocity.{name}"),
                    unless_held_back(integral),
                    expected,
                    unit(),
                ));
            }
            if let Some((brownian, temperature)) = heavy {
                let tau = brownian.relaxation_time(temperature);
                let expected = Some(self.units.boltzmann() * temperature * tau / brownian.mass());
                let far = self.lags_at(&motion.displacement, [3.0, 6.0], tau);
                let slope = far.map_or_else(Estimate::default, |lags| {
                    motion
                        .displacement
                        .slope(index, lags)
                        .times(area / every / 6.0)
                });
                figures.push(figure(
                    &format!("diffusion_coefficient.{name}"),
                    slope,
                    expected,
                    self.unit("m²/s"),
                ));
            }
            let indices = || lags.iter().map(|(lag, _)| *lag);
            let squares = motion.displacement.means(index, indices()).into_iter();
            let squares: Vec<Estimate> = squares.map(|square| square.times(area)).collect();
            columns.push(column(
                &format!("mean_square_displacement.{name}"),
                squares.iter().map(|square| square.value),
            ));
            columns.push(column(
                &format!("standard_error.{name}"),
                squares.iter().map(|square| square.error),
            ));
            if let Some((brownian, temperature)) = heavy {
                let expected = lags.iter().map(|(_, lag)| {
                    Some(brownian.mean_square_displacement(temperature, lag * every))
                });
                columns.push(column(&format!("expected.{name}"), expected));
            }
            let products = motion.velocity.means(index, indices()).into_iter();
            let products = products.map(|product| product.times(squared_speed).value);
            columns.push(column(
                &format!("velocity_autocorrelation.{name}"),
                products,
            ));
        }
        (figures, columns)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn walls_take_the_share_that_the_diffusion_equation_says() {
        let size = DVec3::new(1.0, 2.0, 4.0);
        let container = Domain::container(0.5 * size);
        // Mean square displacement along an axis of length 1 after D t, as a sum over the modes between the walls.
        let square = |time: f64| {
            let modes = (0..2000).map(|mode| PI * f64::from(2 * mode + 1));
            let left = modes.map(|k| (-k * k * time).exp() / k.powi(4));
            1.0 / 6.0 - 16.0 * left.sum::<f64>()
        };
        let (time, step) = (1e-4, 1e-7);
        let slopes = size.to_array().map(|length| {
            let scaled = |time: f64| length * length * square(time / (length * length));
            (scaled(time + step) - scaled(time - step)) / (4.0 * step)
        });
        let lost = 1.0 - slopes.iter().sum::<f64>() / 3.0;
        let expected = held_back(&container, 6.0 * time);
        assert!(
            (lost / expected - 1.0).abs() < 0.01,
            "{lost} and {expected}"
        );
        let periodic = Domain {
            boundary: Boundary::Periodic,
            ..container
        };
        assert_eq!(held_back(&periodic, 6.0 * time), 0.0);
    }

    #[test]
    fn diffusion_is_read_off_later_in_a_longer_run() {
        assert_eq!(diffusive(30.0), [10.0, 20.0]);
        assert_eq!(diffusive(LAGS_PER_RUN * 30.0), [15.0, 30.0]);
        assert_eq!(diffusive(1e9), [100.0, 200.0]);
    }
}
