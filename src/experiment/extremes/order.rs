//! Rows 41 and 42: fast structures against slow twins.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use rand::{Rng, RngExt};

use super::Verdict;
use crate::calendar::{Bounded, Calendar, Indexed, Lazy};
use crate::event::{Event, EventKind, Wall};
use crate::experiment::all_pairs;
use crate::experiment::gases::{generator, random_mixture};
use crate::experiment::trial::{EVENT, Trial, WINDOWED};
use crate::state::State;

/// An event in the order of events.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ordered(Event);

impl Eq for Ordered {}

impl Ord for Ordered {
    fn cmp(&self, other: &Self) -> Ordering {
        if self.0.precedes(&other.0) {
            Ordering::Less
        } else if other.0.precedes(&self.0) {
            Ordering::Greater
        } else {
            Ordering::Equal
        }
    }
}

impl PartialOrd for Ordered {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Few different times, so that most events tie with another.
fn random_event(random: &mut impl Rng, ball: u32, balls: u32, from: f64) -> Event {
    let kind = match random.random_range(0..4) {
        0 => EventKind::Crossing {
            axis: random.random_range(0..3),
        },
        1 => EventKind::Wall(Wall {
            axis: random.random_range(0..3),
            upper: random.random(),
        }),
        _ => EventKind::Pair {
            partner: random.random_range(0..balls),
        },
    };
    Event::new(
        from + f64::from(random.random_range(0..50)) / 8.0,
        ball,
        kind,
    )
}

/// Operations after which the calendar's first event is not the ordered map's.
fn differences<C: Calendar>(operations: u32) -> u32 {
    const BALLS: u32 = 500;
    let mut random = generator(41);
    let mut calendar = C::new(BALLS as usize);
    let mut own: Vec<Option<Event>> = vec![None; BALLS as usize];
    let mut ordered = BTreeSet::new();
    let mut wrong = 0;
    for _ in 0..operations {
        let first = ordered.first().map(|first: &Ordered| first.0);
        let from = first.map_or(0.0, |first| first.time);
        // Half of the time the first event is replaced by a later one, as an engine does.
        let ball = match first {
            Some(first) if random.random() => first.ball,
            _ => random.random_range(0..BALLS),
        };
        if let Some(old) = own[ball as usize].take() {
            ordered.remove(&Ordered(old));
        }
        if random.random_range(0..4) == 0 {
            calendar.remove(ball);
        } else {
            let event = random_event(&mut random, ball, BALLS, from);
            calendar.set(event);
            own[ball as usize] = Some(event);
            ordered.insert(Ordered(event));
        }
        wrong += u32::from(calendar.first() != ordered.first().map(|first| first.0));
        if from > 4.0 {
            let later = from.floor();
            own.iter_mut()
                .flatten()
                .for_each(|event| event.time -= later);
            ordered = own.iter().flatten().map(|&event| Ordered(event)).collect();
            calendar.rebase(later, own.iter().flatten().copied());
        }
    }
    wrong
}

/// Operations on each calendar in row 41.
const OPERATIONS: u32 = 1_000_000;

/// Row 41.
pub fn calendars() -> Verdict {
    let mut verdict = Verdict::default();
    let wrong = [
        ("indexed", differences::<Indexed>(OPERATIONS)),
        ("lazy", differences::<Lazy>(OPERATIONS)),
        ("bounded", differences::<Bounded>(OPERATIONS)),
    ];
    for (name, wrong) in wrong {
        verdict.equal(
            format!("{name}: wrong first events of a million"),
            &wrong,
            &0,
        );
    }
    verdict
}

/// Row 42.
pub fn grids() -> Verdict {
    let mut verdict = Verdict::default();
    let (mut scenes, mut events, mut most) = (0, 0, 0);
    let mut different = [Vec::new(), Vec::new()];
    for seed in 0..200 {
        let gas = random_mixture(seed);
        let state = State::new(&gas);
        let balls = state.ball_count();
        if balls < 2 {
            continue;
        }
        // Walls included, some twenty collisions per ball.
        let expected = all_pairs::collisions(state.clone(), 20 * balls);
        let Some(end) = expected.last().map(|record| record.0) else {
            continue;
        };
        scenes += 1;
        events += expected.len();
        most = most.max(balls);
        for (choice, different) in [EVENT, WINDOWED].into_iter().zip(&mut different) {
            let mut trial = Trial::resume(choice, state.clone());
            let mut records = Vec::new();
            trial
                .engine
                .advance(end, &mut |collision| {
                    records.push((collision.time, collision.participants))
                })
                .expect("room to move");
            if records.len() < expected.len() || records[..expected.len()] != expected[..] {
                different.push(seed);
            }
        }
    }
    for (choice, different) in [EVENT, WINDOWED].into_iter().zip(&different) {
        let what = format!(
            "{}: scenes with other collisions than all pairs",
            choice.name()
        );
        verdict.equal(what, different, &Vec::new());
    }
    verdict.note(format!(
        "{events} collisions in {scenes} scenes of up to {most} balls"
    ));
    verdict
}
