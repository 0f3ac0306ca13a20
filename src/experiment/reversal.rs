//! `moltop experiment reversal`: run a gas, turn it round, and see how far it finds the way back.
//!
//! Redoes the second experiment of the student paper that this program takes up, the seed: its scene (512 balls), its times and
//! its measures. What comes back tells how reversible a method is, not how right: a method can retrace a wrong way. So the error
//! of the way there stands beside it, against the exact engine.

mod steps;

use crate::error::Result;
use crate::experiment::double_double::DoubleDouble;
use crate::experiment::echo::Echo;
use crate::experiment::fit::slope;
use crate::experiment::gases::seed_scene;
use crate::experiment::page::{Options, Outputs, Page, Table, Value};
use crate::experiment::plot::{Axis, Glyph, Line, Plot, Series};
use crate::experiment::precise::{Precise, Scalar, distance};
use crate::experiment::progress::Progress;
use crate::experiment::trial::{EVENT, REVERSIBLE, Trial, WINDOWED};
use crate::state::Placement;
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

/// When the trajectories of a method are compared with those of twice the precision.
const TRAJECTORY_TIMES: [f64; 3] = [0.5, 1.0, 2.0];

/// What runs a gas.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    Engine(Choice),
    /// All pairs, in half the digits of f64.
    Single,
    /// All pairs, in twice the digits of f64.
    Double,
}

/// The way of engine event, which others are held against.
const EXACT: usize = 0;

struct Method {
    name: &'static str,
    way: Way,
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
    /// There and back, by data set.
    collisions: Vec<u64>,
    energy: Option<f64>,
}

impl Point {
    fn mean_collisions(&self) -> u64 {
        self.collisions.iter().sum::<u64>() / self.collisions.len() as u64
    }
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
    let tables = ["errors", "seed", "trajectories", "steps"];
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
    let (steps, why) = steps::causes(options.quick, &mut progress);
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
            steps,
        ],
        paragraphs: growth
            .map(|(exponent, at_zero)| words(exponent, at_zero))
            .into_iter()
            .chain(why)
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

fn methods(step_seeds: u64) -> [Method; 7] {
    let method = |name, way, cost, seeds| Method {
        name,
        way,
        cost,
        seeds,
    };
    let step = |dt: f64| Way::Engine(Choice::Step(dt));
    [
        method("event", Way::Engine(EVENT), 0.002, 5),
        method("windowed", Way::Engine(WINDOWED), 0.004, 5),
        method("reversible", Way::Engine(REVERSIBLE), 0.005, 5),
        method("step, dt = 1/60", step(1.0 / 60.0), 0.005, 5),
        method("step, dt = 1/3600", step(1.0 / 3600.0), 0.1, step_seeds),
        method("all pairs, 24 bits", Way::Single, 0.02, 1),
        method("all pairs, 106 bits", Way::Double, 0.1, 1),
    ]
}

/// What comes back.
struct Return {
    /// Of each ball's position and velocity.
    errors: Vec<(f64, f64)>,
    collisions: u64,
    energy: Option<f64>,
}

impl Way {
    fn there_and_back(self, gas: &Placement, time: f64) -> Return {
        match self {
            Self::Engine(choice) => {
                let echo = Echo::new(choice, gas, time);
                Return {
                    collisions: echo.trial.events(),
                    energy: Some(echo.trial.energy_drift()),
                    errors: echo.errors,
                }
            }
            Self::Single => there_and_back::<f32>(gas, time),
            Self::Double => there_and_back::<DoubleDouble>(gas, time),
        }
    }

    /// Mean distance from the trajectories of twice the precision at a time, and the largest overlap till then.
    fn trajectory_error(
        self,
        gas: &Placement,
        time: f64,
        reference: &Precise<DoubleDouble>,
    ) -> (f64, Option<f64>) {
        let of = |places: Vec<[f64; 3]>| {
            let reference = reference.present();
            let distances = reference
                .iter()
                .zip(&places)
                .map(|(precise, place)| distance(&precise.0, &place.map(DoubleDouble::from)));
            distances.sum::<f64>() / places.len() as f64
        };
        match self {
            Self::Engine(choice) => {
                let mut trial = Trial::new(choice, gas);
                trial.run(time);
                let end = trial.state().placement();
                (
                    of(end.positions.iter().map(glam::DVec3::to_array).collect()),
                    trial.observer.max_overlap,
                )
            }
            Self::Single => {
                let mut twin = Precise::<f32>::new(gas);
                twin.run(time);
                (
                    of(twin
                        .present()
                        .iter()
                        .map(|ball| ball.0.map(Scalar::value))
                        .collect()),
                    None,
                )
            }
            Self::Double => (0.0, None),
        }
    }
}

fn there_and_back<S: Scalar>(gas: &Placement, time: f64) -> Return {
    let mut twin = Precise::<S>::new(gas);
    let start = twin.present();
    twin.run(time);
    twin.reverse();
    twin.run(2.0 * time);
    twin.reverse();
    let end = twin.present();
    let errors = start
        .iter()
        .zip(&end)
        .map(|(start, end)| (distance(&start.0, &end.0), distance(&start.1, &end.1)));
    Return {
        errors: errors.collect(),
        collisions: twin.collisions(),
        energy: None,
    }
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
                collisions: Vec::new(),
                energy: None,
            };
            for seed in 1..=method.seeds {
                if progress.stopped() {
                    break;
                }
                progress.tell(0.0, &format!("{}, {time} s there and back", method.name));
                let back = method.way.there_and_back(&seed_scene(EDGE, seed), time);
                progress.tell(2.0 * time * method.cost, method.name);
                let mean_of = |error: fn(&(f64, f64)) -> f64| {
                    mean(&back.errors.iter().map(error).collect::<Vec<_>>())
                };
                point.positions.push(mean_of(|error| error.0));
                point.velocities.push(mean_of(|error| error.1));
                point.collisions.push(back.collisions);
                point.energy = back.energy.into_iter().chain(point.energy).reduce(f64::max);
                if seed == 1 && number == EXACT && [1.0, 6.0, 11.0].contains(&time) {
                    scatter.push((time, back.errors));
                }
            }
            if !point.positions.is_empty() {
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
        .filter(|point| point.method == EXACT && GROWTH.contains(&point.time))
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
            .find(|other| other.method == EXACT && other.time == point.time);
        // Of the same data sets.
        let sum = |of: &Point| {
            of.collisions
                .iter()
                .take(point.collisions.len())
                .sum::<u64>() as f64
        };
        let ratio = exact.map(|exact| sum(point) / sum(exact));
        table.push([
            methods[point.method].name.into(),
            point.time.into(),
            (point.positions.len() as u64).into(),
            mean(&point.positions).into(),
            lowest.into(),
            highest.into(),
            mean(&point.velocities).into(),
            point.mean_collisions().into(),
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
            at(0, time).map(Point::mean_collisions).into(),
            step.into(),
            position(4, time),
        ]);
    }
    table
}

/// How far each method's balls are from those of twice the precision on the way there.
fn trajectories(methods: &[Method]) -> Table {
    let title = "Mean distance from the trajectories of 106 bits, without turning round";
    let columns = [
        "engine",
        "after 0.5 s [d]",
        "after 1 s [d]",
        "after 2 s [d]",
        "max overlap [d]",
    ];
    let mut table = Table::new("trajectories", title, &columns);
    let gas = seed_scene(EDGE, 1);
    let references = TRAJECTORY_TIMES.map(|time| {
        let mut reference = Precise::new(&gas);
        reference.run(time);
        reference
    });
    for method in methods.iter().filter(|method| method.way != Way::Double) {
        let mut overlap = None;
        let [first, second, third] = [0, 1, 2].map(|index| {
            let error =
                method
                    .way
                    .trajectory_error(&gas, TRAJECTORY_TIMES[index], &references[index]);
            overlap = error.1;
            error.0
        });
        table.push([
            method.name.into(),
            first.into(),
            second.into(),
            third.into(),
            overlap.into(),
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
            let series = Series::numbered(number, &name, line);
            if method.way == Way::Engine(WINDOWED) {
                // The same bits as engine event: its points stand around the other's.
                series.hollow().joined(Line::Dashed)
            } else {
                series
            }
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
