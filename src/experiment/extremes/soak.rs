//! Row 29: a thousand million collisions, or as many as the user has time for.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use super::Verdict;
use crate::domain::Boundary;
use crate::experiment::extremes::dense::compressibility;
use crate::experiment::fit::slope_and_error;
use crate::experiment::gases::{lattice, stop_drift};
use crate::experiment::theory;
use crate::experiment::trial::{EVENT, Trial, WINDOWED, resident_memory};
use crate::worker::engines::Choice;

const PACKING: f64 = 0.3;

/// Collisions of engine event; engine windowed runs a tenth of them. What `--soak` changes.
pub static COLLISIONS: AtomicU64 = AtomicU64::new(1_000_000_000);

/// Collisions after which memory must not grow any more.
pub const WARM_UP: u64 = 1_000_000;

/// Parts of the second half of the run of whose memory the means are taken.
const PARTS: usize = 10;

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
    let mut memory = Vec::new();
    while trial.events() < events {
        step += 10.0;
        trial
            .try_run(step, &mut |collision| gap = gap.max(collision.gap.abs()))
            .expect("room to move");
        monotone &= trial.events() > last;
        last = trial.events();
        memory.extend(resident_memory().map(|bytes| (last as f64, bytes as f64)));
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
    gains_no_memory(&mut verdict, &memory);
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

/// Checks that resident memory, taken at so many collisions, has ceased to rise: no slope beyond its error in the second half.
///
/// In the first half lists may still grow to the longest that chance brings about; what leaks never ceases. The allocator takes
/// memory from the system and gives it back, megabytes at a time, so one moment says nothing of another; means of many do.
fn gains_no_memory(verdict: &mut Verdict, memory: &[(f64, f64)]) {
    const ERRORS: f64 = 4.0;
    let (early, memory) = memory.split_at(memory.len() / 2);
    let share = memory.len() / PARTS;
    if share == 0 {
        verdict.not_run("memory: the system does not tell, or the run is too short");
        return;
    }
    let mean = |laps: &[(f64, f64)]| {
        let sum = laps
            .iter()
            .fold((0.0, 0.0), |sum, lap| (sum.0 + lap.0, sum.1 + lap.1));
        (sum.0 / share as f64, sum.1 / share as f64)
    };
    let parts: Vec<_> = memory.chunks_exact(share).take(PARTS).map(mean).collect();
    let (slope, error) = slope_and_error(&parts);
    verdict.at_most("memory gained, bytes per collision", slope, ERRORS * error);
    let gained = parts[0].1 - early[0].1;
    verdict.note(format!(
        "{gained:.0} bytes gained in the first half; mean of the bytes resident in each tenth of the second: {:.0?}",
        parts.iter().map(|part| part.1).collect::<Vec<_>>()
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::extremes::verdict::Outcome;

    #[test]
    fn memory_may_come_and_go_but_not_grow() {
        let laps = |come_and_gone: f64, gain: f64| -> Vec<(f64, f64)> {
            let lap = |lap: u32| {
                let collisions = 5e5 * f64::from(lap);
                let taken = come_and_gone * f64::from(lap * lap % 7 / 3);
                (collisions, 9e6 + taken + gain * collisions)
            };
            (0..200).map(lap).collect()
        };
        let outcome = |laps: &[(f64, f64)]| {
            let mut verdict = Verdict::default();
            gains_no_memory(&mut verdict, laps);
            verdict.outcome()
        };
        assert_eq!(outcome(&laps(2e6, 0.0)), Outcome::Pass);
        assert_eq!(outcome(&laps(2e6, 0.01)), Outcome::Fail);
        assert_eq!(outcome(&laps(0.0, 0.0)), Outcome::Pass);
        assert_eq!(outcome(&laps(0.0, 0.01)), Outcome::Fail);
        let ceases: Vec<_> = laps(0.0, 0.01)
            .iter()
            .map(|lap| (lap.0, lap.1.min(9.3e6)))
            .collect();
        assert_eq!(outcome(&ceases), Outcome::Pass);
        assert_eq!(outcome(&laps(0.0, 0.0)[..9]), Outcome::NotRun);
    }
}
