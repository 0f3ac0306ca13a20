//! The loop on the engine's thread.

mod keep;
mod tell;

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use super::echo::EchoWatch;
use super::measure::{self, Pictures, Pressures, Survey};
use super::observables::{self, Plan};
use super::pace::{Mean, Meter, Slices};
use super::past::Past;
use super::saved::{Origin, SavedRun, Totals};
use super::watchdog::Watchdog;
use super::writer::Writer;
use super::{OnTrouble, Options, Slot};
use crate::engine::{Engine, Stuck};
use crate::feed::Command;
use crate::history::History;
use crate::observe::Observer;
use crate::observe::on_demand::OnDemand;
use crate::snapshot::{NamedBall, ObservableName, Observed, Phase, Snapshot, Warning};
use crate::state::{Placement, State};
use crate::trajectory_file::{Frame, Recorder};

/// By what share of a sample a row may come after the end of the run through rounding, with a wide margin.
const ROUNDING_OF_ROWS: f64 = 1e-6;

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
    /// Name of the method that had the gas when that was last told.
    method: &'static str,
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
    /// Lengths of the queue since the last snapshot, and since the last stretch of the history.
    queue: [Mean; 2],
    /// Simulated times at which time was reversed.
    reversals: Vec<f64>,
    /// Simulated times that watchers have marked.
    marks: Vec<f64>,
    /// The newest warnings, and how many the log has had.
    warnings: (Vec<Warning>, u64),
    watchdog: Watchdog,
    /// What the watchdog has found and nothing has been done about.
    trouble: Option<String>,
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

/// Why a run ends before its time.
enum Stopped {
    /// The engine cannot go on.
    Stuck(Stuck),
    /// What the watchdog has found.
    Trouble(String),
}

impl From<Stuck> for Stopped {
    fn from(stuck: Stuck) -> Self {
        Self::Stuck(stuck)
    }
}

impl Stopped {
    fn words(self) -> String {
        match self {
            Self::Stuck(stuck) => stuck.to_string(),
            Self::Trouble(words) => words,
        }
    }
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
            run.on_demand = plan.and_then(|plan| plan.observers(run.engine.state()));
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
            run.marks = saved.marks;
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
            method: engine.name(),
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
            phase: if setting.options.replay {
                Phase::Paused
            } else {
                Phase::Running
            },
            queue: [Mean::default(); 2],
            reversals: Vec::new(),
            marks: Vec::new(),
            warnings: (Vec::new(), 0),
            watchdog: Watchdog::default(),
            trouble: None,
            watched: false,
            pictures: Pictures::default(),
            limit: None,
            limit_anchor: (now, 0.0),
            step_until: None,
            target: 0.0,
            writer: (setting.options.directory.clone())
                .filter(|_| !setting.options.replay)
                .map(Writer::start),
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
            self.show_news();
            while let Ok(command) = self.inbox.try_recv() {
                if self.obey(command).is_break() {
                    return;
                }
            }
            let waited = match self.wait_for() {
                None => {
                    let (began, counted) = (Instant::now(), self.meter.wall_time());
                    let outcome = self.slice();
                    let counted = self.meter.wall_time() - counted;
                    self.meter.spent(began.elapsed().as_secs_f64() - counted);
                    match outcome {
                        Ok(ControlFlow::Continue(())) => {}
                        Ok(ControlFlow::Break(())) => {
                            self.phase = Phase::Finished;
                            return;
                        }
                        Err(why) => {
                            self.phase = Phase::Failed(why.words());
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
            return Some(if self.expects_news() {
                SNAPSHOT_EVERY
            } else {
                LONG
            });
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
            Command::Mark(time) => self.mark(time),
            Command::Goto(time) => self.past = time.and_then(|time| self.go_back(time)),
            Command::Watch(watched) => self.watched = watched,
            Command::Observe(name, on) => self.observe(name, on),
        }
        self.publish(None);
        ControlFlow::Continue(())
    }

    /// Observes something from now on, or no more.
    fn observe(&mut self, name: ObservableName, on: bool) {
        let Some(plan) = &self.setting.origin.plan else {
            return;
        };
        self.engine.settle();
        let switched = plan.switch(&mut self.on_demand, name, on, self.engine.state());
        self.notice = switched.err();
        self.evaluate_observables();
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
    fn slice(&mut self) -> Result<ControlFlow<()>, Stopped> {
        let began = Instant::now();
        let time = self.time();
        let sample = self.setting.origin.card.sample;
        let until = self.setting.options.until;
        let next_row = (self.rows + 1) as f64 * sample;
        // Three times 0.1 is a little more than 0.3: a run of whole samples ends with a row all the same.
        let at_end = |end: &f64| (next_row - end).abs() < ROUNDING_OF_ROWS * sample;
        let next_row = until.filter(at_end).unwrap_or(next_row);
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
            until,
        ];
        let target = stops.into_iter().flatten().fold(time + length, f64::min);
        self.target = target;
        self.run_to(target)?;
        let queue_length = self.engine.queue_length() as f64;
        self.queue
            .iter_mut()
            .for_each(|mean| mean.add(queue_length));
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
        if until.is_some_and(|end| target >= end) {
            return Ok(ControlFlow::Break(()));
        }
        if self.published.elapsed() >= SNAPSHOT_EVERY {
            self.publish(None);
        }
        if let Some(trouble) = self.trouble.take() {
            match self.setting.options.on_trouble.unwrap_or_default() {
                OnTrouble::Ignore => {}
                OnTrouble::Pause => {
                    self.phase = Phase::Paused;
                    self.publish(None);
                }
                OnTrouble::Checkpoint => self.checkpoint_due = Instant::now(),
                OnTrouble::Stop => {
                    return Err(Stopped::Trouble(format!("{trouble} (--on-trouble stop)")));
                }
            }
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

    fn reversed(&self) -> bool {
        self.reversals.len() % 2 == 1
    }

    /// Advances the gas with all its observers, wherever slices end.
    fn run_to(&mut self, target: f64) -> Result<(), Stuck> {
        let plan = self.setting.origin.plan.as_ref();
        let on_demand = (self.on_demand.as_mut()).zip(plan.map(Plan::every));
        observables::advance(&mut *self.engine, &mut self.observer, on_demand, target)
    }
}
