//! What observables find, against references and against theory.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use moltop::scene::Scene;
use moltop::snapshot::{Figure, Observed, Phase, Snapshot};
use moltop::worker::engines::Choice;
use moltop::worker::{Options, Worker};

fn run(text: &str, engine: Choice) -> Arc<Snapshot> {
    let scene = Scene::parse(Path::new("scene.toml"), text).expect("a good scene");
    let options = Options {
        engine,
        until: scene.until,
        series: None,
        directory: None,
        checkpoint_every: Duration::MAX,
        on_trouble: None,
        until_error: None,
        reversals: Vec::new(),
        trajectory: None,
        program_start: Instant::now(),
    };
    let outcome = Worker::start(&scene, scene.place().expect("a good scene"), options).join();
    assert_eq!(outcome.snapshot.phase, Phase::Finished);
    outcome.snapshot
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

/// Reference values at this density: molecular dynamics over Enskog 1.20 for diffusion (Speedy 1987), which 500 balls in a
/// periodic box lower by 6 % or so; viscosity 0.58 and conductivity 2.3 (Lue 2005) with the errors of a short run.
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
