//! The accuracy card: what tells whether a run can be trusted, each figure beside the range in which it is sound.

use serde::Serialize;

use super::Snapshot;

/// One figure of the accuracy card.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Check {
    /// What it is.
    pub name: &'static str,
    /// Its value; `None` before there is one.
    pub value: Option<f64>,
    /// Largest magnitude at which it is sound.
    pub limit: f64,
    /// Whether it is; a figure that does not exist yet is.
    pub sound: bool,
}

/// Largest overlap of an exact engine that rounding explains, over the contact distance.
const OVERLAP: f64 = 1e-11;

/// Largest relative drift of a conserved quantity that rounding explains.
const DRIFT: f64 = 1e-12;

/// Largest share of collisions at the instant of the ball's own collision before: more means that balls have no room.
const ZERO_TIME_SHARE: f64 = 1e-3;

/// The same for an engine that keeps its numbers in f32.
const SINGLE_DRIFT: f64 = 1e-6;

impl Snapshot {
    /// Whether the engine is approximate by design.
    pub fn is_approximate(&self) -> bool {
        matches!(self.engine.as_ref(), "step" | "statistical")
    }

    /// The accuracy card of the run so far.
    ///
    /// The figures of engine `step`, whose errors are larger by design, come with the same limits: that is the trade.
    pub fn accuracy(&self) -> Vec<Check> {
        let counts = &self.counts;
        let collisions = counts.pair_collisions + counts.wall_collisions + counts.plane_collisions;
        let zero_time =
            (collisions > 0).then(|| counts.zero_time_events as f64 / collisions as f64);
        let drift = if self.engine == "statistical" {
            SINGLE_DRIFT
        } else {
            DRIFT
        };
        [
            ("largest overlap", self.max_overlap, OVERLAP),
            ("energy drift", self.energy_drift, drift),
            ("momentum drift", self.momentum_drift, drift),
            ("virial residual", self.virial_residual, DRIFT),
            ("late events", Some(counts.late_events as f64), 0.0),
            ("zero-time share", zero_time, ZERO_TIME_SHARE),
        ]
        .map(|(name, value, limit)| Check {
            name,
            value,
            limit,
            sound: value.is_none_or(|value| value.abs() <= limit),
        })
        .into()
    }
}
