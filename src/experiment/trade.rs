//! `moltop experiment trade`: what each setting costs on a scene of the user's, and what it gets wrong.
//!
//! All settings start from the same settled gas (`settle`) and run on the clock. Speed and averages are from the same run; averages are
//! held against an exact engine that ran longer, each with its noise. Trajectories are held against twice the precision on a
//! part of the gas. The recommendation is read off the measurements. With `--out`, what is known of finished settings is kept
//! there, and an interrupted experiment goes on with the next one.

mod settings;
mod settle;
mod statistics;
mod tables;
mod trajectories;
mod verdict;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::experiment::kept::Kept;
use crate::experiment::page::{Options as Common, Outputs, Page};
use crate::experiment::progress::Progress;
use crate::quantity::{Quantity, duration, plain, quantity};
use crate::run::{load, say};
use crate::scene::Scene;
use crate::state::Placement;
use crate::worker::engines::{Accuracy, Choice, EngineName, Wishes, thermal_speed};
use settings::{Setting, Settings};
use settle::Start;
use statistics::{Limits, Measured, measure};
use trajectories::{Faith, Judge, LOOKS, TURNS};
use verdict::{Promise, Row};

/// Mean free times over which displacements are measured.
const WINDOW: f64 = 4.0;

/// How much longer the reference runs than the others.
const REFERENCE: f64 = 3.0;

/// Seconds for each setting.
const SECONDS: f64 = 15.0;

/// The same with `--quick`.
const QUICK_SECONDS: f64 = 1.0;

/// Most balls that are followed one by one; twice the precision looks at all pairs.
const MOST_FOLLOWED: usize = 1000;

/// The same with `--quick`.
const QUICK_FOLLOWED: usize = 300;

/// Seconds that following single balls may always take.
const LEAST_FOLLOWING: f64 = 1.0;

/// What the user asks for.
#[derive(Clone, Debug, Default, Args)]
#[group(skip)]
pub struct Options {
    /// Scene file [default: oxygen near standard conditions]
    pub scene: Option<PathBuf>,
    /// What every experiment is asked.
    #[command(flatten)]
    pub common: Common,
    /// Seconds for each setting [default: 15, or 1 with --quick]; the noise falls with its root
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub seconds: Option<f64>,
    /// Compare these engines only; the fastest exact one is always there
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub engines: Vec<EngineName>,
    /// Threads that settings with several use [default: one for each core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=64))]
    pub threads: Option<u16>,
}

fn seconds(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.01..=1e5).contains(&value) => Ok(value),
        _ => Err("must be from 0.01 to 100000".to_owned()),
    }
}

/// What is kept of an experiment that is not finished.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Unfinished {
    start: Start,
    settings: Vec<Finished>,
}

/// What one setting has shown.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Finished {
    choice: Choice,
    measured: Measured,
    faith: Option<Faith>,
}

/// Runs the experiment; gives the exit code.
///
/// # Errors
/// When the scene is no good or results cannot be written.
pub fn run(options: &Options) -> Result<u8> {
    let scene = load(options.scene.as_ref())?;
    let quick = options.common.quick;
    let budget = (options.seconds).unwrap_or(if quick { QUICK_SECONDS } else { SECONDS });
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let several = options.threads.map_or_else(cores, usize::from);
    let most = if quick { QUICK_FOLLOWED } else { MOST_FOLLOWED };
    let what = format!("{} {several} {most}\n{}", budget.to_bits(), scene.source);
    let kept = Kept::new(options.common.out.as_deref(), "trade", &what);
    let unfinished: Option<Unfinished> = kept.load(options.common.force)?;
    let outputs = Outputs::new(
        "trade",
        &Common {
            // What an interrupted run has written is replaced by what the whole one has.
            force: options.common.force || unfinished.is_some(),
            ..options.common.clone()
        },
        &[
            "settling", "settings", "numbers", "faith", "accuracy", "refused",
        ],
        &["pressure", "trajectories"],
    )?;
    let mut progress = Progress::new(budget * (REFERENCE + 1.0))?;
    let mut known = if let Some(unfinished) = unfinished {
        unfinished
    } else {
        let fresh = Unfinished {
            start: start(&scene, several, budget, &mut progress)?,
            settings: Vec::new(),
        };
        if !progress.stopped() {
            kept.store(&fresh)?;
        }
        fresh
    };
    if !known.settings.is_empty() {
        say(&format!(
            "{} settings were measured before and are taken over",
            known.settings.len()
        ));
    }
    let start = known.start.clone();
    let promises: Vec<_> = Accuracy::value_variants()
        .iter()
        .map(|&accuracy| (accuracy, chosen(accuracy, &start.gas, scene.seed)))
        .collect();
    let choices = promises.iter().map(|promise| promise.1);
    let settings = Settings::of(&start.gas, several, scene.seed)
        .with(choices, &start.gas)
        .only(&options.engines);
    let count = settings.allowed.len() as f64;
    progress.expect(budget * (count + REFERENCE + 1.0));
    let judge = Judge::new(&start.gas, start.free_time, most);
    let allowed = settings.allowed;
    let mut rows = measure_all(
        allowed,
        &mut known,
        &kept,
        (judge.as_ref(), budget),
        &mut progress,
    )?;
    verdict::mark(&mut rows);
    let promises: Vec<Promise> = promises
        .iter()
        .map(|(accuracy, choice)| {
            let row = rows.iter().find(|row| row.setting.choice == *choice);
            verdict::promise(*accuracy, name_of(*accuracy), row)
        })
        .collect();
    let mut page = Page {
        name: "trade",
        title: "Speed against accuracy",
        command: command(options),
        tables: vec![
            tables::settling(&start),
            tables::averages(&rows, scene.units),
            tables::numbers(&rows),
            tables::faith(&rows),
            tables::accuracies(&promises),
            tables::refused(&settings.refused),
        ],
        paragraphs: paragraphs(&scene, &start, &rows, judge.as_ref(), budget),
        plots: vec![
            tables::pressure_plot(&rows, scene.units),
            tables::trajectory_plot(&rows, scene.units),
        ],
    };
    page.tables.retain(|table| !table.rows.is_empty());
    if progress.stopped() {
        page.paragraphs.push(kept.interrupted().to_owned());
    }
    outputs.finish(&page)?;
    if !progress.stopped() {
        kept.remove();
    }
    Ok(progress.code())
}

/// Measures the settings that are not known yet, and keeps each as soon as it is.
fn measure_all(
    settings: Vec<Setting>,
    known: &mut Unfinished,
    kept: &Kept,
    (judge, budget): (Option<&Judge>, f64),
    progress: &mut Progress,
) -> Result<Vec<Row>> {
    let mut rows: Vec<Row> = Vec::new();
    let mut reference: Option<Measured> = None;
    for setting in settings {
        let first = reference.is_none();
        let limits = Limits {
            budget: if first { REFERENCE * budget } else { budget },
            free_time: known.start.free_time,
            window: WINDOW,
        };
        let mut before = known.settings.iter();
        let before = before.find(|finished| finished.choice == setting.choice);
        let finished = if let Some(finished) = before {
            progress.already(limits.budget);
            finished.clone()
        } else if progress.stopped() {
            break;
        } else {
            let finished = run_setting(&setting, &known.start, limits, judge, progress);
            if !progress.stopped() {
                known.settings.push(finished.clone());
                kept.store(known)?;
            }
            finished
        };
        let Finished {
            measured, faith, ..
        } = finished;
        let reference = reference.get_or_insert_with(|| measured.clone());
        rows.push(Row::new(setting, measured, reference, faith));
    }
    Ok(rows)
}

/// The settled gas of a scene.
fn start(scene: &Scene, threads: usize, budget: f64, progress: &mut Progress) -> Result<Start> {
    let placed = scene.place()?;
    if placed.positions.is_empty() || thermal_speed(&placed) <= 0.0 {
        let words = "experiment trade: nothing moves in this scene: there is nothing to trade";
        return Err(Error::Usage(words.to_owned()));
    }
    Ok(Start::settle(scene, &placed, threads, budget, progress))
}

/// Measures a setting, and follows its balls if there is time for that.
fn run_setting(
    setting: &Setting,
    start: &Start,
    limits: Limits,
    judge: Option<&Judge>,
    progress: &mut Progress,
) -> Finished {
    let measured = measure(setting.choice, &start.gas, limits, &setting.name, progress);
    let faith = judge.filter(|judge| {
        // A part of the balls takes about that part of the time.
        let share = judge.balls() as f64 / start.gas.positions.len() as f64;
        let expected = judge.time() / measured.speed() * share;
        let follows = !matches!(setting.choice, Choice::Statistical { .. });
        follows && expected < (2.0 * limits.budget).max(LEAST_FOLLOWING) && !progress.stopped()
    });
    Finished {
        choice: setting.choice,
        faith: faith.and_then(|judge| judge.judge(setting.choice)),
        measured,
    }
}

fn command(options: &Options) -> String {
    let mut command = "moltop experiment trade".to_owned();
    if let Some(scene) = &options.scene {
        command = format!("{command} {}", scene.display());
    }
    if options.common.quick {
        command.push_str(" --quick");
    }
    if !options.engines.is_empty() {
        let names = options
            .engines
            .iter()
            .filter_map(ValueEnum::to_possible_value);
        let names: Vec<String> = names.map(|name| name.get_name().to_owned()).collect();
        command = format!("{command} --engines {}", names.join(","));
    }
    if let Some(seconds) = options.seconds {
        command = format!("{command} --seconds {seconds}");
    }
    command
}

/// What `--accuracy` chooses on one thread.
fn chosen(accuracy: Accuracy, gas: &Placement, seed: u64) -> Choice {
    let wishes = Wishes {
        accuracy: Some(accuracy),
        threads: Some(1),
        seed,
        ..Wishes::default()
    };
    Choice::new(&wishes, gas).unwrap_or_default()
}

fn name_of(accuracy: Accuracy) -> &'static str {
    match accuracy {
        Accuracy::Exact => "exact",
        Accuracy::Tenth => "0.1%",
        Accuracy::One => "1%",
        Accuracy::Ten => "10%",
    }
}

/// What is said beside the tables.
fn paragraphs(
    scene: &Scene,
    start: &Start,
    rows: &[Row],
    judge: Option<&Judge>,
    budget: f64,
) -> Vec<String> {
    let Some(first) = rows.first() else {
        return Vec::new();
    };
    let time = |time: f64| quantity(time, Quantity::Time, scene.units);
    let what = if start.collides {
        "the mean free time"
    } else {
        "the time to cross the box, for no two balls met,"
    };
    let mut words = format!(
        "Scene: {}. Its {} balls had run for {} times {what} of {}{}. Every setting started from there and ran for {} s, the first, {}, for \
         {}: averages are held against it. An error below twice its noise may be chance. Displacement is the mean square over {} mean free times; the \
         viscosity of an engine by chance is not measured here, but taken from its law.",
        scene.title,
        start.gas.positions.len(),
        plain(start.time / start.free_time),
        time(start.free_time),
        if start.has_settled() {
            ", until they had settled"
        } else {
            ""
        },
        plain(budget),
        first.setting.name,
        duration(first.measured.seconds),
        WINDOW,
    );
    if let Some(judge) = judge {
        words.extend([
            format!(
                " Trajectories are held against {}, for {}",
                judge.words, LOOKS[2]
            ),
            format!(
                " mean free times, and turned round after {} and {}.",
                TURNS[0], TURNS[1]
            ),
        ]);
    }
    let mut paragraphs = vec![words];
    if !start.has_settled() {
        let unmet = start.criteria.iter().filter(|criterion| !criterion.met);
        let unmet: Vec<&str> = unmet.map(|criterion| criterion.what.as_str()).collect();
        let why = unmet.join("; ");
        paragraphs.push(format!(
            "Warning: the gas had not settled ({why}), so that all averages may drift; give it more time with --seconds."
        ));
    }
    if let Some(until) = scene.until {
        let needs = until / first.measured.speed();
        if needs > 2.0 * first.measured.seconds {
            paragraphs.push(format!(
                "Warning: the whole scene, {}, would take {} with {}; these are slices, up to {} long.",
                time(until),
                duration(needs),
                first.setting.name,
                time(rows.iter().map(|row| row.measured.time).fold(0.0, f64::max)),
            ));
        }
    }
    paragraphs.extend(verdict::recommendations(rows));
    paragraphs
}
