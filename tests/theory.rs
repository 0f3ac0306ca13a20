//! Theory and simulation meet: pressure and collision rates of whole runs against what the scene's analysis expects.
//!
//! The bands are the theory's own error plus three standard errors of runs of this length.

use std::path::Path;
use std::time::Instant;

use moltop::scene::Scene;
use moltop::scene::analysis::Theory;
use moltop::worker::engines::Choice;
use moltop::worker::{Options, Worker};

/// A mixture: masses a factor of eight apart, radii a factor of two.
const MIXTURE: &str = r#"
units = "reduced"
[domain]
kind = "container"
size = [12, 10, 14]
[[species]]
count = 200
radius = 0.6
mass = 4
placement = { kind = "random" }
velocity = { kind = "maxwell", temperature = 1 }
[[species]]
count = 600
radius = 0.3
mass = 0.5
placement = { kind = "random" }
velocity = { kind = "maxwell", temperature = 1 }
"#;

#[track_caller]
fn check(scene: &Scene, until: f64, tolerance: [f64; 3]) {
    let placement = scene.place().expect("a good scene");
    let theory = Theory::new(&placement, scene.units);
    let options = Options {
        engine: Choice::default(),
        until: Some(until),
        series: None,
        program_start: Instant::now(),
    };
    let last = Worker::start(scene, placement, options).join().snapshot;
    let expected = theory.at(last.temperature.expect("balls that move"));
    let pairs = [
        ("pressure", last.pressure.wall, expected.pressure),
        (
            "pair rate",
            Some(last.counts.pair_collisions as f64 / until),
            expected.pair_rate,
        ),
        (
            "wall rate",
            Some(last.counts.wall_collisions as f64 / until),
            expected.wall_rate,
        ),
    ];
    for ((name, found, expected), tolerance) in pairs.into_iter().zip(tolerance) {
        let (found, expected) = (found.expect("a long run"), expected.expect("a fluid"));
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{name}: {found}, expected {expected}"
        );
    }
}

#[test]
fn five_hundred_balls_between_near_walls_behave_as_expected() {
    let scene = Scene::load(Path::new("configs/seed-512.toml")).expect("a good scene");
    check(&scene, 400.0, [0.01, 0.015, 0.01]);
}

#[test]
fn a_mixture_behaves_as_expected() {
    let scene = Scene::parse(Path::new("mixture.toml"), MIXTURE).expect("a good scene");
    check(&scene, 200.0, [0.015, 0.025, 0.012]);
}
