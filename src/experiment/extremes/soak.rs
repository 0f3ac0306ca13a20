//! Row 29: a thousand million collisions.

use super::Verdict;
use crate::experiment::extremes::dense::compressibility;
use crate::experiment::gases::face_centred;
use crate::experiment::theory;
use crate::experiment::trial::{EVENT, Trial, resident_memory};

/// Row 29.
pub fn soak() -> Verdict {
    let mut verdict = Verdict::default();
    let packing = 0.3;
    let density = packing * 6.0 / std::f64::consts::PI;
    // 864 balls; 1372 is the next lattice.
    let mut trial = Trial::new(EVENT, &face_centred(6, density, 29));
    trial.run_for_events(1_000_000, 10.0);
    let memory = resident_memory();
    let (start, virial) = (trial.time(), trial.observer.ledger.pair_virial());
    let (mut step, mut gap, mut last, mut monotone) = (start, 0.0_f64, 0, true);
    while trial.events() < 1_000_000_000 {
        step += 100.0;
        trial
            .try_run(step, &mut |collision| gap = gap.max(collision.gap.abs()))
            .expect("room to move");
        monotone &= trial.events() > last;
        last = trial.events();
    }
    let gained = trial.observer.ledger.pair_virial() - virial;
    let found = compressibility(trial.state(), gained, trial.time() - start);
    let expected = theory::compressibility(packing);
    verdict.at_most("energy", trial.energy_drift(), 1e-11);
    verdict.at_most("gap over d", gap, 1e-12);
    verdict.near("compressibility factor", found, expected, 0.001 * expected);
    verdict.holds("counters only grow", monotone, "yes");
    match memory.zip(resident_memory()) {
        Some((before, now)) => {
            let grown = now.saturating_sub(before) as f64;
            verdict.at_most("memory gained after the first million, bytes", grown, 0.0);
        }
        None => verdict.not_run("memory: the system does not tell"),
    }
    verdict
}
