//! Theory and simulation meet: pressure and collision rates of whole runs against what the scene's analysis expects.
//!
//! The bands are the theory's own error plus three standard errors of runs of this length.

use std::path::Path;
use std::time::{Duration, Instant};

use moltop::calendar::Indexed;
use moltop::engine::Engine;
use moltop::engine::event_driven::EventDriven;
use moltop::engine::windowed::Windowed;
use moltop::scene::Scene;
use moltop::scene::analysis::{Brownian, Theory};
use moltop::state::State;
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
        directory: None,
        replay: false,
        checkpoint_every: Duration::MAX,
        on_trouble: None,
        until_error: None,
        reversals: Vec::new(),
        trajectory: None,
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

/// Pair collisions that `moltop check` expects, against what a short run counts after the start has been forgotten.
#[track_caller]
fn check_rate(name: &str, settle: f64, until: f64) {
    let scene = Scene::load(Path::new(&format!("configs/{name}.toml"))).expect("a good scene");
    let placement = scene.place().expect("a good scene");
    let state = State::new(&placement);
    let units = state.units;
    let mut engine: Box<dyn Engine> = if Windowed::pays(&placement) {
        Box::new(Windowed::new(state, 2))
    } else {
        Box::new(EventDriven::<Indexed>::new(state))
    };
    let mut counted = [0; 2];
    for (count, time) in counted.iter_mut().zip([settle, until]) {
        engine
            .advance(units.instant(time), &mut |_| ())
            .expect("balls with room");
        *count = engine.counters().pair_collisions;
    }
    let found = (counted[1] - counted[0]) as f64 / (until - settle);
    let temperature =
        moltop::scene::analysis::temperature(&placement, scene.units).expect("balls that move");
    let expected = Theory::new(&placement, scene.units)
        .at(temperature)
        .pair_rate
        .expect("a theory");
    println!(
        "{name}: {found:.4e}, expected {expected:.4e}, ratio {}",
        found / expected
    );
    assert!(
        (found / expected - 1.0).abs() < 0.02,
        "{name}: {found}, expected {expected}"
    );
}

#[test]
fn the_collision_rate_of_the_dense_fluid_is_known_before_it_runs() {
    check_rate("dense-fluid", 1.0, 2.5);
}

#[test]
fn the_collision_rate_of_the_crystal_is_known_before_it_runs() {
    check_rate("crystal", 0.2, 1.0);
}

#[test]
fn the_collision_rate_of_the_mixture_is_known_before_it_runs() {
    check_rate("mixture", 20.0, 320.0);
}

#[test]
fn the_collision_rate_of_oxygen_is_known_before_it_runs() {
    check_rate("oxygen", 1.0e-10, 1.6e-10);
}

#[test]
fn the_collision_rate_beside_a_grain_is_known_before_it_runs() {
    check_rate("brownian", 5e-10, 2.5e-9);
}

/// The mean squared displacement of a heavy ball over many courses of events, before and after its relaxation time.
#[test]
fn a_heavy_ball_wanders_as_far_as_langevin_says() {
    const SEEDS: u32 = 60;
    let text = "units = \"reduced\"\n[domain]\nkind = \"periodic\"\nsize = [20, 20, 20]\n\
                [[species]]\ncount = 2000\nradius = 0.25\nmass = 1\nplacement = { kind = \"random\" }\n\
                velocity = { kind = \"maxwell\", temperature = 1 }\n\
                [[ball]]\nname = \"grain\"\nposition = [0, 0, 0]\nradius = 1\nmass = 50\n";
    let times = [5.0, 50.0];
    let (mut found, mut expected) = ([0.0; 2], [0.0; 2]);
    for seed in 1..=SEEDS {
        let mut scene = Scene::parse(Path::new("grain.toml"), text).expect("a good scene");
        scene.seed = u64::from(seed);
        let placement = scene.place().expect("a good scene");
        let theory = Brownian::new(&placement, scene.units, 2000).expect("a heavy ball");
        let mut engine = EventDriven::new(State::new(&placement));
        let units = engine.state().units;
        for (index, time) in times.into_iter().enumerate() {
            engine
                .advance(units.instant(time), &mut |_| ())
                .expect("balls with room");
            let moved = engine.state().unwrapped_position(2000) * units.length;
            found[index] += moved.length_squared();
            expected[index] += theory.displacement_squared(1.0, time);
        }
    }
    for (found, expected) in found.into_iter().zip(expected) {
        // A sum of squares of three normal deviates, so many times.
        let tolerance = 3.0 * (2.0 / 3.0 / f64::from(SEEDS)).sqrt();
        println!("{} of the expected square", found / expected);
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{}",
            found / expected
        );
    }
}
