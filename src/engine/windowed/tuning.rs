//! How wide the cells and how long the windows are, and which gases the windowed engine suits.

use glam::DVec3;

use super::pieces::MOST_BALLS;
use crate::domain::{Boundary, Domain};
use crate::state::{Placement, State};

/// Cell width in mean spacings of the balls; measured to be best, and flat around.
const SPACINGS_PER_CELL: f64 = 3.0;

/// Window length in mean times that a ball takes from one cell into the next; measured to be best, and flat around.
const CROSSINGS_PER_WINDOW: f64 = 1.0;

/// Mean number of cell faces that a Maxwellian ball crosses while moving one cell width at the speed `sqrt(k T / m)`:
/// `3 sqrt(2 / pi)`, derived here.
const CROSSINGS_PER_WIDTH: f64 = 2.394;

/// Most pair collisions per ball in a window.
const COLLISIONS_PER_WINDOW: f64 = 0.1;

/// Longest window \[epochs\]: times in it stay exact relative to its first epoch.
const LONGEST_WINDOW: f64 = 4.0;

/// Shortest window \[epochs\]: far above the grid of time.
const SHORTEST_WINDOW: f64 = 1.0 / (1_u64 << 40) as f64;

/// From which numbers of balls, and at which mean spacing in diameters, this engine is the faster one (measured).
const FEW_BALLS: usize = 1000;
const MANY_BALLS: usize = 20_000;
const DILUTE_FEW: f64 = 1.7;
const DILUTE_MANY: f64 = 1.2;

/// Largest radius in smallest ones up to which the filter, which knows the largest only, lets little through in vain.
const SIMILAR_SIZE: f64 = 4.0;

/// Whether the windowed engine can run a gas: a container, perhaps with planes, or a periodic box that is wider than any ball;
/// every ball free to move, some moving.
pub fn supports(gas: &Placement) -> bool {
    is_suitable(&gas.domain, largest_radius(gas))
        && gas.bodies.iter().all(|body| body.mass.is_finite())
        && gas.positions.len() < MOST_BALLS
        && gas
            .velocities
            .iter()
            .any(|&velocity| velocity != DVec3::ZERO)
}

/// Whether the engine can run in a domain balls that are no larger than this.
pub fn is_suitable(domain: &Domain, largest_radius: f64) -> bool {
    match domain.boundary {
        Boundary::Container => true,
        // One layer of places around the cells must hold all that reaches beyond the faces.
        Boundary::Periodic => {
            domain.planes.is_empty() && domain.half_size.min_element() > 1.01 * largest_radius
        }
        Boundary::Open => false,
    }
}

fn largest_radius(gas: &Placement) -> f64 {
    gas.bodies
        .iter()
        .map(|body| body.radius)
        .fold(0.0, f64::max)
}

/// Whether the windowed engine is faster than `event` for a gas: enough balls of like size that can meet, far enough apart.
pub fn pays(gas: &Placement) -> bool {
    let count = gas.positions.len();
    let spacing = (gas.domain.volume() / count as f64).cbrt();
    let largest = largest_radius(gas);
    let smallest = gas
        .bodies
        .iter()
        .map(|body| body.radius)
        .fold(f64::INFINITY, f64::min);
    let dilute = if count >= MANY_BALLS {
        DILUTE_MANY
    } else {
        DILUTE_FEW
    };
    largest > 0.0
        && count >= FEW_BALLS
        && largest <= SIMILAR_SIZE * smallest
        && spacing >= dilute * 2.0 * largest
        && supports(gas)
}

/// Least width of a cell \[length\].
pub fn cell_width(state: &State) -> f64 {
    let spacing = (state.domain.volume() / state.ball_count() as f64).cbrt();
    (SPACINGS_PER_CELL * spacing).max(2.02 * state.bodies.largest_radius())
}

/// Length of a window \[epochs\], with cells of this width, for balls whose velocity has components of this root mean square.
/// `rate` is how often a ball has met another lately, in collisions per epoch.
pub fn window_length(state: &State, cell_width: f64, deviation: f64, rate: f64) -> f64 {
    let count = state.ball_count() as f64;
    let volume = state.domain.volume();
    let diameter = 2.0 * state.bodies.mean_radius();
    // Pair collisions per ball and time, from kinetic theory with the contact value of Carnahan and Starling.
    let packing =
        (std::f64::consts::PI / 6.0 * diameter * diameter * diameter * count / volume).min(0.7);
    let contact_value =
        (1.0 - 0.5 * packing) / ((1.0 - packing) * (1.0 - packing) * (1.0 - packing));
    let section = 2.0 * std::f64::consts::PI.sqrt() * diameter * diameter * contact_value;
    let expected_rate = section * count / volume * deviation;
    let transit = CROSSINGS_PER_WINDOW * cell_width / (CROSSINGS_PER_WIDTH * deviation);
    transit
        .min(COLLISIONS_PER_WINDOW / expected_rate.max(rate))
        .clamp(SHORTEST_WINDOW, LONGEST_WINDOW)
}
