//! There and back: how well a gas finds the way back after its velocities have been turned round.

use crate::experiment::trial::Trial;
use crate::state::Placement;
use crate::worker::engines::Choice;

/// A run for a time and back.
pub struct Echo {
    /// Error of each ball's position and velocity at the end.
    pub errors: Vec<(f64, f64)>,
    /// The run.
    pub trial: Trial,
}

impl Echo {
    /// Runs a gas for `time`, turns it round and runs it for as long again.
    pub fn new(choice: Choice, gas: &Placement, time: f64) -> Self {
        let mut trial = Trial::new(choice, gas);
        // An engine on integers rounds the input: its own start is what it must come back to.
        trial.engine.settle();
        let start = trial.state().placement();
        trial.run(time);
        trial.reverse();
        trial.run(2.0 * time);
        let end = trial.state().placement();
        let positions = start.positions.iter().zip(&end.positions);
        let velocities = start.velocities.iter().zip(&end.velocities);
        let errors = positions
            .map(|(start, end)| start.distance(*end))
            .zip(velocities.map(|(start, end)| (*start + *end).length()))
            .collect();
        Self { errors, trial }
    }

    /// Mean error of the positions.
    pub fn position(&self) -> f64 {
        mean(self.errors.iter().map(|error| error.0))
    }

    /// Mean error of the velocities.
    pub fn velocity(&self) -> f64 {
        mean(self.errors.iter().map(|error| error.1))
    }
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

/// Mean distance between the balls of two gases.
pub fn mean_distance(first: &Placement, second: &Placement) -> f64 {
    let pairs = first.positions.iter().zip(&second.positions);
    mean(pairs.map(|(a, b)| a.distance(*b)))
}
