//! Row 36: all 704,969 molecules of the embedded scene.

use super::Verdict;
use crate::experiment::trial::{Trial, resident_memory};
use crate::scene::Scene;
use crate::units::UnitScale;
use crate::worker::engines::Choice;

/// Most bytes per ball.
const MOST_BYTES: f64 = 400.0;

fn start(verdict: &mut Verdict) -> Trial {
    let began = std::time::Instant::now();
    let before = resident_memory();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let gas = Scene::oxygen().place().expect("the embedded scene is good");
    let mut trial = Trial::new(Choice::Windowed(threads), &gas);
    drop(gas);
    trial.run(1e-13);
    if let Some((before, now)) = before.zip(resident_memory()) {
        let per_ball = now.saturating_sub(before) as f64 / trial.state().ball_count() as f64;
        verdict.at_most("memory, bytes per ball", per_ball, MOST_BYTES);
    }
    verdict.note(format!(
        "{:.2} s from nothing to the first events, {threads} threads",
        began.elapsed().as_secs_f64()
    ));
    trial
}

/// Row 36, 10 ps.
pub fn short() -> Verdict {
    let mut verdict = Verdict::default();
    let mut trial = start(&mut verdict);
    let began = std::time::Instant::now();
    trial.run(1e-11);
    verdict.at_most("temperature", trial.energy_drift(), 1e-12);
    verdict.at_most(
        "virial ledger",
        trial.drift().virial.unwrap_or(f64::NAN),
        1e-12,
    );
    let counters = trial.engine.counters();
    let (pairs, walls) = (counters.pair_collisions, counters.wall_collisions);
    let seconds = began.elapsed().as_secs_f64();
    verdict.note(format!(
        "from the lattice: {pairs} pair and {walls} wall collisions in 10 ps, {seconds:.2} s"
    ));
    verdict
}

/// Row 36, 1 ns to settle, 1 ns for the pressure, 10 ps for the counts.
pub fn long() -> Verdict {
    let mut verdict = Verdict::default();
    let mut trial = start(&mut verdict);
    let state = trial.state();
    let UnitScale { time, .. } = state.units;
    let (pressure, area) = (state.units.pressure(), state.domain.wall_area());
    let temperature = state.totals().thermal_energy().expect("balls that move")
        * state.units.energy()
        / 1.380_649e-23;
    trial.run(1e-9);
    let impulse = trial.observer.ledger.wall_impulse();
    let counts = trial.engine.counters();
    trial.run(1.01e-9);
    let after = trial.engine.counters();
    let pairs = after.pair_collisions - counts.pair_collisions;
    let walls = after.wall_collisions - counts.wall_collisions;
    trial.run(2e-9);
    let force = (trial.observer.ledger.wall_impulse() - impulse) / (1e-9 / time);
    let found = force / area * pressure;
    // Expected at 273.15 K; the drawn velocities are a little off that.
    let expected = 98_804.0 * temperature / 273.15;
    verdict.near(
        "pair collisions in 10 ps",
        pairs as f64,
        20_867.0,
        3.0 * 145.0,
    );
    verdict.near("wall collisions in 10 ps", walls as f64, 15_004.0, 370.0);
    verdict.near(
        "pressure in Pa, over the second ns",
        found,
        expected,
        3.0 * 0.000_92 * expected,
    );
    verdict.at_most("temperature", trial.energy_drift(), 1e-12);
    verdict.at_most(
        "virial ledger",
        trial.drift().virial.unwrap_or(f64::NAN),
        1e-12,
    );
    verdict.note(format!("temperature {temperature:.3} K"));
    verdict
}
