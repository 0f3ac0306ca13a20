//! Engine `reversible`: every word of the state comes back, and what happens is what happens in the `event` engine.

mod common;

use common::{lattice, normal, seed_scene};
use glam::DVec3;
use moltop::domain::{Boundary, Domain, Plane};
use moltop::engine::event_driven::EventDriven;
use moltop::engine::reversible::{Refusal, Reversible, Words};
use moltop::engine::{Counters, Engine};
use moltop::event::{Collision, Participants};
use moltop::observe::Observer;
use moltop::state::{Body, Placement, State, Time};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

fn engine(placement: &Placement) -> Reversible {
    Reversible::new(State::new(placement)).expect("a scene within range")
}

fn run(engine: &mut dyn Engine, until: Time, report: &mut dyn FnMut(&Collision)) {
    engine.advance(until, report).expect("room to move");
}

fn twice(time: Time) -> Time {
    Time {
        epoch: 2 * time.epoch,
        local: 0.0,
    }
    .after(2.0 * time.local)
    .expect("near")
}

/// Words that differ; the second state's velocities negated.
fn differing(start: &[Words], end: &[Words]) -> usize {
    let differing = |(start, end): (&Words, &Words)| {
        (0..3)
            .map(|axis| {
                usize::from(start.0[axis] != end.0[axis])
                    + usize::from(start.1[axis] != -end.1[axis])
            })
            .sum::<usize>()
    };
    start.iter().zip(end).map(differing).sum()
}

/// Balls on a lattice with few different velocities, so that many things happen at once.
fn symmetric_scene(seed: u64) -> Placement {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut placement = lattice(1, 1.0, 4.0, 1);
    placement.positions.clear();
    placement.velocities.clear();
    if random.random_range(0..2) == 0 {
        placement.domain.boundary = Boundary::Periodic;
    }
    let step = [0.5, 0.25][random.random_range(0..2)];
    for _ in 0..random.random_range(2..60) {
        let mut whole = |most: i32| f64::from(random.random_range(-most..=most));
        let most = (1.5 / step) as i32;
        let place = DVec3::new(whole(most), whole(most), whole(most)) * step;
        let velocity = DVec3::new(whole(1), whole(1), whole(1));
        if placement
            .positions
            .iter()
            .all(|other| place.distance(*other) >= 1.0)
        {
            placement.positions.push(place);
            placement.velocities.push(velocity);
        }
    }
    placement
}

/// Runs from time zero to `turn`, back to time zero, and gives the words that differ.
fn echo(engine: &mut Reversible, turn: Time) -> usize {
    let start = engine.words();
    run(engine, turn, &mut |_| {});
    engine.reverse();
    run(engine, twice(turn), &mut |_| {});
    differing(&start, &engine.words())
}

#[track_caller]
fn check_echo(placement: &Placement, time: f64) -> Counters {
    let mut engine = engine(placement);
    let turn = engine.state().units.instant(time);
    let (start, words) = (engine.state().placement(), engine.words());
    let energy = engine.state().totals().kinetic_energy;
    run(&mut engine, turn, &mut |_| {});
    let drift = engine.state().totals().kinetic_energy / energy - 1.0;
    assert!(drift.abs() < 1e-13, "{drift:e}");
    engine.reverse();
    run(&mut engine, twice(turn), &mut |_| {});
    assert_eq!(differing(&words, &engine.words()), 0);
    let counters = engine.counters();
    assert_eq!(counters.remembered_events, 0, "{counters:?}");
    assert_eq!(counters.irreversible_starts, 0, "{counters:?}");
    assert_eq!(counters.late_events, 0, "{counters:?}");
    // The rounded state comes back as well.
    engine.settle();
    let mut back = engine.state().placement();
    back.velocities.iter_mut().for_each(|v| *v = -*v);
    assert_eq!(back, start);
    counters
}

/// Random balls without overlap in a box: several sizes and masses, perhaps an obstacle, a point, a plane.
fn random_scene(seed: u64) -> Placement {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let half_size = DVec3::new(
        random.random_range(2.0..8.0),
        random.random_range(2.0..8.0),
        random.random_range(2.0..8.0),
    );
    let boundary = [Boundary::Container, Boundary::Periodic][random.random_range(0..2)];
    let plane = Plane {
        normal: [DVec3::X, DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z][random.random_range(0..4)],
        offset: random.random_range(-1.0..1.0),
    };
    let with_plane = boundary == Boundary::Container && random.random_range(0..3) == 0;
    let kinds: u32 = random.random_range(1..4);
    let bodies = (0..kinds).map(|_| Body {
        radius: if random.random_range(0..8) == 0 {
            0.0
        } else {
            random.random_range(0.02..1.0)
        },
        mass: if random.random_range(0..10) == 0 {
            f64::INFINITY
        } else {
            10.0_f64.powf(random.random_range(-1.5..1.5))
        },
    });
    let mut placement = Placement {
        bodies: bodies.collect(),
        domain: Domain {
            boundary,
            half_size,
            planes: if with_plane { vec![plane] } else { Vec::new() },
        },
        center: DVec3::ZERO,
        body_of: Vec::new(),
        positions: Vec::new(),
        velocities: Vec::new(),
    };
    for _ in 0..random.random_range(20..4000) {
        let kind = random.random_range(0..kinds);
        let Body { radius, mass } = placement.bodies[kind as usize];
        let room = half_size - radius;
        let place = DVec3::from_array(room.to_array().map(|room| random.random_range(-room..room)));
        if placement.positions.len() < 60 && is_free(&placement, place, radius) {
            placement.positions.push(place);
            placement.body_of.push(kind);
            let velocity = normal(&mut random) / mass.sqrt();
            placement.velocities.push(if mass.is_finite() {
                velocity
            } else {
                DVec3::ZERO
            });
        }
    }
    placement
}

fn is_free(placement: &Placement, place: DVec3, radius: f64) -> bool {
    let period = placement.domain.period();
    let others = placement.positions.iter().zip(&placement.body_of);
    let apart = |(other, &kind): (&DVec3, &u32)| {
        let way = place - *other;
        let way = if period == DVec3::ZERO {
            way
        } else {
            way - (way / period).round() * period
        };
        way.length() > radius + placement.bodies[kind as usize].radius
    };
    let mut planes = placement.domain.planes.iter();
    others.into_iter().all(apart) && planes.all(|plane| plane.distance(place).abs() > radius)
}

#[test]
fn all_512_balls_come_back_to_the_last_bit_after_16_s() {
    let counters = check_echo(&seed_scene(8, 512), 16.0);
    let events = counters.pair_collisions + counters.wall_collisions;
    assert!((21_500..25_000).contains(&events), "{events}");
}

#[test]
fn all_64_balls_come_back_to_the_last_bit_after_3000_collisions_each() {
    let counters = check_echo(&seed_scene(4, 64), 2000.0);
    assert!(counters.pair_collisions > 64 * 3000, "{counters:?}");
}

#[test]
fn all_15625_balls_come_back_to_the_last_bit() {
    let counters = check_echo(&seed_scene(25, 25), 3.0);
    assert!(counters.pair_collisions > 15_625 * 8, "{counters:?}");
}

#[test]
fn random_scenes_come_back_from_any_instant_and_from_the_very_tick_of_any_collision() {
    let mut kinds = [0; 4];
    for seed in 0..150 {
        let placement = random_scene(seed);
        let mut instants = Vec::new();
        let mut forward = engine(&placement);
        let end = forward.state().units.instant(20.0);
        run(&mut forward, end, &mut |collision| {
            instants.push(collision.time);
            kinds[match collision.participants {
                Participants::Pair(..) => 0,
                Participants::Wall(..) => 1,
                Participants::Plane(..) => 2,
                Participants::Face(..) => 3,
            }] += 1;
        });
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut turns = vec![end];
        if !instants.is_empty() {
            turns.push(instants[random.random_range(0..instants.len())]);
            turns.push(
                instants[instants.len() / 2]
                    .after(2.0_f64.powi(-49))
                    .expect("near"),
            );
        }
        for turn in turns {
            let mut engine = engine(&placement);
            assert_eq!(echo(&mut engine, turn), 0, "seed {seed}, turn {turn:?}");
            assert_eq!(engine.counters().remembered_events, 0, "seed {seed}");
            assert_eq!(engine.counters().late_events, 0, "seed {seed}");
        }
    }
    assert!(kinds.iter().all(|&count| count > 2000), "{kinds:?}");
}

#[test]
fn symmetric_scenes_come_back_with_what_happens_at_one_tick_remembered() {
    let (mut plain, mut remembered) = (0, 0);
    for seed in 0..300 {
        let placement = symmetric_scene(seed);
        let mut engine = engine(&placement);
        // In units of 16 epochs: to 1.25, back to 0.5, on to 3.25, back to the start. The clock always runs on.
        let clock = [1.25, 2.0, 4.75, 8.0].map(|time| Time {
            epoch: (time * 16.0) as u64,
            local: 0.0,
        });
        if engine.advance(clock[3], &mut |_| {}).is_err() {
            // A row of balls that fills the box: no engine gets through.
            let mut other = EventDriven::new(State::new(&placement));
            other.advance(clock[3], &mut |_| {}).expect_err("no room");
            continue;
        }
        // Balls that touch at the start make its very instant ambiguous, so what counts is the state just after it.
        let mut engine = Reversible::new(State::new(&placement)).expect("fits");
        let just_after = Time {
            epoch: 0,
            local: 1.0 / 128.0,
        };
        run(&mut engine, just_after, &mut |_| {});
        let start = engine.words();
        for turn in &clock[..3] {
            run(&mut engine, *turn, &mut |_| {});
            engine.reverse();
        }
        let before_end = Time {
            epoch: clock[3].epoch - 1,
            local: 1.0 - just_after.local,
        };
        run(&mut engine, before_end, &mut |_| {});
        assert_eq!(differing(&start, &engine.words()), 0, "seed {seed}");
        let counters = engine.counters();
        plain += usize::from(counters.remembered_events == 0 && counters.pair_collisions > 0);
        remembered += usize::from(counters.remembered_events > 0);
    }
    assert!(plain > 30 && remembered > 100, "{plain}, {remembered}");
}

#[test]
fn a_dense_gas_comes_back() {
    let counters = check_echo(&lattice(6, 1.05, 6.3, 11), 20.0);
    assert!(counters.pair_collisions > 40_000, "{counters:?}");
}

#[test]
fn one_mass_in_a_million_comes_back() {
    let mut placement = seed_scene(5, 9);
    placement.bodies = [1.0, 1e6].map(|mass| Body { radius: 0.5, mass }).to_vec();
    placement.body_of = (0..125).map(|ball| u32::from(ball == 62)).collect();
    placement.velocities[62] /= 1000.0;
    let counters = check_echo(&placement, 30.0);
    assert!(counters.pair_collisions > 5000, "{counters:?}");
}

#[test]
fn masses_of_1_to_1000_and_radii_of_1_to_3_come_back() {
    for boundary in [Boundary::Container, Boundary::Periodic] {
        let mut placement = seed_scene(6, 7);
        placement.domain.boundary = boundary;
        placement.bodies = vec![
            Body {
                radius: 0.5,
                mass: 1000.0,
            },
            Body {
                radius: 0.5 / 3.0,
                mass: 1.0,
            },
        ];
        placement.body_of = (0..216).map(|ball| ball % 2).collect();
        let counters = check_echo(&placement, 20.0);
        assert!(counters.pair_collisions > 4000, "{counters:?}");
    }
}

#[test]
fn where_slices_end_and_how_wide_cells_are_changes_no_bit() {
    let placement = seed_scene(5, 3);
    let mut whole = engine(&placement);
    let end = whole.state().units.instant(2.0);
    run(&mut whole, end, &mut |_| {});
    for width in [0.01, 0.3, 2.0] {
        let mut sliced = Reversible::with_cell_width(State::new(&placement), width).expect("fits");
        for slice in 1..=200 {
            let until = sliced.state().units.instant(f64::from(slice) * 0.01);
            run(&mut sliced, until, &mut |_| {});
        }
        assert_eq!(sliced.words(), whole.words(), "width {width}");
        assert_eq!(sliced.hash(), whole.hash());
        assert_eq!(sliced.state().hash(), whole.state().hash());
    }
}

#[test]
fn collisions_are_those_of_the_event_engine_until_chaos_takes_over() {
    let records = |engine: &mut dyn Engine| {
        let mut records = Vec::new();
        let end = engine.state().units.instant(4.0);
        run(engine, end, &mut |collision| {
            records.push((collision.participants, collision.time))
        });
        records
    };
    for seed in 1..=5 {
        let state = State::new(&seed_scene(5, seed));
        let expected = records(&mut EventDriven::new(state.clone()));
        let found = records(&mut Reversible::new(state).expect("fits"));
        for (index, (found, expected)) in found.iter().zip(&expected).take(500).enumerate() {
            assert_eq!(found.0, expected.0, "seed {seed}, collision {index}");
            // One tick early at most, but for round-off that chaos has made larger.
            let late = found.1.since(expected.1).abs();
            assert!(index > 100 || late < 1e-12, "seed {seed}: {late:e}");
        }
    }
}

#[test]
fn energy_momentum_and_the_virial_balance_and_no_two_balls_ever_overlap() {
    for boundary in [Boundary::Container, Boundary::Periodic] {
        let mut placement = seed_scene(6, 1);
        placement.domain.boundary = boundary;
        let mut engine = engine(&placement);
        let mut observer = Observer::new(engine.state());
        let end = engine.state().units.instant(100.0);
        run(&mut engine, end, &mut |collision| {
            observer.record(collision);
            assert!(
                collision.gap < 1e-13 || !matches!(collision.participants, Participants::Pair(..))
            );
        });
        assert!(engine.counters().pair_collisions > 15_000);
        let drift = observer
            .ledger
            .drift(engine.state().now, &engine.state().totals());
        assert!(drift.energy.expect("energy").abs() < 1e-13, "{drift:?}");
        assert!(drift.momentum.expect("momentum") < 1e-13, "{drift:?}");
        assert!(drift.virial.expect("virial") < 1e-12, "{drift:?}");
        assert_eq!(observer.max_overlap, Some(0.0));
        engine.reverse();
        observer.ledger.reverse(engine.state());
        run(&mut engine, twice(end), &mut |collision| {
            observer.record(collision);
        });
        let drift = observer
            .ledger
            .drift(engine.state().now, &engine.state().totals());
        assert!(drift.energy.expect("energy").abs() < 1e-14, "{drift:?}");
        assert!(drift.virial.expect("virial") < 1e-12, "{drift:?}");
    }
}

#[test]
fn one_ball_is_back_bit_for_bit_after_a_million_bounces() {
    let mut single = lattice(1, 1.0, 8.0, 1);
    single.bodies[0].radius = 1.0;
    single.velocities[0] = DVec3::new(0.75, -0.5, 0.25);
    let mut engine = engine(&single);
    let start = engine.words();
    let end = engine.state().units.instant(48.0 * 131_072.0);
    run(&mut engine, end, &mut |_| {});
    assert_eq!(engine.words(), start);
    assert_eq!(engine.counters().wall_collisions, 131_072 * 12);
    assert_eq!(engine.counters().remembered_events, 0);
}

#[test]
fn a_ball_in_a_corner_turns_round_and_never_leaves_the_box() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(23);
    for case in 0..2000 {
        let mut single = lattice(1, 1.0, 8.0, 1);
        let corner = DVec3::splat(3.5);
        let speed: f64 = random.random_range(0.1..10.0);
        let direction = if case % 2 == 0 {
            DVec3::ONE
        } else {
            normal(&mut random).abs()
        };
        single.velocities[0] = direction * speed;
        // Flush with three walls, two, one or none.
        single.positions[0] = corner;
        for axis in 0..case % 4 {
            single.positions[0][axis] = 3.0;
        }
        let mut engine = engine(&single);
        let start = engine.words();
        for step in 1..=8 {
            let until = engine.state().units.instant(f64::from(step) / speed);
            run(&mut engine, until, &mut |_| {});
            let place = engine.state().placement().positions[0];
            assert!(place.abs().max_element() <= 3.5, "{place}");
        }
        let turn = engine.state().now;
        engine.reverse();
        run(&mut engine, twice(turn), &mut |_| {});
        assert_eq!(differing(&start, &engine.words()), 0);
    }
    let mut single = lattice(1, 1.0, 8.0, 1);
    single.velocities[0] = DVec3::ONE;
    let mut engine = engine(&single);
    let end = engine.state().units.instant(4.0);
    run(&mut engine, end, &mut |_| {});
    assert_eq!(engine.state().placement().velocities[0], DVec3::NEG_ONE);
    assert_eq!(engine.counters().wall_collisions, 3);
}

#[test]
fn a_newtons_cradle_passes_its_velocity_on_bit_for_bit_and_comes_back() {
    for count in [2, 5, 50, 1000_usize] {
        let mut cradle = lattice(1, 1.0, 4096.0, 1);
        cradle.positions = (0..count)
            .map(|ball| DVec3::X * (ball as f64 + if ball == 0 { 0.0 } else { 1.0 }))
            .collect();
        cradle.velocities = vec![DVec3::ZERO; count];
        cradle.velocities[0] = DVec3::X * 0.75;
        let mut engine = engine(&cradle);
        let start = engine.words();
        let turn = engine.state().units.instant(3.0);
        run(&mut engine, turn, &mut |_| {});
        let velocities = engine.state().placement().velocities;
        assert_eq!(velocities[count - 1], DVec3::X * 0.75);
        assert!(velocities[..count - 1].iter().all(|&v| v == DVec3::ZERO));
        assert_eq!(engine.counters().pair_collisions, count as u64 - 1);
        // The touching balls collide at one instant.
        let ties = engine.counters().remembered_events;
        assert_eq!(ties > 0, count > 2, "{ties}");
        engine.reverse();
        run(&mut engine, twice(turn), &mut |_| {});
        assert_eq!(differing(&start, &engine.words()), 0);
    }
}

#[test]
fn a_packing_without_room_ends_with_an_error() {
    let mut engine = engine(&lattice(4, 1.0, 4.0, 1));
    let end = engine.state().units.instant(1.0);
    let stuck = engine.advance(end, &mut |_| {}).expect_err("no room");
    assert!(stuck.to_string().contains("no time progress"), "{stuck}");
}

#[test]
fn a_gas_at_rest_stays_there() {
    let mut resting = seed_scene(3, 1);
    resting.velocities.fill(DVec3::ZERO);
    let mut engine = engine(&resting);
    let end = engine.state().units.instant(10.0);
    run(&mut engine, end, &mut |_| panic!("nothing moves"));
    assert_eq!(engine.state().placement(), resting);
}

#[test]
fn scenes_that_cannot_be_exact_are_refused_with_a_reason() {
    let refusal = |change: &dyn Fn(&mut Placement)| {
        let mut placement = seed_scene(3, 1);
        change(&mut placement);
        let refusal = Reversible::new(State::new(&placement)).expect_err("a refusal");
        assert!(refusal.to_string().starts_with("engine `reversible`"));
        refusal
    };
    let open = refusal(&|scene| scene.domain.boundary = Boundary::Open);
    assert_eq!(open, Refusal::Open);
    let plane = |normal: DVec3| Plane {
        normal: normal.normalize(),
        offset: 2.9,
    };
    let oblique = refusal(&|scene| scene.domain.planes.push(plane(DVec3::new(1.0, 1.0, 0.0))));
    assert_eq!(oblique, Refusal::ObliquePlane(0));
    let masses = refusal(&|scene| {
        scene.bodies.push(Body {
            radius: 0.5,
            mass: 1e12,
        });
        scene.body_of = vec![0; 27];
        scene.body_of[5] = 1;
    });
    assert!(matches!(masses, Refusal::Masses(_)), "{masses}");
    let small = refusal(&|scene| scene.bodies[0].radius = 1e-14);
    assert!(matches!(small, Refusal::SmallBall(_)), "{small}");
}
