//! From internal units to what a snapshot shows.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::domain::Boundary;
use crate::engine::Counters;
use crate::observe::Observer;
use crate::observe::speeds::Speeds;
use crate::scene::Scene;
use crate::scene::analysis::Brownian;
use crate::snapshot::{self, Counts, NamedBall, Pressure, Sample};
use crate::state::{Placement, State};

/// Balls in a sample for the picture, at the most.
const MOST_SAMPLED: usize = 20_000;

/// What reading every ball tells.
#[derive(Clone, Debug)]
pub struct Survey {
    /// Kinetic energy \[energy\].
    pub kinetic_energy: f64,
    /// `k T` \[energy\]; `None` if no ball can move.
    pub thermal_energy: Option<f64>,
    /// Relative change of energy.
    pub energy_drift: Option<f64>,
    /// Relative momentum not explained by the walls.
    pub momentum_drift: Option<f64>,
    /// Relative error of the virial ledger.
    pub virial_residual: Option<f64>,
    /// Speed histogram.
    pub speeds: Option<Arc<snapshot::Speeds>>,
    /// Mean speed \[speed\].
    pub mean_speed: Option<f64>,
}

impl Survey {
    /// Reads every ball.
    pub fn of(state: &State, observer: &Observer) -> Self {
        let totals = state.totals();
        let drift = observer.ledger.drift(state.now, &totals);
        let velocity = state.units.velocity();
        let speeds = Speeds::at_energy(state, totals.kinetic_energy);
        Self {
            kinetic_energy: totals.kinetic_energy * state.units.energy(),
            thermal_energy: totals
                .thermal_energy()
                .map(|energy| energy * state.units.energy()),
            energy_drift: drift.energy,
            momentum_drift: drift.momentum,
            virial_residual: drift.virial,
            mean_speed: speeds.as_ref().map(|speeds| speeds.mean * velocity),
            speeds: speeds.map(|speeds| {
                Arc::new(snapshot::Speeds {
                    bin_width: speeds.bin_width * velocity,
                    counts: speeds.counts,
                    maxwell: speeds.maxwell,
                    ks: speeds.ks,
                    ks_critical: speeds.ks_critical,
                    component_bin_width: 2.0 * speeds.bin_width * velocity,
                    components: speeds.components,
                    normal: speeds.normal,
                    component_ks: speeds.component_ks,
                })
            }),
        }
    }
}

/// Rates and pressures over the settled part of a run, in the scene's units.
#[derive(Clone, Copy, Debug, Default)]
pub struct Settled {
    /// Pressure by both routes.
    pub pressure: Pressure,
    /// Pair collisions of the gas per time.
    pub pair_rate: Option<f64>,
    /// Wall collisions of the gas per time.
    pub wall_rate: Option<f64>,
}

impl Settled {
    /// Averages at the state's present. `pressures` are those of the run's start: to find them anew takes a look at every ball.
    pub fn of(state: &State, observer: &Observer, pressures: &Pressures) -> Self {
        let Some(averages) = observer.blocks.averages(state.now) else {
            return Self::default();
        };
        let time = averages.duration * state.units.time;
        let settled = averages.settled;
        let per_epoch = |amount: f64| amount / averages.duration;
        let wall_error = averages.wall_error.and_then(|error| pressures.wall(error));
        let virial_error = averages
            .virial_error
            .and_then(|error| pressures.virial_share(error));
        Self {
            pressure: Pressure {
                wall: pressures.wall(per_epoch(settled.wall_impulse)),
                virial: pressures.virial(per_epoch(settled.pair_virial)),
                standard_error: wall_error.or(virial_error),
            },
            pair_rate: Some(settled.pair_collisions as f64 / time),
            wall_rate: (state.domain.boundary == Boundary::Container)
                .then(|| settled.wall_collisions as f64 / time),
        }
    }
}

/// What turns momentum into pressure, as far as the scene has one: both in a container, the virial's alone in a periodic
/// box, neither in open space.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Pressures {
    wall_area: Option<f64>,
    /// Volume open to the centres, and the kinetic part `N k T` of `p V`.
    open: Option<(f64, f64)>,
    scale: f64,
}

impl Pressures {
    /// The pressures that the state's domain has.
    pub fn of(state: &State) -> Self {
        let totals = state.totals();
        let moving = totals.moving as f64;
        let kinetic = totals
            .thermal_energy()
            .map_or(0.0, |energy| moving * energy);
        let edges = match state.domain.boundary {
            Boundary::Container => {
                Some(2.0 * (state.domain.half_size - state.bodies.mean_radius()))
            }
            Boundary::Periodic => Some(state.domain.period()),
            Boundary::Open => None,
        };
        Self {
            wall_area: (state.domain.boundary == Boundary::Container)
                .then(|| state.domain.wall_area()),
            open: edges.map(|edges| (edges.element_product(), kinetic)),
            scale: state.units.pressure(),
        }
    }

    /// Force per physical wall area, in the scene's units, from an internal force on all walls.
    pub fn wall(&self, force: f64) -> Option<f64> {
        self.wall_area.map(|area| force / area * self.scale)
    }

    /// `(N k T + virial rate / 3) / V`, on the volume open to the centres, in the scene's units.
    ///
    /// Source: numerically identical to the wall pressure on the area open to the centres, but for the change of the radial
    /// momentum, which is bounded (derived here).
    pub fn virial(&self, virial_rate: f64) -> Option<f64> {
        self.open
            .map(|(volume, kinetic)| (kinetic + virial_rate / 3.0) / volume * self.scale)
    }

    /// The share of [`Self::virial`] that the collisions make.
    pub fn virial_share(&self, virial_rate: f64) -> Option<f64> {
        self.open
            .map(|(volume, _)| virial_rate / 3.0 / volume * self.scale)
    }
}

/// A named ball: where it started, and what theory expects of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Named {
    /// Its name.
    pub name: String,
    /// Which ball it is.
    pub ball: usize,
    start: DVec3,
    theory: Option<Brownian>,
}

impl Named {
    /// The named balls of a scene.
    pub fn all(scene: &Scene, placement: &Placement) -> Vec<Self> {
        let named = scene.named_balls().into_iter();
        named
            .map(|(name, ball)| Self {
                name,
                ball,
                start: placement.positions[ball],
                theory: Brownian::new(placement, scene.units, ball),
            })
            .collect()
    }

    /// How far it has come by now; theory has nothing to say without a temperature.
    pub fn at(&self, state: &State, temperature: Option<f64>, time: f64) -> NamedBall {
        let position = state.unwrapped_position(self.ball) * state.units.length + state.center;
        let theory = self.theory.zip(temperature);
        NamedBall {
            name: self.name.clone(),
            position: position.to_array(),
            displacement_squared: (position - self.start).length_squared(),
            expected_displacement_squared: theory
                .map(|(theory, temperature)| theory.displacement_squared(temperature, time)),
        }
    }
}

/// The counters as a snapshot has them.
pub fn counts(counters: &Counters) -> Counts {
    Counts {
        pair_collisions: counters.pair_collisions,
        wall_collisions: counters.wall_collisions,
        plane_collisions: counters.plane_collisions,
        cell_crossings: counters.cell_crossings,
        stale_events: counters.stale_events,
        late_events: counters.late_events,
        ties: counters.ties,
        zero_time_events: counters.zero_time_events,
        remembered_events: counters.remembered_events,
        irreversible_starts: counters.irreversible_starts,
        steps: counters.steps,
        audited_steps: counters.audited_steps,
        missed_collisions: counters.missed_collisions,
        double_bounces: counters.double_bounces,
    }
}

/// Which balls a picture is made from: the named ones, then others spread evenly, so that any prefix is a fair sample.
pub fn sampled_balls(ball_count: usize, named: &[(String, usize)]) -> Vec<u32> {
    let named = named.iter().map(|&(_, ball)| ball as u32);
    // Steps of the golden ratio visit every ball once if the step and the count have no common factor.
    let mut step = ((ball_count as f64 * 0.618_033_988_749_895) as usize).max(1);
    while common_divisor(step, ball_count) > 1 {
        step += 1;
    }
    let spread = (0..ball_count).scan(0, move |ball, _| {
        *ball = (*ball + step) % ball_count;
        Some(*ball as u32)
    });
    let is_named: Vec<u32> = named.clone().collect();
    named
        .chain(spread.filter(|ball| !is_named.contains(ball)))
        .take(MOST_SAMPLED)
        .collect()
}

fn common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

/// Share of the wall time that may go into samples for the picture.
const PICTURE_SHARE: f64 = 0.002;

/// Longest rest between two samples, however long one took.
const LONGEST_REST: Duration = Duration::from_secs(1);

/// The samples for the picture, no oftener than their share of the time allows: reading balls all over the memory is slow.
#[derive(Default)]
pub struct Pictures {
    last: Option<(Arc<Sample>, Instant)>,
}

impl Pictures {
    /// The last sample, or a new one if it is due or the run stands still.
    pub fn sample(&mut self, running: bool, take: impl FnOnce() -> Sample) -> Arc<Sample> {
        let began = Instant::now();
        match &self.last {
            Some((sample, due)) if running && began < *due => Arc::clone(sample),
            _ => {
                let sample = Arc::new(take());
                let rest = began.elapsed().div_f64(PICTURE_SHARE);
                let due = Instant::now() + rest.min(LONGEST_REST);
                self.last = Some((Arc::clone(&sample), due));
                sample
            }
        }
    }
}

/// Positions and radii of sampled balls at the present.
pub fn sample(state: &State, balls: &[u32], names: &[String]) -> Sample {
    let position = |&ball: &u32| {
        let position =
            state.trajectories[ball as usize].position_at(state.now) * state.units.length;
        position.to_array().map(|coordinate| coordinate as f32)
    };
    let radius = |&ball: &u32| (state.bodies.of(ball as usize).radius * state.units.length) as f32;
    Sample {
        positions: balls.iter().map(position).collect(),
        radii: balls.iter().map(radius).collect(),
        names: names.to_vec(),
    }
}

/// Largest resident memory of this process so far, where the system tells.
pub fn peak_memory() -> Option<u64> {
    memory("VmHWM:")
}

/// Resident memory of this process, where the system tells.
pub fn resident_memory() -> Option<u64> {
    memory("VmRSS:")
}

fn memory(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    line.trim()
        .strip_suffix("kB")?
        .trim()
        .parse::<u64>()
        .ok()
        .map(|kilobytes| 1024 * kilobytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_takes_named_balls_first_and_no_ball_twice() {
        for count in [1, 2, 10, 512, 704_969] {
            let named = [("pollen".to_owned(), count - 1)];
            let mut balls = sampled_balls(count, &named);
            assert_eq!(balls[0] as usize, count - 1);
            assert_eq!(balls.len(), count.min(MOST_SAMPLED));
            balls.sort_unstable();
            balls.dedup();
            assert_eq!(balls.len(), count.min(MOST_SAMPLED));
        }
        assert!(sampled_balls(0, &[]).is_empty());
    }
}
