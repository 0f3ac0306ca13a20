//! Meetings of two pieces, or of a piece and a wall, and their order.

use std::cmp::Ordering;

use super::pieces::Id;
use super::region::Shelves;

/// Numbers from here on are walls, not pieces.
pub const AT_WALL: u32 = u32::MAX - 5;

/// A meeting of two pieces, or of a piece and a wall.
#[derive(Clone, Copy, Debug)]
pub struct Meeting {
    /// When, in epochs from the window's first epoch.
    pub time: f64,
    /// The piece, or one of the two.
    pub piece: Id,
    /// The other piece; [`AT_WALL`] and the wall's number for a wall.
    pub other: Id,
    /// The pieces that follow, where they have been listed and tested already: `piece`'s and `other`'s.
    pub next: [Id; 2],
    /// Orders meetings at one instant as all exact engines do.
    pub rank: (u32, u32),
}

impl Meeting {
    /// By time; walls before pairs; lower balls first.
    pub fn order(&self, other: &Self) -> Ordering {
        let kind = |meeting: &Self| meeting.other < AT_WALL;
        let ties = || (kind(self), self.rank).cmp(&(kind(other), other.rank));
        self.time.total_cmp(&other.time).then_with(ties)
    }

    /// The two pieces, the one with the lower ball first.
    pub fn in_order(&self, shelves: &Shelves) -> [Id; 2] {
        if shelves.ball(self.piece) == self.rank.0 {
            [self.piece, self.other]
        } else {
            [self.other, self.piece]
        }
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
