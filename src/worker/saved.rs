//! A run as a checkpoint holds it: all that it needs to go on, without its scene file, as if it had never stopped.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::echo::EchoWatch;
use super::engines::Choice;
use super::measure::{Named, Pressures};
use super::observables::Plan;
use super::pace::Meter;
use crate::checkpoint;
use crate::domain::Boundary;
use crate::engine::Saved;
use crate::error::{Error, Result};
use crate::history::History;
use crate::observe::Observer;
use crate::observe::on_demand::OnDemand;
use crate::scene::Scene;
use crate::scene::analysis::Theory;
use crate::snapshot::SceneCard;
use crate::state::{Placement, State};
use crate::trajectory_file::Mark;

/// Overlap of balls with walls beyond which a checkpoint is not believed, in internal lengths; the engine of steps lets balls
/// fly on for a step.
const OUTSIDE: f64 = 1e-9;

/// What does not change while a run goes on, whatever its balls do.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Origin {
    /// What snapshots say of the scene.
    pub card: Arc<SceneCard>,
    /// What kinetic theory says of it.
    pub(super) theory: Theory,
    /// The balls that the scene names.
    pub(super) named: Vec<Named>,
    /// What of it is to be measured beside.
    pub(super) plan: Option<Plan>,
    /// The scene file.
    pub path: PathBuf,
    /// Its text.
    pub source: String,
}

/// Totals at the end of an interval, from which the next one's means are made.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Totals {
    pub time: f64,
    pub wall_impulse: f64,
    pub pair_virial: f64,
    pub pair_collisions: u64,
    pub wall_collisions: u64,
}

/// A run at one moment.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SavedRun {
    /// Where it came from.
    pub origin: Arc<Origin>,
    /// What drives it.
    pub engine: Choice,
    /// Simulated time at which it was to end.
    pub until: Option<f64>,
    /// Simulated time.
    pub time: f64,
    /// Wall time spent running, pauses excluded \[s\].
    pub wall_time_s: f64,
    /// Simulated time per wall second, lately.
    pub time_rate: Option<f64>,
    pub(super) state: State,
    pub(super) kinetic_energy: f64,
    pub(super) saved: Saved,
    pub(super) observer: Observer,
    pub(super) on_demand: Option<OnDemand>,
    pub(super) pressures: Pressures,
    pub(super) echo: EchoWatch,
    pub(super) meter: Meter,
    pub(super) history: Arc<History>,
    pub(super) last_point: (Totals, f64),
    pub(super) last_row: Totals,
    pub(super) rows: u64,
    /// How far its trajectory has come, if there is one.
    pub trajectory: Option<Mark>,
    /// Simulated times at which time was reversed.
    pub(super) reversals: Vec<f64>,
    /// Simulated times that watchers have marked.
    pub(super) marks: Vec<f64>,
}

impl Origin {
    /// What a scene and its placed balls tell.
    pub fn new(scene: &Scene, placement: &Placement) -> Self {
        Self {
            card: Arc::new(scene.card(placement)),
            theory: Theory::new(placement, scene.units),
            named: Named::all(scene, placement),
            plan: Plan::new(scene, placement),
            path: scene.path.clone(),
            source: scene.source.clone(),
        }
    }

    /// Tells one scene from another: a hash of its text and of what was made of it.
    pub fn hash(&self) -> u64 {
        let card = format!("{:?}", self.card);
        checkpoint::hash(self.source.bytes().chain(card.into_bytes()))
    }
}

impl SavedRun {
    /// Reads a checkpoint, or the newest whole one of a run directory, and checks that it can be gone on from. Gives the file
    /// that was read and, if a newer one was damaged, what is wrong with that.
    ///
    /// # Errors
    /// [`Error::Usage`] with the file and what is wrong with it.
    pub fn load(path: &Path) -> Result<(Self, PathBuf, Option<String>)> {
        let mut damage = None;
        for file in checkpoint::candidates(path) {
            let read = checkpoint::load::<Self>(&file).and_then(|(run, scene_hash)| {
                run.check(scene_hash).map_err(|why| {
                    format!(
                        "{}: not a checkpoint that can be used: {why}",
                        file.display()
                    )
                })?;
                Ok(run)
            });
            match read {
                Ok(run) => return Ok((run, file, damage)),
                Err(why) => {
                    damage.get_or_insert(why);
                }
            }
        }
        let nothing = || format!("{}: holds no checkpoint", path.display());
        Err(Error::Usage(damage.unwrap_or_else(nothing)))
    }

    /// Writes its checkpoint.
    ///
    /// # Errors
    /// What the writer answers.
    pub fn write(&self, writer: &mut dyn io::Write) -> io::Result<()> {
        checkpoint::write(self, self.origin.hash(), writer)
    }

    /// Whether time runs backwards.
    pub fn reversed(&self) -> bool {
        self.reversals.len() % 2 == 1
    }

    /// What must hold of every gas that an engine has left.
    fn check(&self, scene_hash: u64) -> std::result::Result<(), String> {
        let wrong = |what: &str| Err(what.to_owned());
        let count = self.state.ball_count();
        if scene_hash != self.origin.hash() {
            return wrong("it holds another scene than it says");
        }
        if !self.state.is_consistent()
            || self.origin.card.ball_count != count
            || self.origin.named.iter().any(|named| named.ball >= count)
            || !self.saved.fits(count)
            || !self.echo.fits(count)
        {
            return wrong("its parts do not belong together");
        }
        let finite = |ball: usize| {
            let flight = &self.state.trajectories[ball];
            flight.position.is_finite() && flight.velocity.is_finite()
        };
        if let Some(ball) = (0..count).find(|&ball| !finite(ball)) {
            return wrong(&format!("ball {ball} is nowhere"));
        }
        if let Some(ball) = (0..count).find(|&ball| self.is_outside(ball)) {
            return wrong(&format!("ball {ball} is outside the box"));
        }
        if self.state.totals().kinetic_energy != self.kinetic_energy {
            return wrong("its balls do not have the energy that it says");
        }
        Ok(())
    }

    /// Whether a ball has left the box, farther than the engine lets it.
    fn is_outside(&self, ball: usize) -> bool {
        let domain = &self.state.domain;
        let radius = match domain.boundary {
            Boundary::Open => return false,
            Boundary::Container => self.state.bodies.of(ball).radius,
            Boundary::Periodic => 0.0,
        };
        // In a step, a ball flies on beyond the walls.
        let beyond = match self.engine {
            Choice::Step(step) => {
                let way = 2.0 * step / self.state.units.time;
                self.state.trajectories[ball].velocity.length() * way
            }
            _ => 0.0,
        };
        let position = self.state.trajectories[ball].position_at(self.state.now);
        let limit = domain.half_size - radius + OUTSIDE + beyond;
        position.abs().cmpgt(limit).any()
    }
}
