//! A ball's flight on integers, and the exact ticks at which it meets another or a wall.
//!
//! An event happens at the last tick before two balls would overlap, or a ball would pass a wall, if they flew on. So balls
//! never overlap and never leave the box. A collision mirrors the next step into the previous one, so the reversed run finds
//! the same event at the same tick.
//!
//! Which tick that is follows from integers alone; f64 numbers only say where to look.

use serde::{Deserialize, Serialize};

use crate::engine::reversible::wide::Wide;

/// What began a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Origin {
    /// The start of the run, or a reversal.
    Start,
    /// A wall or a plane.
    Wall,
    /// A collision with a ball.
    Ball,
}

/// A ball in free flight, in integer units.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Flight {
    /// Where the ball was at `at`.
    pub position: [i128; 3],
    /// Way per tick.
    pub velocity: [i64; 3],
    /// The tick that `position` belongs to.
    pub at: i128,
    /// The tick at which the flight began. Leaving a periodic box does not end it.
    pub since: i128,
    /// What happened then.
    pub origin: Origin,
}

impl Flight {
    /// Where the ball is at a tick.
    #[inline]
    pub fn position_at(&self, tick: i128) -> [i128; 3] {
        let ticks = tick - self.at;
        std::array::from_fn(|axis| self.position[axis] + i128::from(self.velocity[axis]) * ticks)
    }

    /// Moves the reference to a tick; changes no position.
    pub fn refer_to(&mut self, tick: i128) {
        self.position = self.position_at(tick);
        self.at = tick;
    }

    /// The last tick before the ball passes the coordinate `limit` along `axis`, upwards or downwards; the tick of its
    /// reference if it is beyond and moves on outwards. `None` if it moves away or not at all.
    #[inline]
    pub fn wall_tick(&self, axis: usize, limit: i128, upwards: bool) -> Option<i128> {
        let (gap, speed) = if upwards {
            (limit - self.position[axis], self.velocity[axis])
        } else {
            (self.position[axis] - limit, -self.velocity[axis])
        };
        (speed > 0).then(|| self.at + gap.max(0) / i128::from(speed))
    }
}

/// Two balls that fly towards or past each other, seen from the second, from the later of their begins on.
#[derive(Clone, Copy, Debug)]
pub struct Approach {
    since: i128,
    separation: [i128; 3],
    velocity: [i64; 3],
    contact_squared: Wide,
}

impl Approach {
    /// The flights of two balls, the first moved by `shift`; `contact` is the distance of their centres at contact.
    #[inline]
    pub fn new(first: &Flight, second: &Flight, shift: [i128; 3], contact: i128) -> Self {
        let since = first.since.max(second.since);
        let [one, other] = [first, second].map(|flight| flight.position_at(since));
        Self {
            since,
            separation: std::array::from_fn(|axis| one[axis] - other[axis] + shift[axis]),
            velocity: std::array::from_fn(|axis| first.velocity[axis] - second.velocity[axis]),
            contact_squared: Wide::square(contact),
        }
    }

    /// The later begin of the two flights.
    #[inline]
    pub fn since(&self) -> i128 {
        self.since
    }

    /// From the second ball to the first at a tick.
    #[inline]
    pub fn separation_at(&self, tick: i128) -> [i128; 3] {
        self.after(tick - self.since)
    }

    /// Whether the balls overlap at the begin, as they may at the start of a run and never later.
    #[inline]
    pub fn overlaps(&self) -> bool {
        self.beyond(0) < 0.0
    }

    /// The last tick before the balls would overlap; the begin if they overlap there and approach. `None` if they never do.
    #[inline]
    pub fn meeting(&self) -> Option<i128> {
        let radial = self.radial(self.separation);
        if !(radial < 0.0) {
            return None;
        }
        if self.overlaps() {
            return Some(self.since);
        }
        let beyond = self.beyond(0);
        // |r|^2 - contact^2 = beyond + 2 radial t + speed^2 t^2
        let speed_squared = self.speed_squared();
        let discriminant = radial * radial - speed_squared * beyond;
        if discriminant < -1e-9 * radial * radial {
            return None;
        }
        let guess = beyond / (discriminant.max(0.0).sqrt() - radial);
        let first_overlap = self
            .search((guess.ceil() as i128).max(1))
            .or_else(|| self.search_from_closest(-radial / speed_squared))?;
        Some(self.since + first_overlap - 1)
    }

    /// Whether the balls move apart and would have overlapped one tick before they began to: what a reversed run takes for a
    /// collision.
    #[inline]
    pub fn parts(&self) -> bool {
        self.radial(self.separation) > 0.0 && self.beyond(-1) < 0.0
    }

    /// How many ticks after the begin the balls first overlap, by Newton's method from `guess` on; `None` if that leads
    /// nowhere, as it does for balls that only graze.
    #[inline]
    fn search(&self, mut guess: i128) -> Option<i128> {
        // Apart at `low`, overlapping at `high`, and nearing each other between.
        let (mut low, mut high) = (0, i128::MAX);
        for _ in 0..16 {
            let slope = 2.0 * self.radial(self.after(guess));
            if !(slope < 0.0) {
                return None;
            }
            let beyond = self.beyond(guess);
            let step = (beyond / slope).abs();
            if beyond < 0.0 {
                high = guess;
                guess -= (step as i128).max(1);
            } else {
                low = guess;
                guess += (step.ceil() as i128).max(1);
            }
            if high - low == 1 {
                return Some(high);
            }
            guess = guess.clamp(low + 1, high - 1);
        }
        None
    }

    /// Like [`Self::search`], by bisection between the begin and the closest approach, about `closest` ticks after it.
    #[cold]
    fn search_from_closest(&self, closest: f64) -> Option<i128> {
        let mut middle = closest as i128;
        for _ in 0..2 {
            let radial = self.radial(self.after(middle));
            middle -= (radial / self.speed_squared()).round() as i128;
        }
        let overlaps = |&ticks: &i128| self.beyond(ticks) < 0.0;
        let mut high = (middle.max(3) - 2..=middle + 2).find(overlaps)?;
        let mut low = 0;
        while high - low > 1 {
            let between = low + (high - low) / 2;
            if overlaps(&between) {
                high = between;
            } else {
                low = between;
            }
        }
        Some(high)
    }

    #[inline]
    fn after(&self, ticks: i128) -> [i128; 3] {
        std::array::from_fn(|axis| self.separation[axis] + i128::from(self.velocity[axis]) * ticks)
    }

    /// Distance squared minus contact distance squared some ticks after the begin: rounded, but with the exact sign.
    #[inline]
    fn beyond(&self, ticks: i128) -> f64 {
        Wide::length_squared(self.after(ticks)).minus(self.contact_squared)
    }

    /// `r . v`, rounded.
    #[inline]
    fn radial(&self, separation: [i128; 3]) -> f64 {
        (0..3)
            .map(|axis| separation[axis] as f64 * self.velocity[axis] as f64)
            .sum()
    }

    #[inline]
    fn speed_squared(&self) -> f64 {
        self.velocity
            .iter()
            .map(|&component| component as f64 * component as f64)
            .sum()
    }
}

/// Distance between the surfaces of two balls over their contact distance.
pub fn gap(separation: [i128; 3], contact: i128) -> f64 {
    // r^2 - c^2 = (r - c) (r + c), without cancellation
    let beyond = Wide::length_squared(separation).minus(Wide::square(contact));
    let contact = contact as f64;
    beyond / contact / ((contact * contact + beyond).sqrt() + contact)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    fn flight(position: [i128; 3], velocity: [i64; 3]) -> Flight {
        Flight {
            position,
            velocity,
            at: 0,
            since: 0,
            origin: Origin::Start,
        }
    }

    #[test]
    fn a_wall_is_met_at_the_last_tick_inside() {
        let check = |position, velocity, upwards, expected| {
            let ball = flight([position, 0, 0], [velocity, 0, 0]);
            let limit = if upwards { 100 } else { -100 };
            assert_eq!(ball.wall_tick(0, limit, upwards), expected);
        };
        check(0, 7, true, Some(14));
        check(2, 7, true, Some(14));
        check(0, -7, false, Some(14));
        check(100, 7, true, Some(0));
        check(105, 7, true, Some(0));
        check(100, -7, true, None);
        check(0, 0, true, None);
    }

    #[test]
    fn a_meeting_is_the_last_tick_without_overlap_as_found_tick_by_tick() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        let (mut meetings, mut single) = (0, 0);
        for _ in 0..200_000 {
            let contact: i128 = 100;
            let mut near = || random.random_range(-300..=300);
            let first = flight([near(), near(), near()], [0; 3]);
            let mut slow = || random.random_range(-60..=60);
            let second = flight([0; 3], [slow(), slow(), slow()]);
            let approach = Approach::new(&first, &second, [0; 3], contact);
            let overlaps = |tick| {
                let squares = approach.after(tick).map(|component| component * component);
                squares.iter().sum::<i128>() < contact * contact
            };
            if overlaps(0) {
                continue;
            }
            let expected = (0..700).find(|&tick| overlaps(tick + 1));
            assert_eq!(approach.meeting(), expected, "{approach:?}");
            meetings += usize::from(expected.is_some());
            single += usize::from(expected.is_some_and(|tick| !overlaps(tick + 2)));
        }
        assert!(meetings > 5000 && single > 500, "{meetings}, {single}");
    }

    #[test]
    fn the_reference_of_a_flight_does_not_matter() {
        let first = flight([1 << 100, 3, 5], [-(1 << 50), 1 << 40, 7]);
        let second = flight([0, 0, 1 << 99], [0, 0, -(1 << 49)]);
        let contact = 1 << 98;
        let meeting = Approach::new(&first, &second, [0; 3], contact).meeting();
        assert!(meeting.is_some());
        let mut moved = first;
        moved.refer_to(1 << 45);
        assert_ne!(moved, first);
        assert_eq!(
            Approach::new(&moved, &second, [0; 3], contact).meeting(),
            meeting
        );
        assert_eq!(
            Approach::new(&second, &moved, [0; 3], contact).meeting(),
            meeting
        );
    }
}
