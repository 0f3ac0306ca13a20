//! Where the balls live: a box with hard walls, a periodic box or open space, and planes that bound it further.
//!
//! Lengths are in whatever unit the caller keeps; positions are relative to the domain's centre.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What happens at the faces of the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Boundary {
    /// Six hard walls.
    Container,
    /// A ball whose centre leaves through a face comes in through the opposite one.
    Periodic,
    /// Nothing: the box only says where the balls begin.
    Open,
}

/// A hard plane through the domain; each ball stays on the side where it starts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// Unit vector perpendicular to the plane.
    pub normal: DVec3,
    /// Distance of the plane from the domain's centre along the normal \[length\]; may be negative.
    pub offset: f64,
}

impl Plane {
    /// Distance of a point from the plane, positive on the side that the normal points to \[length\].
    #[inline]
    pub fn distance(&self, position: DVec3) -> f64 {
        self.normal.dot(position) - self.offset
    }
}

/// The region open to the balls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Domain {
    /// What happens at the faces of the box.
    pub boundary: Boundary,
    /// Distance from the centre to the faces along each axis \[length\].
    pub half_size: DVec3,
    /// Planes inside the box.
    pub planes: Vec<Plane>,
}

impl Domain {
    /// A box with hard walls and no planes.
    pub fn container(half_size: DVec3) -> Self {
        Self {
            boundary: Boundary::Container,
            half_size,
            planes: Vec::new(),
        }
    }

    /// The same domain with all lengths multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let plane = |plane: &Plane| Plane {
            offset: plane.offset * factor,
            ..*plane
        };
        Self {
            boundary: self.boundary,
            half_size: self.half_size * factor,
            planes: self.planes.iter().map(plane).collect(),
        }
    }

    /// Volume of the box \[length^3\]; planes cut nothing off.
    pub fn volume(&self) -> f64 {
        let half = self.half_size;
        8.0 * half.x * half.y * half.z
    }

    /// Area of the six faces \[length^2\].
    pub fn wall_area(&self) -> f64 {
        let half = self.half_size;
        8.0 * (half.x * half.y + half.y * half.z + half.z * half.x)
    }

    /// Edges of the box if its images count, else zero: what one step to a neighbouring image adds to a position.
    pub fn period(&self) -> DVec3 {
        if self.boundary == Boundary::Periodic {
            2.0 * self.half_size
        } else {
            DVec3::ZERO
        }
    }
}

/// The boundary as a loop knows it: looked up, or known when the loop is compiled, so that what it does not need is left out.
pub trait KnownBoundary {
    /// The boundary of a scene that has this one.
    fn of(scene: Boundary) -> Boundary;
}

/// Looked up in the scene.
#[derive(Clone, Copy, Debug)]
pub struct AnyBoundary;

/// [`Boundary::Container`].
#[derive(Clone, Copy, Debug)]
pub struct Walls;

/// [`Boundary::Periodic`].
#[derive(Clone, Copy, Debug)]
pub struct Wrapped;

impl KnownBoundary for AnyBoundary {
    #[inline(always)]
    fn of(scene: Boundary) -> Boundary {
        scene
    }
}

impl KnownBoundary for Walls {
    #[inline(always)]
    fn of(_scene: Boundary) -> Boundary {
        Boundary::Container
    }
}

impl KnownBoundary for Wrapped {
    #[inline(always)]
    fn of(_scene: Boundary) -> Boundary {
        Boundary::Periodic
    }
}
