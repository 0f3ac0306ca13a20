//! The commands about runs of other processes: list, status, pause, resume, reverse, stop, watch, clean.

mod clean;

use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

use serde::Serialize;
use serde_json::Value;

use crate::error::{Error, Result};
use crate::feed::message::Ending;
use crate::feed::socket::SocketFeed;
use crate::feed::{Command, Feed};
use crate::headless;
use crate::quantity::{Quantity, duration, plain, quantity};
use crate::run::{say, tell};
use crate::run_directory::{EXIT, Found, SUMMARY};
use crate::signals::Signals;
use crate::snapshot::{NamedBall, Phase, Snapshot, Units};
use crate::summary::Measured;

pub use clean::clean;

/// How long a run has to obey a command.
const OBEYED: Duration = Duration::from_secs(10);

/// What is known of a run from outside.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Status {
    /// Name of the run.
    pub name: String,
    /// Its process, while it is going on.
    pub pid: Option<u32>,
    /// `starting`, `running`, `paused`, `finished`, `failed`, `stopped`; `silent` if its process does not answer, `killed` if
    /// it ended without a word.
    pub state: &'static str,
    /// Title of the scene.
    pub scene: Option<String>,
    /// Name of the engine.
    pub engine: Option<String>,
    /// Simulated time.
    pub time: Option<f64>,
    /// Simulated time at which it ends.
    pub until: Option<f64>,
    /// Wall-clock time spent running \[s\].
    pub wall_time_s: Option<f64>,
    /// Pair collisions per wall second: lately, or on the whole if the run has ended.
    pub collisions_per_wall_second: Option<f64>,
    /// Directory of the run.
    pub run_dir: PathBuf,
    #[serde(skip)]
    units: Units,
}

impl Status {
    /// Asks a run that is going on, or reads what one that has ended has left.
    pub fn of(run: &Found) -> Self {
        if run.is_going_on() {
            match SocketFeed::connect(run, true) {
                Ok(feed) => return Self::from_snapshot(run, &feed.latest()),
                Err(_) if run.is_going_on() => {
                    return Self {
                        pid: run.pid(),
                        ..Self::unknown(run, "silent")
                    };
                }
                Err(_) => {} // it has ended meanwhile
            }
        }
        Self::from_files(run)
    }

    fn unknown(run: &Found, state: &'static str) -> Self {
        Self {
            name: run.name.clone(),
            pid: None,
            state,
            scene: None,
            engine: None,
            time: None,
            until: None,
            wall_time_s: None,
            collisions_per_wall_second: None,
            run_dir: run.path.clone(),
            units: Units::default(),
        }
    }

    fn from_snapshot(run: &Found, snapshot: &Snapshot) -> Self {
        Self {
            pid: run.pid(),
            scene: Some(snapshot.scene.title.clone()),
            engine: Some(snapshot.engine.to_string()),
            time: Some(snapshot.time),
            until: snapshot.until,
            wall_time_s: Some(snapshot.wall_time_s),
            collisions_per_wall_second: snapshot.collisions_per_wall_second,
            units: snapshot.scene.units,
            ..Self::unknown(run, state(&snapshot.phase))
        }
    }

    fn from_files(run: &Found) -> Self {
        let Ok(exit) = fs::read_to_string(run.path.join(EXIT)) else {
            return Self::unknown(run, "killed");
        };
        let state = match exit.split_whitespace().nth(1) {
            Some("finished") => "finished",
            Some("quit" | "signal") => "stopped",
            _ => "failed",
        };
        let summary = fs::read(run.path.join(SUMMARY)).unwrap_or_default();
        let summary: Value = serde_json::from_slice(&summary).unwrap_or_default();
        let words = |value: &Value| value.as_str().map(str::to_owned);
        Self {
            scene: words(&summary["scene"]["title"]),
            engine: words(&summary["engine"]),
            time: summary["time"].as_f64(),
            until: summary["until"].as_f64(),
            wall_time_s: summary["wall_time_s"].as_f64(),
            collisions_per_wall_second: summary["collisions_per_wall_second"].as_f64(),
            units: serde_json::from_value(summary["scene"]["units"].clone()).unwrap_or_default(),
            ..Self::unknown(run, state)
        }
    }

    fn show(&self, value: Option<f64>, kind: Quantity) -> String {
        value.map_or_else(|| "–".to_owned(), |value| quantity(value, kind, self.units))
    }

    /// In words, a cell for each column of [`COLUMNS`].
    fn cells(&self) -> [String; 6] {
        [
            self.name.clone(),
            self.state.to_owned(),
            self.show(self.time, Quantity::Time),
            self.show(self.until, Quantity::Time),
            self.wall_time_s.map_or_else(|| "–".to_owned(), duration),
            (self.collisions_per_wall_second)
                .map_or_else(|| "–".to_owned(), |rate| format!("{}/s", plain(rate))),
        ]
    }
}

const COLUMNS: [&str; 6] = ["run", "state", "time", "until", "wall time", "collisions"];

fn state(phase: &Phase) -> &'static str {
    match phase {
        Phase::Starting => "starting",
        Phase::Running => "running",
        Phase::Paused => "paused",
        Phase::Finished => "finished",
        Phase::Failed(_) => "failed",
    }
}

/// All runs, those that are going on first, newest first.
///
/// # Errors
/// [`Error::File`] when the runs cannot be read.
pub fn list(json: bool) -> Result<String> {
    let mut runs = Found::all()?;
    runs.sort_by_key(|run| std::cmp::Reverse((run.is_going_on(), run.started())));
    let known: Vec<Status> = runs.iter().map(Status::of).collect();
    if json {
        return Ok(to_json(&known));
    }
    if known.is_empty() {
        say("there is no run: `moltop SCENE` starts one");
    }
    Ok(table(&known))
}

/// One run, by default the newest one that is going on.
///
/// # Errors
/// [`Error::Usage`] when there is no such run.
pub fn status(run: Option<&str>, json: bool) -> Result<String> {
    let run = run.map_or_else(Found::newest, Found::by_name)?;
    let known = Status::of(&run);
    if json {
        return Ok(to_json(&known));
    }
    let mut lines = vec![("scene", known.scene.clone().unwrap_or_default())];
    lines.extend(COLUMNS.into_iter().zip(known.cells()));
    lines.push(("engine", known.engine.clone().unwrap_or_default()));
    lines.push((
        "process",
        known
            .pid
            .map_or_else(|| "–".to_owned(), |pid| pid.to_string()),
    ));
    lines.push(("directory", known.run_dir.display().to_string()));
    let lines = lines
        .iter()
        .map(|(name, value)| format!("{name:<12}{value}\n"));
    Ok(lines.collect())
}

fn to_json(value: &impl Serialize) -> String {
    let mut text = serde_json::to_string_pretty(value).expect("plain data");
    text.push('\n');
    text
}

fn table(known: &[Status]) -> String {
    if known.is_empty() {
        return String::new();
    }
    let mut rows = vec![COLUMNS.map(str::to_owned)];
    rows.extend(known.iter().map(Status::cells));
    let width = |column: usize| {
        rows.iter()
            .map(|row| row[column].chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..COLUMNS.len()).map(width).collect();
    let line = |row: &[String; 6]| {
        let cells = row
            .iter()
            .zip(&widths)
            .map(|(cell, width)| format!("{cell:<width$}"));
        format!("{}\n", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

/// Has a run obey, and says when it has.
///
/// # Errors
/// [`Error::Usage`] when there is no such run, [`Error::Engine`] when it does not obey.
pub fn command(run: &str, command: Command) -> Result<u8> {
    let run = Found::by_name(run)?;
    let feed = SocketFeed::connect(&run, false)?;
    let before = feed.latest();
    let done = |now: &Snapshot| match command {
        Command::Pause => now.phase == Phase::Paused,
        Command::Resume => now.phase == Phase::Running,
        _ => now.reversed != before.reversed,
    };
    let words = match command {
        Command::Pause => "paused",
        Command::Resume => "runs",
        _ => "reversed",
    };
    feed.send(command);
    let obeyed = feed.wait_for(OBEYED, done).ok_or_else(|| {
        let name = &run.name;
        let state = state(&feed.latest().phase);
        Error::Engine(format!("{name}: does not obey: its state is {state}"))
    })?;
    let time = quantity(obeyed.time, Quantity::Time, obeyed.scene.units);
    say(&format!("{}: {words} at {time}", run.name));
    Ok(0)
}

/// Waits for a run that has been told to stop; a signal ends the wait.
///
/// # Errors
/// [`Error::Engine`] when its process is gone without a word, or a signal came first.
pub fn wait_for_end(feed: &SocketFeed, signals: &Signals) -> Result<Ending> {
    loop {
        if let Some(end) = feed.wait_for_end(Duration::from_millis(100)) {
            return end;
        }
        if signals.received().is_some() {
            return Err(Error::Engine("the run has not ended yet".to_owned()));
        }
    }
}

/// Ends runs in good order, and waits until they have written their results.
///
/// # Errors
/// [`Error::Usage`] when there is no such run, [`Error::Engine`] when it does not answer.
pub fn stop(runs: &[Found]) -> Result<u8> {
    let signals = Signals::listen()?;
    let feeds: Vec<Result<SocketFeed>> = runs
        .iter()
        .map(|run| SocketFeed::connect(run, false))
        .collect();
    for feed in feeds.iter().flatten() {
        feed.send(Command::Stop);
    }
    let mut code = 0;
    for feed in feeds {
        match feed.and_then(|feed| wait_for_end(&feed, &signals)) {
            Ok(ending) => code = code.max(tell(&ending)),
            Err(error) if runs.len() == 1 => return Err(error),
            Err(error) => {
                say(&format!("moltop: {error}"));
                code = 1;
            }
        }
    }
    Ok(code)
}

/// Prints how a run goes, a line now and then, until it ends; gives back its exit code.
///
/// # Errors
/// [`Error::Usage`] when there is no such run, [`Error::Engine`] when it does not answer or its process is gone.
pub fn watch(run: Option<&str>, jsonl: bool, every: Duration) -> Result<u8> {
    let run = run.map_or_else(Found::newest, Found::by_name)?;
    let feed = SocketFeed::connect(&run, true)?;
    let mut shown = None;
    let mut pause = Duration::ZERO;
    loop {
        let end = feed.wait_for_end(pause);
        let snapshot = feed.latest();
        if shown != Some(snapshot.sequence) {
            shown = Some(snapshot.sequence);
            let text = if jsonl {
                Line::text(&run, &snapshot, feed.was_stopped())
            } else {
                headless::line(&snapshot)
            };
            let mut stdout = io::stdout().lock();
            if writeln!(stdout, "{text}")
                .and_then(|()| stdout.flush())
                .is_err()
            {
                return Ok(0); // whoever read has seen enough
            }
        }
        if let Some(end) = end {
            return end.map(|ending| ending.code);
        }
        pause = every;
    }
}

/// A line of `moltop watch --jsonl`: what `status --json` has, and what is measured.
#[derive(Serialize)]
struct Line<'s> {
    #[serde(flatten)]
    status: Status,
    sequence: u64,
    reversed: bool,
    time_left_s: Option<(f64, f64)>,
    #[serde(flatten)]
    measured: Measured,
    queue_length: u64,
    peak_rss_bytes: Option<u64>,
    named_balls: &'s [NamedBall],
}

impl Line<'_> {
    fn text(run: &Found, snapshot: &Snapshot, was_stopped: bool) -> String {
        let mut status = Status::from_snapshot(run, snapshot);
        if was_stopped {
            status.state = "stopped";
        }
        let line = Line {
            status,
            sequence: snapshot.sequence,
            reversed: snapshot.reversed,
            time_left_s: snapshot.time_left_s,
            measured: Measured::of(snapshot),
            queue_length: snapshot.queue_length,
            peak_rss_bytes: snapshot.peak_rss_bytes,
            named_balls: &snapshot.named,
        };
        serde_json::to_string(&line).expect("plain data")
    }
}
