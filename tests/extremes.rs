//! Scenes at the edge of what numbers can do, run by engine `event`, each with the bound that it must keep.
//!
//! Rows of the matrix of extremes: oblique Galperin billiards, a mass ratio of 1e12, a radius ratio of 1e4, a gas of packing
//! fraction 1e-8, rest, corners, balls flush on walls, a mixture, a gas on a line.

use glam::DVec3;
use moltop::domain::{Boundary, Domain};
use moltop::engine::Engine;
use moltop::engine::event_driven::EventDriven;
use moltop::event::{Collision, Participants};
use moltop::normal::normal_vector as normal;
use moltop::state::{Body, Placement, State};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// A placement of balls, each with a body of its own kind.
fn placement(boundary: Boundary, half_size: DVec3, balls: &[(Body, DVec3, DVec3)]) -> Placement {
    let mut bodies: Vec<Body> = Vec::new();
    let body_of = balls
        .iter()
        .map(|(body, ..)| {
            let known = bodies.iter().position(|other| other == body);
            known.unwrap_or_else(|| {
                bodies.push(*body);
                bodies.len() - 1
            }) as u32
        })
        .collect();
    Placement {
        domain: Domain {
            boundary,
            ..Domain::container(half_size)
        },
        center: DVec3::ZERO,
        bodies,
        body_of,
        positions: balls.iter().map(|ball| ball.1).collect(),
        velocities: balls.iter().map(|ball| ball.2).collect(),
    }
}

/// A unit ball.
const UNIT: Body = Body {
    radius: 0.5,
    mass: 1.0,
};

fn random(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

/// A random place between -1 and 1 along each axis.
fn place(random: &mut Xoshiro256PlusPlus) -> DVec3 {
    2.0 * DVec3::from_array(random.random::<[f64; 3]>()) - 1.0
}

/// Runs until a number of collisions of any kind has happened.
fn run_collisions(
    engine: &mut EventDriven,
    step: f64,
    collisions: u64,
    report: &mut dyn FnMut(&Collision),
) -> f64 {
    let units = engine.state().units;
    let (mut time, mut count) = (0.0, 0);
    while count < collisions {
        time += step;
        engine
            .advance(units.instant(time), &mut |collision| {
                if !matches!(collision.participants, Participants::Face(..)) {
                    count += 1;
                    report(collision);
                }
            })
            .expect("balls with room");
    }
    time
}

fn relative_energy_change(before: f64, state: &State) -> f64 {
    (state.kinetic_energy() / before - 1.0).abs()
}

/// Row 9. A light ball between a wall and a heavy one collides 3, 31, 314, 3141 times, whatever the direction.
///
/// A light ball between a mirror and a heavy ball is two mirror images that collide at once: here the mirror is a plane.
#[test]
fn galperins_balls_count_the_digits_of_pi_along_an_oblique_line() {
    use moltop::domain::Plane;
    // Round balls throw aside what is not quite on their line, the more the farther they fly between two collisions.
    const GAP: f64 = 1.0 / 16384.0;
    let direction = DVec3::new(1.0, 2.0, 3.0).normalize();
    for (k, expected) in [(0, 3), (1, 31), (2, 314), (3, 3141)] {
        let heavy = Body {
            mass: 100f64.powi(k),
            ..UNIT
        };
        let slow = 0.1f64.powi(k); // the light ball's speed comes up to 1
        let mut scene = placement(
            Boundary::Open,
            DVec3::splat(64.0),
            &[
                (UNIT, direction * -0.5, DVec3::ZERO),
                (heavy, direction * (0.5 + GAP), -direction * slow),
            ],
        );
        scene.domain.planes.push(Plane {
            normal: direction,
            offset: -1.0 - GAP,
        });
        let mut engine = EventDriven::new(State::new(&scene));
        let mut count = 0;
        let units = engine.state().units;
        engine
            .advance(units.instant(1e4 / slow), &mut |_| count += 1)
            .expect("balls with room");
        assert_eq!(count, expected, "mass ratio 100^{k}");
        let end = engine.state().placement();
        for velocity in end.velocities {
            let transverse = velocity - direction * direction.dot(velocity);
            println!("ratio 100^{k}: {:e}", transverse.length());
            assert!(transverse.length() <= 1e-12, "{}", transverse.length());
        }
    }
}

/// Row 16.
#[test]
fn a_ball_a_million_million_times_as_heavy_keeps_the_energy() {
    let mut random = random(16);
    let heavy = Body {
        radius: 2.0,
        mass: 1e12,
    };
    let mut balls = vec![(heavy, DVec3::ZERO, DVec3::new(1e-6, 0.0, 0.0))];
    for site in 0..512 {
        let site = DVec3::from_array([site / 64, site / 8 % 8, site % 8].map(f64::from));
        let site = (site - 3.5) * 2.0;
        if site.length() > 3.0 {
            balls.push((UNIT, site, normal(&mut random)));
        }
    }
    assert!(balls.len() > 450);
    let scene = placement(Boundary::Container, DVec3::splat(8.0), &balls);
    let mut engine = EventDriven::new(State::new(&scene));
    let before = engine.state().kinetic_energy();
    run_collisions(&mut engine, 10.0, 1_000_000, &mut |_| ());
    let drift = relative_energy_change(before, engine.state());
    println!("energy drift {drift:e}");
    assert!(drift <= 1e-12, "{drift:e}");
    let moved = engine.state().placement().positions[0].length();
    assert!(moved.is_finite() && moved < 6.0, "{moved}");
}

/// Row 17.
#[test]
fn a_ball_ten_thousand_times_as_large_overlaps_none() {
    let mut random = random(17);
    let large = Body {
        radius: 1e4,
        mass: 1e6,
    };
    let small = Body {
        radius: 1.0,
        mass: 1.0,
    };
    let half = 2e4;
    let mut balls = vec![(large, DVec3::ZERO, DVec3::ZERO)];
    while balls.len() < 1001 {
        let site = place(&mut random) * (half - 1.0);
        if site.length() > 1e4 + 1.0 && balls[1..].iter().all(|ball| (ball.1 - site).length() > 2.0)
        {
            balls.push((small, site, 1000.0 * normal(&mut random)));
        }
    }
    let scene = placement(Boundary::Container, DVec3::splat(half), &balls);
    let began = std::time::Instant::now();
    let mut engine = EventDriven::new(State::new(&scene));
    let mut overlap: f64 = 0.0;
    run_collisions(&mut engine, 1.0, 100_000, &mut |collision| {
        if let Participants::Pair(first, second) = collision.participants {
            let contact = if first.min(second) == 0 {
                1e4 + 1.0
            } else {
                2.0
            };
            overlap = overlap.max(-collision.gap * contact);
        }
    });
    let rate = 1e5 / began.elapsed().as_secs_f64();
    println!("largest overlap {overlap:e}, {rate:.3e} collisions per second");
    assert!(overlap <= 1e-11, "{overlap:e}");
    assert!(rate >= 1e4, "{rate}");
    if let Some(memory) = resident_memory() {
        assert!(memory < 200 << 20, "{memory} bytes");
    }
}

/// Largest resident memory of this process, where the system tells \[bytes\].
fn resident_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

/// Row 18: how often the collisions of a thin gas are what theory expects; the box is 3000 times narrower than a free path.
fn check_thin_gas(collisions: u64) {
    let mut random = random(18);
    let count = 1000.0;
    let volume: f64 = count * std::f64::consts::PI / 6.0 / 1e-8;
    let half = 0.5 * volume.cbrt();
    let balls: Vec<_> = (0..1000)
        .map(|_| (UNIT, place(&mut random) * half, normal(&mut random)))
        .collect();
    let scene = placement(Boundary::Periodic, DVec3::splat(half), &balls);
    let mut engine = EventDriven::new(State::new(&scene));
    let units = engine.state().units;
    let sigma = (engine.state().thermal_energy().expect("balls that move") * units.energy()).sqrt();
    let per_ball = 4.0 * std::f64::consts::PI.sqrt() * (count / volume) * sigma;
    let expected = 0.5 * (count - 1.0) * per_ball;
    let mut pairs = 0;
    let step = 0.01 * collisions as f64 / expected;
    let time = run_collisions(&mut engine, step, collisions, &mut |collision| {
        pairs += u64::from(matches!(collision.participants, Participants::Pair(..)));
        assert!(collision.gap.is_finite() && collision.impulse.is_finite());
    });
    let ratio = pairs as f64 / time / expected;
    println!("{pairs} collisions, {ratio} of the expected rate");
    assert!(
        (ratio - 1.0).abs() < 3.0 / (collisions as f64).sqrt(),
        "{ratio}"
    );
    let end = engine.state().placement();
    assert!(
        end.positions
            .iter()
            .chain(&end.velocities)
            .all(|vector| vector.is_finite())
    );
}

#[test]
fn a_gas_of_packing_fraction_1e_8_collides_about_as_often_as_theory_says() {
    check_thin_gas(100);
}

/// Row 21.
#[test]
fn what_rests_stays_and_what_is_alone_meets_walls_only() {
    let box_of =
        |balls: &[(Body, DVec3, DVec3)]| placement(Boundary::Container, DVec3::splat(4.0), balls);
    let rest: Vec<_> = (0..64)
        .map(|site| {
            let site = DVec3::from_array([site / 16, site / 4 % 4, site % 4].map(f64::from));
            (UNIT, site - 1.5, DVec3::ZERO)
        })
        .collect();
    let check = |balls: &[(Body, DVec3, DVec3)], walls: u64, pairs: u64| {
        let began = std::time::Instant::now();
        let mut engine = EventDriven::new(State::new(&box_of(balls)));
        let units = engine.state().units;
        engine
            .advance(units.instant(10.0), &mut |_| ())
            .expect("balls with room");
        assert!(
            began.elapsed().as_secs_f64() < 0.01,
            "{:?}",
            began.elapsed()
        );
        assert_eq!(units.scene_time(engine.state().now), 10.0);
        let counters = engine.counters();
        assert_eq!(
            (counters.wall_collisions, counters.pair_collisions),
            (walls, pairs)
        );
        engine.state().placement()
    };
    check(&[], 0, 0);
    check(&rest, 0, 0);
    // One ball: 3.5 to the first wall, then 7 from wall to wall.
    let one = check(&[(UNIT, DVec3::ZERO, DVec3::X)], 1, 0);
    assert_eq!((one.positions[0].x, one.velocities[0].x), (-3.0, -1.0));
    // One mover among balls at rest, on a line of its own: it meets walls only.
    let mut mover = rest;
    mover.push((UNIT, DVec3::new(0.0, 3.0, 3.0), DVec3::X));
    check(&mover, 1, 0);
}

/// Row 23, first half.
#[test]
fn a_ball_that_runs_into_a_corner_or_an_edge_comes_straight_back() {
    let mut random = random(23);
    for trial in 0..2000 {
        let half = 1.0 + random.random::<f64>();
        let speed = 0.5 + random.random::<f64>();
        let sign = place(&mut random).signum();
        let axes = [
            DVec3::ONE,
            DVec3::new(1.0, 1.0, 0.0),
            DVec3::new(0.0, 1.0, 1.0),
        ][trial % 3];
        let velocity = sign * axes * speed;
        let scene = placement(
            Boundary::Container,
            DVec3::splat(half),
            &[(UNIT, DVec3::ZERO, velocity)],
        );
        let mut engine = EventDriven::new(State::new(&scene));
        let units = engine.state().units;
        let time = 1.5 * (half - 0.5) / speed;
        engine
            .advance(units.instant(time), &mut |_| ())
            .expect("a ball with room");
        let after = engine.state().placement().velocities[0];
        assert_eq!(
            after.to_array().map(|v| v + 0.0),
            (-velocity).to_array().map(|v| v + 0.0)
        );
    }
}

/// Row 23, second half.
#[test]
fn balls_that_start_flush_in_edges_and_corners_never_leave() {
    let mut random = random(24);
    for _ in 0..100_000 {
        let half = DVec3::from_array(random.random::<[f64; 3]>()) + 1.0;
        let limit = half - UNIT.radius;
        let mut position = place(&mut random);
        let flush = 1 + random.random::<u8>() % 3;
        for axis in 0..flush as usize {
            position[axis] = position[axis].signum();
        }
        let velocity = normal(&mut random) * DVec3::new(1.0, 1.0, f64::from(flush % 2));
        let scene = placement(
            Boundary::Container,
            half,
            &[(UNIT, position * limit, velocity)],
        );
        let mut engine = EventDriven::new(State::new(&scene));
        let units = engine.state().units;
        for step in 1..=4 {
            engine
                .advance(units.instant(f64::from(step)), &mut |_| ())
                .expect("a ball with room");
            let place = engine.state().placement().positions[0].abs();
            assert!(
                (place - limit).max_element() <= 4.0 * f64::EPSILON,
                "{place} beyond {limit}"
            );
        }
    }
}

/// Row 24.
#[test]
fn a_ball_flush_on_a_wall_that_is_struck_stays_inside() {
    let mut random = random(25);
    let mut deepest: f64 = 0.0;
    let half = DVec3::splat(2.5);
    let limit = half - UNIT.radius;
    let mut struck = 0;
    for _ in 0..100_000 {
        let mut position = place(&mut random) * limit;
        let axis = random.random::<u8>() as usize % 3;
        position[axis] = limit[axis].copysign(position[axis]);
        let other = loop {
            let other = place(&mut random) * limit;
            if (other - position).length() > 1.0 {
                break other;
            }
        };
        let aim = position + 0.5 * place(&mut random) - other;
        let rest = random.random::<bool>();
        let own = if rest {
            DVec3::ZERO
        } else {
            0.1 * normal(&mut random)
        };
        let balls = [(UNIT, position, own), (UNIT, other, aim)];
        let scene = placement(Boundary::Container, half, &balls);
        let mut engine = EventDriven::new(State::new(&scene));
        let units = engine.state().units;
        for step in 1..=3 {
            engine
                .advance(units.instant(f64::from(step)), &mut |collision| {
                    if let Participants::Pair(..) = collision.participants {
                        deepest = deepest.max(-collision.gap);
                        struck += 1;
                    }
                })
                .expect("balls with room");
            for place in engine.state().placement().positions {
                assert!(
                    (place.abs() - limit).max_element() <= 4.0 * f64::EPSILON,
                    "{place}"
                );
            }
        }
    }
    println!("{struck} struck, deepest overlap {deepest:e} d");
    assert!(struck > 50_000);
    assert!(deepest <= 1e-14, "{deepest:e}");
}

/// Row 34.
#[test]
fn a_mixture_shares_its_heat_and_collides_as_theory_says() {
    use moltop::scene::{Scene, analysis};
    let scene = Scene::load(std::path::Path::new("configs/mixture.toml")).expect("a good scene");
    let start = scene.place().expect("a good scene");
    let mut engine = EventDriven::new(State::new(&start));
    let units = engine.state().units;
    let (settled, end, samples) = (20.0, 620.0, 300);
    engine
        .advance(units.instant(settled), &mut |_| ())
        .expect("balls with room");
    let before = engine.counters().pair_collisions;
    let mut energies = [0.0; 2];
    for sample in 1..=samples {
        let time = settled + (end - settled) * f64::from(sample) / f64::from(samples);
        engine
            .advance(units.instant(time), &mut |_| ())
            .expect("balls with room");
        for (ball, velocity) in engine.state().placement().velocities.iter().enumerate() {
            let mass = start.bodies[start.body_of[ball] as usize].mass;
            energies[usize::from(ball >= 1000)] += mass * velocity.length_squared();
        }
    }
    let ratio = energies[0] / energies[1];
    let rate = (engine.counters().pair_collisions - before) as f64 / (end - settled);
    let temperature = analysis::temperature(&start, scene.units).expect("balls that move");
    let expected = analysis::Theory::new(&start, scene.units)
        .at(temperature)
        .pair_rate;
    let of_theory = rate / expected.expect("a theory");
    println!("temperature ratio {ratio}, rate {of_theory} of theory");
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    assert!((of_theory - 1.0).abs() < 0.01, "{of_theory}");
}

/// Row 39. Equal balls on a line exchange their velocities: which there are never changes.
#[test]
fn balls_on_a_line_keep_their_velocities_bit_for_bit() {
    let mut random = random(39);
    let balls: Vec<_> = (0..1000)
        .map(|index| {
            // Velocities on a grid, so that their differences are exact.
            let velocity = f64::from(random.random::<i16>()) / 8192.0;
            let place = 2.0 * f64::from(index) - 999.0;
            (
                UNIT,
                DVec3::new(place, 0.0, 0.0),
                DVec3::new(velocity, 0.0, 0.0),
            )
        })
        .collect();
    let scene = placement(Boundary::Container, DVec3::new(1000.0, 1.0, 1.0), &balls);
    let speeds = |placement: &Placement| {
        let mut speeds: Vec<f64> = placement.velocities.iter().map(|v| v.x.abs()).collect();
        speeds.sort_by(f64::total_cmp);
        speeds
    };
    let before = speeds(&scene);
    let mut engine = EventDriven::new(State::new(&scene));
    run_collisions(&mut engine, 1.0, 1_000_000, &mut |_| ());
    let end = engine.state().placement();
    assert!(end.velocities.iter().all(|v| v.y == 0.0 && v.z == 0.0));
    let after = speeds(&end);
    let changed = before.iter().zip(&after).filter(|(a, b)| a != b).count();
    let difference = |(a, b): (&f64, &f64)| (a - b).abs();
    let largest = before
        .iter()
        .zip(&after)
        .map(difference)
        .fold(0.0, f64::max);
    println!("{changed} velocities changed, by {largest:e} at the most");
    assert_eq!(changed, 0, "of 1000 velocities");
}
