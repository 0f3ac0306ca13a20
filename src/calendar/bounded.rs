//! Calendar `bounded`: a ring of bins over a window of time, so that the cost of an event does not grow with the number of
//! balls.
//!
//! Time is cut into bins that hold a few events each. The bin that is due is kept in order by a small heap; those of the
//! window ahead are unordered lists; what lies beyond is one more list, sorted into the ring each time it has turned once.
//!
//! What always holds: bins before and at `due` are in the heap; a list holds one bin, at most a turn ahead; the list beyond
//! holds nothing that lies before the end of this turn. Equal times share a bin, so ties are the heap's alone.
//!
//! Source: Paul, J. Comput. Phys. 221, 615 (2007). Added here: the width of the bins follows from the events themselves.

use prefetch_index::prefetch_index;

use crate::calendar::{Calendar, Indexed};
use crate::event::Event;

/// Events that a bin should hold near the present: few enough for a shallow heap, enough to make empty bins rare.
const EVENTS_PER_BIN: f64 = 4.0;

/// Bins after the one that is due whose events are given as approaching: enough to hide the memory's latency, few enough that
/// what they need stays in the cache; measured to be best, and flat around.
const BINS_AHEAD: u64 = 4;

/// Length of the window in median times to an event: few events lie beyond it.
const MEDIANS_PER_WINDOW: f64 = 8.0;

/// Fewest bins.
const FEWEST_BINS: usize = 16;

/// Narrowest bin \[epochs\]: where all events are due at once, any width serves.
const NARROWEST: f64 = 1.0 / (1_u64 << 40) as f64;

/// Most events that the median is taken from.
const SAMPLE: usize = 1024;

/// Ends a list.
const END: u32 = u32::MAX;

/// Instead of a list: the ball has no event.
const ABSENT: u32 = u32::MAX;

/// Instead of a list: the ball's event is in the heap.
const IN_HEAP: u32 = u32::MAX - 1;

/// A ball's event and its place.
#[derive(Clone, Copy, Debug)]
struct Entry {
    event: Event,
    list: u32,
    previous: u32,
    next: u32,
}

/// Up to where the approaching events have been given.
#[derive(Clone, Copy, Debug)]
struct Walk {
    bin: u64,
    /// The next ball of that bin's list; a hint, for its event may have moved.
    ball: u32,
}

/// The events of each ball in bins of time.
#[derive(Clone, Debug)]
pub struct Bounded {
    entries: Vec<Entry>,
    /// First ball of each bin's list; the last list holds what lies beyond the window.
    heads: Vec<u32>,
    per_width: f64,
    /// The bin whose events are in the heap, counted from time zero.
    due: u64,
    walk: Walk,
    heap: Indexed,
    in_ring: usize,
    beyond: usize,
}

impl Calendar for Bounded {
    fn new(ball_count: usize) -> Self {
        let nothing = Event::new(0.0, 0, crate::event::EventKind::Crossing { axis: 0 });
        let nowhere = Entry {
            event: nothing,
            list: ABSENT,
            previous: END,
            next: END,
        };
        Self {
            entries: vec![nowhere; ball_count],
            heads: vec![END; FEWEST_BINS + 1],
            per_width: 1.0,
            due: 0,
            walk: Walk { bin: 0, ball: END },
            heap: Indexed::new(ball_count),
            in_ring: 0,
            beyond: 0,
        }
    }

    fn len(&self) -> usize {
        self.heap.len() + self.in_ring + self.beyond
    }

    #[inline]
    fn first(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.heap.first() {
                return Some(event);
            }
            if self.in_ring > 0 {
                self.turn();
            } else if self.beyond > 0 {
                self.leap();
            } else {
                return None;
            }
        }
    }

    #[inline]
    fn approaching(&mut self) -> Option<Event> {
        loop {
            let list = self.list_of(self.walk.bin);
            if let Some(entry) = self.entries.get(self.walk.ball as usize)
                && entry.list == list
            {
                self.walk.ball = entry.next;
                prefetch_index(&self.entries, entry.next as usize);
                self.heap.prefetch(entry.event.ball);
                return Some(entry.event);
            }
            if self.walk.bin >= self.due + BINS_AHEAD {
                return None;
            }
            let bin = self.walk.bin.max(self.due) + 1;
            let ball = self.heads[self.list_of(bin) as usize];
            let later = self.heads[self.list_of(bin + 1) as usize];
            prefetch_index(&self.entries, later as usize);
            self.walk = Walk { bin, ball };
        }
    }

    #[inline]
    fn set(&mut self, event: Event) {
        let bin = self.bin_at(event.time);
        let list = self.entries[event.ball as usize].list;
        if list == IN_HEAP && bin <= self.due {
            self.heap.set(event); // it stays in the heap
            return;
        }
        self.remove(event.ball);
        self.insert(event, bin);
    }

    fn remove(&mut self, ball: u32) {
        let Entry {
            list,
            previous,
            next,
            ..
        } = self.entries[ball as usize];
        if list == ABSENT {
            return;
        }
        self.entries[ball as usize].list = ABSENT;
        if list == IN_HEAP {
            self.heap.remove(ball);
            return;
        }
        if previous == END {
            self.heads[list as usize] = next;
        } else {
            self.entries[previous as usize].next = next;
        }
        if next != END {
            self.entries[next as usize].previous = previous;
        }
        *self.count_of(list) -= 1;
    }

    fn rebase(&mut self, _epochs: f64, events: impl Iterator<Item = Event>) {
        let events: Vec<Event> = events.collect();
        let (width, bins) = layout(&events);
        *self = Self {
            heads: vec![END; bins + 1],
            per_width: 1.0 / width,
            ..Self::new(self.entries.len())
        };
        let first = events
            .iter()
            .fold(f64::INFINITY, |first, event| first.min(event.time));
        if first < f64::INFINITY {
            self.due = self.bin_at(first);
        }
        for event in events {
            self.insert(event, self.bin_at(event.time));
        }
    }
}

impl Bounded {
    /// Bins of the ring.
    fn bins(&self) -> u64 {
        self.heads.len() as u64 - 1
    }

    /// The list of a bin, if it lies in the window.
    #[inline]
    fn list_of(&self, bin: u64) -> u32 {
        (bin % self.bins()) as u32
    }

    /// The list of what lies beyond the window.
    fn beyond_list(&self) -> u32 {
        self.heads.len() as u32 - 1
    }

    fn count_of(&mut self, list: u32) -> &mut usize {
        if list == self.beyond_list() {
            &mut self.beyond
        } else {
            &mut self.in_ring
        }
    }

    #[inline]
    fn bin_at(&self, time: f64) -> u64 {
        (time * self.per_width) as u64
    }

    /// Puts an event of a ball that has none where it belongs.
    #[inline]
    fn insert(&mut self, event: Event, bin: u64) {
        let ball = event.ball;
        if bin <= self.due {
            self.entries[ball as usize].list = IN_HEAP;
            self.heap.set(event);
            return;
        }
        let list = if bin - self.due < self.bins() {
            self.list_of(bin)
        } else {
            self.beyond_list()
        };
        let next = std::mem::replace(&mut self.heads[list as usize], ball);
        self.entries[ball as usize] = Entry {
            event,
            list,
            previous: END,
            next,
        };
        if next != END {
            self.entries[next as usize].previous = ball;
        }
        *self.count_of(list) += 1;
    }

    /// Goes on to the next bin; there are events in the ring.
    fn turn(&mut self) {
        self.due += 1;
        if self.due.is_multiple_of(self.bins()) {
            self.sort_in();
        }
        self.empty(self.list_of(self.due));
    }

    /// Goes on to the first event beyond the window; there is nothing before it.
    fn leap(&mut self) {
        let mut earliest = u64::MAX;
        let mut ball = self.heads[self.beyond_list() as usize];
        while ball != END {
            let entry = &self.entries[ball as usize];
            earliest = earliest.min(self.bin_at(entry.event.time));
            ball = entry.next;
        }
        self.due = earliest;
        self.sort_in();
    }

    /// Sorts what lies beyond the window as it was into the window as it is.
    fn sort_in(&mut self) {
        self.empty(self.beyond_list());
    }

    /// Takes all events out of a list and puts each where it now belongs.
    fn empty(&mut self, list: u32) {
        let mut ball = std::mem::replace(&mut self.heads[list as usize], END);
        while ball != END {
            let Entry { event, next, .. } = self.entries[ball as usize];
            *self.count_of(list) -= 1;
            self.insert(event, self.bin_at(event.time));
            ball = next;
        }
    }
}

/// Width of a bin \[epochs\] and number of bins for these events.
///
/// Waiting times that fall off exponentially put `n ln 2 / median` events into a unit of time near the present.
fn layout(events: &[Event]) -> (f64, usize) {
    let mut times: Vec<f64> = events
        .iter()
        .step_by(events.len() / SAMPLE + 1)
        .map(|event| event.time)
        .collect();
    if times.is_empty() {
        return (1.0, FEWEST_BINS);
    }
    times.sort_by(f64::total_cmp);
    let median = times[times.len() / 2] - times[0];
    let density = std::f64::consts::LN_2 * events.len() as f64;
    let width = (EVENTS_PER_BIN / density * median).max(NARROWEST);
    let bins = (MEDIANS_PER_WINDOW * density / EVENTS_PER_BIN) as usize;
    (width, bins.max(FEWEST_BINS))
}
