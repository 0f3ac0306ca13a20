//! Meetings of two pieces, or of a piece and what bounds the domain, and their order.

use std::cmp::Ordering;

use super::pieces::Id;
use super::scratch::Scratch;
use super::team::Team;
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

/// The meetings of a window in order of time. The window is cut into shares, so that threads can sort side by side.
#[derive(Clone, Debug, Default)]
pub struct Agenda {
    shares: Vec<Scratch<Meeting>>,
    /// For each share where the next meeting of each bin belongs, while it is filled.
    places: Vec<Scratch<u32>>,
    /// In which share the next one is, how many before it there, and how many there are from it on.
    share: usize,
    done: usize,
    left: usize,
}

impl Agenda {
    /// Empty, to be filled by so many threads.
    pub fn new(threads: usize) -> Self {
        Self {
            shares: vec![Scratch::default(); threads],
            places: vec![Scratch::default(); threads],
            ..Self::default()
        }
    }

    /// Puts in order what has been `found` for a window that lasts from `begin` to `end`, in the epochs of the meetings' times.
    ///
    /// They are spread evenly over the window but for chance, so a distribution into bins does most of the work.
    pub fn fill(&mut self, team: &Team, found: &[&[Meeting]], (begin, end): (f64, f64)) {
        let count: usize = found.iter().map(|found| found.len()).sum();
        let bins = (count / 2).max(1);
        let per_time = bins as f64 / (end - begin);
        let bin = |meeting: &Meeting| (((meeting.time - begin) * per_time) as usize).min(bins - 1);
        let threads = self.shares.len();
        let shares = self.shares.iter_mut().zip(&mut self.places).enumerate();
        team.work(shares, |(number, share)| {
            let cut = |number| bins * number / threads;
            let (first, bins) = (cut(number), cut(number + 1) - cut(number));
            // What belongs into another share goes into one more bin, of which only the last is kept.
            let bin = |meeting: &Meeting| bin(meeting).wrapping_sub(first).min(bins);
            distribute(found, bins, bin, share);
        });
        self.left = count;
        (self.share, self.done) = (0, 0);
        self.skip_finished();
    }

    fn skip_finished(&mut self) {
        while self
            .shares
            .get(self.share)
            .is_some_and(|share| share.len() == self.done)
        {
            self.share += 1;
            self.done = 0;
        }
    }

    /// The next one.
    #[inline]
    pub fn next(&self) -> Option<&Meeting> {
        self.shares.get(self.share)?.get(self.done)
    }

    /// One of those that come soon after it: so many later, if it is in the same share.
    #[inline]
    pub fn later(&self, ahead: usize) -> Option<&Meeting> {
        self.shares.get(self.share)?.get(self.done + ahead)
    }

    /// Goes on to the one after the next.
    #[inline]
    pub fn advance(&mut self) {
        self.done += 1;
        self.left -= 1;
        self.skip_finished();
    }

    /// How many are left.
    pub fn left(&self) -> usize {
        self.left
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.shares.iter_mut().for_each(Scratch::empty);
        self.left = 0;
    }
}

/// Puts those meetings of `found` into `sorted`, in order, whose `bin` is one of `bins`; all others have that number.
fn distribute(
    found: &[&[Meeting]],
    bins: usize,
    bin: impl Fn(&Meeting) -> usize,
    (sorted, places): (&mut Scratch<Meeting>, &mut Scratch<u32>),
) {
    places.empty();
    places.resize(bins + 2, 0);
    for meeting in found.iter().copied().flatten() {
        places[bin(meeting) + 1] += 1;
    }
    for bin in 0..bins {
        places[bin + 1] += places[bin];
    }
    let count = places[bins] as usize;
    sorted.empty();
    sorted.resize(count + 1, Meeting::default());
    for meeting in found.iter().copied().flatten() {
        let bin = bin(meeting);
        let place = &mut places[bin];
        sorted[*place as usize] = *meeting;
        *place += u32::from(bin < bins);
    }
    sorted.truncate(count);
    // Each place is now where the next bin begins.
    let mut first = 0;
    for &end in &places[..bins] {
        let bin = &mut sorted[first..end as usize];
        if bin.len() > 1 {
            bin.sort_unstable_by(Meeting::order);
        }
        first = end as usize;
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

    #[test]
    fn bins_give_the_order_of_a_plain_sort() {
        let mut word = 1_u64;
        let meeting = |_| {
            word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(9);
            Meeting {
                time: (word >> 54) as f64 / 1024.0,
                rank: ((word >> 20) as u32, 7),
                ..Meeting::default()
            }
        };
        let meetings: Vec<_> = (0..5000).map(meeting).collect();
        let mut expected = meetings.clone();
        expected.sort_by(Meeting::order);
        for (threads, count) in [(1, 5000), (2, 5000), (3, 5000), (3, 1), (2, 0)] {
            let mut agenda = Agenda::new(threads);
            let (few, many) = meetings[..count].split_at(count / 3);
            agenda.fill(&Team::new(threads), &[few, &[], many], (0.0, 1.0));
            if count == 5000 {
                assert_eq!(agenda.left(), count);
                for expected in &expected {
                    assert_eq!(agenda.next(), Some(expected));
                    agenda.advance();
                }
            } else {
                assert_eq!(agenda.left(), count);
                (0..count).for_each(|_| agenda.advance());
            }
            assert_eq!((agenda.next(), agenda.left()), (None, 0));
        }
    }
}
