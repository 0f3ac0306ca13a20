//! The state of a gas: trajectories, in internal units that are the scene's times powers of two.
//!
//! A ball *is* a trajectory: its position at its own last collision, its velocity since, and the time of that collision.
//! Nothing else is state; cells and calendars are derived from it.
//!
//! Internal units: positions are relative to the centre of the domain; the unit of length is the power of two at or below the
//! largest half size, the unit of time is one epoch, the unit of mass the power of two at or below the largest mass. Scaling by a
//! power of two is exact, so a scene and its scaled twin run bit for bit alike (tested).

use glam::DVec3;

use crate::domain::Domain;
use crate::sum::Sum;

/// Added to a local time and taken away again, it leaves a multiple of 2^-49: f64 numbers in `[8, 16)` have that spacing.
const ROUND_TO_GRID: f64 = 12.0;

/// Epochs that an internal unit of length takes at the root mean square speed, at least. With 8, the step of the time grid
/// moves a ball by at most the spacing of f64 coordinates near the walls, so time adds no error that space does not have.
const EPOCHS_PER_CROSSING: f64 = 8.0;

/// An instant: whole epochs plus a local time in `[0, 1)` epochs, a multiple of 2^-49.
///
/// The smallest step stays the same however long a run lasts (an f64 second would coarsen), and moving to another epoch
/// is exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Time {
    /// Whole epochs.
    pub epoch: u64,
    /// Rest, in `[0, 1)` epochs.
    pub local: f64,
}

impl Time {
    /// The instant `duration` epochs later, rounded to the grid; `None` where that is too far away to matter (2^52 epochs).
    ///
    /// `duration` must not be negative. Monotone: a longer duration never gives an earlier instant.
    #[inline]
    pub fn after(self, duration: f64) -> Option<Self> {
        const FAR: f64 = (1_u64 << 52) as f64;
        let local = (self.local + duration + ROUND_TO_GRID) - ROUND_TO_GRID;
        (local < FAR).then(|| {
            let whole = local as u64;
            Self {
                epoch: self.epoch + whole,
                local: local - whole as f64,
            }
        })
    }

    /// Epochs from `earlier` to `self`; negative if `self` is the earlier one.
    #[inline]
    pub fn since(self, earlier: Self) -> f64 {
        self.epoch.wrapping_sub(earlier.epoch).cast_signed() as f64 + (self.local - earlier.local)
    }

    /// Epochs from the beginning of epoch `base`; exact up to 16 epochs.
    #[inline]
    pub fn relative_to(self, base: u64) -> f64 {
        self.since(Self {
            epoch: base,
            local: 0.0,
        })
    }
}

/// Radius and mass of a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Radius \[length\].
    pub radius: f64,
    /// Mass \[mass\].
    pub mass: f64,
}

/// Radius and mass of every ball; kept once if all are alike.
#[derive(Clone, Debug, PartialEq)]
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

    /// The one body that all balls share, if they do.
    pub fn uniform(&self) -> Option<Body> {
        (self.kind_of.is_empty()).then(|| self.kinds[0])
    }

    /// Largest radius \[length\].
    pub fn largest_radius(&self) -> f64 {
        self.kinds
            .iter()
            .fold(0.0, |largest, body| largest.max(body.radius))
    }
}

/// A ball in free flight. One cache line.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// Powers of two that turn internal units into the scene's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitScale {
    /// Scene length of one internal length.
    pub length: f64,
    /// Scene time of one epoch.
    pub time: f64,
    /// Scene mass of one internal mass.
    pub mass: f64,
}

impl UnitScale {
    /// The units that put the largest coordinate into `[1, 2)` and the root mean square speed at or below 1/8.
    fn of(placement: &Placement) -> Self {
        let length = power_of_two_below(placement.domain.half_size().max_element());
        let mass = power_of_two_below(
            placement
                .bodies
                .iter()
                .fold(0.0, |largest, body| largest.max(body.mass)),
        );
        let speed = root_mean_square_speed(&placement.velocities);
        // A gas at rest has no time scale of its own.
        let time = if speed > 0.0 {
            power_of_two_below(length / speed) / EPOCHS_PER_CROSSING
        } else {
            1.0
        };
        Self { length, time, mass }
    }

    /// Scene velocity of one internal velocity.
    pub fn velocity(&self) -> f64 {
        self.length / self.time
    }

    /// Scene energy of one internal energy.
    pub fn energy(&self) -> f64 {
        self.mass * self.velocity() * self.velocity()
    }

    /// Scene pressure of one internal pressure.
    pub fn pressure(&self) -> f64 {
        self.energy() / self.length / self.length / self.length
    }

    /// The instant at scene time `time` after the start.
    ///
    /// Times beyond 2^52 epochs are cut there: no run gets that far.
    pub fn instant(&self, time: f64) -> Time {
        const FAR: Time = Time {
            epoch: 1 << 52,
            local: 0.0,
        };
        Time::default()
            .after((time / self.time).max(0.0))
            .unwrap_or(FAR)
    }

    /// Scene time between the start and an instant.
    pub fn scene_time(&self, time: Time) -> f64 {
        (time.epoch as f64 + time.local) * self.time
    }
}

/// Balls as a scene gives them, all at one instant, in the scene's units.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// Where the balls live.
    pub domain: Domain,
    /// The domain's centre \[length\]; positions are in the scene's coordinates, not relative to it.
    pub center: DVec3,
    /// The different radii and masses.
    pub bodies: Vec<Body>,
    /// Index into `bodies` for each ball; empty when there is only one body.
    pub body_of: Vec<u32>,
    /// Positions \[length\].
    pub positions: Vec<DVec3>,
    /// Velocities \[length per time\].
    pub velocities: Vec<DVec3>,
}

/// The gas.
#[derive(Clone, Debug, PartialEq)]
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
    /// Collisions of each ball so far, with balls and walls.
    pub collisions: Vec<u64>,
    /// The present.
    pub now: Time,
}

impl State {
    /// The gas at time zero, as placed.
    pub fn new(placement: &Placement) -> Self {
        let units = UnitScale::of(placement);
        let Domain::Container { half_size } = placement.domain;
        let body = |body: &Body| Body {
            radius: body.radius / units.length,
            mass: body.mass / units.mass,
        };
        let flight = |(&position, &velocity): (&DVec3, &DVec3)| Trajectory {
            position: (position - placement.center) / units.length,
            velocity: velocity / units.velocity(),
            begin: Time::default(),
        };
        Self {
            units,
            domain: Domain::Container {
                half_size: half_size / units.length,
            },
            center: placement.center,
            bodies: Bodies {
                kinds: placement.bodies.iter().map(body).collect(),
                kind_of: placement.body_of.clone(),
            },
            trajectories: placement
                .positions
                .iter()
                .zip(&placement.velocities)
                .map(flight)
                .collect(),
            collisions: vec![0; placement.positions.len()],
            now: Time::default(),
        }
    }

    /// All balls at the present, in the scene's units.
    pub fn placement(&self) -> Placement {
        let Domain::Container { half_size } = self.domain;
        let units = self.units;
        let body = |body: &Body| Body {
            radius: body.radius * units.length,
            mass: body.mass * units.mass,
        };
        Placement {
            domain: Domain::Container {
                half_size: half_size * units.length,
            },
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

    /// Kinetic energy of all balls.
    pub fn kinetic_energy(&self) -> f64 {
        let energy = |ball: usize| {
            0.5 * self.bodies.of(ball).mass * self.trajectories[ball].velocity.length_squared()
        };
        (0..self.ball_count()).map(energy).collect::<Sum>().value()
    }

    /// Momentum of all balls.
    pub fn momentum(&self) -> DVec3 {
        (0..self.ball_count())
            .map(|ball| self.trajectories[ball].velocity * self.bodies.of(ball).mass)
            .sum()
    }

    /// `sum of m r . v` at the present: the virial ledger's level.
    pub fn radial_momentum(&self) -> f64 {
        let radial = |ball: usize| {
            let trajectory = &self.trajectories[ball];
            self.bodies.of(ball).mass * trajectory.position_at(self.now).dot(trajectory.velocity)
        };
        (0..self.ball_count()).map(radial).collect::<Sum>().value()
    }

    /// A 64-bit hash of the present: time, and every ball's position and velocity at that time, bit for bit.
    ///
    /// Source: FNV-1a (Fowler, Noll, Vo; RFC 9923), on words instead of bytes.
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
        hash
    }
}

/// The largest power of two that is not above `value`, which must be positive and normal.
fn power_of_two_below(value: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    f64::from_bits(value.to_bits() & EXPONENT)
}

/// Root mean square of the speeds, without overflow or underflow of the squares.
fn root_mean_square_speed(velocities: &[DVec3]) -> f64 {
    let largest = velocities.iter().fold(0.0_f64, |largest, velocity| {
        largest.max(velocity.abs().max_element())
    });
    if largest < f64::MIN_POSITIVE {
        return 0.0;
    }
    let scale = power_of_two_below(largest);
    let sum: f64 = velocities
        .iter()
        .map(|velocity| (*velocity / scale).length_squared())
        .sum();
    scale * (sum / velocities.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn later_instants_are_on_the_grid_and_in_order() {
        let start = Time {
            epoch: 3,
            local: 0.75,
        };
        assert_eq!(
            start.after(0.5),
            Some(Time {
                epoch: 4,
                local: 0.25
            })
        );
        let mut last = start;
        for step in 0..1000 {
            let next = start
                .after(f64::from(step) * 0.001_234_567_89)
                .expect("near");
            assert!(next >= last);
            assert_eq!((next.local * 2.0_f64.powi(49)).fract(), 0.0);
            last = next;
        }
    }

    #[test]
    fn an_instant_beyond_reach_is_none() {
        assert_eq!(Time::default().after(f64::INFINITY), None);
        assert_eq!(Time::default().after(1e300), None);
    }

    #[test]
    fn differences_are_exact_at_any_epoch() {
        let tick = 2.0_f64.powi(-49);
        let early = Time {
            epoch: 1 << 40,
            local: tick,
        };
        let late = Time {
            epoch: (1 << 40) + 2,
            local: 3.0 * tick,
        };
        assert_eq!(late.since(early), 2.0 + 2.0 * tick);
        assert_eq!(early.since(late), -2.0 - 2.0 * tick);
    }

    #[test]
    fn powers_of_two_are_found_below() {
        assert_eq!(power_of_two_below(6.75), 4.0);
        assert_eq!(power_of_two_below(0.3), 0.25);
        assert_eq!(
            power_of_two_below(2.0_f64.powi(-500) * 1.5),
            2.0_f64.powi(-500)
        );
    }
}
