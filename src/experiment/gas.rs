//! `moltop experiment gas`: oxygen near standard conditions at full size, sample by sample.
//!
//! Redoes the fourth experiment of the student paper that this program takes up, the seed: 704,969 molecules in a cube of
//! 0.3 micrometres, twenty samples of temperature and pressure. Each pressure has the error bar that the number of wall hits
//! allows, and is held against kinetic theory at the temperature measured; so are the collisions and the speeds. Other gases
//! can be given the same test. With `--out`, checkpoints are kept there, and an interrupted run goes on bit for bit.
//!
//! Source of the error bar: derived here. The momentum of a hit is Rayleigh distributed, so a sum of n independent hits has the
//! relative deviation `sqrt(4 / (pi n))`.

use std::f64::consts::PI;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use serde::{Deserialize, Serialize};

use crate::domain::Boundary;
use crate::engine::Counters;
use crate::error::{Error, Result};
use crate::experiment::kept::Kept;
use crate::experiment::page::{Options as Common, Outputs, Page, Table, Value};
use crate::experiment::plot::{Axis, Glyph, Line, Plot, Series};
use crate::experiment::progress::Progress;
use crate::experiment::trial::{SavedTrial, Trial};
use crate::observe::speeds::Speeds;
use crate::run::{load, say};
use crate::scene::Scene;
use crate::scene::analysis::{Theory, temperature};
use crate::snapshot::Units;
use crate::state::{Placement, State};
use crate::worker::engines::{Choice, EngineName, Wishes};

/// Samples, as in the seed.
const SAMPLES: u32 = 20;

/// Chi-square of twenty samples lies between these in all but one of a thousand honest runs, on either side.
const CHI_SQUARE: (f64, f64) = (5.921, 45.315);

/// Pair collisions in a wall second that the time left is first guessed from.
const PACE: f64 = 1e5;

/// Mean free times in which another gas than the oxygen settles, at the least.
const SETTLE: f64 = 6.0;

/// What the user asks for.
#[derive(Clone, Debug, Default, Args)]
#[group(skip)]
pub struct Options {
    /// Scene file, in SI units, of balls in a container [default: oxygen near standard conditions]
    pub scene: Option<PathBuf>,
    /// What every experiment is asked.
    #[command(flatten)]
    pub common: Common,
    /// A whole microsecond: hours; goes on from its last checkpoint in --out when it is started again
    #[arg(long, conflicts_with = "quick", requires = "out")]
    pub full: bool,
    /// Simulated time of all samples together [default: 4 ns; 1 us with --full, 0.4 ns with --quick]
    #[arg(long, value_name = "SECONDS", value_parser = length)]
    pub length: Option<f64>,
    /// Wall time between two checkpoints in --out, such as 30s or 10min
    #[arg(long, value_name = "DURATION", default_value = "1min", value_parser = humantime::parse_duration)]
    pub checkpoint_every: Duration,
    /// Threads [default: one for each core]; their number changes no collision
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=64))]
    pub threads: Option<u16>,
}

fn length(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1e-15..=1e3).contains(&value) => Ok(value),
        _ => Err("must be from 1e-15 to 1000".to_owned()),
    }
}

/// One sample.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Sample {
    time: f64,
    temperature: f64,
    pressure: f64,
    error: f64,
    expected: f64,
    pairs: u64,
    walls: u64,
    pair_rate_ratio: Option<f64>,
    wall_rate_ratio: Option<f64>,
    ks: f64,
}

impl Sample {
    fn deviation(&self) -> f64 {
        (self.pressure - self.expected) / self.error
    }
}

/// When a sample began, and the wall impulse and the counts of then.
type Begin = (f64, f64, Counters);

fn begin(trial: &Trial) -> Begin {
    let impulse = trial.observer.ledger.wall_impulse();
    (trial.time(), impulse, trial.engine.counters())
}

/// What is kept of a run that is not finished.
#[derive(Serialize, Deserialize)]
struct Unfinished {
    trial: SavedTrial,
    samples: Vec<Sample>,
    begin: Begin,
}

/// A run that is going on.
struct Run {
    trial: Trial,
    samples: Vec<Sample>,
    begin: Begin,
    kept: Kept,
    /// Simulated time to settle, and of a sample.
    plan: (f64, f64),
    /// Simulated time in a wall second, as it was guessed.
    pace: f64,
    progress: Progress,
    checkpoint_every: Duration,
    saved: Instant,
}

/// Runs the experiment; gives the exit code.
///
/// # Errors
/// When the scene is no good or results cannot be written.
pub fn run(options: &Options) -> Result<u8> {
    let scene = load(options.scene.as_ref())?;
    let threads = options.threads.map_or_else(
        || std::thread::available_parallelism().map_or(1, usize::from),
        usize::from,
    );
    let all = options
        .length
        .unwrap_or(match (options.common.quick, options.full) {
            (true, _) => 4e-10,
            (_, true) => 1e-6,
            _ => 4e-9,
        });
    let kept = Kept::new(
        options.common.out.as_deref(),
        "gas",
        &format!("{}\n{}", all.to_bits(), scene.source),
    );
    let unfinished: Option<Unfinished> = kept.load(options.common.force)?;
    let outputs = Outputs::new(
        "gas",
        &Common {
            force: options.common.force || unfinished.is_some(),
            ..options.common.clone()
        },
        &["samples", "result", "speeds"],
        &["pressure", "speeds"],
    )?;
    let gas = scene.place()?;
    let warm = check(&scene, &gas)?;
    let theory = Theory::new(&gas, Units::Si);
    let expected = theory.at(warm);
    let rate = expected.pair_rate.unwrap_or(0.0) + expected.wall_rate.unwrap_or(0.0);
    let flights = 2.0 * expected.pair_rate.unwrap_or(0.0) / gas.positions.len() as f64;
    let settle = match (&options.scene, options.common.quick) {
        (None, true) => 2e-10,
        (None, false) => 1e-9,
        _ => (SETTLE / flights).min(all),
    };
    let pace = PACE / rate;
    let progress = Progress::new((settle + all) / pace)?;
    let wishes = Wishes {
        engine: EngineName::Auto,
        threads: Some(threads),
        ..Wishes::default()
    };
    let choice = Choice::new(&wishes, &gas).unwrap_or_default();
    let mut run = Run::new(unfinished, choice, &gas, kept, progress)?;
    run.plan = (settle, all / f64::from(SAMPLES));
    run.pace = pace;
    run.checkpoint_every = options.checkpoint_every;
    drop(gas);
    run.finish(&theory)?;
    let Run {
        trial,
        samples,
        progress,
        kept,
        ..
    } = run;
    let mut page = page(&trial, &samples, &theory, options, (choice, threads));
    if progress.stopped() {
        page.paragraphs.push(kept.interrupted().to_owned());
    }
    outputs.finish(&page)?;
    if !progress.stopped() {
        kept.remove();
    }
    Ok(progress.code())
}

/// The temperature of a gas that can be given the test.
fn check(scene: &Scene, gas: &Placement) -> Result<f64> {
    let refuse = |why: &str| Err(Error::Usage(format!("experiment gas: {why}")));
    if scene.units != Units::Si || gas.domain.boundary != Boundary::Container {
        return refuse("the scene must be in SI units, and its domain a container");
    }
    match temperature(gas, scene.units).filter(|&temperature| temperature > 0.0) {
        Some(temperature) => Ok(temperature),
        None => refuse("nothing moves in this scene"),
    }
}

impl Run {
    /// Goes on from what an interrupted run has left, or begins.
    fn new(
        unfinished: Option<Unfinished>,
        choice: Choice,
        gas: &Placement,
        kept: Kept,
        mut progress: Progress,
    ) -> Result<Self> {
        let (trial, samples, begin) = if let Some(unfinished) = unfinished {
            let Some(trial) = unfinished.trial.resume(choice) else {
                let words = "experiment gas: the checkpoint in --out is of another engine";
                return Err(Error::Usage(words.to_owned()));
            };
            say(&format!(
                "goes on from {:.3} ns, with {} samples",
                1e9 * trial.time(),
                unfinished.samples.len()
            ));
            (trial, unfinished.samples, unfinished.begin)
        } else {
            progress.tell(0.0, &format!("placing {} balls", gas.positions.len()));
            let trial = Trial::resume(choice, State::new(gas));
            let begin = begin(&trial);
            (trial, Vec::new(), begin)
        };
        Ok(Self {
            trial,
            samples,
            begin,
            kept,
            plan: (0.0, 0.0),
            pace: 1.0,
            progress,
            checkpoint_every: Duration::MAX,
            saved: Instant::now(),
        })
    }

    /// Settles, and takes the samples that are missing.
    fn finish(&mut self, theory: &Theory) -> Result<()> {
        let (settle, length) = self.plan;
        self.progress.already(self.trial.time() / self.pace);
        if self.samples.is_empty() && self.trial.time() < settle {
            if !self.advance(settle, "settling")? {
                return self.keep();
            }
            self.begin = begin(&self.trial);
        }
        for number in self.samples.len() as u32 + 1..=SAMPLES {
            let end = settle + length * f64::from(number);
            if !self.advance(end, &format!("sample {number} of {SAMPLES}"))? {
                return self.keep();
            }
            let sample = sample(&self.trial, self.begin, theory);
            self.samples.push(sample);
            self.begin = begin(&self.trial);
        }
        Ok(())
    }

    /// Runs to a simulated time in slices of a fraction of a second; `false` if a signal came first.
    fn advance(&mut self, until: f64, words: &str) -> Result<bool> {
        while self.trial.time() < until && !self.progress.stopped() {
            let before = self.trial.time();
            self.trial.run((before + 0.2 * self.pace).min(until));
            let after = self.trial.time();
            if after <= before {
                break; // the end, up to the grid of time
            }
            let words = format!("{words}, {:.3} ns", 1e9 * after);
            self.progress.tell((after - before) / self.pace, &words);
            if self.saved.elapsed() > self.checkpoint_every {
                self.keep()?;
            }
        }
        Ok(!self.progress.stopped())
    }

    /// Writes a checkpoint.
    fn keep(&mut self) -> Result<()> {
        if self.kept.path().is_some() {
            self.kept.store(&Unfinished {
                trial: self.trial.save(),
                samples: self.samples.clone(),
                begin: self.begin,
            })?;
        }
        self.saved = Instant::now();
        Ok(())
    }
}

/// What has happened since a time, with the wall impulse and the counts of then.
fn sample(trial: &Trial, (start, impulse, counts): Begin, theory: &Theory) -> Sample {
    let state = trial.state();
    let units = state.units;
    let duration = trial.time() - start;
    let force = (trial.observer.ledger.wall_impulse() - impulse) / (duration / units.time);
    let pressure = force / state.domain.wall_area() * units.pressure();
    let now = trial.engine.counters();
    let (pairs, walls) = (
        now.pair_collisions - counts.pair_collisions,
        now.wall_collisions - counts.wall_collisions,
    );
    let energy = state
        .totals()
        .thermal_energy()
        .expect("molecules that move");
    let temperature = energy * units.energy() / Units::Si.boltzmann();
    let expected = theory.at(temperature);
    let ratio = |count: u64, rate: Option<f64>| rate.map(|rate| count as f64 / (rate * duration));
    let speeds = Speeds::of(state).expect("molecules that move");
    Sample {
        time: trial.time(),
        temperature,
        pressure,
        error: pressure * (4.0 / (PI * walls as f64)).sqrt(),
        expected: expected.pressure.unwrap_or(f64::NAN),
        pairs,
        walls,
        pair_rate_ratio: ratio(pairs, expected.pair_rate),
        wall_rate_ratio: ratio(walls, expected.wall_rate),
        ks: speeds.ks / speeds.ks_critical,
    }
}

fn page(
    trial: &Trial,
    samples: &[Sample],
    theory: &Theory,
    options: &Options,
    (choice, threads): (Choice, usize),
) -> Page {
    let mut command = "moltop experiment gas".to_owned();
    if let Some(scene) = &options.scene {
        command = format!("{command} {}", scene.display());
    }
    let flag = match (options.common.quick, options.full) {
        (true, _) => " --quick",
        (_, true) => " --full",
        _ => "",
    };
    command.push_str(flag);
    if let Some(length) = options.length {
        command = format!("{command} --length {length:e}");
    }
    let threads = match choice {
        Choice::Windowed(_) => format!(", {threads} threads"),
        _ => String::new(),
    };
    Page {
        name: "gas",
        title: "A gas and its theory, sample by sample",
        command,
        tables: vec![
            rows(samples),
            result(trial, samples, theory, options.scene.is_none()),
            histogram(trial),
        ],
        paragraphs: vec![format!(
            "{} balls, engine {}{threads}. Pressure is force per area of all six walls; its error is \
             the shot noise of the wall hits; theory is taken at the temperature measured in each sample. {} samples, each \
             on its own: chi-square must lie between {} and {} for twenty.",
            trial.state().ball_count(),
            choice.name(),
            samples.len(),
            CHI_SQUARE.0,
            CHI_SQUARE.1
        )],
        plots: vec![pressure_plot(samples), speeds_plot(trial)],
    }
}

fn rows(samples: &[Sample]) -> Table {
    let columns = [
        "sample",
        "until [ns]",
        "temperature [K]",
        "pressure [kPa]",
        "error [kPa]",
        "theory [kPa]",
        "deviation [errors]",
        "pair collisions",
        "over theory",
        "wall hits",
        "hits over theory",
        "KS over critical",
    ];
    let mut table = Table::new("samples", "Sample by sample", &columns);
    for (number, sample) in samples.iter().enumerate() {
        table.push([
            (number as u64 + 1).into(),
            (1e9 * sample.time).into(),
            Value::Fixed(sample.temperature, 3),
            Value::Fixed(1e-3 * sample.pressure, 3),
            Value::Fixed(1e-3 * sample.error, 3),
            Value::Fixed(1e-3 * sample.expected, 3),
            Value::Fixed(sample.deviation(), 2),
            sample.pairs.into(),
            sample.pair_rate_ratio.into(),
            sample.walls.into(),
            sample.wall_rate_ratio.into(),
            sample.ks.into(),
        ]);
    }
    table
}

fn result(trial: &Trial, samples: &[Sample], theory: &Theory, is_oxygen: bool) -> Table {
    let mut table = Table::new(
        "result",
        "All samples together",
        &["quantity", "found", "error", "expected"],
    );
    let none = || None::<f64>.into();
    if samples.is_empty() {
        return table;
    }
    let count = samples.len() as f64;
    let mean = |what: fn(&Sample) -> f64| samples.iter().map(what).sum::<f64>() / count;
    let error = samples
        .iter()
        .map(|sample| sample.error * sample.error)
        .sum::<f64>()
        .sqrt()
        / count;
    let pressure = mean(|sample| sample.pressure);
    let kilo = |value: f64| Value::Fixed(1e-3 * value, 3);
    table.push([
        "pressure [kPa]".into(),
        kilo(pressure),
        kilo(error),
        kilo(mean(|sample| sample.expected)),
    ]);
    // The velocities were drawn: their temperature is off by a thousandth or so, and the pressure with it.
    let temperature = mean(|sample| sample.temperature);
    let scale = 273.15 / temperature;
    let standard = theory.at(273.15).pressure.unwrap_or(f64::NAN);
    table.push([
        "pressure at 273.15 K [kPa]".into(),
        kilo(pressure * scale),
        kilo(error * scale),
        kilo(standard),
    ]);
    let drawn = temperature * (2.0 / (3.0 * trial.state().ball_count() as f64)).sqrt();
    table.push([
        "temperature [K]".into(),
        Value::Fixed(temperature, 3),
        Value::Fixed(drawn, 3),
        if is_oxygen {
            Value::Fixed(273.15, 2)
        } else {
            Value::Nothing
        },
    ]);
    let chi_square: f64 = samples
        .iter()
        .map(|sample| sample.deviation() * sample.deviation())
        .sum();
    table.push([
        "chi-square of the pressures".into(),
        chi_square.into(),
        (2.0 * count).sqrt().into(),
        count.into(),
    ]);
    table.push([
        "speeds, KS over critical, last sample".into(),
        samples.last().map(|sample| sample.ks).into(),
        none(),
        "below 1".into(),
    ]);
    table.push([
        "energy drift".into(),
        trial.energy_drift().into(),
        none(),
        "below 1e-12".into(),
    ]);
    table
}

fn histogram(trial: &Trial) -> Table {
    let mut table = Table::only_in_files(
        "speeds",
        "Speeds at the end",
        &["speed [m/s]", "molecules", "Maxwell"],
    );
    let speeds = Speeds::of(trial.state()).expect("molecules that move");
    let width = speeds.bin_width * trial.state().units.velocity();
    for (bin, (&count, &maxwell)) in speeds.counts.iter().zip(&speeds.maxwell).enumerate() {
        table.push([
            ((bin as f64 + 0.5) * width).into(),
            count.into(),
            maxwell.into(),
        ]);
    }
    table
}

fn pressure_plot(samples: &[Sample]) -> Plot {
    let points = |what: fn(&Sample) -> f64| -> Vec<_> {
        samples
            .iter()
            .map(|sample| (1e9 * sample.time, 1e-3 * what(sample)))
            .collect()
    };
    let errors = samples.iter().map(|sample| 1e-3 * sample.error).collect();
    Plot {
        name: "pressure",
        title: "Pressure on the six walls, sample by sample".to_owned(),
        x: Axis::linear("simulated time [ns]"),
        y: Axis::linear("pressure [kPa]"),
        series: vec![
            Series::points(
                "measured, one error",
                Glyph::Circle,
                points(|sample| sample.pressure),
            )
            .with_errors(errors),
            Series::line(
                "kinetic theory",
                Line::Dashed,
                points(|sample| sample.expected),
            ),
        ],
    }
}

fn speeds_plot(trial: &Trial) -> Plot {
    let speeds = Speeds::of(trial.state()).expect("molecules that move");
    let width = speeds.bin_width * trial.state().units.velocity();
    let at = |bin: usize| (bin as f64 + 0.5) * width;
    let counts = speeds
        .counts
        .iter()
        .enumerate()
        .map(|(bin, &count)| (at(bin), count as f64));
    let maxwell = speeds
        .maxwell
        .iter()
        .enumerate()
        .map(|(bin, &count)| (at(bin), count));
    Plot {
        name: "speeds",
        title: "Speeds at the end".to_owned(),
        x: Axis::linear("speed [m/s]"),
        y: Axis::linear("molecules per bin"),
        series: vec![
            Series::points("measured", Glyph::Circle, counts.collect()).hollow(),
            Series::line("Maxwell", Line::Solid, maxwell.collect()),
        ],
    }
}
