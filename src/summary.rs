//! What a run says of itself at its end: the summary file, and the same in a few lines for people.

use std::fmt::Write as _;
use std::io;

use serde::Serialize;
use serde_json::Serializer;
use serde_json::ser::{Formatter, PrettyFormatter};

use crate::quantity::{Quantity, duration, plain, quantity};
use crate::snapshot::{
    Check, Echo, NamedBall, Observed, Phase, Pressure, Snapshot, Speeds, Units, by_name,
};

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
    engine: &'s str,
    time: f64,
    until: Option<f64>,
    wall_time_s: f64,
    setup_time_s: Option<f64>,
    collisions_per_wall_second: Option<f64>,
    #[serde(flatten)]
    measured: Measured,
    accuracy: Vec<Check>,
    echo: Option<Echo>,
    echo_horizon: Option<f64>,
    speeds: Option<SpeedSummary<'s>>,
    queue_length: QueueLength,
    counters: Counters,
    peak_rss_bytes: Option<u64>,
    state_hash: Option<String>,
    #[serde(serialize_with = "by_name")]
    observables: &'s [Observed],
    named_balls: &'s [NamedBall],
    exit: String,
}

/// What is measured of the gas itself, at the end and on the way.
#[derive(Debug, Serialize)]
pub struct Measured {
    pair_collisions: u64,
    wall_collisions: u64,
    plane_collisions: u64,
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
}

impl Measured {
    /// As of a snapshot.
    pub fn of(snapshot: &Snapshot) -> Self {
        Self {
            pair_collisions: snapshot.counts.pair_collisions,
            wall_collisions: snapshot.counts.wall_collisions,
            plane_collisions: snapshot.counts.plane_collisions,
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
        }
    }
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
    remembered_events: u64,
    irreversible_starts: u64,
    steps: Option<u64>,
    audited_steps: Option<u64>,
    missed_collisions: Option<u64>,
    double_bounces: Option<u64>,
}

impl<'s> Summary<'s> {
    /// The summary of a run that ended with this snapshot.
    pub fn new(snapshot: &'s Snapshot, exit: &Exit) -> Self {
        let Snapshot { scene, counts, .. } = snapshot;
        // Over the whole run: the snapshot's own rate is of the last seconds, which says little of a run that is over.
        let per_wall_second = (snapshot.wall_time_s > 0.0 && counts.pair_collisions > 0)
            .then(|| counts.pair_collisions as f64 / snapshot.wall_time_s);
        let in_steps = |count: u64| (counts.steps > 0).then_some(count);
        Self {
            schema: SCHEMA,
            scene: SceneSummary {
                title: &scene.title,
                units: scene.units,
                ball_count: scene.ball_count,
                packing_fraction: scene.packing_fraction,
            },
            engine: &snapshot.engine,
            time: snapshot.time,
            until: snapshot.until,
            wall_time_s: snapshot.wall_time_s,
            setup_time_s: snapshot.setup_time_s,
            collisions_per_wall_second: per_wall_second,
            measured: Measured::of(snapshot),
            accuracy: snapshot.accuracy(),
            echo: snapshot.echo,
            echo_horizon: snapshot.echo_horizon,
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
                remembered_events: counts.remembered_events,
                irreversible_starts: counts.irreversible_starts,
                steps: in_steps(counts.steps),
                audited_steps: in_steps(counts.audited_steps),
                missed_collisions: in_steps(counts.missed_collisions)
                    .filter(|_| counts.audited_steps > 0),
                double_bounces: in_steps(counts.double_bounces),
            },
            peak_rss_bytes: snapshot.peak_rss_bytes,
            named_balls: &snapshot.named,
            observables: &snapshot.observables,
            state_hash: snapshot.state_hash.map(|hash| format!("{hash:016x}")),
            exit: exit.words(),
        }
    }
}

impl Summary<'_> {
    /// Writes the file.
    ///
    /// # Errors
    /// What the writer answers.
    pub fn write(&self, writer: &mut dyn io::Write) -> io::Result<()> {
        let mut serializer = Serializer::with_formatter(&mut *writer, OneKeyPerLine::default());
        self.serialize(&mut serializer)?;
        writer.write_all(b"\n")
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
            ..
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

/// One key a line, but a histogram's numbers on one line.
#[derive(Default)]
struct OneKeyPerLine(PrettyFormatter<'static>);

impl Formatter for OneKeyPerLine {
    fn begin_object<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.begin_object(writer)
    }

    fn end_object<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.end_object(writer)
    }

    fn begin_object_key<W: io::Write + ?Sized>(
        &mut self,
        writer: &mut W,
        first: bool,
    ) -> io::Result<()> {
        self.0.begin_object_key(writer, first)
    }

    fn begin_object_value<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.begin_object_value(writer)
    }

    fn end_object_value<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.end_object_value(writer)
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
    let end = show(Some(snapshot.time), Quantity::Time);
    line(
        "run",
        format!("{}: {} at {end}", snapshot.scene.title, exit.words()),
    );
    if snapshot.is_approximate() {
        line("engine", format!("{}, approximate", snapshot.engine));
    }
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
        virial, // a periodic box has no walls
        standard_error,
    } = snapshot.pressure;
    let expected = show(snapshot.expected.pressure, Quantity::Pressure);
    let (wall, error) = (
        show(wall.or(virial), Quantity::Pressure),
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
    for ball in &snapshot.named {
        let root = |squared: f64| show(Some(squared.sqrt()), Quantity::Length);
        let expected = ball.expected_displacement_squared.map_or_else(
            || "–".to_owned(),
            |expected| format!("{} root mean square", root(expected)),
        );
        let moved = root(ball.displacement_squared);
        line(&ball.name, format!("moved {moved} (theory {expected})"));
    }
    for figure in snapshot
        .observables
        .iter()
        .flat_map(|observable| &observable.figures)
    {
        let number = |value: Option<f64>| value.map_or("–".to_owned(), plain);
        let (value, error) = (number(figure.value), number(figure.standard_error));
        let (unit, expected) = (&figure.unit, number(figure.expected));
        let words = format!("{value} {unit} (standard error {error}; theory {expected})");
        line(&format!("{} ", figure.name), words.replace("  ", " "));
    }
    let drift = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.1e}"));
    line("energy drift", drift(snapshot.energy_drift));
    line("largest overlap", drift(snapshot.max_overlap));
    let counts = &snapshot.counts;
    if counts.steps > 0 {
        line("steps", counts.steps.to_string());
    }
    if snapshot.engine == "step" {
        line(
            "missed collisions",
            match counts.audited_steps {
                0 => "–".to_owned(),
                audited if audited < counts.steps => {
                    format!("{} in {audited} of the steps", counts.missed_collisions)
                }
                _ => counts.missed_collisions.to_string(),
            },
        );
        line("double bounces", counts.double_bounces.to_string());
    }
    text
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::snapshot::{Boundary, SceneCard};

    /// A run of which nothing is known yet.
    fn young() -> Snapshot {
        let scene = SceneCard {
            title: "Nothing yet".to_owned(),
            units: Units::Si,
            ball_count: 2,
            packing_fraction: 0.1,
            boundary: Boundary::Container,
            size: [1.0; 3],
            planes: Vec::new(),
            center: [0.0; 3],
            radius: 0.1,
            sample: 1.0,
        };
        Snapshot {
            state_hash: Some(0xab),
            ..Snapshot::starting(Arc::new(scene), "event", None)
        }
    }

    fn written(snapshot: &Snapshot, exit: &Exit) -> String {
        let mut bytes = Vec::new();
        Summary::new(snapshot, exit)
            .write(&mut bytes)
            .expect("memory takes all");
        String::from_utf8(bytes).expect("text")
    }

    #[test]
    fn what_does_not_exist_yet_is_null() {
        let json: serde_json::Value =
            serde_json::from_str(&written(&young(), &Exit::Signal(15))).expect("JSON");
        for key in [
            "temperature",
            "setup_time_s",
            "speeds",
            "max_overlap",
            "collisions_per_wall_second",
            "mean_free_path",
        ] {
            assert!(
                json.get(key).is_some_and(serde_json::Value::is_null),
                "{key}"
            );
        }
        assert!(json["pressure"]["wall"].is_null());
        assert_eq!(
            (json["exit"].as_str(), json["state_hash"].as_str()),
            (Some("signal 15"), Some("00000000000000ab"))
        );
    }

    #[test]
    fn a_histogram_takes_one_line() {
        let speeds = Speeds {
            bin_width: 0.5,
            counts: vec![1, 2],
            maxwell: vec![0.5, 2.5],
            ks: 0.1,
            ks_critical: 0.2,
            ..Speeds::default()
        };
        let snapshot = Snapshot {
            speeds: Some(Arc::new(speeds)),
            ..young()
        };
        assert!(
            written(&snapshot, &Exit::Quit)
                .contains("      \"counts\": [1,2],\n      \"maxwell\": [0.5,2.5]\n")
        );
    }

    #[test]
    fn a_failure_outweighs_a_signal_and_has_its_own_exit_code() {
        let failed = Snapshot {
            phase: Phase::Failed("a bug".to_owned()),
            ..young()
        };
        let exit = Exit::of(&failed, Exit::Signal(15));
        assert_eq!((exit.code(), exit.words()), (1, "failed: a bug".to_owned()));
        assert_eq!(Exit::of(&young(), Exit::Signal(15)).code(), 143);
    }

    #[test]
    fn the_lines_for_people_have_a_dash_for_what_does_not_exist() {
        assert!(for_people(&young(), &Exit::Quit).contains("temperature       –\n"));
    }
}
