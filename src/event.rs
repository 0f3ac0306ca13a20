//! Events: what a ball will do next, and the collisions an engine reports.

use serde::{Deserialize, Serialize};

use std::cmp::Ordering;

use glam::DVec3;

use crate::state::Time;

/// What happens to a ball next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// It begins to reach into the next cell along an axis.
    Crossing {
        /// 0, 1, 2 for x, y, z.
        axis: usize,
    },
    /// It hits a container wall, or its centre leaves a periodic box.
    Wall(Wall),
    /// It hits a plane.
    Plane {
        /// Which of the domain's planes.
        plane: u32,
    },
    /// It hits another ball.
    Pair {
        /// The other ball.
        partner: u32,
    },
}

/// One of the six faces of a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Wall {
    /// The axis it is perpendicular to: 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Whether it is the wall at the positive end.
    pub upper: bool,
}

/// The next event of a ball, in 16 bytes.
///
/// Events are ordered by time, then kind (crossings, walls, planes, pairs), then the lower and the higher ball index, so that the order
/// of simultaneous collisions does not depend on who was scheduled first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// When, in epochs from the calendar's base.
    pub time: f64,
    /// Whose event it is.
    pub ball: u32,
    code: u32,
}

/// Codes below this one are crossings and walls.
const FIRST_PLANE: u32 = 9;

/// Most planes a domain can have.
pub const MAX_PLANE_COUNT: usize = 1000;

/// Codes below this one are planes; the rest are partners, moved up by it.
const FIRST_PARTNER: u32 = FIRST_PLANE + MAX_PLANE_COUNT as u32;

/// Most balls a calendar can hold: their indices share 32 bits with the other kinds of event.
pub const MAX_BALL_COUNT: usize = (u32::MAX - FIRST_PARTNER) as usize;

impl Event {
    /// The event of `ball` at `time`.
    #[inline]
    pub fn new(time: f64, ball: u32, kind: EventKind) -> Self {
        let code = match kind {
            EventKind::Crossing { axis } => axis as u32,
            EventKind::Wall(Wall { axis, upper }) => 3 + 2 * axis as u32 + u32::from(upper),
            EventKind::Plane { plane } => FIRST_PLANE + plane,
            EventKind::Pair { partner } => FIRST_PARTNER + partner,
        };
        Self { time, ball, code }
    }

    /// What happens.
    #[inline]
    pub fn kind(&self) -> EventKind {
        match self.code {
            axis @ 0..3 => EventKind::Crossing {
                axis: axis as usize,
            },
            wall @ 3..FIRST_PLANE => EventKind::Wall(Wall {
                axis: (wall as usize - 3) / 2,
                upper: wall % 2 == 0,
            }),
            plane @ FIRST_PLANE..FIRST_PARTNER => EventKind::Plane {
                plane: plane - FIRST_PLANE,
            },
            partner => EventKind::Pair {
                partner: partner - FIRST_PARTNER,
            },
        }
    }

    /// Whether this event comes before `other`: by time, ties by kind and indices.
    #[inline]
    pub fn precedes(&self, other: &Self) -> bool {
        self.time < other.time
            || (self.time == other.time && self.tie_order(other) == Ordering::Less)
    }

    fn tie_order(&self, other: &Self) -> Ordering {
        let key = |event: &Self| match event.kind() {
            EventKind::Crossing { .. } => (0, event.ball, event.code),
            EventKind::Wall(_) => (1, event.ball, event.code),
            EventKind::Plane { .. } => (2, event.ball, event.code),
            EventKind::Pair { partner } => (3, event.ball.min(partner), event.ball.max(partner)),
        };
        key(self).cmp(&key(other)).then(self.ball.cmp(&other.ball))
    }
}

/// Who collided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Participants {
    /// Two balls, the lower index first.
    Pair(u32, u32),
    /// A ball and a container wall.
    Wall(u32, Wall),
    /// A ball and one of the domain's planes.
    Plane(u32, u32),
    /// No collision: a ball whose centre left a periodic box through a face and entered at the opposite one.
    Face(u32, Wall),
}

/// A collision that has happened, as an engine reports it. Internal units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collision {
    /// When.
    pub time: Time,
    /// Who.
    pub participants: Participants,
    /// Momentum that the first participant received.
    pub impulse: DVec3,
    /// Momentum that the gas received from outside: from walls, planes and fixed balls.
    pub external: DVec3,
    /// `sum of r . dp`, with `r` from the other ball's nearest image for pairs: what the pressure is made from.
    pub virial: f64,
    /// Jump of `sum of m r . v`, with the positions as they are: what the ledger is made from.
    pub radial_jump: f64,
    /// Distance between the surfaces over the contact distance: negative for an overlap. Zero for walls and planes, NaN for
    /// partners that were drawn and do not touch.
    pub gap: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_survives_its_code() {
        let walls = (0..6).map(|side| {
            EventKind::Wall(Wall {
                axis: side / 2,
                upper: side % 2 == 1,
            })
        });
        let crossings = (0..3).map(|axis| EventKind::Crossing { axis });
        let pairs =
            [0, 1, 704_968, MAX_BALL_COUNT as u32 - 1].map(|partner| EventKind::Pair { partner });
        let planes = [0, MAX_PLANE_COUNT as u32 - 1].map(|plane| EventKind::Plane { plane });
        for kind in walls.chain(crossings).chain(planes).chain(pairs) {
            assert_eq!(Event::new(1.0, 7, kind).kind(), kind);
        }
    }

    #[test]
    fn simultaneous_events_go_by_kind_and_then_by_the_lower_index() {
        let pair = |ball, partner| Event::new(1.0, ball, EventKind::Pair { partner });
        assert!(pair(9, 2).precedes(&pair(3, 4)));
        assert!(pair(2, 5).precedes(&pair(6, 2)));
        assert!(Event::new(1.0, 9, EventKind::Crossing { axis: 0 }).precedes(&pair(0, 1)));
        assert!(!pair(3, 4).precedes(&pair(3, 4)));
        assert!(Event::new(0.5, 9, EventKind::Pair { partner: 8 }).precedes(&pair(0, 1)));
    }
}
