//! What the loop must reckon with: looked up in the scene, or left out of the loop when it is compiled.
//!
//! Every choice gives the same collisions, bit for bit, as [`General`]; it only skips questions whose answer is known.

use crate::domain::{AnyBoundary, Boundary, Domain, KnownBoundary, Plane, Walls, Wrapped};
use crate::state::{Bodies, Body, State};

/// What the loop asks about its scene again and again.
pub trait Needs: KnownBoundary + Copy + Send {
    /// Whether all balls are known to be alike.
    const ALIKE: bool;

    /// Radius and mass of a ball.
    fn body(bodies: &Bodies, ball: usize) -> Body;

    /// The planes.
    fn planes(domain: &Domain) -> &[Plane];

    /// Whether two balls can collide.
    fn interacting(in_scene: bool) -> bool;
}

/// Any scene.
pub type General = AnyBoundary;

/// What most gases need: balls that are all alike and do collide, in a box without planes.
pub trait Plain: KnownBoundary + Copy + Send {}

impl Plain for Walls {}
impl Plain for Wrapped {}

impl Needs for General {
    const ALIKE: bool = false;

    #[inline(always)]
    fn body(bodies: &Bodies, ball: usize) -> Body {
        bodies.of(ball)
    }

    #[inline(always)]
    fn planes(domain: &Domain) -> &[Plane] {
        &domain.planes
    }

    #[inline(always)]
    fn interacting(in_scene: bool) -> bool {
        in_scene
    }
}

impl<P: Plain> Needs for P {
    const ALIKE: bool = true;

    #[inline(always)]
    fn body(bodies: &Bodies, _ball: usize) -> Body {
        bodies.kinds()[0]
    }

    #[inline(always)]
    fn planes(_domain: &Domain) -> &[Plane] {
        &[]
    }

    #[inline(always)]
    fn interacting(_in_scene: bool) -> bool {
        true
    }
}

/// The boundary of a scene that a [`Plain`] loop can run; `None` for one that needs [`General`].
pub fn plain(state: &State) -> Option<Boundary> {
    let alike = state.bodies.uniform().is_some_and(|body| body.radius > 0.0);
    let plain = alike && state.ball_count() > 1 && state.domain.planes.is_empty();
    plain.then_some(state.domain.boundary)
}
