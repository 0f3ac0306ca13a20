//! Calendar `indexed`: an indexed four-ary heap.
//!
//! It holds at most one event per ball, and a position index so that a ball's event can be replaced or removed in
//! O(log n). Four children share a cache line, and a heap that is half as deep as a binary one misses the cache
//! half as often.

use crate::calendar::Calendar;
use crate::event::Event;

/// The heap's root sits in the last place of the first line, so that each group of four children fills one line.
const ROOT: usize = 3;

/// Marks a ball without an event.
const ABSENT: u32 = u32::MAX;

/// Four events in one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Line([Event; 4]);

/// The earliest event of each ball, ordered.
#[derive(Clone, Debug)]
pub struct Indexed {
    lines: Vec<Line>,
    place_of: Vec<u32>,
    end: usize,
}

impl Calendar for Indexed {
    fn new(ball_count: usize) -> Self {
        Self {
            lines: Vec::new(),
            place_of: vec![ABSENT; ball_count],
            end: ROOT,
        }
    }

    fn len(&self) -> usize {
        self.end - ROOT
    }

    #[inline]
    fn first(&mut self) -> Option<Event> {
        (!self.is_empty()).then(|| self.at(ROOT))
    }

    #[inline]
    fn set(&mut self, event: Event) {
        let place = self.place_of[event.ball as usize];
        if place == ABSENT {
            let place = self.grow();
            self.rise(place, event);
        } else {
            self.settle(place as usize, event);
        }
    }

    fn remove(&mut self, ball: u32) {
        let place = self.place_of[ball as usize];
        if place == ABSENT {
            return;
        }
        self.place_of[ball as usize] = ABSENT;
        self.end -= 1;
        if place as usize != self.end {
            self.settle(place as usize, self.at(self.end));
        }
    }

    fn rebase(&mut self, _epochs: f64, events: impl Iterator<Item = Event>) {
        self.place_of.fill(ABSENT);
        self.end = ROOT;
        for event in events {
            let place = self.grow();
            self.put(place, event);
        }
        for place in (ROOT..self.end).rev() {
            self.sink(place, self.at(place));
        }
    }
}

impl Indexed {
    /// Adds a free place at the end.
    fn grow(&mut self) -> usize {
        let place = self.end;
        if place / 4 == self.lines.len() || self.lines.is_empty() {
            let nothing = Event::new(
                f64::INFINITY,
                0,
                crate::event::EventKind::Crossing { axis: 0 },
            );
            self.lines.push(Line([nothing; 4]));
            if place / 4 == self.lines.len() {
                self.lines.push(Line([nothing; 4]));
            }
        }
        self.end += 1;
        place
    }

    #[inline]
    fn at(&self, place: usize) -> Event {
        self.lines[place / 4].0[place % 4]
    }

    #[inline]
    fn put(&mut self, place: usize, event: Event) {
        self.lines[place / 4].0[place % 4] = event;
        self.place_of[event.ball as usize] = place as u32;
    }

    /// Moves an event up or down from `place` to where it belongs.
    #[inline]
    fn settle(&mut self, place: usize, event: Event) {
        if place > ROOT && event.precedes(&self.at(parent(place))) {
            self.rise(place, event);
        } else {
            self.sink(place, event);
        }
    }

    fn rise(&mut self, mut place: usize, event: Event) {
        while place > ROOT {
            let above = self.at(parent(place));
            if !event.precedes(&above) {
                break;
            }
            self.put(place, above);
            place = parent(place);
        }
        self.put(place, event);
    }

    fn sink(&mut self, mut place: usize, event: Event) {
        loop {
            let first_child = 4 * place - 8;
            if first_child >= self.end {
                break;
            }
            let line = &self.lines[first_child / 4].0;
            let mut earliest = 0;
            for child in 1..(self.end - first_child).min(4) {
                if line[child].precedes(&line[earliest]) {
                    earliest = child;
                }
            }
            let below = line[earliest];
            if !below.precedes(&event) {
                break;
            }
            self.put(place, below);
            place = first_child + earliest;
        }
        self.put(place, event);
    }
}

#[inline]
fn parent(place: usize) -> usize {
    place / 4 + 2
}
