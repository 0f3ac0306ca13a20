//! `moltop check`: what a scene is, what of it will be modelled, and what a run will cost, from theory alone.

use std::fmt::Write as _;

use serde::Serialize;

use crate::quantity::{Quantity, duration, plain, quantity};
use crate::scene::analysis::{self, Theory};
use crate::scene::{BYTES_PER_BALL, Scene};
use crate::snapshot::Units;
use crate::state::Placement;

/// Pair collisions that a run of hundreds of thousands of balls does per wall second on one core: an assumption, right within a
/// factor of a few. Small gases, which fit the caches, are many times faster.
pub const ASSUMED_COLLISIONS_PER_SECOND: f64 = 20_000.0;

/// Balls that engine `step` moves by a step per wall second on one core: an assumption, right within a factor of a few.
pub const ASSUMED_BALL_STEPS_PER_SECOND: f64 = 2e7;

/// A run that takes longer must be accepted with `--yes` \[s\].
pub const LONG_RUN: f64 = 3600.0;

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
    warnings: Vec<String>,
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
    /// Wall time at the assumed speed \[s\].
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
            cost: cost(expected, until),
            cost_in_steps: None,
            bytes_per_ball: BYTES_PER_BALL,
            memory_bytes: BYTES_PER_BALL * ball_count as u64,
            model: model(placement),
            warnings: Vec::new(),
        };
        report.warnings = report.find_warnings();
        report
    }

    /// The cost of the run, if it has an end and theory has rates.
    pub fn cost(&self) -> Option<Cost> {
        self.cost
    }

    /// Takes the cost of a run in steps of this length, in the scene's units, for that of a run from event to event.
    pub fn cost_in_steps(&mut self, step: f64) {
        if let Some(until) = self.until {
            let wall_time_s = until / step * self.ball_count as f64 / ASSUMED_BALL_STEPS_PER_SECOND;
            self.cost_in_steps = Some(wall_time_s);
        }
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
                    "the run to {} in such steps is estimated at {} (assuming {ASSUMED_BALL_STEPS_PER_SECOND:e} balls moved \
                     per second): give a smaller --until, a longer --dt, or --yes to accept it",
                    quantity(until, Quantity::Time, self.units),
                    duration(wall_time_s)
                )
            });
        }
        let cost = self.cost.filter(|cost| cost.wall_time_s > LONG_RUN)?;
        Some(format!(
            "the run to {} is estimated at {} pair collisions and {} (assuming {ASSUMED_COLLISIONS_PER_SECOND} per second): \
             give a smaller --until, or --yes to accept it",
            quantity(until, Quantity::Time, self.units),
            plain(cost.pair_collisions),
            duration(cost.wall_time_s)
        ))
    }

    fn find_warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.ball_count == 0 {
            warnings.push("the scene has no balls: nothing will happen".to_owned());
        } else if self.temperature == Some(0.0) {
            warnings.push("all balls rest: nothing will happen".to_owned());
        } else if self.expected.pressure.is_none() {
            warnings.push(
                "so dense that the balls may freeze: theory has no pressure and no rates here"
                    .to_owned(),
            );
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
        line(
            "pressure",
            &format!(
                "{} expected, force per wall area",
                show(self.expected.pressure, Quantity::Pressure)
            ),
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
                "up to about {} MB, {} bytes per ball",
                plain(memory),
                self.bytes_per_ball
            ),
        );
        for choice in &self.model {
            line("model", choice);
        }
        line("until", &show(self.until, Quantity::Time));
        if let Some(cost) = self.cost {
            let (pairs, walls) = (plain(cost.pair_collisions), plain(cost.wall_collisions));
            line("cost", &format!("{pairs} pair and {walls} wall collisions"));
            let time = duration(cost.wall_time_s);
            line(
                "wall time",
                &format!(
                    "about {time} if {ASSUMED_COLLISIONS_PER_SECOND} pair collisions take a second"
                ),
            );
        }
        for warning in &self.warnings {
            line("warning", warning);
        }
        text
    }
}

fn cost(expected: Rates, until: Option<f64>) -> Option<Cost> {
    let until = until?;
    let (pair_collisions, wall_collisions) =
        (expected.pair_rate? * until, expected.wall_rate? * until);
    // Walls cost less than pairs and usually come along; alone they still take their time.
    let wall_time_s = pair_collisions.max(wall_collisions) / ASSUMED_COLLISIONS_PER_SECOND;
    Some(Cost {
        pair_collisions,
        wall_collisions,
        wall_time_s,
    })
}

fn model(placement: &Placement) -> Vec<String> {
    let bodies = match placement.bodies.len() {
        0 => "no balls".to_owned(),
        1 => "one radius and mass for all balls: kept once".to_owned(),
        kinds => format!("{kinds} different radii and masses: an index per ball"),
    };
    let pairs = match placement.positions.len() {
        0 | 1 => "no collisions between balls: there are no pairs",
        _ => "collisions between balls, event by event: the only engine of this version",
    };
    vec![
        bodies,
        pairs.to_owned(),
        "six hard walls; no planes, no periodic images".to_owned(),
    ]
}
