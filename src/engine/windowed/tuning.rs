//! How wide the cells and how long the windows are, and which gases the windowed engine suits.

use std::f64::consts::PI;

use glam::DVec3;

use super::lists::Census;
use super::pieces::MOST_BALLS;
use crate::domain::{Boundary, Domain};
use crate::engine::event_driven;
use crate::state::{Placement, State, Trajectory};

/// Cell width in mean spacings of the balls; measured to be best, and flat around.
const SPACINGS_PER_CELL: f64 = 2.9;

/// Window length in mean times that a ball takes from one cell into the next; measured to be best, and flat around.
const CROSSINGS_PER_WINDOW: f64 = 1.2;

/// Mean number of cell faces that a Maxwellian ball crosses while moving one cell width at the speed `sqrt(k T / m)`:
/// `3 sqrt(2 / pi)`, derived here.
const CROSSINGS_PER_WIDTH: f64 = 2.394;

/// Most collisions of a ball with others in a window, on average; measured to be best, and flat around.
const COLLISIONS_PER_WINDOW: f64 = 0.25;

/// The same in windows in which every ball knows its neighbours, and how many must fit in for that to be the faster way (measured).
const COLLISIONS_AMONG_NEIGHBOURS: [f64; 2] = [0.22, 1.0];

/// Balls of average density in a ball's reach in such a window, itself included; measured to be best, and flat around.
const NEIGHBOURS: f64 = 9.0;

/// How much faster than the fastest ball one may become before such a window must be cut short. Hardly any does: in a gas at rest
/// the fastest of a million is some five times as fast as `sqrt(k T / m)`.
const FASTER: f64 = 1.1;

/// How many times as often as in a gas of even density balls collide that are crowded somewhere: the mean density does not tell how
/// many neighbours these have.
const CROWDED: f64 = 2.0;

/// Largest radius in smallest ones with which a ball cannot have so many neighbours that lists of them do not fit in memory.
const ALIKE: f64 = 2.0;

/// Most of a cell's width to which a ball may reach out of it.
const MOST_REACH: f64 = 0.9;

/// Longest window \[epochs\]: times in it stay exact relative to its first epoch.
const LONGEST_WINDOW: f64 = 4.0;

/// Shortest window \[epochs\]: far above the grid of time.
const SHORTEST_WINDOW: f64 = 1.0 / (1_u64 << 40) as f64;

/// Fewest balls of which this engine is the faster one (measured).
const FEW_BALLS: usize = 200;

/// From which mean spacing in diameters on it is where balls are not [`ALIKE`] enough to know their neighbours (measured).
const DILUTE: f64 = 1.3;

/// Largest radius in smallest ones up to which the filter, which knows the largest only, lets little through in vain.
const SIMILAR_SIZE: f64 = 4.0;

/// Whether the windowed engine can run a gas: a container, perhaps with planes, or a periodic box that is wider than any ball;
/// every ball free to move, some moving.
pub fn supports(gas: &Placement) -> bool {
    is_suitable(&gas.domain, gas.largest_radius())
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

/// Whether the windowed engine is faster than `event` for a gas: enough balls of like size that can meet, far enough apart.
pub fn pays(gas: &Placement) -> bool {
    let count = gas.positions.len();
    let largest = gas.largest_radius();
    let smallest = gas
        .bodies
        .iter()
        .map(|body| body.radius)
        .fold(f64::INFINITY, f64::min);
    largest > 0.0
        && count >= FEW_BALLS
        && largest <= SIMILAR_SIZE * smallest
        && (largest <= ALIKE * smallest || gas.spacing() >= DILUTE * 2.0 * largest)
        && supports(gas)
}

/// Least width of a cell \[length\].
pub fn cell_width(state: &State) -> f64 {
    let spacing = (state.domain.volume() / state.ball_count() as f64).cbrt();
    (SPACINGS_PER_CELL * spacing).max(2.02 * state.bodies.largest_radius())
}

/// How the next windows are to be.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// How long they are \[epochs\].
    pub length: f64,
    /// If every ball is to know its neighbours: how far it may get in one \[length\].
    pub drift: Option<f64>,
}

impl Plan {
    /// With cells of this width, for balls whose velocity has components of this root mean square and of which the fastest is so
    /// fast. `rate` is how often a ball has met another lately, in collisions per epoch.
    pub fn new(
        state: &State,
        cell_width: f64,
        (deviation, fastest): (f64, f64),
        rate: f64,
    ) -> Self {
        let expected = collision_rate(state) * deviation;
        let is_crowd = rate > CROWDED * expected;
        let rate = rate.max(expected);
        let length = |collisions: f64| {
            (transit(cell_width) / deviation)
                .min(collisions / rate)
                .clamp(SHORTEST_WINDOW, LONGEST_WINDOW)
        };
        let [fewest, most] = COLLISIONS_AMONG_NEIGHBOURS;
        let (least, radius) = (
            state.bodies.smallest_radius(),
            state.bodies.largest_radius(),
        );
        let density = state.ball_count() as f64 / state.domain.volume();
        let reach = (0.75 * NEIGHBOURS / PI / density).cbrt();
        let fastest = FASTER * fastest;
        let among_neighbours = length(most).min((0.5 * reach - radius) / fastest);
        let drift = fastest * among_neighbours;
        let pays = !is_crowd
            && among_neighbours >= SHORTEST_WINDOW
            && among_neighbours * rate >= fewest
            && radius <= ALIKE * least
            && radius + drift <= MOST_REACH * cell_width;
        // In a small box a ball could see two images of another, or a cell images on both its sides.
        let fits = match state.domain.boundary {
            Boundary::Periodic => {
                let period = state.domain.period().min_element();
                period >= (2.0 * cell_width).max(4.0 * (radius + drift))
            }
            Boundary::Container | Boundary::Open => true,
        };
        if pays && fits {
            Self {
                length: among_neighbours,
                drift: Some(drift),
            }
        } else {
            Self {
                length: length(COLLISIONS_PER_WINDOW),
                drift: None,
            }
        }
    }
}

/// How far a ball flies in a window as it changes cells of this width: the root mean square of a component.
fn transit(cell_width: f64) -> f64 {
    CROSSINGS_PER_WINDOW * cell_width / CROSSINGS_PER_WIDTH
}

/// How often a ball meets another, for each length that it flies, the root mean square of a component \[1 / length\]: from kinetic
/// theory with the contact value of Carnahan and Starling.
fn collision_rate(state: &State) -> f64 {
    let count = state.ball_count() as f64;
    let volume = state.domain.volume();
    let diameter = 2.0 * state.bodies.mean_radius();
    let packing = (PI / 6.0 * diameter * diameter * diameter * count / volume).min(0.7);
    let contact_value =
        (1.0 - 0.5 * packing) / ((1.0 - packing) * (1.0 - packing) * (1.0 - packing));
    let section = 4.0 * PI.sqrt() * diameter * diameter * contact_value;
    section * count / volume
}

/// What windows took, in counts that do not depend on the number of threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    /// How many they were.
    pub windows: u32,
    /// Who passed which cells.
    pub census: Census,
    /// Flights begun.
    pub turns: u64,
}

/// What the engines' steps cost \[ns\], in a gas that is small enough for the caches.
///
/// Source: measured; what is compared are sums, of which the largest part differs from scene to scene.
mod cost {
    /// Windowed: a ball in a window.
    pub const BALL: f64 = 15.0;
    /// Windowed: a ball in a cell's list.
    pub const PASSAGE: f64 = 6.0;
    /// Windowed: a pair of a list.
    pub const PAIR: f64 = 0.3;
    /// Windowed: a new flight, but for the pairs it makes.
    pub const TURN: f64 = 400.0;
    /// Event: a ball that reaches into a cell, but for the balls it looks at.
    pub const CROSSING: f64 = 150.0;
    /// Event: a new flight, but for the balls it looks at.
    pub const FLIGHT: f64 = 400.0;
    /// Event: a ball that is looked at.
    pub const LOOK: f64 = 2.5;
}

/// How many times as much work as engine `event` windows may take before they do not pay: changing the engine is work too, and
/// the costs are rough.
const MOST_WORK: f64 = 2.0;

impl Work {
    /// Whether the windows paid. `cell_width` is that of their cells, `way` how far balls flew in them in all: the root mean
    /// square of a component.
    pub fn pays(&self, state: &State, cell_width: f64, way: f64) -> bool {
        let Census { passages, pairs } = self.census;
        let (passages, pairs) = (passages as f64, pairs as f64);
        let balls = state.ball_count() as f64 * f64::from(self.windows);
        if balls == 0.0 || passages == 0.0 {
            return true;
        }
        // Cells in which a ball is listed, and its company there.
        let lists = passages / balls;
        let company = 2.0 * pairs / passages;
        let own = cost::BALL * balls
            + cost::PASSAGE * passages
            + cost::PAIR * pairs
            + self.turns as f64 * (cost::TURN + cost::PAIR * lists * company);
        // Balls that are crowded in a corner are found there by counting all: so that is left for the case of doubt.
        let density = company / (lists * cell_width.powi(3));
        own <= MOST_WORK * self.event_cost(state, way, density)
            || own <= MOST_WORK * self.event_cost(state, way, density_around_a_ball(state))
    }

    /// What the same stretch of time would have cost engine `event` \[ns\], with so many balls per volume around a ball.
    fn event_cost(&self, state: &State, way: f64, density: f64) -> f64 {
        let (width, reach) = event_cells(state);
        let company = density * (width * reach).powi(3);
        let crossings = state.ball_count() as f64 * CROSSINGS_PER_WIDTH * way / width;
        crossings * (cost::CROSSING + cost::LOOK * company * reach * reach)
            + self.turns as f64 * (cost::FLIGHT + cost::LOOK * company * reach.powi(3))
    }
}

/// How wide engine `event` makes its cells, and how many times as wide the room is from which balls reach into one.
fn event_cells(state: &State) -> (f64, f64) {
    let radius = state.bodies.mean_radius();
    let width = event_driven::cell_width(state.domain.volume(), state.ball_count(), radius);
    (width, 1.0 + 2.0 * radius / width)
}

/// Balls per volume in the cell of engine `event` in which a ball is, on average over the balls.
fn density_around_a_ball(state: &State) -> f64 {
    let (width, _) = event_cells(state);
    let cell = |trajectory: &Trajectory| {
        let place = (trajectory.position_at(state.now) + state.domain.half_size) / width;
        place.to_array().map(|place| place as i64)
    };
    let mut cells: Vec<[i64; 3]> = state.trajectories.iter().map(cell).collect();
    cells.sort_unstable();
    let crowds = cells.chunk_by(|one, next| one == next);
    let squares: f64 = crowds.map(|crowd| (crowd.len() as f64).powi(2)).sum();
    squares / state.ball_count() as f64 / width.powi(3)
}
