//! What a run says of itself at its end: the summary file, and the same in a few lines for people.

use std::fmt::Write as _;

use serde::Serialize;

use crate::quantity::{Quantity, duration, quantity};
use crate::snapshot::{Phase, Pressure, Snapshot, Speeds, Units};

/// Name and version of the summary's format.
pub const SCHEMA: &str = "moltop.summary/1";

/// Why a run ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Exit {
    /// `until` was reached.
    Finished,
    /// The user left the dashboard.
    Quit,
    /// A signal asked the program to stop.
    Signal(i32),
    /// The engine stopped before its time; the text says why.
    Failed(String),
}

impl Exit {
    /// Exit code of the process: 128 and the signal's number after a signal, as shells have it.
    pub fn code(&self) -> u8 {
        match self {
            Self::Finished | Self::Quit => 0,
            Self::Signal(number) => 128 + u8::try_from(*number).unwrap_or(0),
            Self::Failed(_) => 1,
        }
    }

    /// As the summary says it: `finished`, `quit`, `signal 15`, `failed: why`.
    pub fn words(&self) -> String {
        match self {
            Self::Finished => "finished".to_owned(),
            Self::Quit => "quit".to_owned(),
            Self::Signal(number) => format!("signal {number}"),
            Self::Failed(why) => format!("failed: {why}"),
        }
    }

    /// What the last snapshot says outweighs why the program stopped waiting.
    pub fn of(snapshot: &Snapshot, otherwise: Self) -> Self {
        match &snapshot.phase {
            Phase::Finished => Self::Finished,
            Phase::Failed(why) => Self::Failed(why.clone()),
            _ => otherwise,
        }
    }
}

/// The summary file. `None` is written as `null`: the quantity does not exist.
#[derive(Debug, Serialize)]
pub struct Summary<'s> {
    schema: &'static str,
    scene: SceneSummary<'s>,
    engine: &'static str,
    time: f64,
    wall_time_s: f64,
    setup_time_s: Option<f64>,
    pair_collisions: u64,
    wall_collisions: u64,
    plane_collisions: u64,
    collisions_per_wall_second: Option<f64>,
    temperature: Option<f64>,
    kinetic_energy: f64,
    pressure: Pressure,
    compressibility_factor: Option<f64>,
    collision_rate: Option<f64>,
    mean_free_path: Option<f64>,
    energy_drift: Option<f64>,
    momentum_drift: Option<f64>,
    virial_residual: Option<f64>,
    max_overlap: Option<f64>,
    speeds: Option<SpeedSummary<'s>>,
    queue_length: QueueLength,
    counters: Counters,
    peak_rss_bytes: Option<u64>,
    state_hash: Option<String>,
    exit: String,
}

#[derive(Debug, Serialize)]
struct SceneSummary<'s> {
    title: &'s str,
    units: Units,
    ball_count: usize,
    packing_fraction: f64,
}

#[derive(Debug, Serialize)]
struct SpeedSummary<'s> {
    histogram: Histogram<'s>,
    ks: f64,
    ks_critical: f64,
}

#[derive(Debug, Serialize)]
struct Histogram<'s> {
    bin_width: f64,
    counts: &'s [u64],
    maxwell: &'s [f64],
}

#[derive(Debug, Serialize)]
struct QueueLength {
    now: u64,
    max: u64,
}

#[derive(Debug, Serialize)]
struct Counters {
    cell_crossings: u64,
    stale_events: u64,
    late_events: u64,
    ties: u64,
    zero_time_events: u64,
}

impl<'s> Summary<'s> {
    /// The summary of a run that ended with this snapshot.
    pub fn new(snapshot: &'s Snapshot, exit: &Exit) -> Self {
        let Snapshot { scene, counts, .. } = snapshot;
        // Over the whole run: the snapshot's own rate is of the last seconds, which says little of a run that is over.
        let per_wall_second = (snapshot.wall_time_s > 0.0 && counts.pair_collisions > 0)
            .then(|| counts.pair_collisions as f64 / snapshot.wall_time_s);
        Self {
            schema: SCHEMA,
            scene: SceneSummary {
                title: &scene.title,
                units: scene.units,
                ball_count: scene.ball_count,
                packing_fraction: scene.packing_fraction,
            },
            engine: snapshot.engine,
            time: snapshot.time,
            wall_time_s: snapshot.wall_time_s,
            setup_time_s: snapshot.setup_time_s,
            pair_collisions: counts.pair_collisions,
            wall_collisions: counts.wall_collisions,
            plane_collisions: counts.plane_collisions,
            collisions_per_wall_second: per_wall_second,
            temperature: snapshot.temperature,
            kinetic_energy: snapshot.kinetic_energy,
            pressure: snapshot.pressure,
            compressibility_factor: snapshot.compressibility_factor,
            collision_rate: snapshot.collision_rate,
            mean_free_path: snapshot.mean_free_path,
            energy_drift: snapshot.energy_drift,
            momentum_drift: snapshot.momentum_drift,
            virial_residual: snapshot.virial_residual,
            max_overlap: snapshot.max_overlap,
            speeds: snapshot.speeds.as_deref().map(SpeedSummary::new),
            queue_length: QueueLength {
                now: snapshot.queue_length,
                max: snapshot.queue_length_max,
            },
            counters: Counters {
                cell_crossings: counts.cell_crossings,
                stale_events: counts.stale_events,
                late_events: counts.late_events,
                ties: counts.ties,
                zero_time_events: counts.zero_time_events,
            },
            peak_rss_bytes: snapshot.peak_rss_bytes,
            state_hash: snapshot.state_hash.map(|hash| format!("{hash:016x}")),
            exit: exit.words(),
        }
    }
}

impl<'s> SpeedSummary<'s> {
    fn new(speeds: &'s Speeds) -> Self {
        let Speeds {
            bin_width,
            counts,
            maxwell,
            ks,
            ks_critical,
        } = speeds;
        Self {
            histogram: Histogram {
                bin_width: *bin_width,
                counts,
                maxwell,
            },
            ks: *ks,
            ks_critical: *ks_critical,
        }
    }
}

/// The summary in a few lines for people.
pub fn for_people(snapshot: &Snapshot, exit: &Exit) -> String {
    let units = snapshot.scene.units;
    let show = |value: Option<f64>, kind: Quantity| {
        value.map_or("–".to_owned(), |value| quantity(value, kind, units))
    };
    let mut text = String::new();
    let mut line =
        |name: &str, value: String| writeln!(text, "{name:<18}{value}").expect("memory takes all");
    line(
        "run",
        format!(
            "{}: {} of {}",
            exit.words(),
            show(Some(snapshot.time), Quantity::Time),
            snapshot.scene.title
        ),
    );
    line("wall time", duration(snapshot.wall_time_s));
    line(
        "pair collisions",
        snapshot.counts.pair_collisions.to_string(),
    );
    line(
        "wall collisions",
        snapshot.counts.wall_collisions.to_string(),
    );
    line(
        "temperature",
        show(snapshot.temperature, Quantity::Temperature),
    );
    let Pressure {
        wall,
        standard_error,
        ..
    } = snapshot.pressure;
    let expected = show(snapshot.expected.pressure, Quantity::Pressure);
    let (wall, error) = (
        show(wall, Quantity::Pressure),
        show(standard_error, Quantity::Pressure),
    );
    line(
        "pressure",
        format!("{wall} (standard error {error}; theory {expected})"),
    );
    line(
        "mean free path",
        show(snapshot.mean_free_path, Quantity::Length),
    );
    let drift = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.1e}"));
    line("energy drift", drift(snapshot.energy_drift));
    line("largest overlap", drift(snapshot.max_overlap));
    text
}
