//! What a scene does not need is left out, and that changes no bit: each choice against the general path.

mod common;
#[path = "common/random_scene.rs"]
mod random_scene;

use common::{lattice, seed_scene};
use glam::DVec3;
use moltop::calendar::Indexed;
use moltop::domain::{Boundary, Plane};
use moltop::engine::Engine;
use moltop::engine::event_driven::{EventDriven, fitting, with_shells};
use moltop::event::Collision;
use moltop::scene::analysis;
use moltop::state::{Body, Placement, State};
use random_scene::random_scene;

fn seed_512() -> Placement {
    seed_scene(8, 1)
}

/// State hash and collisions after two units of time.
fn run(placement: &Placement) -> (u64, u64) {
    let mut engine = EventDriven::new(State::new(placement));
    let units = engine.state().units;
    let mut collisions = 0;
    engine
        .advance(units.instant(2.0), &mut |_| collisions += 1)
        .expect("balls with room");
    (engine.state().hash(), collisions)
}

/// A random scene without what the loops for plain scenes leave out: alike balls in a box, without planes.
fn plain_scene(seed: u64) -> Placement {
    let mut scene = random_scene(seed);
    let smallest = scene
        .bodies
        .iter()
        .map(|body| body.radius)
        .fold(1.0, f64::min);
    scene.bodies = vec![Body {
        radius: smallest.max(0.02),
        mass: 1.0,
    }];
    scene.body_of.clear();
    scene.domain.planes.clear();
    scene
}

#[test]
fn every_loop_that_leaves_something_out_gives_the_collisions_of_the_general_one_on_300_random_scenes()
 {
    let mut boundaries = [0_usize; 3];
    for seed in 0..300 {
        let scene = if seed < 240 {
            plain_scene(seed)
        } else {
            random_scene(seed)
        };
        let collisions = |mut engine: Box<dyn Engine>| {
            let mut collisions: Vec<Collision> = Vec::new();
            let until = engine.state().units.instant(20.0);
            engine
                .advance(until, &mut |collision| collisions.push(*collision))
                .expect("balls with room");
            (collisions, engine.state().hash(), engine.counters())
        };
        let (general, hash, counters) = collisions(Box::new(EventDriven::new(State::new(&scene))));
        let fitting = collisions(fitting::<Indexed>(State::new(&scene), None));
        assert!(fitting == (general, hash, counters), "scene {seed}");
        boundaries[scene.domain.boundary as usize] += fitting.0.len();
    }
    assert!(
        boundaries.iter().all(|&count| count > 500),
        "{boundaries:?}"
    );
}

/// Lists of neighbours are the fast structure, cells the slow twin.
#[test]
fn lists_of_neighbours_give_the_collisions_of_cells_at_every_density_and_with_every_shell() {
    let (mut crossings, mut count) = (0, 0);
    for (seed, spacing) in (0_u64..).zip([1.002, 1.02, 1.1, 1.25, 1.5, 2.5]) {
        for boundary in [Boundary::Container, Boundary::Periodic] {
            let mut scene = lattice(8, spacing, 8.0 * spacing.max(1.25), seed);
            if boundary == Boundary::Periodic {
                scene.domain.half_size *= spacing / spacing.max(1.25);
            }
            scene.domain.boundary = boundary;
            let collisions = |engine: &mut dyn Engine| {
                let mut collisions: Vec<Collision> = Vec::new();
                for slice in 1..=5 {
                    let until = engine.state().units.instant(0.5 * f64::from(slice));
                    engine
                        .advance(until, &mut |collision| collisions.push(*collision))
                        .expect("balls with room");
                    engine.reverse();
                    engine.reverse();
                }
                (collisions, engine.state().hash())
            };
            let cells = collisions(&mut EventDriven::new(State::new(&scene)));
            count += cells.0.len();
            for shell in [0.01, 0.2, 0.4] {
                let scale = State::new(&scene).units.length;
                let mut engine = with_shells(State::new(&scene), shell / scale)
                    .expect("alike balls in a wide box");
                assert!(
                    collisions(&mut *engine) == cells,
                    "{spacing} {boundary:?} {shell}"
                );
                crossings += engine.counters().cell_crossings;
            }
        }
    }
    assert!(count > 50_000 && crossings > 100_000, "{count} {crossings}");
}

/// A list that has no room for a crowd grows.
#[test]
fn lists_of_neighbours_hold_a_crowd() {
    let scene = lattice(8, 1.05, 9.0, 3);
    let mut cells = EventDriven::new(State::new(&scene));
    let scale = cells.state().units.length;
    let mut lists = with_shells(State::new(&scene), 0.55 / scale).expect("wide box");
    let until = cells.state().units.instant(1.0);
    for engine in [&mut cells as &mut dyn Engine, &mut *lists] {
        engine.advance(until, &mut |_| {}).expect("balls with room");
    }
    assert_eq!(cells.state().hash(), lists.state().hash());
}

#[test]
fn one_body_kept_once_is_the_same_as_a_body_per_ball() {
    let once = seed_512();
    let mut each = once.clone();
    each.bodies = vec![once.bodies[0]; 512];
    each.body_of = (0..512).collect();
    assert_eq!(run(&once), run(&each));
}

#[test]
fn no_plane_is_the_same_as_a_plane_beyond_the_walls() {
    let without = seed_512();
    let mut with = without.clone();
    with.domain.planes.push(Plane {
        normal: DVec3::X,
        offset: 100.0,
    });
    assert_eq!(run(&without), run(&with));
}

#[test]
fn points_alone_fly_as_points_beside_a_far_ball() {
    let mut alone = seed_512();
    alone.bodies[0].radius = 0.0;
    let mut beside = alone.clone();
    beside.bodies.push(Body {
        radius: 1e-300,
        mass: f64::INFINITY,
    });
    beside.body_of = vec![0; 512];
    beside.body_of.push(1);
    beside.positions.push(DVec3::splat(6.7));
    beside.velocities.push(DVec3::ZERO);
    let end = |placement: &Placement| {
        let mut engine = EventDriven::new(State::new(placement));
        let units = engine.state().units;
        engine
            .advance(units.instant(2.0), &mut |_| ())
            .expect("balls with room");
        assert_eq!(engine.counters().pair_collisions, 0);
        engine.counters().wall_collisions
    };
    assert_eq!(end(&alone), end(&beside));
}

#[test]
fn the_choices_say_what_is_left_out() {
    let mut placement = seed_512();
    let says = |placement: &Placement, words: &str| {
        let choices = analysis::choices(placement).join("\n");
        assert!(choices.contains(words), "{choices}");
    };
    says(&placement, "kept once");
    says(&placement, "no planes");
    says(&placement, "no periodic images");
    placement.domain.boundary = Boundary::Periodic;
    says(&placement, "no walls");
    placement.bodies[0].radius = 0.0;
    says(&placement, "all are points");
}
