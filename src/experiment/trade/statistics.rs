//! What a setting gets wrong on average, and how fast it was: one run says both.
//!
//! A run goes in slices, and the clock is read between them. Slices make blocks, and blocks the noise of every average; where
//! there are few blocks, what chance alone would give is taken if it is more.
//!
//! Sources: derived here. Hits on walls and collisions are taken as independent: `sqrt(4 / (pi n))` for the pressure on walls,
//! `1 / sqrt(n)` for counts, `1.13 / sqrt(n)` for the virial's part; a displacement squared is that of a normal deviate in
//! three dimensions, `sqrt(2 / (3 n))`.

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::domain::Boundary;
use crate::engine::{Counters, Report};
use crate::event::Participants;
use crate::experiment::progress::Progress;
use crate::experiment::trial::{Trial, processor_seconds};
use crate::observe::speeds::Speeds;
use crate::state::{Placement, State};
use crate::worker::engines::Choice;

/// Most blocks.
const BLOCKS: usize = 16;

/// Fewer blocks than this do not know their own spread.
const FEW: usize = 8;

/// The first slice, in windows: short enough for the slowest setting.
const FIRST_SLICE: f64 = 1.0 / (1 << 20) as f64;

/// Slices in a budget, about.
const SLICES: f64 = 64.0;

/// Wall time after which a run ends whatever the processor has done, in budgets.
const PATIENCE: f64 = 4.0;

/// A mean and its standard error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The mean.
    pub value: f64,
    /// One standard error.
    pub noise: f64,
}

impl Estimate {
    /// How far it is from another, as a share of the other.
    pub fn against(self, other: Self) -> Difference {
        Difference {
            error: self.value / other.value - 1.0,
            noise: (self.noise / other.value).hypot(other.noise / other.value),
        }
    }
}

/// A relative error and its own standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The error.
    pub error: f64,
    /// One standard error.
    pub noise: f64,
}

impl Difference {
    /// The error, or nothing if chance alone may have made it.
    pub fn seen(self) -> f64 {
        if self.error.abs() > 2.0 * self.noise {
            self.error.abs()
        } else {
            0.0
        }
    }

    /// What the error is below, but for one run in twenty.
    pub fn bound(self) -> f64 {
        self.error.abs() + 2.0 * self.noise
    }
}

/// What a run has shown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Processor time; wall time on several threads \[s\].
    pub seconds: f64,
    /// Simulated time, in the scene's units.
    pub time: f64,
    /// Force per area of the container's walls.
    pub wall_pressure: Option<Estimate>,
    /// `p V / N k T` from the virial of the pair collisions.
    pub compressibility: Option<Estimate>,
    /// Pair collisions per time.
    pub pair_rate: Option<Estimate>,
    /// Mean square displacement in a window.
    pub displacement: Option<Estimate>,
    /// Collisions that steps have missed, of all.
    pub missed: Option<f64>,
    /// Collisions of pairs that had not parted since their last, of all.
    pub double: Option<f64>,
    /// Largest overlap at a collision, in contact distances.
    pub overlap: Option<f64>,
    /// Relative change of the energy.
    pub energy: Option<f64>,
    /// What the virial ledger misses.
    pub ledger: Option<f64>,
    /// Distance of the speeds from Maxwell's over the critical one.
    pub speeds: Option<f64>,
}

impl Measured {
    /// Simulated time per second.
    pub fn speed(&self) -> f64 {
        self.time / self.seconds.max(1e-9)
    }
}

/// What happened in a stretch of time.
#[derive(Clone, Copy, Default)]
struct Slice {
    time: f64,
    impulse: f64,
    virial: f64,
    pairs: f64,
    walls: f64,
}

impl Slice {
    /// What has been reported since the run began; an engine that goes in steps reports each bit by bit.
    fn of(trial: &Trial, counts: [u64; 2]) -> Self {
        Self {
            time: trial.time(),
            impulse: trial.observer.ledger.wall_impulse(),
            virial: trial.observer.ledger.pair_virial(),
            pairs: counts[0] as f64,
            walls: counts[1] as f64,
        }
    }

    fn combined(self, other: Self, sign: f64) -> Self {
        Self {
            time: self.time + sign * other.time,
            impulse: self.impulse + sign * other.impulse,
            virial: self.virial + sign * other.virial,
            pairs: self.pairs + sign * other.pairs,
            walls: self.walls + sign * other.walls,
        }
    }
}

/// How long a run may take, and how it is looked at.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Seconds.
    pub budget: f64,
    /// Mean free time, in the scene's units.
    pub free_time: f64,
    /// Mean free times over which displacements are measured.
    pub window: f64,
}

/// Runs a gas until the budget is spent; reads the processor's clock, or the wall's where there are several threads.
pub fn measure(
    choice: Choice,
    gas: &Placement,
    limits: Limits,
    words: &str,
    progress: &mut Progress,
) -> Measured {
    let alone = threads(choice) == 1;
    let began = Instant::now();
    let clock = || {
        if alone {
            processor_seconds()
        } else {
            began.elapsed().as_secs_f64()
        }
    };
    let mut trial = Trial::new(choice, gas);
    if let Choice::Statistical { resolution, .. } = choice {
        // It begins with half a flight without collisions.
        trial.run(resolution.step * limits.free_time);
    }
    let begin = trial.time();
    let mut displacements = Displacements::new(trial.state());
    let (mut slices, mut squares) = (Vec::new(), Vec::new());
    let (mut seconds, mut counts) = (0.0, [0_u64; 2]);
    let window = limits.window * limits.free_time;
    let mut length = window * FIRST_SLICE;
    let mut next_window = begin + window;
    let running = Instant::now();
    let patience = Duration::from_secs_f64(PATIENCE * limits.budget);
    while seconds < limits.budget && running.elapsed() < patience && !progress.stopped() {
        let before = Slice::of(&trial, counts);
        let until = trial
            .state()
            .units
            .instant((before.time + length).min(next_window));
        let start = clock();
        let Trial { engine, observer } = &mut trial;
        if engine
            .advance_in_sums(until, &mut |report| {
                observer.take(report);
                count(report, &mut counts);
            })
            .is_err()
        {
            break; // no room: what has been measured stands
        }
        let spent = clock() - start;
        seconds += spent;
        progress.tell(spent, words);
        slices.push(Slice::of(&trial, counts).combined(before, -1.0));
        if trial.time() >= next_window - 1e-9 * window {
            trial.engine.settle();
            squares.push(displacements.next(trial.state()));
            next_window += window;
        } else if spent < limits.budget / SLICES && length < window {
            length *= 2.0;
        }
    }
    trial.engine.settle();
    summary(&trial, &slices, &squares, seconds)
}

/// Counts collisions with balls and with walls.
fn count(report: Report, [pairs, walls]: &mut [u64; 2]) {
    match report {
        Report::One(collision) => match collision.participants {
            Participants::Pair(..) => *pairs += 1,
            Participants::Wall(..) => *walls += 1,
            Participants::Plane(..) | Participants::Face(..) => {}
        },
        Report::Sums(sums) => {
            *pairs += sums.pair_collisions;
            *walls += sums.wall_collisions;
        }
    }
}

/// Threads of a choice.
pub fn threads(choice: Choice) -> usize {
    match choice {
        Choice::Windowed(threads) | Choice::Statistical { threads, .. } => threads,
        _ => 1,
    }
}

fn summary(trial: &Trial, slices: &[Slice], squares: &[f64], seconds: f64) -> Measured {
    let state = trial.state();
    let units = state.units;
    let total = slices
        .iter()
        .fold(Slice::default(), |sum, &slice| sum.combined(slice, 1.0));
    let blocks = blocks(slices, total.time);
    let rate = |what: fn(&Slice) -> f64, chance: f64| {
        (what(&total) != 0.0 && total.time > 0.0).then(|| estimate(&blocks, total, what, chance))
    };
    let steady = state.domain.boundary != Boundary::Open;
    let energy = state.ball_count() as f64 * state.totals().thermal_energy().unwrap_or(f64::NAN);
    let scale = |estimate: Estimate, factor: f64| Estimate {
        value: factor * estimate.value,
        noise: factor * estimate.noise,
    };
    // Rates are per scene time, impulses and virials in internal units.
    let wall = rate(|slice| slice.impulse, (4.0 / (PI * total.walls)).sqrt());
    let virial = rate(|slice| slice.virial, 1.13 / total.pairs.sqrt());
    let drift = trial.drift();
    let counters = trial.engine.counters();
    let of_all = |count: fn(&Counters) -> u64| {
        (counters.steps > 0 && counters.pair_collisions > 0 && counters.audited_steps > 0)
            .then(|| count(&counters) as f64 / counters.pair_collisions as f64)
    };
    let speeds = Speeds::of(state);
    Measured {
        seconds,
        time: total.time,
        wall_pressure: wall
            .filter(|_| state.domain.boundary == Boundary::Container)
            .map(|wall| {
                let momentum = units.mass * units.velocity();
                let area = state.domain.wall_area() * units.length * units.length;
                scale(wall, momentum / area)
            }),
        compressibility: virial.filter(|_| steady && energy > 0.0).map(|virial| {
            let part = scale(virial, units.time / (3.0 * energy));
            Estimate {
                value: 1.0 + part.value,
                ..part
            }
        }),
        pair_rate: rate(|slice| slice.pairs, 1.0 / total.pairs.sqrt()).filter(|_| steady),
        displacement: displacement(squares, state.ball_count()),
        missed: of_all(|counters| counters.missed_collisions),
        double: of_all(|counters| counters.double_bounces),
        overlap: trial.observer.max_overlap,
        energy: drift.energy.map(f64::abs),
        ledger: drift.virial,
        speeds: speeds.map(|speeds| speeds.ks / speeds.ks_critical),
    }
}

/// Slices put together to blocks of about the same length.
fn blocks(slices: &[Slice], total: f64) -> Vec<Slice> {
    let mut blocks: Vec<Slice> = Vec::new();
    let mut block = Slice::default();
    for slice in slices {
        block = block.combined(*slice, 1.0);
        if block.time >= total / BLOCKS as f64 {
            blocks.push(block);
            block = Slice::default();
        }
    }
    blocks
}

/// A rate, with the spread of the blocks for its noise; `chance` is the relative noise that chance alone would give.
fn estimate(blocks: &[Slice], total: Slice, what: fn(&Slice) -> f64, chance: f64) -> Estimate {
    let value = what(&total) / total.time;
    let chance = chance * value.abs();
    let count = blocks.len() as f64;
    let squares = blocks
        .iter()
        .map(|block| (what(block) / block.time - value).powi(2));
    let spread = (squares.sum::<f64>() / (count * (count - 1.0)).max(1.0)).sqrt();
    Estimate {
        value,
        noise: if blocks.len() < FEW {
            spread.max(chance)
        } else {
            spread
        },
    }
}

/// Mean square displacement over all windows.
fn displacement(squares: &[f64], balls: usize) -> Option<Estimate> {
    let count = squares.len() as f64;
    let value = squares.iter().sum::<f64>() / count;
    let deviations = squares.iter().map(|square| (square - value).powi(2));
    let spread = (deviations.sum::<f64>() / (count * (count - 1.0)).max(1.0)).sqrt();
    let chance = value * (2.0 / (3.0 * count * balls as f64)).sqrt();
    let noise = if squares.len() < FEW {
        spread.max(chance)
    } else {
        spread
    };
    (value > 0.0).then_some(Estimate { value, noise })
}

/// Where the balls were at the beginning of a window, without the drift of the whole gas.
struct Displacements {
    from: Vec<DVec3>,
    drift: DVec3,
    begin: crate::state::Time,
}

impl Displacements {
    fn new(state: &State) -> Self {
        Self {
            from: (0..state.ball_count())
                .map(|ball| state.unwrapped_position(ball))
                .collect(),
            drift: state.totals().drift(),
            begin: state.now,
        }
    }

    /// Mean square displacement of this window; begins the next one.
    fn next(&mut self, state: &State) -> f64 {
        let drifted = self.drift * state.now.since(self.begin);
        let next = Self::new(state);
        let squares = self
            .from
            .iter()
            .zip(&next.from)
            .map(|(from, to)| (*to - *from - drifted).length_squared());
        let mean = squares.sum::<f64>() / self.from.len().max(1) as f64;
        *self = next;
        mean
    }
}
