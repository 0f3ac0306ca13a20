//! Each calendar against a plain list searched from end to end, on random operations with many ties; and whole runs, which
//! must not depend on the calendar by a bit.

mod common;

use common::seed_scene;
use moltop::calendar::{Bounded, Calendar, Indexed, Lazy};
use moltop::engine::Engine;
use moltop::engine::event_driven::EventDriven;
use moltop::event::{Event, EventKind, Wall};
use moltop::state::State;
use rand::{Rng, RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// The slow twin: one place per ball, looked through for the earliest.
#[derive(Default)]
struct List(Vec<Option<Event>>);

impl List {
    fn first(&self) -> Option<Event> {
        self.0
            .iter()
            .flatten()
            .copied()
            .reduce(|best, event| if event.precedes(&best) { event } else { best })
    }
}

fn random_event(random: &mut impl Rng, ball: u32, balls: u32) -> Event {
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
    // Few different times: most events tie with another. Some are far away.
    let far = if random.random_range(0..10) == 0 {
        1000.0
    } else {
        1.0
    };
    Event::new(
        far * f64::from(random.random_range(0..50)) / 8.0,
        ball,
        kind,
    )
}

/// Random operations on a calendar and the list; `exact` if the calendar holds nothing outdated.
fn compare<C: Calendar>(balls: u32, operations: usize, seed: u64, exact: bool) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut calendar = C::new(balls as usize);
    let mut list = List(vec![None; balls as usize]);
    for _ in 0..operations {
        let ball = random.random_range(0..balls);
        match random.random_range(0..100) {
            0..30 => {
                calendar.remove(ball);
                list.0[ball as usize] = None;
            }
            30 if random.random_range(0..100) == 0 => {
                let later = list.first().map_or(0.0, |first| first.time.floor());
                for event in list.0.iter_mut().flatten() {
                    event.time -= later;
                }
                calendar.rebase(later, list.0.iter().flatten().copied());
            }
            31..70 => {
                // What an engine does most: the first event is replaced by a later one.
                if let Some(first) = calendar.first() {
                    let mut event = random_event(&mut random, first.ball, balls);
                    event.time += first.time;
                    calendar.set(event);
                    list.0[first.ball as usize] = Some(event);
                }
            }
            _ => {
                let event = random_event(&mut random, ball, balls);
                calendar.set(event);
                list.0[ball as usize] = Some(event);
            }
        }
        assert_eq!(calendar.first(), list.first());
        if let Some(event) = calendar.approaching() {
            assert_eq!(list.0[event.ball as usize], Some(event));
        }
        let count = list.0.iter().flatten().count();
        assert!(calendar.len() == count || (!exact && calendar.len() > count));
    }
}

fn a_million_operations<C: Calendar>(exact: bool) {
    for (seed, balls) in [(1, 1), (2, 2), (3, 5), (4, 17), (5, 64), (6, 100)] {
        compare::<C>(balls, 150_000, seed, exact);
    }
    compare::<C>(1000, 100_000, 7, exact);
}

#[test]
fn the_indexed_calendar_gives_the_same_first_event_as_a_linear_search() {
    a_million_operations::<Indexed>(true);
}

#[test]
fn the_lazy_calendar_gives_the_same_first_event_as_a_linear_search() {
    a_million_operations::<Lazy>(false);
}

#[test]
fn the_bounded_calendar_gives_the_same_first_event_as_a_linear_search() {
    a_million_operations::<Bounded>(true);
}

/// As in a gas: each event is followed by another of its ball, some time later.
#[test]
fn the_bounded_calendar_says_what_comes_before_long() {
    const BALLS: u32 = 5000;
    let mut random = Xoshiro256PlusPlus::seed_from_u64(8);
    let mut event = |ball: u32, now: f64| {
        let wait = -random.random::<f64>().ln();
        Event::new(now + wait, ball, EventKind::Crossing { axis: 0 })
    };
    let mut calendar = Bounded::new(BALLS as usize);
    let events: Vec<Event> = (0..BALLS).map(|ball| event(ball, 0.0)).collect();
    calendar.rebase(0.0, events.into_iter());
    let mut given = vec![None; BALLS as usize];
    let [mut foreseen, mut early] = [0; 2];
    for _ in 0..10 * BALLS {
        let first = calendar.first().expect("every ball has an event");
        for _ in 0..2 {
            if let Some(event) = calendar.approaching() {
                assert_ne!(given[event.ball as usize], Some(event), "given twice");
                given[event.ball as usize] = Some(event);
                // Some hundred times the mean time between two events.
                early += u32::from(event.time > first.time + 100.0 / f64::from(BALLS));
            }
        }
        foreseen += u32::from(given[first.ball as usize] == Some(first));
        calendar.set(event(first.ball, first.time));
    }
    assert!(foreseen > 10 * BALLS / 100 * 95, "{foreseen}");
    assert_eq!(early, 0);
}

/// Hash of the state after `time`, and the most events ever in the calendar.
fn run<C: Calendar + Clone>(n: usize, seed: u64, time: f64) -> (u64, u64) {
    let mut engine = EventDriven::<C>::with_calendar(State::new(&seed_scene(n, seed)));
    let half = engine.state().units.instant(0.5 * time);
    let end = engine.state().units.instant(time);
    engine.advance(half, &mut |_| {}).expect("room to move");
    engine.reverse();
    engine.advance(end, &mut |_| {}).expect("room to move");
    (engine.state().hash(), engine.counters().queue_length_max)
}

#[test]
fn a_run_does_not_depend_on_the_calendar_but_only_the_lazy_one_grows() {
    for (n, seed, time) in [(1, 1, 20.0), (2, 2, 50.0), (5, 3, 20.0), (8, 4, 6.0)] {
        let balls = (n * n * n) as u64;
        let (expected, length) = run::<Indexed>(n, seed, time);
        assert!(length <= balls);
        assert_eq!(run::<Bounded>(n, seed, time), (expected, length));
        let (hash, longest) = run::<Lazy>(n, seed, time);
        assert_eq!(hash, expected);
        assert!(
            n < 5 || longest > balls + balls / 4,
            "{longest} events of {balls} balls"
        );
    }
}

/// There are so many balls that the engine asks for their memory ahead of their turn.
#[test]
fn a_large_gas_does_not_depend_on_the_calendar_either() {
    let indexed = run::<Indexed>(28, 5, 0.2);
    assert_eq!(run::<Bounded>(28, 5, 0.2), indexed);
}
