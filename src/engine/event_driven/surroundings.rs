//! What a ball asks of its surroundings: whom it may meet, and for how long that answer is good.

use prefetch_index::prefetch_index;

use crate::cell_list::CellList;
use crate::domain::Boundary;
use crate::engine::event_driven::needs::Needs;
use crate::engine::event_driven::search::{Candidate, Search};
use crate::event::Wall;
use crate::state::State;

/// Knows for each ball whom it may meet until it next crosses something.
///
/// What always holds: two balls that touch know of each other.
pub trait Surroundings<N: Needs>: Clone + Send {
    /// Forgets all balls.
    fn clear(&mut self, state: &State);

    /// Adds the next ball, which gets the next index.
    fn push(&mut self, state: &State, ball: usize);

    /// When a flying ball crosses into what it does not know yet, in epochs since its flight began, and along which axis.
    fn crossing(&self, state: &State, ball: usize) -> Option<(f64, usize)>;

    /// Whether a ball may meet a face of the box before its next crossing, if it flies towards it.
    fn may_reach(&self, state: &State, ball: usize, face: Wall) -> bool;

    /// A ball crosses, now: it learns whom it may meet from here on, and takes the earliest collision with those it did not
    /// know.
    fn cross(&mut self, state: &State, ball: usize, axis: usize, best: &mut Candidate);

    /// A ball has changed its course.
    fn turn(&mut self, state: &State, ball: usize);

    /// A ball has been moved by a whole box.
    fn wrap(&mut self, state: &State, ball: usize);

    /// Asks for the memory of what is known of a ball.
    fn prefetch(&self, ball: usize);

    /// Asks for the memory of where a ball will look when it crosses along `axis` or, without one, turns; what is known of it should
    /// be at hand.
    fn prefetch_places(&self, state: &State, ball: usize, axis: Option<usize>);

    /// Asks for the memory of everyone that a ball will look at then; where it looks should be at hand.
    fn prefetch_known(&self, state: &State, ball: usize, axis: Option<usize>);

    /// The earliest collision with anyone a ball knows.
    fn look(&self, state: &State, ball: usize) -> Candidate;
}

impl<N: Needs> Surroundings<N> for CellList<N> {
    fn clear(&mut self, state: &State) {
        *self = Self::new(&state.domain, self.width(), state.ball_count());
    }

    fn push(&mut self, state: &State, ball: usize) {
        let position = state.trajectories[ball].position_at(state.now);
        self.push(position, N::body(&state.bodies, ball).radius);
    }

    #[inline]
    fn crossing(&self, state: &State, ball: usize) -> Option<(f64, usize)> {
        let trajectory = &state.trajectories[ball];
        let radius = N::body(&state.bodies, ball).radius;
        let mut first = (f64::INFINITY, 0);
        for axis in 0..3 {
            if let Some(flight) = self.crossing(ball, trajectory, radius, axis)
                && flight < first.0
            {
                first = (flight, axis);
            }
        }
        (first.0 < f64::INFINITY).then_some(first)
    }

    #[inline]
    fn may_reach(&self, state: &State, ball: usize, face: Wall) -> bool {
        N::of(state.domain.boundary) == Boundary::Periodic || self.is_outermost(ball, face)
    }

    #[inline]
    fn cross(&mut self, state: &State, ball: usize, axis: usize, best: &mut Candidate) {
        let trajectory = state.trajectories[ball];
        let place = (trajectory.position_at(state.now), trajectory.velocity);
        let radius = N::body(&state.bodies, ball).radius;
        let mut search = Search::new(state, ball, best);
        self.cross(ball, place, radius, axis, |cells, company| {
            search.add(cells, company);
        });
        search.look();
    }

    #[inline]
    fn turn(&mut self, state: &State, ball: usize) {
        let radius = N::body(&state.bodies, ball).radius;
        self.relocate(ball, state.trajectories[ball].position, radius);
    }

    #[inline]
    fn wrap(&mut self, state: &State, ball: usize) {
        self.turn(state, ball);
    }

    #[inline]
    fn prefetch(&self, ball: usize) {
        self.prefetch_range(ball);
    }

    #[inline]
    fn prefetch_places(&self, state: &State, ball: usize, axis: Option<usize>) {
        let velocity = state.trajectories[ball].velocity;
        self.prefetch_cells(ball, axis.map(|axis| (axis, velocity[axis])));
    }

    #[inline]
    fn prefetch_known(&self, state: &State, ball: usize, axis: Option<usize>) {
        let velocity = state.trajectories[ball].velocity;
        let crossing = axis.map(|axis| (axis, velocity[axis]));
        self.for_each_company_ahead(ball, crossing, |company| {
            for &other in company.balls {
                prefetch_index(&state.trajectories, other as usize);
            }
        });
    }

    #[inline]
    fn look(&self, state: &State, ball: usize) -> Candidate {
        let mut best = Candidate::NONE;
        let mut search = Search::new(state, ball, &mut best);
        self.for_each_company(ball, |company| search.add(self, company));
        search.look();
        best
    }
}
