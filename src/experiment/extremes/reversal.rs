//! Rows 25 to 27 and 40: there and back, exactly or as far as chaos lets rounding go.

use super::Verdict;
use crate::engine::Engine;
use crate::engine::reversible::{Reversible, Words};
use crate::experiment::echo::{Echo, mean_distance};
use crate::experiment::fit::slope;
use crate::experiment::gases::seed_scene;
use crate::experiment::trial::{EVENT, REVERSIBLE, Trial, processor_seconds};
use crate::state::{Placement, State};

fn echo_of(seed: u64, time: f64) -> Echo {
    Echo::new(EVENT, &seed_scene(8, seed), time)
}

/// Row 25.
pub fn echo() -> Verdict {
    let mut verdict = Verdict::default();
    for (time, bound, events) in [
        (1.0, 2e-14, 1250.0),
        (6.0, 1e-6, 8650.0),
        (11.0, 1.1, 16_100.0),
        (16.0, 6.0, 23_200.0),
    ] {
        let runs: Vec<_> = (1..=5).map(|seed| echo_of(seed, time)).collect();
        let mean = runs.iter().map(Echo::position).sum::<f64>() / 5.0;
        verdict.at_most(
            format!("{time} s there and back: error of position"),
            mean,
            bound,
        );
        let counts: Vec<f64> = runs.iter().map(|run| run.trial.events() as f64).collect();
        let farthest = counts.iter().fold(0.0_f64, |worst, count| {
            worst.max((count / events - 1.0).abs())
        });
        let what = format!("{time} s: collisions over {events}, farthest from 1");
        verdict.at_most(what, farthest, 0.08);
    }
    verdict
}

/// Collisions per ball and time.
fn rate(trial: &Trial) -> f64 {
    let pairs = trial.engine.counters().pair_collisions as f64;
    2.0 * pairs / trial.state().ball_count() as f64 / trial.time()
}

/// Growth per collision of a ball, from the logarithms of errors at whole times 1 to 9, averaged over five seeds.
fn growth_per_collision(mut error: impl FnMut(u64, f64) -> (f64, f64)) -> (f64, f64) {
    let mut points = Vec::new();
    let mut rates = 0.0;
    for time in 1..=9 {
        let time = f64::from(time);
        let runs: Vec<_> = (1..=5).map(|seed| error(seed, time)).collect();
        let logarithm = runs.iter().map(|run| libm::log(run.0)).sum::<f64>() / 5.0;
        rates = runs.iter().map(|run| run.1).sum::<f64>() / 5.0;
        points.push((time, logarithm));
    }
    (slope(&points) / rates, rates)
}

/// Row 27.
pub fn growth() -> Verdict {
    let mut verdict = Verdict::default();
    let (found, rate) = growth_per_collision(|seed, time| {
        let echo = echo_of(seed, time);
        (echo.position(), rate(&echo.trial))
    });
    verdict.near(
        "growth exponent per collision of a ball",
        found,
        1.55,
        0.155,
    );
    verdict.note(format!(
        "{rate:.3} collisions per ball and s; errors of 1 to 9 s, {:.0} collisions per ball",
        8.0 * rate
    ));
    verdict
}

/// Row 40.
pub fn one_bit() -> Verdict {
    let mut verdict = Verdict::default();
    let (found, _) = growth_per_collision(|seed, time| {
        let gas = seed_scene(8, seed);
        let mut changed = gas.clone();
        let component = &mut changed.velocities[100].x;
        // Not the last bit: that one is lost where velocities are added to positions.
        *component = f64::from_bits(component.to_bits() ^ 1 << 8);
        let run = |gas: &Placement| {
            let mut trial = Trial::new(EVENT, gas);
            trial.run(time);
            trial
        };
        let (first, second) = (run(&gas), run(&changed));
        let error = mean_distance(&first.state().placement(), &second.state().placement());
        (error, rate(&first))
    });
    let (echo, _) = growth_per_collision(|seed, time| {
        let echo = echo_of(seed, time);
        (echo.position(), rate(&echo.trial))
    });
    verdict.near(
        "growth exponent of one bit over that of the echo",
        found / echo,
        1.0,
        0.1,
    );
    verdict.note(format!(
        "one bit {found:.3}, echo {echo:.3} per collision of a ball"
    ));
    verdict
}

/// Row 26, 16 s.
pub fn exact_echo() -> Verdict {
    exact_echo_of(8, 16.0)
}

/// Row 26, 64 balls, 2000 s.
pub fn long_exact_echo() -> Verdict {
    let mut verdict = exact_echo_of(4, 2000.0);
    for (n, time) in [(4, 200.0), (8, 40.0)] {
        compare_cost(&mut verdict, n, time);
    }
    verdict
}

/// Row 26, 15,625 balls, 46 s: a hundred collisions of each ball there, and as many back.
pub fn large_exact_echo() -> Verdict {
    exact_echo_of(25, 46.0)
}

/// What exact reversal costs: the least processor time of a few runs each, taken in turns.
fn compare_cost(verdict: &mut Verdict, n: usize, time: f64) {
    let gas = seed_scene(n, 1);
    let mut least = [f64::INFINITY; 2];
    for _ in 0..3 {
        for (choice, least) in [REVERSIBLE, EVENT].into_iter().zip(&mut least) {
            let began = processor_seconds();
            Trial::new(choice, &gas).run(time);
            *least = least.min(processor_seconds() - began);
        }
    }
    let what = format!(
        "{} balls: processor time over that of engine event",
        n * n * n
    );
    verdict.at_most(what, least[0] / least[1], 8.0);
}

fn exact_echo_of(n: usize, time: f64) -> Verdict {
    let mut verdict = Verdict::default();
    let state = State::new(&seed_scene(n, 1));
    let energy = state.totals().kinetic_energy;
    let turn = state.units.instant(time);
    let end = state.units.instant(2.0 * time);
    let mut engine = Reversible::new(state).expect("a scene within range");
    let start = engine.words();
    engine.advance(turn, &mut |_| {}).expect("room to move");
    let drift = (engine.state().totals().kinetic_energy / energy - 1.0).abs();
    engine.reverse();
    engine.advance(end, &mut |_| {}).expect("room to move");
    let differ = |(start, end): (&Words, &Words)| -> usize {
        (0..3)
            .map(|axis| {
                usize::from(start.0[axis] != end.0[axis])
                    + usize::from(start.1[axis] != -end.1[axis])
            })
            .sum()
    };
    let words = engine.words();
    let different: usize = start.iter().zip(&words).map(differ).sum();
    let counters = engine.counters();
    verdict.equal(
        format!("words that differ of {}", 6 * start.len()),
        &different,
        &0,
    );
    verdict.at_most("energy at the turn", drift, 1e-13);
    let events = counters.pair_collisions + counters.wall_collisions;
    let (ties, remembered) = (counters.ties, counters.remembered_events);
    verdict.note(format!(
        "{events} collisions there and back, {:.0} of each ball with others one way, {ties} ties, {remembered} remembered",
        counters.pair_collisions as f64 / start.len() as f64
    ));
    verdict
}
