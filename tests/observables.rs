//! What observables find, against references and against theory.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use moltop::feed::{Command, Feed};
use moltop::scene::Scene;
use moltop::snapshot::{Figure, ObservableName, Observed, Phase, Snapshot};
use moltop::worker::engines::Choice;
use moltop::worker::{Options, SavedRun, Worker};

fn options(engine: Choice, until: f64) -> Options {
    Options {
        engine,
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
    }
}

fn run_with(text: &str, options: Options) -> Arc<Snapshot> {
    let scene = Scene::parse(Path::new("scene.toml"), text).expect("a good scene");
    let outcome = Worker::start(&scene, scene.place().expect("a good scene"), options).join();
    assert_eq!(outcome.snapshot.phase, Phase::Finished);
    outcome.snapshot
}

fn run(text: &str, engine: Choice) -> Arc<Snapshot> {
    let scene = Scene::parse(Path::new("scene.toml"), text).expect("a good scene");
    run_with(text, options(engine, scene.until.expect("an end")))
}

fn observable<'s>(snapshot: &'s Snapshot, name: &str) -> &'s Observed {
    let found = snapshot
        .observables
        .iter()
        .find(|observable| observable.name == name);
    found.expect("it was asked for")
}

fn figure<'s>(snapshot: &'s Snapshot, observable_name: &str, name: &str) -> &'s Figure {
    let figures = &observable(snapshot, observable_name).figures;
    figures
        .iter()
        .find(|figure| figure.name == name)
        .expect("a figure of this name")
}

/// A figure over what is expected of it, and the error of that.
fn ratio(figure: &Figure) -> (f64, f64) {
    let expected = figure.expected.expect("theory");
    (
        figure.value.expect("a value") / expected,
        figure.standard_error.unwrap_or(0.0) / expected,
    )
}

fn column(observable: &Observed, name: &str) -> Vec<f64> {
    let column = observable.columns.iter().find(|column| column.name == name);
    column
        .expect("a column of this name")
        .values
        .iter()
        .flatten()
        .copied()
        .collect()
}

/// Balls in a periodic box at density n d^3 = 0.5.
fn fluid(observe: &str, until: f64) -> String {
    format!(
        "units = \"reduced\"\n[domain]\nkind = \"periodic\"\nsize = [10, 10, 10]\n\
         [[species]]\nname = \"balls\"\ncount = 500\nradius = 0.5\nmass = 1\n\
         velocity = {{ kind = \"normal\", deviation = 1 }}\n[observe]\n{observe}\n[run]\nuntil = {until}\n"
    )
}

/// Reference values at this density: molecular dynamics over Enskog 1.20 for diffusion in boxes of this size (Speedy 1987);
/// viscosity 0.58 and conductivity 2.3 (Lue 2005) with the errors of a short run.
#[test]
fn a_fluid_has_its_contact_value_diffusion_and_transport_coefficients() {
    let last = run(
        &fluid(
            "radial_distribution = true\nmotion = true\ntransport = true\nflights = true",
            150.0,
        ),
        Choice::default(),
    );
    for name in [
        "contact_value_from_pressure",
        "contact_value_from_collision_rate",
    ] {
        let (ratio, _) = ratio(figure(&last, "radial_distribution", name));
        assert!((ratio - 1.0).abs() < 0.01, "{name} {ratio}");
    }
    let (contact, error) = ratio(figure(&last, "radial_distribution", "contact_value"));
    assert!(
        (contact - 1.0).abs() < 0.01 + 3.0 * error && error < 0.02,
        "{contact} +- {error}"
    );
    for name in [
        "diffusion_coefficient.balls",
        "diffusion_coefficient_from_velocity.balls",
    ] {
        let (ratio, error) = ratio(figure(&last, "motion", name));
        assert!(
            (ratio / 1.20 - 1.0).abs() < 0.08,
            "{name} {ratio} +- {error}"
        );
    }
    for (name, correction) in [("viscosity", 1.02), ("thermal_conductivity", 0.99)] {
        let (ratio, error) = ratio(figure(&last, "transport", name));
        assert!(
            (ratio - correction).abs() < 4.0 * error + 0.05 && error < 0.2,
            "{name} {ratio} +- {error}"
        );
    }
    let (path, error) = ratio(figure(&last, "flights", "mean_free_path"));
    assert!(
        (path - 1.0).abs() < 0.01 && error < 0.01,
        "{path} +- {error}"
    );
}

/// Diffusion of 500 balls against Speedy's fit (Mol. Phys. 62, 509, 1987), which sums up boxes of such a size: above Enskog's in
/// the middle, below it near freezing. All densities: `moltop experiment fluid`.
#[test]
fn diffusion_follows_the_trend_of_the_reference_with_density() {
    let over_enskog = [
        (0.2, 0.876, 1.87404),
        (0.5, 0.240, 7.68227),
        (0.8, 0.0645, 22.9177),
    ]
    .map(|(density, reference, rate)| {
        let (edge, until) = ((500.0_f64 / density).cbrt(), 2000.0 / rate);
        let text =
            fluid("motion = true", until).replace("[10, 10, 10]", &format!("{:?}", [edge; 3]));
        let last = run(&text, Choice::default());
        let diffusion = figure(&last, "motion", "diffusion_coefficient.balls");
        let slow = last.temperature.expect("balls that move").sqrt();
        let value = diffusion.value.expect("a long run") / slow;
        assert!((value / reference - 1.0).abs() < 0.04, "{density}: {value}");
        ratio(diffusion).0
    });
    let [gas, fluid, dense] = over_enskog;
    assert!(
        gas > 1.03 && fluid > gas + 0.07 && dense < 1.02,
        "{over_enskog:?}"
    );
}

/// Flights of a gas against the law that kinetic theory gives them: Pearson's sum over bins of enough flights.
#[test]
fn free_flights_are_spread_as_kinetic_theory_says() {
    let text = "units = \"reduced\"\n[domain]\nkind = \"periodic\"\nsize = [40, 40, 40]\n\
         [[species]]\ncount = 1000\nradius = 0.5\nmass = 1\nvelocity = { kind = \"normal\", deviation = 1 }\n\
         [observe]\nflights = true\n[run]\nuntil = 900\n";
    let last = run(text, Choice::default());
    let flights = observable(&last, "flights");
    for name in ["path", "time"] {
        let found = column(flights, &format!("flights_by_{name}"));
        let expected = column(flights, &format!("expected_by_{name}"));
        let total: f64 = found.iter().sum();
        assert!(total > 50_000.0, "{total}");
        let distance: f64 = found
            .iter()
            .zip(&expected)
            .map(|(found, expected)| (found - expected).abs())
            .sum();
        assert!(
            distance / total < 0.06,
            "{name}: {} of the flights are elsewhere",
            distance / total
        );
    }
}

/// Seventeen mean free times, at whose end each ball is on a flight that is longer than most: those must not lack.
#[test]
fn long_flights_are_not_missing_from_the_histogram_of_a_short_run() {
    let text = "units = \"reduced\"\n[domain]\nkind = \"periodic\"\nsize = [63.5, 63.5, 63.5]\n\
         [[species]]\ncount = 4000\nradius = 0.5\nmass = 1\nplacement = { kind = \"random\" }\n\
         velocity = { kind = \"normal\", deviation = 1 }\n[observe]\nflights = true\n[run]\nuntil = 150\n";
    let last = run(text, Choice::default());
    let flights = observable(&last, "flights");
    for name in ["path", "time"] {
        let found = column(flights, &format!("flights_by_{name}"));
        let edges = column(flights, &format!("free_{name}"));
        let total: f64 = found.iter().sum();
        assert!(total > 25_000.0, "{total}");
        let half = 0.5 * edges[1];
        let sum: f64 = found
            .iter()
            .zip(&edges)
            .map(|(found, edge)| found * (edge + half))
            .sum();
        let mean = figure(&last, "flights", &format!("mean_free_{name}"));
        let ratio = sum / total / mean.value.expect("flights");
        assert!((ratio - 1.0).abs() < 0.02, "{name}: {ratio}");
    }
}

/// Both exact engines show the observers the same gas: every number of every table, bit for bit.
#[test]
fn observables_are_the_same_with_both_engines_and_any_number_of_threads() {
    let text = "units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [120, 120, 120]\n\
         [[species]]\nname = \"a\"\ncount = 4096\nradius = 0.5\nmass = 1\nvelocity = { kind = \"normal\", deviation = 1 }\n\
         [observe]\nevery = 5\nradial_distribution = true\ndensity_profile = true\nmotion = true\nrelaxation = true\nflights = true\n\
         [run]\nuntil = 300\n";
    let event = run(text, Choice::default());
    assert!(event.counts.pair_collisions > 5000);
    assert_eq!(event.observables.len(), 5);
    for threads in [1, 2] {
        let windowed = run(text, Choice::Windowed(threads));
        assert_eq!(event.state_hash, windowed.state_hash);
        assert_eq!(event.observables, windowed.observables);
    }
}

#[test]
fn the_pressure_on_each_wall_is_that_of_the_gas() {
    let text = "units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [20, 20, 20]\n\
         [[species]]\ncount = 1000\nradius = 0.3\nmass = 1\nvelocity = { kind = \"normal\", deviation = 1 }\n\
         [observe]\nflights = true\n[run]\nuntil = 200\n";
    let last = run(text, Choice::default());
    for wall in [
        "x_lower", "x_upper", "y_lower", "y_upper", "z_lower", "z_upper",
    ] {
        let (ratio, error) = ratio(figure(&last, "flights", &format!("pressure.{wall}")));
        assert!(
            (ratio - 1.0).abs() < 5.0 * error && error < 0.03,
            "{wall} {ratio} +- {error}"
        );
    }
}

/// Stops before and after a reversal, goes on from the checkpoints, and compares every figure and every table.
#[test]
fn every_observable_goes_on_from_a_checkpoint_bit_for_bit() {
    let all = "radial_distribution = true\ndensity_profile = true\nmotion = true\nrelaxation = true\nflights = true";
    let scene = |kind: &str, more: &str| {
        format!(
            "units = \"reduced\"\n[domain]\nkind = \"{kind}\"\nsize = [60, 60, 60]\n\
             [[species]]\nname = \"a\"\ncount = 2000\nradius = 0.5\nmass = 1\nvelocity = {{ kind = \"normal\", deviation = 1 }}\n\
             [[ball]]\nname = \"grain\"\nposition = [2.3, 2.3, 2.3]\nradius = 0.9\nmass = 20\n\
             [observe]\nevery = 0.7\n{all}\n{more}"
        )
    };
    let (turn, until) = (31.0, 60.0);
    for (text, observables) in [
        (scene("container", ""), 5),
        (scene("periodic", "transport = true"), 6),
    ] {
        for engine in [Choice::default(), Choice::Windowed(2), Choice::Reversible] {
            let whole = Options {
                reversals: vec![turn],
                ..options(engine, until)
            };
            let whole = run_with(&text, whole);
            assert!(whole.counts.pair_collisions > 1000);
            assert_eq!(whole.observables.len(), observables);
            let place = tempfile::tempdir().expect("a directory");
            let part = |until: f64, reversals: &[f64]| Options {
                directory: Some(place.path().to_owned()),
                reversals: reversals.to_vec(),
                ..options(engine, until)
            };
            run_with(&text, part(20.0, &[]));
            let mut last = None;
            for (end, turns) in [(45.0, &[turn][..]), (until, &[])] {
                let (saved, ..) = SavedRun::load(place.path()).expect("a checkpoint");
                last = Some(Worker::resume(saved, part(end, turns)).join().snapshot);
            }
            let last = last.expect("it went on");
            assert_eq!(last.state_hash, whole.state_hash, "{engine:?}");
            for (one, other) in last.observables.iter().zip(whole.observables.iter()) {
                assert_eq!(one, other, "{engine:?}");
            }
        }
    }
}

/// The scene of `configs/relaxation.toml`, turned back after six collisions per ball: H goes the whole way back.
#[test]
fn boltzmanns_h_returns_when_time_is_reversed() {
    let text = std::fs::read_to_string("configs/relaxation.toml").expect("a scene");
    let turned = Options {
        reversals: vec![4.0],
        ..options(Choice::Reversible, 8.0)
    };
    let last = run_with(&text, turned);
    let relaxation = observable(&last, "relaxation");
    let [collisions, h, maxwell] =
        ["collisions_per_ball", "h", "h_of_maxwell"].map(|name| column(relaxation, name));
    let middle = h.len() / 2;
    assert!(collisions[middle] > 5.0, "{}", collisions[middle]);
    assert!(h[0] > maxwell[0] + 1.0 && (h[middle] - maxwell[middle]).abs() < 0.01);
    for (there, back) in h.iter().zip(h.iter().rev()) {
        assert!((there - back).abs() < 1e-9, "{there} {back}");
    }
}

/// In the first collision of most balls: the flights that have ended are the short ones, and yet the mean is right.
#[test]
fn the_mean_free_path_is_not_that_of_the_short_flights_that_have_ended() {
    let text = "units = \"reduced\"\n[domain]\nkind = \"periodic\"\nsize = [250, 250, 250]\n\
         [[species]]\ncount = 20000\nradius = 0.5\nmass = 1\nplacement = { kind = \"random\" }\n\
         velocity = { kind = \"normal\", deviation = 1 }\n[observe]\nevery = 1\nflights = true\n[run]\nuntil = 100.9\n";
    let last = run(text, Choice::Windowed(2));
    let ends = 2.0 * last.counts.pair_collisions as f64;
    assert!(ends < 1.2 * 20_000.0, "{ends}");
    for name in ["mean_free_path", "mean_free_time"] {
        let figure = figure(&last, "flights", name);
        let (ratio, _) = ratio(figure);
        assert!((ratio - 1.0).abs() < 4.0 / ends.sqrt(), "{name} {ratio}");
    }
}

/// Keys of a running dashboard end up here: what is switched on measures from then on, and what cannot be says why.
#[test]
fn observables_are_switched_on_and_off_while_the_gas_runs() {
    let text = fluid("motion = true", 1e9);
    let scene = Scene::parse(Path::new("scene.toml"), &text).expect("a good scene");
    let placement = scene.place().expect("a good scene");
    let worker = Worker::start(&scene, placement, options(Choice::default(), 1e9));
    let feed = worker.feed();
    let wait = |what: &str, is_there: &dyn Fn(&Snapshot) -> bool| {
        let deadline = Instant::now() + Duration::from_secs(60);
        while !is_there(&feed.latest()) {
            assert!(Instant::now() < deadline, "{what}");
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    let found = |snapshot: &Snapshot, name| {
        let observed = snapshot.observed(name)?;
        Some(
            observed
                .figures
                .iter()
                .any(|figure| figure.standard_error.is_some()),
        )
    };
    for name in ObservableName::ALL {
        feed.send(Command::Observe(name, true));
    }
    wait("all are on", &|snapshot| snapshot.observables.len() == 6);
    for name in [
        ObservableName::Flights,
        ObservableName::Transport,
        ObservableName::RadialDistribution,
    ] {
        wait("it has found something", &|snapshot| {
            found(snapshot, name) == Some(true)
        });
    }
    for name in ObservableName::ALL {
        feed.send(Command::Observe(name, false));
    }
    wait("all are off", &|snapshot| snapshot.observables.is_empty());
    let time = feed.latest().time;
    wait("the run goes on", &|snapshot| snapshot.time > time);
    feed.send(Command::Stop);
    worker.join();
    let text = text.replace("periodic", "container");
    let scene = Scene::parse(Path::new("scene.toml"), &text).expect("a good scene");
    let placement = scene.place().expect("a good scene");
    let worker = Worker::start(&scene, placement, options(Choice::default(), 1e9));
    let feed = worker.feed();
    feed.send(Command::Observe(ObservableName::Transport, true));
    let deadline = Instant::now() + Duration::from_secs(60);
    while feed.latest().notice.is_none() && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(5));
    }
    let notice = feed.latest().notice.clone().unwrap_or_default();
    assert!(
        notice.starts_with("transport: must be measured in a periodic box"),
        "{notice}"
    );
    feed.send(Command::Stop);
    worker.join();
}
