//! The table `[observe]`: what is measured on demand.

use serde::{Deserialize, Serialize};

use std::fmt::Write as _;

use clap::ValueEnum;

use super::reader::{Faults, Table};
use super::{Scene, Species};
use crate::domain::Boundary;

/// What can be measured on demand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[value(rename_all = "snake_case")]
pub enum Name {
    /// Neighbours at each distance, and the value at contact
    RadialDistribution,
    /// Balls along each axis
    DensityProfile,
    /// Mean square displacement, velocity autocorrelation and diffusion coefficient
    Motion,
    /// Boltzmann's H and the fourth moment of the velocities
    Relaxation,
    /// Free paths and times, collisions per ball, pressure on each wall
    Flights,
    /// Shear viscosity and thermal conductivity (periodic boxes)
    Transport,
}

/// What a scene asks to be measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Observe {
    /// Simulated time between two looks at all balls; `None` lets the program choose.
    pub every: Option<f64>,
    /// How far the radial distribution reaches \[length\]; `None` is three mean diameters.
    pub distance: Option<f64>,
    /// What is measured.
    pub chosen: Vec<Name>,
}

const KEYS: [(&str, Name); 6] = [
    ("radial_distribution", Name::RadialDistribution),
    ("density_profile", Name::DensityProfile),
    ("motion", Name::Motion),
    ("relaxation", Name::Relaxation),
    ("flights", Name::Flights),
    ("transport", Name::Transport),
];

impl Name {
    /// All of them, in the order of the results.
    pub const ALL: [Self; 6] = [
        Self::RadialDistribution,
        Self::DensityProfile,
        Self::Motion,
        Self::Relaxation,
        Self::Flights,
        Self::Transport,
    ];

    /// The key of `[observe]`, and the name in the summary.
    pub fn key(self) -> &'static str {
        KEYS.iter()
            .find(|(_, name)| *name == self)
            .map_or("", |(key, _)| key)
    }
}

impl Observe {
    /// The wish for one thing.
    pub fn only(name: Name) -> Self {
        Self {
            chosen: vec![name],
            ..Self::default()
        }
    }

    /// Chooses more.
    pub fn add(&mut self, names: &[Name]) {
        for name in names {
            if !self.chosen.contains(name) {
                self.chosen.push(*name);
            }
        }
    }

    /// Writes the table, if it says anything.
    pub(super) fn put(&self, text: &mut String) {
        if *self == Self::default() {
            return;
        }
        let numbers = [("every", self.every), ("distance", self.distance)];
        let numbers = numbers
            .into_iter()
            .filter_map(|(key, value)| Some(format!("{key} = {:?}\n", value?)));
        let flags = self
            .chosen
            .iter()
            .map(|name| format!("{} = true\n", name.key()));
        let lines: String = numbers.chain(flags).collect();
        write!(text, "\n[observe]\n{lines}").expect("memory takes all");
    }
}

/// Reads the table.
pub(super) fn read(mut table: Table, faults: &mut Faults) -> Observe {
    let mut observe = Observe {
        every: table.positive("every", faults).map(|every| every.value),
        distance: table
            .positive("distance", faults)
            .map(|distance| distance.value),
        chosen: Vec::new(),
    };
    for (key, name) in KEYS {
        if table.flag(key, faults).is_some_and(|flag| flag.value) {
            observe.chosen.push(name);
        }
    }
    table.finish(faults);
    observe
}

/// Why a scene cannot measure what it asks for; `None` if it can.
pub fn refusal(scene: &Scene) -> Option<String> {
    refusal_of(scene, &scene.observe)
}

/// The same of another wish.
pub fn refusal_of(scene: &Scene, observe: &Observe) -> Option<String> {
    let fixed = |species: &Species| species.mass.is_some_and(f64::is_infinite);
    let any_fixed =
        scene.species.iter().any(fixed) || scene.balls.iter().any(|ball| ball.mass.is_infinite());
    let domain = &scene.domain;
    let uniform = domain.boundary == Boundary::Periodic && domain.planes.is_empty() && !any_fixed;
    let room = domain.half_size.min_element();
    match observe {
        observe if observe.chosen.contains(&Name::Transport) && !uniform => Some(
            "transport: must be measured in a periodic box without planes and fixed balls, where the gas is alike everywhere"
                .to_owned(),
        ),
        observe if observe.distance.is_some_and(|distance| distance >= room) => Some(format!(
            "distance: must be less than half the smallest edge of the domain, {room}"
        )),
        observe
            if domain.boundary == Boundary::Open
                && (observe.chosen).iter().any(|name| matches!(name, Name::RadialDistribution | Name::DensityProfile)) =>
        {
            Some("radial_distribution, density_profile: open space has no density: must be in a container or a periodic box".to_owned())
        }
        _ => None,
    }
}
