//! `moltop generate`: scenes from a few numbers, the same from the same seed.
//!
//! `balls` makes a cube of balls on a lattice, their radii, masses and speeds alike or drawn, as the student program's
//! generator did; `gas` makes a real gas at a pressure and a temperature.

use std::fmt;
use std::io::{self, Write};
use std::path::Path;
use std::str::FromStr;

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::error::{Error, Result};
use crate::normal::{normal_vector, standard_normal};
use crate::scene::{Cell, Scene};
use crate::snapshot::Units;
use crate::state::Placement;

/// A gas as hard spheres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gas {
    /// Its formula, as the command line takes it.
    pub name: &'static str,
    /// Mass of a mole \[kg\]. Source: standard atomic weights (IUPAC), abridged to five digits.
    pub molar_mass: f64,
    /// Kinetic diameter \[m\]. Source: Breck, Zeolite Molecular Sieves (1974), table 8.14; the values in common use.
    pub diameter: f64,
}

/// The gases that are known.
pub const GASES: [Gas; 5] = [
    Gas {
        name: "O2",
        molar_mass: 31.998e-3,
        diameter: 346e-12,
    },
    Gas {
        name: "N2",
        molar_mass: 28.014e-3,
        diameter: 364e-12,
    },
    Gas {
        name: "H2",
        molar_mass: 2.016e-3,
        diameter: 289e-12,
    },
    Gas {
        name: "He",
        molar_mass: 4.0026e-3,
        diameter: 260e-12,
    },
    Gas {
        name: "Ar",
        molar_mass: 39.95e-3,
        diameter: 340e-12,
    },
];

/// Avogadro's constant \[1/mol\]. Source: the SI brochure, 9th edition (exact).
const AVOGADRO: f64 = 6.022_140_76e23;

/// Most balls that are generated.
const MOST_BALLS: f64 = 100e6;

/// A number that is given or drawn anew for each ball: `0.5`, `uniform:0.5`, `normal:0.5,0.1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Draw {
    /// The same for all.
    Fixed(f64),
    /// Any number up to a maximum, all alike.
    Uniform(f64),
    /// Normal with a mean and a standard deviation; what is not positive is drawn again.
    Normal(f64, f64),
}

impl FromStr for Draw {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let number = |text: &str| {
            let value = text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
            value
                .filter(|x| *x >= 0.0)
                .ok_or(format!("{text:?}: must be a finite number, 0 or greater"))
        };
        match text.split_once(':') {
            None => number(text).map(Self::Fixed),
            Some(("uniform", most)) => number(most).map(Self::Uniform),
            Some(("normal", rest)) => {
                let Some((mean, deviation)) = rest.split_once(',') else {
                    return Err("must be normal:MEAN,DEVIATION".to_owned());
                };
                Ok(Self::Normal(number(mean)?, number(deviation)?))
            }
            Some((kind, _)) => Err(format!(
                "{kind}: must be X, uniform:MAXIMUM or normal:MEAN,DEVIATION"
            )),
        }
    }
}

impl fmt::Display for Draw {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Fixed(value) => write!(formatter, "{value}"),
            Self::Uniform(most) => write!(formatter, "uniform:{most}"),
            Self::Normal(mean, deviation) => write!(formatter, "normal:{mean},{deviation}"),
        }
    }
}

impl Draw {
    /// A number in (0, most], or the fixed one; `None` when luck has run out.
    fn draw(self, most: f64, random: &mut Xoshiro256PlusPlus) -> Option<f64> {
        (0..10_000)
            .map(|_| match self {
                Self::Fixed(value) => value,
                Self::Uniform(most) => most * (1.0 - random.random::<f64>()),
                Self::Normal(mean, deviation) => mean + deviation * standard_normal(random),
            })
            .find(|&value| {
                matches!(self, Self::Fixed(_)) || (value >= f64::MIN_POSITIVE && value <= most)
            })
    }
}

/// A cube of balls on a cubic lattice, in a container one spacing wider.
#[derive(Clone, Copy, Debug)]
pub struct Balls {
    /// Balls along an edge.
    pub edge: u32,
    /// Distance of neighbours.
    pub spacing: f64,
    /// Radii; drawn ones are at most half the spacing.
    pub radius: Draw,
    /// Masses.
    pub mass: Draw,
    /// Speeds, in directions that are all alike; `Normal` is the normal distribution of each component, about its mean.
    pub speed: Draw,
    /// Seed of what is drawn.
    pub seed: u64,
}

impl Balls {
    /// Makes the scene.
    ///
    /// # Errors
    /// [`Error::Usage`] for numbers that make no balls, [`Error::Scene`] for balls that overlap.
    pub fn scene(&self) -> Result<(Scene, Placement)> {
        let n = self.edge as usize;
        if f64::from(self.edge).powi(3) > MOST_BALLS {
            return Err(Error::Usage(format!(
                "{n}^3 balls: must be at most {MOST_BALLS:e}"
            )));
        }
        let luckless = |what: &str, draw: Draw| {
            Error::Usage(format!(
                "--{what} {draw}: draws no number that fits: must be greater than 0{}",
                if what == "radius" {
                    " and at most half the spacing"
                } else {
                    ""
                }
            ))
        };
        let mut random = Xoshiro256PlusPlus::seed_from_u64(self.seed);
        let size = self.spacing * (n as f64 + 1.0);
        let head = format!(
            "title = \"{n} x {n} x {n} balls\"\nunits = \"reduced\"\nseed = {}\n\
             [domain]\nkind = \"container\"\nsize = [{size:?}, {size:?}, {size:?}]\n",
            self.seed
        );
        let mut scene = Scene::parse(Path::new("balls"), &head)?;
        for site in Cell::Cubic.sites(n.pow(3), DVec3::splat(self.spacing)) {
            let radius = self.radius.draw(0.5 * self.spacing, &mut random);
            let mass = self.mass.draw(f64::MAX, &mut random);
            scene.balls.push(crate::scene::Ball {
                name: None,
                position: site,
                velocity: self
                    .velocity(&mut random)
                    .ok_or_else(|| luckless("speed", self.speed))?,
                radius: radius.ok_or_else(|| luckless("radius", self.radius))?,
                mass: mass
                    .filter(|mass| *mass > 0.0)
                    .ok_or_else(|| luckless("mass", self.mass))?,
                line: 0,
            });
        }
        let balls = scene.place()?;
        Ok((scene, balls))
    }

    fn velocity(&self, random: &mut Xoshiro256PlusPlus) -> Option<DVec3> {
        let mut normal = || normal_vector(random);
        if let Draw::Normal(mean, deviation) = self.speed {
            return Some(mean + deviation * normal());
        }
        let direction = loop {
            let direction: DVec3 = normal();
            if direction.length() > 0.0 {
                break direction.normalize();
            }
        };
        Some(direction * self.speed.draw(f64::MAX, random)?)
    }
}

/// How large a gas is.
#[derive(Clone, Copy, Debug)]
pub enum Extent {
    /// Edge of a cube \[m\].
    Edge(f64),
    /// Volume of a cube \[m^3\].
    Volume(f64),
}

/// A gas by its pressure, volume and temperature.
///
/// # Errors
/// [`Error::Usage`] when that makes too many molecules or none, [`Error::Scene`] when they do not fit.
pub fn gas(
    gas: &Gas,
    pressure: f64,
    extent: Extent,
    temperature: f64,
    seed: u64,
) -> Result<(Scene, Placement)> {
    let edge = match extent {
        Extent::Edge(edge) => edge,
        Extent::Volume(volume) => volume.cbrt(),
    };
    let volume = match extent {
        Extent::Edge(edge) => edge.powi(3),
        Extent::Volume(volume) => volume,
    };
    let exact = pressure * volume / (Units::Si.boltzmann() * temperature);
    let count = exact.round();
    if !(1.0..=MOST_BALLS).contains(&count) {
        return Err(Error::Usage(format!(
            "p V / (k T) = {exact:.4e} molecules: must be from 1 to {MOST_BALLS:e}"
        )));
    }
    // The lattice that leaves the fewest sites empty; at these densities any has room.
    let count = count as usize;
    let empty = |cell: Cell| cell.sites_of_cube(count) - count;
    let cell = if empty(Cell::Fcc) < empty(Cell::Cubic) {
        "fcc"
    } else {
        "cubic"
    };
    let (mass, radius) = (gas.molar_mass / AVOGADRO, 0.5 * gas.diameter);
    let text = format!(
        "# {count} molecules: p V / (k T) at {pressure:?} Pa and {temperature:?} K in a cube of {edge:?} m.\n\n\
         title = \"{} at {pressure} Pa and {temperature} K\"\nunits = \"si\"\nseed = {seed}\n\n\
         [domain]\nkind = \"container\"\nsize = [{edge:?}, {edge:?}, {edge:?}]\n\n\
         [[species]]\nname = \"{}\"\ncount = {count}\nradius = {radius:?}\nmass = {mass:?}\n\
         placement = {{ kind = \"lattice\", cell = \"{cell}\" }}\n\
         velocity = {{ kind = \"maxwell\", temperature = {temperature:?} }}\n",
        gas.name, gas.name
    );
    let scene = Scene::parse(Path::new("gas"), &text)?;
    let balls = scene.place()?;
    Ok((scene, balls))
}

/// How a generated scene is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// A scene file.
    Toml,
    /// The seed's text.
    Seed,
}

/// Writes a generated scene: a gas as its species, balls one by one.
///
/// # Errors
/// [`Error::Usage`] for more balls than a TOML file holds.
///
/// # Panics
/// For a periodic scene as the seed's text; none is generated.
pub fn write(scene: &Scene, balls: &Placement, format: Format) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    let written: io::Result<()> = match format {
        Format::Toml if scene.balls.is_empty() => text.write_all(scene.source.as_bytes()),
        Format::Toml => text.write_all(scene.to_toml(balls)?.as_bytes()),
        Format::Seed => scene.write_seed_text(balls, &mut text),
    };
    written.expect("memory takes all, and no generated scene is periodic");
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEED_SCENE: Balls = Balls {
        edge: 4,
        spacing: 1.5,
        radius: Draw::Fixed(0.5),
        mass: Draw::Fixed(1.0),
        speed: Draw::Normal(0.0, 1.0),
        seed: 1,
    };

    #[test]
    fn what_is_drawn_is_read_from_the_command_line() {
        let parse = str::parse::<Draw>;
        assert_eq!(parse("0.5"), Ok(Draw::Fixed(0.5)));
        assert_eq!(parse("uniform:2"), Ok(Draw::Uniform(2.0)));
        assert_eq!(parse("normal:2,0.5"), Ok(Draw::Normal(2.0, 0.5)));
        for bad in [
            "",
            "nan",
            "-1",
            "0,5",
            "normal:1",
            "uniform:inf",
            "cauchy:1",
        ] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_file_and_it_reads_back() {
        for format in [Format::Toml, Format::Seed] {
            let file = |seed| {
                let (scene, balls) = Balls { seed, ..SEED_SCENE }.scene().expect("a good scene");
                let text = write(&scene, &balls, format).expect("few balls");
                (String::from_utf8(text).expect("text"), balls)
            };
            let (text, balls) = file(1);
            assert_eq!(text, file(1).0);
            assert_ne!(text, file(2).0);
            let back = Scene::parse(Path::new("again"), &text).and_then(|scene| scene.place());
            assert_eq!(back.expect("a good scene"), balls);
        }
    }

    #[test]
    fn drawn_balls_keep_to_their_limits() {
        let (_, balls) = Balls {
            radius: Draw::Uniform(0.75),
            mass: Draw::Normal(1.0, 1.0),
            speed: Draw::Uniform(3.0),
            ..SEED_SCENE
        }
        .scene()
        .expect("a good scene");
        assert_eq!(balls.bodies.len(), 64);
        assert!(
            balls
                .bodies
                .iter()
                .all(|body| body.radius <= 0.75 && body.mass > 0.0)
        );
        assert!(
            balls
                .velocities
                .iter()
                .all(|velocity| velocity.length() <= 3.0 + 1e-12)
        );
        let one_speed = Balls {
            speed: Draw::Fixed(2.0),
            ..SEED_SCENE
        };
        let (_, balls) = one_speed.scene().expect("a good scene");
        assert!(
            balls
                .velocities
                .iter()
                .all(|velocity| (velocity.length() - 2.0).abs() < 1e-14)
        );
    }

    #[test]
    fn balls_that_cannot_be_are_refused() {
        let refused = |balls: Balls| balls.scene().expect_err("it cannot be").to_string();
        assert!(
            refused(Balls {
                radius: Draw::Fixed(0.8),
                ..SEED_SCENE
            })
            .contains("overlap")
        );
        assert!(
            refused(Balls {
                mass: Draw::Fixed(0.0),
                ..SEED_SCENE
            })
            .contains("--mass 0")
        );
        assert!(
            refused(Balls {
                edge: 100_000,
                ..SEED_SCENE
            })
            .contains("at most")
        );
    }

    #[test]
    fn a_gas_has_as_many_molecules_as_its_pressure_needs() {
        let oxygen = &GASES[0];
        let (scene, balls) =
            gas(oxygen, 101_325.0, Extent::Edge(1e-7), 273.15, 1).expect("a good scene");
        assert_eq!(balls.positions.len(), 26_868); // Loschmidt's constant, 2.686780e25 per m^3
        assert_eq!(balls.bodies[0].radius, 1.73e-10);
        assert!((balls.bodies[0].mass / 5.3134e-26 - 1.0).abs() < 1e-4);
        let (same, _) =
            gas(oxygen, 101_325.0, Extent::Volume(1e-21), 273.15, 1).expect("a good scene");
        assert_eq!(same.ball_count(), scene.ball_count());
        assert!(
            gas(oxygen, 1.0, Extent::Edge(1e-9), 300.0, 1).is_err(),
            "no molecule"
        );
        assert!(
            gas(oxygen, 1e9, Extent::Edge(1e-8), 10.0, 1).is_err(),
            "solid, and beyond"
        );
    }
}
