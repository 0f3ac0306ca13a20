//! Who is whose neighbour in a window: for each flight of a region a record in lines of memory of its own.

use std::ops::Range;

use prefetch_index::prefetch_index;

use super::pieces::Id;
use crate::engine::image::{IMAGE_SHIFT, Seen, image_at, image_of, number_of, steps_of};

/// Numbers in a line of memory.
const WORDS: usize = 16;

/// A line of memory.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
struct Words([u32; WORDS]);

/// The neighbours of a region's flights, each with the image at which the flight must be to touch it.
#[derive(Clone, Debug, Default)]
pub struct Neighbours {
    first: usize,
    /// How many each flight has.
    lengths: Vec<u16>,
    /// The first line of each flight, then the second one of each, and so on: hardly any needs more than one.
    words: Vec<Words>,
}

impl Neighbours {
    /// Forgets all; from now on the neighbours of these flights are noted.
    pub fn reset(&mut self, flights: Range<usize>) {
        let lines = (self.words.len() / self.lengths.len().max(1)).max(1);
        self.first = flights.start;
        self.lengths.clear();
        self.lengths.resize(flights.len(), 0);
        self.words.resize(flights.len() * lines, Words::default());
    }

    /// Notes a neighbour of a flight. Gives whether the flight is the region's.
    #[inline(always)]
    pub fn note(&mut self, flight: Id, neighbour: Seen) -> bool {
        let count = self.lengths.len();
        let flight = (flight as usize).wrapping_sub(self.first);
        let Some(length) = self.lengths.get_mut(flight) else {
            return false;
        };
        let place = *length as usize;
        *length += 1;
        let line = place / WORDS * count + flight;
        if line >= self.words.len() {
            self.words
                .resize(self.words.len() + count, Words::default());
        }
        self.words[line].0[place % WORDS] = neighbour;
        true
    }

    /// The neighbours of a flight, in parts of no more than [`WORDS`].
    #[inline(always)]
    pub fn of(&self, flight: Id) -> impl Iterator<Item = &[Seen]> {
        let flight = flight as usize - self.first;
        let mut left = self.lengths[flight] as usize;
        let lines = self.words[flight..].iter().step_by(self.lengths.len());
        lines.take(left.div_ceil(WORDS)).map(move |line| {
            let part = &line.0[..left.min(WORDS)];
            left -= part.len();
            part
        })
    }

    /// Moves the image at which a flight touches some of its neighbours by a step along an axis.
    pub fn move_image(&mut self, flight: Id, of: impl Fn(Id) -> bool, axis: usize, step: i8) {
        let (flight, count) = (flight as usize - self.first, self.lengths.len());
        let lines = self.words[flight..].iter_mut().step_by(count);
        let seen = lines.flat_map(|line| &mut line.0);
        for seen in seen.take(self.lengths[flight] as usize) {
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
        prefetch_index(&self.words, (flight as usize).wrapping_sub(self.first));
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
