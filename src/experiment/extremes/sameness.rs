//! Rows 28 and 30: the same bits however a gas is run, and accounts that balance in every scene.

use rand::RngExt;

use super::Verdict;
use crate::domain::Boundary;
use crate::engine::Engine;
use crate::engine::event_driven::EventDriven;
use crate::engine::windowed::Windowed;
use crate::experiment::gases::{face_centred, generator, lattice, random_mixture, seed_scene};
use crate::experiment::trial::{EVENT, REVERSIBLE, Trial, WINDOWED};
use crate::state::{Placement, State};
use crate::worker::engines::{CalendarName, Choice};

/// What [`State::hash`] gives for the seed's scene of 512 balls, velocities of seed 1, after 10 s, on any machine and in any
/// build.
const KNOWN_HASH: u64 = 0x0cab_5c5a_2f28_aca6;

fn hash_after(choice: Choice, gas: &Placement, time: f64) -> u64 {
    let mut trial = Trial::new(choice, gas);
    trial.run(time);
    trial.state().hash()
}

/// Row 28.
pub fn same_bits() -> Verdict {
    let mut verdict = Verdict::default();
    let gas = seed_scene(8, 1);
    let time = 10.0;
    let expected = hash_after(EVENT, &gas, time);
    let mut different = |what: &str, found: u64| {
        let holds = found == expected;
        verdict.holds(what, holds, "the same state, bit for bit");
    };
    different("again", hash_after(EVENT, &gas, time));
    for calendar in [CalendarName::Lazy, CalendarName::Bounded] {
        different(
            &format!("calendar {calendar:?}"),
            hash_after(Choice::Event(calendar), &gas, time),
        );
    }
    for threads in [1, 2, 4] {
        // So few balls are not worth a second thread: each has its region all the same.
        let mut engine = Windowed::with_regions(State::new(&gas), threads);
        let until = engine.state().units.instant(time);
        engine.advance(until, &mut |_| {}).expect("room to move");
        different(
            &format!("windowed, {threads} threads"),
            engine.state().hash(),
        );
    }
    for width in [0.05, 0.2, 1.0] {
        let mut engine = EventDriven::with_cell_width(State::new(&gas), width);
        let until = engine.state().units.instant(time);
        engine.advance(until, &mut |_| {}).expect("room to move");
        different(&format!("cells {width} wide"), engine.state().hash());
    }
    let mut random = generator(28);
    for choice in [EVENT, WINDOWED] {
        let mut trial = Trial::new(choice, &gas);
        let mut slice = 0.0;
        while slice < time {
            slice = time.min(slice + 0.1 * random.random::<f64>());
            trial.run(slice);
        }
        different(
            &format!("{} in random slices", choice.name()),
            trial.state().hash(),
        );
        let mut trial = Trial::new(choice, &gas);
        trial.run(10.0 * random.random::<f64>());
        let mut trial = Trial::resume(choice, trial.state().clone());
        trial.run(time);
        different(
            &format!("{} resumed at a random time", choice.name()),
            trial.state().hash(),
        );
    }
    let others = [Choice::Step(1.0 / 64.0)].into_iter().chain([REVERSIBLE]);
    for choice in others {
        let [first, second] = [(); 2].map(|()| hash_after(choice, &gas, time));
        verdict.holds(
            format!("{} again", choice.name()),
            first == second,
            "the same state, bit for bit",
        );
    }
    let known = expected == KNOWN_HASH;
    verdict.holds("the hash that other builds and machines gave", known, "yes");
    verdict.note(format!(
        "hash {expected:016x}, debug assertions {}",
        cfg!(debug_assertions)
    ));
    let build = if cfg!(debug_assertions) {
        "release"
    } else {
        "debug"
    };
    verdict.not_run(format!(
        "{build} builds and other processors: this process is none of them; each must give the known hash"
    ));
    verdict
}

/// Row 30.
pub fn ledger() -> Verdict {
    let mut verdict = Verdict::default();
    let scenes = [
        ("seed's scene", seed_scene(8, 1), 20.0),
        ("dense", lattice(8, 1.02, 8.2, 2), 1.0),
        ("dilute", lattice(10, 10.0, 105.0, 3), 200.0),
        ("periodic fluid", face_centred(5, 0.8, 4), 10.0),
        ("periodic crystal", face_centred(4, 1.3, 5), 2.0),
        ("mixture", random_mixture(38), 20.0),
    ];
    for (what, gas, time) in &scenes {
        let engines = [EVENT, WINDOWED, Choice::Step(1.0 / 256.0)];
        for choice in engines.into_iter().chain([REVERSIBLE]) {
            let windowed = matches!(choice, Choice::Windowed(_));
            if windowed && !Windowed::supports(gas) {
                continue;
            }
            // Dense gases are not what engine windowed is made for: it runs a shorter part of them.
            let dense = gas.domain.boundary == Boundary::Periodic;
            let part = if windowed && dense { 0.1 } else { 1.0 };
            let mut trial = Trial::new(choice, gas);
            trial.run(part * time);
            let residual = trial.drift().virial.unwrap_or(f64::NAN);
            let what = format!("{}, {what}, {} collisions", choice.name(), trial.events());
            verdict.at_most(what, residual, 1e-12);
        }
    }
    verdict
}
