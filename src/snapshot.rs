//! What leaves the engine thread: one plain value that screens, summaries and files are made from.
//!
//! All quantities are in the scene's units unless the name says otherwise (`_s` is wall-clock seconds). A quantity that does
//! not exist yet is `None`, never zero or NaN.

mod accuracy;
mod observables;

use std::borrow::Cow;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

pub use accuracy::Check;
pub use observables::{Column, Curve, Figure, ObservableName, Observed, by_name};

pub use crate::history::{History, Observable, Range, Stretch};

/// The unit system of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Units {
    /// Metre, second, kilogram, kelvin; k = 1.380649e-23 J/K.
    Si,
    /// The scene's own length, time and mass; k = 1.
    #[default]
    Reduced,
}

impl Units {
    /// Boltzmann's constant in these units. Source: the SI brochure, 9th edition (exact).
    pub fn boltzmann(self) -> f64 {
        match self {
            Self::Si => 1.380_649e-23,
            Self::Reduced => 1.0,
        }
    }
}

/// What happens at the faces of the box.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Boundary {
    /// Six hard walls.
    Container,
    /// What leaves through a face comes in through the opposite one.
    Periodic,
    /// Nothing: the box only says where the balls begin.
    #[default]
    Open,
}

/// What does not change during a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneCard {
    /// The scene's title.
    pub title: String,
    /// Unit system of every quantity in the snapshot.
    pub units: Units,
    /// Number of balls.
    pub ball_count: usize,
    /// Volume of the balls over the volume of the domain.
    pub packing_fraction: f64,
    /// What happens at the faces of the box.
    pub boundary: Boundary,
    /// Edges of the box \[length\].
    pub size: [f64; 3],
    /// Planes inside the box: unit normal, and distance from the centre along it \[length\].
    pub planes: Vec<([f64; 3], f64)>,
    /// Centre of the domain in the scene's coordinates \[length\].
    pub center: [f64; 3],
    /// Largest ball radius \[length\].
    pub radius: f64,
    /// Simulated time between two rows of the series \[time\].
    pub sample: f64,
}

/// What the run is doing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Phase {
    /// Placing balls and predicting the first events.
    Starting,
    /// The engine advances.
    Running,
    /// Waiting for a command.
    Paused,
    /// `until` was reached.
    Finished,
    /// The engine stopped before its time; the text says why.
    Failed(String),
}

/// Collisions and engine events since the start of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Ball-ball collisions.
    pub pair_collisions: u64,
    /// Collisions of a ball with a container wall.
    pub wall_collisions: u64,
    /// Collisions of a ball with a plane.
    pub plane_collisions: u64,
    /// Entries into a cell.
    pub cell_crossings: u64,
    /// Queued collisions found outdated when their turn came.
    pub stale_events: u64,
    /// Collisions that were due before the moment they were found.
    pub late_events: u64,
    /// Collisions at exactly the time of the collision before.
    pub ties: u64,
    /// Collisions of a ball at exactly the time of its own collision before.
    pub zero_time_events: u64,
    /// Engine `reversible`: collisions that had to be remembered for the way back, because others shared their instant.
    pub remembered_events: u64,
    /// Engine `reversible`: balls that overlapped or touched at the start, which a reversed run cannot tell.
    pub irreversible_starts: u64,
    /// Steps of engine `step`; zero with the others.
    pub steps: u64,
    /// Steps in which missed collisions were looked for.
    pub audited_steps: u64,
    /// Pairs that met and parted again within an audited step, and so did not collide.
    pub missed_collisions: u64,
    /// Collisions of a pair that had not parted since its last one.
    pub double_bounces: u64,
}

/// Pressure by two routes, averaged over the settled part of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pressure {
    /// Momentum given to the walls per time and physical wall area.
    pub wall: Option<f64>,
    /// From the virial of the pair collisions, on the volume open to the centres.
    pub virial: Option<f64>,
    /// Standard error of `wall` from block averages.
    pub standard_error: Option<f64>,
}

/// What kinetic theory expects of this scene at its measured temperature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// Force per physical wall area.
    pub pressure: Option<f64>,
    /// Pair collisions of the whole gas per simulated time.
    pub pair_rate: Option<f64>,
    /// Wall collisions of the whole gas per simulated time.
    pub wall_rate: Option<f64>,
}

/// Speed histogram against Maxwell's distribution at the measured temperature.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Speeds {
    /// Width of a bin \[speed\]; bin `i` holds speeds in `[i, i + 1) * bin_width`, the last one also everything faster.
    pub bin_width: f64,
    /// Balls per bin.
    pub counts: Vec<u64>,
    /// Balls per bin that Maxwell's distribution expects.
    pub maxwell: Vec<f64>,
    /// Kolmogorov-Smirnov distance between measured and Maxwell's cumulative distribution, at the bin edges.
    pub ks: f64,
    /// The distance that one run in a thousand exceeds by chance, `1.949 / sqrt(n)`.
    pub ks_critical: f64,
    /// Balls per bin of each velocity component, over bins of `component_bin_width` that lie even about zero.
    pub components: [Vec<u64>; 3],
    /// Balls per bin that the normal distribution expects of each.
    pub normal: Vec<f64>,
    /// Width of those bins \[speed\].
    pub component_bin_width: f64,
    /// Kolmogorov-Smirnov distance of each component from the normal distribution, at the bin edges.
    pub component_ks: [f64; 3],
}

/// How far a reversed run has found its way back.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Echo {
    /// Simulated time at which time was reversed.
    pub turned_at: f64,
    /// Share of the way back that has been run, from 0 to 1.
    pub retraced: f64,
    /// Mean distance of the balls from where they started, in largest diameters; `None` until the run is back there.
    pub error: Option<f64>,
}

/// A bounded sample of the balls for the picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Positions relative to the domain's centre \[length\], in an order that any prefix is a fair sample of the whole.
    /// The same index is the same ball in every snapshot.
    pub positions: Vec<[f32; 3]>,
    /// Radii of the same balls \[length\].
    pub radii: Vec<f32>,
    /// Names of the first entries, if the scene names balls; these are drawn tagged.
    pub names: Vec<String>,
}

/// Something that went to the run's log as a warning or worse.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Warning {
    /// Wall time of the run when it was noticed, pauses excluded.
    pub wall_time_s: f64,
    /// What was said.
    pub words: String,
}

/// A ball that the scene names, and how far it has come.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NamedBall {
    /// Its name.
    pub name: String,
    /// Where it is, in the scene's coordinates; in a periodic box as if it had never been moved back \[length\].
    pub position: [f64; 3],
    /// Square of its distance from where it started \[length^2\].
    pub displacement_squared: f64,
    /// Mean of that over all courses of events, for a heavy ball in a periodic gas (Langevin).
    pub expected_displacement_squared: Option<f64>,
}

/// Everything a screen or a summary may know of a run at one moment.
///
/// The large parts that rarely change are not serialised with it: between processes they travel only when they are new.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Grows by one with each snapshot.
    pub sequence: u64,
    /// What does not change.
    #[serde(skip)]
    pub scene: Arc<SceneCard>,
    /// Name of the engine, as `--engine` takes it.
    pub engine: Cow<'static, str>,
    /// What the run is doing.
    pub phase: Phase,
    /// Whether time runs backwards (an odd number of reversals).
    pub reversed: bool,
    /// Simulated time run so far; it grows also after a reversal.
    pub time: f64,
    /// Simulated time at which the run ends; `None` runs for ever.
    pub until: Option<f64>,
    /// Wall-clock time spent running, pauses excluded.
    pub wall_time_s: f64,
    /// From the program's start to the first event.
    pub setup_time_s: Option<f64>,
    /// Simulated time per wall second, lately.
    pub time_rate: Option<f64>,
    /// Ceiling on `time_rate` chosen by the user.
    pub time_rate_limit: Option<f64>,
    /// Pair collisions per wall second, lately.
    pub collisions_per_wall_second: Option<f64>,
    /// Wall seconds left: a low and a high estimate.
    pub time_left_s: Option<(f64, f64)>,
    /// Standard error of the pressure over the pressure at which the run ends, if it does.
    pub until_error: Option<f64>,
    /// Standard error of the pressure over the pressure, now.
    pub pressure_error: Option<f64>,
    /// Wall seconds until `until_error` is reached: a low and a high estimate.
    pub error_left_s: Option<(f64, f64)>,
    /// Collisions and events so far.
    pub counts: Counts,
    /// Temperature from the kinetic energy, `2 K / (3 N k)`.
    pub temperature: Option<f64>,
    /// Kinetic energy.
    pub kinetic_energy: f64,
    /// Pressure, averaged over the settled part of the run.
    pub pressure: Pressure,
    /// `P V / (N k T)` from the wall pressure and the physical volume.
    pub compressibility_factor: Option<f64>,
    /// Pair collisions of one ball per simulated time, averaged over the settled part of the run.
    pub collision_rate: Option<f64>,
    /// Pair collisions of the whole gas per simulated time, averaged likewise.
    pub pair_rate: Option<f64>,
    /// Wall collisions of the whole gas per simulated time, averaged likewise.
    pub wall_rate: Option<f64>,
    /// Path a ball flies between two pair collisions \[length\].
    pub mean_free_path: Option<f64>,
    /// What kinetic theory expects.
    pub expected: Expected,
    /// Kinetic energy now over that at the start, minus one.
    pub energy_drift: Option<f64>,
    /// Change of total momentum not explained by the walls, relative to the sum of all momenta.
    pub momentum_drift: Option<f64>,
    /// How far the virial ledger is from closing, relative to `2 K t`.
    pub virial_residual: Option<f64>,
    /// Largest overlap at a collision, relative to the contact distance; `None` before the first pair collision.
    pub max_overlap: Option<f64>,
    /// How far a reversed run has found back; `None` unless it has been reversed.
    pub echo: Option<Echo>,
    /// Simulated time after which a reversal no longer finds back, through rounding; `None` if that is not known, or if the
    /// engine is exact.
    pub echo_horizon: Option<f64>,
    /// Speed histogram, refreshed every few seconds.
    #[serde(skip)]
    pub speeds: Option<Arc<Speeds>>,
    /// Events in the queue, on the mean since the snapshot before; in the last snapshot of a run, at its end.
    pub queue_length: u64,
    /// Most events ever in the queue.
    pub queue_length_max: u64,
    /// Simulated time of the newest checkpoint on the disk.
    pub last_checkpoint: Option<f64>,
    /// Checkpoints that this process has written.
    pub checkpoints: u64,
    /// What the user should know although the run goes on, such as a checkpoint that could not be written.
    pub notice: Option<String>,
    /// The newest warnings of the run's log, oldest first.
    pub warnings: Vec<Warning>,
    /// Simulated times that watchers have marked.
    pub marks: Vec<f64>,
    /// How many processes watch; `None` where the run is in the watcher's own.
    pub watchers: Option<u32>,
    /// Largest resident memory of the process so far.
    pub peak_rss_bytes: Option<u64>,
    /// Hash of time and state, synchronised; only in the last snapshot of a run.
    pub state_hash: Option<u64>,
    /// The balls that the scene names.
    pub named: Vec<NamedBall>,
    /// What the scene asks to be observed, refreshed every few seconds.
    #[serde(skip)]
    pub observables: Arc<Vec<Observed>>,
    /// The run's history, in constant memory.
    #[serde(skip)]
    pub history: Arc<History>,
    /// The run as it was at the past moment that [`crate::feed::Command::Goto`] asked for, or on its way there: until it is
    /// in phase `Finished` it has yet to come to its `until`.
    #[serde(skip)]
    pub past: Option<Arc<Snapshot>>,
    /// Balls for the picture; `None` while nobody watches.
    #[serde(skip)]
    pub sample: Option<Arc<Sample>>,
}

impl Snapshot {
    /// What an observable has found, if it is observed.
    pub fn observed(&self, name: ObservableName) -> Option<&Observed> {
        let mut all = self.observables.iter();
        all.find(|observed| observed.name == name.key())
    }

    /// The snapshot of a run that has not begun.
    pub fn starting(scene: Arc<SceneCard>, engine: &'static str, until: Option<f64>) -> Self {
        Self {
            sequence: 0,
            scene,
            engine: Cow::Borrowed(engine),
            phase: Phase::Starting,
            reversed: false,
            time: 0.0,
            until,
            wall_time_s: 0.0,
            setup_time_s: None,
            time_rate: None,
            time_rate_limit: None,
            collisions_per_wall_second: None,
            time_left_s: None,
            until_error: None,
            pressure_error: None,
            error_left_s: None,
            counts: Counts::default(),
            temperature: None,
            kinetic_energy: 0.0,
            pressure: Pressure::default(),
            compressibility_factor: None,
            collision_rate: None,
            pair_rate: None,
            wall_rate: None,
            mean_free_path: None,
            expected: Expected::default(),
            energy_drift: None,
            momentum_drift: None,
            virial_residual: None,
            max_overlap: None,
            echo: None,
            echo_horizon: None,
            speeds: None,
            queue_length: 0,
            queue_length_max: 0,
            last_checkpoint: None,
            checkpoints: 0,
            notice: None,
            warnings: Vec::new(),
            marks: Vec::new(),
            watchers: None,
            peak_rss_bytes: None,
            state_hash: None,
            named: Vec::new(),
            observables: Arc::default(),
            history: Arc::default(),
            past: None,
            sample: None,
        }
    }
}

/// One row of the series file, at a multiple of the scene's `sample`.
///
/// Pressures are averages over the interval since the row before; counts cover the whole run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SeriesRow {
    /// Simulated time.
    pub time: f64,
    /// Wall-clock time spent running.
    pub wall_time_s: f64,
    /// Temperature.
    pub temperature: Option<f64>,
    /// Wall pressure over the interval.
    pub pressure_wall: Option<f64>,
    /// Virial pressure over the interval.
    pub pressure_virial: Option<f64>,
    /// Ball-ball collisions so far.
    pub pair_collisions: u64,
    /// Wall collisions so far.
    pub wall_collisions: u64,
    /// Events in the queue.
    pub queue_length: u64,
    /// Largest overlap so far, relative to the contact distance.
    pub max_overlap: Option<f64>,
    /// Kinetic energy over that at the start, minus one.
    pub energy_drift: Option<f64>,
}
