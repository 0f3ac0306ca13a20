//! Engine `event`: against an engine that looks at all pairs, and against what must be conserved.

mod common;
#[path = "common/random_scene.rs"]
mod random_scene;

use common::{lattice, seed_scene};
use glam::{DVec3, IVec3};
use moltop::collision::{collide, image_pair_time, plane_time, reflect, wall_time};
use moltop::domain::{Boundary, Domain};
use moltop::engine::Engine;
use moltop::engine::event_driven::EventDriven;
use moltop::event::{Collision, Participants, Wall};
use moltop::observe::Observer;
use moltop::state::{Placement, State, Time, Trajectory};
use random_scene::random_scene;

type Record = (Time, Participants);

/// The slow twin: before every collision it looks at every pair, at every image, every wall and every plane.
fn all_pairs(mut state: State, collisions: usize) -> Vec<Record> {
    let mut records = Vec::new();
    while records.len() < collisions {
        let Some((time, participants, shift)) = earliest(&state) else {
            break;
        };
        let now = if time > state.now { time } else { state.now };
        state.now = now;
        let fly = |ball: u32| state.trajectories[ball as usize].synchronized(now);
        let body = |ball: u32| state.bodies.of(ball as usize);
        match participants {
            Participants::Wall(ball, wall) => {
                let mut flight = fly(ball);
                let limit = limit_of(&state, wall, body(ball).radius);
                flight.position[wall.axis] = limit;
                flight.velocity[wall.axis] = -flight.velocity[wall.axis].abs().copysign(limit);
                state.trajectories[ball as usize] = flight;
            }
            Participants::Face(ball, face) => {
                let mut flight = fly(ball);
                flight.position[face.axis] = -limit_of(&state, face, 0.0);
                state.trajectories[ball as usize] = flight;
            }
            Participants::Plane(ball, index) => {
                let mut flight = fly(ball);
                let planes = &state.domain.planes;
                let upper = state.sides[ball as usize * planes.len() + index as usize];
                flight.velocity = reflect(flight.velocity, &planes[index as usize], upper);
                state.trajectories[ball as usize] = flight;
            }
            Participants::Pair(first, second) => {
                let pair = [fly(first), fly(second)];
                let masses = [body(first).mass, body(second).mass];
                let separation = pair[0].position - pair[1].position + shift;
                let velocities = collide(separation, pair.map(|ball| ball.velocity), masses);
                for (one, ball) in [first, second].into_iter().enumerate() {
                    if masses[one].is_finite() {
                        state.trajectories[ball as usize] = Trajectory {
                            velocity: velocities[one],
                            ..pair[one]
                        };
                    }
                }
            }
        }
        records.push((now, participants));
    }
    records
}

fn limit_of(state: &State, wall: Wall, radius: f64) -> f64 {
    let limit = state.domain.half_size[wall.axis] - radius;
    if wall.upper { limit } else { -limit }
}

fn earliest(state: &State) -> Option<(Time, Participants, DVec3)> {
    let mut best: Option<(Time, Participants, DVec3)> = None;
    let mut offer = |time: Option<Time>, participants, shift| {
        // A collision found late happens now; walls before planes before pairs, lower indices first.
        let Some(time) = time.map(|time| if time > state.now { time } else { state.now }) else {
            return;
        };
        if best.is_none_or(|(earliest, ..)| time < earliest) {
            best = Some((time, participants, shift));
        }
    };
    let periodic = state.domain.boundary == Boundary::Periodic;
    let count = state.ball_count() as u32;
    for ball in 0..count {
        let flight = &state.trajectories[ball as usize];
        let radius = if periodic {
            0.0
        } else {
            state.bodies.of(ball as usize).radius
        };
        for (axis, upper) in [
            (0, false),
            (0, true),
            (1, false),
            (1, true),
            (2, false),
            (2, true),
        ] {
            let wall = Wall { axis, upper };
            if state.domain.boundary != Boundary::Open && (flight.velocity[axis] > 0.0) == upper {
                let who = if periodic {
                    Participants::Face(ball, wall)
                } else {
                    Participants::Wall(ball, wall)
                };
                offer(
                    wall_time(flight, axis, limit_of(state, wall, radius)),
                    who,
                    DVec3::ZERO,
                );
            }
        }
    }
    for ball in 0..count {
        for (index, plane) in state.domain.planes.iter().enumerate() {
            let upper = state.sides[ball as usize * state.domain.planes.len() + index];
            let time = plane_time(
                &state.trajectories[ball as usize],
                plane,
                upper,
                state.bodies.of(ball as usize).radius,
            );
            offer(time, Participants::Plane(ball, index as u32), DVec3::ZERO);
        }
    }
    let boxes = if periodic { -1..=1 } else { 0..=0 };
    for first in 0..count {
        for second in first + 1..count {
            let contact =
                state.bodies.of(first as usize).radius + state.bodies.of(second as usize).radius;
            let pair = [first, second].map(|ball| &state.trajectories[ball as usize]);
            for (x, y, z) in boxes.clone().flat_map(|x| {
                let boxes = boxes.clone();
                boxes
                    .clone()
                    .flat_map(move |y| boxes.clone().map(move |z| (x, y, z)))
            }) {
                let shift = IVec3::new(x, y, z).as_dvec3() * state.domain.period();
                let time = image_pair_time(pair[0], pair[1], contact, shift);
                offer(time, Participants::Pair(first, second), shift);
            }
        }
    }
    best
}

#[test]
fn the_grid_and_the_calendar_give_the_collisions_of_all_pairs_on_240_random_scenes() {
    let mut kinds = [0; 4];
    for seed in 0..240 {
        let state = State::new(&random_scene(seed));
        let wanted = 20 * state.ball_count();
        let expected = all_pairs(state.clone(), wanted);
        let Some(&(end, _)) = expected.last() else {
            continue;
        };
        let mut records = Vec::new();
        let mut engine = EventDriven::new(state);
        engine
            .advance(end, &mut |collision| {
                records.push((collision.time, collision.participants))
            })
            .expect("room");
        for (index, (record, expected)) in records.iter().zip(&expected).enumerate() {
            assert_eq!(record, expected, "seed {seed}, collision {index}");
            kinds[match expected.1 {
                Participants::Pair(..) => 0,
                Participants::Wall(..) => 1,
                Participants::Plane(..) => 2,
                Participants::Face(..) => 3,
            }] += 1;
        }
        assert!(
            records.len() >= expected.len(),
            "seed {seed}: {} of {}",
            records.len(),
            expected.len()
        );
    }
    assert!(kinds.iter().all(|&count| count > 1000), "{kinds:?}");
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
        let drift = observer
            .ledger
            .drift(engine.state().now, &engine.state().totals());
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
