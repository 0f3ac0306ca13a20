//! A ball's path through a window: straight pieces between its meetings with what bounds the domain, and the cells each of
//! them passes.

use glam::DVec3;

use super::grid::Grid;
use super::meeting::{AT_BOUNDARY, Bound, Meeting};
use super::pieces::{Id, Line, NONE, Numbering};
use super::touch::Offsets;
use crate::collision::{image_pair_time, pair_time, plane_time, wall_time};
use crate::domain::Boundary;
use crate::engine::contact;
use crate::event::{Collision, Wall};
use crate::state::{Body, State, Time, Trajectory};

/// A window of time, ends included.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// When it begins.
    pub begin: Time,
    /// When it ends.
    pub end: Time,
}

impl Window {
    /// The instant that lies `time` epochs after the beginning of the window's first epoch.
    #[inline]
    pub fn instant(self, time: f64) -> Time {
        let whole = time as u64;
        Time {
            epoch: self.begin.epoch + whole,
            local: time - whole as f64,
        }
    }

    /// Its begin and end, in epochs from its first epoch.
    pub fn span(self) -> (f64, f64) {
        let base = self.begin.epoch;
        (self.begin.relative_to(base), self.end.relative_to(base))
    }
}

/// What all threads read.
#[derive(Clone, Copy)]
pub struct Gas<'a> {
    /// The exact flights, bodies and domain.
    pub state: &'a State,
    /// The cells.
    pub grid: &'a Grid,
    /// How pieces are numbered.
    pub numbering: Numbering,
    /// The window.
    pub window: Window,
    /// Windows per epoch.
    pub per_epoch: f64,
    /// Grid lengths per window for a length per epoch.
    pub speed_scale: f64,
    /// Where the cells are that a path touches.
    pub offsets: &'a Offsets,
    /// By how much a line's position may be wrong, with a margin, in grid lengths.
    pub slack: f64,
    /// In windows in which every ball knows its neighbours: how far it may get in one, in grid lengths.
    pub drift: Option<f64>,
}

impl Gas<'_> {
    /// Whether the domain is a periodic box.
    #[inline]
    pub fn is_periodic(&self) -> bool {
        self.state.domain.boundary == Boundary::Periodic
    }

    /// A ball's radius and mass.
    #[inline]
    pub fn body(&self, ball: u32) -> Body {
        self.state.bodies.of(ball as usize)
    }

    /// A flight as the filter sees it.
    #[inline]
    pub fn line(&self, trajectory: &Trajectory, ball: u32) -> Line {
        let start = trajectory.position_at(self.window.begin);
        let velocity = trajectory.velocity * self.speed_scale;
        Line::new(self.grid.to_grid(start), velocity, ball)
    }

    /// Another piece as the filter sees it.
    #[inline]
    pub fn piece_line(&self, trajectory: &Trajectory, ball: u32) -> Line {
        let begin = trajectory.begin.since(self.window.begin) * self.per_epoch;
        self.line(trajectory, ball).beginning(begin)
    }

    /// For each axis the least coordinate, as a line has it, of the flights for which a cell is the first along that axis: of the cells
    /// in which they are listed as far around as they may get. With a margin, downwards.
    #[inline]
    pub fn firsts(&self, cell: usize) -> [f32; 3] {
        let center = self.grid.center(cell);
        let reach = self.state.bodies.largest_radius() * self.grid.scale
            + self.drift.unwrap_or(0.0)
            - self.slack;
        std::array::from_fn(|axis| {
            let edge = self.grid.edges[axis];
            let lower = center[axis] - 0.5 * edge;
            if lower < 0.5 * edge && !self.is_periodic() {
                // Nothing is listed beyond a wall.
                f32::NEG_INFINITY
            } else {
                lower + reach as f32
            }
        })
    }

    /// What so many steps by whole boxes add to a position.
    #[inline]
    pub fn shift_by(&self, image: [i8; 3]) -> DVec3 {
        DVec3::from_array(image.map(f64::from)) * self.state.domain.period()
    }

    /// When two flights meet that are so far apart at contact, if they do in the window; the first one as it is when moved to an image
    /// by a shift.
    #[inline(always)]
    pub fn pair_time(
        &self,
        pair: &[Trajectory; 2],
        contact: f64,
        (image, shift): ([i8; 3], DVec3),
    ) -> Option<Time> {
        let [first, second] = pair;
        let time = if image == [0; 3] {
            pair_time(first, second, contact)
        } else {
            image_pair_time(first, second, contact, shift)
        };
        time.filter(|&time| time <= self.window.end)
    }

    /// How far a ball's centre gets along an axis, without sign.
    #[inline]
    fn limit(&self, axis: usize, body: Body) -> f64 {
        let half_size = self.state.domain.half_size[axis];
        if self.is_periodic() {
            half_size
        } else {
            half_size - body.radius
        }
    }

    /// What bounds the domain where a flight gets there first in the window, and when.
    #[inline(always)]
    pub fn next_bound(
        &self,
        trajectory: &Trajectory,
        ball: u32,
        body: Body,
    ) -> Option<(Time, Bound)> {
        let domain = &self.state.domain;
        let slack = super::grid::SLACK * self.grid.width().min_element();
        let end = trajectory.position_at(self.window.end);
        let mut first: Option<(Time, Bound)> = None;
        let mut offer = |time: Option<Time>, bound: Bound| {
            if let Some(time) = time
                && time <= self.window.end
                && first.is_none_or(|(earliest, _)| time < earliest)
            {
                first = Some((time, bound));
            }
        };
        for axis in 0..3 {
            let limit = self.limit(axis, body);
            if end[axis].abs() > limit - slack {
                let upper = trajectory.velocity[axis] > 0.0;
                let limit = limit.copysign(trajectory.velocity[axis]);
                offer(
                    wall_time(trajectory, axis, limit),
                    Bound::Wall(Wall { axis, upper }),
                );
            }
        }
        for (index, plane) in domain.planes.iter().enumerate() {
            let upper = self.is_above(ball, index);
            offer(
                plane_time(trajectory, plane, upper, body.radius),
                Bound::Plane(index),
            );
        }
        first
    }

    /// Whether a ball is on the side of a plane that its normal points to.
    fn is_above(&self, ball: u32, plane: usize) -> bool {
        self.state.sides[ball as usize * self.state.domain.planes.len() + plane]
    }

    /// A ball's flight after it has met what bounds the domain, and the report of that.
    #[inline]
    pub fn after(
        &self,
        ball: u32,
        before: Trajectory,
        bound: Bound,
        time: Time,
    ) -> (Trajectory, Collision) {
        let body = self.body(ball);
        match bound {
            Bound::Wall(wall) => {
                let limit = self.limit(wall.axis, body);
                if self.is_periodic() {
                    contact::face(ball, before, body, wall, limit, time)
                } else {
                    contact::wall(ball, before, body, wall, limit, time)
                }
            }
            Bound::Plane(index) => {
                let plane = &self.state.domain.planes[index];
                let plane = (index as u32, plane, self.is_above(ball, index));
                contact::plane(ball, before, body, plane, time)
            }
        }
    }

    /// The meeting of two pieces, of balls which entered the window with the flights `owners`, the lower ball first; it is moved by
    /// `image` to touch the other.
    #[inline(always)]
    pub fn meeting_of(
        &self,
        [piece, other]: [Id; 2],
        time: Time,
        (balls, owners): ([u32; 2], [Id; 2]),
        image: [i8; 3],
    ) -> Meeting {
        Meeting {
            time: time.relative_to(self.window.begin.epoch),
            piece,
            other,
            owners,
            next: [NONE; 2],
            rank: balls.into(),
            image,
        }
    }

    /// The meeting of a piece with what bounds the domain, of a ball which entered the window with the flight `owner`.
    #[inline]
    pub fn meeting_with(
        &self,
        bound: Bound,
        time: Time,
        piece: Id,
        (ball, owner): (u32, Id),
    ) -> Meeting {
        let number = bound.number();
        Meeting {
            time: time.relative_to(self.window.begin.epoch),
            piece,
            other: AT_BOUNDARY + number,
            owners: [owner, NONE],
            next: [NONE; 2],
            rank: (ball, number),
            image: [0; 3],
        }
    }

    /// Follows a piece of a ball, which entered the window with the flight `owner`, and those after it where it meets what bounds
    /// the domain, to the end of the window: `pass` gets each piece's number with the ends of its way and the ball's radius, `meet`
    /// each such meeting, `add` numbers each further piece.
    #[inline(always)]
    pub fn trace(
        &self,
        id: Id,
        trajectory: Trajectory,
        (ball, owner): (u32, Id),
        mut add: impl FnMut(&Trajectory) -> Id,
        mut pass: impl FnMut(Id, [DVec3; 2], f64),
        mut meet: impl FnMut(Meeting),
    ) {
        let Window { begin, end } = self.window;
        let body = self.body(ball);
        let (mut id, mut trajectory) = (id, trajectory);
        loop {
            let bound = self.next_bound(&trajectory, ball, body);
            let from = if trajectory.begin > begin {
                trajectory.begin
            } else {
                begin
            };
            let to = bound.map_or(end, |(time, _)| time);
            let ends: [DVec3; 2] = [from, to].map(|time| trajectory.position_at(time));
            pass(id, ends, body.radius);
            let Some((time, bound)) = bound else { return };
            (trajectory, _) = self.after(ball, trajectory, bound, time);
            let next = add(&trajectory);
            meet(Meeting {
                next: [next, NONE],
                ..self.meeting_with(bound, time, id, (ball, owner))
            });
            id = next;
        }
    }
}
