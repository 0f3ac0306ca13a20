//! What a resolution comes to for a gas, and what it gets wrong, before anything runs.

use super::cells::Cells;
use super::law::{Free, Mixture};
use super::{FEWEST_PER_CELL, MOST_BALLS, Resolution, WIDEST, width};
use crate::domain::Boundary;
use crate::state::State;

/// Packing fraction above which a gas is no longer run unless that is forced.
pub const DENSEST: f64 = 1e-2;

/// Packing fraction above which the method is in doubt.
pub const DENSE: f64 = 1e-3;

/// Fewest balls.
const FEWEST_BALLS: usize = 20;

/// Most kinds of balls: all pairs of them are looked at.
const MOST_KINDS: usize = 1000;

/// Largest radius in smallest ones: tries go by the largest pair.
const SIMILAR_SIZE: f64 = 4.0;

/// Why a gas cannot be run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// Open space, where cells have no end.
    Open,
    /// Planes.
    Planes,
    /// Balls that never move.
    Fixed,
    /// All balls rest, or none can meet another.
    NoCollisions,
    /// Too few balls for averages.
    Few(usize),
    /// Too many balls.
    Many(usize),
    /// Radii, largest over smallest.
    Sizes(f64),
    /// Different kinds of balls.
    Kinds(usize),
    /// The packing fraction.
    Dense(f64),
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Open => write!(
                formatter,
                "space is open: it needs a container or a periodic box"
            ),
            Self::Planes => write!(formatter, "it knows no planes"),
            Self::Fixed => write!(
                formatter,
                "some balls are fixed: it needs balls that all can move"
            ),
            Self::NoCollisions => write!(formatter, "no two balls will collide"),
            Self::Few(count) => write!(
                formatter,
                "{count} balls are too few: it needs {FEWEST_BALLS}"
            ),
            Self::Many(count) => write!(
                formatter,
                "{count} balls are too many: at most {MOST_BALLS}"
            ),
            Self::Sizes(ratio) => write!(
                formatter,
                "the largest radius is {ratio:.1} times the smallest: at most {SIMILAR_SIZE}"
            ),
            Self::Kinds(count) => write!(
                formatter,
                "{count} kinds of balls are too many: at most {MOST_KINDS}"
            ),
            Self::Dense(packing_fraction) => write!(
                formatter,
                "a packing fraction of {packing_fraction:.2e} is too dense: at most {DENSEST}"
            ),
        }
    }
}

/// A resolution fitted to a gas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Step and cells as they will be; the cells may be wider than wished, where there are few balls.
    pub resolution: Resolution,
    /// Length of a step \[epochs\].
    pub step: f64,
    /// Mean number of balls in a cell.
    pub balls_per_cell: f64,
    /// Volume of the balls over that of the domain.
    pub packing_fraction: f64,
}

/// Relative errors, by their laws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Of the pressure.
    pub pressure: f64,
    /// Of the rate of pair collisions.
    pub collision_rate: f64,
    /// Of self-diffusion.
    pub diffusion: f64,
    /// Of the viscosity.
    pub viscosity: f64,
    /// Of the conduction of heat; not measured.
    pub conduction: f64,
}

impl Errors {
    /// The largest of pressure, rate, diffusion and viscosity.
    pub fn largest(&self) -> f64 {
        self.pressure
            .max(self.collision_rate)
            .max(self.diffusion)
            .max(self.viscosity)
    }
}

impl Plan {
    /// Fits a resolution to a gas; `forced` accepts one that is too dense.
    ///
    /// # Errors
    /// [`Refusal`] if the method cannot run the gas.
    pub fn new(state: &State, resolution: Resolution, forced: bool) -> Result<Self, Refusal> {
        let (mixture, free, cells) = fit(state, resolution.cell)?;
        if mixture.packing_fraction > DENSEST && !forced {
            return Err(Refusal::Dense(mixture.packing_fraction));
        }
        Ok(Self {
            resolution: Resolution {
                cell: cells.width() / free.path,
                ..resolution
            },
            step: resolution.step * free.time,
            balls_per_cell: state.ball_count() as f64 / cells.count() as f64,
            packing_fraction: mixture.packing_fraction,
        })
    }

    /// What the step and the cells get wrong.
    ///
    /// Sources: Garcia & Wagner, Phys. Fluids 12, 2621 (2000), for the step; Alexander, Garcia & Alder, Phys. Fluids 10, 1540
    /// (1998), for the cells, both recalled. Pressure and rate are bounds that `moltop experiment trade --engines statistical
    /// --seconds 25` found kept on the oxygen, within noise. So is the term for few balls in a cell, of which the same two meet
    /// again too often: displacements were 0.26(5) % too small with 20 of them.
    pub fn errors(&self) -> Errors {
        let Resolution { step, cell } = self.resolution;
        let (step, cell) = (step * step, cell * cell);
        Errors {
            pressure: 2e-4 + 0.2 * self.packing_fraction * self.packing_fraction.sqrt(),
            collision_rate: 5e-4,
            diffusion: 0.037 * step + 0.08 / self.balls_per_cell,
            viscosity: 0.0533 * step + 0.113 * cell,
            conduction: 0.0237 * step + 0.045 * cell,
        }
    }

    /// Whether cells hold so few balls that the same two meet again too often.
    pub fn is_sparse(&self) -> bool {
        self.balls_per_cell < 0.75 * FEWEST_PER_CELL
    }
}

/// The gas as a mixture, its mean free time and path, and its cells.
pub(super) fn fit(state: &State, wish: f64) -> Result<(Mixture, Free, Cells), Refusal> {
    let (count, kinds) = (state.ball_count(), state.bodies.kinds());
    let smallest = kinds
        .iter()
        .fold(f64::INFINITY, |least, body| least.min(body.radius));
    let ratio = state.bodies.largest_radius() / smallest;
    if state.domain.boundary == Boundary::Open {
        return Err(Refusal::Open);
    }
    if !state.domain.planes.is_empty() {
        return Err(Refusal::Planes);
    }
    if state.bodies.any_fixed() {
        return Err(Refusal::Fixed);
    }
    if count < FEWEST_BALLS {
        return Err(Refusal::Few(count));
    }
    if count >= MOST_BALLS {
        return Err(Refusal::Many(count));
    }
    if kinds.len() > MOST_KINDS {
        return Err(Refusal::Kinds(kinds.len()));
    }
    if ratio > SIMILAR_SIZE {
        return Err(Refusal::Sizes(ratio));
    }
    let mixture = Mixture::of(state).ok_or(Refusal::NoCollisions)?;
    let free = mixture.free().ok_or(Refusal::NoCollisions)?;
    let width = width(state, wish, free.path).min(WIDEST * free.path);
    let cells = Cells::new(&state.domain, smallest, width);
    Ok((mixture, free, cells))
}
