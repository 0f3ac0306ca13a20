//! Meetings of two pieces, or of a piece and what bounds the domain.

use std::cmp::Ordering;

use super::pieces::Id;
use crate::event::{MAX_PLANE_COUNT, Wall};

/// Numbers from here on are walls, faces and planes, not pieces.
pub const AT_BOUNDARY: u32 = u32::MAX - FIRST_PLANE - MAX_PLANE_COUNT as u32;

/// Walls and faces come first.
const FIRST_PLANE: u32 = 6;

/// What bounds the domain, met by one piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// A wall of a container or a face of a periodic box.
    Wall(Wall),
    /// One of the domain's planes.
    Plane(usize),
}

impl Bound {
    /// Its number; walls before planes.
    pub fn number(self) -> u32 {
        match self {
            Self::Wall(Wall { axis, upper }) => 2 * axis as u32 + u32::from(upper),
            Self::Plane(index) => FIRST_PLANE + index as u32,
        }
    }

    /// What has this number.
    pub fn of(number: u32) -> Self {
        if number < FIRST_PLANE {
            Self::Wall(Wall {
                axis: number as usize / 2,
                upper: number % 2 == 1,
            })
        } else {
            Self::Plane((number - FIRST_PLANE) as usize)
        }
    }
}

/// A meeting of two pieces, or of a piece and what bounds the domain.
#[derive(Clone, Copy, Debug, Default)]
pub struct Meeting {
    /// When, in epochs from the window's first epoch.
    pub time: f64,
    /// The piece; of two, that of the ball with the lower index.
    pub piece: Id,
    /// The other piece; [`AT_BOUNDARY`] and the number of a [`Bound`].
    pub other: Id,
    /// The flights with which the balls entered the window; one for a meeting with a [`Bound`].
    pub owners: [Id; 2],
    /// The pieces that follow, where they have been listed and tested already: `piece`'s and `other`'s.
    pub next: [Id; 2],
    /// The balls, the lower index first; or a ball and the number of a [`Bound`].
    pub rank: (u32, u32),
    /// By how many boxes the lower ball is moved to touch the other.
    pub image: [i8; 3],
}

impl Meeting {
    /// What bounds the domain, if that is met.
    #[inline]
    pub fn bound(&self) -> Option<Bound> {
        self.other.checked_sub(AT_BOUNDARY).map(Bound::of)
    }

    /// By time; walls and faces before planes before pairs; lower balls first: as all exact engines do.
    #[inline]
    pub fn order(&self, other: &Self) -> Ordering {
        self.time
            .total_cmp(&other.time)
            .then_with(|| self.tie_order(other))
    }

    #[cold]
    fn tie_order(&self, other: &Self) -> Ordering {
        let key = |meeting: &Self| {
            let kind = match meeting.bound() {
                Some(Bound::Wall(_)) => 0,
                Some(Bound::Plane(_)) => 1,
                None => 2,
            };
            (kind, meeting.rank, meeting.image)
        };
        key(self).cmp(&key(other))
    }
}

/// The earliest is the greatest: what a heap gives first.
impl Ord for Meeting {
    fn cmp(&self, other: &Self) -> Ordering {
        other.order(self)
    }
}

impl PartialOrd for Meeting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Meeting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Meeting {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_bounds_the_domain_has_numbers() {
        for number in [0, 1, 4, 5, 6, 7, FIRST_PLANE + MAX_PLANE_COUNT as u32 - 1] {
            assert_eq!(Bound::of(number).number(), number);
        }
    }
}
