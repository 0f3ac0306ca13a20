//! `moltop experiment fluid`: structure, diffusion, viscosity and conductivity of hard spheres against density.
//!
//! Periodic boxes of two sizes at densities from a gas to short of freezing, watched by the observables that every run can have.
//! A small box slows diffusion down, as each ball is dragged along by its own images; the correction makes the two sizes agree.
//!
//! Sources: Speedy, Mol. Phys. 62, 509 (1987) for diffusion; Yeh & Hummer, J. Phys. Chem. B 108, 15873 (2004) for the box.

use std::path::Path;

use crate::error::Result;
use crate::experiment::page::{Options, Outputs, Page, Table, Value};
use crate::experiment::plot::{Axis, Glyph, Line, Plot, Series};
use crate::experiment::progress::Progress;
use crate::experiment::theory;
use crate::experiment::trial::{EVENT, Trial, processor_seconds};
use crate::observe::block_sums::Estimate;
use crate::scene::Scene;
use crate::snapshot::{Figure, Observed};
use crate::worker::observables::{Known, Plan, advance};

/// Number densities, in units of the diameter.
const DENSITIES: [f64; 9] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];

/// Balls, and for how many mean free times they are watched.
const BOXES: [(u32, f64); 2] = [(500, 6400.0), (4000, 2400.0)];

/// The same of `--quick`.
const QUICK_BOXES: [(u32, f64); 1] = [(500, 1600.0)];

/// Collisions per second of processor that the time left is first guessed from.
const PACE: f64 = 300_000.0;

/// Sum over a cubic lattice of images that Yeh & Hummer's correction has.
const IMAGES: f64 = 2.837_297;

/// What was found at one density in one box; in units of diameter, mass and `k T`.
struct Point {
    density: f64,
    balls: u32,
    compressibility: f64,
    contact: [Estimate; 3],
    diffusion: Estimate,
    diffusion_unbound: Option<f64>,
    /// Enskog's diffusion.
    enskog: Option<f64>,
    /// Over Enskog's values.
    viscosity: Estimate,
    conductivity: Estimate,
}

/// Runs the experiment; gives the exit code.
///
/// # Errors
/// When results cannot be written.
pub fn run(options: &Options) -> Result<u8> {
    let outputs = Outputs::new(
        "fluid",
        options,
        &["structure", "transport"],
        &["diffusion"],
    )?;
    let boxes: &[(u32, f64)] = if options.quick { &QUICK_BOXES } else { &BOXES };
    let collisions = boxes
        .iter()
        .map(|(balls, times)| f64::from(*balls) * times / 2.0);
    let seconds = DENSITIES.len() as f64 * collisions.sum::<f64>() / PACE;
    let mut progress = Progress::new(seconds)?;
    let mut points = Vec::new();
    for &(balls, times) in boxes {
        for density in DENSITIES {
            points.extend(point(density, balls, times, &mut progress)?);
        }
    }
    let mut page = Page {
        name: "fluid",
        title: "Hard spheres against density",
        command: format!("moltop experiment fluid{}", if options.quick { " --quick" } else { "" }),
        tables: vec![structure(&points), transport(&points)],
        paragraphs: vec![
            "Engine event, periodic boxes. Errors are standard errors from blocks of each run. `unbound` is the diffusion corrected \
             for the size of the box with the viscosity that the same run found: k T 2.837 / (6 pi viscosity edge) more. Speedy's \
             formula sums up runs of some hundred balls, not corrected."
                .to_owned(),
        ],
        plots: vec![diffusion_plot(&points)],
    };
    if progress.stopped() {
        page.paragraphs
            .push("Interrupted: this is what had been measured.".to_owned());
    }
    outputs.finish(&page)?;
    Ok(progress.code())
}

/// Watches a fluid for so many mean free times; `None` if a signal came first.
fn point(
    density: f64,
    balls: u32,
    free_times: f64,
    progress: &mut Progress,
) -> Result<Option<Point>> {
    let edge = (f64::from(balls) / density).cbrt();
    let text = format!(
        "units = \"reduced\"\nseed = {balls}\n[domain]\nkind = \"periodic\"\nsize = [{edge}, {edge}, {edge}]\n\
         [[species]]\nname = \"balls\"\ncount = {balls}\nradius = 0.5\nmass = 1\n\
         velocity = {{ kind = \"normal\", deviation = 1 }}\n\
         [observe]\nradial_distribution = true\nmotion = true\ntransport = true\n"
    );
    let scene = Scene::parse(Path::new("fluid.toml"), &text)?;
    let placement = scene.place()?;
    let plan = Plan::new(&scene, &placement).expect("a scene with balls");
    let mut trial = Trial::new(EVENT, &placement);
    let mut on_demand = plan.observers(trial.state()).expect("it asks for some");
    let free_time = 1.0 / theory::collision_rate(density);
    let slice = 20.0 * free_time;
    let words = format!("{balls} balls at density {density}");
    for step in 1..=(free_times / 20.0) as u32 {
        let start = processor_seconds();
        let Trial { engine, observer } = &mut trial;
        let observed = Some((&mut on_demand, plan.every()));
        advance(&mut **engine, observer, observed, f64::from(step) * slice).expect("room to move");
        progress.tell(processor_seconds() - start, &words);
        if progress.stopped() {
            return Ok(None);
        }
    }
    let state = trial.state();
    let averages = (trial.observer.blocks.averages(state.now)).expect("time has passed");
    let energy = state.totals().thermal_energy().expect("balls that move");
    let count = f64::from(balls);
    let duration = averages.duration * state.units.time;
    let temperature = energy * state.units.energy();
    let virial = averages.settled.pair_virial / averages.duration;
    let known = Known {
        temperature: Some(temperature),
        collision_rate: Some(2.0 * averages.settled.pair_collisions as f64 / count / duration),
        compressibility_factor: Some(1.0 + virial / (3.0 * count * energy)),
    };
    let found = plan.results(&on_demand, state, known);
    // A ball's speed is its own unit: what grows with it is brought to k T = 1.
    let slow = 1.0 / temperature.sqrt();
    let diffusion = figure(&found, "diffusion_coefficient.balls");
    let viscosity = figure(&found, "viscosity");
    let unbound = diffusion
        .value
        .zip(viscosity.value)
        .map(|(diffusion, viscosity)| {
            let drag = 6.0 * std::f64::consts::PI * viscosity * edge;
            slow * (diffusion + IMAGES * temperature / drag)
        });
    let contact = [
        "contact_value",
        "contact_value_from_pressure",
        "contact_value_from_collision_rate",
    ];
    Ok(Some(Point {
        density,
        balls,
        compressibility: known.compressibility_factor.unwrap_or(f64::NAN),
        contact: contact.map(|name| estimate(figure(&found, name))),
        diffusion: estimate(diffusion).times(slow),
        diffusion_unbound: unbound,
        enskog: diffusion.expected.map(|expected| slow * expected),
        viscosity: over_theory(viscosity),
        conductivity: over_theory(figure(&found, "thermal_conductivity")),
    }))
}

fn figure<'f>(found: &'f [Observed], name: &str) -> &'f Figure {
    let mut figures = found.iter().flat_map(|observed| &observed.figures);
    figures
        .find(|figure| figure.name == name)
        .expect("the run is long enough for it")
}

fn estimate(figure: &Figure) -> Estimate {
    Estimate {
        value: figure.value,
        error: figure.standard_error,
    }
}

fn over_theory(figure: &Figure) -> Estimate {
    figure.expected.map_or_else(Estimate::default, |expected| {
        estimate(figure).times(1.0 / expected)
    })
}

fn fixed(value: Option<f64>, decimals: usize) -> Value {
    value.map_or(Value::Nothing, |value| Value::Fixed(value, decimals))
}

fn structure(points: &[Point]) -> Table {
    let columns = [
        "balls",
        "density",
        "Z",
        "Z, literature",
        "g(d) from g(r)",
        "error",
        "from Z",
        "from the rate",
    ];
    let mut table = Table::new("structure", "Pressure and contact value", &columns);
    for point in points {
        let expected = theory::compressibility(theory::packing_fraction(point.density));
        let [counted, pressure, rate] = point.contact;
        table.push([
            u64::from(point.balls).into(),
            Value::Fixed(point.density, 1),
            Value::Fixed(point.compressibility, 4),
            Value::Fixed(expected, 4),
            fixed(counted.value, 4),
            fixed(counted.error, 4),
            fixed(pressure.value, 4),
            fixed(rate.value, 4),
        ]);
    }
    table
}

fn transport(points: &[Point]) -> Table {
    let columns = [
        "balls",
        "density",
        "diffusion",
        "error",
        "Speedy",
        "unbound",
        "over Enskog",
        "viscosity over Enskog",
        "its error",
        "conductivity over Enskog",
        "its own error",
    ];
    let title = "Diffusion, viscosity and conductivity";
    let mut table = Table::new("transport", title, &columns);
    for point in points {
        table.push([
            u64::from(point.balls).into(),
            Value::Fixed(point.density, 1),
            fixed(point.diffusion.value, 4),
            fixed(point.diffusion.error, 4),
            Value::Fixed(theory::diffusion(point.density), 4),
            fixed(point.diffusion_unbound, 4),
            fixed(
                point
                    .diffusion
                    .value
                    .zip(point.enskog)
                    .map(|(found, enskog)| found / enskog),
                3,
            ),
            fixed(point.viscosity.value, 3),
            fixed(point.viscosity.error, 3),
            fixed(point.conductivity.value, 3),
            fixed(point.conductivity.error, 3),
        ]);
    }
    table
}

fn diffusion_plot(points: &[Point]) -> Plot {
    let mut series = Vec::new();
    for (balls, glyph) in [(500, Glyph::Circle), (4000, Glyph::Square)] {
        let of_box = || points.iter().filter(move |point| point.balls == balls);
        let ratio = |point: &Point| Some((point.density, point.diffusion.value? / point.enskog?));
        let ratios: Vec<_> = of_box().filter_map(ratio).collect();
        if !ratios.is_empty() {
            series.push(Series::points(&format!("{balls} balls"), glyph, ratios));
        }
    }
    let speedy = |point: &Point| {
        Some((
            point.density,
            theory::diffusion(point.density) / point.enskog?,
        ))
    };
    let curve = points.iter().take(DENSITIES.len()).filter_map(speedy);
    series.push(Series::line("Speedy 1987", Line::Dashed, curve.collect()));
    Plot {
        name: "diffusion",
        title: "Diffusion over Enskog's".to_owned(),
        x: Axis::linear("number density [1/diameter^3]"),
        y: Axis::linear("diffusion over Enskog's"),
        series,
    }
}
