//! Calendar `lazy`: a binary heap that every event is pushed into and none is taken out of before its time.
//!
//! What always holds: a ball's live entry is the one with the ball's present number; all others of that ball are outdated.
//! They stay until they come to the top and are thrown away there, so the heap holds more than one entry per ball: what was
//! predicted for the far future and never came true stays longest. That growth is what this calendar is here to show.
//!
//! Idea: the lazy priority queue of the student paper that this program takes up. Its engine pushed every pair that might
//! meet; ours hands over the earliest event of a ball each time it changes, most of which are near, so the heap settles at
//! about one and a half entries per ball in that paper's gas instead of growing on.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::calendar::Calendar;
use crate::event::Event;

/// An event as it was pushed.
#[derive(Clone, Copy, Debug)]
struct Entry {
    event: Event,
    /// The number that its ball had then.
    number: u64,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    /// The standard library's heap has the largest on top, so the earlier is the larger.
    fn cmp(&self, other: &Self) -> Ordering {
        if self.event.precedes(&other.event) {
            Ordering::Greater
        } else if other.event.precedes(&self.event) {
            Ordering::Less
        } else {
            Ordering::Equal
        }
    }
}

/// Every event there was, but for those that have come to the top.
#[derive(Clone, Debug)]
pub struct Lazy {
    heap: BinaryHeap<Entry>,
    /// How often each ball's event has changed: the number of its live entry.
    changes: Vec<u64>,
}

impl Calendar for Lazy {
    fn new(ball_count: usize) -> Self {
        Self {
            heap: BinaryHeap::new(),
            changes: vec![0; ball_count],
        }
    }

    fn len(&self) -> usize {
        self.heap.len()
    }

    fn first(&mut self) -> Option<Event> {
        while let Some(entry) = self.heap.peek() {
            if entry.number == self.changes[entry.event.ball as usize] {
                return Some(entry.event);
            }
            self.heap.pop();
        }
        None
    }

    fn set(&mut self, event: Event) {
        let number = &mut self.changes[event.ball as usize];
        *number += 1;
        self.heap.push(Entry {
            event,
            number: *number,
        });
    }

    fn remove(&mut self, ball: u32) {
        self.changes[ball as usize] += 1;
    }

    fn rebase(&mut self, epochs: f64, events: impl Iterator<Item = Event>) {
        let mut entries = std::mem::take(&mut self.heap).into_vec();
        // The live ones come again; the outdated stay as long as they would have stayed, for they are what is counted here.
        entries.retain(|entry| entry.number != self.changes[entry.event.ball as usize]);
        for entry in &mut entries {
            entry.event.time -= epochs;
        }
        let live = events.map(|event| Entry {
            event,
            number: self.changes[event.ball as usize],
        });
        entries.extend(live);
        self.heap = entries.into();
    }
}
