//! The loop on the engine's thread.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use super::echo::{EchoWatch, horizon};
use super::measure::{self, Pictures, Pressures, Settled, Survey};
use super::observables::Known;
use super::pace::{Meter, Slices};
use super::past::Past;
use super::saved::{Origin, SavedRun, Totals};
use super::writer::Writer;
use super::{Options, Slot};
use crate::engine::{Engine, Stuck};
use crate::feed::Command;
use crate::history::{History, Observable, Stretch};
use crate::observe::Observer;
use crate::observe::on_demand::OnDemand;
use crate::snapshot::{Expected, NamedBall, Observed, Phase, SeriesRow, Snapshot};
use crate::state::{Placement, State};
use crate::trajectory_file::{Frame, Recorder};

/// Wall time between two snapshots.
const SNAPSHOT_EVERY: Duration = Duration::from_millis(100);

/// Wall time of the run between two stretches of the history \[s\].
const HISTORY_EVERY_S: f64 = 0.5;

/// Share of the wall time that may go into reading every ball.
const SURVEY_SHARE: f64 = 0.003;

/// Share of the wall time that may go into settling the engine for the named balls.
const CLOSER_LOOK_SHARE: f64 = 0.05;

/// Wall time between two surveys, at least.
const SURVEY_EVERY: Duration = Duration::from_secs(1);

/// First slice, in epochs: short, whatever the scene.
const FIRST_SLICE: f64 = 1.0 / 4096.0;

/// Longest that one slice may run on where the rate of simulated time is limited \[wall s\].
const LIMITED_SLICE_S: f64 = 0.02;

/// What is fixed when a run starts.
pub struct Setting {
    origin: Arc<Origin>,
    names: Vec<String>,
    sampled: Vec<u32>,
    options: Options,
}

impl Setting {
    /// What the run needs beside the balls.
    pub fn new(origin: Arc<Origin>, options: Options) -> Self {
        let named = origin.named.iter();
        let named: Vec<_> = named.map(|ball| (ball.name.clone(), ball.ball)).collect();
        Self {
            sampled: measure::sampled_balls(origin.card.ball_count, &named),
            names: named.into_iter().map(|(name, _)| name).collect(),
            origin,
            options,
        }
    }

    /// When the next checkpoint is due; a pause without end is one of a century.
    fn next_checkpoint(&self) -> Instant {
        const CENTURY: Duration = Duration::from_secs(100 * 365 * 86_400);
        Instant::now() + self.options.checkpoint_every.min(CENTURY)
    }

    /// The snapshot of a run that has not begun.
    pub fn first_snapshot(&self) -> Snapshot {
        Snapshot::starting(
            Arc::clone(&self.origin.card),
            self.options.engine.name(),
            self.options.until,
        )
    }
}

/// What a run begins with.
pub enum Begin {
    /// A gas as it was placed.
    Placed(Placement),
    /// A run that goes on.
    Saved(Box<SavedRun>),
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
    /// The named balls, as of the last closer look.
    named: Vec<NamedBall>,
    closer_look_due: Instant,
    history: Arc<History>,
    history_due: f64,
    /// Where the last stretch of the history ended, and the wall time then.
    last_point: (Totals, f64),
    last_row: Totals,
    rows: u64,
    /// Number of the next frame of the trajectory.
    next_frame: u64,
    phase: Phase,
    /// Simulated times at which time was reversed.
    reversals: Vec<f64>,
    watched: bool,
    pictures: Pictures,
    limit: Option<f64>,
    /// Where the limit on the rate counts from.
    limit_anchor: (Instant, f64),
    /// Simulated time at which a single step ends.
    step_until: Option<f64>,
    /// Where the last slice was to end.
    target: f64,
    /// What writes checkpoints, if the run has a directory.
    writer: Option<Writer>,
    checkpoint_due: Instant,
    /// Simulated time of the newest checkpoint, written or on its way to the disk.
    saved_at: Option<f64>,
    notice: Option<String>,
    /// The past that somebody asked for.
    past: Option<Past>,
    /// How many of the reversals that are to be run again have been.
    turned: usize,
    setup_time_s: f64,
    sequence: u64,
    published: Instant,
}

/// Runs until the end, a stop or a failure; gives back the balls and their collisions.
pub fn run(
    setting: &Setting,
    begin: Begin,
    inbox: &Receiver<Command>,
    slot: &Slot,
) -> (Placement, Vec<u64>) {
    let choice = &setting.options.engine;
    let mut run = match begin {
        Begin::Placed(placement) => {
            let state = State::new(&placement);
            drop(placement);
            let observer = Observer::new(&state);
            let survey = Survey::of(&state, &observer);
            let mut run = Run::new(
                setting,
                inbox,
                slot,
                (choice.engine(state), observer, survey),
            );
            run.echo = EchoWatch::new(run.engine.state());
            let plan = setting.origin.plan.as_ref();
            run.on_demand = plan.map(|plan| plan.observers(run.engine.state()));
            run
        }
        Begin::Saved(saved) => {
            let survey = Survey::of(&saved.state, &saved.observer);
            let engine = (choice.resume(saved.state, saved.saved))
                .expect("a checkpoint's engine is the one that is to go on");
            let mut run = Run::new(setting, inbox, slot, (engine, saved.observer, survey));
            run.on_demand = saved.on_demand;
            run.pressures = saved.pressures;
            run.echo = saved.echo;
            run.history_due = saved.meter.wall_time() + HISTORY_EVERY_S;
            run.meter = saved.meter;
            run.history = saved.history;
            run.last_point = saved.last_point;
            run.last_row = saved.last_row;
            run.rows = saved.rows;
            run.reversals = saved.reversals;
            run.target = saved.time;
            run.limit_anchor.1 = saved.time;
            run.saved_at = Some(saved.time);
            run.checkpoint_due = setting.next_checkpoint();
            run
        }
    };
    run.setup_time_s = setting.options.program_start.elapsed().as_secs_f64();
    run.publish(None);
    run.record_frame_if_due(run.time());
    run.go();
    run.write_history();
    run.save_at_the_end(); // before the engine is settled, which moves where flights are counted from
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

impl<'a> Run<'a> {
    /// A run that has just begun.
    fn new(
        setting: &'a Setting,
        inbox: &'a Receiver<Command>,
        slot: &'a Slot,
        (engine, observer, survey): (Box<dyn Engine>, Observer, Survey),
    ) -> Self {
        let now = Instant::now();
        Self {
            setting,
            inbox,
            slot,
            observer,
            on_demand: None,
            observables: Arc::default(),
            observables_due: now,
            echo: EchoWatch::default(),
            pressures: Pressures::of(engine.state()),
            slices: Slices::new(FIRST_SLICE * engine.state().units.time),
            engine,
            survey,
            survey_due: now + SURVEY_EVERY,
            meter: Meter::default(),
            named: Vec::new(),
            closer_look_due: Instant::now(),
            history: Arc::default(),
            history_due: HISTORY_EVERY_S,
            last_point: (Totals::default(), 0.0),
            last_row: Totals::default(),
            rows: 0,
            next_frame: (setting.options.trajectory.as_ref()).map_or(0, Recorder::first),
            phase: Phase::Running,
            reversals: Vec::new(),
            watched: false,
            pictures: Pictures::default(),
            limit: None,
            limit_anchor: (now, 0.0),
            step_until: None,
            target: 0.0,
            writer: setting.options.directory.clone().map(Writer::start),
            checkpoint_due: now, // from the start on there is one to go back to
            saved_at: None,
            notice: None,
            past: None,
            turned: 0,
            setup_time_s: 0.0,
            sequence: 0,
            published: now,
        }
    }

    fn go(&mut self) {
        loop {
            self.save_if_due();
            self.show_past();
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
            let news = self.past.as_ref().is_some_and(Past::is_on_its_way);
            return Some(if news { SNAPSHOT_EVERY } else { LONG });
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
                let sample = self.setting.origin.card.sample;
                // A run that stands on a multiple, but for rounding, goes to the next one.
                self.step_until =
                    Some(((self.time() / sample * (1.0 + 1e-12)).floor() + 1.0) * sample);
            }
            Command::Reverse => {
                self.reverse();
            }
            Command::LimitTimeRate(limit) => {
                self.limit = limit;
                self.limit_anchor = (Instant::now(), self.time());
                self.meter.restart();
            }
            Command::Checkpoint => {
                self.checkpoint_due = Instant::now();
                self.saved_at = None;
                if self.writer.is_none() {
                    self.notice = Some("no checkpoint: the run has no directory".to_owned());
                }
                self.save_if_due();
            }
            Command::Goto(time) => self.past = time.and_then(|time| self.go_back(time)),
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
        let sample = self.setting.origin.card.sample;
        let next_row = (self.rows + 1) as f64 * sample;
        let mut length = self.slices.length().min(sample);
        if let Some(limit) = self.limit {
            length = length.min(limit * LIMITED_SLICE_S);
        }
        let stops = [
            Some(next_row),
            self.frame_due(),
            self.step_until,
            self.echo.back_at(),
            self.setting.options.reversals.get(self.turned).copied(),
            self.setting.options.until,
        ];
        let target = stops.into_iter().flatten().fold(time + length, f64::min);
        self.target = target;
        self.run_to(target)?;
        let spent = began.elapsed();
        self.slices.learn(self.time() - time, spent);
        self.meter
            .ran(spent, self.time(), self.engine.counters().pair_collisions);

        let turn = self.setting.options.reversals.get(self.turned);
        if turn.is_some_and(|&turn| target >= turn) {
            self.turned += 1;
            self.reverse();
        }
        if self.echo.back_at().is_some_and(|back| target >= back) {
            self.engine.settle();
            self.echo.arrive(self.engine.state());
        }
        self.record_frame_if_due(target);
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
            let wanted = self.setting.options.until_error;
            if wanted
                .is_some_and(|wanted| self.pressure_error().is_some_and(|error| error <= wanted))
            {
                return Ok(ControlFlow::Break(()));
            }
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

    /// Simulated time of the next frame of the trajectory.
    fn frame_due(&self) -> Option<f64> {
        let trajectory = self.setting.options.trajectory.as_ref()?;
        Some(trajectory.time_of(self.next_frame))
    }

    fn record_frame_if_due(&mut self, time: f64) {
        let Some(trajectory) = &self.setting.options.trajectory else {
            return;
        };
        if time >= trajectory.time_of(self.next_frame) {
            self.engine.settle();
            trajectory.add(Frame {
                number: self.next_frame,
                time: trajectory.time_of(self.next_frame),
                balls: self.engine.state().placement(),
            });
            self.next_frame += 1;
        }
    }

    fn reverse(&mut self) {
        self.engine.reverse();
        self.observer.ledger.reverse(self.engine.state());
        if let Some(on_demand) = &mut self.on_demand {
            on_demand.reverse(self.engine.state());
        }
        self.reversals.push(self.time());
        self.echo.turn(self.time());
    }

    /// Starts on the way to a past moment, if there is one and a checkpoint before it.
    fn go_back(&mut self, time: f64) -> Option<Past> {
        let refuse = |run: &mut Self, why: &str| {
            run.notice = Some(format!("no way back: {why}"));
            None
        };
        if !(0.0..=self.time()).contains(&time) {
            return refuse(self, "the run has not been there");
        }
        let Some(directory) = self.setting.options.directory.clone() else {
            return refuse(self, "the run has no directory for checkpoints");
        };
        self.notice = None;
        Some(Past::start(
            directory,
            time,
            &self.slot.get(),
            self.reversals.clone(),
        ))
    }

    /// Publishes what has become of the past, while the run itself has no news.
    fn show_past(&mut self) {
        let shown = self.slot.get();
        let news = |past: &Past| {
            let latest = past.latest();
            (shown.past.as_ref()).is_none_or(|shown| shown.sequence != latest.sequence)
        };
        if self.published.elapsed() >= SNAPSHOT_EVERY && self.past.as_ref().is_some_and(news) {
            self.publish(None);
        }
    }

    /// Share of the pressure that its standard error is.
    fn pressure_error(&self) -> Option<f64> {
        let pressure = Settled::of(self.engine.state(), &self.observer).pressure;
        let value = pressure
            .wall
            .or(pressure.virial)
            .filter(|value| *value > 0.0);
        value
            .zip(pressure.standard_error)
            .map(|(value, error)| error / value)
    }

    /// Wall seconds until the standard error of the pressure, now `error`, is `wanted`: it falls with the root of the time.
    fn time_to_error(&self, error: Option<f64>) -> Option<(f64, f64)> {
        let share = error? / self.setting.options.until_error?;
        let missing = (self.time() * (share * share - 1.0)).max(0.0);
        let (low, high) = self.meter.time_for(missing)?;
        // An error from some sixty blocks is itself known to a tenth, its square to a fifth.
        Some((0.8 * low, 1.25 * high))
    }

    /// Writes a checkpoint, if one is due and the one before is on the disk.
    fn save_if_due(&mut self) {
        let time = self.time();
        if Instant::now() < self.checkpoint_due || self.writer.as_ref().is_none_or(Writer::is_busy)
        {
            return;
        }
        self.checkpoint_due = self.setting.next_checkpoint();
        if self.saved_at == Some(time) {
            return; // nothing has happened since
        }
        self.saved_at = Some(time);
        self.engine.settle();
        let run = self.save();
        if let Some(writer) = &mut self.writer {
            writer.write(run);
        }
    }

    /// The last checkpoint; waits until it is on the disk.
    fn save_at_the_end(&mut self) {
        let Some(mut writer) = self.writer.take() else {
            return;
        };
        // A gas that got stuck is of no use, and one of another time is safe.
        if self.saved_at != Some(self.time()) && !matches!(self.phase, Phase::Failed(_)) {
            self.engine.settle();
            writer.write(self.save());
        }
        writer.finish();
        self.writer = Some(writer);
    }

    fn save(&self) -> SavedRun {
        let state = self.engine.state().clone();
        SavedRun {
            origin: Arc::clone(&self.setting.origin),
            engine: self.setting.options.engine,
            until: self.setting.options.until,
            time: self.time(),
            wall_time_s: self.meter.wall_time(),
            time_rate: self.meter.rates().map(|(rate, _)| rate),
            kinetic_energy: state.kinetic_energy(),
            state,
            saved: self.engine.save(),
            observer: self.observer.clone(),
            on_demand: self.on_demand.clone(),
            pressures: self.pressures,
            echo: self.echo.clone(),
            meter: self.meter.clone(),
            history: Arc::clone(&self.history),
            last_point: self.last_point,
            last_row: self.last_row,
            rows: self.rows,
            trajectory: (self.setting.options.trajectory.as_ref())
                .and_then(|trajectory| trajectory.mark(self.next_frame)),
            reversals: self.reversals.clone(),
        }
    }

    fn reversed(&self) -> bool {
        self.reversals.len() % 2 == 1
    }

    /// Advances the gas, and shows it to the observers on demand at their instants, wherever slices end.
    fn run_to(&mut self, target: f64) -> Result<(), Stuck> {
        let units = self.engine.state().units;
        let observer = &mut self.observer;
        let Some((plan, on_demand)) = self
            .setting
            .origin
            .plan
            .as_ref()
            .zip(self.on_demand.as_mut())
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
        let Some((plan, on_demand)) = self
            .setting
            .origin
            .plan
            .as_ref()
            .zip(self.on_demand.as_ref())
        else {
            return;
        };
        let began = Instant::now();
        let state = self.engine.state();
        let settled = Settled::of(state, &self.observer);
        let balls = self.setting.origin.card.ball_count as f64;
        let volume: f64 = self.setting.origin.card.size.iter().product();
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
        let [x, y, z] = self.setting.origin.card.size;
        let balls = self.setting.origin.card.ball_count as f64;
        pressure
            .zip(self.survey.thermal_energy)
            .map(|(p, energy)| p * x * y * z / (balls * energy))
    }

    fn temperature(&self) -> Option<f64> {
        self.survey
            .thermal_energy
            .map(|energy| energy / self.setting.origin.card.units.boltzmann())
    }

    /// Sees where the named balls are, unless that would cost too much wall time.
    fn look_closer(&mut self) {
        let named = &self.setting.origin.named;
        if named.is_empty() || Instant::now() < self.closer_look_due {
            return;
        }
        let began = Instant::now();
        self.engine.settle();
        self.closer_look_due = began + began.elapsed().div_f64(CLOSER_LOOK_SHARE);
        let (state, time) = (self.engine.state(), self.time());
        let temperature = self.temperature().filter(|_| !self.reversed());
        self.named = named
            .iter()
            .map(|ball| ball.at(state, temperature, time))
            .collect();
    }

    fn publish(&mut self, state_hash: Option<u64>) {
        self.look_closer();
        let running = self.phase == Phase::Running;
        let sample = self.watched.then(|| {
            let (engine, setting) = (&mut self.engine, self.setting);
            (self.pictures).sample(running, || {
                engine.settle();
                measure::sample(engine.state(), &setting.sampled, &setting.names)
            })
        });
        self.sequence += 1;
        self.published = Instant::now();
        let card = &self.setting.origin.card;
        let state = self.engine.state();
        let counters = self.engine.counters();
        let settled = Settled::of(state, &self.observer);
        let balls = card.ball_count as f64;
        let time = self.time();
        let temperature = self.temperature();
        let rates = self.meter.rates().filter(|_| self.phase == Phase::Running);
        let pair_rate = settled.pair_rate.filter(|_| counters.pair_collisions > 0);
        let pressure_error = self.pressure_error();
        let pressure = settled.pressure.wall.or(settled.pressure.virial);
        self.slot.put(Snapshot {
            sequence: self.sequence,
            phase: self.phase.clone(),
            reversed: self.reversed(),
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
                .and_then(|until| self.meter.time_for(until - time)),
            until_error: self.setting.options.until_error,
            pressure_error,
            error_left_s: self.time_to_error(pressure_error),
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
                self.setting.origin.theory.at(temperature)
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
            past: self.past.as_ref().map(Past::latest),
            last_checkpoint: self.writer.as_ref().and_then(Writer::written),
            notice: (self.writer.as_ref().and_then(Writer::trouble))
                .or_else(|| self.setting.options.trajectory.as_ref()?.trouble())
                .or_else(|| self.notice.clone()),
            peak_rss_bytes: measure::peak_memory(),
            state_hash,
            named: self.named.clone(),
            observables: Arc::clone(&self.observables),
            history: Arc::clone(&self.history),
            sample,
            ..self.setting.first_snapshot()
        });
    }
}
