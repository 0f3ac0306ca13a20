//! Finds everybody's neighbours: all whom a ball may touch in a window, whatever happens to both of them in it.

use prefetch_index::prefetch_index;

use super::{Candidate, LISTS_AHEAD, LOADED_AT_ONCE, MANY_CANDIDATES, Passage, Region};
use crate::engine::image::{IMAGE_SHIFT, Seen, image_at, image_of, number_of, steps_of};
use crate::engine::windowed::filter::ReadAhead;
use crate::engine::windowed::paths::Gas;
use crate::engine::windowed::pieces::Id;
use crate::engine::windowed::sheet::{LANES, Row};
use crate::engine::windowed::shelves::{Images, Passers, Shelves, View};
use crate::state::Trajectory;

/// How many cells before its turn the memory for a cell and its flights' neighbours is asked for.
const CELLS_AHEAD: usize = 4;

impl Region {
    /// Lists a flight around where it begins, and notes where it meets what bounds the domain.
    pub(super) fn list_around(&mut self, gas: Gas, id: Id, flight: &Trajectory, ball: u32) {
        let place = flight.position_at(gas.window.begin);
        self.ways
            .add(&gas, id, [place; 2], gas.state.bodies.largest_radius());
        if let Some((time, bound)) = gas.next_bound(flight, ball, gas.body(ball)) {
            let meeting = gas.meeting_with(bound, time, id, (ball, id));
            self.meetings.push(meeting);
        }
    }

    /// Finds who is whose neighbour, after the others' `mail` has been listed, and the first meetings; those of other regions'
    /// flights go into the outbox.
    pub fn find_neighbours(&mut self, shelves: Shelves, mail: &[Vec<Passage>]) {
        self.outbox.clear();
        self.deliver(mail);
        self.census = self.lists.take_census();
        self.neighbours.reset(self.flights.clone());
        for cell in self.lists.cells() {
            self.lists.read_ahead(cell + LISTS_AHEAD);
            let ahead = cell + CELLS_AHEAD;
            for &entry in self.lists.entries_if_here(ahead) {
                self.neighbours.read_ahead(number_of(entry));
            }
            self.note_neighbours(&shelves, cell, ahead);
            if self.candidates.len() >= MANY_CANDIDATES {
                self.meet_neighbours(&shelves);
            }
        }
        self.meet_neighbours(&shelves);
    }

    /// Notes the neighbours that others have found.
    pub fn deliver_neighbours<'m>(&mut self, mail: impl IntoIterator<Item = &'m Passage>) {
        for &(entry, flight) in mail {
            self.neighbours.note(flight, entry);
        }
    }

    /// Which of some neighbours a ball may touch whose flight begins in the window ([`super::Filter::touching`]).
    #[inline]
    pub fn touching(&self, row: &Row, partner: u32, others: &[Row; LANES]) -> u64 {
        self.filter.touching(row, partner, others)
    }

    /// Notes who are neighbours in a cell, and who of them may meet. Meanwhile it asks for the memory of the flights that pass the
    /// cell `ahead`.
    fn note_neighbours(&mut self, shelves: &Shelves, cell: usize, ahead: usize) {
        let Self {
            lists,
            neighbours,
            filter,
            spare_sheet,
            candidates,
            outbox,
            ..
        } = self;
        let gas = &shelves.gas;
        let entries = lists.entries(cell);
        let view = View { shelves, own: None };
        let pieces = Passers { view, entries };
        let firsts = gas.firsts(cell);
        let ahead = ReadAhead {
            lines: shelves.lines,
            entries: lists.entries_if_here(ahead),
        };
        let (pairs, touching) = if gas.is_periodic() {
            filter.neighbours(spare_sheet, Images(pieces), firsts, ahead)
        } else {
            filter.neighbours(spare_sheet, pieces, firsts, ahead)
        };
        let rows = spare_sheet.rows();
        for (&(row, other), &touching) in pairs.iter().zip(touching) {
            let seen = [row, other].map(|row| entries[row as usize]);
            let flights = seen.map(number_of);
            let [one, two] =
                [[0, 1], [1, 0]].map(|[from, to]| flights[to] | between(seen[from], seen[to]));
            for (flight, neighbour) in [(flights[0], one), (flights[1], two)] {
                if !neighbours.note(flight, neighbour) {
                    outbox.push((neighbour, flight));
                }
            }
            if touching {
                let balls = [row, other].map(|row| rows[row as usize].ball());
                for ball in balls {
                    prefetch_index(&gas.state.trajectories, ball as usize);
                }
                let candidate = Candidate {
                    entries: seen,
                    balls,
                    owners: flights,
                    cell: cell as u32,
                    generation: 0,
                };
                candidates.push(candidate.in_order());
            }
        }
    }

    /// Decides which of the candidates meet.
    fn meet_neighbours(&mut self, shelves: &Shelves) {
        let flights = &shelves.gas.state.trajectories;
        for candidates in self.candidates.chunks(LOADED_AT_ONCE) {
            // Loaded on their own, that the memory can be asked for several at a time.
            let load = |candidate: &Candidate| candidate.balls.map(|ball| flights[ball as usize]);
            self.loaded.clear();
            self.loaded.extend(candidates.iter().map(load));
            for (candidate, pair) in candidates.iter().zip(&self.loaded) {
                if let Some(meeting) = candidate.meeting(&shelves.gas, pair, None) {
                    self.meetings.push(meeting);
                }
            }
        }
        self.candidates.empty();
    }
}

/// As bits above a neighbour's number: the image at which a flight must be to touch it, both seen in one cell.
#[inline(always)]
fn between(flight: Seen, neighbour: Seen) -> u32 {
    if image_of(flight) == image_of(neighbour) {
        return 0;
    }
    let [from, to] = [flight, neighbour].map(|seen| steps_of(image_of(seen)));
    image_at(std::array::from_fn(|axis| from[axis] - to[axis])) << IMAGE_SHIFT
}
