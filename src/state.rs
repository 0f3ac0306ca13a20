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

/// Radius and mass of a ball, in internal units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Radius \[length\].
    pub radius: f64,
    /// Mass \[mass\].
    pub mass: f64,
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
