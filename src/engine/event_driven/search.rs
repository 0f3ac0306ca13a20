//! A ball's search for its next partner among the balls near it.

use std::marker::PhantomData;

use glam::DVec3;
use prefetch_index::prefetch_index;

use super::needs::Needs;
use super::sieve::{AT_ONCE, Sight, sift};
use crate::cell_list::{Cell, CellList, Company};
use crate::collision::{contact_time, image_pair_time, may_meet, separation_at_later_begin};
use crate::engine::image::{image_of, number_of, steps_of};
use crate::state::{Bodies, State, Time, Trajectory};

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

    /// When it comes, if it does.
    #[inline(always)]
    fn known(&self) -> Option<Time> {
        (self.partner != u32::MAX).then_some(self.time)
    }

    /// The way from the ball to the image that meets its partner \[length\].
    pub fn shift(&self, period: DVec3) -> DVec3 {
        DVec3::from_array(self.image.map(f64::from)) * period
    }
}

/// A ball that looks for its earliest collision with the others in some cells.
///
/// It first writes down who they are, and then looks at many at a time: while it writes, the memory of their flights comes.
pub struct Search<'a, N> {
    state: &'a State,
    ball: usize,
    others: [u32; AT_ONCE],
    count: usize,
    best: &'a mut Candidate,
    needs: PhantomData<N>,
}

impl<'a, N: Needs> Search<'a, N> {
    /// To improve a ball's candidate.
    #[inline(always)]
    pub fn new(state: &'a State, ball: usize, best: &'a mut Candidate) -> Self {
        Self {
            state,
            ball,
            others: [0; AT_ONCE],
            count: 0,
            best,
            needs: PhantomData,
        }
    }

    /// Also among the company in one of the cells.
    #[inline(always)]
    pub fn add(&mut self, cells: &CellList<N>, company: Company) {
        if let Some(cell) = company.at_face {
            return look_at_images(self.state, cells, self.ball, company.balls, cell, self.best);
        }
        // No face of a periodic box passes this cell.
        let mut balls = company.balls;
        while self.count + balls.len() > AT_ONCE {
            let (first, rest) = balls.split_at(AT_ONCE - self.count);
            self.write_down(first);
            self.look();
            balls = rest;
        }
        self.write_down(balls);
    }

    #[inline(always)]
    fn write_down(&mut self, balls: &[u32]) {
        let flights = &self.state.trajectories[..];
        for (place, &other) in self.others[self.count..].iter_mut().zip(balls) {
            *place = other;
            prefetch_index(flights, other as usize);
        }
        self.count += balls.len();
    }

    /// Looks at those that have been added.
    #[inline]
    pub fn look(&mut self) {
        let others = &self.others[..self.count];
        let here = Here::<N>::of(self.state, self.ball);
        look_at(self.state, self.ball, others, &here, self.best);
        self.count = 0;
    }
}

/// A ball's view of others that are where they are.
struct Here<'a, N> {
    flights: &'a [Trajectory],
    bodies: &'a Bodies,
    radius: f64,
    needs: PhantomData<N>,
}

impl<'a, N: Needs> Here<'a, N> {
    #[inline(always)]
    fn of(state: &'a State, ball: usize) -> Self {
        Self {
            flights: &state.trajectories,
            bodies: &state.bodies,
            radius: N::body(&state.bodies, ball).radius,
            needs: PhantomData,
        }
    }
}

impl<N: Needs> Sight for Here<'_, N> {
    const AT_IMAGES: bool = false;

    #[inline(always)]
    fn flight(&self, seen: u32) -> &Trajectory {
        &self.flights[seen as usize]
    }

    #[inline(always)]
    fn contact(&self, seen: u32) -> f64 {
        let radius = if N::ALIKE {
            self.radius
        } else {
            N::body(self.bodies, seen as usize).radius
        };
        self.radius + radius
    }

    #[inline(always)]
    fn shift(&self, _seen: u32) -> DVec3 {
        DVec3::ZERO
    }
}

/// Improves a ball's candidate by its collisions with others, each at one image.
#[inline]
pub fn look_at<T: Sight>(
    state: &State,
    ball: usize,
    others: &[u32],
    sight: &T,
    best: &mut Candidate,
) {
    let flight = &state.trajectories[ball];
    let mut possible = [0; AT_ONCE];
    for others in others.chunks(AT_ONCE) {
        let count = sift(flight, others, sight, best.known(), &mut possible);
        for &seen in &possible[..count] {
            let (other, contact) = (sight.flight(seen), sight.contact(seen));
            let (begin, mut separation) = separation_at_later_begin(flight, other);
            let (mut partner, mut image) = (seen, [0; 3]);
            if T::AT_IMAGES {
                separation += sight.shift(seen);
                (partner, image) = (number_of(seen), steps_of(image_of(seen)));
            }
            let velocity = flight.velocity - other.velocity;
            let meeting = contact_time(separation, velocity, contact);
            if let Some(time) = meeting.and_then(|duration| begin.after(duration)) {
                best.improve(ball, partner, time, image);
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
