//! `moltop experiment gas`: oxygen near standard conditions at full size, sample by sample.
//!
//! Redoes the fourth experiment of the student paper that this program takes up, the seed: 704,969 molecules in a cube of
//! 0.3 micrometres, twenty samples of temperature and pressure. Each pressure has the error bar that the number of wall hits
//! allows, and is held against kinetic theory at the temperature measured; so are the collisions and the speeds.
//!
//! Source of the error bar: derived here. The momentum of a hit is Rayleigh distributed, so a sum of n independent hits has the
//! relative deviation `sqrt(4 / (pi n))`.

use std::f64::consts::PI;

use clap::Args;

use crate::error::Result;
use crate::experiment::page::{Options as Common, Outputs, Page, Table, Value};
use crate::experiment::plot::{Axis, Glyph, Line, Plot, Series};
use crate::experiment::progress::Progress;
use crate::experiment::trial::Trial;
use crate::observe::speeds::Speeds;
use crate::scene::Scene;
use crate::scene::analysis::Theory;
use crate::snapshot::Units;
use crate::worker::engines::Choice;

/// Samples, as in the seed.
const SAMPLES: u32 = 20;

/// Chi-square of twenty samples lies between these in all but one of a thousand honest runs, on either side.
const CHI_SQUARE: (f64, f64) = (5.921, 45.315);

/// Simulated seconds per wall second that the time left is first guessed from.
const PACE: f64 = 5e-11;

/// What the user asks for.
#[derive(Clone, Debug, Default, Args)]
#[group(skip)]
pub struct Options {
    /// What every experiment is asked.
    #[command(flatten)]
    pub common: Common,
    /// A whole microsecond: hours
    #[arg(long, conflicts_with = "quick")]
    pub full: bool,
    /// Threads [default: one for each core]; their number changes no collision
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=64))]
    pub threads: Option<u16>,
}

/// One sample.
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

/// Runs the experiment; gives the exit code.
///
/// # Errors
/// When results cannot be written.
pub fn run(options: &Options) -> Result<u8> {
    let outputs = Outputs::new(
        "gas",
        &options.common,
        &["samples", "result", "speeds"],
        &["pressure", "speeds"],
    )?;
    let (settle, length) = match (options.common.quick, options.full) {
        (true, _) => (2e-10, 2e-11),
        (_, true) => (1e-9, 5e-8),
        _ => (1e-9, 2e-10),
    };
    let threads = options.threads.map_or_else(
        || std::thread::available_parallelism().map_or(1, usize::from),
        usize::from,
    );
    let seconds = (settle + length * f64::from(SAMPLES)) / PACE;
    let mut progress = Progress::new(seconds)?;
    progress.tell(0.0, "placing 704969 molecules");
    let gas = Scene::oxygen().place()?;
    let theory = Theory::new(&gas, Units::Si);
    let mut trial = Trial::new(Choice::Windowed(threads), &gas);
    drop(gas);
    advance(&mut trial, settle, "settling", &mut progress);
    let mut samples = Vec::new();
    for number in 1..=SAMPLES {
        let end = settle + length * f64::from(number);
        let before = (
            trial.time(),
            trial.observer.ledger.wall_impulse(),
            trial.engine.counters(),
        );
        if !advance(
            &mut trial,
            end,
            &format!("sample {number} of {SAMPLES}"),
            &mut progress,
        ) {
            break;
        }
        samples.push(sample(&trial, before, &theory));
    }
    let mut page = page(&trial, &samples, &theory, options, threads);
    if progress.stopped() {
        page.paragraphs
            .push("Interrupted: this is what had been measured.".to_owned());
    }
    outputs.finish(&page)?;
    Ok(progress.code())
}

/// Runs to a simulated time in slices of a second or so; `false` if a signal came first.
fn advance(trial: &mut Trial, until: f64, words: &str, progress: &mut Progress) -> bool {
    while trial.time() < until && !progress.stopped() {
        let next = (trial.time() + 0.2 * PACE).min(until);
        let before = trial.time();
        trial.run(next);
        if trial.time() <= before {
            break; // the end, up to the grid of time
        }
        let words = format!("{words}, {:.3} ns", 1e9 * trial.time());
        progress.tell((trial.time() - before) / PACE, &words);
    }
    !progress.stopped()
}

/// What has happened since a time, with the wall impulse and the counts of then.
fn sample(
    trial: &Trial,
    (start, impulse, counts): (f64, f64, crate::engine::Counters),
    theory: &Theory,
) -> Sample {
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
    let energy = state.thermal_energy().expect("molecules that move");
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
    threads: usize,
) -> Page {
    let flag = match (options.common.quick, options.full) {
        (true, _) => " --quick",
        (_, true) => " --full",
        _ => "",
    };
    Page {
        name: "gas",
        title: "Oxygen near standard conditions",
        command: format!("moltop experiment gas{flag}"),
        tables: vec![
            rows(samples),
            result(trial, samples, theory),
            histogram(trial),
        ],
        paragraphs: vec![format!(
            "704,969 molecules, engine windowed, {threads} threads. Pressure is force per area of all six walls; its error is \
             the shot noise of the wall hits; theory is taken at the temperature measured in each sample. {} samples, each \
             on its own: chi-square must lie between {} and {} for twenty.",
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

fn result(trial: &Trial, samples: &[Sample], theory: &Theory) -> Table {
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
    let drawn = 273.15 * (2.0 / (3.0 * trial.state().ball_count() as f64)).sqrt();
    table.push([
        "temperature [K]".into(),
        Value::Fixed(temperature, 3),
        Value::Fixed(drawn, 3),
        Value::Fixed(273.15, 2),
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
