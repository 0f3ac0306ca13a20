//! `moltop experiment extremes`: what happens at the edges of what numbers can do, one row per extreme, each with a verdict.
//!
//! A row runs gases directly and holds what it measures against thresholds that were fixed before the engines were written;
//! they are never loosened. A row that fails says by how much.
//!
//! Tier A takes a second or so per row and is part of the tests; tier B takes up to a minute per row; tier C is for releases.

mod corners;
mod dense;
mod fluid;
mod kernels;
mod mixed;
mod order;
mod oxygen;
mod report;
mod reversal;
mod sameness;
mod soak;
mod steps;
mod toys;
mod units;
mod verdict;

use std::panic::catch_unwind;
use std::path::PathBuf;
use std::process::Command;
use std::time::Instant;

use clap::{Args, ValueEnum};
use serde::Serialize;

use crate::error::{Error, Result};
use crate::experiment::progress::Progress;
pub use verdict::{Check, Outcome, Verdict};

/// How often a row is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, ValueEnum)]
pub enum Tier {
    /// With every change: a second or so
    #[value(name = "A", alias = "a")]
    A,
    /// Every night: up to a minute
    #[value(name = "B", alias = "b")]
    B,
    /// For a release: minutes
    #[value(name = "C", alias = "c")]
    C,
}

/// A row of the matrix, or a part of one that has its own tier.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Its number; parts of one row share it.
    pub number: u32,
    /// The extreme.
    pub title: &'static str,
    /// The engines that run it.
    pub engines: &'static str,
    /// How often it is run.
    pub tier: Tier,
    /// About how long it takes \[s\].
    pub expected_s: f64,
    /// Whether it watches the memory of its process, and so is given one in which no other row has left any.
    pub alone: bool,
    /// Runs it.
    pub run: fn() -> Verdict,
}

const fn row(
    number: u32,
    tier: Tier,
    expected_s: f64,
    engines: &'static str,
    title: &'static str,
    run: fn() -> Verdict,
) -> Row {
    Row {
        number,
        title,
        engines,
        tier,
        expected_s,
        alone: false,
        run,
    }
}

/// All rows, in the order of their numbers.
#[rustfmt::skip]
pub const ROWS: &[Row] = {
    use Tier::{A, B, C};
    const ALL: &str = "event, windowed, step, reversible";
    const EXACT: &str = "event, windowed, reversible";
    &[
        row(1, A, 1.0, ALL, "one ball, millions of bounces", toys::one_ball),
        row(2, A, 0.1, ALL, "two equal balls head on", toys::head_on),
        row(3, A, 1.0, "prediction", "a million pairs against twice the precision", kernels::random_pairs),
        row(4, A, 0.1, "prediction", "grazing pairs", kernels::grazing_pairs),
        row(5, A, 0.1, "prediction", "overlapping pairs", kernels::overlapping_pairs),
        row(6, A, 0.2, EXACT, "cradle of 5, 50, 1000 balls that touch", toys::cradle),
        row(7, A, 0.1, "event, windowed", "cradle at a scale of 0.3", toys::scaled_cradle),
        row(8, A, 2.0, "event", "Galperin's billiard, mass ratio to 1e12", toys::galperin),
        row(8, C, 20.0, "event", "Galperin's billiard, mass ratio 1e14", toys::galperin_far),
        row(9, A, 0.1, "event", "Galperin's billiard, oblique", toys::oblique_galperin),
        row(10, A, 0.1, "event", "caged lattice, gaps down to 1e-12", dense::caged),
        row(10, B, 3.0, "windowed", "caged lattice, gaps down to 1e-12, windowed", dense::caged_windowed),
        row(11, A, 0.1, "event, reversible", "caged lattice without room", dense::jammed),
        row(11, B, 1.0, "windowed", "caged lattice without room, windowed", dense::jammed_windowed),
        row(12, A, 0.5, ALL, "units times powers of two", units::powers_of_two),
        row(13, A, 1.0, "event, windowed", "SI against reduced units", units::si_and_reduced),
        row(14, A, 0.2, "event, windowed", "clock that started long ago", units::late_start),
        row(15, A, 0.1, "event, windowed", "box far from the origin", units::far_away),
        row(16, B, 3.0, "event", "a ball 1e12 times as heavy", mixed::heavy),
        row(17, B, 3.0, "event", "a ball 1e4 times as large", mixed::large).alone(),
        row(18, B, 60.0, "windowed", "packing fraction 1e-8", mixed::dilute),
        row(19, B, 80.0, "event", "fluid at packing fraction 0.49", dense::dense_fluid),
        row(20, B, 40.0, "event", "crystal at packing fraction 0.70", dense::crystal),
        row(21, A, 0.1, "event, step", "rest, one mover, one ball, none", corners::rest),
        row(22, A, 0.1, EXACT, "collisions at one instant", corners::simultaneous),
        row(23, A, 2.0, ALL, "corners, edges and flush starts", corners::corners),
        row(24, A, 4.0, "event, windowed", "a ball flush on a wall is struck", corners::struck_at_a_wall),
        row(25, A, 2.0, "event", "echo of the seed's scene", reversal::echo),
        row(26, A, 1.0, "reversible", "exact echo of the seed's scene", reversal::exact_echo),
        row(26, B, 2.0, "reversible", "exact echo of 64 balls over 2000 s", reversal::long_exact_echo),
        row(26, B, 20.0, "reversible", "exact echo of 15,625 balls, a hundred collisions each", reversal::large_exact_echo),
        row(27, B, 5.0, "event", "growth of the echo's error", reversal::growth),
        row(28, A, 2.0, ALL, "the same bits, however it is run", sameness::same_bits),
        row(29, C, 1800.0, "event", "a thousand million collisions", soak::soak).alone(),
        row(29, C, 300.0, "windowed", "a tenth of that, windowed", soak::soak_windowed).alone(),
        row(30, A, 3.0, ALL, "virial ledger", sameness::ledger),
        row(31, B, 200.0, "event", "equation of state", fluid::pressure),
        row(31, B, 5.0, "windowed", "equation of state and collision rate, windowed", fluid::windowed),
        row(32, B, 1.0, "event", "collision rate of the same runs", fluid::rate),
        row(33, B, 10.0, "event, step", "speeds from Maxwell's and from equal ones", fluid::speeds),
        row(34, B, 10.0, "event", "mixture, masses 1:16, radii 1:2", mixed::mixture),
        row(35, C, 60.0, "event", "diffusion", fluid::diffusion),
        row(36, B, 10.0, "windowed", "all of oxygen, 10 ps", oxygen::short).alone(),
        row(36, C, 120.0, "windowed", "all of oxygen, 1 ns and 1 ns more", oxygen::long).alone(),
        row(37, B, 10.0, "step", "laws of the step's errors", steps::laws),
        row(38, A, 2.0, "step", "collisions of engine step", steps::counts),
        row(39, A, 2.0, "event", "balls on a line", toys::line),
        row(40, B, 5.0, "event", "one bit of one velocity", reversal::one_bit),
        row(41, A, 1.0, "calendars", "calendars against an ordered map", order::calendars),
        row(42, A, 10.0, "event, windowed", "grids against all pairs", order::grids),
    ]
};

/// What the user asks for.
#[derive(Clone, Debug, Default, Args)]
pub struct Options {
    /// Only what takes up to a minute: tiers A and B
    #[arg(long)]
    pub quick: bool,
    /// Only these rows, by number
    #[arg(long = "row", value_name = "N", num_args = 1.., value_parser = clap::value_parser!(u32).range(1..=42))]
    pub rows: Vec<u32>,
    /// Only rows of this tier
    #[arg(long, value_name = "TIER")]
    pub tier: Option<Tier>,
    /// Only rows of this engine: event, windowed, reversible, step
    #[arg(long, value_name = "NAME", value_parser = ["event", "windowed", "reversible", "step"])]
    pub engine: Option<String>,
    /// Collisions of the soak, row 29; engine windowed runs a tenth of them
    #[arg(long, value_name = "N", default_value_t = 1_000_000_000, value_parser = clap::value_parser!(u64).range(20 * soak::WARM_UP..))]
    pub soak: u64,
    /// Write extremes.json and extremes.md into this directory
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Overwrite files that exist
    #[arg(long)]
    pub force: bool,
    /// Print JSON instead of a table
    #[arg(long)]
    pub json: bool,
}

impl Options {
    /// The rows asked for.
    pub fn rows(&self) -> Vec<&'static Row> {
        let wanted = |row: &&Row| {
            (self.rows.is_empty() || self.rows.contains(&row.number))
                && self.tier.is_none_or(|tier| row.tier == tier)
                && self
                    .engine
                    .as_ref()
                    .is_none_or(|name| row.engines.split(", ").any(|engine| engine == name))
                && !(self.quick && row.tier == Tier::C)
        };
        ROWS.iter().filter(wanted).collect()
    }
}

/// A row that was run.
#[derive(Clone, Debug, Serialize)]
pub struct Done {
    /// Its number.
    pub number: u32,
    /// The extreme.
    pub title: &'static str,
    /// The engines that run it.
    pub engines: &'static str,
    /// How often it is run.
    pub tier: Tier,
    /// What it comes to.
    pub outcome: Outcome,
    /// What it found.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// How long it took.
    pub wall_time_s: f64,
}

/// The name that tells a part of a row from the others: its number and tier, and its engines where that is not enough.
fn part(row: &Row) -> String {
    let Row { number, tier, .. } = row;
    let same = |other: &&Row| (other.number, other.tier) == (*number, *tier);
    if ROWS.iter().filter(same).count() > 1 {
        format!("{number} {tier:?} ({})", row.title)
    } else {
        format!("{number} {tier:?}")
    }
}

impl Row {
    const fn alone(self) -> Self {
        Self {
            alone: true,
            ..self
        }
    }

    /// Runs the row; a panic in it is a failure like any other.
    pub fn run(&self) -> Done {
        self.done(|| {
            catch_unwind(self.run).unwrap_or_else(|_| {
                let mut verdict = Verdict::default();
                verdict.holds("runs to its end", false, "yes, and it panicked");
                verdict
            })
        })
    }

    /// Runs the row in a process of its own.
    fn run_apart(&self, options: &Options) -> Done {
        self.done(|| {
            self.verdict_from_apart(options).unwrap_or_else(|why| {
                let mut verdict = Verdict::default();
                let required = format!("yes, in a process of its own: {why}");
                verdict.holds("runs to its end", false, &required);
                verdict
            })
        })
    }

    /// What another process finds; or why it finds nothing.
    fn verdict_from_apart(&self, options: &Options) -> std::result::Result<Verdict, String> {
        let program = std::env::current_exe().map_err(|error| error.to_string())?;
        let output = Command::new(program)
            .args(["experiment", "extremes", "--json"])
            .args(["--row", &self.number.to_string()])
            .args(["--tier", &format!("{:?}", self.tier)])
            .args(["--engine", self.engines])
            .args(["--soak", &options.soak.to_string()])
            .output()
            .map_err(|error| error.to_string())?;
        let words = || String::from_utf8_lossy(&output.stderr).trim().to_owned();
        let mut document: serde_json::Value =
            serde_json::from_slice(&output.stdout).map_err(|_| words())?;
        serde_json::from_value(document["rows"][0].take()).map_err(|error| error.to_string())
    }

    fn done(&self, run: impl FnOnce() -> Verdict) -> Done {
        let began = Instant::now();
        let verdict = run();
        Done {
            number: self.number,
            title: self.title,
            engines: self.engines,
            tier: self.tier,
            outcome: verdict.outcome(),
            verdict,
            wall_time_s: began.elapsed().as_secs_f64(),
        }
    }
}

/// Runs the rows asked for, tells as they finish, and gives the exit code: 1 if a row failed.
///
/// # Errors
/// [`Error::Usage`] when nothing is left to run or the outputs cannot be written.
pub fn run(options: &Options) -> Result<u8> {
    let rows = options.rows();
    if rows.is_empty() {
        return Err(Error::Usage(
            "no row is of that number, tier and engine".to_owned(),
        ));
    }
    soak::COLLISIONS.store(options.soak, std::sync::atomic::Ordering::Relaxed);
    let outputs = report::Outputs::new(options)?;
    let mut progress = Progress::new(rows.iter().map(|row| row.expected_s).sum())?;
    let mut done = Vec::new();
    for (index, row) in rows.iter().enumerate() {
        if progress.stopped() {
            break;
        }
        let (place, count, Row { number, title, .. }) = (index + 1, rows.len(), row);
        progress.tell(0.0, &format!("{place} of {count}: row {number}, {title}"));
        done.push(if row.alone && count > 1 {
            row.run_apart(options)
        } else {
            row.run()
        });
        progress.tell(row.expected_s, title);
        if !options.json {
            report::print_row(&done[index])?;
        }
    }
    let report = report::Report::new(&done);
    report.finish(options.json)?;
    outputs.write(&report)?;
    let failed = done.iter().any(|row| row.outcome == Outcome::Fail);
    Ok(progress.code().max(u8::from(failed)))
}
