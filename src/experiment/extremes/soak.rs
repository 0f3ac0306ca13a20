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

/// Collisions before anything is judged.
pub const WARM_UP: u64 = 1_000_000;

/// Parts of the run of whose memory the means are taken.
const PARTS: usize = 20;

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
    let mut memory = Memory::default();
    while trial.events() < events {
        step += 10.0;
        trial
            .try_run(step, &mut |collision| gap = gap.max(collision.gap.abs()))
            .expect("room to move");
        monotone &= trial.events() > last;
        last = trial.events();
        if let Some(bytes) = resident_memory() {
            memory.note(last as f64, events as f64, bytes as f64);
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
    memory.judge(&mut verdict);
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

/// Resident memory in the parts of a run; takes none itself as the run goes on.
#[derive(Default)]
struct Memory {
    /// Of each part how often it was looked at, and the sums of the collisions and of the bytes then.
    sums: [[f64; 3]; PARTS],
}

impl Memory {
    /// Notes the bytes that are resident after so many of all collisions.
    fn note(&mut self, collisions: f64, all: f64, bytes: f64) {
        let part = (PARTS as f64 * collisions / all) as usize;
        let sums = &mut self.sums[part.min(PARTS - 1)];
        for (sum, term) in sums.iter_mut().zip([1.0, collisions, bytes]) {
            *sum += term;
        }
    }

    /// Checks that memory has ceased to rise: no slope beyond its error in the second half.
    ///
    /// In the first half lists may still grow to the longest that chance brings about; what leaks never ceases. The allocator takes
    /// memory from the system and gives it back, megabytes at a time, so one moment says nothing of another; means of many do.
    fn judge(&self, verdict: &mut Verdict) {
        const ERRORS: f64 = 4.0;
        if self.sums.iter().any(|&[looks, ..]| looks == 0.0) {
            verdict.not_run("memory: the system does not tell, or the run is too short");
            return;
        }
        let means = self
            .sums
            .map(|[looks, collisions, bytes]| (collisions / looks, bytes / looks));
        let (slope, error) = slope_and_error(&means[PARTS / 2..]);
        verdict.at_most("memory gained, bytes per collision", slope, ERRORS * error);
        let bytes = means.map(|mean| mean.1.round() as u64);
        verdict.note(format!(
            "mean of the bytes resident in each twentieth: {bytes:?}"
        ));
    }
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
            let mut memory = Memory::default();
            for &(collisions, bytes) in laps {
                memory.note(collisions, 1e8, bytes);
            }
            memory.judge(&mut verdict);
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
