//! The loop on the engine's thread.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use super::echo::{EchoWatch, horizon};
use super::measure::{self, Named, Pressures, Settled, Survey};
use super::observables::{Known, Plan};
use super::pace::{Meter, Slices};
use super::{Options, Slot};
use crate::engine::{Engine, Stuck};
use crate::feed::Command;
use crate::history::{History, Observable, Stretch};
use crate::observe::Observer;
use crate::observe::on_demand::OnDemand;
use crate::scene::Scene;
use crate::scene::analysis::Theory;
use crate::snapshot::{
    Expected, NamedBall, Observed, Phase, Sample, SceneCard, SeriesRow, Snapshot,
};
use crate::state::{Placement, State};

/// Wall time between two snapshots.
const SNAPSHOT_EVERY: Duration = Duration::from_millis(100);

/// Wall time of the run between two stretches of the history \[s\].
const HISTORY_EVERY_S: f64 = 0.5;

/// Share of the wall time that may go into reading every ball.
const SURVEY_SHARE: f64 = 0.003;

/// Share of the wall time that may go into settling the engine for a picture.
const CLOSER_LOOK_SHARE: f64 = 0.05;

/// Wall time between two surveys, at least.
const SURVEY_EVERY: Duration = Duration::from_secs(1);

/// First slice, in epochs: short, whatever the scene.
const FIRST_SLICE: f64 = 1.0 / 4096.0;

/// Longest that one slice may run on where the rate of simulated time is limited \[wall s\].
const LIMITED_SLICE_S: f64 = 0.02;

/// What is fixed when a run starts.
pub struct Setting {
    card: Arc<SceneCard>,
    theory: Theory,
    names: Vec<String>,
    named: Vec<Named>,
    sampled: Vec<u32>,
    plan: Option<Plan>,
    options: Options,
}

impl Setting {
    /// Takes from the scene what the run needs beside the balls.
    pub fn new(scene: &Scene, placement: &Placement, options: Options) -> Self {
        let named = scene.named_balls();
        Self {
            card: Arc::new(scene.card(placement)),
            theory: Theory::new(placement, scene.units),
            sampled: measure::sampled_balls(placement.positions.len(), &named),
            named: Named::all(scene, placement),
            plan: Plan::new(scene, placement),
            names: named.into_iter().map(|(name, _)| name).collect(),
            options,
        }
    }

    /// The snapshot of a run that has not begun.
    pub fn first_snapshot(&self) -> Snapshot {
        Snapshot::starting(
            Arc::clone(&self.card),
            self.options.engine.name(),
            self.options.until,
        )
    }
}

/// Totals at the end of an interval, from which the next one's means are made.
#[derive(Clone, Copy, Default)]
struct Totals {
    time: f64,
    wall_impulse: f64,
    pair_virial: f64,
    pair_collisions: u64,
    wall_collisions: u64,
}

struct Run<'a> {
    setting: &'a Setting,
    inbox: &'a Receiver<Command>,
    slot: &'a Slot,
    engine: Box<dyn Engine>,
    observer: Observer,
    on_demand: Option<OnDemand>,
    observables: Arc<Vec<Observed>>,
    observables_due: Instant,
    pressures: Pressures,
    echo: EchoWatch,
    survey: Survey,
    survey_due: Instant,
    meter: Meter,
    slices: Slices,
    /// The named balls and the sample for the picture, as of the last closer look.
    named: Vec<NamedBall>,
    sample: Option<Arc<Sample>>,
    closer_look_due: Instant,
    history: Arc<History>,
    history_due: f64,
    /// Where the last stretch of the history ended, and the wall time then.
    last_point: (Totals, f64),
    last_row: Totals,
    rows: u64,
    phase: Phase,
    reversed: bool,
    watched: bool,
    limit: Option<f64>,
    /// Where the limit on the rate counts from.
    limit_anchor: (Instant, f64),
    /// Simulated time at which a single step ends.
    step_until: Option<f64>,
    /// Where the last slice was to end.
    target: f64,
    setup_time_s: f64,
    sequence: u64,
    published: Instant,
}

/// Runs until the end, a stop or a failure; gives back the balls and their collisions.
pub fn run(
    setting: &Setting,
    placement: Placement,
    inbox: &Receiver<Command>,
    slot: &Slot,
) -> (Placement, Vec<u64>) {
    let state = State::new(&placement);
    drop(placement);
    let observer = Observer::new(&state);
    let survey_began = Instant::now();
    let survey = Survey::of(&state, &observer);
    let survey_due = survey_began + survey_pause(survey_began.elapsed());
    let engine = setting.options.engine.engine(state);
    let mut run = Run {
        setting,
        inbox,
        slot,
        observer,
        on_demand: (setting.plan.as_ref()).map(|plan| plan.observers(engine.state())),
        observables: Arc::default(),
        observables_due: Instant::now(),
        echo: EchoWatch::new(engine.state()),
        pressures: Pressures::of(engine.state()),
        slices: Slices::new(FIRST_SLICE * engine.state().units.time),
        engine,
        survey,
        survey_due,
        meter: Meter::default(),
        named: Vec::new(),
        sample: None,
        closer_look_due: Instant::now(),
        history: Arc::default(),
        history_due: HISTORY_EVERY_S,
        last_point: (Totals::default(), 0.0),
        last_row: Totals::default(),
        rows: 0,
        phase: Phase::Running,
        reversed: false,
        watched: false,
        limit: None,
        limit_anchor: (Instant::now(), 0.0),
        step_until: None,
        target: 0.0,
        setup_time_s: setting.options.program_start.elapsed().as_secs_f64(),
        sequence: 0,
        published: Instant::now(),
    };
    run.publish(None);
    run.go();
    run.write_history();
    run.engine.settle();
    run.survey = Survey::of(run.engine.state(), &run.observer);
    run.evaluate_observables();
    run.publish(Some(run.engine.state().hash()));
    let state = run.engine.state();
    (state.placement(), state.collisions.clone())
}

/// Wall time between surveys that cost `cost` each.
fn survey_pause(cost: Duration) -> Duration {
    cost.div_f64(SURVEY_SHARE).max(SURVEY_EVERY)
}

impl Run<'_> {
    fn go(&mut self) {
        loop {
            while let Ok(command) = self.inbox.try_recv() {
                if self.obey(command).is_break() {
                    return;
                }
            }
            let waited = match self.wait_for() {
                None => {
                    match self.slice() {
                        Ok(ControlFlow::Continue(())) => {}
                        Ok(ControlFlow::Break(())) => {
                            self.phase = Phase::Finished;
                            return;
                        }
                        Err(stuck) => {
                            self.phase = Phase::Failed(stuck.to_string());
                            return;
                        }
                    }
                    continue;
                }
                Some(pause) => self.inbox.recv_timeout(pause),
            };
            match waited {
                Ok(command) if self.obey(command).is_break() => return,
                Ok(_) | Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    /// How long to wait for a command before the next slice; `None` for no wait.
    fn wait_for(&self) -> Option<Duration> {
        const LONG: Duration = Duration::from_secs(1);
        if self.phase == Phase::Paused {
            return Some(LONG);
        }
        let (since, from) = self.limit_anchor;
        let ahead = (self.time() - from) / self.limit? - since.elapsed().as_secs_f64();
        (ahead > 0.0)
            .then(|| Duration::try_from_secs_f64(ahead).map_or(LONG, |ahead| ahead.min(LONG)))
    }

    fn obey(&mut self, command: Command) -> ControlFlow<()> {
        match command {
            Command::Stop => return ControlFlow::Break(()),
            Command::Pause => self.phase = Phase::Paused,
            Command::Resume => {
                self.phase = Phase::Running;
                self.step_until = None;
                self.limit_anchor = (Instant::now(), self.time());
            }
            Command::Step => {
                self.phase = Phase::Running;
                self.limit_anchor = (Instant::now(), self.time());
                let sample = self.setting.card.sample;
                // A run that stands on a multiple, but for rounding, goes to the next one.
                self.step_until =
                    Some(((self.time() / sample * (1.0 + 1e-12)).floor() + 1.0) * sample);
            }
            Command::Reverse => {
                self.engine.reverse();
                self.observer.ledger.reverse(self.engine.state());
                if let Some(on_demand) = &mut self.on_demand {
                    on_demand.reverse(self.engine.state());
                }
                self.reversed = !self.reversed;
                self.echo.turn(self.time());
            }
            Command::LimitTimeRate(limit) => {
                self.limit = limit;
                self.limit_anchor = (Instant::now(), self.time());
                self.meter.restart();
            }
            Command::Watch(watched) => self.watched = watched,
        }
        self.publish(None);
        ControlFlow::Continue(())
    }

    /// Simulated time: what was asked for, where the engine has got there.
    fn time(&self) -> f64 {
        let state = self.engine.state();
        if state.now == state.units.instant(self.target) {
            self.target
        } else {
            state.units.scene_time(state.now)
        }
    }

    /// Runs one slice; breaks when the end of the run is reached.
    fn slice(&mut self) -> Result<ControlFlow<()>, Stuck> {
        let began = Instant::now();
        let time = self.time();
        let sample = self.setting.card.sample;
        let next_row = (self.rows + 1) as f64 * sample;
        let mut length = self.slices.length().min(sample);
        if let Some(limit) = self.limit {
            length = length.min(limit * LIMITED_SLICE_S);
        }
        let stops = [
            Some(next_row),
            self.step_until,
            self.echo.back_at(),
            self.setting.options.until,
        ];
        let target = stops.into_iter().flatten().fold(time + length, f64::min);
        self.target = target;
        self.run_to(target)?;
        let spent = began.elapsed();
        self.slices.learn(self.time() - time, spent);
        self.meter
            .ran(spent, self.time(), self.engine.counters().pair_collisions);

        if self.echo.back_at().is_some_and(|back| target >= back) {
            self.engine.settle();
            self.echo.arrive(self.engine.state());
        }
        let at_row = target >= next_row;
        if at_row || began >= self.survey_due {
            self.look_at_every_ball();
        }
        if self.on_demand.is_some() && began >= self.observables_due {
            self.evaluate_observables();
        }
        if at_row {
            self.rows += 1;
            self.write_row();
        }
        if self.meter.wall_time() >= self.history_due {
            self.history_due = self.meter.wall_time() + HISTORY_EVERY_S;
            self.write_history();
        }
        if self.step_until.is_some_and(|end| target >= end) {
            self.step_until = None;
            self.phase = Phase::Paused;
            self.publish(None);
        }
        if self.setting.options.until.is_some_and(|end| target >= end) {
            return Ok(ControlFlow::Break(()));
        }
        if self.published.elapsed() >= SNAPSHOT_EVERY {
            self.publish(None);
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Advances the gas, and shows it to the observers on demand at their instants, wherever slices end.
    fn run_to(&mut self, target: f64) -> Result<(), Stuck> {
        let units = self.engine.state().units;
        let observer = &mut self.observer;
        let Some((plan, on_demand)) = self.setting.plan.as_ref().zip(self.on_demand.as_mut())
        else {
            let until = units.instant(target);
            return (self.engine).advance_in_sums(until, &mut |report| observer.take(report));
        };
        loop {
            let due = on_demand.looks as f64 * plan.every();
            let until = units.instant(due.min(target));
            if on_demand.wants_collisions() {
                self.engine.advance(until, &mut |collision| {
                    observer.record(collision);
                    on_demand.record(collision);
                })?;
            } else {
                (self.engine).advance_in_sums(until, &mut |report| observer.take(report))?;
            }
            if due > target {
                return Ok(());
            }
            self.engine.settle();
            on_demand.look(self.engine.state());
        }
    }

    /// Makes figures and tables of what the observers on demand have found.
    fn evaluate_observables(&mut self) {
        let Some((plan, on_demand)) = self.setting.plan.as_ref().zip(self.on_demand.as_ref())
        else {
            return;
        };
        let began = Instant::now();
        let state = self.engine.state();
        let settled = Settled::of(state, &self.observer);
        let balls = self.setting.card.ball_count as f64;
        let volume: f64 = self.setting.card.size.iter().product();
        let energy = self.survey.thermal_energy.map(|energy| balls * energy);
        let bulk = settled
            .pressure
            .virial
            .filter(|_| settled.pressure.wall.is_none());
        let known = Known {
            temperature: self.temperature(),
            collision_rate: (settled.pair_rate)
                .map(|rate| 2.0 * rate / balls)
                .filter(|rate| *rate > 0.0),
            compressibility_factor: bulk
                .zip(energy)
                .map(|(pressure, energy)| pressure * volume / energy),
        };
        self.observables = Arc::new(plan.results(on_demand, state, known));
        self.observables_due = Instant::now() + survey_pause(began.elapsed());
    }

    fn look_at_every_ball(&mut self) {
        let began = Instant::now();
        self.engine.settle();
        self.survey = Survey::of(self.engine.state(), &self.observer);
        self.survey_due = Instant::now() + survey_pause(began.elapsed());
    }

    fn totals(&self) -> Totals {
        let counters = self.engine.counters();
        Totals {
            time: self.time(),
            wall_impulse: self.observer.ledger.wall_impulse(),
            pair_virial: self.observer.ledger.pair_virial(),
            pair_collisions: counters.pair_collisions,
            wall_collisions: counters.wall_collisions,
        }
    }

    /// Wall and virial pressure between two moments, as far as the scene has them.
    fn pressures_between(&self, from: Totals, to: Totals) -> (Option<f64>, Option<f64>) {
        let epochs = (to.time - from.time) / self.engine.state().units.time;
        if epochs <= 0.0 {
            return (None, None);
        }
        let wall = (to.wall_impulse - from.wall_impulse) / epochs;
        let virial = (to.pair_virial - from.pair_virial) / epochs;
        (self.pressures.wall(wall), self.pressures.virial(virial))
    }

    fn write_row(&mut self) {
        let totals = self.totals();
        let pressures = self.pressures_between(self.last_row, totals);
        self.last_row = totals;
        let counters = self.engine.counters();
        let row = SeriesRow {
            time: totals.time,
            wall_time_s: self.meter.wall_time(),
            temperature: self.temperature(),
            pressure_wall: pressures.0,
            pressure_virial: pressures.1,
            pair_collisions: counters.pair_collisions,
            wall_collisions: counters.wall_collisions,
            queue_length: self.engine.queue_length() as u64,
            max_overlap: self.observer.max_overlap,
            energy_drift: self.survey.energy_drift,
        };
        if let Some(series) = &self.setting.options.series {
            // Whoever wrote the series has gone; the run goes on.
            let _ = series.send(row);
        }
    }

    fn write_history(&mut self) {
        let (last, wall_before) = self.last_point;
        let totals = self.totals();
        let wall_time = self.meter.wall_time();
        self.last_point = (totals, wall_time);
        let span = totals.time - last.time;
        if !(span > 0.0) {
            return;
        }
        let counters = self.engine.counters();
        let survey = &self.survey;
        let (wall, virial) = self.pressures_between(last, totals);
        let pairs = (totals.pair_collisions - last.pair_collisions) as f64;
        let walls = (totals.wall_collisions - last.wall_collisions) as f64;
        let speeds = survey.speeds.as_deref();
        let stretch = Stretch::new(last.time, totals.time, wall_time)
            .with(Observable::Temperature, self.temperature())
            .with(Observable::PressureWall, wall)
            .with(Observable::PressureVirial, virial)
            .with(
                Observable::CompressibilityFactor,
                self.compressibility_factor(wall.or(virial)),
            )
            .with(Observable::PairRate, Some(pairs / span))
            .with(Observable::WallRate, Some(walls / span))
            .with(Observable::EnergyDrift, survey.energy_drift)
            .with(Observable::MomentumDrift, survey.momentum_drift)
            .with(Observable::VirialResidual, survey.virial_residual)
            .with(Observable::MaxOverlap, self.observer.max_overlap)
            .with(
                Observable::SpeedDeviation,
                speeds.map(|speeds| speeds.ks / speeds.ks_critical),
            )
            .with(
                Observable::QueueLength,
                (counters.queue_length_max > 0).then(|| self.engine.queue_length() as f64),
            )
            .with(Observable::Speed, Some(pairs / (wall_time - wall_before)))
            .with(
                Observable::Memory,
                measure::resident_memory().map(|bytes| bytes as f64),
            );
        Arc::make_mut(&mut self.history).push(stretch);
    }

    /// `P V / (N k T)`, for a pressure.
    fn compressibility_factor(&self, pressure: Option<f64>) -> Option<f64> {
        let [x, y, z] = self.setting.card.size;
        let balls = self.setting.card.ball_count as f64;
        pressure
            .zip(self.survey.thermal_energy)
            .map(|(p, energy)| p * x * y * z / (balls * energy))
    }

    fn temperature(&self) -> Option<f64> {
        self.survey
            .thermal_energy
            .map(|energy| energy / self.setting.card.units.boltzmann())
    }

    /// Sees where the balls of the picture and the named ones are, unless that would cost too much wall time.
    fn look_closer(&mut self) {
        if !self.watched {
            self.sample = None;
        }
        let wanted = self.watched || !self.setting.named.is_empty();
        if !wanted
            || (Instant::now() < self.closer_look_due && self.sample.is_some() == self.watched)
        {
            return;
        }
        let began = Instant::now();
        self.engine.settle();
        self.closer_look_due = began + began.elapsed().div_f64(CLOSER_LOOK_SHARE);
        let (state, setting, time) = (self.engine.state(), self.setting, self.time());
        let temperature = self.temperature().filter(|_| !self.reversed);
        self.named = setting
            .named
            .iter()
            .map(|ball| ball.at(state, temperature, time))
            .collect();
        self.sample = self
            .watched
            .then(|| Arc::new(measure::sample(state, &setting.sampled, &setting.names)));
    }

    fn publish(&mut self, state_hash: Option<u64>) {
        self.look_closer();
        self.sequence += 1;
        self.published = Instant::now();
        let card = &self.setting.card;
        let state = self.engine.state();
        let counters = self.engine.counters();
        let settled = Settled::of(state, &self.observer);
        let balls = card.ball_count as f64;
        let time = self.time();
        let temperature = self.temperature();
        let rates = self.meter.rates().filter(|_| self.phase == Phase::Running);
        let pair_rate = settled.pair_rate.filter(|_| counters.pair_collisions > 0);
        let pressure = settled.pressure.wall.or(settled.pressure.virial);
        self.slot.put(Snapshot {
            sequence: self.sequence,
            phase: self.phase.clone(),
            reversed: self.reversed,
            time,
            wall_time_s: self.meter.wall_time(),
            setup_time_s: Some(self.setup_time_s),
            time_rate: rates.map(|(rate, _)| rate),
            time_rate_limit: self.limit,
            collisions_per_wall_second: rates.map(|(_, rate)| rate),
            time_left_s: self
                .setting
                .options
                .until
                .and_then(|until| self.meter.time_left(time, until)),
            counts: measure::counts(&counters),
            temperature,
            kinetic_energy: self.survey.kinetic_energy,
            pressure: settled.pressure,
            compressibility_factor: self.compressibility_factor(pressure),
            collision_rate: pair_rate.map(|rate| 2.0 * rate / balls),
            pair_rate,
            wall_rate: settled.wall_rate,
            mean_free_path: pair_rate
                .zip(self.survey.mean_speed)
                .map(|(rate, speed)| balls * speed / (2.0 * rate)),
            expected: temperature.map_or_else(Expected::default, |temperature| {
                self.setting.theory.at(temperature)
            }),
            energy_drift: self.survey.energy_drift,
            momentum_drift: self.survey.momentum_drift,
            virial_residual: self.survey.virial_residual,
            max_overlap: self.observer.max_overlap,
            echo: self.echo.at(time),
            echo_horizon: horizon(
                card.packing_fraction,
                pair_rate.map_or(0.0, |rate| 2.0 * rate / balls),
            )
            .filter(|_| !matches!(self.engine.name(), "reversible" | "statistical")),
            speeds: self.survey.speeds.clone(),
            queue_length: self.engine.queue_length() as u64,
            queue_length_max: counters.queue_length_max,
            peak_rss_bytes: measure::peak_memory(),
            state_hash,
            named: self.named.clone(),
            observables: Arc::clone(&self.observables),
            history: Arc::clone(&self.history),
            sample: self.sample.clone(),
            ..self.setting.first_snapshot()
        });
    }
}
