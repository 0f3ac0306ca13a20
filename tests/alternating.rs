//! Engine `windowed` as runs have it: it hands the gas over to `event` where its windows do not pay, and takes it back.

mod common;
#[path = "common/records.rs"]
mod records;

use common::{lattice, normal, seed_scene};
use glam::DVec3;
use moltop::checkpoint;
use moltop::domain::Domain;
use moltop::engine::alternating::Alternating;
use moltop::engine::event_driven::EventDriven;
use moltop::engine::windowed::Windowed;
use moltop::engine::{Engine, Saved};
use moltop::state::{Placement, State};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use records::{advance, counted};

/// `n^3` balls crowded into a corner of a container `wide` times as wide as they take.
fn crowd(n: usize, wide: f64, seed: u64) -> Placement {
    let spacing = 1.1;
    let mut gas = lattice(n, spacing, n as f64 * spacing, seed);
    let edge = n as f64 * spacing;
    gas.domain = Domain::container(DVec3::splat(0.5 * wide * edge));
    let corner = DVec3::splat(0.5 * (wide - 1.0) * edge);
    for position in &mut gas.positions {
        *position -= corner;
    }
    gas
}

/// 64 balls with gaps of 2^-20 between them.
fn cage() -> Placement {
    let gap = 2.0_f64.powi(-20);
    let mut gas = lattice(4, 1.0 + gap, 4.0 + 5.0 * gap, 1);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
    gas.velocities.fill_with(|| normal(&mut random));
    gas
}

/// Runs a gas by both engines, on several numbers of threads and through checkpoints; gives the methods at the stops.
#[track_caller]
fn compare(gas: &Placement, stops: &[f64]) -> Vec<&'static str> {
    assert!(Windowed::supports(gas));
    let mut event = EventDriven::new(State::new(gas));
    let mut engines = [1, 2, 4].map(|threads| Alternating::new(State::new(gas), threads));
    let mut saved = engines[0].save();
    let mut state = engines[0].state().clone();
    let mut methods = Vec::new();
    for &stop in stops {
        let expected = advance(&mut event, stop);
        assert!(!expected.is_empty());
        for engine in &mut engines {
            assert!(advance(engine, stop) == expected, "at {stop}");
            assert_eq!(engine.state().hash(), event.state().hash());
            assert_eq!(counted(engine), counted(&event));
        }
        let names = engines.each_ref().map(Engine::name);
        assert_eq!(names, [names[0]; 3], "at {stop}");
        methods.push(names[0]);

        // Through a checkpoint's bytes and on to the stop.
        let mut bytes = Vec::new();
        checkpoint::write(&(&state, &saved), 7, &mut bytes).expect("memory takes all");
        let Saved::Alternating(read) = checkpoint::decode::<(State, Saved)>(&bytes)
            .expect("whole")
            .0
            .1
        else {
            panic!("another engine's");
        };
        let mut resumed = Alternating::resume(state, 2, read);
        assert!(
            advance(&mut resumed, stop) == expected,
            "resumed, at {stop}"
        );
        assert_eq!(resumed.state(), event.state());
        assert_eq!(counted(&resumed), counted(&event));
        (saved, state) = (resumed.save(), resumed.state().clone());
    }
    methods
}

#[test]
fn a_crowd_is_handed_over_and_taken_back_when_it_has_spread() {
    let stops: Vec<f64> = (-1..=6).map(|doubling| 2.0_f64.powi(doubling)).collect();
    let methods = compare(&crowd(16, 4.5, 1), &stops);
    println!("{methods:?}");
    assert!(methods.contains(&"event"));
    assert_eq!(methods.last(), Some(&"windowed"));
}

#[test]
fn balls_with_hardly_any_room_collide_as_in_engine_event() {
    let gap = 2.0_f64.powi(-20);
    let methods = compare(&cage(), &[5.0, 10.0, 50.0].map(|gaps| gaps * gap));
    println!("{methods:?}");
}

#[test]
fn a_jammed_gas_stops_as_in_engine_event() {
    let gas = lattice(4, 1.0, 4.0, 1);
    let end = |engine: &mut dyn Engine| {
        let until = engine.state().units.instant(1.0);
        let mut collisions = Vec::new();
        let stuck = engine.advance(until, &mut |collision| {
            collisions.push(collision.participants)
        });
        (collisions, stuck.expect_err("no room"))
    };
    let (expected, stuck) = end(&mut EventDriven::new(State::new(&gas)));
    let (collisions, also_stuck) = end(&mut Alternating::new(State::new(&gas), 1));
    let same = collisions.iter().zip(&expected).take_while(|(a, b)| a == b);
    assert_eq!(
        (same.count(), collisions.len()),
        (expected.len(), expected.len())
    );
    assert_eq!(also_stuck, stuck);
}

#[test]
fn a_gas_that_suits_windows_stays() {
    for gas in [lattice(10, 10.0, 105.0, 3), seed_scene(12, 4)] {
        let mut engine = Alternating::new(State::new(&gas), 1);
        advance(&mut engine, 20.0);
        assert_eq!((engine.name(), engine.last_change()), ("windowed", None));
    }
}

#[test]
fn reversal_while_the_other_has_the_gas_is_as_in_engine_event() {
    let gas = cage();
    let gap = 2.0_f64.powi(-20);
    let turn = |engine: &mut dyn Engine| {
        let there = advance(engine, 7.0 * gap);
        engine.reverse();
        (there, advance(engine, 20.0 * gap), engine.state().hash())
    };
    let event = turn(&mut EventDriven::new(State::new(&gas)));
    assert!(turn(&mut Alternating::new(State::new(&gas), 1)) == event);
}
