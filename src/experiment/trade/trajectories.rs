//! How true the trajectories of a setting are, and how far it finds the way back: on a part of the gas that twice the precision
//! can follow.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::domain::{Boundary, Domain};
use crate::engine::reversible::Reversible;
use crate::experiment::double_double::DoubleDouble;
use crate::experiment::echo::Echo;
use crate::experiment::precise::{Precise, distance};
use crate::experiment::trial::{EVENT, REVERSIBLE, Trial};
use crate::state::{Placement, State};
use crate::worker::engines::Choice;

/// When trajectories are compared, in mean free times.
pub const LOOKS: [f64; 3] = [0.5, 1.0, 2.0];

/// When the gas is turned round, in mean free times.
pub const TURNS: [f64; 2] = [1.0, 4.0];

/// How faithful a setting is to every ball.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Faith {
    /// Mean distance from the reference at each of [`LOOKS`], in diameters.
    pub distance: [f64; 3],
    /// Mean distance from the start after each of [`TURNS`] and back, in diameters.
    pub echo: [f64; 2],
    /// Mean gap at a collision, in contact distances; `None` without collisions.
    pub gap: Option<f64>,
}

/// What trajectories are held against.
enum Reference {
    /// Places of the balls at each of [`LOOKS`], in twice the precision.
    Double(Vec<Vec<[DoubleDouble; 3]>>),
    /// Places by an engine.
    Engine(Vec<Vec<DVec3>>),
}

/// A part of the gas, and where its balls should be.
pub struct Judge {
    gas: Placement,
    reference: Reference,
    /// In the scene's units.
    free_time: f64,
    diameter: f64,
    /// What the balls are held against, in words.
    pub words: String,
}

impl Judge {
    /// Takes a part of at most `most` balls; `None` if the gas has too many and no part can be cut out.
    pub fn new(whole: &Placement, free_time: f64, most: usize) -> Option<Self> {
        let gas = part(whole, most)?;
        // Twenty bits: twice the time must lie on the engines' grid of time too, or the way back ends a tick beside the start.
        let free_time = f64::from_bits(free_time.to_bits() & !u64::from(u32::MAX));
        let units = State::new(&gas).units;
        // Instants are on a grid: the reference must look at the same.
        let looks = LOOKS.map(|look| units.scene_time(units.instant(look * free_time)));
        let known = gas.bodies.len() == 1
            && gas.bodies[0].mass.is_finite()
            && gas.domain.boundary == Boundary::Container
            && gas.domain.planes.is_empty();
        let (reference, words) = if known {
            let mut precise = Precise::<DoubleDouble>::new(&gas);
            let places = looks.map(|time| {
                precise.run(time);
                precise.present().into_iter().map(|ball| ball.0).collect()
            });
            (Reference::Double(places.into()), "all pairs in 106 bits")
        } else {
            let reversible = Reversible::new(State::new(&gas)).is_ok();
            let (choice, words) = if reversible {
                (REVERSIBLE, "engine reversible")
            } else {
                (EVENT, "engine event")
            };
            let mut trial = Trial::new(choice, &gas);
            let places = looks.map(|time| {
                trial.run(time);
                trial.state().placement().positions
            });
            (Reference::Engine(places.into()), words)
        };
        let radii = State::new(&gas).bodies.mean_radius() * units.length;
        let diameter = if radii > 0.0 {
            2.0 * radii
        } else {
            gas.domain.half_size.max_element()
        };
        let words = format!("{words}, {} balls", gas.positions.len());
        Some(Self {
            gas,
            reference,
            free_time,
            diameter,
            words,
        })
    }

    /// Balls of the part.
    pub fn balls(&self) -> usize {
        self.gas.positions.len()
    }

    /// Simulated time that [`Self::judge`] runs for, all in all.
    pub fn time(&self) -> f64 {
        (LOOKS[2] + 2.0 * TURNS.iter().sum::<f64>()) * self.free_time
    }

    /// Runs the part with an engine, there and back too; `None` if the engine does not take it.
    pub fn judge(&self, choice: Choice) -> Option<Faith> {
        if choice == REVERSIBLE && Reversible::new(State::new(&self.gas)).is_err() {
            return None;
        }
        let mut faith = Faith::default();
        let mut trial = Trial::new(choice, &self.gas);
        let (mut gaps, mut count) = (0.0, 0_u64);
        for (look, distance) in faith.distance.iter_mut().enumerate() {
            trial
                .try_run(LOOKS[look] * self.free_time, &mut |collision| {
                    if collision.gap.is_finite() {
                        gaps += collision.gap.abs();
                        count += 1;
                    }
                })
                .ok()?;
            *distance = self.distance(look, &trial.state().placement());
        }
        faith.gap = (count > 0).then(|| gaps / count as f64);
        for (echo, turn) in faith.echo.iter_mut().zip(TURNS) {
            *echo = Echo::new(choice, &self.gas, turn * self.free_time).position() / self.diameter;
        }
        Some(faith)
    }

    fn distance(&self, look: usize, found: &Placement) -> f64 {
        let count = found.positions.len().max(1) as f64;
        let sum: f64 = match &self.reference {
            Reference::Double(places) => places[look]
                .iter()
                .zip(&found.positions)
                .map(|(place, found)| distance(place, &found.to_array().map(DoubleDouble::from)))
                .sum(),
            Reference::Engine(places) => places[look]
                .iter()
                .zip(&found.positions)
                .map(|(place, found)| place.distance(*found))
                .sum(),
        };
        sum / count / self.diameter
    }
}

/// The gas itself if it is small, else the balls in the middle; those of a periodic box in a container of their own.
fn part(gas: &Placement, most: usize) -> Option<Placement> {
    let count = gas.positions.len();
    if gas.domain.boundary == Boundary::Open || !gas.domain.planes.is_empty() {
        return (count <= most).then(|| gas.clone());
    }
    let half_size = gas.domain.half_size * (most as f64 / count as f64).cbrt().min(1.0);
    let centred = |position: &DVec3| *position - gas.center;
    let whole = count <= most;
    let mut part = gas.clone();
    part.center = DVec3::ZERO;
    part.domain = Domain::container(half_size);
    let radius =
        |ball: usize| gas.bodies[gas.body_of.get(ball).map_or(0, |&kind| kind as usize)].radius;
    let inside: Vec<usize> = (0..count)
        .filter(|&ball| {
            // A ball of a container may touch its walls, up to rounding.
            let reach = centred(&gas.positions[ball]).abs() + radius(ball);
            whole && gas.domain.boundary == Boundary::Container || reach.cmple(half_size).all()
        })
        .take(most)
        .collect();
    part.positions = inside
        .iter()
        .map(|&ball| centred(&gas.positions[ball]))
        .collect();
    part.velocities = inside.iter().map(|&ball| gas.velocities[ball]).collect();
    if !gas.body_of.is_empty() {
        part.body_of = inside.iter().map(|&ball| gas.body_of[ball]).collect();
    }
    (inside.len() > 1).then_some(part)
}
