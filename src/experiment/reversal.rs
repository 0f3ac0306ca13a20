//! `moltop experiment reversal`: run a gas, turn it round, and see how far it finds the way back.
//!
//! Redoes the second experiment of the student paper that this program takes up, the seed: its scene (512 balls), its times and
//! its measures. What comes back tells how reversible a method is, not how right: a method can retrace a wrong way. So the error
//! of the way there stands beside it, against the exact engine.

use crate::error::Result;
use crate::experiment::echo::{Echo, mean_distance};
use crate::experiment::fit::slope;
use crate::experiment::gases::seed_scene;
use crate::experiment::page::{Options, Outputs, Page, Table, Value};
use crate::experiment::plot::{Axis, Glyph, Line, Plot, Series};
use crate::experiment::progress::Progress;
use crate::experiment::trial::{EVENT, REVERSIBLE, Trial, WINDOWED};
use crate::worker::engines::Choice;

/// Balls along an edge of the scene's cube.
const EDGE: usize = 8;

/// What the seed printed: time, mean error of position and of velocity, collisions there and back, from event to event.
///
/// Its "0" at 1 s is what eight decimals leave of about 4e-14.
const SEED_EVENT: [(f64, f64, f64, u64); 4] = [
    (1.0, 0.0, 3.91e-12, 1250),
    (6.0, 2.01e-6, 6.35e-6, 8534),
    (11.0, 1.40, 2.012, 15_824),
    (16.0, 4.66, 2.217, 22_843),
];

/// The seed's errors of position in steps of 1/3600.
const SEED_STEP: [(f64, f64); 2] = [(1.0, 1.3e-3), (6.0, 2.68)];

/// Mean distance of two random places for a centre in this box: 0.6617 of its edge.
const LOST_POSITION: f64 = 0.6617 * 12.5;

/// Mean length of the difference of two random velocities: `4 / sqrt(pi)` deviations.
const LOST_VELOCITY: f64 = 2.256_758;

/// Times over which errors grow by a constant factor.
const GROWTH: std::ops::RangeInclusive<f64> = 1.0..=9.0;

/// When the trajectories of a method are compared with those of the exact engine.
const TRAJECTORY_TIME: f64 = 1.0;

struct Method {
    name: &'static str,
    choice: Choice,
    /// Seconds that a simulated second takes, about.
    cost: f64,
    seeds: u64,
}

/// One echo of a method: all data sets.
struct Point {
    method: usize,
    time: f64,
    positions: Vec<f64>,
    velocities: Vec<f64>,
    collisions: u64,
    energy: f64,
}

/// A time, and the errors of every ball's position and velocity after it.
type Cloud = (f64, Vec<(f64, f64)>);

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Runs the experiment; gives the exit code.
///
/// # Errors
/// When results cannot be written.
pub fn run(options: &Options) -> Result<u8> {
    let tables = ["errors", "seed", "trajectories"];
    let outputs = Outputs::new(
        "reversal",
        options,
        &tables,
        &["position", "velocity", "balls"],
    )?;
    let (times, step_seeds): (Vec<f64>, u64) = if options.quick {
        (vec![1.0, 3.0, 6.0, 9.0, 11.0, 16.0], 1)
    } else {
        ((1..=16).map(f64::from).collect(), 3)
    };
    let methods = methods(step_seeds);
    let all: f64 = times.iter().sum();
    let costs = methods
        .iter()
        .map(|method| 2.0 * all * method.cost * method.seeds as f64);
    let mut progress = Progress::new(costs.sum())?;
    let (points, scatter) = measure(&methods, &times, &mut progress);
    let growth = growth(&points);
    let mut page = Page {
        name: "reversal",
        title: "There and back",
        command: format!(
            "moltop experiment reversal{}",
            if options.quick { " --quick" } else { "" }
        ),
        tables: vec![
            errors(&methods, &points),
            beside_the_seed(&points),
            trajectories(&methods),
        ],
        paragraphs: growth
            .map(|(exponent, at_zero)| words(exponent, at_zero))
            .into_iter()
            .collect(),
        plots: vec![
            plot("position", &methods, &points, growth),
            plot("velocity", &methods, &points, None),
            balls(&scatter),
        ],
    };
    if progress.stopped() {
        page.paragraphs
            .push("Interrupted: this is what had been measured.".to_owned());
    }
    outputs.finish(&page)?;
    Ok(progress.code())
}

fn methods(step_seeds: u64) -> [Method; 5] {
    [
        Method {
            name: "event",
            choice: EVENT,
            cost: 0.002,
            seeds: 5,
        },
        Method {
            name: "windowed",
            choice: WINDOWED,
            cost: 0.004,
            seeds: 5,
        },
        Method {
            name: "reversible",
            choice: REVERSIBLE,
            cost: 0.015,
            seeds: 5,
        },
        Method {
            name: "step, dt = 1/60",
            choice: Choice::Step(1.0 / 60.0),
            cost: 0.005,
            seeds: 5,
        },
        Method {
            name: "step, dt = 1/3600",
            choice: Choice::Step(1.0 / 3600.0),
            cost: 0.1,
            seeds: step_seeds,
        },
    ]
}

/// Runs every echo; also gives the errors of single balls.
fn measure(methods: &[Method], times: &[f64], progress: &mut Progress) -> (Vec<Point>, Vec<Cloud>) {
    let mut points = Vec::new();
    let mut scatter = Vec::new();
    for (number, method) in methods.iter().enumerate() {
        for &time in times {
            let mut point = Point {
                method: number,
                time,
                positions: Vec::new(),
                velocities: Vec::new(),
                collisions: 0,
                energy: 0.0,
            };
            for seed in 1..=method.seeds {
                if progress.stopped() {
                    break;
                }
                progress.tell(0.0, &format!("{}, {time} s there and back", method.name));
                let echo = Echo::new(method.choice, &seed_scene(EDGE, seed), time);
                progress.tell(2.0 * time * method.cost, method.name);
                point.positions.push(echo.position());
                point.velocities.push(echo.velocity());
                point.collisions += echo.trial.events();
                point.energy = point.energy.max(echo.trial.energy_drift());
                if seed == 1 && method.choice == EVENT && [1.0, 6.0, 11.0].contains(&time) {
                    scatter.push((time, echo.errors));
                }
            }
            if !point.positions.is_empty() {
                point.collisions /= point.positions.len() as u64;
                points.push(point);
            }
        }
    }
    (points, scatter)
}

/// How fast the error of engine event grows \[1/s\], and the logarithm it would have at time zero.
fn growth(points: &[Point]) -> Option<(f64, f64)> {
    let logarithms: Vec<(f64, f64)> = points
        .iter()
        .filter(|point| point.method == 0 && GROWTH.contains(&point.time))
        .map(|point| {
            let sum: f64 = point.positions.iter().map(|&error| libm::log(error)).sum();
            (point.time, sum / point.positions.len() as f64)
        })
        .collect();
    if logarithms.len() < 2 {
        return None;
    }
    let exponent = slope(&logarithms);
    let offsets: f64 = logarithms
        .iter()
        .map(|(time, logarithm)| logarithm - exponent * time)
        .sum();
    Some((exponent, offsets / logarithms.len() as f64))
}

fn words(exponent: f64, at_zero: f64) -> String {
    let horizon = (libm::log(0.1) - at_zero) / exponent;
    format!(
        "Errors of engine event grow by e^({exponent:.3} t): chaos, not a fault of the engine, for each digit more would buy \
         {:.2} s. A tenth of a diameter is reached after {horizon:.1} s. Engine reversible rounds to integers in a way that a \
         reversed run undoes, so it has nothing to grow. An error of 0 is every bit the same; it cannot be shown on a \
         logarithmic axis. Errors of the way back say nothing about the way there: see the trajectories.",
        libm::log(10.0) / exponent
    )
}

fn errors(methods: &[Method], points: &[Point]) -> Table {
    let columns = [
        "engine",
        "time [s]",
        "data sets",
        "position error [d]",
        "lowest [d]",
        "highest [d]",
        "velocity error",
        "collisions",
        "over event's",
        "energy drift",
    ];
    let mut table = Table::new("errors", "Mean errors after so long and back", &columns);
    for point in points {
        let (lowest, highest) = crate::experiment::fit::extent(&point.positions);
        let exact = points
            .iter()
            .find(|other| other.method == 0 && other.time == point.time);
        let ratio = exact.map(|exact| point.collisions as f64 / exact.collisions as f64);
        table.push([
            methods[point.method].name.into(),
            point.time.into(),
            (point.positions.len() as u64).into(),
            mean(&point.positions).into(),
            lowest.into(),
            highest.into(),
            mean(&point.velocities).into(),
            point.collisions.into(),
            ratio.into(),
            point.energy.into(),
        ]);
    }
    table
}

fn beside_the_seed(points: &[Point]) -> Table {
    let columns = [
        "time [s]",
        "seed, position [d]",
        "event, position [d]",
        "reversible, position [d]",
        "seed, velocity",
        "event, velocity",
        "seed, collisions",
        "event, collisions",
        "seed, step 1/3600, position [d]",
        "step 1/3600, position [d]",
    ];
    let mut table = Table::new("seed", "The seed's figures on the same scene", &columns);
    let at = |method: usize, time: f64| {
        points
            .iter()
            .find(|point| point.method == method && point.time == time)
    };
    let position = |method: usize, time: f64| -> Value {
        at(method, time).map(|point| mean(&point.positions)).into()
    };
    for (time, seed_position, seed_velocity, seed_collisions) in SEED_EVENT {
        let step = SEED_STEP
            .iter()
            .find(|step| step.0 == time)
            .map(|step| step.1);
        table.push([
            time.into(),
            seed_position.into(),
            position(0, time),
            position(2, time),
            seed_velocity.into(),
            at(0, time).map(|point| mean(&point.velocities)).into(),
            seed_collisions.into(),
            at(0, time).map(|point| point.collisions).into(),
            step.into(),
            position(4, time),
        ]);
    }
    table
}

/// How far each method's balls are from those of engine event on the way there.
fn trajectories(methods: &[Method]) -> Table {
    let title = format!(
        "Mean distance from the positions of engine event after {TRAJECTORY_TIME} s, without turning round"
    );
    let mut table = Table::new(
        "trajectories",
        title,
        &["engine", "distance [d]", "max overlap [d]"],
    );
    let run = |choice: Choice| {
        let mut trial = Trial::new(choice, &seed_scene(EDGE, 1));
        trial.run(TRAJECTORY_TIME);
        trial
    };
    let exact = run(EVENT).state().placement();
    for method in methods {
        let trial = run(method.choice);
        let distance = mean_distance(&exact, &trial.state().placement());
        table.push([
            method.name.into(),
            distance.into(),
            trial.observer.max_overlap.into(),
        ]);
    }
    table
}

fn plot(
    name: &'static str,
    methods: &[Method],
    points: &[Point],
    growth: Option<(f64, f64)>,
) -> Plot {
    let position = name == "position";
    let mut series: Vec<Series> = methods
        .iter()
        .enumerate()
        .map(|(number, method)| {
            let own = points.iter().filter(|point| point.method == number);
            let line = own.map(|point| {
                (
                    point.time,
                    mean(if position {
                        &point.positions
                    } else {
                        &point.velocities
                    }),
                )
            });
            let line: Vec<_> = line.collect();
            let zero = line.iter().all(|point| point.1 == 0.0);
            let name = if zero {
                format!("{}: 0 at all times", method.name)
            } else {
                method.name.to_owned()
            };
            Series::numbered(number, &name, line)
        })
        .collect();
    let seed = SEED_EVENT.map(|point| (point.0, if position { point.1 } else { point.2 }));
    series.push(Series::points("seed, event", Glyph::Circle, seed.into()).hollow());
    if position {
        series.push(Series::points(
            "seed, step, dt = 1/3600",
            Glyph::Cross,
            SEED_STEP.into(),
        ));
    }
    let lost = if position {
        LOST_POSITION
    } else {
        LOST_VELOCITY
    };
    series.push(Series::line(
        "nothing remembered",
        Line::Dashed,
        vec![(1.0, lost), (16.0, lost)],
    ));
    if let Some((exponent, at_zero)) = growth {
        let line = |time: f64| (time, libm::exp(at_zero + exponent * time));
        let end = (libm::log(lost) - at_zero) / exponent;
        let label = format!("e^({exponent:.2} t)");
        series.push(Series::line(
            &label,
            Line::Dotted,
            vec![line(1.0), line(end)],
        ));
    }
    let (what, unit) = if position {
        ("position", "d")
    } else {
        ("velocity", "deviations")
    };
    Plot {
        name,
        title: format!("Error of {what} after there and back, 512 balls"),
        x: Axis::linear("time until turned round [s]"),
        y: Axis::logarithmic(&format!("mean error of {what} [{unit}]")),
        series,
    }
}

/// Every ball's error, as the seed drew it.
fn balls(scatter: &[Cloud]) -> Plot {
    let cloud = |(number, (time, errors)): (usize, &Cloud)| {
        let points = errors.iter().map(|error| error.0).enumerate();
        let points = points.map(|(ball, error)| (ball as f64, error)).collect();
        let glyph = [Glyph::Dot, Glyph::Cross, Glyph::Circle][number % 3];
        let series = Series::points(&format!("{time} s"), glyph, points);
        if glyph == Glyph::Circle {
            series.hollow()
        } else {
            series
        }
    };
    Plot {
        name: "balls",
        title: "Error of each ball after there and back, engine event".to_owned(),
        x: Axis::linear("ball"),
        y: Axis::logarithmic("error of position [d]"),
        series: scatter.iter().enumerate().map(cloud).collect(),
    }
}
