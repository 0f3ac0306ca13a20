//! Rows 37 and 38: engine step, whose errors must follow their laws.

use std::f64::consts::PI;

use super::Verdict;
use super::verdict::number;
use crate::experiment::gases::seed_scene;
use crate::experiment::trial::{EVENT, Trial};
use crate::observe::Observer;
use crate::worker::engines::Choice;

/// Force on the walls after the first tenth of the run, in internal units.
fn wall_force(observer: &Observer, trial: &Trial) -> f64 {
    let averages = observer
        .blocks
        .averages(trial.state().now)
        .expect("a long run");
    averages.settled.wall_impulse / averages.duration
}

/// Holds a figure against its band if its statistical error is less than half of that; else it only tells.
fn resolve(verdict: &mut Verdict, what: &str, (found, error): (f64, f64), (law, band): (f64, f64)) {
    if error <= 0.5 * band {
        verdict.near(what, found, law, band);
    } else {
        let words = [found, error, law, band].map(number);
        let [found, error, law, band] = words;
        verdict.note(format!(
            "{what}: {found} with a statistical error of {error}, too large to judge {law} ± {band}"
        ));
    }
}

/// Row 37.
pub fn laws() -> Verdict {
    const SEEDS: u64 = 16;
    let mut verdict = Verdict::default();
    let force = |choice: Choice, seed: u64, time: f64| {
        let mut trial = Trial::new(choice, &seed_scene(8, seed));
        trial.run(time);
        (wall_force(&trial.observer, &trial), trial)
    };
    let hits = |trial: &Trial| trial.engine.counters().wall_collisions;
    let (mut exact, mut exact_hits) = (0.0, 0);
    for seed in 1..=SEEDS {
        let (force, trial) = force(EVENT, seed, 200.0);
        exact += force;
        exact_hits += hits(&trial);
    }
    for divisor in [7.5, 15.0, 30.0, 60.0, 120.0, 240.0] {
        let step = 1.0 / divisor;
        let (mut sum, mut overlap) = (0.0, 0.0_f64);
        let (mut missed, mut met, mut walls) = (0, 0, 0);
        for seed in 1..=SEEDS {
            let (force, trial) = force(Choice::Step(step), seed, 40.0);
            sum += force;
            overlap = overlap.max(trial.max_overlap());
            missed += trial.engine.counters().missed_collisions;
            met += trial.engine.counters().pair_collisions;
            walls += hits(&trial);
        }
        let name = format!("dt = 1/{divisor}");
        // Shot noise of the wall hits of both runs.
        let noise = (4.0 / PI * (1.0 / walls as f64 + 1.0 / exact_hits as f64)).sqrt();
        let law = -1.25 * step;
        let what = format!("{name}: change of pressure");
        resolve(
            &mut verdict,
            &what,
            (sum / exact - 1.0, noise),
            (law, 0.15 * -law),
        );
        verdict.at_most(format!("{name}: overlap over d"), overlap, 8.0 * step);
        let law = 2.0 / 3.0 * step * step;
        let share = missed as f64 / (missed + met) as f64;
        let noise = share / (missed.max(1) as f64).sqrt();
        let what = format!("{name}: share missed ({missed})");
        resolve(&mut verdict, &what, (share, noise), (law, 0.2 * law));
    }
    verdict
}

/// Row 38.
pub fn counts() -> Verdict {
    let mut verdict = Verdict::default();
    let (mut stepped, mut exact, mut doubled) = (0, 0, 0);
    for seed in 1..=3 {
        let gas = seed_scene(8, seed);
        let mut trial = Trial::new(EVENT, &gas);
        trial.run(6.0);
        exact += trial.engine.counters().pair_collisions;
        let mut trial = Trial::new(Choice::Step(1.0 / 3600.0), &gas);
        trial.run(6.0);
        stepped += trial.engine.counters().pair_collisions;
        doubled += trial.engine.counters().double_bounces;
    }
    let ratio = stepped as f64 / exact as f64;
    verdict.near("collisions of pairs, step over event", ratio, 1.0, 0.05);
    verdict.note(format!(
        "{doubled} double bounces of {stepped}; the student paper's rule gives a ratio of 2.6"
    ));
    verdict
}
