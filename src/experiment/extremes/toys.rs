//! Rows 1, 2, 6 to 9 and 39: a few balls whose future is known exactly.

use glam::DVec3;
use rand::RngExt;

use super::Verdict;
use crate::domain::{Boundary, Plane};
use crate::experiment::double_double::DoubleDouble;
use crate::experiment::gases::{container, direction, generator};
use crate::experiment::trial::{EVENT, REVERSIBLE, Trial, WINDOWED};
use crate::state::{Body, Placement};
use crate::worker::engines::Choice;

/// A ball of radius 1 in a box of edge 8.
fn one(position: DVec3, velocity: DVec3) -> Placement {
    let mut gas = container(DVec3::splat(4.0), vec![position]);
    gas.bodies[0].radius = 1.0;
    gas.velocities[0] = velocity;
    gas
}

/// Row 1.
pub fn one_ball() -> Verdict {
    let mut verdict = Verdict::default();
    // Periods 16, 32 and 64; the walls at 3 are reached after 3, 9 and 11, and then every 8, 16 and 32.
    let gas = one(
        DVec3::new(0.75, -0.375, 0.9375),
        DVec3::new(0.75, 0.375, 0.1875),
    );
    let mut compare = |name: &str, mut trial: Trial, periods: f64| {
        trial.run(16.0 * periods);
        let back = trial.state().placement();
        let exact = back.positions == gas.positions && back.velocities == gas.velocities;
        let what = format!("{name}: back bit for bit after {} bounces", trial.events());
        verdict.holds(what, exact, "yes");
    };
    let periods = f64::from(1 << 20);
    compare("event", Trial::new(EVENT, &gas), periods);
    compare("windowed", Trial::new(WINDOWED, &gas), f64::from(1 << 16));
    // Steps that end where the walls are; a million of them.
    compare(
        "step",
        Trial::new(Choice::Step(0.5), &gas),
        f64::from(1 << 15),
    );
    compare("reversible", Trial::new(REVERSIBLE, &gas), periods);
    let mut random = generator(1);
    let mut worst = 0.0_f64;
    for _ in 0..3 {
        let gas = one(DVec3::ZERO, direction(&mut random));
        let mut trial = Trial::new(EVENT, &gas);
        let time = 3_000_000.0;
        trial.run(time);
        let end = trial.state().placement().positions[0];
        for axis in 0..3 {
            worst = worst.max((end[axis] - fold(gas.velocities[0][axis], time)).abs());
        }
    }
    verdict.at_most(
        "random velocity, a million bounces: error over the edge",
        worst / 8.0,
        1e-9,
    );
    verdict
}

/// Where a point is that began at zero and is reflected at -3 and 3.
fn fold(speed: f64, time: f64) -> f64 {
    let way = DoubleDouble::from(speed) * DoubleDouble::from(time) + DoubleDouble::from(3.0);
    let turns = (way.value() / 12.0).floor();
    let rest = (way - DoubleDouble::from(12.0 * turns)).value();
    if rest <= 6.0 { rest - 3.0 } else { 9.0 - rest }
}

/// Row 2.
pub fn head_on() -> Verdict {
    let mut verdict = Verdict::default();
    let mut gas = container(DVec3::splat(8.0), vec![DVec3::X * -2.0, DVec3::X * 2.0]);
    gas.velocities = vec![DVec3::X * 0.75, DVec3::X * -0.25];
    let engines = [EVENT, WINDOWED, Choice::Step(0.125)];
    for choice in engines.into_iter().chain([REVERSIBLE]) {
        let mut trial = Trial::new(choice, &gas);
        let records = trial.records(4.0);
        let times: Vec<f64> = records
            .iter()
            .map(|record| trial.state().units.scene_time(record.0))
            .collect();
        let swapped =
            trial.state().placement().velocities == [gas.velocities[1], gas.velocities[0]];
        verdict.holds(
            format!("{}: velocities swapped bit for bit", choice.name()),
            swapped,
            "yes",
        );
        verdict.equal(format!("{}: instants", choice.name()), &times, &vec![3.0]);
    }
    verdict
}

/// Balls that touch in a row, the first coming from two diameters away.
fn row_of(count: usize, scale: f64) -> Placement {
    let place = |ball: usize| {
        let run_up = if ball == 0 { 2.0 } else { 0.0 };
        DVec3::X * scale * (ball as f64 - (count / 2) as f64 - run_up)
    };
    let room = (count as f64).log2().ceil().exp2();
    let half_size = DVec3::new(scale * room, scale * 4.0, scale * 4.0);
    let mut gas = container(half_size, (0..count).map(place).collect());
    gas.bodies[0].radius = 0.5 * scale;
    gas.velocities[0] = DVec3::X * scale;
    gas
}

/// Row 6.
pub fn cradle() -> Verdict {
    let mut verdict = Verdict::default();
    for count in [5, 50, 1000] {
        let gas = row_of(count, 1.0);
        for choice in [EVENT, WINDOWED].into_iter().chain([REVERSIBLE]) {
            let mut trial = Trial::new(choice, &gas);
            let records = trial.records(2.5);
            let what = format!("{}, {count} balls: collisions", choice.name());
            verdict.equal(what, &records.len(), &(count - 1));
            let one_instant = records.iter().all(|record| record.0 == records[0].0);
            let velocities = trial.state().placement().velocities;
            let (last, rest) = velocities.split_last().expect("balls");
            let exact = *last == DVec3::X && rest.iter().all(|velocity| *velocity == DVec3::ZERO);
            let what = format!(
                "{}, {count} balls: one instant, last ball takes all",
                choice.name()
            );
            verdict.holds(what, one_instant && exact, "yes, bit for bit");
        }
    }
    verdict
}

/// Row 7.
pub fn scaled_cradle() -> Verdict {
    let mut verdict = Verdict::default();
    for count in [5, 50] {
        let gas = row_of(count, 0.3);
        for choice in [EVENT, WINDOWED] {
            let mut trial = Trial::new(choice, &gas);
            let went = trial.try_run(2.5, &mut |_| {});
            let name = format!("{}, {count} balls", choice.name());
            verdict.holds(format!("{name}: no loop"), went.is_ok(), "yes");
            let velocities = trial.state().placement().velocities;
            let (last, rest) = velocities.split_last().expect("balls");
            let error = rest
                .iter()
                .fold((*last - DVec3::X * 0.3).length(), |worst, velocity| {
                    worst.max(velocity.length())
                });
            verdict.at_most(format!("{name}: error of speeds"), error / 0.3, 1e-12);
            verdict.at_most(
                format!("{name}: overlap over d"),
                trial.max_overlap(),
                1e-14,
            );
        }
    }
    verdict
}

/// A light ball at rest between a plane and a heavy ball that comes towards it, along a line; all that can collide has
/// collided by the end. The light ball gets about as fast as `speed` times ten to the exponent.
fn billiard(line: DVec3, exponent: i32, gap: f64, speed: f64) -> Trial {
    let places = vec![line * -0.5, line * (0.5 + gap)];
    let mut gas = container(DVec3::splat(8.0), places);
    let heavy = Body {
        radius: 0.5,
        mass: 100.0_f64.powi(exponent),
    };
    gas.bodies.push(heavy);
    gas.body_of = vec![0, 1];
    gas.velocities[1] = line * -speed;
    gas.domain.boundary = Boundary::Open;
    gas.domain.planes.push(Plane {
        normal: line,
        offset: -1.0 - gap,
    });
    let mut trial = Trial::new(EVENT, &gas);
    trial.run(10_000.0 / speed);
    trial
}

const DIGITS_OF_PI: [u64; 8] = [3, 31, 314, 3141, 31_415, 314_159, 3_141_592, 31_415_926];

fn galperin_at(exponents: std::ops::RangeInclusive<i32>) -> Verdict {
    let mut verdict = Verdict::default();
    let mut worst = 0.0_f64;
    for exponent in exponents {
        let trial = billiard(DVec3::X, exponent, 0.25, 1.0);
        let what = format!("collisions at 1e{}", 2 * exponent);
        verdict.equal(what, &trial.events(), &DIGITS_OF_PI[exponent as usize]);
        worst = worst.max(trial.energy_drift());
    }
    verdict.at_most("energy", worst, 1e-12);
    verdict
}

/// Row 8, up to a mass ratio of 1e12.
pub fn galperin() -> Verdict {
    galperin_at(0..=6)
}

/// Row 8, at a mass ratio of 1e14.
pub fn galperin_far() -> Verdict {
    galperin_at(7..=7)
}

/// Row 9.
pub fn oblique_galperin() -> Verdict {
    let mut verdict = Verdict::default();
    let along = |line: DVec3, gap: f64| {
        let line = line.normalize();
        let (mut counts, mut transverse) = (Vec::new(), 0.0_f64);
        for exponent in 0..=3 {
            let trial = billiard(line, exponent, gap, 0.1_f64.powi(exponent));
            counts.push(trial.events());
            for velocity in trial.state().placement().velocities {
                transverse = transverse.max((velocity - line * line.dot(velocity)).length());
            }
        }
        (counts, transverse)
    };
    // Components in ratios of powers of two, so that the directions in the scene are not rounded.
    let (counts, transverse) = along(DVec3::new(1.0, 2.0, 2.0), 0.25);
    verdict.equal(
        "along (1, 2, 2): collisions",
        &counts,
        &DIGITS_OF_PI[..4].to_vec(),
    );
    verdict.at_most(
        "along (1, 2, 2): speed across, the fastest being one",
        transverse,
        1e-12,
    );
    // Round balls throw aside what is not quite on their line, the more the farther they fly between two collisions.
    for exponent in [2, 8, 14, 17, 20] {
        let (counts, transverse) = along(DVec3::new(1.0, 2.0, 3.0), 2.0_f64.powi(-exponent));
        verdict.note(format!(
            "along (1, 2, 3), which is rounded, gap 2^-{exponent}: collisions {counts:?}, speed across {transverse:.1e}"
        ));
    }
    verdict
}

/// Row 39.
pub fn line() -> Verdict {
    let mut verdict = Verdict::default();
    let mut random = generator(39);
    let places = (0..1000)
        .map(|ball| DVec3::X * (2.0 * f64::from(ball) - 999.0))
        .collect();
    let mut gas = container(DVec3::new(1000.0, 1.0, 1.0), places);
    // Velocities on a grid, so that their differences are exact.
    for velocity in &mut gas.velocities {
        velocity.x = f64::from(random.random::<i16>()) / 8192.0;
    }
    let speeds = |gas: &Placement| {
        let mut speeds: Vec<f64> = gas
            .velocities
            .iter()
            .map(|velocity| velocity.x.abs())
            .collect();
        speeds.sort_by(f64::total_cmp);
        speeds
    };
    let before = speeds(&gas);
    let mut trial = Trial::new(EVENT, &gas);
    trial.run_for_events(1_000_000, 1.0);
    let after = speeds(&trial.state().placement());
    let changed = before.iter().zip(&after).filter(|(a, b)| a != b).count();
    let worst = before
        .iter()
        .zip(&after)
        .fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
    verdict.equal("speeds of 1000 that changed a bit", &changed, &0);
    verdict.note(format!(
        "largest change after {} collisions: {worst:.1e}",
        trial.events()
    ));
    verdict
}
