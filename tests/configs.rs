//! Every scene in `configs` runs, if only for a moment, and shows what its comments promise.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use moltop::scene::Scene;
use moltop::snapshot::{Phase, Snapshot};
use moltop::worker::engines::Choice;
use moltop::worker::{Options, Outcome, Worker};

/// Runs a scene to a time; what must hold of every run is checked here.
fn run(name: &str, until: f64) -> (Arc<Snapshot>, Outcome) {
    let scene = Scene::load(Path::new(&format!("configs/{name}.toml"))).expect("a good scene");
    let placement = scene.place().expect("a good scene");
    let options = Options {
        engine: Choice::default(),
        until: Some(until),
        series: None,
        directory: None,
        replay: false,
        checkpoint_every: Duration::MAX,
        on_trouble: None,
        until_error: None,
        reversals: Vec::new(),
        trajectory: None,
        program_start: Instant::now(),
    };
    let outcome = Worker::start(&scene, placement, options).join();
    let last = Arc::clone(&outcome.snapshot);
    assert_eq!(last.phase, Phase::Finished, "{name}");
    assert!(
        last.energy_drift.expect("balls that move").abs() < 1e-12,
        "{name}"
    );
    assert!(last.max_overlap.unwrap_or(0.0) < 1e-12, "{name}");
    assert_eq!(last.counts.late_events, 0, "{name}");
    (last, outcome)
}

#[test]
fn the_dense_fluid_melts() {
    let (last, _) = run("dense-fluid", 3.0);
    let pressure = last.pressure.virial.expect("collisions");
    assert!(
        (11.2..11.8).contains(&(pressure / last.temperature.expect("balls"))),
        "{pressure}"
    );
}

#[test]
fn the_crystal_stays_a_crystal() {
    let (last, outcome) = run("crystal", 0.5);
    let z = last.compressibility_factor.expect("collisions");
    assert!((z / 54.47 - 1.0).abs() < 0.01, "{z}");
    let scene = Scene::load(Path::new("configs/crystal.toml")).expect("a good scene");
    let start = scene.place().expect("a good scene").positions;
    let (balls, _) = outcome.balls.expect("the balls of the end");
    let edge = scene.domain.period().x;
    for (end, start) in balls.positions.iter().zip(start) {
        let moved = *end - start;
        assert!((moved - edge * (moved / edge).round()).length() < 0.5);
    }
}

#[test]
fn both_kinds_of_the_mixture_keep_their_temperature() {
    let (_, outcome) = run("mixture", 100.0);
    let (balls, _) = outcome.balls.expect("the balls of the end");
    let energy = |range: std::ops::Range<usize>, mass: f64| -> f64 {
        range
            .map(|ball| mass * balls.velocities[ball].length_squared())
            .sum()
    };
    // Standard error of a ratio of two such temperatures: sqrt(2 * 2 / (3 * 1000)) = 3.7 %.
    let ratio = energy(0..1000, 16.0) / energy(1000..2000, 1.0);
    assert!((ratio - 1.0).abs() < 0.15, "{ratio}");
}

#[test]
fn the_grain_takes_up_heat() {
    let (last, outcome) = run("brownian", 5e-10);
    let (balls, collisions) = outcome.balls.expect("the balls of the end");
    assert!(balls.velocities[27_000].length() > 1.0, "metres per second");
    assert!(collisions[27_000] > 300);
    assert!(last.counts.pair_collisions > 30_000);
}

#[test]
fn the_gas_stays_above_the_wedge() {
    let (last, outcome) = run("wedge", 20.0);
    assert!(last.counts.plane_collisions > 100);
    let (balls, _) = outcome.balls.expect("the balls of the end");
    for position in balls.positions {
        assert!(position.y + 9.5 - position.x.abs() > 0.5 * 2f64.sqrt() - 1e-12);
    }
}

#[test]
fn the_ideal_gas_meets_walls_only_and_has_its_pressure() {
    let (last, _) = run("ideal-gas", 20.0);
    assert_eq!(last.counts.pair_collisions, 0);
    let expected = 20_000.0 * last.temperature.expect("balls") / 8000.0;
    assert!((last.pressure.wall.expect("walls") / expected - 1.0).abs() < 0.01);
}

#[test]
fn the_cradle_passes_its_blow_on_exactly() {
    let (last, outcome) = run("cradle", 3.0);
    assert_eq!((last.counts.pair_collisions, last.counts.ties), (4, 3));
    let (balls, _) = outcome.balls.expect("the balls of the end");
    let along: Vec<f64> = balls.positions.iter().map(|position| position.x).collect();
    assert_eq!(along, [-2.0, -1.0, 0.0, 1.0, 3.0]);
    assert_eq!(balls.velocities[4].x, 1.0);
}

#[test]
fn the_piston_presses_on_the_gas_and_is_slowed_down() {
    let (_, outcome) = run("piston", 300.0);
    let (balls, _) = outcome.balls.expect("the balls of the end");
    assert!(
        (1.0..10.0).contains(&balls.positions[2000].x),
        "{}",
        balls.positions[2000]
    );
    assert!(balls.velocities[2000].x < 0.02);
}

#[test]
fn the_seeds_scenes_run() {
    run("seed-512", 10.0);
    run("seed-15625", 0.5);
}

#[test]
fn equal_speeds_become_maxwellian_within_five_collisions_per_ball() {
    let (last, _) = run("relaxation", 24.0);
    let relaxation = &last.observables[0];
    let column = |name: &str| {
        let column = relaxation.columns.iter().find(|column| column.name == name);
        column
            .expect("a column")
            .values
            .iter()
            .flatten()
            .copied()
            .collect::<Vec<f64>>()
    };
    let [collisions, h, maxwell] = ["collisions_per_ball", "h", "h_of_maxwell"].map(column);
    let fourth = column("fourth_moment");
    assert!(
        (fourth[0] - 1.0).abs() < 1e-9 && h[0] > maxwell[0] + 1.0,
        "{} {}",
        fourth[0],
        h[0]
    );
    let late = collisions
        .iter()
        .position(|count| *count > 5.0)
        .expect("five collisions per ball");
    for row in late..h.len() {
        assert!(
            (h[row] - maxwell[row]).abs() < 0.01,
            "{} {}",
            h[row],
            maxwell[row]
        );
    }
    // Of 8000 balls at one instant the moment scatters by 1.3 %, and some 40 of the instants are independent.
    assert!(
        (fourth[late..].iter().sum::<f64>() / fourth[late..].len() as f64 / (5.0 / 3.0) - 1.0)
            .abs()
            < 0.01
    );
}
