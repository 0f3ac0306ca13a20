//! Why fixed steps do not find the way back: a ball that meets two partners within one step.
//!
//! A step that ends with one overlap is undone by the same step backwards, for the pair is as far apart a step later as it was
//! a step before. Of two overlaps of one ball, the first collision may turn the ball away from the second partner, which then
//! is no longer approached. Backwards it is approached, and they collide. So two different pasts have the same future, and no
//! rule that looks at one step alone can tell them apart. How often that happens falls with the step, what it does grows with
//! time as every error does.

use super::EDGE;
use crate::event::{Collision, Participants};
use crate::experiment::echo::Echo;
use crate::experiment::gases::seed_scene;
use crate::experiment::page::{Table, Value};
use crate::experiment::progress::Progress;
use crate::experiment::trial::Trial;
use crate::state::Time;
use crate::worker::engines::Choice;

/// Steps in a second, and time there \[s\].
const CASES: [(f64, f64); 4] = [(3600.0, 1.0), (900.0, 1.0), (14_400.0, 1.0), (3600.0, 6.0)];

/// Seconds that a step of 512 balls takes, about.
const STEP_COST: f64 = 4e-5;

/// An error of a ball beyond this is no rounding \[d\].
const LOST: f64 = 1e-9;

/// How one data set came back.
struct Back {
    /// Balls that met two partners within one step on the way there.
    double_meetings: u64,
    error: f64,
    lost: u64,
}

/// Runs a data set for so long there and back in steps of `1 / rate`.
fn back((rate, time): (f64, f64), seed: u64) -> Back {
    let gas = seed_scene(EDGE, seed);
    let choice = Choice::Step(1.0 / rate);
    let mut last: Vec<Option<Time>> = vec![None; gas.positions.len()];
    let mut double_meetings = 0;
    let mut meet = |collision: &Collision| {
        let (one, other) = match collision.participants {
            Participants::Pair(one, other) => (one, Some(other)),
            Participants::Wall(one, _) | Participants::Plane(one, _) => (one, None),
            Participants::Face(..) => return,
        };
        for ball in std::iter::once(one).chain(other) {
            let before = last[ball as usize].replace(collision.time);
            double_meetings += u64::from(before == Some(collision.time));
        }
    };
    Trial::new(choice, &gas)
        .try_run(time, &mut meet)
        .expect("room to move");
    let echo = Echo::new(choice, &gas, time);
    Back {
        double_meetings,
        error: echo.position(),
        lost: (echo.errors.iter()).filter(|error| error.0 > LOST).count() as u64,
    }
}

/// Errors of data sets with and without a ball that met two partners within one step; a paragraph of words.
pub fn causes(quick: bool, progress: &mut Progress) -> (Table, Option<String>) {
    let (cases, sets): (&[(f64, f64)], u64) = if quick {
        (&CASES[..1], 4)
    } else {
        (&CASES, 12)
    };
    let columns = [
        "step [s]",
        "time there [s]",
        "balls with two meetings in a step",
        "data sets",
        "of these back to rounding",
        "largest error of those [d]",
        "mean error of the others [d]",
        "mean balls lost of the others",
    ];
    let title = "Fixed steps: what keeps them from coming back";
    let mut table = Table::new("steps", title, &columns);
    let mut words = None;
    for &case in cases {
        let (rate, time) = case;
        let mut backs = Vec::new();
        for seed in 1..=sets {
            if progress.stopped() {
                break;
            }
            backs.push(back(case, seed));
            progress.tell(3.0 * rate * time * STEP_COST, "why steps do not come back");
        }
        for some in [false, true] {
            let own: Vec<&Back> = (backs.iter())
                .filter(|back| (back.double_meetings > 0) == some)
                .collect();
            let (kept, lost): (Vec<&Back>, Vec<&Back>) =
                own.iter().partition(|back| back.lost == 0);
            let mean = |what: fn(&Back) -> f64| -> Value {
                let sum: f64 = lost.iter().map(|back| what(back)).sum();
                (!lost.is_empty()).then(|| sum / lost.len() as f64).into()
            };
            table.push([
                Value::Text(format!("1/{rate}")),
                time.into(),
                if some { "some" } else { "none" }.into(),
                (own.len() as u64).into(),
                (kept.len() as u64).into(),
                kept.iter().map(|back| back.error).reduce(f64::max).into(),
                mean(|back| back.error),
                mean(|back| back.lost as f64),
            ]);
        }
        let met: u64 = backs.iter().map(|back| back.double_meetings).sum();
        words = Some(format!(
            "Fixed steps lose the way back where a ball meets two partners within one step: the first collision may turn it \
             away from the second, and then two pasts have one future. In steps of 1/{rate} s that was the case for {:.2} \
             balls of a data set in {time} s.",
            met as f64 / backs.len().max(1) as f64
        ));
    }
    (table, words)
}
