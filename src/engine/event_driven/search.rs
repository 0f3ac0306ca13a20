//! A ball's search for its next partner among the balls near it.

use glam::DVec3;

use crate::cell_list::{Cell, CellList, Company};
use crate::collision::{image_pair_time, may_meet, pair_time, separation_at_later_begin};
use crate::engine::event_driven::needs::Needs;
use crate::engine::image::steps_of;
use crate::state::{State, Time};

/// Balls looked at in one go.
const AT_ONCE: usize = 32;

/// The earliest pair collision that a ball knows of.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// When.
    pub time: Time,
    /// The other ball.
    pub partner: u32,
    /// Boxes by which the ball is moved to meet its partner; zero but across a periodic face.
    pub image: [i8; 3],
}

impl Candidate {
    /// Later than any collision.
    pub const NONE: Self = Self {
        time: Time {
            epoch: u64::MAX,
            local: 0.0,
        },
        partner: u32::MAX,
        image: [0; 3],
    };

    /// Takes the collision of `ball` with `other` instead, if it comes earlier.
    #[inline]
    fn improve(&mut self, ball: usize, other: u32, time: Time, image: [i8; 3]) {
        if time < self.time
            || (time == self.time && pair_precedes(ball as u32, other, self.partner))
        {
            *self = Self {
                time,
                partner: other,
                image,
            };
        }
    }

    /// The way from the ball to the image that meets its partner \[length\].
    pub fn shift(&self, period: DVec3) -> DVec3 {
        DVec3::from_array(self.image.map(f64::from)) * period
    }
}

/// Improves a ball's candidate by its collisions with the others of a cell.
#[inline]
pub fn look<N: Needs>(
    state: &State,
    cells: &CellList<N>,
    ball: usize,
    company: Company,
    best: &mut Candidate,
) {
    if let Some(cell) = company.at_face {
        look_at_images(state, cells, ball, company.balls, cell, best);
    } else {
        // No face of a periodic box passes this cell.
        let see = |other| (other, None);
        look_at::<N>(state, ball, company.balls, see, |_| DVec3::ZERO, best);
    }
}

/// Improves a ball's candidate by its collisions with others, each at one image: `see` gives the other ball and the number of the
/// image by which the looking one meets it, if there are images, and `shift` the way to that.
#[inline(always)]
pub fn look_at<N: Needs>(
    state: &State,
    ball: usize,
    others: &[u32],
    see: impl Fn(u32) -> (u32, Option<usize>),
    shift: impl Fn(usize) -> DVec3,
    best: &mut Candidate,
) {
    let trajectory = &state.trajectories[ball];
    let radius = N::body(&state.bodies, ball).radius;
    let contact = |other: u32| radius + N::body(&state.bodies, other as usize).radius;
    for others in others.chunks(AT_ONCE) {
        // Nobody can foresee which pairs may meet, least of all the processor: so all are looked at without a branch, which
        // also lets it fetch several flights at a time. A ball never may meet itself: it does not approach.
        let mut possible = [0; AT_ONCE];
        let mut count = 0;
        for &seen in others {
            let (other, image) = see(seen);
            let flight = &state.trajectories[other as usize];
            let (_, mut separation) = separation_at_later_begin(trajectory, flight);
            if let Some(image) = image {
                separation += shift(image);
            }
            let velocity = trajectory.velocity - flight.velocity;
            possible[count] = seen;
            count += usize::from(may_meet(separation, velocity, contact(other)));
        }
        for &seen in &possible[..count] {
            let (other, image) = see(seen);
            let flight = &state.trajectories[other as usize];
            let time = match image {
                None => pair_time(trajectory, flight, contact(other)),
                Some(image) => image_pair_time(trajectory, flight, contact(other), shift(image)),
            };
            if let Some(time) = time {
                best.improve(ball, other, time, image.map_or([0; 3], steps_of));
            }
        }
    }
}

/// Looks at the others of a cell at a face of a periodic box, each at every image that the ball may meet.
#[inline(never)]
fn look_at_images<N: Needs>(
    state: &State,
    cells: &CellList<N>,
    ball: usize,
    others: &[u32],
    cell: Cell,
    best: &mut Candidate,
) {
    let trajectory = &state.trajectories[ball];
    let radius = N::body(&state.bodies, ball).radius;
    let contact = |other: u32| radius + N::body(&state.bodies, other as usize).radius;
    let period = state.domain.period();
    for others in others.chunks(AT_ONCE) {
        let mut possible = [0; AT_ONCE];
        let mut count = 0;
        for &other in others {
            let flight = &state.trajectories[other as usize];
            let (_, separation) = separation_at_later_begin(trajectory, flight);
            let velocity = trajectory.velocity - flight.velocity;
            possible[count] = other;
            count += usize::from(match cells.only_image(cell, other) {
                Some(image) => may_meet(
                    separation + image.as_dvec3() * period,
                    velocity,
                    contact(other),
                ),
                None => other as usize != ball,
            });
        }
        for &other in &possible[..count] {
            cells.for_each_image(cell, other, |image| {
                let shift = image.as_dvec3() * period;
                let flight = &state.trajectories[other as usize];
                if let Some(time) = image_pair_time(trajectory, flight, contact(other), shift) {
                    best.improve(ball, other, time, image.to_array().map(|boxes| boxes as i8));
                }
            });
        }
    }
}

/// Whether the pair of `ball` and `other` comes before that of `ball` and `rival` at the same instant.
fn pair_precedes(ball: u32, other: u32, rival: u32) -> bool {
    (ball.min(other), ball.max(other)) < (ball.min(rival), ball.max(rival))
}
