//! The engine's thread: commands in, newest snapshot out. The only place where simulation time meets the wall clock.
//!
//! The engine never waits for a watcher: it leaves its newest snapshot in a slot and goes on. It runs in slices of simulated
//! time that take some milliseconds of wall time each, and looks for commands between them; where the slices end changes no
//! trajectory, so the clock has no influence on the physics.

pub mod engines;
pub mod observables;

mod echo;
mod measure;
mod pace;
mod past;
mod run;
mod saved;
mod watchdog;
mod writer;

use std::io::Write;
use std::os::unix::net::UnixStream;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, Once, mpsc};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

pub use saved::{Origin, SavedRun};
pub use watchdog::OnTrouble;

use crate::feed::{Command, Feed};
use crate::scene::Scene;
use crate::snapshot::{Phase, SeriesRow, Snapshot};
use crate::state::Placement;
use crate::trajectory_file::Recorder;

/// Name of the engine's thread; a panic there becomes an error on the screen instead of words on a terminal.
const THREAD_NAME: &str = "engine";

/// How a run is to be driven.
pub struct Options {
    /// What drives it.
    pub engine: engines::Choice,
    /// Simulated time at which the run ends; `None` runs until it is stopped.
    pub until: Option<f64>,
    /// Standard error of the pressure over the pressure at which the run ends, at the end of a sample.
    pub until_error: Option<f64>,
    /// Simulated times at which time is reversed, in order: a course that was run before.
    pub reversals: Vec<f64>,
    /// Where the rows of the series go.
    pub series: Option<mpsc::Sender<SeriesRow>>,
    /// Where the frames of the trajectory go.
    pub trajectory: Option<Recorder>,
    /// Directory of the run, if it has one: there its checkpoints go.
    pub directory: Option<PathBuf>,
    /// Whether the run has ended and is only shown: it rests, and writes nothing.
    pub replay: bool,
    /// Wall time between two checkpoints.
    pub checkpoint_every: Duration,
    /// What is done when the run's accuracy is in doubt; `None` does not look.
    pub on_trouble: Option<OnTrouble>,
    /// When the program started, for `setup_time_s`.
    pub program_start: Instant,
}

/// What remains of a run.
pub struct Outcome {
    /// The last snapshot; the summary is made from it.
    pub snapshot: Arc<Snapshot>,
    /// All balls at the last instant in the scene's units and order, and the collisions of each; `None` if the engine panicked.
    pub balls: Option<(Placement, Vec<u64>)>,
}

/// A run on its own thread.
pub struct Worker {
    feed: LocalFeed,
    thread: JoinHandle<Option<(Placement, Vec<u64>)>>,
}

/// The feed of a run in this process.
#[derive(Clone)]
pub struct LocalFeed {
    latest: Slot,
    commands: mpsc::Sender<Command>,
}

/// Where the newest snapshot lies, and who is to be woken by it.
#[derive(Clone)]
struct Slot(Arc<Mutex<(Arc<Snapshot>, Option<UnixStream>)>>);

impl Slot {
    fn new(first: Snapshot) -> Self {
        Self(Arc::new(Mutex::new((Arc::new(first), None))))
    }

    fn lock(&self) -> MutexGuard<'_, (Arc<Snapshot>, Option<UnixStream>)> {
        (self.0.lock()).expect("nothing panics while it holds the slot")
    }

    fn get(&self) -> Arc<Snapshot> {
        Arc::clone(&self.lock().0)
    }

    fn put(&self, snapshot: Snapshot) {
        let mut slot = self.lock();
        slot.0 = Arc::new(snapshot);
        if let Some(waker) = &mut slot.1 {
            let _ = waker.write(&[1]); // full, or closed: nobody sleeps at the other end
        }
    }
}

impl LocalFeed {
    /// Has a byte written with each new snapshot, to one stream that must not block.
    pub fn wake_on_news(&self, waker: UnixStream) {
        self.latest.lock().1 = Some(waker);
    }
}

impl Worker {
    /// Starts a run; returns at once, with the first snapshot in phase `Starting`.
    ///
    /// # Panics
    /// If the system gives the process no second thread.
    pub fn start(scene: &Scene, placement: Placement, options: Options) -> Self {
        let origin = Arc::new(Origin::new(scene, &placement));
        Self::begin(origin, run::Begin::Placed(placement), options)
    }

    /// Goes on with a run from its checkpoint; `options` say by what engine and until when.
    ///
    /// # Panics
    /// If the system gives the process no second thread.
    pub fn resume(saved: SavedRun, options: Options) -> Self {
        let origin = Arc::clone(&saved.origin);
        Self::begin(origin, run::Begin::Saved(Box::new(saved)), options)
    }

    /// Shows a run that has ended as its checkpoint has it; `directory` is where its past is, if it is known.
    ///
    /// # Panics
    /// If the system gives the process no second thread.
    pub fn replay(saved: SavedRun, directory: Option<PathBuf>, program_start: Instant) -> Self {
        let options = Options {
            engine: saved.engine,
            until: saved.until,
            until_error: None,
            reversals: Vec::new(),
            series: None,
            trajectory: None,
            directory,
            replay: true,
            checkpoint_every: Duration::MAX,
            on_trouble: None,
            program_start,
        };
        Self::resume(saved, options)
    }

    fn begin(origin: Arc<Origin>, begin: run::Begin, options: Options) -> Self {
        quiet_engine_panics();
        let (commands, inbox) = mpsc::channel();
        let setting = run::Setting::new(origin, options);
        let latest = Slot::new(setting.first_snapshot());
        let slot = latest.clone();
        let body = move || {
            let run = AssertUnwindSafe(|| run::run(&setting, begin, &inbox, &slot));
            catch_unwind(run)
                .map_err(|panic| slot.put(failed(&slot.get(), &panic)))
                .ok()
        };
        let thread = Builder::new()
            .name(THREAD_NAME.into())
            .spawn(body)
            .expect("a process that has just started can start a thread");
        Self {
            feed: LocalFeed { latest, commands },
            thread,
        }
    }

    /// The run as watchers see it.
    pub fn feed(&self) -> LocalFeed {
        self.feed.clone()
    }

    /// Waits for the run to end (after `Command::Stop`, when `until` is reached, or on failure).
    ///
    /// A run that has reached `until` ends by itself; its last snapshot has phase `Finished`.
    ///
    /// # Panics
    /// Never: the engine's own panics end up in the last snapshot.
    pub fn join(self) -> Outcome {
        let balls = self
            .thread
            .join()
            .expect("the engine's panics are caught on its thread");
        Outcome {
            snapshot: self.feed.latest(),
            balls,
        }
    }
}

impl Feed for LocalFeed {
    fn latest(&self) -> Arc<Snapshot> {
        self.latest.get()
    }

    fn send(&self, command: Command) {
        // A run that has ended obeys nothing, and nothing is lost by that.
        let _ = self.commands.send(command);
    }
}

/// The last snapshot of a run whose engine panicked.
fn failed(last: &Snapshot, panic: &Box<dyn std::any::Any + Send>) -> Snapshot {
    let words = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or(panic.downcast_ref::<&str>().copied());
    let reason = format!(
        "the engine failed (a bug in moltop): {}",
        words.unwrap_or("no message")
    );
    tracing::error!("{reason}");
    Snapshot {
        phase: Phase::Failed(reason),
        sequence: last.sequence + 1,
        ..last.clone()
    }
}

/// Keeps the panic of an engine thread off the terminal: the snapshot carries its words.
fn quiet_engine_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if std::thread::current().name() != Some(THREAD_NAME) {
                before(panic);
            }
        }));
    });
}
