//! Rows 21 to 24: rest, simultaneous collisions, corners, and balls flush on walls.

use glam::DVec3;
use rand::RngExt;

use super::Verdict;
use crate::event::Participants;
use crate::experiment::gases::{container, generator, normal, place_in};
use crate::experiment::trial::{EVENT, REVERSIBLE, Trial, WINDOWED, processor_seconds};
use crate::state::Placement;
use crate::worker::engines::Choice;

/// Balls of unit diameter in a box of edge 8.
fn boxed(places: Vec<DVec3>, velocities: Vec<DVec3>) -> Placement {
    let mut gas = container(DVec3::splat(4.0), places);
    gas.velocities = velocities;
    gas
}

/// Row 21.
pub fn rest() -> Verdict {
    let mut verdict = Verdict::default();
    let site = |site: usize| {
        DVec3::new((site / 16) as f64, (site / 4 % 4) as f64, (site % 4) as f64) * 1.25 - 1.875
    };
    let lattice: Vec<DVec3> = (0..64).map(site).collect();
    let mut with_mover = lattice.clone();
    with_mover.push(DVec3::new(0.0, 3.25, 3.25));
    let mut moving = vec![DVec3::ZERO; 65];
    moving[64] = DVec3::X;
    let cases = [
        ("64 balls at rest", boxed(lattice, vec![DVec3::ZERO; 64]), 0),
        // 3.5 to the first wall, then 7 from wall to wall.
        ("one mover among them", boxed(with_mover, moving), 1),
        ("one ball", boxed(vec![DVec3::ZERO], vec![DVec3::X]), 1),
        ("no ball", boxed(Vec::new(), Vec::new()), 0),
    ];
    for choice in [EVENT, Choice::Step(0.125)] {
        for (what, gas, events) in &cases {
            let began = processor_seconds();
            let mut trial = Trial::new(choice, gas);
            trial.run(10.0);
            let seconds = processor_seconds() - began;
            let name = format!("{}, {what}", choice.name());
            verdict.equal(format!("{name}: collisions"), &trial.events(), events);
            verdict.equal(format!("{name}: time"), &trial.time(), &10.0);
            verdict.at_most(format!("{name}: seconds of the processor"), seconds, 0.01);
        }
    }
    verdict
}

/// Balls that all reach the middle, or the ball there, at one instant.
fn star(directions: &[DVec3], middle: bool) -> Placement {
    let mut places: Vec<_> = directions.iter().map(|direction| 3.0 * direction).collect();
    let mut velocities: Vec<_> = directions.iter().map(|direction| -direction).collect();
    if middle {
        places.push(DVec3::ZERO);
        velocities.push(DVec3::ZERO);
    }
    boxed(places, velocities)
}

/// Row 22.
pub fn simultaneous() -> Verdict {
    let mut verdict = Verdict::default();
    let root = 3.0_f64.sqrt() / 2.0;
    let triangle = [
        DVec3::X,
        DVec3::new(-0.5, root, 0.0),
        DVec3::new(-0.5, -root, 0.0),
    ];
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let icosahedron: Vec<DVec3> = [
        (1.0, golden),
        (1.0, -golden),
        (-1.0, golden),
        (-1.0, -golden),
    ]
    .into_iter()
    .flat_map(|(a, b)| {
        [
            DVec3::new(0.0, a, b),
            DVec3::new(a, b, 0.0),
            DVec3::new(b, 0.0, a),
        ]
    })
    .map(DVec3::normalize)
    .collect();
    let cases = [
        ("three", star(&triangle, false)),
        ("twelve round one", star(&icosahedron, true)),
    ];
    for (what, gas) in &cases {
        let mut hashes = Vec::new();
        for choice in [EVENT, WINDOWED].into_iter().chain([REVERSIBLE]) {
            let run = || {
                let mut trial = Trial::new(choice, gas);
                trial.try_run(4.0, &mut |_| {}).map(|()| trial)
            };
            let name = format!("{}, {what}", choice.name());
            let (Ok(first), Ok(second)) = (run(), run()) else {
                verdict.holds(format!("{name}: no loop"), false, "yes");
                continue;
            };
            let bound = 4.0 * f64::EPSILON * gas.positions.len() as f64;
            let drift = first.drift();
            verdict.at_most(format!("{name}: energy"), first.energy_drift(), bound);
            verdict.at_most(
                format!("{name}: momentum"),
                drift.momentum.unwrap_or(0.0),
                bound,
            );
            let (hash, again) = (first.state().hash(), second.state().hash());
            verdict.holds(
                format!("{name}: same state again"),
                hash == again,
                "yes, bit for bit",
            );
            hashes.push(hash);
            verdict.note(format!(
                "{name}: {} collisions, hash {hash:016x}",
                first.events()
            ));
        }
        let same = hashes.len() == 3 && hashes[0] == hashes[1];
        verdict.holds(
            format!("{what}: event and windowed agree"),
            same,
            "yes, bit for bit",
        );
    }
    verdict.not_run("other machines: compare the hashes");
    verdict
}

/// How far a ball of radius 1/2 is outside the walls; not positive for one inside.
fn outside(position: DVec3, half_size: DVec3) -> f64 {
    (position.abs() - (half_size - 0.5)).max_element()
}

/// Row 23.
pub fn corners() -> Verdict {
    let mut verdict = Verdict::default();
    let engines = [EVENT, WINDOWED, Choice::Step(0.125)];
    for choice in engines.into_iter().chain([REVERSIBLE]) {
        let mut wrong = 0;
        for code in 0..27 {
            let sign = [code / 9, code / 3 % 3, code % 3].map(|digit| f64::from(digit - 1));
            let velocity = DVec3::from_array(sign) * 0.5;
            if velocity == DVec3::ZERO {
                continue;
            }
            let mut trial = Trial::new(choice, &boxed(vec![DVec3::ZERO], vec![velocity]));
            trial.run(10.0);
            let back = trial.state().placement().velocities[0];
            wrong += usize::from(back + 0.0 != -velocity + 0.0);
        }
        let what = format!(
            "{}: of 26 faces, edges and corners not straight back",
            choice.name()
        );
        verdict.equal(what, &wrong, &0);
    }
    for choice in engines.into_iter().chain([REVERSIBLE]) {
        let mut random = generator(23);
        let (mut out, mut farthest, mut steps) = (0_u32, 0.0_f64, 0.0_f64);
        let dt = 1.0 / 64.0;
        for _ in 0..100_000 {
            let half_size = place_in(DVec3::splat(0.5), &mut random) + 1.5;
            let mut place = place_in(half_size - 0.5, &mut random);
            let flush: usize = random.random_range(1..4);
            for axis in 0..flush {
                place[axis] = (half_size[axis] - 0.5).copysign(place[axis]);
            }
            let velocity = normal(&mut random);
            let mut gas = container(half_size, vec![place]);
            gas.velocities[0] = velocity;
            let choice = match choice {
                Choice::Step(_) => Choice::Step(dt),
                other => other,
            };
            let mut trial = Trial::new(choice, &gas);
            for slice in 1..=3 {
                trial.run(f64::from(slice) * 0.7);
                let beyond = outside(trial.state().placement().positions[0], half_size);
                let allowed = if let Choice::Step(_) = choice {
                    dt * velocity.length()
                } else {
                    0.0
                };
                // A ball at a wall is where rounding puts it: two spacings of f64 are not outside.
                out += u32::from(beyond > allowed + 2.0 * f64::EPSILON);
                farthest = farthest.max(beyond);
                steps = steps.max(beyond / velocity.length());
            }
        }
        let name = choice.name();
        if let Choice::Step(_) = choice {
            let what = format!("{name}: of 100000 flush starts ever farther out than a step's way");
            verdict.equal(what, &out, &0);
            verdict.note(format!(
                "{name}: at most {:.2} of a step's way beyond a wall",
                steps / dt
            ));
        } else {
            verdict.equal(
                format!("{name}: of 100000 flush starts ever outside"),
                &out,
                &0,
            );
            verdict.note(format!("{name}: farthest beyond a wall {farthest:.1e}"));
        }
    }
    verdict
}

/// Row 24.
pub fn struck_at_a_wall() -> Verdict {
    let mut verdict = Verdict::default();
    struck_by(EVENT, 100_000, &mut verdict);
    let found = [EVENT, WINDOWED].map(|choice| struck_by(choice, 10_000, &mut verdict));
    let what = "collisions between balls of engine windowed, as with event";
    verdict.equal(what, &found[1], &found[0]);
    verdict
}

/// A ball rests flush on a wall, or moves there, and another hits it; gives how often balls collide.
fn struck_by(choice: Choice, trials: usize, verdict: &mut Verdict) -> u32 {
    let mut random = generator(24);
    let half_size = DVec3::splat(2.5);
    let limit = half_size - 0.5;
    let (mut out, mut overlap, mut struck) = (0_u32, 0.0_f64, 0_u32);
    for trial in 0..trials {
        let mut place = place_in(limit, &mut random);
        let axis = trial % 3;
        place[axis] = limit[axis].copysign(place[axis]);
        let other = loop {
            let other = place_in(limit, &mut random);
            if other.distance(place) > 1.0 {
                break other;
            }
        };
        let mut gas = container(half_size, vec![place, other]);
        gas.velocities[1] = place + place_in(DVec3::splat(0.5), &mut random) - other;
        if trial % 2 == 0 {
            gas.velocities[0] = 0.1 * normal(&mut random);
        }
        let mut trial = Trial::new(choice, &gas);
        for slice in 1..=3 {
            trial
                .try_run(f64::from(slice), &mut |collision| {
                    if let Participants::Pair(..) = collision.participants {
                        overlap = overlap.max(-collision.gap);
                        struck += 1;
                    }
                })
                .expect("room to move");
            for position in trial.state().placement().positions {
                out += u32::from(outside(position, half_size) > 4.0 * f64::EPSILON);
            }
        }
    }
    let name = format!("{}, {trials} trials", choice.name());
    verdict.equal(format!("{name}: balls ever outside"), &out, &0);
    verdict.at_most(format!("{name}: overlap over d"), overlap, 1e-14);
    verdict.note(format!("{name}: {struck} collisions between balls"));
    struck
}
