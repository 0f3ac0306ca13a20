//! Who is whose neighbour in a window: for each flight of a region a record in lines of memory of its own.

use std::ops::Range;

use prefetch_index::prefetch_index;

use super::pieces::Id;
use super::scratch::Scratch;
use crate::engine::image::{IMAGE_SHIFT, Seen, image_at, image_of, number_of, steps_of};

/// Neighbours in a line of memory.
const ROOM: usize = 15;

/// A line of memory: some neighbours, and where the others are.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
struct Line {
    seen: [Seen; ROOM],
    /// The next line, among all the further ones.
    next: u32,
}

/// The neighbours of a region's flights, each with the image at which the flight must be to touch it.
#[derive(Clone, Debug, Default)]
pub struct Neighbours {
    first: usize,
    /// How many each flight has.
    lengths: Vec<u16>,
    /// The first line of each flight.
    lines: Vec<Line>,
    /// The further ones of all: hardly any flight needs one.
    further: Scratch<Line>,
}

impl Neighbours {
    /// Forgets all; from now on the neighbours of these flights are noted.
    pub fn reset(&mut self, flights: Range<usize>) {
        self.first = flights.start;
        self.lengths.clear();
        self.lengths.resize(flights.len(), 0);
        self.lines.resize(flights.len(), Line::default());
        self.further.empty();
    }

    /// Notes a neighbour of a flight. Gives whether the flight is the region's.
    #[inline(always)]
    pub fn note(&mut self, flight: Id, neighbour: Seen) -> bool {
        let flight = (flight as usize).wrapping_sub(self.first);
        let Some(length) = self.lengths.get_mut(flight) else {
            return false;
        };
        let place = *length as usize;
        *length += 1;
        if place < ROOM {
            self.lines[flight].seen[place] = neighbour;
        } else {
            self.note_further(flight, place, neighbour);
        }
        true
    }

    #[cold]
    fn note_further(&mut self, flight: usize, place: usize, neighbour: Seen) {
        let number = place / ROOM;
        if place.is_multiple_of(ROOM) {
            let new = self.further.len() as u32;
            self.line_mut(flight, number - 1).next = new;
            self.further.push(Line::default());
        }
        self.line_mut(flight, number).seen[place % ROOM] = neighbour;
    }

    /// A line of a flight, by its number.
    fn line_mut(&mut self, flight: usize, number: usize) -> &mut Line {
        if number == 0 {
            return &mut self.lines[flight];
        }
        let first = self.lines[flight].next;
        let place = (1..number).fold(first, |place, _| self.further[place as usize].next);
        &mut self.further[place as usize]
    }

    /// The neighbours of a flight, in parts of no more than [`ROOM`].
    #[inline(always)]
    pub fn of(&self, flight: Id) -> impl Iterator<Item = &[Seen]> {
        let flight = flight as usize - self.first;
        let mut left = self.lengths[flight] as usize;
        let mut line = &self.lines[flight];
        std::iter::from_fn(move || {
            let part = &line.seen[..left.min(ROOM)];
            left -= part.len();
            if left > 0 {
                line = &self.further[line.next as usize];
            }
            (!part.is_empty()).then_some(part)
        })
    }

    /// Moves the image at which a flight touches some of its neighbours by a step along an axis.
    pub fn move_image(&mut self, flight: Id, of: impl Fn(Id) -> bool, axis: usize, step: i8) {
        let flight = flight as usize - self.first;
        for place in 0..self.lengths[flight] as usize {
            let seen = &mut self.line_mut(flight, place / ROOM).seen[place % ROOM];
            let number = number_of(*seen);
            if of(number) {
                let mut steps = steps_of(image_of(*seen));
                steps[axis] += step;
                *seen = number | image_at(steps) << IMAGE_SHIFT;
            }
        }
    }

    /// Asks for the memory of a flight's neighbours.
    #[inline(always)]
    pub fn read_ahead(&self, flight: Id) {
        prefetch_index(&self.lines, (flight as usize).wrapping_sub(self.first));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_has_the_neighbours_that_were_noted_however_many() {
        let mut neighbours = Neighbours::default();
        for most in [3, 40, 3] {
            neighbours.reset(5..9);
            assert!(!neighbours.note(4, 0) && !neighbours.note(9, 0));
            for number in 0..most {
                for flight in 5..9 {
                    assert!(neighbours.note(flight, 100 * flight + number));
                }
            }
            let step = image_at([1, 0, 0]) << IMAGE_SHIFT;
            neighbours.move_image(7, |number| number == 702, 0, 1);
            for flight in 5..9 {
                let noted: Vec<_> = neighbours.of(flight).flatten().copied().collect();
                let mut expected: Vec<_> = (0..most).map(|number| 100 * flight + number).collect();
                expected[2] |= if flight == 7 { step } else { 0 };
                assert_eq!(noted, expected);
            }
        }
    }
}
