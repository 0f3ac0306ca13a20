//! Engine and step by the accuracy that is wanted, from the error laws of engine `statistical`, and what each choice costs.

use clap::ValueEnum;
use serde::Serialize;

use super::{Choice, Wishes};
use crate::engine::statistical::{CAREFUL, DENSE, Plan, QUICK, Resolution, USUAL};
use crate::quantity::plain;
use crate::state::{Placement, State};

/// Balls that engine `statistical` moves by a step per wall second on one core: an assumption, right within a factor of a few.
pub const BALL_STEPS_PER_SECOND: f64 = 4e7;

/// The largest error of pressure, collision rate, diffusion and viscosity that is accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Accuracy {
    /// None but rounding: an exact engine
    Exact,
    /// 0.1 %
    #[value(name = "0.1%")]
    Tenth,
    /// 1 %
    #[value(name = "1%")]
    One,
    /// 10 %
    #[value(name = "10%")]
    Ten,
}

impl Accuracy {
    /// The error as a share.
    pub fn share(self) -> f64 {
        match self {
            Self::Exact => 0.0,
            Self::Tenth => 1e-3,
            Self::One => 1e-2,
            Self::Ten => 1e-1,
        }
    }

    /// The resolution that keeps the errors of this gas below what is accepted; `None` if no preset does.
    pub fn resolution(self, placement: &Placement) -> Option<Resolution> {
        // Finer cells than those of the presets pay only where there are balls enough for them.
        let finest = Resolution {
            cell: 1.0 / 16.0,
            ..CAREFUL
        };
        let state = State::new(placement);
        [QUICK, USUAL, CAREFUL, finest]
            .into_iter()
            .find(|&resolution| {
                Plan::new(&state, resolution, false)
                    .is_ok_and(|plan| !plan.is_sparse() && plan.errors().largest() <= self.share())
            })
    }
}

/// What a wished accuracy comes to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Offer {
    /// As `--accuracy` takes it.
    accuracy: String,
    engine: &'static str,
    /// Length of a step in mean free times.
    step_fraction: Option<f64>,
    /// Width of a cell in mean free paths.
    cell_fraction: Option<f64>,
    balls_per_cell: Option<f64>,
    /// Relative errors by their laws: pressure, collision rate, diffusion, viscosity.
    errors: Option<[f64; 4]>,
    /// Wall seconds per simulated time, in the scene's units.
    wall_seconds_per_time: Option<f64>,
}

impl Offer {
    /// The offers for a gas, exact first; `exact` are the wall seconds per simulated time of an exact engine.
    pub fn all(placement: &Placement, exact: Option<f64>) -> Vec<Self> {
        let offer = |&accuracy: &Accuracy| {
            let wishes = Wishes {
                accuracy: Some(accuracy),
                ..Wishes::default()
            };
            let choice = Choice::new(&wishes, placement).unwrap_or_default();
            let name = accuracy.to_possible_value();
            let name = name.as_ref().map_or("", |value| value.get_name());
            Self::new(name, choice, placement, exact)
        };
        Accuracy::value_variants().iter().map(offer).collect()
    }

    /// What a choice comes to.
    pub fn new(accuracy: &str, choice: Choice, placement: &Placement, exact: Option<f64>) -> Self {
        let state = State::new(placement);
        let plan = match choice {
            Choice::Statistical { resolution, .. } => Plan::new(&state, resolution, true).ok(),
            _ => None,
        };
        let seconds = |plan: &Plan| {
            state.ball_count() as f64 / BALL_STEPS_PER_SECOND / (plan.step * state.units.time)
        };
        Self {
            accuracy: accuracy.to_owned(),
            engine: choice.name(),
            step_fraction: plan.map(|plan| plan.resolution.step),
            cell_fraction: plan.map(|plan| plan.resolution.cell),
            balls_per_cell: plan.map(|plan| plan.balls_per_cell),
            errors: plan.map(|plan| {
                let errors = plan.errors();
                [
                    errors.pressure,
                    errors.collision_rate,
                    errors.diffusion,
                    errors.viscosity,
                ]
            }),
            wall_seconds_per_time: plan.as_ref().map(seconds).or(exact),
        }
    }

    /// In a line: the engine, its step and cells, its errors.
    pub fn words(&self) -> String {
        let (Some(step), Some(cell), Some(balls), Some(errors)) = (
            self.step_fraction,
            self.cell_fraction,
            self.balls_per_cell,
            self.errors,
        ) else {
            return format!("engine {}, exact", self.engine);
        };
        let [pressure, rate, diffusion, viscosity] = errors.map(|error| plain(100.0 * error));
        format!(
            "engine {}, approximate: steps of {} mean free times, cells of {} mean free paths with {} balls; errors up to \
             {pressure} % in pressure, {rate} % in collision rate, {diffusion} % in diffusion, {viscosity} % in viscosity",
            self.engine,
            plain(step),
            plain(cell),
            plain(balls)
        )
    }

    /// As `--accuracy` takes it.
    pub fn accuracy(&self) -> &str {
        &self.accuracy
    }

    /// Wall seconds per simulated time, in the scene's units.
    pub fn wall_seconds_per_time(&self) -> Option<f64> {
        self.wall_seconds_per_time
    }
}

/// What makes the method doubtful for a gas.
pub(super) fn warning(placement: &Placement, resolution: Resolution) -> Option<String> {
    let plan = Plan::new(&State::new(placement), resolution, true).ok()?;
    let mut doubts = Vec::new();
    if plan.packing_fraction > DENSE {
        doubts.push(format!(
            "a packing fraction of {} is above {}: recollisions and layers at the walls are missing",
            plain(plan.packing_fraction),
            plain(DENSE)
        ));
    }
    if plan.is_sparse() {
        doubts.push(format!(
            "{} balls in a cell are few: the same two meet again too often, and diffusion is too slow",
            plain(plan.balls_per_cell)
        ));
    }
    if resolution.step > 1.0 {
        doubts.push(format!(
            "steps of {} mean free times are longer than one",
            plain(resolution.step)
        ));
    }
    (!doubts.is_empty()).then(|| format!("engine statistical: {}", doubts.join("; ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn the_oxygen_gets_what_was_measured_for_it_and_the_exact_engine_where_nothing_else_will_do() {
        let oxygen = Scene::oxygen().place().expect("a good scene");
        assert_eq!(Accuracy::Ten.resolution(&oxygen), Some(QUICK));
        assert_eq!(Accuracy::One.resolution(&oxygen), Some(USUAL));
        assert_eq!(
            Accuracy::Tenth.resolution(&oxygen),
            None,
            "0.3 % in viscosity"
        );
        assert_eq!(Accuracy::Exact.resolution(&oxygen), None);
        let choices: Vec<_> = Offer::all(&oxygen, Some(1.0))
            .iter()
            .map(|offer| offer.engine)
            .collect();
        assert_eq!(
            choices,
            ["windowed", "windowed", "statistical", "statistical"]
        );
    }
}
