//! Engine `windowed` against engine `event`: the same collisions, bit for bit and in the same order.

mod common;
#[path = "common/random_scene.rs"]
mod random_scene;

use common::{lattice, normal, seed_scene};
use glam::DVec3;
use moltop::domain::{Boundary, Domain};
use moltop::engine::Engine;
use moltop::engine::event_driven::EventDriven;
use moltop::engine::windowed::Windowed;
use moltop::event::Participants;
use moltop::state::{Body, Placement, State, Time};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use random_scene::random_scene;

/// Runs an engine in slices; gives all its collisions and the hash of its last state.
fn collisions(
    engine: &mut dyn Engine,
    until: f64,
    slices: u32,
) -> (Vec<(Time, Participants)>, u64) {
    let mut records = Vec::new();
    for slice in 1..=slices {
        let end = engine
            .state()
            .units
            .instant(until * f64::from(slice) / f64::from(slices));
        engine
            .advance(end, &mut |collision| {
                records.push((collision.time, collision.participants))
            })
            .expect("room");
    }
    (records, engine.state().hash())
}

#[track_caller]
fn compare(placement: &Placement, until: f64, fewest: usize) {
    let (expected, hash) = collisions(&mut EventDriven::new(State::new(placement)), until, 1);
    for (slices, regions) in [(1, 1), (37, 2), (5, 7)] {
        let mut engine = Windowed::with_regions(State::new(placement), regions);
        let (records, windowed_hash) = collisions(&mut engine, until, slices);
        for (index, (record, expected)) in records.iter().zip(&expected).enumerate() {
            assert_eq!(
                record,
                expected,
                "collision {index} of {}, {slices} slices, {regions} regions",
                records.len()
            );
        }
        assert_eq!(records.len(), expected.len());
        assert_eq!(windowed_hash, hash);
    }
    assert!(expected.len() >= fewest, "{}", expected.len());
}

#[test]
fn a_dense_gas_collides_as_in_engine_event() {
    compare(&seed_scene(6, 1), 12.0, 3000);
    compare(&lattice(8, 1.02, 8.2, 2), 1.0, 5000);
}

#[test]
fn a_dilute_gas_collides_as_in_engine_event() {
    compare(&lattice(20, 10.0, 205.0, 3), 100.0, 10_000);
}

#[test]
fn a_gas_with_few_long_flights_collides_as_in_engine_event() {
    compare(&lattice(4, 100.0, 405.0, 4), 10_000.0, 1000);
}

#[test]
fn mixtures_at_random_places_collide_as_in_engine_event() {
    for seed in 0..25 {
        compare(&mixture(seed), 5.0, 100);
    }
}

#[test]
fn mixtures_in_a_periodic_box_collide_as_in_engine_event() {
    for seed in 0..25 {
        let mut placement = mixture(seed);
        placement.domain.boundary = Boundary::Periodic;
        compare(&placement, 5.0, 100);
    }
}

#[test]
fn a_dense_periodic_fluid_collides_as_in_engine_event() {
    let mut placement = lattice(9, 1.2, 9.0 * 1.2, 8);
    placement.domain.boundary = Boundary::Periodic;
    compare(&placement, 3.0, 8000);
    let mut placement = lattice(14, 4.0, 14.0 * 4.0, 9);
    placement.domain.boundary = Boundary::Periodic;
    compare(&placement, 20.0, 2000);
}

#[test]
fn scenes_of_all_kinds_that_it_supports_collide_as_in_engine_event() {
    let scenes = (0..250).map(random_scene);
    let supported: Vec<_> = scenes.filter(Windowed::supports).collect();
    let with_planes = |scene: &&Placement| !scene.domain.planes.is_empty();
    let periodic = |scene: &&Placement| scene.domain.boundary == Boundary::Periodic;
    assert!(supported.iter().filter(with_planes).count() > 25);
    assert!(supported.iter().filter(periodic).count() > 25);
    for scene in &supported {
        compare(scene, 10.0, 0);
    }
}

/// Some hundred balls of two kinds at random places without overlap in a container.
fn mixture(seed: u64) -> Placement {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let half_size = DVec3::new(
        random.random_range(6.0..9.0),
        random.random_range(6.0..9.0),
        7.0,
    );
    let body = |random: &mut Xoshiro256PlusPlus| Body {
        radius: random.random_range(0.0..1.0),
        mass: random.random_range(0.01..10.0),
    };
    let mut placement = Placement {
        domain: Domain::container(half_size),
        center: DVec3::ZERO,
        bodies: vec![body(&mut random), body(&mut random)],
        body_of: Vec::new(),
        positions: Vec::new(),
        velocities: Vec::new(),
    };
    for _ in 0..300 {
        let kind = random.random_range(0..2_u32);
        let radius = placement.bodies[kind as usize].radius;
        let place = DVec3::from_array(
            (half_size - radius)
                .to_array()
                .map(|room| random.random_range(-room..room)),
        );
        let mut others = placement.positions.iter().zip(&placement.body_of);
        if others.all(|(other, &kind)| {
            place.distance(*other) > radius + placement.bodies[kind as usize].radius
        }) {
            placement.positions.push(place);
            placement.body_of.push(kind);
            placement.velocities.push(normal(&mut random));
        }
    }
    placement
}

#[test]
fn a_reversed_run_collides_as_in_engine_event() {
    let placement = seed_scene(6, 7);
    let turn = |engine: &mut dyn Engine| {
        collisions(engine, 1.234, 3);
        engine.reverse();
        collisions(engine, 3.0, 5)
    };
    let event = turn(&mut EventDriven::new(State::new(&placement)));
    let windowed = turn(&mut Windowed::new(State::new(&placement), 1));
    assert_eq!(event, windowed);
}

/// What happens at one instant happens in the order of engine `event`, also where a later turn brings about an earlier one.
#[test]
fn collisions_at_one_instant_come_in_the_order_of_engine_event() {
    // Twelve balls that reach the one in the middle together, and boxes in which all touch their walls.
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let corners = [
        (1.0, golden),
        (1.0, -golden),
        (-1.0, golden),
        (-1.0, -golden),
    ];
    let directions: Vec<DVec3> = (corners.into_iter())
        .flat_map(|(a, b)| [[0.0, a, b], [a, b, 0.0], [b, 0.0, a]])
        .map(|direction| DVec3::from_array(direction).normalize())
        .collect();
    let mut star = lattice(1, 1.0, 8.0, 1);
    star.velocities[0] = DVec3::ZERO;
    star.positions
        .extend(directions.iter().map(|direction| 3.0 * direction));
    star.velocities
        .extend(directions.iter().map(|direction| -direction));
    compare(&star, 20.0, 40);
    let mut middle_last = star;
    middle_last.positions.rotate_left(1);
    middle_last.velocities.rotate_left(1);
    compare(&middle_last, 20.0, 40);
    // Two rows between walls that they touch, with velocities of few bits: many collisions at one instant.
    for seed in 0..20 {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut gas = lattice(3, 1.25, 3.5, seed);
        for velocity in &mut gas.velocities {
            *velocity = DVec3::from_array([(); 3].map(|()| f64::from(random.random_range(-2..=2))));
        }
        compare(&gas, 3.0, 100);
    }
}
