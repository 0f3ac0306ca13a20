//! The calendar against a plain list searched from end to end, on random operations with many ties.

use moltop::calendar::Calendar;
use moltop::event::{Event, EventKind, Wall};
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
    // Few different times: most events tie with another.
    Event::new(f64::from(random.random_range(0..50)), ball, kind)
}

fn compare(balls: u32, operations: usize, seed: u64) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut calendar = Calendar::new(balls as usize);
    let mut list = List(vec![None; balls as usize]);
    for _ in 0..operations {
        let ball = random.random_range(0..balls);
        match random.random_range(0..100) {
            0..30 => {
                calendar.remove(ball);
                list.0[ball as usize] = None;
            }
            30 if random.random_range(0..100) == 0 => {
                calendar.rebuild(list.0.iter().flatten().copied())
            }
            31..60 => {
                // What an engine does most: the first event is replaced by a later one.
                if let Some(first) = calendar.first() {
                    let event = random_event(&mut random, first.ball, balls);
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
        assert_eq!(calendar.len(), list.0.iter().flatten().count());
    }
}

#[test]
fn a_million_random_operations_give_the_same_first_event_as_a_linear_search() {
    for (seed, balls) in [(1, 1), (2, 2), (3, 5), (4, 17), (5, 64), (6, 100)] {
        compare(balls, 150_000, seed);
    }
    compare(1000, 100_000, 7);
}
