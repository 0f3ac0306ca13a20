//! Engines and calendars by name: the one place that knows them all.

mod accuracy;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use crate::calendar::{Bounded, Indexed, Lazy};
use crate::engine::alternating::Alternating;
use crate::engine::event_driven;
use crate::engine::reversible::Reversible;
use crate::engine::statistical::{self, Plan, Resolution, Statistical};
use crate::engine::time_stepping::TimeStepping;
use crate::engine::windowed::Windowed;
use crate::engine::{Engine, Saved, Tally};
use crate::quantity::plain;
use crate::scene::analysis::packing_fraction;
use crate::state::{Placement, State, UnitScale};
pub use accuracy::{Accuracy, BALL_STEPS_PER_SECOND, Offer};

/// Engines as `--engine` and `[run] engine` name them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum EngineName {
    /// Let the program choose: windowed where it is the faster, else event
    #[default]
    Auto,
    /// From collision to collision, exact; any scene
    Event,
    /// The same collisions as event, many times faster for a dilute gas; all balls can move, in a container or periodic box
    Windowed,
    /// Exact under time reversal, on integers: a reversed run comes back to the last bit
    Reversible,
    /// In steps of --dt, inexact, for comparison
    Step,
    /// By chance, approximate: averages of a dilute gas many times faster; no trajectories
    Statistical,
}

/// Calendars of engine `event` as `--calendar` names them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
pub enum CalendarName {
    /// A heap of one event per ball
    Indexed,
    /// A heap of all events there were, which shows how it grows
    Lazy,
    /// Bins of time, whose cost does not grow with the number of balls
    Bounded,
    /// The faster of `bounded` and `indexed`: bounded in a gas of many balls
    #[default]
    Auto,
}

/// What the user asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wishes {
    /// `--engine`, or else the scene's.
    pub engine: EngineName,
    /// `--calendar`.
    pub calendar: Option<CalendarName>,
    /// `--dt`, in the scene's units; positive.
    pub step: Option<f64>,
    /// `--threads`.
    pub threads: Option<usize>,
    /// `--step-fraction`.
    pub step_fraction: Option<f64>,
    /// `--cells-per-path`.
    pub cells_per_path: Option<f64>,
    /// `--accuracy`.
    pub accuracy: Option<Accuracy>,
    /// The scene's seed, or `--seed`.
    pub seed: u64,
    /// `--force`.
    pub forced: bool,
    /// When the run ends, if it does, in the scene's units.
    pub until: Option<f64>,
}

/// An engine that can run the scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Choice {
    /// [`event_driven::EventDriven`], with this calendar.
    Event(CalendarName),
    /// [`Alternating`]: [`Windowed`], on so many threads, where it pays.
    Windowed(usize),
    /// [`Reversible`].
    Reversible,
    /// [`TimeStepping`], with steps of this length in the scene's units.
    Step(f64),
    /// [`Statistical`].
    Statistical {
        /// How finely the gas is resolved.
        resolution: Resolution,
        /// What is drawn depends on it.
        seed: u64,
        /// On so many threads.
        threads: usize,
    },
}

impl Default for Choice {
    fn default() -> Self {
        Self::Event(CalendarName::Auto)
    }
}

/// Shortest step in epochs: finer ones would feel the grid of time.
const SHORTEST_STEP: f64 = 1.0 / (1_u64 << 40) as f64;

/// Share of a diameter that a thermal ball may fly in a step without a warning.
const SHORT_WAY: f64 = 0.1;

impl Choice {
    /// The engine for these balls.
    ///
    /// # Errors
    /// The words for the user, when the wishes contradict each other or the engine cannot run these balls.
    pub fn new(wishes: &Wishes, placement: &Placement) -> Result<Self, String> {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let threads = || wishes.threads.unwrap_or_else(cores);
        let resolution = wishes.resolution(placement)?;
        let choice = match (wishes.engine, wishes.step) {
            (EngineName::Auto, _) if wishes.calendar.is_none() && Windowed::pays(placement) => {
                Self::Windowed(threads())
            }
            (EngineName::Auto | EngineName::Event | EngineName::Statistical, _) => {
                Self::Event(wishes.calendar.unwrap_or_default())
            }
            (EngineName::Windowed, _) if Windowed::supports(placement) => Self::Windowed(threads()),
            (EngineName::Windowed, _) => {
                let words = "engine windowed runs balls that all can move, in a container or a periodic box that is wider than they are: give --engine event";
                return Err(words.to_owned());
            }
            (EngineName::Reversible, _) => {
                Reversible::new(State::new(placement)).map_err(|refusal| {
                    format!("engine reversible: {refusal}: give --engine event")
                })?;
                Self::Reversible
            }
            (EngineName::Step, Some(step)) => Self::Step(step),
            (EngineName::Step, None) => {
                return Err(
                    "engine step needs --dt T, the length of a step in the scene's units"
                        .to_owned(),
                );
            }
        };
        let choice = resolution.map_or(choice, |resolution| Self::Statistical {
            resolution,
            seed: wishes.seed,
            threads: threads(),
        });
        let name = choice.name();
        if (wishes.step_fraction.is_some() || wishes.cells_per_path.is_some())
            && name != "statistical"
        {
            return Err(format!(
                "--step-fraction and --cells-per-path are for engine statistical, and this is {name}"
            ));
        }
        if wishes.calendar.is_some() && !matches!(choice, Self::Event(_)) {
            return Err(format!(
                "--calendar is for engine event, and this is {name}"
            ));
        }
        match choice {
            Self::Step(step) => check_step(step, wishes.until, placement)?,
            _ if wishes.step.is_some() => {
                return Err(format!("--dt is for engine step, and this is {name}"));
            }
            _ => {}
        }
        Ok(choice)
    }

    /// The engine's name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Event(_) => "event",
            Self::Windowed(_) => "windowed",
            Self::Reversible => "reversible",
            Self::Step(_) => "step",
            Self::Statistical { .. } => "statistical",
        }
    }

    /// The engine itself, for the balls that the choice was made for.
    ///
    /// # Panics
    /// If the reversible engine refuses balls that it accepted when the choice was made.
    pub fn engine(&self, state: State) -> Box<dyn Engine> {
        match self {
            Self::Event(calendar) => event(*calendar, state, None),
            Self::Windowed(threads) => Box::new(Alternating::new(state, *threads)),
            Self::Reversible => Box::new(
                Reversible::new(state).expect("the choice was made for balls that it can run"),
            ),
            Self::Step(step) => Box::new(TimeStepping::new(state, *step)),
            Self::Statistical {
                resolution,
                seed,
                threads,
            } => Box::new(Statistical::new(state, *resolution, *seed, *threads)),
        }
    }

    /// The engine itself, to go on from what one of its kind has saved; `None` if it was another kind.
    pub fn resume(&self, state: State, saved: Saved) -> Option<Box<dyn Engine>> {
        Some(match (self, saved) {
            (Self::Event(calendar), Saved::Exact(tally)) => event(*calendar, state, Some(tally)),
            (Self::Windowed(threads), Saved::Alternating(saved)) => {
                Box::new(Alternating::resume(state, *threads, saved))
            }
            (Self::Windowed(threads), Saved::Exact(tally)) => {
                Box::new(Alternating::resume(state, *threads, tally.into()))
            }
            (Self::Reversible, Saved::Reversible(saved)) => {
                Box::new(Reversible::resume(state, saved))
            }
            (Self::Step(_), Saved::Step(saved)) => Box::new(TimeStepping::resume(state, saved)),
            (Self::Statistical { threads, .. }, Saved::Statistical(saved)) => {
                Box::new(Statistical::resume(state, *saved, *threads))
            }
            _ => return None,
        })
    }

    /// What is wrong with the choice although it can be run: steps so long that they are felt.
    pub fn warning(&self, placement: &Placement) -> Option<String> {
        let step = match self {
            Self::Step(step) => step,
            Self::Statistical { resolution, .. } => {
                return accuracy::warning(placement, *resolution);
            }
            _ => return None,
        };
        let way = thermal_speed(placement) * step / mean_diameter(placement);
        (way > SHORT_WAY && way.is_finite()).then(|| {
            format!(
                "--dt {}: balls fly {} diameters in a step: the pressure will be about {} % too low, and balls will \
                 overlap by up to {} diameters",
                plain(*step),
                plain(way),
                plain(100.0 * pressure_error(way, packing_fraction(placement))),
                plain((8.0 * way).min(1.0)),
            )
        })
    }
}

fn event(calendar: CalendarName, state: State, tally: Option<Tally>) -> Box<dyn Engine> {
    match calendar {
        CalendarName::Indexed => event_driven::fitting::<Indexed>(state, tally),
        CalendarName::Lazy => event_driven::fitting::<Lazy>(state, tally),
        CalendarName::Bounded => event_driven::fitting::<Bounded>(state, tally),
        CalendarName::Auto => event_driven::usual(state, tally),
    }
}

impl Wishes {
    /// How finely engine `statistical` is to resolve the gas; `None` if it is not wanted.
    fn resolution(&self, placement: &Placement) -> Result<Option<Resolution>, String> {
        let preset = match (self.engine, self.accuracy) {
            (EngineName::Auto, Some(accuracy)) => accuracy.resolution(placement),
            (_, Some(_)) => {
                return Err("--accuracy chooses the engine: give it or --engine".to_owned());
            }
            (EngineName::Statistical, None) => Some(statistical::USUAL),
            (_, None) => None,
        };
        let Some(preset) = preset else {
            return Ok(None);
        };
        let resolution = Resolution {
            step: self.step_fraction.unwrap_or(preset.step),
            cell: self.cells_per_path.map_or(preset.cell, f64::recip),
        };
        Plan::new(&State::new(placement), resolution, self.forced).map_err(|refusal| {
            let force = match refusal {
                statistical::Refusal::Dense(_) => ", or --force to run it all the same",
                _ => "",
            };
            format!("engine statistical: {refusal}: give --engine event{force}")
        })?;
        Ok(Some(resolution))
    }
}

fn check_step(step: f64, until: Option<f64>, placement: &Placement) -> Result<(), String> {
    if let Some(until) = until.filter(|&until| step > until) {
        return Err(format!(
            "--dt {}: must not be longer than the run, {}",
            plain(step),
            plain(until)
        ));
    }
    let shortest = SHORTEST_STEP * UnitScale::of(placement).time;
    if step < shortest {
        return Err(format!(
            "--dt {}: must be at least {}, for time itself has a grid",
            plain(step),
            plain(shortest)
        ));
    }
    Ok(())
}

/// Share of the pressure that long steps lose, when a thermal ball flies `way` diameters in one.
///
/// They lose `3.4 way` of the part that collisions make, which is `1 - 1 / Z` of the whole.
///
/// Source: measured at a packing fraction of a tenth, where it is the known `1.25 way`; a thin gas loses `2.26 way` of that
/// part (derived here, from contacts found half a step late). Carnahan & Starling, J. Chem. Phys. 51, 635 (1969), for `Z`.
pub(crate) fn pressure_error(way: f64, packing_fraction: f64) -> f64 {
    let phi = packing_fraction;
    let z = (1.0 + phi * (1.0 + phi * (1.0 - phi))) / ((1.0 - phi) * (1.0 - phi) * (1.0 - phi));
    (3.4 * way).min(1.0) * (1.0 - 1.0 / z)
}

/// Root mean square of a component of the velocity.
pub(crate) fn thermal_speed(placement: &Placement) -> f64 {
    let squares = placement.velocities.iter().map(|v| v.length_squared());
    (squares.sum::<f64>() / (3.0 * placement.velocities.len().max(1) as f64)).sqrt()
}

/// Mean over the balls.
pub(crate) fn mean_diameter(placement: &Placement) -> f64 {
    let radius = |&kind: &u32| placement.bodies[kind as usize].radius;
    let radii = placement.body_of.iter().map(radius);
    match placement.bodies.as_slice() {
        [body] => 2.0 * body.radius,
        _ => 2.0 * radii.sum::<f64>() / placement.body_of.len().max(1) as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pressure_error_follows_its_law_and_fades_in_a_thin_gas() {
        let law = pressure_error(0.1, 0.109) / 0.125;
        assert!((law - 1.0).abs() < 0.05, "{law}");
        assert!(pressure_error(0.1, 5.7e-4) < 1e-3);
        assert!(pressure_error(10.0, 0.109) < 0.4);
    }
}
