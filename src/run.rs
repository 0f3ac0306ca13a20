//! One run from its options to its files, whether a screen watches it or not.

mod resumed;

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use crate::check::Report;
use crate::checkpoint;
use crate::cli::RunOptions;
use crate::error::{Error, Result};
use crate::feed::message::Ending;
use crate::feed::server::Server;
use crate::feed::{Command, Feed};
use crate::output::{SeriesWriter, Target, write_history, write_observed, write_state};
use crate::quantity::plain;
use crate::report;
use crate::run_directory::{self, RunDirectory};
use crate::run_process::logout;
use crate::scene::{Scene, is_seed_text, observe};
use crate::state::Placement;
use crate::summary::{Exit, Summary, for_people};
use crate::trajectory_file::{ENDINGS, Format, Recorder, Witness};
use crate::worker::engines::{Accuracy, Choice, EngineName, Offer, Wishes};
use crate::worker::{LocalFeed, OnTrouble, Options, Worker};
use resumed::Resumed;

/// A run that could start: the scene is good and its balls are placed, or its checkpoint is; its outputs can be written.
pub struct Prepared {
    origin: Origin,
    outputs: Outputs,
    run_dir: Option<PathBuf>,
    checkpoint_every: Duration,
    trajectory_every: Option<f64>,
    force: bool,
    until_error: Option<f64>,
    on_trouble: OnTrouble,
}

/// What a run comes from.
enum Origin {
    Scene(Box<Placed>),
    Checkpoint(Box<Resumed>),
}

/// A scene with its balls.
struct Placed {
    scene: Scene,
    placement: Placement,
    engine: Choice,
    report: Report,
}

struct Outputs {
    summary: Option<Target>,
    series: Option<Target>,
    state: Option<Target>,
    history: Option<Target>,
    trajectory: Option<PathBuf>,
}

/// A run that is going on.
pub struct Run {
    worker: Worker,
    directory: Option<RunDirectory>,
    server: Option<Server>,
    summary: Option<Target>,
    series: Option<SeriesWriter>,
    state: Option<Target>,
    history: Option<Target>,
    trajectory: Option<Witness>,
}

/// The scene of the command line: a file, or the embedded one.
///
/// # Errors
/// [`Error::Scene`] when the file does not make a scene.
pub fn load(path: Option<&PathBuf>) -> Result<Scene> {
    path.map_or_else(|| Ok(Scene::oxygen()), |path| Scene::load(path))
}

impl Prepared {
    /// Reads, checks and places the scene, or reads the checkpoint, and checks the outputs; writes nothing.
    ///
    /// # Errors
    /// [`Error::Scene`] for the scene, [`Error::Usage`] for the checkpoint, the outputs and the engine.
    pub fn new(options: &RunOptions) -> Result<Self> {
        let checkpoint = (options.scene.as_deref())
            .filter(|path| path.is_dir() || checkpoint::is_checkpoint(path));
        let outputs = Outputs::new(options, checkpoint.is_some())?;
        let origin = match checkpoint {
            Some(path) => Origin::Checkpoint(Box::new(Resumed::new(path, options)?)),
            None => Origin::Scene(Box::new(Placed::new(options)?)),
        };
        Ok(Self {
            origin,
            outputs,
            run_dir: options.run_dir.clone(),
            checkpoint_every: options.checkpoint_every,
            trajectory_every: options.trajectory_every,
            force: options.force,
            until_error: options.until_error,
            on_trouble: options.on_trouble,
        })
    }

    /// Why the run needs `--yes`, if it does: it has no end in sight, or takes more than an hour.
    pub fn needs_consent(&self) -> Option<String> {
        match &self.origin {
            Origin::Scene(placed) => placed.report.needs_consent(),
            Origin::Checkpoint(resumed) => resumed.needs_consent(),
        }
    }

    /// Makes the run's directory and starts the engine.
    ///
    /// Without `--run-dir`, a directory that cannot be made is only worth a warning.
    ///
    /// # Errors
    /// [`Error::File`] when the directory of `--run-dir` cannot be made, or the series cannot be opened any more.
    pub fn start(self, program_start: Instant) -> Result<Run> {
        let directory = match self.open_directory() {
            Ok(directory) => Some(directory),
            Err(error) if self.run_dir.is_some() || matches!(error, Error::Usage(_)) => {
                return Err(error);
            }
            Err(error) => {
                say(&format!(
                    "moltop: warning: the run has no directory: {error}"
                ));
                None
            }
        };
        self.start_in(directory, program_start)
    }

    /// Starts the engine of a run that leaves nothing behind but the outputs that were asked for.
    ///
    /// # Errors
    /// [`Error::File`] when the series cannot be opened any more.
    pub fn start_without_directory(self, program_start: Instant) -> Result<Run> {
        self.start_in(None, program_start)
    }

    fn start_in(self, directory: Option<RunDirectory>, program_start: Instant) -> Result<Run> {
        let trajectory = self.trajectory()?;
        let witness = trajectory.as_ref().map(Recorder::witness);
        let Outputs {
            summary,
            series,
            state,
            history,
            trajectory: _,
        } = self.outputs;
        let (sender, series) = match series {
            Some(target) => {
                let (sender, receiver) = mpsc::channel();
                (Some(sender), Some(SeriesWriter::start(target, receiver)?))
            }
            None => (None, None),
        };
        let options = |engine, until| Options {
            engine,
            until,
            until_error: self.until_error,
            reversals: Vec::new(),
            series: sender,
            trajectory,
            directory: directory.as_ref().map(|found| found.path().to_owned()),
            replay: false,
            checkpoint_every: self.checkpoint_every,
            on_trouble: Some(self.on_trouble),
            program_start,
        };
        let worker = match self.origin {
            Origin::Scene(placed) => {
                let options = options(placed.engine, placed.scene.until);
                Worker::start(&placed.scene, placed.placement, options)
            }
            Origin::Checkpoint(resumed) => {
                let saved = resumed.saved;
                let options = options(saved.engine, saved.until);
                Worker::resume(saved, options)
            }
        };
        Ok(Run {
            worker,
            directory,
            server: None,
            summary,
            series,
            state,
            history,
            trajectory: witness,
        })
    }
}

impl Prepared {
    /// The trajectory's file: a new one, or that of the checkpoint if the run goes on where it was.
    fn trajectory(&self) -> Result<Option<Recorder>> {
        let path = self.outputs.trajectory.as_deref();
        let (sample, time, mark) = match &self.origin {
            Origin::Scene(placed) => (placed.scene.sample, 0.0, None),
            Origin::Checkpoint(resumed) => {
                let saved = &resumed.saved;
                let at_home = resumed.is_at_home(self.run_dir.as_ref());
                let mark = saved.trajectory.as_ref().filter(|_| at_home);
                (saved.origin.card.sample, saved.time, mark)
            }
        };
        match (path, mark) {
            (None, None) => Ok(None),
            (_, Some(mark)) if path.is_none_or(|path| mark.is_in(path)) => {
                if self
                    .trajectory_every
                    .is_some_and(|every| every != mark.every)
                {
                    let (file, every) = (mark.path.display(), plain(mark.every));
                    return Err(Error::Usage(format!(
                        "--trajectory-every: {file} has a frame every {every}, which it keeps"
                    )));
                }
                Recorder::resume(mark).map(Some)
            }
            (Some(path), _) => {
                Target::new(path, self.force)?;
                let every = self.trajectory_every.unwrap_or(sample);
                Recorder::create(path, every, time, self.force).map(Some)
            }
            (None, Some(_)) => unreachable!("a mark without another path is gone on with"),
        }
    }

    fn open_directory(&self) -> Result<RunDirectory> {
        let (title, source, own) = match &self.origin {
            Origin::Scene(placed) => (&placed.scene.title, &placed.scene.source, None),
            Origin::Checkpoint(resumed) => {
                let origin = &resumed.saved.origin;
                let own = resumed.directory(self.run_dir.as_ref())?;
                (&origin.card.title, &origin.source, own)
            }
        };
        let goes_on = own.is_some();
        let directory = match own {
            Some(own) => own,
            None => RunDirectory::create(title, self.run_dir.as_deref())?,
        };
        directory.start_log()?;
        if !goes_on {
            let file = if is_seed_text(source) {
                run_directory::SCENE_IN_SEED_TEXT
            } else {
                run_directory::SCENE
            };
            (directory.target(file)).write(|writer| writer.write_all(source.as_bytes()))?;
        }
        let what = if goes_on { "goes on" } else { "started" };
        tracing::info!(run = directory.name(), pid = std::process::id(), "{what}");
        if let Some(warning) = logout::warning() {
            tracing::warn!("{warning}");
        }
        Ok(directory)
    }
}

impl Placed {
    fn new(options: &RunOptions) -> Result<Self> {
        let mut scene = load(options.scene.as_ref())?;
        scene.seed = options.seed.unwrap_or(scene.seed);
        scene.until = options.until.or(scene.until);
        scene.sample = options.sample.unwrap_or(scene.sample);
        scene.observe.add(&options.observe);
        if let Some(why) = observe::refusal(&scene) {
            return Err(Error::Usage(format!("--observe {why}")));
        }
        let placement = scene.place()?;
        let wishes = Wishes {
            engine: match (options.engine, options.accuracy) {
                (None, Some(_)) => EngineName::Auto,
                (engine, _) => engine.unwrap_or(scene.engine),
            },
            step_fraction: options.step_fraction,
            cells_per_path: options.cells_per_path,
            accuracy: options.accuracy,
            seed: scene.seed,
            forced: options.force,
            calendar: options.calendar,
            step: options.step,
            threads: options.threads.map(usize::from),
            until: scene.until,
        };
        let engine = Choice::new(&wishes, &placement).map_err(Error::Usage)?;
        if let Some(warning) = engine.warning(&placement) {
            say(&format!("moltop: warning: {warning}"));
        }
        let mut report = Report::new(&scene, &placement, scene.until);
        match engine {
            Choice::Step(step) => report.cost_in_steps(step),
            Choice::Statistical { .. } => {
                let offer = Offer::new("", engine, &placement, None);
                say(&format!("moltop: {}", offer.words()));
                report.cost_per_time(offer.wall_seconds_per_time());
            }
            _ if options.accuracy.is_none_or(|wish| wish == Accuracy::Exact) => {}
            _ => say(
                "moltop: no setting of engine statistical is so accurate for this gas: it runs exactly",
            ),
        }
        Ok(Self {
            scene,
            placement,
            engine,
            report,
        })
    }
}

impl Outputs {
    fn new(options: &RunOptions, from_checkpoint: bool) -> Result<Self> {
        let paths = [
            &options.summary,
            &options.series,
            &options.state,
            &options.history,
            &options.trajectory,
        ];
        for (index, path) in paths.iter().enumerate() {
            if path.is_some() && paths[..index].contains(path) {
                return Err(Error::Usage(
                    "two outputs have the same name: each needs its own".to_owned(),
                ));
            }
        }
        let target = |path: &Option<PathBuf>| {
            path.as_ref()
                .map(|path| Target::new(path, options.force))
                .transpose()
        };
        let trajectory = options.trajectory.clone();
        if let Some(path) = trajectory
            .as_ref()
            .filter(|path| Format::of(path).is_none())
        {
            return Err(Error::Usage(format!(
                "--trajectory {}: must end in {ENDINGS}",
                path.display()
            )));
        }
        if options.trajectory_every.is_some() && trajectory.is_none() && !from_checkpoint {
            return Err(Error::Usage(
                "--trajectory-every: goes with --trajectory FILE".to_owned(),
            ));
        }
        if let Some(path) = trajectory.as_ref().filter(|_| !from_checkpoint) {
            Target::new(path, options.force)?;
        }
        let [summary, series, state, history] = [
            &options.summary,
            &options.series,
            &options.state,
            &options.history,
        ]
        .map(target);
        Ok(Self {
            trajectory,
            summary: summary?,
            series: series?,
            state: state?,
            history: history?,
        })
    }
}

impl Run {
    /// The run as watchers see it.
    pub fn feed(&self) -> LocalFeed {
        self.worker.feed()
    }

    /// The run's directory, if it has one.
    pub fn directory(&self) -> Option<&RunDirectory> {
        self.directory.as_ref()
    }

    /// Lets other processes watch and command the run, if it has a directory.
    ///
    /// # Errors
    /// [`Error::File`] when its socket cannot be made.
    pub fn serve(&mut self) -> Result<()> {
        if let Some(directory) = &self.directory {
            self.server = Some(Server::start(directory.path(), self.feed())?);
        }
        Ok(())
    }

    /// Stops the engine if it still runs, writes every output, and says how the run went.
    pub fn finish(self, exit: Exit) -> Ending {
        self.worker.feed().send(Command::Stop);
        let outcome = self.worker.join();
        let exit = Exit::of(&outcome.snapshot, exit);
        let mut written = Vec::new();
        let summary = Summary::new(&outcome.snapshot, &exit);
        let of_run = (self.directory.as_ref()).map(|found| found.target(run_directory::SUMMARY));
        for target in of_run.iter().chain(&self.summary) {
            written.push(target.write(|writer| summary.write(writer)));
        }
        // The worker is gone, and with it the sender of rows.
        written.extend(self.series.map(SeriesWriter::finish));
        written.extend(self.trajectory.map(|trajectory| trajectory.testify()));
        if let Some(target) = self.state {
            written.push(match &outcome.balls {
                Some((balls, collisions)) => {
                    target.write(|writer| write_state(writer, balls, collisions))
                }
                None => Err(Error::Engine(
                    "the engine failed, so there is no state to write".to_owned(),
                )),
            });
        }
        for observed in outcome.snapshot.observables.iter() {
            let target = (self.directory.as_ref())
                .map(|found| found.target(&format!("{}.csv", observed.name)));
            written.extend(
                target.map(|target| target.write(|writer| write_observed(writer, observed))),
            );
        }
        let history = &outcome.snapshot.history;
        let of_run = (self.directory.as_ref()).map(|found| found.target(run_directory::HISTORY));
        for target in of_run.iter().chain(&self.history) {
            written.push(target.write(|writer| write_history(writer, history)));
        }
        if let Some(directory) = &self.directory {
            let path = directory.path();
            written.push(report::Report::of(path).and_then(|report| report.write(path)));
        }
        let failures: Vec<String> = (written.into_iter().filter_map(Result::err))
            .map(|error| error.to_string())
            .collect();
        let ending = Ending {
            code: if failures.is_empty() { exit.code() } else { 1 },
            summary: for_people(&outcome.snapshot, &exit),
            failures,
        };
        for failure in &ending.failures {
            tracing::error!("{failure}");
        }
        tracing::info!("ended: {}", exit.words());
        if let Some(directory) = &self.directory {
            let words =
                |writer: &mut dyn Write| writeln!(writer, "{} {}", ending.code, exit.words());
            if let Err(error) = directory.target(run_directory::EXIT).write(words) {
                tracing::error!("{error}");
            }
        }
        if let Some(server) = self.server {
            server.finish(ending.clone());
        }
        ending
    }
}

/// Says on stderr how a run ended; gives back its exit code.
pub fn tell(ending: &Ending) -> u8 {
    say(ending.summary.trim_end());
    for failure in &ending.failures {
        say(&format!("moltop: {failure}"));
    }
    ending.code
}

/// A line on stderr; when nobody listens there, there is nobody to tell.
pub fn say(words: &str) {
    let _ = writeln!(io::stderr(), "{words}");
}
