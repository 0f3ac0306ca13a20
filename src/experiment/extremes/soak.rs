//! Row 29: a thousand million collisions, or as many as the user has time for.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use super::Verdict;
use crate::domain::Boundary;
use crate::experiment::extremes::dense::compressibility;
use crate::experiment::gases::{lattice, stop_drift};
use crate::experiment::theory;
use crate::experiment::trial::{EVENT, Trial, WINDOWED, resident_memory};
use crate::worker::engines::Choice;

const PACKING: f64 = 0.3;

/// Collisions of engine event; engine windowed runs a tenth of them. What `--soak` changes.
pub static COLLISIONS: AtomicU64 = AtomicU64::new(1_000_000_000);

/// Collisions after which memory must not grow any more.
pub const WARM_UP: u64 = 1_000_000;

/// Row 29.
pub fn soak() -> Verdict {
    run(EVENT, COLLISIONS.load(Ordering::Relaxed))
}

/// Row 29, engine windowed: a tenth as long.
pub fn soak_windowed() -> Verdict {
    run(WINDOWED, COLLISIONS.load(Ordering::Relaxed) / 10)
}

/// Runs 1000 balls in a periodic box for that many collisions.
fn run(choice: Choice, events: u64) -> Verdict {
    let mut verdict = Verdict::default();
    let spacing = (std::f64::consts::PI / 6.0 / PACKING).cbrt();
    let mut gas = lattice(10, spacing, 10.0 * spacing, 29);
    gas.domain.boundary = Boundary::Periodic;
    stop_drift(&mut gas);
    let began = Instant::now();
    let mut trial = Trial::new(choice, &gas);
    trial.run_for_events(WARM_UP, 10.0);
    let (start, virial) = (trial.time(), trial.observer.ledger.pair_virial());
    let (mut step, mut gap, mut last, mut monotone) = (start, 0.0_f64, 0, true);
    let mut tenths = Vec::new();
    while trial.events() < events {
        step += 100.0;
        trial
            .try_run(step, &mut |collision| gap = gap.max(collision.gap.abs()))
            .expect("room to move");
        monotone &= trial.events() > last;
        last = trial.events();
        if last > tenths.len() as u64 * events / 10 {
            tenths.extend(resident_memory());
        }
    }
    let gained = trial.observer.ledger.pair_virial() - virial;
    verdict.at_most("energy", trial.energy_drift(), 1e-11);
    verdict.at_most("gap over d", gap, 1e-12);
    verdict.at_most(
        "virial ledger",
        trial.drift().virial.unwrap_or(f64::NAN),
        1e-12,
    );
    verdict.holds("counters only grow", monotone, "yes");
    // The first is taken after one lap, so that what measuring itself touches for the first time is in it.
    match tenths.first().zip(tenths.last()) {
        Some((early, late)) => {
            let grown = late.saturating_sub(*early) as f64;
            verdict.at_most("memory gained from first to last tenth, bytes", grown, 0.0);
            verdict.note(format!("bytes resident at each tenth: {tenths:?}"));
        }
        None => verdict.not_run("memory: the system does not tell"),
    }
    let counters = trial.engine.counters();
    verdict.note(format!(
        "{last} collisions in {:.0} s, {} late, {} ties",
        began.elapsed().as_secs_f64(),
        counters.late_events,
        counters.ties
    ));
    let found = compressibility(trial.state(), gained, trial.time() - start);
    let expected = theory::compressibility(PACKING);
    verdict.near("compressibility factor", found, expected, 0.001 * expected);
    verdict
}
