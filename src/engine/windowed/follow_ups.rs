//! Meetings of pieces that begin while a window's meetings are carried out.
//!
//! The window is cut into slices. What comes in a later one is put aside there, in no order; a slice is put in order when it is
//! reached. So it is known before its turn whose memory will be needed.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::meeting::Meeting;
use super::pieces::NONE;
use super::scratch::Scratch;

/// The meetings.
#[derive(Clone, Debug, Default)]
pub struct FollowUps {
    /// When the window begins, and slices per time.
    begin: f64,
    per_time: f64,
    /// Of each slice the one that was put aside last; [`NONE`] without any.
    slices: Vec<u32>,
    /// All that were put aside, each with the one before it in its slice.
    aside: Scratch<(Meeting, u32)>,
    /// The slice that has been reached, its meetings in order, the last one first, and those that were added since.
    slice: usize,
    reached: Vec<Meeting>,
    added: BinaryHeap<Meeting>,
    /// How many are left.
    left: usize,
}

impl FollowUps {
    /// Begins a window from one time to another, cut into so many slices.
    pub fn begin(&mut self, (begin, end): (f64, f64), slices: usize) {
        self.clear();
        self.begin = begin;
        self.per_time = slices as f64 / (end - begin);
        self.slices.resize(slices, NONE);
        self.slice = 0;
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.slices.clear();
        self.aside.empty();
        self.reached.clear();
        self.added.clear();
        self.left = 0;
    }

    /// How many are left.
    pub fn left(&self) -> usize {
        self.left
    }

    /// Adds a meeting.
    #[inline]
    pub fn push(&mut self, meeting: Meeting) {
        self.left += 1;
        let slice = ((meeting.time - self.begin) * self.per_time) as usize;
        let slice = slice.min(self.slices.len() - 1);
        if slice <= self.slice {
            self.added.push(meeting);
        } else {
            let before = std::mem::replace(&mut self.slices[slice], self.aside.len() as u32);
            self.aside.push((meeting, before));
        }
    }

    /// Whether all meetings up to the slice that has been reached are done, and there are others.
    #[inline]
    pub fn is_slice_done(&self) -> bool {
        self.reached.is_empty() && self.added.is_empty() && self.left > 0
    }

    /// Goes on to the next slice in which there are any.
    pub fn go_on(&mut self) {
        self.slice += 1;
        while self.slices[self.slice] == NONE {
            self.slice += 1;
        }
        let mut reached = std::mem::take(&mut self.reached);
        reached.extend(self.put_aside(self.slice));
        reached.sort_unstable_by(|one, other| other.order(one));
        self.reached = reached;
    }

    /// The meetings of the slice that has been reached, and of the one after it.
    pub fn soon(&self) -> (&[Meeting], impl Iterator<Item = &Meeting>) {
        (&self.reached, self.put_aside(self.slice + 1))
    }

    /// What was put aside in a slice.
    fn put_aside(&self, slice: usize) -> impl Iterator<Item = &Meeting> {
        let mut next = self.slices.get(slice).copied().unwrap_or(NONE);
        std::iter::from_fn(move || {
            let (meeting, before) = self.aside.get(next as usize)?;
            next = *before;
            Some(meeting)
        })
    }

    /// The next one in order, in the slice that has been reached.
    #[inline]
    pub fn next(&self) -> Option<&Meeting> {
        let (reached, added) = (self.reached.last(), self.added.peek());
        if self.is_added_next() { added } else { reached }
    }

    /// Takes the next one away.
    #[inline]
    pub fn pop(&mut self) {
        self.left -= 1;
        if self.is_added_next() {
            self.added.pop();
        } else {
            self.reached.pop();
        }
    }

    #[inline]
    fn is_added_next(&self) -> bool {
        match (self.reached.last(), self.added.peek()) {
            (Some(reached), Some(added)) => added.order(reached) == Ordering::Less,
            (reached, _) => reached.is_none(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meetings_come_in_order_whenever_they_are_added() {
        let mut word = 1_u64;
        let mut after = |time: f64| {
            word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(9);
            Meeting {
                time: time + (word >> 54) as f64 / 4096.0,
                rank: ((word >> 20) as u32, 7),
                ..Meeting::default()
            }
        };
        let mut follow_ups = FollowUps::default();
        for slices in [1, 40, 7] {
            follow_ups.begin((1.0, 2.0), slices);
            let mut all: Vec<Meeting> = (0..100).map(|_| after(1.0)).collect();
            for &meeting in &all {
                follow_ups.push(meeting);
            }
            let mut taken = Vec::new();
            while follow_ups.left() > 0 {
                if follow_ups.is_slice_done() {
                    follow_ups.go_on();
                }
                let next = *follow_ups.next().expect("one of those that are left");
                follow_ups.pop();
                taken.push(next);
                // Some bring about others, at the same instant at the earliest.
                if all.len() < 300 {
                    let mut other = after(next.time);
                    if all.len().is_multiple_of(5) {
                        other = Meeting {
                            time: next.time,
                            ..other
                        };
                        other.rank.0 |= 1 << 31;
                    }
                    follow_ups.push(other);
                    all.push(other);
                }
            }
            all.sort_by(Meeting::order);
            assert!(taken.windows(2).all(|two| two[0].time <= two[1].time));
            taken.sort_by(Meeting::order);
            assert_eq!(taken, all);
            assert!(follow_ups.next().is_none() && !follow_ups.is_slice_done());
        }
    }
}
