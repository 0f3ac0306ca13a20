//! Scenes: what the user wrote, checked, and the balls placed.
//!
//! [`Scene::load`] and [`Scene::parse`] doubt every value once; what comes out of [`Scene::place`] is finite, inside the
//! domain and free of overlaps, so nothing behind it doubts again.

mod checks;
mod contact_grid;
mod format;
mod frames;
mod memory;
pub mod observe;
mod placement;
mod reader;
mod region;
mod seed_text;
mod site;
mod table;
mod write;

pub mod analysis;

pub use memory::{BYTES_PER_BALL, bytes_per_ball};
pub use seed_text::is_seed_text;
pub use site::Cell;
pub use table::Rows;

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::domain::{Boundary, Domain};
use crate::error::{Error, Result};
use crate::snapshot::{self, SceneCard, Units};
use crate::state::Placement;
use crate::worker::engines::EngineName;

/// The scene that runs when none is named: a cube of oxygen near standard conditions.
pub const OXYGEN: &str = include_str!("../configs/oxygen.toml");

/// How the embedded scene is called in messages.
pub const OXYGEN_NAME: &str = "configs/oxygen.toml";

/// Largest scene file \[bytes\]; more balls than fit belong into a CSV file.
const LARGEST_FILE: u64 = 64 << 20;

/// Largest file of the seed's text \[bytes\], which has no other place for its balls.
const LARGEST_SEED_TEXT: u64 = 2 << 30;

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
    /// What moves the balls, unless the command line says so.
    pub engine: EngineName,
    /// The domain's planes as the file has them, for writing it again.
    pub planes: Vec<PlaneText>,
    /// Simulated time at which the run ends, if the scene says so.
    pub until: Option<f64>,
    /// Simulated time between two rows of the series.
    pub sample: f64,
    /// What is measured on demand.
    pub observe: observe::Observe,
    /// Balls that come in numbers, in the order of the file.
    pub species: Vec<Species>,
    /// Balls that the scene lists one by one; they come after all species.
    pub balls: Vec<Ball>,
    /// The scene file, for messages.
    pub path: PathBuf,
    /// The scene file's text as it was read.
    pub source: String,
}

/// A plane in the words of a scene file, in the scene's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneText {
    /// A point of the plane \[length\].
    pub point: DVec3,
    /// A vector perpendicular to it, of any length.
    pub normal: DVec3,
}

/// Balls alike in radius, mass and the rule that places them.
#[derive(Clone, Debug, PartialEq)]
pub struct Species {
    /// Name, for messages.
    pub name: Option<String>,
    /// Number of balls.
    pub count: usize,
    /// Radius of each \[length\], 0 for points; `None` takes it from the rows of the file that places them.
    pub radius: Option<f64>,
    /// Mass of each \[mass\], infinite for balls that never move; `None` takes it from the rows of the file that places them.
    pub mass: Option<f64>,
    /// Where the balls start.
    pub sites: Sites,
    /// How fast the balls start; `None` takes it from the rows of the file that places them.
    pub velocities: Option<Velocities>,
    /// Line of the scene file, for messages.
    pub line: usize,
}

/// Where the balls of a species start.
#[derive(Clone, Debug, PartialEq)]
pub enum Sites {
    /// The sites of a lattice centred in the domain.
    Lattice {
        /// The lattice's cell.
        cell: Cell,
        /// Edge of a cell \[length\]; `None` fills the domain.
        spacing: Option<f64>,
    },
    /// One after the other at random where there is room (random sequential insertion).
    Random,
    /// The rows of a CSV file, or of a trajectory's last frame.
    Rows(Rows),
}

/// How fast the balls of a species start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Velocities {
    /// Maxwell's distribution: each component normal with variance `k T / m`.
    Maxwell {
        /// Temperature \[K, or energy in reduced units\].
        temperature: f64,
    },
    /// Each component normal.
    Normal {
        /// Standard deviation of a component \[speed\].
        deviation: f64,
    },
    /// One speed, all directions alike.
    Speed {
        /// The speed.
        value: f64,
    },
    /// At rest.
    Rest,
}

/// A ball that the scene lists by itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Ball {
    /// Name, which also tags the ball on screen.
    pub name: Option<String>,
    /// Position in the scene's coordinates \[length\].
    pub position: DVec3,
    /// Velocity.
    pub velocity: DVec3,
    /// Radius \[length\], 0 for a point.
    pub radius: f64,
    /// Mass \[mass\], infinite for a ball that never moves.
    pub mass: f64,
    /// Line of the scene file, for messages.
    pub line: usize,
}

impl Scene {
    /// Reads a scene from a file.
    ///
    /// # Errors
    /// [`Error::Scene`] when the file cannot be read, is not text, is longer than 64 MiB, or does not make a scene.
    pub fn load(path: &Path) -> Result<Self> {
        let refuse = |words: String| Error::Scene(vec![format!("{}: {words}", path.display())]);
        let mut bytes = Vec::new();
        let cannot_read = |error: io::Error| refuse(format!("cannot read: {error}"));
        let mut file = File::open(path).map_err(cannot_read)?;
        let mut read = |bytes: &mut Vec<u8>, limit: u64| {
            (&mut file)
                .take(limit + 1 - bytes.len() as u64)
                .read_to_end(bytes)
        };
        read(&mut bytes, LARGEST_FILE).map_err(cannot_read)?;
        let mut limit = LARGEST_FILE;
        let begin = str::from_utf8(&bytes[..bytes.len().min(4096)])
            .map_or_else(|error| error.valid_up_to(), str::len);
        if bytes.len() as u64 > limit
            && seed_text::is_seed_text(&String::from_utf8_lossy(&bytes[..begin]))
        {
            limit = LARGEST_SEED_TEXT;
            read(&mut bytes, limit).map_err(cannot_read)?;
        }
        if bytes.len() as u64 > limit {
            let limit = limit >> 20;
            return Err(refuse(format!(
                "size: more than the limit of {limit} MiB: put the balls into a CSV file, placement = {{ kind = \"file\", ... }}"
            )));
        }
        if bytes.contains(&0) {
            return Err(refuse(
                "not a scene: it holds NUL bytes, so it is binary or UTF-16".to_owned(),
            ));
        }
        let text = String::from_utf8(bytes).map_err(|error| {
            refuse(format!(
                "not text: byte {} is not UTF-8",
                error.utf8_error().valid_up_to()
            ))
        })?;
        Self::parse(path, &text)
    }

    /// The embedded scene: oxygen near standard conditions.
    ///
    /// # Panics
    /// Never: a test reads the embedded scene.
    pub fn oxygen() -> Self {
        Self::parse(Path::new(OXYGEN_NAME), OXYGEN).expect("the embedded scene is a good scene")
    }

    /// Reads a scene from the text of a file, TOML or the seed's, whatever its name; `path` is for messages, and files that the scene names are found beside it.
    ///
    /// # Errors
    /// [`Error::Scene`] with one line per fault.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let parse = if seed_text::is_seed_text(text) {
            seed_text::parse
        } else {
            format::parse
        };
        parse(path, text).map_err(Error::Scene)
    }

    /// The balls of a CSV state, with the domain and units of a scene; without one, in open space and reduced units.
    ///
    /// # Errors
    /// [`Error::Scene`] with one line per fault of the file.
    pub fn from_state(path: &Path, like: Option<Self>) -> Result<Self> {
        let rows = table::read(path).map_err(Error::Scene)?;
        let (Some(radii), Some(masses)) = (&rows.radii, &rows.masses) else {
            let words = format!("{}: columns: radius and mass are needed", path.display());
            return Err(Error::Scene(vec![words]));
        };
        let still = vec![DVec3::ZERO; rows.positions.len()];
        let velocities = rows.velocities.as_ref().unwrap_or(&still);
        let balls: Vec<Ball> = (0..rows.positions.len())
            .map(|index| Ball {
                name: None,
                position: rows.positions[index],
                velocity: velocities[index],
                radius: radii[index],
                mass: masses[index],
                line: index + 2, // after the header
            })
            .collect();
        let scene = like.unwrap_or_else(|| {
            let region = seed_text::open_space(&balls);
            Self {
                title: format::default_title(path),
                units: Units::Reduced,
                seed: 1,
                domain: region.domain,
                center: region.center,
                planes: Vec::new(),
                engine: EngineName::Auto,
                until: None,
                sample: format::default_sample(None, Some(Units::Reduced)),
                observe: observe::Observe::default(),
                species: Vec::new(),
                balls: Vec::new(),
                path: PathBuf::new(),
                source: String::new(),
            }
        });
        Ok(Self {
            species: Vec::new(),
            balls,
            path: path.to_owned(),
            ..scene
        })
    }

    /// Whether the domain is a periodic box.
    pub fn has_images(&self) -> bool {
        self.domain.boundary == Boundary::Periodic
    }

    /// Number of balls.
    pub fn ball_count(&self) -> usize {
        self.species
            .iter()
            .map(|species| species.count)
            .sum::<usize>()
            + self.balls.len()
    }

    /// Places the balls: the only use of random numbers.
    ///
    /// Species come in the order of the file, then the explicit balls. The same scene and seed give the same bits on every
    /// machine.
    ///
    /// # Errors
    /// [`Error::Scene`] when balls overlap, leave the container or do not fit in memory.
    pub fn place(&self) -> Result<Placement> {
        placement::place(self).map_err(Error::Scene)
    }

    /// Names of balls and their indices in the placement.
    pub fn named_balls(&self) -> Vec<(String, usize)> {
        let first = self.ball_count() - self.balls.len();
        let balls = self.balls.iter().enumerate();
        balls
            .filter_map(|(offset, ball)| Some((ball.name.clone()?, first + offset)))
            .collect()
    }

    /// What snapshots say of this scene.
    pub fn card(&self, placement: &Placement) -> SceneCard {
        let radii = placement.bodies.iter().map(|body| body.radius);
        let planes =
            (self.domain.planes.iter()).map(|plane| (plane.normal.to_array(), plane.offset));
        SceneCard {
            title: self.title.clone(),
            units: self.units,
            ball_count: placement.positions.len(),
            packing_fraction: analysis::packing_fraction(placement),
            boundary: match self.domain.boundary {
                Boundary::Container => snapshot::Boundary::Container,
                Boundary::Periodic => snapshot::Boundary::Periodic,
                Boundary::Open => snapshot::Boundary::Open,
            },
            size: (2.0 * self.domain.half_size).to_array(),
            planes: planes.collect(),
            center: self.center.to_array(),
            radius: radii.fold(0.0, f64::max),
            sample: self.sample,
        }
    }
}
