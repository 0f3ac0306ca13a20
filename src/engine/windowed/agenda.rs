//! The meetings of a window: as they are found, and in order of time.
//!
//! A window is cut into stretches of time. What is found is put with others of its stretch at once, so that each stretch can be
//! put in order on its own, in a cache and by any thread.

use std::cmp::Ordering;

use prefetch_index::prefetch_index;

use super::meeting::Meeting;
use super::scratch::Scratch;
use super::team::Team;

/// Stretches of a window.
const STRETCHES: usize = 64;

/// Most meetings in a bin of a stretch with which chance spreads them over it.
const MOST_IN_BIN: u32 = 16;

/// Meetings that have been found in a window, in no order but that of their stretches.
#[derive(Clone, Debug)]
pub struct Found {
    stretches: Vec<Scratch<Meeting>>,
    /// When the window begins, and stretches per time.
    begin: f64,
    per_time: f64,
}

impl Default for Found {
    fn default() -> Self {
        Self {
            stretches: vec![Scratch::default(); STRETCHES],
            begin: 0.0,
            per_time: 0.0,
        }
    }
}

impl Found {
    /// Begins a window from one time to another.
    pub fn begin(&mut self, (begin, end): (f64, f64)) {
        self.empty();
        self.begin = begin;
        self.per_time = STRETCHES as f64 / (end - begin);
    }

    /// Forgets all meetings.
    pub fn empty(&mut self) {
        self.stretches.iter_mut().for_each(Scratch::empty);
    }

    /// How many stretches of the window have passed at a time.
    #[inline(always)]
    fn passed(&self, time: f64) -> f64 {
        (time - self.begin) * self.per_time
    }

    /// Adds a meeting.
    #[inline(always)]
    pub fn push(&mut self, meeting: Meeting) {
        let stretch = (self.passed(meeting.time) as usize).min(STRETCHES - 1);
        let stretch = &mut self.stretches[stretch];
        stretch.push(meeting);
        prefetch_index(stretch.as_slice(), stretch.len() + 2);
    }

    /// Gives up all meetings.
    pub fn drain(&mut self) -> impl Iterator<Item = Meeting> {
        self.stretches
            .iter_mut()
            .flat_map(|stretch| stretch.drain(..))
    }
}

/// The meetings of a window in order of time.
#[derive(Clone, Debug, Default)]
pub struct Agenda {
    /// The first `count` in order; what comes after them means nothing.
    sorted: Vec<Meeting>,
    count: usize,
    done: usize,
}

impl Agenda {
    /// Puts in order what several have `found` in the same window.
    pub fn fill(&mut self, team: &Team, found: &[&Found]) {
        let count_in = |stretch: usize| {
            found
                .iter()
                .map(|found| found.stretches[stretch].len())
                .sum()
        };
        let counts: [usize; STRETCHES] = std::array::from_fn(count_in);
        (self.count, self.done) = (counts.iter().sum(), 0);
        if self.sorted.len() < self.count {
            // Some more, as windows vary by chance.
            let room = self.count + self.count / 8;
            self.sorted = vec![Meeting::default(); room];
        }
        let mut rest = &mut self.sorted[..self.count];
        let shares = counts.into_iter().enumerate().map(|(stretch, count)| {
            let sorted = rest.split_off_mut(..count);
            (stretch, sorted.expect("stretches make up the whole"))
        });
        team.work(shares, |(stretch, sorted)| sort(found, stretch, sorted));
    }

    /// The next one.
    #[inline]
    pub fn next(&self) -> Option<&Meeting> {
        self.later(0)
    }

    /// The one that comes so many later.
    #[inline]
    pub fn later(&self, ahead: usize) -> Option<&Meeting> {
        self.sorted[..self.count].get(self.done + ahead)
    }

    /// Goes on to the one after the next.
    #[inline]
    pub fn advance(&mut self) {
        self.done += 1;
    }

    /// How many are left.
    pub fn left(&self) -> usize {
        self.count - self.done
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        (self.count, self.done) = (0, 0);
    }
}

/// Puts all meetings of a stretch in order into `sorted`, which is as long.
///
/// They are spread evenly over it but for chance, so a distribution into bins does most of the work.
fn sort(found: &[&Found], stretch: usize, sorted: &mut [Meeting]) {
    for place in 0..sorted.len() {
        prefetch_index(&*sorted, place);
    }
    let bins = (2 * sorted.len()).max(1);
    let bin_of = |found: &Found, meeting: &Meeting| {
        let passed = found.passed(meeting.time) - stretch as f64;
        ((passed * bins as f64) as usize).min(bins - 1)
    };
    let mut places = vec![0_u32; bins];
    for found in found {
        for meeting in found.stretches[stretch].iter() {
            places[bin_of(found, meeting)] += 1;
        }
    }
    let (mut fullest, mut before) = (0, 0);
    for place in &mut places {
        fullest = fullest.max(*place);
        before += std::mem::replace(place, before);
    }
    for found in found {
        for meeting in found.stretches[stretch].iter() {
            let place = &mut places[bin_of(found, meeting)];
            sorted[*place as usize] = *meeting;
            *place += 1;
        }
    }
    if fullest > MOST_IN_BIN {
        sorted.sort_unstable_by(Meeting::order);
        return;
    }
    // Only those of one bin may be out of order.
    for end in 1..sorted.len() {
        let mut place = end;
        while place > 0 && sorted[place].order(&sorted[place - 1]) == Ordering::Less {
            sorted.swap(place - 1, place);
            place -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_give_the_order_of_a_plain_sort() {
        let mut word = 1_u64;
        let meeting = |_| {
            word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(9);
            Meeting {
                time: 3.0 + (word >> 54) as f64 / 1024.0,
                rank: ((word >> 20) as u32, 7),
                ..Meeting::default()
            }
        };
        let meetings: Vec<_> = (0..5000).map(meeting).collect();
        let mut agenda = Agenda::default();
        for (threads, count, span) in [
            (1, 5000, (3.0, 4.0)),
            (2, 5000, (3.0, 4.0)),
            (3, 5000, (3.5, 3.75)),
            (3, 1, (3.0, 4.0)),
            (2, 0, (3.0, 4.0)),
        ] {
            let mut found = vec![Found::default(); 3];
            for found in &mut found {
                found.begin(span);
            }
            for (number, meeting) in meetings[..count].iter().enumerate() {
                found[number % 5 % 3].push(*meeting);
            }
            let parts: Vec<_> = found.iter().collect();
            agenda.fill(&Team::new(threads), &parts);
            assert_eq!(agenda.left(), count);
            let mut expected = meetings[..count].to_vec();
            expected.sort_by(Meeting::order);
            for expected in &expected {
                assert_eq!(agenda.next(), Some(expected));
                agenda.advance();
            }
            assert_eq!((agenda.next(), agenda.left()), (None, 0));
            let mut given: Vec<_> = found[0].drain().collect();
            given.sort_by(Meeting::order);
            assert_eq!(given.len(), (0..count).filter(|n| n % 5 % 3 == 0).count());
            assert_eq!(found[0].drain().count(), 0);
        }
    }
}
