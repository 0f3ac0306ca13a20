//! `moltop experiment trade`: what each setting costs on a scene of the user's, and what it gets wrong.
//!
//! All settings start from the same settled gas and run on the clock. Speed and averages are from the same run; averages are
//! held against an exact engine that ran longer, each with its noise. Trajectories are held against twice the precision on a
//! part of the gas. The recommendation is read off the measurements.

mod settings;
mod statistics;
mod tables;
mod trajectories;
mod verdict;

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::engine::windowed::Windowed;
use crate::error::{Error, Result};
use crate::experiment::page::{Options as Common, Outputs, Page};
use crate::experiment::progress::Progress;
use crate::experiment::trial::{EVENT, Trial};
use crate::quantity::{Quantity, duration, plain, quantity};
use crate::run::load;
use crate::scene::Scene;
use crate::scene::analysis::{Theory, temperature};
use crate::state::Placement;
use crate::worker::engines::{Accuracy, Choice, EngineName, Wishes, thermal_speed};
use settings::Settings;
use statistics::{Limits, Measured, measure};
use trajectories::{Judge, LOOKS, TURNS};
use verdict::{Promise, Row};

/// Mean free times in which a gas forgets how it was placed.
const SETTLE: f64 = 5.0;

/// Mean free times over which displacements are measured.
const WINDOW: f64 = 4.0;

/// Budgets in which it must have done so.
const PATIENCE: f64 = 8.0;

/// Mean free times after which a gas that had no time for more is taken for settled all the same.
const HARDLY_SETTLED: f64 = 2.0;

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

/// The gas that all settings start from.
struct Start {
    gas: Placement,
    /// Mean time between two collisions of a ball, or to cross the box if there are none; in the scene's units.
    free_time: f64,
    /// Mean free times it has settled for.
    settled: f64,
    /// Whether balls meet at all.
    collides: bool,
}

/// Runs the experiment; gives the exit code.
///
/// # Errors
/// When the scene is no good or results cannot be written.
pub fn run(options: &Options) -> Result<u8> {
    let outputs = Outputs::new(
        "trade",
        &options.common,
        &["settings", "numbers", "faith", "accuracy", "refused"],
        &["pressure", "trajectories"],
    )?;
    let scene = load(options.scene.as_ref())?;
    let quick = options.common.quick;
    let budget = (options.seconds).unwrap_or(if quick { QUICK_SECONDS } else { SECONDS });
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let several = options.threads.map_or_else(cores, usize::from);
    let placed = scene.place()?;
    if placed.positions.is_empty() || thermal_speed(&placed) <= 0.0 {
        let words = "experiment trade: nothing moves in this scene: there is nothing to trade";
        return Err(Error::Usage(words.to_owned()));
    }
    let mut progress = Progress::new(budget * (REFERENCE + 1.0))?;
    let start = Start::settle(&scene, &placed, several, budget, &mut progress);
    drop(placed);
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
    let judge = Judge::new(
        &start.gas,
        start.free_time,
        if quick { QUICK_FOLLOWED } else { MOST_FOLLOWED },
    );
    let mut rows: Vec<Row> = Vec::new();
    let mut reference: Option<Measured> = None;
    for setting in settings.allowed {
        if progress.stopped() {
            break;
        }
        let limits = Limits {
            budget: if reference.is_none() {
                REFERENCE * budget
            } else {
                budget
            },
            free_time: start.free_time,
            window: WINDOW,
        };
        let measured = measure(
            setting.choice,
            &start.gas,
            limits,
            &setting.name,
            &mut progress,
        );
        let faith = judge.as_ref().filter(|judge| {
            // A part of the balls takes about that part of the time.
            let share = judge.balls() as f64 / start.gas.positions.len() as f64;
            let expected = judge.time() / measured.speed() * share;
            let follows = !matches!(setting.choice, Choice::Statistical { .. });
            follows && expected < 2.0 * budget && !progress.stopped()
        });
        let faith = faith.and_then(|judge| judge.judge(setting.choice));
        let reference = reference.get_or_insert_with(|| measured.clone());
        rows.push(Row::new(setting, measured, reference, faith));
    }
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
            tables::averages(&rows, scene.units),
            tables::numbers(&rows),
            tables::faith(&rows),
            tables::accuracies(&promises),
            tables::refused(&settings.refused),
        ],
        paragraphs: paragraphs(&scene, &start, &rows, judge.as_ref(), budget),
        plots: vec![tables::pressure_plot(&rows), tables::trajectory_plot(&rows)],
    };
    page.tables.retain(|table| !table.rows.is_empty());
    if progress.stopped() {
        page.paragraphs
            .push("Interrupted: this is what had been measured.".to_owned());
    }
    outputs.finish(&page)?;
    Ok(progress.code())
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

impl Start {
    /// Runs a scene until it has settled, or the time for that is spent.
    fn settle(
        scene: &Scene,
        placed: &Placement,
        threads: usize,
        budget: f64,
        progress: &mut Progress,
    ) -> Self {
        let expected = temperature(placed, scene.units)
            .and_then(|temperature| Theory::new(placed, scene.units).at(temperature).pair_rate);
        let count = placed.positions.len() as f64;
        let crossing = 2.0 * placed.domain.half_size.max_element() / thermal_speed(placed);
        let guess = expected.map_or(crossing, |rate| count / (2.0 * rate).max(f64::MIN_POSITIVE));
        let guess = guess.min(crossing * 1e3);
        let choice = if Windowed::pays(placed) {
            Choice::Windowed(threads)
        } else {
            EVENT
        };
        let mut trial = Trial::new(choice, placed);
        let began = std::time::Instant::now();
        let slices = 200.0;
        for slice in 1..=(SETTLE * slices) as u32 {
            let spent = began.elapsed().as_secs_f64();
            if progress.stopped() || spent > PATIENCE * budget {
                break;
            }
            let until = f64::from(slice) / slices * guess;
            if trial.try_run(until, &mut |_| {}).is_err() {
                break; // no room to move: every engine will say so
            }
            progress.tell(0.0, "settling");
        }
        let pairs = trial.engine.counters().pair_collisions as f64;
        let free_time = if pairs > 0.0 {
            count * trial.time() / (2.0 * pairs)
        } else {
            guess
        };
        Self {
            settled: trial.time() / free_time,
            gas: trial.state().placement(),
            free_time,
            collides: pairs > 0.0,
        }
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
        "Scene: {}. Its {} balls had settled for {} times {what} of {}. Every setting started from there and ran for {} s, the first, {}, for \
         {}: averages are held against it. An error below twice its noise may be chance. Displacement is the mean square over {} mean free times; the \
         viscosity of an engine by chance is not measured here, but taken from its law.",
        scene.title,
        start.gas.positions.len(),
        plain(start.settled),
        time(start.free_time),
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
    if start.settled < HARDLY_SETTLED && start.collides {
        paragraphs.push(
            "Warning: the gas had no time to settle; give it more with --seconds.".to_owned(),
        );
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
