//! Engine `event`: against an engine that looks at all pairs, and against what must be conserved.

mod common;

use common::{lattice, normal, seed_scene};
use glam::DVec3;
use moltop::collision::{collide, pair_time, wall_time};
use moltop::domain::Domain;
use moltop::engine::event_driven::EventDriven;
use moltop::event::{Collision, Participants, Wall};
use moltop::observe::Observer;
use moltop::state::{Body, Placement, State, Time};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

type Record = (Time, Participants);

/// The slow twin: before every collision it looks at every pair and every wall.
fn all_pairs(mut state: State, collisions: usize) -> Vec<Record> {
    let mut records = Vec::new();
    while records.len() < collisions {
        let Some((time, participants)) = earliest(&state) else {
            break;
        };
        let now = if time > state.now { time } else { state.now };
        state.now = now;
        match participants {
            Participants::Wall(ball, wall) => {
                let limit = limit_of(&state, ball, wall);
                let ball = &mut state.trajectories[ball as usize];
                *ball = ball.synchronized(now);
                ball.position[wall.axis] = limit;
                ball.velocity[wall.axis] = -ball.velocity[wall.axis].abs().copysign(limit);
            }
            Participants::Plane(..) | Participants::Face(..) => {
                unreachable!("a container without planes")
            }
            Participants::Pair(first, second) => {
                let pair =
                    [first, second].map(|ball| state.trajectories[ball as usize].synchronized(now));
                let masses = [first, second].map(|ball| state.bodies.of(ball as usize).mass);
                let separation = pair[0].position - pair[1].position;
                let velocities = collide(separation, pair.map(|ball| ball.velocity), masses);
                for (index, ball) in [first, second].into_iter().enumerate() {
                    state.trajectories[ball as usize] = pair[index];
                    state.trajectories[ball as usize].velocity = velocities[index];
                }
            }
        }
        records.push((now, participants));
    }
    records
}

fn limit_of(state: &State, ball: u32, wall: Wall) -> f64 {
    let limit = state.domain.half_size[wall.axis] - state.bodies.of(ball as usize).radius;
    if wall.upper { limit } else { -limit }
}

fn earliest(state: &State) -> Option<Record> {
    let mut best: Option<Record> = None;
    let mut offer = |time: Option<Time>, participants| {
        // A collision found late happens now; walls before pairs, lower indices first.
        let Some(time) = time.map(|time| if time > state.now { time } else { state.now }) else {
            return;
        };
        if best.is_none_or(|(earliest, _)| time < earliest) {
            best = Some((time, participants));
        }
    };
    let count = state.ball_count() as u32;
    for ball in 0..count {
        for (axis, upper) in [
            (0, false),
            (0, true),
            (1, false),
            (1, true),
            (2, false),
            (2, true),
        ] {
            let wall = Wall { axis, upper };
            let trajectory = &state.trajectories[ball as usize];
            if (trajectory.velocity[axis] > 0.0) == upper {
                offer(
                    wall_time(trajectory, axis, limit_of(state, ball, wall)),
                    Participants::Wall(ball, wall),
                );
            }
        }
    }
    for first in 0..count {
        for second in first + 1..count {
            let contact =
                state.bodies.of(first as usize).radius + state.bodies.of(second as usize).radius;
            let pair = [first, second].map(|ball| &state.trajectories[ball as usize]);
            offer(
                pair_time(pair[0], pair[1], contact),
                Participants::Pair(first, second),
            );
        }
    }
    best
}

/// Balls of one or several sizes at random places without overlap.
fn random_scene(seed: u64) -> Placement {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let count = random.random_range(2..60);
    let kinds = random.random_range(1..4);
    let body = |random: &mut Xoshiro256PlusPlus| Body {
        radius: random.random_range(0.02..1.0),
        mass: random.random_range(0.1..100.0),
    };
    let bodies: Vec<Body> = (0..kinds).map(|_| body(&mut random)).collect();
    let half_size = DVec3::new(
        random.random_range(2.0..8.0),
        random.random_range(2.0..8.0),
        random.random_range(2.0..8.0),
    );
    let mut placement = Placement {
        domain: Domain::container(half_size),
        center: DVec3::ZERO,
        bodies,
        body_of: Vec::new(),
        positions: Vec::new(),
        velocities: Vec::new(),
    };
    for _ in 0..count {
        let kind = random.random_range(0..kinds);
        let radius = placement.bodies[kind as usize].radius;
        let room = half_size - radius;
        for _attempt in 0..100 {
            let place =
                DVec3::from_array(room.to_array().map(|room| random.random_range(-room..room)));
            let free = placement
                .positions
                .iter()
                .zip(&placement.body_of)
                .all(|(other, &kind)| {
                    place.distance(*other) > radius + placement.bodies[kind as usize].radius
                });
            if free {
                placement.positions.push(place);
                placement.body_of.push(kind);
                placement.velocities.push(normal(&mut random));
                break;
            }
        }
    }
    placement
}

#[test]
fn the_grid_and_the_calendar_give_the_collisions_of_all_pairs_on_200_random_scenes() {
    for seed in 0..200 {
        let state = State::new(&random_scene(seed));
        let wanted = 20 * state.ball_count();
        let expected = all_pairs(state.clone(), wanted);
        let mut records = Vec::new();
        let mut engine = EventDriven::new(state);
        let end = expected
            .last()
            .expect("balls in a container always hit a wall")
            .0;
        engine
            .advance(end, &mut |collision| {
                records.push((collision.time, collision.participants))
            })
            .expect("room");
        assert!(
            records.len() >= expected.len(),
            "seed {seed}: {} of {}",
            records.len(),
            expected.len()
        );
        if let Some(index) = (0..expected.len()).find(|&index| records[index] != expected[index]) {
            panic!(
                "seed {seed}, collision {index}: {:?}, expected {:?}",
                records[index], expected[index]
            );
        }
    }
}

fn run(placement: &Placement, time: f64, report: &mut dyn FnMut(&Collision)) -> EventDriven {
    let mut engine = EventDriven::new(State::new(placement));
    engine
        .advance(engine.state().units.instant(time), report)
        .expect("room to move");
    engine
}

#[test]
fn the_width_of_the_cells_and_the_length_of_the_slices_change_no_bit() {
    let placement = seed_scene(6, 3);
    let whole = run(&placement, 2.0, &mut |_| {});
    for width in [0.01, 0.13, 0.3, 2.0] {
        let mut engine = EventDriven::with_cell_width(State::new(&placement), width);
        for slice in 1..=200 {
            let until = engine.state().units.instant(f64::from(slice) * 0.01);
            engine.advance(until, &mut |_| {}).expect("room to move");
        }
        assert_eq!(engine.state().hash(), whole.state().hash(), "width {width}");
    }
}

#[test]
fn energy_momentum_and_the_virial_balance_over_100000_collisions_for_20_seeds() {
    for seed in 1..=20 {
        let state = State::new(&seed_scene(6, seed));
        let mut observer = Observer::new(&state);
        let mut engine = EventDriven::new(state);
        let mut step = 0;
        while engine.counters().pair_collisions + engine.counters().wall_collisions < 100_000 {
            step += 1;
            let until = engine.state().units.instant(f64::from(step) * 10.0);
            engine
                .advance(until, &mut |collision| observer.record(collision))
                .expect("room to move");
        }
        let drift = observer.ledger.drift(engine.state());
        assert!(
            drift.energy.expect("energy").abs() < 1e-13,
            "seed {seed}: {drift:?}"
        );
        assert!(
            drift.momentum.expect("momentum") < 1e-13,
            "seed {seed}: {drift:?}"
        );
        assert!(
            drift.virial.expect("virial") < 1e-12,
            "seed {seed}: {drift:?}"
        );
        assert!(
            observer.max_overlap.expect("collisions") < 1e-13,
            "seed {seed}: {:?}",
            observer.max_overlap
        );
        assert_eq!(engine.counters().late_events, 0);
        assert!(engine.counters().queue_length_max <= 216);
    }
}

#[test]
fn one_second_there_and_back_returns_to_the_start() {
    for seed in 1..=5 {
        let placement = seed_scene(8, seed);
        let mut engine = run(&placement, 1.0, &mut |_| {});
        engine.reverse();
        engine
            .advance(engine.state().units.instant(2.0), &mut |_| {})
            .expect("room to move");
        let back = engine.state().placement();
        let errors = placement
            .positions
            .iter()
            .zip(&back.positions)
            .map(|(start, end)| start.distance(*end));
        let mean = errors.sum::<f64>() / placement.positions.len() as f64;
        assert!(mean < 1e-13, "seed {seed}: {mean:e}");
        let collisions = engine.counters().pair_collisions + engine.counters().wall_collisions;
        assert!(
            (1150..=1350).contains(&collisions),
            "seed {seed}: {collisions}"
        );
    }
}

#[test]
fn units_scaled_by_powers_of_two_give_the_same_bits() {
    let placement = seed_scene(5, 1);
    let mut expected = Vec::new();
    let engine = run(&placement, 9.0, &mut |collision| {
        expected.push((collision.time, collision.participants))
    });
    assert!(expected.len() > 1000);
    for (length, time) in [
        (-31, -40),
        (30, 1),
        (-100, -100),
        (200, -100),
        (-500, 0),
        (-500, -300),
    ] {
        let (length, time) = (2.0_f64.powi(length), 2.0_f64.powi(time));
        let mut scaled = placement.clone();
        scaled.domain = Domain::container(placement.domain.half_size * length);
        scaled.bodies[0].radius *= length;
        scaled
            .positions
            .iter_mut()
            .for_each(|position| *position *= length);
        scaled
            .velocities
            .iter_mut()
            .for_each(|velocity| *velocity = *velocity * length / time);
        let mut records = Vec::new();
        let twin = run(&scaled, 9.0 * time, &mut |collision| {
            records.push((collision.time, collision.participants))
        });
        assert_eq!(records, expected);
        assert_eq!(twin.state().hash(), engine.state().hash());
    }
}

#[test]
fn the_start_of_the_clock_changes_no_bit() {
    let placement = seed_scene(5, 2);
    let early = run(&placement, 3.0, &mut |_| {});
    for epoch in [1 << 20, 1 << 40] {
        let mut state = State::new(&placement);
        state.now.epoch = epoch;
        state
            .trajectories
            .iter_mut()
            .for_each(|trajectory| trajectory.begin.epoch = epoch);
        let mut engine = EventDriven::new(state);
        let mut until = engine.state().units.instant(3.0);
        until.epoch += epoch;
        engine.advance(until, &mut |_| {}).expect("room to move");
        assert_eq!(engine.state().placement(), early.state().placement());
    }
}

#[test]
fn a_packing_without_room_ends_with_an_error_that_names_the_balls() {
    let stuck = {
        let mut engine = EventDriven::new(State::new(&lattice(4, 1.0, 4.0, 1)));
        engine
            .advance(engine.state().units.instant(1.0), &mut |_| {})
            .expect_err("no room")
    };
    assert!(
        stuck.to_string().starts_with("no time progress: ball"),
        "{stuck}"
    );
}

#[test]
fn a_gas_at_rest_stays_there_and_one_ball_bounces_exactly() {
    let mut resting = seed_scene(3, 1);
    resting.velocities.fill(DVec3::ZERO);
    let engine = run(&resting, 10.0, &mut |_| panic!("nothing moves"));
    assert_eq!(engine.state().placement(), resting);
    assert_eq!(engine.queue_length(), 0);

    let mut single = lattice(1, 1.0, 8.0, 1);
    single.bodies[0].radius = 1.0;
    single.velocities[0] = DVec3::new(0.75, -0.5, 0.25);
    let mut hits = 0;
    let engine = run(&single, 12.0 * 65_536.0 * 4.0, &mut |_| hits += 1);
    assert_eq!(engine.state().placement(), single);
    assert_eq!(hits, 65_536 * 4 * 3 * 2 / 4 * 2);
}
