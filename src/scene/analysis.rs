//! What kinetic theory says of a scene before it runs.

use crate::state::Placement;

/// Volume of the balls over the volume of the domain.
pub fn packing_fraction(placement: &Placement) -> f64 {
    let edges = 2.0 * placement.domain.half_size();
    let share = |radius: f64| {
        4.0 / 3.0
            * std::f64::consts::PI
            * (radius / edges.x)
            * (radius / edges.y)
            * (radius / edges.z)
    };
    match placement.bodies.as_slice() {
        [body] => placement.positions.len() as f64 * share(body.radius),
        bodies => placement
            .body_of
            .iter()
            .map(|&body| share(bodies[body as usize].radius))
            .sum(),
    }
}
