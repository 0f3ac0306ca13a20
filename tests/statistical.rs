//! Engine `statistical`: the averages of theory and of the exact engine, the same bits on any number of threads, and what it
//! refuses. Bands are four standard errors of the counts they are made from.

mod common;

use common::{lattice, seed_scene};
use moltop::domain::Boundary;
use moltop::engine::statistical::{Plan, QUICK, Refusal, Resolution, Statistical, USUAL};
use moltop::engine::{Engine, Saved};
use moltop::observe::Observer;
use moltop::scene::analysis::{Theory, temperature};
use moltop::snapshot::Units;
use moltop::state::{Body, Placement, State};

/// Some 5832 balls at a packing fraction of 5e-4; a ball collides about once in 150 units of time.
fn dilute() -> Placement {
    lattice(18, 10.0, 182.0, 1)
}

const MEAN_FREE_TIME: f64 = 146.0;

fn periodic(mut gas: Placement) -> Placement {
    gas.domain.boundary = Boundary::Periodic;
    gas
}

/// All balls in the lowest third, from where they spread.
fn crowded(mut gas: Placement) -> Placement {
    let floor = -gas.domain.half_size.z;
    for position in &mut gas.positions {
        position.z = floor + (position.z - floor) / 3.0;
    }
    gas
}

fn run(engine: &mut Statistical, observer: &mut Observer, until: f64) {
    let until = engine.state().units.instant(until);
    engine
        .advance_in_sums(until, &mut |report| observer.take(report))
        .expect("nothing can be stuck");
    engine.settle();
}

/// Hash of the end, in so many slices on so many threads.
fn end(gas: &Placement, threads: usize, slices: u32, one_by_one: bool) -> u64 {
    let mut engine = Statistical::with_threads(State::new(gas), USUAL, 7, threads);
    let mut observer = Observer::new(engine.state());
    for slice in 1..=slices {
        let until = 5.0 * MEAN_FREE_TIME * f64::from(slice) / f64::from(slices);
        if one_by_one {
            let until = engine.state().units.instant(until);
            engine
                .advance(until, &mut |collision| observer.record(collision))
                .expect("nothing can be stuck");
            engine.settle();
        } else {
            run(&mut engine, &mut observer, until);
        }
    }
    engine.state().hash()
}

#[test]
fn threads_slices_and_the_way_of_reporting_change_no_bit() {
    for gas in [dilute(), periodic(dilute()), crowded(dilute())] {
        let expected = end(&gas, 1, 1, false);
        assert_eq!(end(&gas, 2, 1, false), expected);
        assert_eq!(end(&gas, 5, 7, false), expected);
        assert_eq!(end(&gas, 3, 40, true), expected);
    }
}

#[test]
fn a_resumed_gas_is_the_uninterrupted_one_bit_for_bit() {
    for gas in [dilute(), periodic(mixture())] {
        let mut engine = Statistical::with_threads(State::new(&gas), USUAL, 7, 2);
        let mut observer = Observer::new(engine.state());
        run(&mut engine, &mut observer, 1.37 * MEAN_FREE_TIME);
        let Saved::Statistical(saved) = engine.save() else {
            panic!("another engine's")
        };
        assert!(saved.fits(gas.positions.len()) && !saved.fits(7));
        let mut resumed = Statistical::resume(engine.state().clone(), *saved, 1);
        let mut twin = observer.clone();
        run(&mut engine, &mut observer, 3.0 * MEAN_FREE_TIME);
        run(&mut resumed, &mut twin, 3.0 * MEAN_FREE_TIME);
        assert_eq!(resumed.state().hash(), engine.state().hash());
        assert_eq!(resumed.state().collisions, engine.state().collisions);
        assert_eq!(resumed.counters(), engine.counters());
        assert_eq!(twin.blocks, observer.blocks);
    }
}

#[track_caller]
fn near(found: f64, expected: f64, share: f64) {
    assert!(
        (found / expected - 1.0).abs() < share,
        "{found} is not {expected} within {share}"
    );
}

/// Runs a gas for forty mean free times after five to settle, and compares it with theory.
#[track_caller]
fn check_rates(gas: &Placement, resolution: Resolution) {
    let thermal = temperature(gas, Units::Reduced).expect("balls that move");
    let expected = Theory::new(gas, Units::Reduced).at(thermal);
    let mut engine = Statistical::new(State::new(gas), resolution, 1, 1);
    let mut observer = Observer::new(engine.state());
    run(&mut engine, &mut observer, 5.0 * MEAN_FREE_TIME);
    let (before, pushed, virial) = (
        engine.counters(),
        observer.ledger.wall_impulse(),
        observer.ledger.pair_virial(),
    );
    run(&mut engine, &mut observer, 45.0 * MEAN_FREE_TIME);
    let counters = engine.counters();
    let time = 40.0 * MEAN_FREE_TIME;
    let pairs = (counters.pair_collisions - before.pair_collisions) as f64;
    near(
        pairs / time,
        expected.pair_rate.expect("a gas"),
        4.0 / pairs.sqrt(),
    );
    let units = engine.state().units;
    let momentum = units.mass * units.velocity();
    if let Some(wall_rate) = expected.wall_rate {
        let walls = (counters.wall_collisions - before.wall_collisions) as f64;
        near(walls / time, wall_rate, 4.0 / walls.sqrt());
        let area = gas.domain.wall_area();
        let pressure = (observer.ledger.wall_impulse() - pushed) * momentum / time / area;
        near(
            pressure,
            expected.pressure.expect("a gas"),
            4.0 * 0.6 / walls.sqrt(),
        );
    } else {
        // Beyond the ideal gas's: a third of the virial per volume, all of it from collisions.
        let virial = (observer.ledger.pair_virial() - virial) * momentum * units.length / time;
        let volume = gas.domain.volume();
        let ideal = gas.positions.len() as f64 * thermal / volume;
        let excess = expected.pressure.expect("a gas") - ideal;
        near(virial / 3.0 / volume, excess, 4.0 / pairs.sqrt());
    }
    let drift = observer
        .ledger
        .drift(engine.state().now, &engine.state().totals());
    assert!(drift.energy.expect("moving").abs() < 1e-7);
    assert_eq!((drift.virial, observer.max_overlap), (None, None));
}

#[test]
fn rates_and_pressure_between_walls_are_those_of_theory() {
    check_rates(&dilute(), USUAL);
}

#[test]
fn rates_and_pressure_in_a_periodic_box_are_those_of_theory_whatever_the_step() {
    check_rates(&periodic(dilute()), QUICK);
}

/// Heavy large balls and light small ones.
fn mixture() -> Placement {
    let mut gas = periodic(dilute());
    gas.bodies = vec![
        Body {
            radius: 0.5,
            mass: 1.0,
        },
        Body {
            radius: 1.0,
            mass: 8.0,
        },
    ];
    gas.body_of = (0..gas.positions.len())
        .map(|ball| u32::from(ball % 4 == 0))
        .collect();
    for (ball, velocity) in gas.velocities.iter_mut().enumerate() {
        if ball % 4 == 0 {
            *velocity *= 8.0_f64.sqrt().recip();
        }
    }
    gas
}

#[test]
fn a_mixture_collides_as_theory_says() {
    check_rates(&mixture(), USUAL);
}

#[test]
fn every_collision_is_in_the_ledger() {
    for gas in [dilute(), periodic(dilute()), mixture()] {
        let mut engine = Statistical::new(State::new(&gas), USUAL, 1, 1);
        let mut observer = Observer::new(engine.state());
        let until = engine.state().units.instant(3.3 * MEAN_FREE_TIME);
        engine
            .advance(until, &mut |collision| observer.record(collision))
            .expect("nothing can be stuck");
        engine.settle();
        let drift = observer
            .ledger
            .drift(engine.state().now, &engine.state().totals());
        assert!(drift.momentum.expect("moving") < 1e-6, "{drift:?}");
        assert!(drift.virial.expect("moving") < 1e-6, "{drift:?}");
        assert_eq!(observer.max_overlap, None);
        let collisions: u64 = engine.state().collisions.iter().sum();
        let counters = engine.counters();
        assert_eq!(
            collisions,
            2 * counters.pair_collisions + counters.wall_collisions
        );
    }
}

#[test]
fn equal_speeds_become_maxwells() {
    let mut gas = dilute();
    gas.velocities
        .iter_mut()
        .for_each(|velocity| *velocity = velocity.normalize());
    let mut engine = Statistical::new(State::new(&gas), USUAL, 1, 1);
    let mut observer = Observer::new(engine.state());
    run(&mut engine, &mut observer, 20.0 * MEAN_FREE_TIME);
    let squares: Vec<f64> = (engine.state().trajectories.iter())
        .map(|flight| flight.velocity.length_squared())
        .collect();
    let count = squares.len() as f64;
    let second = squares.iter().sum::<f64>() / count;
    let fourth = squares.iter().map(|square| square * square).sum::<f64>() / count;
    // The ratio begins at 1. Its variance in a Maxwellian sample is 56/27 over the count (derived here, from the moments).
    near(
        fourth / (second * second),
        5.0 / 3.0,
        4.0 * (56.0 / 27.0 / count).sqrt(),
    );
}

#[test]
fn a_reversed_gas_does_not_come_back_but_keeps_its_energy() {
    let gas = dilute();
    let mut engine = Statistical::new(State::new(&gas), USUAL, 1, 1);
    let mut observer = Observer::new(engine.state());
    let energy = engine.state().totals().kinetic_energy;
    run(&mut engine, &mut observer, 2.0 * MEAN_FREE_TIME);
    engine.reverse();
    run(&mut engine, &mut observer, 4.0 * MEAN_FREE_TIME);
    let end = engine.state().placement();
    let apart = gas
        .positions
        .iter()
        .zip(&end.positions)
        .map(|(start, end)| start.distance(*end));
    assert!(apart.sum::<f64>() / end.positions.len() as f64 > 10.0);
    near(engine.state().totals().kinetic_energy, energy, 1e-7);
    let inside = gas.domain.half_size - 0.5 + 1e-4;
    assert!(
        end.positions
            .iter()
            .all(|position| position.abs().cmple(inside).all())
    );
}

#[test]
fn before_a_collision_a_reversed_gas_flies_straight_back() {
    let gas = dilute();
    let mut engine = Statistical::new(State::new(&gas), USUAL, 1, 1);
    let mut observer = Observer::new(engine.state());
    run(&mut engine, &mut observer, 0.03 * MEAN_FREE_TIME);
    engine.reverse();
    run(&mut engine, &mut observer, 0.06 * MEAN_FREE_TIME);
    assert_eq!(engine.counters().steps, 0);
    for (start, end) in gas
        .positions
        .iter()
        .zip(engine.state().placement().positions)
    {
        assert!(start.distance(end) < 1e-3, "{start} {end}");
    }
}

#[test]
fn what_it_cannot_do_it_refuses() {
    let check = |gas: &Placement, expected: &str| {
        let refusal: Refusal = Plan::new(&State::new(gas), USUAL, false).expect_err("refused");
        assert!(refusal.to_string().contains(expected), "{refusal}");
    };
    let mut open = dilute();
    open.domain.boundary = Boundary::Open;
    check(&open, "space is open");
    check(&seed_scene(8, 1), "too dense");
    let mut resting = dilute();
    resting
        .velocities
        .iter_mut()
        .for_each(|velocity| *velocity *= 0.0);
    check(&resting, "no two balls will collide");
    check(&lattice(2, 10.0, 182.0, 1), "8 balls are too few");
    let mut sizes = mixture();
    sizes.bodies[1].radius = 3.0;
    check(&sizes, "6.0 times the smallest");
    let mut points = dilute();
    points.bodies[0].radius = 0.0;
    check(&points, "no two balls will collide");
    let plan = Plan::new(&State::new(&seed_scene(8, 1)), USUAL, true).expect("forced");
    assert!(plan.is_sparse());
}
