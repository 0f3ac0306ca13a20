//! Rows 37 and 38: engine step, whose errors must follow their laws.

use super::Verdict;
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

/// Row 37.
pub fn laws() -> Verdict {
    let mut verdict = Verdict::default();
    let seeds = 1..=8_u64;
    let time = 40.0;
    let force = |choice: Choice, seed: u64| {
        let mut trial = Trial::new(choice, &seed_scene(8, seed));
        trial.run(time);
        (wall_force(&trial.observer, &trial), trial)
    };
    let exact: f64 = seeds.clone().map(|seed| force(EVENT, seed).0).sum();
    for divisor in [7.5, 15.0, 30.0, 60.0, 120.0, 240.0] {
        let step = 1.0 / divisor;
        let runs: Vec<_> = seeds
            .clone()
            .map(|seed| force(Choice::Step(step), seed))
            .collect();
        let change = runs.iter().map(|run| run.0).sum::<f64>() / exact - 1.0;
        let overlap = runs
            .iter()
            .fold(0.0_f64, |worst, run| worst.max(run.1.max_overlap()));
        let (mut missed, mut met) = (0, 0);
        for (_, trial) in &runs {
            missed += trial.engine.counters().missed_collisions;
            met += trial.engine.counters().pair_collisions;
        }
        let name = format!("dt = 1/{divisor}");
        let law = -1.25 * step;
        verdict.near(
            format!("{name}: change of pressure"),
            change,
            law,
            0.15 * -law,
        );
        verdict.at_most(format!("{name}: overlap over d"), overlap, 8.0 * step);
        let law = 2.0 / 3.0 * step * step;
        let share = missed as f64 / (missed + met) as f64;
        verdict.near(
            format!("{name}: share missed ({missed})"),
            share,
            law,
            0.2 * law,
        );
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
