//! Engine `statistical`: direct simulation Monte Carlo, the fast and approximate end of the trade for dilute gases.
//!
//! Balls fly freely for a step; then partners inside small cells collide at random, as often as kinetic theory says that pairs
//! of their relative speed do. Averages come out right (pressure, speeds, rates, diffusion, viscosity, how a gas settles),
//! trajectories do not exist: nothing can be reversed, and balls may overlap.
//!
//! What always holds: collisions happen at the instants `(k + 1/2) step`, and between two of them every ball flies freely, so
//! the gas can be read at any time. What is drawn depends on seed, step and cell alone, and the order of the balls in a cell on
//! nothing but the past, so the same gas comes out bit for bit on any number of threads.
//!
//! What makes it right beyond the textbook's scheme: partners are moved apart by what their diameters transfer, so that the
//! pressure is that of balls and not of points; the rate counts contact value and walls; majorants grow between steps only.
//!
//! Sources: Bird, Molecular Gas Dynamics and the Direct Simulation of Gas Flows (1994); Alexander, Garcia & Alder, Phys. Rev.
//! Lett. 74, 5212 (1995); Garcia & Wagner, Phys. Fluids 12, 2621 (2000), for what the step gets wrong.

mod bins;
mod cells;
mod columns;
mod flight;
mod law;
mod plan;
mod random;
mod round;
mod stock;

use std::ops::Range;

use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};

use crate::engine::step_clock::StepClock;
use crate::engine::{self, Counters, Engine, Report, Stuck, Sums};
use crate::event::Collision;
use crate::state::{State, Time, Trajectory};
use bins::{MOST_BALLS, Record};
pub use plan::{DENSE, Errors, Plan, Refusal};
use round::{Instant, Notes, Rules, Share, Tally};
use stock::Stock;

/// Fewest balls for which a thread is worth starting.
const BALLS_PER_THREAD: usize = 20_000;

/// Steps after which the balls are shared out among the threads anew, if need be.
const STEPS_PER_SHARING: u64 = 16;

/// Fewest balls of a cell, on average: with fewer, the same two meet again too often.
const FEWEST_PER_CELL: f64 = 20.0;

/// Widest cells, in mean free paths.
const WIDEST: f64 = 0.5;

/// How finely the gas is resolved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Resolution {
    /// Length of a step in mean free times.
    pub step: f64,
    /// Width of the cells in mean free paths, as far as there are balls enough.
    pub cell: f64,
}

/// Half a mean free time: diffusion within 1 %, viscosity within 3 %.
pub const QUICK: Resolution = Resolution {
    step: 0.5,
    cell: 1.0 / 3.0,
};

/// A fifth of a mean free time: diffusion within 0.2 %, viscosity within 0.5 %.
pub const USUAL: Resolution = Resolution {
    step: 0.2,
    cell: 1.0 / 6.0,
};

/// A tenth of a mean free time.
pub const CAREFUL: Resolution = Resolution {
    step: 0.1,
    cell: 1.0 / 6.0,
};

/// The statistical engine.
#[derive(Clone, Debug)]
pub struct Statistical {
    /// The gas as of the last time it was settled, but for the present.
    state: State,
    rules: Rules,
    /// Ends of half steps; collisions happen at the odd ones.
    clock: StepClock,
    /// Where the balls are at the next collisions.
    stock: Stock,
    /// In a periodic box: how many boxes each ball will have moved on by the next collisions.
    images: Vec<IVec3>,
    /// For each cell, what no pair's relative speed times section was above so far.
    majorants: Vec<f32>,
    /// What happened in each plane of cells in the last step.
    tallies: Vec<Tally>,
    pending: Pending,
    settled: bool,
    counters: Counters,
}

/// What a statistical engine must be given beside its state to go on: the balls cell by cell, in their order.
///
/// Collisions that were asked for one by one and lie ahead of the present are not kept.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Saved {
    rules: Rules,
    clock: StepClock,
    records: Vec<Record>,
    /// Balls in each cell.
    counts: Vec<u32>,
    images: Vec<IVec3>,
    majorants: Vec<f32>,
    sums: Sums,
    reported: Sums,
    counters: Counters,
}

impl Saved {
    /// Whether it belongs to a gas of so many balls.
    pub fn fits(&self, ball_count: usize) -> bool {
        let cells = self.rules.cells.count();
        let total: u64 = self.counts.iter().map(|&count| u64::from(count)).sum();
        self.records.len() == ball_count
            && total == ball_count as u64
            && self
                .records
                .iter()
                .all(|record| (record.ball as usize) < ball_count)
            && [self.counts.len(), self.majorants.len()] == [cells; 2]
            && [0, ball_count].contains(&self.images.len())
    }
}

/// What the last step did, as far as it has not been reported.
#[derive(Clone, Debug, Default)]
struct Pending {
    /// Its sums, over the flight between its collisions and the next.
    sums: Sums,
    reported: Sums,
    /// Its collisions, in order of time, and how many are reported.
    collisions: Vec<Collision>,
    done: usize,
}

impl Statistical {
    /// Prepares a gas that this engine supports, to be run by so many threads at the most; their number changes no bit.
    ///
    /// # Panics
    /// If [`Plan::new`] refuses the gas, but for its density.
    pub fn new(state: State, resolution: Resolution, seed: u64, threads: usize) -> Self {
        let worth_it = (state.ball_count() / BALLS_PER_THREAD).max(1);
        Self::with_threads(state, resolution, seed, threads.min(worth_it))
    }

    /// Like [`Self::new`], with so many threads even if that does not pay.
    ///
    /// # Panics
    /// If [`Plan::new`] refuses the gas, but for its density.
    pub fn with_threads(state: State, resolution: Resolution, seed: u64, threads: usize) -> Self {
        let (mixture, free, cells) = plan::fit(&state, resolution.cell)
            .expect("the caller has asked whether this engine supports the gas");
        let step = resolution.step * free.time;
        let rules = Rules::new(&state, mixture, cells, (resolution.step, step), seed);
        let threads = threads.clamp(1, cells.dimensions[2]);
        let mut engine = Self {
            clock: StepClock::new(0.5 * step, state.now),
            stock: Stock::new(
                cells.dimensions[2],
                cells.per_plane(),
                threads,
                state.ball_count(),
            ),
            images: state.images.clone(),
            majorants: vec![rules.floor; cells.count()],
            tallies: vec![Tally::default(); cells.dimensions[2]],
            pending: Pending::default(),
            settled: true,
            counters: Counters::default(),
            rules,
            state,
        };
        if engine.clock.number().is_multiple_of(2) {
            engine.clock.tick();
        }
        engine.take_in();
        engine
    }

    /// Goes on from what an engine has saved; its state must have been settled.
    pub fn resume(state: State, saved: Saved, threads: usize) -> Self {
        let worth_it = (state.ball_count() / BALLS_PER_THREAD).max(1);
        let cells = saved.rules.cells;
        let threads = threads.min(worth_it).clamp(1, cells.dimensions[2]);
        let (planes, per_plane) = (cells.dimensions[2], cells.per_plane());
        let mut stock = Stock::new(planes, per_plane, threads, state.ball_count());
        let mut records = saved.records.into_iter();
        for (cell, &count) in saved.counts.iter().enumerate() {
            for record in records.by_ref().take(count as usize) {
                stock.put(cell, record.into());
            }
        }
        Self {
            clock: saved.clock,
            stock,
            images: saved.images,
            majorants: saved.majorants,
            tallies: vec![Tally::default(); cells.dimensions[2]],
            pending: Pending {
                sums: saved.sums,
                reported: saved.reported,
                ..Pending::default()
            },
            settled: true,
            counters: saved.counters,
            rules: saved.rules,
            state,
        }
    }

    /// Puts the balls of the state into bins, flown on to the next collisions.
    fn take_in(&mut self) {
        let now = Instant {
            number: 0,
            time: self.state.now,
            flight: self.clock.next_end().since(self.state.now),
        };
        let record = |(ball, flight): (usize, &Trajectory)| {
            Record::new(ball, flight.position_at(now.time), flight.velocity)
        };
        let flights = self.state.trajectories.iter().enumerate();
        let balls: Vec<Record> = flights.map(record).collect();
        self.stock.clear();
        self.images.clone_from(&self.state.images);
        let (notes, tally) = round::put(
            &self.rules,
            &self.state.bodies,
            &balls,
            now,
            &mut self.stock,
        );
        self.keep(vec![notes]);
        self.count(now.time, &[tally]);
    }

    /// One round of collisions and the flights that follow it.
    fn step(&mut self, each: bool) {
        let now = Instant {
            number: self.clock.number() / 2,
            time: self.clock.next_end(),
            flight: self.rules.step,
        };
        if self.counters.steps.is_multiple_of(STEPS_PER_SHARING) {
            let balls: Vec<u64> = self.tallies.iter().map(|tally| tally.balls).collect();
            self.stock.share_out(&balls);
        }
        let alike = self.state.bodies.uniform().is_some();
        let work = match (each, alike) {
            (false, true) => round::run::<false, true>,
            (false, false) => round::run::<false, false>,
            (true, true) => round::run::<true, true>,
            (true, false) => round::run::<true, false>,
        };
        let planes: Vec<Range<usize>> = self.stock.planes().collect();
        let Stock {
            own, sent, spare, ..
        } = &mut self.stock;
        std::mem::swap(sent, spare);
        let (rules, bodies, old) = (&self.rules, &self.state.bodies, &spare[..]);
        let per_plane = rules.cells.per_plane();
        let (mut tallies, mut majorants) = (&mut self.tallies[..], &mut self.majorants[..]);
        let mut shares: Vec<Share> = Vec::new();
        let bins = own.iter_mut().zip(sent);
        for (number, (planes, (own, sent))) in planes.into_iter().zip(bins).enumerate() {
            own.turn_over();
            sent.clear();
            shares.push(Share {
                number,
                tallies: tallies
                    .split_off_mut(..planes.len())
                    .expect("all planes are shared out"),
                majorants: majorants
                    .split_off_mut(..planes.len() * per_plane)
                    .expect("all planes are shared out"),
                planes,
                own,
                sent,
                notes: Notes::default(),
            });
        }
        std::thread::scope(|scope| {
            let mut shares = shares.iter_mut();
            let first = shares.next();
            shares.for_each(|share| {
                scope.spawn(move || work(rules, bodies, old, now, share));
            });
            if let Some(share) = first {
                work(rules, bodies, old, now, share);
            }
        });
        let done = shares.into_iter().map(|share| share.notes).collect();
        self.keep(done);
        self.clock.tick();
        self.clock.tick();
        self.settled = false;
        self.counters.steps += 1;
        let tallies = std::mem::take(&mut self.tallies);
        self.count(now.time, &tallies);
        self.tallies = tallies;
    }

    /// Keeps what the shares of a step have noted one by one.
    fn keep(&mut self, shares: Vec<Notes>) {
        self.pending.collisions.clear();
        self.pending.done = 0;
        for (faces, collisions) in shares {
            self.pending.collisions.extend(collisions);
            for (ball, face) in faces {
                self.images[ball as usize][face.axis] += if face.upper { 1 } else { -1 };
            }
        }
        let collisions = &mut self.pending.collisions;
        collisions.sort_by(|a, b| a.time.partial_cmp(&b.time).expect("times are numbers"));
    }

    /// Sums up what happened in all planes, in their order.
    fn count(&mut self, begin: Time, tallies: &[Tally]) {
        let mut sums = Sums {
            begin,
            end: self.clock.next_end(),
            ..Sums::default()
        };
        for tally in tallies {
            sums.pair_collisions += tally.pair_collisions;
            sums.wall_collisions += tally.wall_collisions;
            sums.pair_virial += tally.pair_virial;
            sums.wall_impulse += tally.wall_impulse;
        }
        self.counters.pair_collisions += sums.pair_collisions;
        self.counters.wall_collisions += sums.wall_collisions;
        self.pending.sums = sums;
        self.pending.reported = Sums {
            begin,
            end: begin,
            ..Sums::default()
        };
    }

    fn go(&mut self, until: Time, each: bool, report: &mut dyn FnMut(Report)) {
        loop {
            self.pending.report(until, each, report);
            if self.clock.next_end() > until {
                break;
            }
            self.step(each);
        }
        self.settled &= self.state.now == until;
        self.state.now = until;
    }
}

impl Pending {
    /// Reports what has happened up to an instant: of sums, the share of their time that has passed.
    fn report(&mut self, until: Time, each: bool, report: &mut dyn FnMut(Report)) {
        if each {
            let due = self
                .collisions
                .partition_point(|collision| collision.time <= until);
            for collision in &self.collisions[self.done.min(due)..due] {
                report(Report::One(collision));
            }
            self.done = self.done.max(due);
            return;
        }
        let sums = self.sums;
        let end = if until < sums.end { until } else { sums.end };
        if end <= self.reported.end {
            return;
        }
        let so_far = if end < sums.end {
            let share = end.since(sums.begin) / sums.end.since(sums.begin);
            Sums {
                end,
                ..sums.share(share)
            }
        } else {
            sums
        };
        report(Report::Sums(&so_far.since(&self.reported)));
        self.reported = so_far;
    }
}

impl Engine for Statistical {
    fn name(&self) -> &'static str {
        "statistical"
    }

    fn advance(&mut self, until: Time, report: &mut dyn FnMut(&Collision)) -> Result<(), Stuck> {
        self.go(until, true, &mut |what| {
            if let Report::One(collision) = what {
                report(collision)
            }
        });
        Ok(())
    }

    fn advance_in_sums(
        &mut self,
        until: Time,
        report: &mut dyn FnMut(Report),
    ) -> Result<(), Stuck> {
        self.go(until, false, report);
        Ok(())
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn settle(&mut self) {
        if std::mem::replace(&mut self.settled, true) {
            return;
        }
        let Self {
            state,
            rules,
            stock,
            clock,
            images,
            ..
        } = self;
        let ahead = clock.next_end().since(state.now);
        stock.for_each_mut(|record| {
            let ball = record.ball as usize;
            let [position, velocity] =
                [record.position, record.velocity].map(|v| DVec3::from_array(v.map(f64::from)));
            // Backwards in time is forwards with the velocity turned round, and turned round again.
            let (position, velocity, boxes) =
                rules.flown(position, -velocity, ahead, &state.bodies.of(ball));
            if let Some(image) = images.get(ball) {
                state.images[ball] = *image + boxes;
            }
            state.trajectories[ball] = Trajectory {
                position,
                velocity: -velocity,
                begin: state.now,
            };
            state.collisions[ball] += u64::from(std::mem::take(&mut record.collisions));
        });
    }

    fn reverse(&mut self) {
        self.settle();
        self.state.reverse();
        self.take_in();
    }

    fn save(&self) -> engine::Saved {
        let (mut records, mut counts) = (Vec::with_capacity(self.state.ball_count()), Vec::new());
        for cell in 0..self.rules.cells.count() {
            let before = records.len();
            let rows = self.stock.of(cell).flatten();
            records.extend(rows.map(|&row| Record::from(row)));
            counts.push((records.len() - before) as u32);
        }
        engine::Saved::Statistical(Box::new(Saved {
            rules: self.rules.clone(),
            clock: self.clock,
            records,
            counts,
            images: self.images.clone(),
            majorants: self.majorants.clone(),
            sums: self.pending.sums,
            reported: self.pending.reported,
            counters: self.counters,
        }))
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn queue_length(&self) -> usize {
        0
    }
}

/// Width of the cells: what is wished for, but with balls enough, and never above what the method allows.
fn width(state: &State, wish: f64, path: f64) -> f64 {
    let spacing = (state.domain.volume() / state.ball_count() as f64).cbrt();
    (wish * path)
        .max(FEWEST_PER_CELL.cbrt() * spacing)
        .min(WIDEST * path)
}
