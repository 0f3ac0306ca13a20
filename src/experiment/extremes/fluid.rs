//! Rows 31 to 33 and 35: the fluid against the literature.

use std::sync::OnceLock;

use super::Verdict;
use crate::domain::Domain;
use crate::engine::windowed::Windowed;
use crate::experiment::extremes::dense::compressibility;
use crate::experiment::gases::{direction, face_centred, generator, lattice};
use crate::experiment::theory;
use crate::experiment::trial::{EVENT, Trial, WINDOWED};
use crate::observe::speeds::Speeds;
use crate::state::State;
use crate::worker::engines::Choice;

/// Densities of rows 31 and 32.
const DENSITIES: [f64; 6] = [0.1, 0.3, 0.5, 0.6, 0.75, 0.9];

/// What a run of a fluid gave.
struct Run {
    density: f64,
    compressibility: f64,
    /// Standard error from blocks.
    error: f64,
    /// Collisions per ball and time, in units of `sqrt(k T / m) / d`.
    rate: f64,
}

/// Runs of two million collisions, made once for both rows.
fn runs() -> &'static [Run] {
    static RUNS: OnceLock<Vec<Run>> = OnceLock::new();
    RUNS.get_or_init(|| DENSITIES.map(run).into())
}

fn run(density: f64) -> Run {
    const BLOCKS: u32 = 20;
    let expected = theory::collision_rate(density);
    let mut trial = Trial::new(EVENT, &face_centred(7, density, 31));
    let balls = trial.state().ball_count() as f64;
    // The crystal of the start melts.
    trial.run_for_events(500_000, 10.0 / expected);
    let start = trial.time();
    let before = trial.events();
    let length = 2.0 * 100_000.0 / balls / expected;
    let mut values = Vec::new();
    for block in 1..=BLOCKS {
        let virial = trial.observer.ledger.pair_virial();
        let begun = trial.time();
        trial.run(start + length * f64::from(block));
        let gained = trial.observer.ledger.pair_virial() - virial;
        values.push(compressibility(trial.state(), gained, trial.time() - begun));
    }
    let count = f64::from(BLOCKS);
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values
        .iter()
        .map(|value| (value - mean) * (value - mean))
        .sum();
    let state = trial.state();
    let energy = state.totals().thermal_energy().expect("balls that move") * state.units.energy();
    Run {
        density,
        compressibility: mean,
        error: (squares / (count * (count - 1.0))).sqrt(),
        rate: 2.0 * (trial.events() - before) as f64
            / balls
            / (trial.time() - start)
            / energy.sqrt(),
    }
}

/// Row 31.
pub fn pressure() -> Verdict {
    let mut verdict = Verdict::default();
    for run in runs() {
        let expected = theory::compressibility(theory::packing_fraction(run.density));
        let band = 3.0 * run.error + 0.002 * expected;
        let what = format!("compressibility factor at density {}", run.density);
        verdict.near(what, run.compressibility, expected, band);
    }
    verdict
}

/// Row 32.
pub fn rate() -> Verdict {
    let mut verdict = Verdict::default();
    for run in runs() {
        let expected = theory::collision_rate(run.density);
        let what = format!("collision rate at density {}", run.density);
        verdict.near(what, run.rate, expected, 0.005 * expected);
    }
    verdict
}

/// Rows 31 and 32, engine windowed: the same states as engine event, so the same pressure and rate.
pub fn windowed() -> Verdict {
    let mut verdict = Verdict::default();
    for density in DENSITIES {
        let mut gas = face_centred(7, density, 31);
        if !Windowed::supports(&gas) {
            // Walls instead, clear of the balls next to them.
            gas.domain = Domain::container(gas.domain.half_size + 0.1);
        }
        let time = 200.0 / theory::collision_rate(density);
        let [event, windowed] = [EVENT, WINDOWED].map(|choice| {
            let mut trial = Trial::new(choice, &gas);
            trial.run(time);
            (trial.events(), trial.state().hash())
        });
        verdict.holds(
            format!(
                "density {density}: {} collisions as by engine event",
                event.0
            ),
            windowed == event,
            "the same state, bit for bit",
        );
    }
    verdict
}

/// Fourth moment of the speeds over the square of the second; 5/3 after Maxwell.
fn kurtosis(state: &State) -> f64 {
    let squares = state
        .trajectories
        .iter()
        .map(|flight| flight.velocity.length_squared());
    let (second, fourth) = squares.fold((0.0, 0.0), |(second, fourth), square| {
        (second + square, fourth + square * square)
    });
    fourth / (second * second) * state.ball_count() as f64
}

/// Row 33.
pub fn speeds() -> Verdict {
    let mut verdict = Verdict::default();
    let maxwell = lattice(20, 1.5, 31.5, 33);
    let mut equal = maxwell.clone();
    let mut random = generator(33);
    equal
        .velocities
        .fill_with(|| direction(&mut random) * 3.0_f64.sqrt());
    for (what, gas) in [("from Maxwell's", &maxwell), ("from equal ones", &equal)] {
        for choice in [EVENT, Choice::Step(1.0 / 100.0)] {
            let mut trial = Trial::new(choice, gas);
            // Ten collisions per ball, then one instant every two collisions: their mean has less noise than one.
            let per_ball =
                |trial: &Trial| 2.0 * trial.engine.counters().pair_collisions as f64 / 8000.0;
            let mut time = 0.0;
            let (mut sum, mut samples, mut share) = (0.0, 0_u32, None);
            while samples < 20 {
                time += 1.0;
                trial.run(time);
                if per_ball(&trial) < 10.0 {
                    continue;
                }
                let speeds = Speeds::of(trial.state()).expect("balls that move");
                share.get_or_insert(speeds.ks / speeds.ks_critical);
                sum += kurtosis(trial.state());
                samples += 1;
            }
            let name = format!("{}, {what}", choice.name());
            let share = share.expect("a sample");
            verdict.at_most(format!("{name}: distance over the 0.1 % level"), share, 1.0);
            let expected = 5.0 / 3.0;
            verdict.near(
                format!("{name}: kurtosis"),
                sum / f64::from(samples),
                expected,
                0.01 * expected,
            );
        }
    }
    verdict
}

/// Times over which row 35 averages.
const WINDOWS: u32 = 20;

/// Row 35.
pub fn diffusion() -> Verdict {
    let mut verdict = Verdict::default();
    let mut trial = Trial::new(EVENT, &face_centred(10, 0.5, 35));
    trial.run(20.0);
    let places = |trial: &Trial| -> Vec<_> {
        let state = trial.state();
        (0..state.ball_count())
            .map(|ball| state.unwrapped_position(ball) * state.units.length)
            .collect()
    };
    // Mean square displacements over 20 time units, less those over 10: the ballistic start drops out.
    let (mut near, mut far) = (0.0, 0.0);
    for _ in 0..WINDOWS {
        let (start, first) = (trial.time(), places(&trial));
        let mean_square = |trial: &Trial| {
            let squares = places(trial)
                .into_iter()
                .zip(&first)
                .map(|(a, b)| a.distance_squared(*b));
            squares.sum::<f64>() / first.len() as f64
        };
        trial.run(start + 10.0);
        near += mean_square(&trial);
        trial.run(start + 20.0);
        far += mean_square(&trial);
    }
    let state = trial.state();
    let energy = state.totals().thermal_energy().expect("balls that move") * state.units.energy();
    let found = (far - near) / f64::from(WINDOWS) / 60.0 / energy.sqrt();
    verdict.near("diffusion coefficient", found, 0.240, 0.08 * 0.240);
    verdict.note(format!(
        "{} collisions of {} balls",
        trial.events(),
        state.ball_count()
    ));
    verdict
}
