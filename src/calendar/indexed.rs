//! Calendar `indexed`: an indexed four-ary heap.
//!
//! It holds at most one event per ball, and a position index so that a ball's event can be replaced or removed in
//! O(log n). Four children share a cache line, and a heap that is half as deep as a binary one misses the cache
//! half as often.

use prefetch_index::prefetch_index;

use crate::calendar::Calendar;
use crate::event::{Event, EventKind};

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
    fn soon(&self) -> [Option<Event>; 2] {
        let next = self.earliest_below(ROOT);
        let later = next.and_then(|next| self.earliest_below(next));
        [next, later].map(|place| place.map(|place| self.at(place)))
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
        let last = self.at(self.end);
        self.lines[self.end / 4].0[self.end % 4] = nothing();
        if place as usize != self.end {
            self.settle(place as usize, last);
        }
    }

    fn rebase(&mut self, _epochs: f64, events: impl Iterator<Item = Event>) {
        self.place_of.fill(ABSENT);
        self.lines.clear();
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
    /// Asks for the memory of a ball's place.
    #[inline]
    pub fn prefetch(&self, ball: u32) {
        prefetch_index(&self.place_of, ball as usize);
    }

    /// Adds a free place at the end.
    fn grow(&mut self) -> usize {
        let place = self.end;
        while place / 4 >= self.lines.len() {
            self.lines.push(Line([nothing(); 4]));
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

    /// Where the earliest event right below a place is.
    #[inline]
    fn earliest_below(&self, place: usize) -> Option<usize> {
        let first_child = first_child(place);
        (first_child < self.end).then(|| first_child + self.lines[first_child / 4].earliest())
    }

    fn sink(&mut self, mut place: usize, event: Event) {
        loop {
            let first_child = first_child(place);
            if first_child >= self.end {
                break;
            }
            self.read_ahead(first_child);
            let line = &self.lines[first_child / 4];
            let earliest = line.earliest();
            let below = line.0[earliest];
            if !below.precedes(&event) {
                break;
            }
            self.put(place, below);
            place = first_child + earliest;
        }
        self.put(place, event);
    }

    /// Asks for the memory of the children of four places, before it is known which of them is needed.
    #[inline]
    fn read_ahead(&self, first: usize) {
        for line in first - 2..first + 2 {
            prefetch_index(&self.lines, line);
        }
    }
}

impl Line {
    /// Which of the four events comes first. Nobody can foresee it, least of all the processor: so it is found without a branch.
    #[inline]
    fn earliest(&self) -> usize {
        let times = self.0.map(|event| event.time);
        let left = usize::from(times[1] < times[0]);
        let right = 2 + usize::from(times[3] < times[2]);
        let earliest = [left, right][usize::from(times[right] < times[left])];
        let ties = times.iter().filter(|&&time| time == times[earliest]);
        if ties.count() > 1 {
            self.earliest_of_ties()
        } else {
            earliest
        }
    }

    #[cold]
    fn earliest_of_ties(&self) -> usize {
        let mut earliest = 0;
        for child in 1..4 {
            if self.0[child].precedes(&self.0[earliest]) {
                earliest = child;
            }
        }
        earliest
    }
}

/// Stands in places beyond the end, later than any event.
fn nothing() -> Event {
    Event::new(f64::INFINITY, 0, EventKind::Crossing { axis: 0 })
}

#[inline]
fn first_child(place: usize) -> usize {
    4 * place - 8
}

#[inline]
fn parent(place: usize) -> usize {
    place / 4 + 2
}
