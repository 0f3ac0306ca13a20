//! `moltop experiment growth`: how run time grows with the number of balls, for every engine, at a known accuracy.
//!
//! Redoes the first experiment of the student paper that this program takes up, the seed: its scene (a cube of balls, packing
//! fraction 0.11), its 10 simulated seconds, several data sets per size; and the same at the density of oxygen. Every engine
//! starts from the same settled gas and runs on one thread. Time is the processor's, which other programs disturb least. Where
//! 10 simulated seconds take too long, a part is run and its time scaled up; a column tells how much was run.

use crate::error::Result;
use crate::experiment::all_pairs;
use crate::experiment::fit::{exponent, extent, median};
use crate::experiment::gases::{lattice, seed_scene};
use crate::experiment::page::{Options, Outputs, Page, Table};
use crate::experiment::plot::{Axis, Line, Plot, Series};
use crate::experiment::progress::Progress;
use crate::experiment::trial::{EVENT, REVERSIBLE, Trial, WINDOWED, processor_seconds};
use crate::state::State;
use crate::worker::engines::{CalendarName, Choice};

/// Simulated time of the seed's runs.
const TIME: f64 = 10.0;

/// Simulated time in which the lattice of the start dissolves: half a collision per ball.
const SETTLE: f64 = 0.5;

/// How much longer than in the seed's gas everything takes in the thin one.
const THIN: f64 = 100.0;

/// Spacing of the lattice in diameters for molecules of oxygen near standard conditions.
const OXYGEN_SPACING: f64 = 9.692;

/// The seed's program on its scenes: balls, seconds from event to event, seconds in steps of 1/60.
const SEED: [(u64, f64, f64); 3] = [
    (512, 0.118, 0.198),
    (4096, 6.06, 13.0),
    (15_625, 95.0, 200.0),
];

/// Sizes from which exponents are fitted: in smaller ones the walls have more to do than the neighbours.
const FIT_FROM: u64 = 512;

/// Pair collisions between two looks at the clock.
const COLLISIONS_PER_SLICE: f64 = 20_000.0;

/// What a collision of many balls takes, roughly, for the estimate of the time left.
const SECONDS_PER_COLLISION: f64 = 1e-5;

/// A way to run a gas.
struct Method {
    name: &'static str,
    /// An engine, or all pairs without grid and calendar.
    choice: Option<Choice>,
    /// Whether the gas is as thin as oxygen.
    thin: bool,
    /// Balls along the edge of the largest cube.
    largest: usize,
}

const fn method(name: &'static str, choice: Option<Choice>, thin: bool, largest: usize) -> Method {
    Method {
        name,
        choice,
        thin,
        largest,
    }
}

const METHODS: [Method; 9] = [
    method("event", Some(EVENT), false, 89),
    method(
        "event, lazy calendar",
        Some(Choice::Event(CalendarName::Lazy)),
        false,
        46,
    ),
    method(
        "event, bounded calendar",
        Some(Choice::Event(CalendarName::Bounded)),
        false,
        89,
    ),
    method("windowed", Some(WINDOWED), false, 89),
    method("reversible", Some(REVERSIBLE), false, 46),
    method("step, dt = 1/60", Some(Choice::Step(1.0 / 60.0)), false, 46),
    method("all pairs", None, false, 16),
    method("event, thin gas", Some(EVENT), true, 89),
    method("windowed, thin gas", Some(WINDOWED), true, 89),
];

/// One run.
struct Run {
    /// Processor time of the whole of [`TIME`] \[s\].
    seconds: f64,
    setup: f64,
    /// Share of [`TIME`] that was run.
    share: f64,
    collisions: f64,
    pairs: f64,
    overlap: Option<f64>,
    energy: Option<f64>,
}

/// The runs of a method at a size.
struct Point {
    method: usize,
    balls: u64,
    runs: Vec<Run>,
}

impl Point {
    fn median(&self, what: impl Fn(&Run) -> f64) -> f64 {
        median(&self.runs.iter().map(what).collect::<Vec<_>>())
    }

    fn seconds(&self) -> f64 {
        self.median(|run| run.seconds)
    }

    fn largest(&self, what: impl Fn(&Run) -> Option<f64>) -> Option<f64> {
        self.runs.iter().filter_map(what).reduce(f64::max)
    }
}

/// Runs the experiment; gives the exit code.
///
/// # Errors
/// When results cannot be written.
pub fn run(options: &Options) -> Result<u8> {
    let outputs = Outputs::new(
        "growth",
        options,
        &["times", "exponents", "seed"],
        &["time"],
    )?;
    let (edges, budget, sets): (&[usize], f64, u64) = if options.quick {
        (&[2, 4, 8, 12, 16, 25], 0.15, 3)
    } else {
        (&[2, 3, 4, 6, 8, 12, 16, 20, 25, 46, 89], 1.0, 3)
    };
    // About what a run takes.
    let cost =
        |edge: usize| budget.max(least_collisions(edge.pow(3)) as f64 * SECONDS_PER_COLLISION);
    let runs = METHODS.iter().flat_map(|method| {
        let edges = edges.iter().filter(|&&edge| edge <= method.largest);
        edges.map(|&edge| cost(edge))
    });
    let mut progress = Progress::new(runs.sum::<f64>() * sets as f64)?;
    let mut found: Vec<Point> = Vec::new();
    // Sets are the outer loop: what disturbs the machine for a while disturbs all sizes and engines.
    for set in 1..=sets {
        for &edge in edges {
            for thin in [false, true] {
                let state = settled(edge, thin, set);
                for (number, method) in METHODS.iter().enumerate() {
                    if method.thin != thin || edge > method.largest || progress.stopped() {
                        continue;
                    }
                    let balls = state.ball_count() as u64;
                    let words = format!("{balls} balls, {}, data set {set} of {sets}", method.name);
                    progress.tell(0.0, &words);
                    let run = method.run(&state, budget);
                    progress.tell(cost(edge), &words);
                    let known = |point: &&mut Point| point.method == number && point.balls == balls;
                    match found.iter_mut().find(known) {
                        Some(point) => point.runs.push(run),
                        None => found.push(Point {
                            method: number,
                            balls,
                            runs: vec![run],
                        }),
                    }
                }
            }
        }
    }
    found.sort_by_key(|point| (point.method, point.balls));
    outputs.finish(&page(&found, options, progress.stopped()))?;
    Ok(progress.code())
}

/// Fewest collisions to be timed: one for every second ball.
fn least_collisions(ball_count: usize) -> u64 {
    ball_count as u64 / 2
}

/// A gas whose lattice has dissolved.
fn settled(edge: usize, thin: bool, seed: u64) -> State {
    let gas = if thin {
        lattice(edge, OXYGEN_SPACING, OXYGEN_SPACING * edge as f64, seed)
    } else {
        seed_scene(edge, seed)
    };
    let mut trial = Trial::new(EVENT, &gas);
    trial.run(if thin { THIN * SETTLE } else { SETTLE });
    trial.state().clone()
}

impl Method {
    /// Runs for [`TIME`], in the thin gas longer, or until the processor has spent `budget` seconds and there were
    /// [`least_collisions`]: what engine `windowed` does at a time is a good part of that.
    fn run(&self, state: &State, budget: f64) -> Run {
        let Some(choice) = self.choice else {
            return all_pairs_run(state, budget);
        };
        let began = processor_seconds();
        let mut trial = Trial::resume(choice, state.clone());
        let setup = processor_seconds() - began;
        let start = trial.time();
        let length = if self.thin { THIN * TIME } else { TIME };
        // A ball of the seed's gas collides twice a second.
        let expected = state.ball_count() as f64 * TIME;
        let slice = (length * COLLISIONS_PER_SLICE / expected).min(length / 8.0);
        let began = processor_seconds();
        let (mut time, mut spent) = (0.0, 0.0);
        let least = least_collisions(state.ball_count());
        while time < length && (spent < budget || trial.events() < least) {
            time = (time + slice).min(length);
            trial.run(start + time);
            spent = processor_seconds() - began;
        }
        let share = time / TIME;
        Run {
            seconds: spent / share,
            setup,
            share,
            collisions: trial.events() as f64 / share,
            pairs: trial.engine.counters().pair_collisions as f64 / share,
            overlap: trial.observer.max_overlap,
            energy: Some(trial.energy_drift()),
        }
    }
}

/// Every pair, every wall: what the seed's program does at each event.
fn all_pairs_run(state: &State, budget: f64) -> Run {
    let timed = |collisions: usize| {
        let began = processor_seconds();
        let records = all_pairs::collisions(state.clone(), collisions);
        (processor_seconds() - began, records)
    };
    let (setup, _) = timed(0);
    let mut count = 200;
    loop {
        let (spent, records) = timed(count);
        let spent = spent - setup;
        if spent > 0.5 * budget || count > 20_000 {
            let last = records.last().expect("a gas in a container").0;
            let time = state.units.scene_time(last) - state.units.scene_time(state.now);
            let pairs = records
                .iter()
                .filter(|record| matches!(record.1, crate::event::Participants::Pair(..)))
                .count();
            return Run {
                seconds: spent * TIME / time,
                setup,
                share: time / TIME,
                collisions: records.len() as f64 * TIME / time,
                pairs: pairs as f64 * TIME / time,
                overlap: None,
                energy: None,
            };
        }
        count *= 2;
    }
}

fn page(points: &[Point], options: &Options, stopped: bool) -> Page {
    let quick = if options.quick { " --quick" } else { "" };
    let mut page = Page {
        name: "growth",
        title: "Growth of run time with the number of balls",
        command: format!("moltop experiment growth{quick}"),
        tables: vec![times(points), exponents(points), beside_the_seed(points)],
        paragraphs: vec![
            "Time is processor time on one thread for 10 simulated seconds, median of the data sets. Accuracy is from the same \
             runs."
                .to_owned(),
        ],
        plots: vec![plot(points)],
    };
    if stopped {
        page.paragraphs
            .push("Interrupted: this is what had been measured.".to_owned());
    }
    page
}

fn times(points: &[Point]) -> Table {
    let columns = [
        "engine",
        "balls",
        "time [s]",
        "lowest [s]",
        "highest [s]",
        "ns per collision",
        "pairs over event's",
        "max overlap [d]",
        "energy drift",
        "setup [s]",
        "share run",
    ];
    let mut table = Table::new("times", "Processor time for 10 simulated seconds", &columns);
    for point in points {
        let method = &METHODS[point.method];
        let seconds: Vec<f64> = point.runs.iter().map(|run| run.seconds).collect();
        let (lowest, highest) = extent(&seconds);
        let exact = points.iter().find(|other| {
            let other_method = &METHODS[other.method];
            other_method.choice == Some(EVENT)
                && other_method.thin == method.thin
                && other.balls == point.balls
        });
        let ratio =
            exact.map(|exact| point.median(|run| run.pairs) / exact.median(|run| run.pairs));
        table.push([
            method.name.into(),
            point.balls.into(),
            point.seconds().into(),
            lowest.into(),
            highest.into(),
            point
                .median(|run| 1e9 * run.seconds / run.collisions)
                .into(),
            ratio.into(),
            point.largest(|run| run.overlap).into(),
            point.largest(|run| run.energy).into(),
            point.median(|run| run.setup).into(),
            point.median(|run| run.share).into(),
        ]);
    }
    table
}

/// Exponent of a method between [`FIT_FROM`] and some number of balls, and the largest number there.
fn fitted(points: &[Point], method: usize, most: u64) -> (Option<f64>, Option<u64>) {
    let fitted = points
        .iter()
        .filter(|point| point.method == method && (FIT_FROM..=most).contains(&point.balls));
    let fitted: Vec<_> = fitted
        .map(|point| (point.balls as f64, point.seconds()))
        .collect();
    (exponent(&fitted), fitted.last().map(|point| point.0 as u64))
}

fn exponents(points: &[Point]) -> Table {
    let seed_largest = SEED[2].0;
    let columns = ["engine", "exponent to 15625 balls", "exponent", "to balls"];
    let title = "Run time from 512 balls up grows as their number to the power of";
    let mut table = Table::new("exponents", title, &columns);
    for (number, method) in METHODS.iter().enumerate() {
        let (all, largest) = fitted(points, number, u64::MAX);
        let (as_far_as_seed, _) = fitted(points, number, seed_largest);
        table.push([
            method.name.into(),
            as_far_as_seed.into(),
            all.into(),
            largest.into(),
        ]);
    }
    for (name, seconds) in [
        ("seed, event", SEED.map(|point| point.1)),
        ("seed, step, dt = 1/60", SEED.map(|point| point.2)),
    ] {
        let points: Vec<_> = SEED
            .iter()
            .zip(seconds)
            .map(|(point, seconds)| (point.0 as f64, seconds))
            .collect();
        table.push([
            name.into(),
            exponent(&points).into(),
            None::<f64>.into(),
            seed_largest.into(),
        ]);
    }
    table
}

fn beside_the_seed(points: &[Point]) -> Table {
    let columns = [
        "balls",
        "seed, event [s]",
        "event [s]",
        "ratio",
        "seed, step [s]",
        "step [s]",
        "ratio of steps",
    ];
    let mut table = Table::new("seed", "The seed's program on the same scenes", &columns);
    let ours = |name: &str, balls: u64| {
        let point = points
            .iter()
            .find(|point| METHODS[point.method].name == name && point.balls == balls)?;
        Some(point.seconds())
    };
    for (balls, event, step) in SEED {
        let (our_event, our_step) = (ours("event", balls), ours("step, dt = 1/60", balls));
        table.push([
            balls.into(),
            event.into(),
            our_event.into(),
            our_event.map(|ours| event / ours).into(),
            step.into(),
            our_step.into(),
            our_step.map(|ours| step / ours).into(),
        ]);
    }
    table
}

fn plot(points: &[Point]) -> Plot {
    let mut series: Vec<Series> = METHODS
        .iter()
        .enumerate()
        .map(|(number, method)| {
            let own = points.iter().filter(|point| point.method == number);
            let line = own
                .map(|point| (point.balls as f64, point.seconds()))
                .collect();
            let series = Series::numbered(number, method.name, line);
            if method.thin {
                series.hollow().joined(Line::Dashed)
            } else {
                series
            }
        })
        .collect();
    for (number, name, seconds) in [(0, "seed, event", 1), (5, "seed, step", 2)] {
        let line = SEED.map(|(balls, event, step)| (balls as f64, [event, step][seconds - 1]));
        series.push(
            Series::numbered(number, name, line.into())
                .hollow()
                .joined(Line::Dotted),
        );
    }
    Plot {
        name: "time",
        title: "Time for 10 simulated seconds, one thread".to_owned(),
        x: Axis::logarithmic("balls"),
        y: Axis::logarithmic("processor time [s]"),
        series,
    }
}
