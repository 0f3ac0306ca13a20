//! What was measured, as tables and pictures.

use crate::experiment::page::{Table, Value};
use crate::experiment::plot::{Axis, Glyph, Line, Plot, Series};
use crate::experiment::trade::settle::Start;
use crate::experiment::trade::statistics::{Difference, threads};
use crate::experiment::trade::trajectories::{LOOKS, TURNS};
use crate::experiment::trade::verdict::{Promise, Row};
use crate::snapshot::Units;

/// What is shown of averages: names and the error's place.
const AVERAGES: [&str; 4] = [
    "wall pressure",
    "virial pressure",
    "collision rate",
    "displacement",
];

/// Unit of speed, and what it is of the scene's.
fn speed_unit(units: Units) -> (&'static str, f64) {
    match units {
        Units::Si => ("ns/s", 1e9),
        Units::Reduced => ("1/s", 1.0),
    }
}

/// Errors against the first row, whose noise is its own.
fn errors(rows: &[Row], number: usize) -> [Option<Difference>; 4] {
    rows[number].errors.map(|found| {
        let own = |noise: f64| {
            if number == 0 {
                noise / 2.0_f64.sqrt()
            } else {
                noise
            }
        };
        found.map(|found| Difference {
            noise: own(found.noise),
            ..found
        })
    })
}

/// What was asked of the gas before anything was measured.
pub fn settling(start: &Start) -> Table {
    let columns = ["the gas at the start", "found", "must be", "met"];
    let mut table = Table::new("settling", "Whether the gas has settled", &columns);
    for criterion in &start.criteria {
        table.push([
            criterion.what.clone().into(),
            criterion.found.into(),
            criterion.limit.clone().into(),
            if criterion.met { "yes" } else { "no" }.into(),
        ]);
    }
    table
}

pub fn averages(rows: &[Row], units: Units) -> Table {
    let (unit, scale) = speed_unit(units);
    let mut columns = vec![
        "setting".to_owned(),
        format!("speed [{unit}]"),
        "times first's".to_owned(),
    ];
    columns.extend(AVERAGES.map(|name| format!("{name} [%]")));
    columns.extend(["viscosity, law [%]".to_owned(), "worth it".to_owned()]);
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let title = "Speed, and errors with their noise, from the same run";
    let mut table = Table::new("settings", title, &columns);
    for (number, row) in rows.iter().enumerate() {
        let [wall, virial, rate, displacement] =
            errors(rows, number).map(|found| -> Value { found.map(with_noise).into() });
        let worth = row.dominated_by.map_or_else(
            || "yes".to_owned(),
            |other| format!("no: {}", rows[other].setting.name),
        );
        let law = row.setting.law[3];
        table.push([
            row.setting.name.clone().into(),
            (scale * row.measured.speed()).into(),
            (row.measured.speed() / rows[0].measured.speed()).into(),
            wall,
            virial,
            rate,
            displacement,
            if law > 0.0 {
                Value::Fixed(100.0 * law, 2)
            } else {
                Value::Nothing
            },
            worth.into(),
        ]);
    }
    table
}

/// In percent, with as many decimals as the noise allows.
fn with_noise(found: Difference) -> String {
    let (error, noise) = (100.0 * found.error, 100.0 * found.noise);
    let decimals = if noise > 0.0 {
        (1.0 - noise.log10().floor()).clamp(0.0, 5.0) as usize
    } else {
        3
    };
    format!("{error:+.decimals$} ± {noise:.decimals$}")
}

/// The same with every digit.
pub fn numbers(rows: &[Row]) -> Table {
    let mut columns = vec![
        "setting".to_owned(),
        "simulated time".to_owned(),
        "seconds".to_owned(),
    ];
    for name in AVERAGES {
        columns.extend([format!("{name} error"), format!("{name} noise")]);
    }
    columns.extend(
        ["pressure", "collision rate", "diffusion", "viscosity"].map(|name| format!("{name} law")),
    );
    columns.push("dominated by".to_owned());
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut table = Table::only_in_files("numbers", "Speed and errors, as shares", &columns);
    for (number, row) in rows.iter().enumerate() {
        let [wall, virial, rate, displacement] = errors(rows, number);
        let error = |found: Option<Difference>| -> Value { found.map(|found| found.error).into() };
        let noise = |found: Option<Difference>| -> Value { found.map(|found| found.noise).into() };
        let [pressure_law, rate_law, diffusion_law, viscosity_law] = row.setting.law;
        table.push([
            row.setting.name.clone().into(),
            row.measured.time.into(),
            row.measured.seconds.into(),
            error(wall),
            noise(wall),
            error(virial),
            noise(virial),
            error(rate),
            noise(rate),
            error(displacement),
            noise(displacement),
            pressure_law.into(),
            rate_law.into(),
            diffusion_law.into(),
            viscosity_law.into(),
            row.dominated_by
                .map(|other| rows[other].setting.name.clone())
                .into(),
        ]);
    }
    table
}

pub fn faith(rows: &[Row]) -> Table {
    let look = |index: usize| format!("off after {} [d]", LOOKS[index]);
    let turn = |index: usize| format!("echo after {} [d]", TURNS[index]);
    let columns = [
        "setting".to_owned(),
        look(0),
        look(1),
        look(2),
        turn(0),
        turn(1),
        "missed [%]".to_owned(),
        "double [%]".to_owned(),
        "max overlap [d]".to_owned(),
        "mean gap [d]".to_owned(),
        "energy drift".to_owned(),
        "virial ledger".to_owned(),
        "KS over critical".to_owned(),
    ];
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let title = "Faithfulness: trajectories and the way back after so many mean free times, and what must be kept";
    let mut table = Table::new("faith", title, &columns);
    for row in rows {
        let faith = row.faith;
        let percent = |share: Option<f64>| -> Value { share.map(|share| 100.0 * share).into() };
        table.push([
            row.setting.name.clone().into(),
            faith.map(|faith| faith.distance[0]).into(),
            faith.map(|faith| faith.distance[1]).into(),
            faith.map(|faith| faith.distance[2]).into(),
            faith.map(|faith| faith.echo[0]).into(),
            faith.map(|faith| faith.echo[1]).into(),
            percent(row.measured.missed),
            percent(row.measured.double),
            row.measured.overlap.into(),
            faith.and_then(|faith| faith.gap).into(),
            row.measured.energy.into(),
            row.measured.ledger.into(),
            row.measured.speeds.into(),
        ]);
    }
    table
}

pub fn accuracies(promises: &[Promise]) -> Table {
    let columns = [
        "--accuracy",
        "takes",
        "largest error by law [%]",
        "largest error measured [%]",
        "noise [%]",
        "promise",
    ];
    let title =
        "What --accuracy promises, and the worst of pressure, collision rate and displacement";
    let mut table = Table::new("accuracy", title, &columns);
    for promise in promises {
        table.push([
            promise.accuracy.into(),
            promise.setting.clone().into(),
            (100.0 * promise.law).into(),
            promise.found.map(|found| 100.0 * found.error).into(),
            promise.found.map(|found| 100.0 * found.noise).into(),
            promise.verdict.into(),
        ]);
    }
    table
}

pub fn refused(refused: &[(String, String)]) -> Table {
    let mut table = Table::new(
        "refused",
        "Engines that do not take this scene",
        &["engine", "reason"],
    );
    for (engine, reason) in refused {
        table.push([engine.clone().into(), reason.clone().into()]);
    }
    table
}

/// Engines with their glyphs.
const ENGINES: [(&str, Glyph); 5] = [
    ("event", Glyph::Circle),
    ("windowed", Glyph::Square),
    ("reversible", Glyph::Diamond),
    ("step", Glyph::Cross),
    ("statistical", Glyph::Triangle),
];

/// Simulated time per second.
fn speed_axis(units: Units) -> Axis {
    Axis::logarithmic(&format!("speed [{}]", speed_unit(units).0))
}

/// Points of every engine, dominated ones hollow, and the front joined.
fn front(rows: &[Row], units: Units, y: &dyn Fn(&Row) -> Option<f64>) -> Vec<Series> {
    let (_, scale) = speed_unit(units);
    let point = |row: &Row| Some((scale * row.measured.speed(), y(row)?));
    let mut series: Vec<Series> = Vec::new();
    for (number, (engine, glyph)) in ENGINES.into_iter().enumerate() {
        for dominated in [false, true] {
            let own = rows.iter().filter(|row| {
                row.setting.choice.name() == engine && row.dominated_by.is_some() == dominated
            });
            let points: Vec<_> = own.filter_map(point).collect();
            if points.is_empty() {
                continue;
            }
            series.push(if dominated {
                let name = format!("{engine}, dominated");
                Series::points(&name, glyph, points)
                    .hollow()
                    .coloured(number)
            } else {
                Series::points(engine, glyph, points).coloured(number)
            });
        }
    }
    let mut points: Vec<_> = rows
        .iter()
        .filter(|row| threads(row.setting.choice) == 1)
        .filter_map(point)
        .collect();
    points.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut best = f64::INFINITY;
    points.retain(|point| {
        let better = point.1 < best;
        best = best.min(point.1);
        better
    });
    series.push(
        Series::line("best for its speed, one thread", Line::Dotted, points)
            .coloured(ENGINES.len()),
    );
    series
}

pub fn pressure_plot(rows: &[Row], units: Units) -> Plot {
    let error = |row: &Row| {
        let known = row.errors[0].into_iter().chain(row.errors[1]);
        let best = known.min_by(|a, b| a.noise.total_cmp(&b.noise))?;
        // Nothing can be seen below the noise.
        Some(100.0 * best.error.abs().max(best.noise)).filter(|error| *error > 0.0)
    };
    Plot {
        name: "pressure",
        title: "Error of the pressure, or its noise if that is more".to_owned(),
        x: speed_axis(units),
        y: Axis::logarithmic("error of the pressure [%]"),
        series: front(rows, units, &error),
    }
}

pub fn trajectory_plot(rows: &[Row], units: Units) -> Plot {
    Plot {
        name: "trajectories",
        title: format!("Error of trajectories after {} mean free time", LOOKS[1]),
        x: speed_axis(units),
        y: Axis::logarithmic("mean error of position [d]"),
        series: front(rows, units, &|row| row.faith.map(|faith| faith.distance[1])),
    }
}
