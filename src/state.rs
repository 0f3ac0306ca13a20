//! The state of a gas: trajectories, in internal units that are the scene's times powers of two.
//!
//! A ball *is* a trajectory: its position at its own last collision, its velocity since, and the time of that collision.
//! Nothing else is state; cells and calendars are derived from it. In a periodic box a flight also ends where the ball's
//! centre leaves through a face: the next one begins at the opposite face, and the ball's image count says how often.
//!
//! Internal units ([`UnitScale`]): positions are relative to the centre of the domain; the unit of length is the power of two
//! at or below the largest half size, the unit of time is one epoch, the unit of mass the power of two at or below the
//! largest mass. Scaling by a power of two is exact, so a scene and its scaled twin run bit for bit alike (tested).

use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};

use crate::domain::{Boundary, Domain};
use crate::sum::Sum;
pub use crate::time::Time;
pub use crate::units::UnitScale;

/// Radius and mass of a ball.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Body {
    /// Radius \[length\].
    pub radius: f64,
    /// Mass \[mass\].
    pub mass: f64,
}

/// Radius and mass of every ball; kept once if all are alike.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bodies {
    kinds: Vec<Body>,
    kind_of: Vec<u32>,
}

impl Bodies {
    /// Body of a ball.
    #[inline]
    pub fn of(&self, ball: usize) -> Body {
        if self.kind_of.is_empty() {
            self.kinds[0]
        } else {
            self.kinds[self.kind_of[ball] as usize]
        }
    }

    /// The different bodies.
    pub fn kinds(&self) -> &[Body] {
        &self.kinds
    }

    /// Which of the [`Self::kinds`] a ball is.
    pub fn kind(&self, ball: usize) -> usize {
        self.kind_of.get(ball).map_or(0, |&kind| kind as usize)
    }

    /// The one body that all balls share, if they do.
    pub fn uniform(&self) -> Option<Body> {
        if self.kind_of.is_empty() {
            self.kinds.first().copied()
        } else {
            None
        }
    }

    /// Whether any ball has an infinite mass and never moves.
    pub fn any_fixed(&self) -> bool {
        self.kinds.iter().any(|body| body.mass.is_infinite())
    }

    /// Mean radius of the balls \[length\]; zero if there are none.
    pub fn mean_radius(&self) -> f64 {
        let radius = |&kind: &u32| self.kinds[kind as usize].radius;
        match self.uniform() {
            Some(body) => body.radius,
            None => self.kind_of.iter().map(radius).sum::<f64>() / self.kind_of.len().max(1) as f64,
        }
    }

    /// Smallest radius \[length\].
    pub fn smallest_radius(&self) -> f64 {
        self.kinds
            .iter()
            .fold(f64::INFINITY, |smallest, body| smallest.min(body.radius))
    }

    /// Largest radius \[length\].
    pub fn largest_radius(&self) -> f64 {
        self.kinds
            .iter()
            .fold(0.0, |largest, body| largest.max(body.radius))
    }
}

/// A ball in free flight. One cache line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[repr(C, align(64))]
pub struct Trajectory {
    /// Where the ball was at `begin` \[length\].
    pub position: DVec3,
    /// Its velocity since \[length per epoch\].
    pub velocity: DVec3,
    /// When the flight began.
    pub begin: Time,
}

impl Trajectory {
    /// Where the ball is at `time`, if it flies freely until then.
    #[inline]
    pub fn position_at(&self, time: Time) -> DVec3 {
        self.position + self.velocity * time.since(self.begin)
    }

    /// The flight as it stands at `time`, seen from there.
    #[must_use]
    pub fn synchronized(&self, time: Time) -> Self {
        Self {
            position: self.position_at(time),
            velocity: self.velocity,
            begin: time,
        }
    }
}

/// Balls as a scene gives them, all at one instant, in the scene's units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Where the balls live; its planes are relative to its centre.
    pub domain: Domain,
    /// The domain's centre \[length\]; positions are in the scene's coordinates, not relative to it.
    pub center: DVec3,
    /// The different radii and masses; an infinite mass makes a ball an obstacle.
    pub bodies: Vec<Body>,
    /// Index into `bodies` for each ball; empty when there is only one body.
    pub body_of: Vec<u32>,
    /// Positions \[length\].
    pub positions: Vec<DVec3>,
    /// Velocities \[length per time\].
    pub velocities: Vec<DVec3>,
}

impl Placement {
    /// Largest radius of any ball \[length\]; zero if there are none.
    pub fn largest_radius(&self) -> f64 {
        let radii = self.bodies.iter().map(|body| body.radius);
        radii.fold(0.0, f64::max)
    }

    /// Mean spacing of the balls, the edge of a cube as large as each one's share of the domain \[length\].
    pub fn spacing(&self) -> f64 {
        let count = self.positions.len().max(1);
        (self.domain.volume() / count as f64).cbrt()
    }
}

/// What all balls that move have together.
#[derive(Clone, Copy, Debug)]
pub struct Totals {
    periodic: bool,
    /// How many they are.
    pub moving: u64,
    mass: f64,
    /// Their kinetic energy.
    pub kinetic_energy: f64,
    /// Their momentum.
    pub momentum: DVec3,
    /// Sum of the magnitudes of their momenta.
    pub momentum_scale: f64,
    /// `sum of m r . v`: the virial ledger's level.
    pub radial_momentum: f64,
}

impl Totals {
    /// `k T`: a third of twice the kinetic energy per ball that moves; `None` if none does.
    ///
    /// In a periodic box the motion of the centre of mass is left out, and its three degrees of freedom with it.
    pub fn thermal_energy(&self) -> Option<f64> {
        let moving = self.moving as f64;
        let (energy, freedom) = if self.periodic {
            let of_center = 0.5 * self.momentum.length_squared() / self.mass;
            (self.kinetic_energy - of_center, 3.0 * (moving - 1.0))
        } else {
            (self.kinetic_energy, 3.0 * moving)
        };
        (freedom > 0.0).then(|| 2.0 * energy / freedom)
    }

    /// Velocity of the centre of mass in a periodic box, where nothing stops it; elsewhere zero.
    pub fn drift(&self) -> DVec3 {
        if self.periodic && self.mass > 0.0 {
            self.momentum / self.mass
        } else {
            DVec3::ZERO
        }
    }
}

/// The gas.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// What one internal unit is in the scene's units.
    pub units: UnitScale,
    /// Where the balls live, centred on the origin.
    pub domain: Domain,
    /// The domain's centre in the scene's coordinates \[scene length\].
    pub center: DVec3,
    /// Radii and masses.
    pub bodies: Bodies,
    /// Every ball's flight.
    pub trajectories: Vec<Trajectory>,
    /// Collisions of each ball so far, with balls, walls and planes.
    pub collisions: Vec<u64>,
    /// In a periodic box: how many boxes each ball has moved on, along each axis. Else empty.
    pub images: Vec<IVec3>,
    /// Where there are planes: for each ball in turn and each plane, whether the ball is on the side the normal points to.
    pub sides: Vec<bool>,
    /// The present.
    pub now: Time,
}

impl State {
    /// The gas at time zero, as placed.
    pub fn new(placement: &Placement) -> Self {
        let units = UnitScale::of(placement);
        let body = |body: &Body| Body {
            radius: body.radius / units.length,
            mass: body.mass / units.mass,
        };
        let flight = |(&position, &velocity): (&DVec3, &DVec3)| Trajectory {
            position: (position - placement.center) / units.length,
            velocity: velocity / units.velocity(),
            begin: Time::default(),
        };
        let domain = placement.domain.scaled(1.0 / units.length);
        let trajectories: Vec<_> = placement
            .positions
            .iter()
            .zip(&placement.velocities)
            .map(flight)
            .collect();
        let side = |ball: &Trajectory| {
            domain
                .planes
                .iter()
                .map(|plane| plane.distance(ball.position) > 0.0)
                .collect::<Vec<_>>()
        };
        Self {
            units,
            center: placement.center,
            bodies: Bodies {
                kinds: placement.bodies.iter().map(body).collect(),
                kind_of: placement.body_of.clone(),
            },
            collisions: vec![0; trajectories.len()],
            images: if domain.boundary == Boundary::Periodic {
                vec![IVec3::ZERO; trajectories.len()]
            } else {
                Vec::new()
            },
            sides: if domain.planes.is_empty() {
                Vec::new()
            } else {
                trajectories.iter().flat_map(side).collect()
            },
            domain,
            trajectories,
            now: Time::default(),
        }
    }

    /// All balls at the present, in the scene's units; in a periodic box, inside it.
    pub fn placement(&self) -> Placement {
        let units = self.units;
        let body = |body: &Body| Body {
            radius: body.radius * units.length,
            mass: body.mass * units.mass,
        };
        Placement {
            domain: self.domain.scaled(units.length),
            center: self.center,
            bodies: self.bodies.kinds.iter().map(body).collect(),
            body_of: self.bodies.kind_of.clone(),
            positions: self
                .trajectories
                .iter()
                .map(|t| t.position_at(self.now) * units.length + self.center)
                .collect(),
            velocities: self
                .trajectories
                .iter()
                .map(|t| t.velocity * units.velocity())
                .collect(),
        }
    }

    /// Where a ball is at the present, counting the boxes it has moved on, so that displacements are true \[length\].
    pub fn unwrapped_position(&self, ball: usize) -> DVec3 {
        let position = self.trajectories[ball].position_at(self.now);
        let image = self.images.get(ball).copied().unwrap_or_default();
        position + image.as_dvec3() * self.domain.period()
    }

    /// Whether every part speaks of the same balls.
    pub fn is_consistent(&self) -> bool {
        let count = self.ball_count();
        let Bodies { kinds, kind_of } = &self.bodies;
        let images = if self.domain.boundary == Boundary::Periodic {
            count
        } else {
            0
        };
        self.collisions.len() == count
            && (count == 0 || !kinds.is_empty())
            && (kind_of.is_empty() || kind_of.len() == count)
            && kind_of.iter().all(|&kind| (kind as usize) < kinds.len())
            && self.images.len() == images
            && self.sides.len() == count * self.domain.planes.len()
    }

    /// Number of balls.
    pub fn ball_count(&self) -> usize {
        self.trajectories.len()
    }

    /// Negates all velocities at the present.
    pub fn reverse(&mut self) {
        for trajectory in &mut self.trajectories {
            *trajectory = trajectory.synchronized(self.now);
            trajectory.velocity = -trajectory.velocity;
        }
    }

    /// What the balls that move have together, at the present. Reads every ball.
    pub fn totals(&self) -> Totals {
        let (mut moving, mut mass, mut momentum) = (0, 0.0, DVec3::ZERO);
        let [mut energy, mut scale, mut radial] = [Sum::default(); 3];
        for (ball, flight) in self.trajectories.iter().enumerate() {
            let of_ball = self.bodies.of(ball).mass;
            if !of_ball.is_finite() {
                continue;
            }
            let (position, velocity) = (flight.position_at(self.now), flight.velocity);
            moving += 1;
            mass += of_ball;
            momentum += velocity * of_ball;
            energy.add(0.5 * of_ball * velocity.length_squared());
            scale.add(of_ball * velocity.length());
            radial.add(of_ball * position.dot(velocity));
        }
        Totals {
            periodic: self.domain.boundary == Boundary::Periodic,
            moving,
            mass,
            kinetic_energy: energy.value(),
            momentum,
            momentum_scale: scale.value(),
            radial_momentum: radial.value(),
        }
    }

    /// A 64-bit hash of the present: time, and every ball's position, image and velocity at that time, bit for bit.
    ///
    /// Source: FNV-1a (Fowler, Noll, Vo; RFC 9923), on words instead of bytes and with a rotation.
    pub fn hash(&self) -> u64 {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut add =
            |word: u64| hash = (hash ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
        add(self.now.epoch);
        add(self.now.local.to_bits());
        for trajectory in &self.trajectories {
            for vector in [trajectory.position_at(self.now), trajectory.velocity] {
                vector
                    .to_array()
                    .iter()
                    .for_each(|value| add(value.to_bits()));
            }
        }
        for image in &self.images {
            image
                .to_array()
                .iter()
                .for_each(|&boxes| add(u64::from(boxes.cast_unsigned())));
        }
        hash
    }
}
