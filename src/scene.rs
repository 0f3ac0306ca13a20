//! Scenes: what the user wrote, checked, and the balls placed.

use std::path::Path;

use glam::DVec3;

use crate::domain::Domain;
use crate::error::Result;
use crate::snapshot::{SceneCard, Units};
use crate::state::Placement;

/// A scene that has been checked: every value behind this door is good.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The scene's title.
    pub title: String,
    /// Unit system of every quantity.
    pub units: Units,
    /// Seed of all random placement.
    pub seed: u64,
    /// Where the balls live.
    pub domain: Domain,
    /// The domain's centre \[length\].
    pub center: DVec3,
    /// Simulated time at which the run ends, if the scene says so.
    pub until: Option<f64>,
    /// Simulated time between two rows of the series.
    pub sample: f64,
    /// The scene file's text as it was read.
    pub source: String,
}

impl Scene {
    /// Reads a scene from the text of a file; `path` is for messages.
    ///
    /// # Errors
    /// [`crate::error::Error::Scene`] with one line per fault.
    pub fn parse(_path: &Path, _text: &str) -> Result<Self> {
        unimplemented!("lands with the scene format")
    }

    /// Places the balls: the only use of random numbers.
    ///
    /// # Errors
    /// Balls that overlap, leave the container or do not fit in memory.
    pub fn place(&self) -> Result<Placement> {
        unimplemented!("lands with the scene format")
    }

    /// Names of balls and their indices in the placement.
    pub fn named_balls(&self) -> Vec<(String, usize)> {
        Vec::new()
    }

    /// What snapshots say of this scene.
    pub fn card(&self, _placement: &Placement) -> SceneCard {
        unimplemented!("lands with the scene format")
    }
}
