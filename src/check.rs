//! `moltop check`: what a scene is, what of it will be modelled, and what a run will cost, from theory alone.

use std::fmt::Write as _;

use serde::Serialize;

use crate::domain::Boundary;
use crate::engine::windowed::Windowed;
use crate::quantity::{Quantity, duration, plain, quantity};
use crate::scene::analysis::{self, Theory};
use crate::scene::observe::{self, Name, Observe};
use crate::scene::{Scene, bytes_per_ball};
use crate::snapshot::Units;
use crate::state::Placement;
use crate::worker::engines::Offer;

/// Pair collisions per wall second on one core, of the engine that `auto` takes: an assumption, right within a factor of a few.
///
/// A gas that outgrows the caches costs the event queue a dozen times as much; the windowed engine does not mind.
pub fn assumed_speed(placement: &Placement) -> f64 {
    const BEYOND_CACHES: usize = 50_000;
    const DENSE: f64 = 3.0;
    let count = placement.positions.len();
    if Windowed::pays(placement) || count < BEYOND_CACHES {
        300_000.0
    } else if placement.spacing() < DENSE * 2.0 * placement.largest_radius() {
        100_000.0
    } else {
        15_000.0
    }
}

/// Balls that engine `step` moves by a step per wall second on one core: an assumption, right within a factor of a few.
pub const ASSUMED_BALL_STEPS_PER_SECOND: f64 = 2e7;

/// What each observable adds to the time of a run, as a share of it: on the oxygen, and in a dense fluid of 10,648 balls; looks at
/// all balls a fifth of a mean free time apart. Measured by `moltop experiment observables`, which gives the errors: 2 to 4 % on the
/// oxygen, 0.2 % in the fluid.
const OBSERVING: [(Name, Option<f64>, f64); 6] = [
    (Name::RadialDistribution, Some(0.0), 0.07),
    (Name::DensityProfile, Some(0.01), 0.01),
    (Name::Motion, Some(0.0), 0.05),
    (Name::Relaxation, Some(0.02), 0.02),
    (Name::Flights, Some(0.10), 0.11),
    (Name::Transport, None, 0.09),
];

/// Memory of the program without balls, measured \[bytes\].
const PROGRAM_BYTES: u64 = 7_000_000;

/// A run that takes longer must be accepted with `--yes` \[s\].
pub const LONG_RUN: f64 = 3600.0;

/// Coordinates coarser than this share of the smallest radius are worth a warning.
const FINE_POSITION: f64 = 1e-12;

/// What is known of a scene before it runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    title: String,
    units: Units,
    ball_count: usize,
    packing_fraction: f64,
    temperature: Option<f64>,
    expected: Rates,
    until: Option<f64>,
    cost: Option<Cost>,
    /// Wall time of a run in steps \[s\].
    #[serde(skip)]
    cost_in_steps: Option<f64>,
    bytes_per_ball: u64,
    memory_bytes: u64,
    model: Vec<String>,
    /// What other accuracies cost.
    accuracies: Vec<Offer>,
    /// What observing costs.
    observables: Vec<Observing>,
    warnings: Vec<String>,
}

/// What observing something costs.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Observing {
    name: &'static str,
    /// Whether the scene asks for it.
    chosen: bool,
    /// Whether it can be measured in this scene.
    possible: bool,
    /// Share of the time of a run without, in a dilute gas and in a dense fluid; measured, elsewhere.
    cost_dilute: Option<f64>,
    cost_dense: f64,
}

impl Observing {
    fn all(scene: &Scene) -> Vec<Self> {
        let one = |&(name, cost_dilute, cost_dense): &(Name, Option<f64>, f64)| Self {
            name: name.key(),
            chosen: scene.observe.chosen.contains(&name),
            possible: observe::refusal_of(scene, &Observe::only(name)).is_none(),
            cost_dilute,
            cost_dense,
        };
        OBSERVING.iter().map(one).collect()
    }

    fn words(&self) -> String {
        let name = self.name;
        if !self.possible {
            return format!("{name}: not in this scene");
        }
        let percent = |share: f64| format!("{:.0}", 100.0 * share);
        let dense = percent(self.cost_dense);
        let cost = self.cost_dilute.map_or_else(
            || format!("{dense} % more time in a dense fluid"),
            |dilute| {
                let dilute = percent(dilute);
                format!("{dilute} % more time in a dilute gas, {dense} % in a dense fluid")
            },
        );
        let chosen = if self.chosen { "on" } else { "off" };
        format!("{name}: {chosen}; {cost}")
    }
}

/// What kinetic theory expects at the temperature of the start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Rates {
    pressure: Option<f64>,
    pair_rate: Option<f64>,
    wall_rate: Option<f64>,
}

/// What a run to `until` takes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// Expected collisions between balls.
    pub pair_collisions: f64,
    /// Expected collisions with the walls.
    pub wall_collisions: f64,
    /// Pair collisions per wall second that are assumed.
    pub collisions_per_second: f64,
    /// Wall time at that speed \[s\].
    pub wall_time_s: f64,
}

impl Report {
    /// Looks at a placed scene that is to run until the given time.
    pub fn new(scene: &Scene, placement: &Placement, until: Option<f64>) -> Self {
        let temperature = analysis::temperature(placement, scene.units);
        let expected = temperature.map_or_else(Default::default, |t| {
            Theory::new(placement, scene.units).at(t)
        });
        let expected = Rates {
            pressure: expected.pressure,
            pair_rate: expected.pair_rate,
            wall_rate: expected.wall_rate,
        };
        let ball_count = placement.positions.len();
        let mut report = Self {
            title: scene.title.clone(),
            units: scene.units,
            ball_count,
            packing_fraction: analysis::packing_fraction(placement),
            temperature,
            expected,
            until,
            cost_in_steps: None,
            cost: cost(expected, placement, until),
            bytes_per_ball: bytes_per_ball(placement),
            memory_bytes: PROGRAM_BYTES + bytes_per_ball(placement) * ball_count as u64,
            model: analysis::choices(placement),
            accuracies: Vec::new(),
            observables: Observing::all(scene),
            warnings: doubts(placement, scene.units),
        };
        let exact = (report.cost.zip(until)).map(|(cost, until)| cost.wall_time_s / until);
        if temperature.is_some_and(|temperature| temperature > 0.0) {
            report.accuracies = Offer::all(placement, exact);
        }
        report.warnings.extend(report.find_warnings(placement));
        report
    }

    /// The cost of the run, if it has an end and theory has rates.
    pub fn cost(&self) -> Option<Cost> {
        self.cost
    }

    /// Takes the cost of a run in steps of this length, in the scene's units, for that of a run from event to event.
    pub fn cost_in_steps(&mut self, step: f64) {
        self.cost_per_time(Some(
            self.ball_count as f64 / ASSUMED_BALL_STEPS_PER_SECOND / step,
        ));
    }

    /// Takes these wall seconds per simulated time, in the scene's units, for the cost of a run in steps.
    pub fn cost_per_time(&mut self, wall_seconds: Option<f64>) {
        self.cost_in_steps = self
            .until
            .zip(wall_seconds)
            .map(|(until, seconds)| until * seconds);
    }

    /// Why the run needs `--yes`, if it does: it has no end in sight, or takes more than an hour.
    pub fn needs_consent(&self) -> Option<String> {
        let Some(until) = self.until else {
            return Some(
                "the run has no end: give --until T, or --yes to run until it is stopped"
                    .to_owned(),
            );
        };
        if let Some(wall_time_s) = self.cost_in_steps {
            return (wall_time_s > LONG_RUN).then(|| {
                format!(
                    "the run to {} in such steps is estimated at {}: give a smaller --until, longer steps, or --yes to \
                     accept it",
                    quantity(until, Quantity::Time, self.units),
                    duration(wall_time_s)
                )
            });
        }
        let cost = self.cost.filter(|cost| cost.wall_time_s > LONG_RUN)?;
        Some(format!(
            "the run to {} is estimated at {} pair collisions and {} (assuming {} of them per second): \
             give a smaller --until, or --yes to accept it",
            quantity(until, Quantity::Time, self.units),
            plain(cost.pair_collisions),
            duration(cost.wall_time_s),
            plain(cost.collisions_per_second),
        ))
    }

    fn find_warnings(&self, placement: &Placement) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.ball_count == 0 {
            warnings.push("the scene has no balls: nothing will happen".to_owned());
        } else if self.temperature.is_none_or(|t| t == 0.0) {
            warnings.push("all balls rest: nothing will happen".to_owned());
        } else if self.expected.pair_rate.is_none() {
            warnings.push(format!(
                "theory has no pressure and no rates here: {}",
                why_silent(placement)
            ));
        }
        if let Some(cost) = self.cost.filter(|cost| cost.wall_time_s > LONG_RUN) {
            let time = duration(cost.wall_time_s);
            warnings.push(format!(
                "the run may take {time}: a run without a screen needs --yes"
            ));
        }
        warnings
    }

    /// The report for people.
    pub fn for_people(&self) -> String {
        let mut text = String::new();
        let mut line = |name: &str, value: &str| {
            writeln!(text, "{name:<18}{value}").expect("memory takes all");
        };
        let show = |value: Option<f64>, kind| {
            value.map_or("–".to_owned(), |value| quantity(value, kind, self.units))
        };
        line("scene", &self.title);
        line("balls", &self.ball_count.to_string());
        line("packing fraction", &plain(self.packing_fraction));
        line(
            "temperature",
            &show(self.temperature, Quantity::Temperature),
        );
        let pressure = show(self.expected.pressure, Quantity::Pressure);
        line(
            "pressure",
            &if self.expected.wall_rate.is_some() {
                format!("{pressure} expected, force per wall area")
            } else {
                format!("{pressure} expected")
            },
        );
        line(
            "pair collisions",
            &format!("{} expected", show(self.expected.pair_rate, Quantity::Rate)),
        );
        line(
            "wall collisions",
            &format!("{} expected", show(self.expected.wall_rate, Quantity::Rate)),
        );
        let memory = self.memory_bytes as f64 / 1e6;
        line(
            "memory",
            &format!(
                "about {} MB, {} bytes per ball",
                plain(memory),
                self.bytes_per_ball
            ),
        );
        for choice in &self.model {
            line("model", choice);
        }
        for offer in &self.accuracies {
            let seconds = offer.wall_seconds_per_time().zip(self.until);
            let cost = seconds.map_or(String::new(), |(seconds, until)| {
                format!("; wall time about {}", duration(seconds * until))
            });
            let name = format!("accuracy {}", offer.accuracy());
            line(&name, &format!("{}{cost}", offer.words()));
        }
        for observing in &self.observables {
            line("observe", &observing.words());
        }
        line("until", &show(self.until, Quantity::Time));
        if let Some(cost) = self.cost {
            let (pairs, walls) = (plain(cost.pair_collisions), plain(cost.wall_collisions));
            line("cost", &format!("{pairs} pair and {walls} wall collisions"));
            let time = duration(cost.wall_time_s);
            line(
                "wall time",
                &format!(
                    "about {time} if {} pair collisions take a second",
                    plain(cost.collisions_per_second)
                ),
            );
        }
        for warning in &self.warnings {
            line("warning", warning);
        }
        text
    }
}

fn cost(expected: Rates, placement: &Placement, until: Option<f64>) -> Option<Cost> {
    let walls = placement.domain.boundary == Boundary::Container;
    let collisions_per_second = assumed_speed(placement);
    let until = until?;
    let wall_rate = if walls { expected.wall_rate? } else { 0.0 };
    let (pair_collisions, wall_collisions) = (expected.pair_rate? * until, wall_rate * until);
    // Walls cost less than pairs and usually come along; alone they still take their time.
    let wall_time_s = pair_collisions.max(wall_collisions) / collisions_per_second;
    Some(Cost {
        pair_collisions,
        wall_collisions,
        collisions_per_second,
        wall_time_s,
    })
}

/// Why theory has nothing to say of a scene.
fn why_silent(placement: &Placement) -> &'static str {
    if placement.positions.len() < analysis::FEWEST {
        return "too few balls for averages";
    }
    if placement.domain.boundary == Boundary::Open {
        "the balls spread in open space"
    } else if !placement.domain.planes.is_empty() {
        "planes divide the domain"
    } else if placement.bodies.iter().any(|body| body.mass.is_infinite()) {
        "some balls are fixed"
    } else if analysis::packing_fraction(placement) < 0.3 {
        "a ball nearly fills the container"
    } else {
        "so dense that the balls may freeze"
    }
}

/// What the numbers of a scene themselves make doubtful.
fn doubts(placement: &Placement, units: Units) -> Vec<String> {
    let mut doubts = Vec::new();
    let radii = placement.bodies.iter().map(|body| body.radius);
    let masses = placement.bodies.iter().map(|body| body.mass);
    let smallest = radii
        .clone()
        .filter(|r| *r > 0.0)
        .fold(f64::INFINITY, f64::min);
    let farthest = (placement.center.abs() + placement.domain.half_size).max_element();
    let step = farthest.next_up() - farthest;
    if step > FINE_POSITION * smallest {
        doubts.push(format!(
            "coordinates reach {}, where they are rounded to {} of the smallest radius: contacts are as coarse",
            plain(farthest),
            plain(step / smallest)
        ));
    }
    let (largest, heaviest) = (
        radii.fold(0.0, f64::max),
        masses.filter(|mass| mass.is_finite()).fold(0.0, f64::max),
    );
    match units {
        Units::Si if largest > 1e-3 && heaviest > 1e-3 => doubts.push(format!(
            "balls of {} m and {} kg in SI units: if the numbers are reduced ones, say units = \"reduced\"",
            plain(largest),
            plain(heaviest)
        )),
        Units::Reduced if 0.0 < heaviest && heaviest < 1e-18 && largest < 1e-6 => {
            doubts.push(format!(
                "radius {} and mass {} in reduced units, where k = 1: if these are metres and kilograms, say units = \"si\"",
                plain(largest),
                plain(heaviest)
            ));
        }
        _ => {}
    }
    doubts
}
