//! Rows 10, 11, 19 and 20: gases with hardly any room.

use glam::DVec3;

use super::Verdict;
use crate::error::Error;
use crate::experiment::gases::{container, face_centred, lattice, with_normal_velocities};
use crate::experiment::theory;
use crate::experiment::trial::{EVENT, REVERSIBLE, Trial, WINDOWED, processor_seconds};
use crate::state::{Placement, State};
use crate::worker::engines::Choice;

/// 64 balls of diameter 1 on a cubic lattice, `gap` apart and as far from the walls.
fn cage(gap: f64) -> Placement {
    let spacing = 1.0 + gap;
    let place = |site: usize| {
        let site = DVec3::new((site / 16) as f64, (site / 4 % 4) as f64, (site % 4) as f64);
        (site - 1.5) * spacing
    };
    let half = 2.0 + 2.5 * gap;
    let gas = container(DVec3::splat(half), (0..64).map(place).collect());
    with_normal_velocities(gas, 2)
}

/// Row 10.
pub fn caged() -> Verdict {
    caged_by(EVENT)
}

/// Row 10, engine windowed.
pub fn caged_windowed() -> Verdict {
    caged_by(WINDOWED)
}

fn caged_by(choice: Choice) -> Verdict {
    let mut verdict = Verdict::default();
    let mut counts = Vec::new();
    // Powers of two just below 1e-3, 1e-6, 1e-9 and 1e-12, so that the lattice itself is exact.
    for exponent in [10, 20, 30, 40] {
        let gap = 2.0_f64.powi(-exponent);
        let mut trial = Trial::new(choice, &cage(gap));
        trial.run(50.0 * gap);
        let counters = trial.engine.counters();
        counts.push((counters.pair_collisions, counters.wall_collisions));
        let what = format!("gap {gap:.2e}: overlap over gap");
        verdict.at_most(what, trial.max_overlap() / gap, 0.01);
    }
    let what = "pair and wall collisions at the three smallest";
    verdict.equal(what, &counts[1..].to_vec(), &vec![counts[1]; 3]);
    verdict.note(format!("{:?} at the largest", counts[0]));
    verdict
}

/// Row 11.
pub fn jammed() -> Verdict {
    let mut verdict = Verdict::default();
    jam(&mut verdict, EVENT);
    jam(&mut verdict, REVERSIBLE);
    verdict
}

/// Row 11, engine windowed.
pub fn jammed_windowed() -> Verdict {
    let mut verdict = Verdict::default();
    jam(&mut verdict, WINDOWED);
    verdict
}

fn jam(verdict: &mut Verdict, choice: Choice) {
    let began = processor_seconds();
    let mut trial = Trial::new(choice, &lattice(4, 1.0, 4.0, 1));
    let stuck = trial.try_run(1.0, &mut |_| {});
    let words = stuck
        .err()
        .map_or_else(|| "ran on".to_owned(), |stuck| stuck.to_string());
    let name = choice.name();
    let clear = words.starts_with("no time progress: ball");
    verdict.holds(format!("{name}: stops and names the balls"), clear, "yes");
    verdict.equal(
        format!("{name}: exit code"),
        &Error::Engine(words.clone()).exit_code(),
        &1,
    );
    verdict.at_most(
        format!("{name}: seconds of the processor"),
        processor_seconds() - began,
        1.0,
    );
    verdict.note(format!("{name}: {words}"));
}

/// Compressibility factor from the virial gained since `virial`, over a time in the scene's units.
pub fn compressibility(state: &State, virial: f64, time: f64) -> f64 {
    let energy = state.totals().thermal_energy().expect("balls that move");
    let epochs = time / state.units.time;
    1.0 + virial / (3.0 * state.ball_count() as f64 * energy * epochs)
}

/// Runs a periodic gas until it has settled, then measures its compressibility factor over that many collisions.
fn measure(trial: &mut Trial, settle: u64, events: u64, slice: f64) -> f64 {
    trial.run_for_events(settle, slice);
    let (start, virial) = (trial.time(), trial.observer.ledger.pair_virial());
    trial.run_for_events(settle + events, slice);
    let gained = trial.observer.ledger.pair_virial() - virial;
    compressibility(trial.state(), gained, trial.time() - start)
}

/// Row 19.
pub fn dense_fluid() -> Verdict {
    let mut verdict = Verdict::default();
    let packing = 0.49;
    let density = packing * 6.0 / std::f64::consts::PI;
    // The crystal of the start melts within some hundred collisions per ball.
    let mut trial = Trial::new(EVENT, &face_centred(7, density, 19));
    let found = measure(&mut trial, 2_000_000, 3_000_000, 1.0);
    let expected = theory::compressibility(packing);
    verdict.near("compressibility factor", found, expected, 0.005 * expected);
    verdict.at_most("overlap over d", trial.max_overlap(), 1e-13);
    verdict.at_most("energy", trial.energy_drift(), 1e-12);
    verdict
}

/// Row 20.
pub fn crystal() -> Verdict {
    let mut verdict = Verdict::default();
    let density = 0.7 * 6.0 / std::f64::consts::PI;
    let mut trial = Trial::new(EVENT, &face_centred(5, density, 20));
    let found = measure(&mut trial, 500_000, 2_000_000, 0.2);
    verdict.near("compressibility factor", found, 54.47, 0.5447);
    verdict.at_most("temperature", trial.energy_drift(), 1e-12);
    verdict
}
