//! A stretch of cells along the curve and the flights in it: what one thread lists and searches.
//!
//! Threads share what is fixed in a phase and own their region; what concerns another region's cells goes into an outbox that
//! is delivered between the phases. How many regions there are changes no meeting.

mod candidate;
mod neighbours;

use std::ops::Range;

use prefetch_index::prefetch_index;
use pulp::Arch;

use super::agenda::Found;
use super::filter::{Filter, ReadAhead};
use super::grid::{Entry, listed_at};
use super::listing::{Flights, Listing};
use super::lists::{Census, Lists};
use super::neighbours::Neighbours;
use super::paths::Gas;
use super::pieces::{FIRST, Id, NONE, Origin, Piece, Pieces};
use super::questions::Margins;
use super::scratch::Scratch;
use super::sheet::Sheet;
use super::shelves::{Images, Passers, Shelves, View};
use super::ways::Ways;
use crate::engine::contact;
use crate::engine::image::number_of;
use crate::state::Trajectory;
use candidate::Candidate;

/// Cells that are searched before what they brought about is followed up.
const CELLS_AT_ONCE: usize = 64;

/// How many cells before its search the memory for a cell is asked for.
const CELLS_AHEAD: usize = 2;

/// How many cells before its search the memory for a cell's list is asked for.
const LISTS_AHEAD: usize = 6;

/// How many passages before its turn the memory for one from elsewhere is asked for.
const MAIL_AHEAD: usize = 16;

/// Candidates, or flights that need a closer look, that are loaded together.
const LOADED_AT_ONCE: usize = 256;

/// Pairs after which they are sifted before more are looked for: few enough that they stay at hand.
const MANY_DOUBTS: usize = 64;

/// Candidates after which they are decided before more are looked for.
const MANY_CANDIDATES: usize = 16 * LOADED_AT_ONCE;

/// Collisions that may follow one another and be foreseen; the others wait until their turn comes.
const MOST_GENERATIONS: u32 = 3;

/// Most pieces that are foreseen, for each flight of a region and in all regions alike: where there would be more, a window ends
/// long before them.
const MOST_FORESEEN: [usize; 2] = [1, 256];

/// An entry that belongs into another region's cell.
pub type Passage = (Entry, u32);

/// What one thread lists and searches.
#[derive(Clone, Debug, Default)]
pub struct Region {
    /// Which region this is.
    pub number: usize,
    /// Its flights.
    pub flights: Range<usize>,
    /// What passes its cells.
    pub lists: Lists,
    /// How often the flights pass its cells in the window, and how many pairs of them pass one cell.
    pub census: Census,
    /// In windows in which every ball knows its neighbours: those of each flight, at their images.
    pub neighbours: Neighbours,
    /// Meetings found here.
    pub meetings: Found,
    /// Passages through other regions' cells.
    pub outbox: Vec<Passage>,
    filter: Filter,
    /// The sheets of the cells that are searched together, the first of these cells, and a sheet for any other cell.
    sheets: Vec<Sheet>,
    on_sheets: usize,
    spare_sheet: Sheet,
    ways: Ways,
    candidates: Scratch<Candidate>,
    loaded: Vec<[Trajectory; 2]>,
    aside: Scratch<(Id, u32)>,
    aside_loaded: Vec<Trajectory>,
    /// Cells before this one have been searched.
    searched: usize,
    /// Those of them in which something has been listed since.
    pending: Vec<u32>,
}

/// The pieces that a region adds in a phase, with their kind.
type Own<'p> = (usize, &'p mut Pieces);

/// Where pieces are found while these are added.
#[inline(always)]
fn view<'a>(shelves: &'a Shelves<'a>, own: Option<&'a Own>) -> View<'a> {
    View {
        shelves,
        own: own.map(|(kind, pieces)| (*kind, &**pieces)),
    }
}

/// Notes a meeting at the region's own pieces; gives whether it is the first so far of each of them. One that is not will hardly
/// come about, so what would follow is not worth foreseeing.
fn is_first(gas: &Gas, ids: [Id; 2], time: f64, (kind, pieces): (usize, &mut Pieces)) -> bool {
    let mut first = true;
    for id in ids {
        if let Piece::Other(of, _, place) = gas.numbering.piece(id)
            && of == kind
        {
            let earliest = &mut pieces.first_meetings[place];
            first &= time < *earliest;
            *earliest = earliest.min(time);
        }
    }
    first
}

impl Region {
    /// Makes this the region of these cells and of the flights that are in them now.
    pub fn reset(&mut self, number: usize, cells: Range<usize>, flights: Range<usize>) {
        let expected = 5 * flights.len() / (2 * cells.len().max(1));
        self.number = number;
        self.flights = flights;
        self.lists.reset(cells, expected);
    }

    /// Largest speed of any piece that was added or that it allows for.
    pub fn fastest(&self) -> f32 {
        self.filter.fastest()
    }

    /// Allows for other regions' pieces, if none is faster than this.
    pub fn allow(&mut self, fastest: f32) {
        self.filter.allow(fastest);
    }

    /// Moves the region's flights on to the window's beginning and lists them and the pieces that follow where they meet what
    /// bounds the domain.
    pub fn list(&mut self, gas: Gas, flights: Flights, margins: Margins, firsts: &mut Pieces) {
        self.lists.clear();
        self.meetings.begin(gas.window.span());
        self.outbox.clear();
        self.aside.empty();
        self.searched = 0;
        self.filter.begin_window(margins);
        Listing {
            gas,
            first: self.flights.start,
            flights,
            lists: &mut self.lists,
            outbox: &mut self.outbox,
            aside: &mut self.aside,
        }
        .run(Arch::new());
        let aside = std::mem::take(&mut self.aside);
        for aside in aside.chunks(LOADED_AT_ONCE) {
            // Loaded on their own, that the memory can be asked for several at a time.
            let flight = |&(_, ball): &(Id, u32)| gas.state.trajectories[ball as usize];
            self.aside_loaded.clear();
            self.aside_loaded.extend(aside.iter().map(flight));
            for (&(flight, ball), index) in aside.iter().zip(0..) {
                let trajectory = self.aside_loaded[index];
                if gas.drift.is_some() {
                    self.list_around(gas, flight, &trajectory, ball);
                    continue;
                }
                self.trace(gas, flight, trajectory, (ball, flight), |number, after| {
                    let line = gas.piece_line(after, ball);
                    let place = firsts.push(*after, line, Origin::of_flight(flight));
                    gas.numbering.id(FIRST, number, place)
                });
            }
            self.list_ways(&gas);
        }
        self.aside = aside;
    }

    /// Follows a piece and those after it, whose ways are then to be listed; `add` numbers these.
    #[inline(always)]
    fn trace(
        &mut self,
        gas: Gas,
        id: Id,
        trajectory: Trajectory,
        ball_and_owner: (u32, Id),
        mut add: impl FnMut(usize, &Trajectory) -> Id,
    ) {
        let Self {
            number,
            ways,
            meetings,
            ..
        } = self;
        gas.trace(
            id,
            trajectory,
            ball_and_owner,
            |after| add(*number, after),
            |id, ends, radius| ways.add(&gas, id, ends, radius),
            |meeting| meetings.push(meeting),
        );
    }

    /// Lists the ways that have been added.
    pub fn list_ways(&mut self, gas: &Gas) {
        let Self {
            lists,
            outbox,
            ways,
            pending,
            searched,
            ..
        } = self;
        let cells = lists.cells();
        ways.visit(gas, |target, id| {
            let (number, entry) = listed_at(target, id);
            let cell = number as usize;
            if !cells.contains(&cell) {
                outbox.push((entry, number));
            } else if lists.insert(cell, entry) && cell < *searched {
                pending.push(number);
            }
        });
    }

    /// Lists what the others' outboxes hold for this region's cells.
    fn deliver(&mut self, mail: &[Vec<Passage>]) {
        let cells = self.lists.cells();
        for mail in mail {
            for (index, &(entry, cell)) in mail.iter().enumerate() {
                if let Some(&(_, ahead)) = mail.get(index + MAIL_AHEAD) {
                    self.lists.tails().read_end_ahead(ahead as usize);
                }
                let cell = cell as usize;
                if cells.contains(&cell) && self.lists.insert(cell, entry) && cell < self.searched {
                    self.pending.push(cell as u32);
                }
            }
        }
    }

    /// Finds the meetings in the region's cells, after the others' `mail` has been listed, and lists the pieces that will follow.
    pub fn find(&mut self, shelves: Shelves, mail: &[Vec<Passage>], mut own: Own) {
        self.outbox.clear();
        self.deliver(mail);
        self.census = self.lists.take_census();
        let cells = self.lists.cells();
        for first in cells.clone().step_by(CELLS_AT_ONCE) {
            let end = (first + CELLS_AT_ONCE).min(cells.end);
            self.searched = end;
            self.begin_sheets(first);
            for cell in first..end {
                self.lists.read_ahead(cell + LISTS_AHEAD);
                self.search(&shelves, Some(&own), cell, Some(cell + CELLS_AHEAD));
                if self.candidates.len() >= MANY_CANDIDATES {
                    self.decide(&shelves, Some(&mut own));
                }
            }
            self.decide(&shelves, Some(&mut own));
            self.follow_up(&shelves, Some(&mut own));
        }
        // What is listed from now on is listed here and there: no cell has a sheet of its own.
        self.on_sheets = cells.end;
    }

    /// Takes empty sheets for the cells from `first` on.
    fn begin_sheets(&mut self, first: usize) {
        self.on_sheets = first;
        self.sheets.resize_with(CELLS_AT_ONCE, Sheet::default);
        self.sheets.iter_mut().for_each(Sheet::clear);
    }

    /// Whether a cell has a sheet, in which all its pieces are that have been searched.
    #[inline]
    fn has_sheet(&self, cell: usize) -> bool {
        cell.wrapping_sub(self.on_sheets) < self.sheets.len()
    }

    /// Finds the meetings of pieces that come from other regions; lists what follows if it has pieces to add.
    pub fn find_visitors(&mut self, shelves: Shelves, mail: &[Vec<Passage>], mut own: Option<Own>) {
        self.outbox.clear();
        self.deliver(mail);
        self.follow_up(&shelves, own.as_mut());
    }

    /// Adds a ball's piece that begins at a meeting and those that follow it to `own`; gives the piece. They are still to be listed,
    /// with [`Self::list_ways`].
    #[inline(always)]
    pub fn begin(
        &mut self,
        gas: Gas,
        trajectory: Trajectory,
        ball: u32,
        origin: Origin,
        (kind, own): Own,
    ) -> Id {
        let line = gas.piece_line(&trajectory, ball);
        self.filter.allow(line.speed());
        let id = gas.numbering.id(kind, self.number, own.lines.len());
        own.push(trajectory, line, origin);
        let further = Origin {
            parents: [NONE; 2],
            partner: NONE,
            ..origin
        };
        let owner = origin.owner;
        self.trace(gas, id, trajectory, (ball, owner), |number, after| {
            let line = gas.piece_line(after, ball);
            gas.numbering
                .id(kind, number, own.push(*after, line, further))
        });
        id
    }

    /// Searches cells in which something has been listed since they were searched, until there are none.
    fn follow_up(&mut self, shelves: &Shelves, mut own: Option<&mut Own>) {
        while !self.pending.is_empty() {
            let mut pending = std::mem::take(&mut self.pending);
            for (index, &cell) in pending.iter().enumerate() {
                let off_sheet = |index: usize| {
                    let cell = pending.get(index).map(|&cell| cell as usize);
                    cell.filter(|&cell| !self.has_sheet(cell))
                };
                if let Some(ahead) = off_sheet(index + LISTS_AHEAD) {
                    self.lists.read_ahead(ahead);
                }
                if let Some(ahead) = off_sheet(index + CELLS_AHEAD) {
                    let ahead = ReadAhead {
                        lines: shelves.lines,
                        entries: self.lists.entries(ahead),
                    };
                    ahead.read_rest();
                }
                self.search(shelves, own.as_deref(), cell as usize, None);
            }
            pending.clear();
            if self.pending.is_empty() {
                self.pending = pending;
            }
            self.decide(shelves, own.as_deref_mut());
        }
    }

    /// Finds which pieces of a cell may meet, but for those that have been searched before. Meanwhile it asks for the memory of the
    /// flights that pass the cell `ahead`.
    fn search(&mut self, shelves: &Shelves, own: Option<&Own>, cell: usize, ahead: Option<usize>) {
        let Self {
            lists,
            filter,
            sheets,
            on_sheets,
            spare_sheet,
            ..
        } = self;
        let view = view(shelves, own);
        let entries = lists.entries(cell);
        let tested = lists.tested(cell);
        let sheet = if let Some(sheet) = sheets.get_mut(cell.wrapping_sub(*on_sheets)) {
            sheet
        } else {
            spare_sheet.clear();
            spare_sheet
        };
        let pieces = Passers { view, entries };
        let here = (cell as u32, shelves.gas.grid.center(cell));
        let ahead = ReadAhead {
            lines: shelves.lines,
            entries: ahead.map_or(&[], |cell| lists.entries_if_here(cell)),
        };
        if shelves.gas.is_periodic() {
            filter.find(sheet, Images(pieces), tested, here, ahead);
        } else {
            filter.find(sheet, pieces, tested, here, ahead);
        }
        lists.set_tested(cell);
        if filter.doubts() >= MANY_DOUBTS {
            self.sift(shelves, own);
        }
    }

    /// Makes candidates of those pairs found that can meet.
    fn sift(&mut self, shelves: &Shelves, own: Option<&Own>) {
        let Self {
            filter, candidates, ..
        } = self;
        let view = view(shelves, own);
        filter.sift(|doubt| {
            let ids = doubt.entries.map(number_of);
            let origins = ids.map(|id| view.origin(id));
            if origins[0].parents.contains(&ids[1]) || origins[1].parents.contains(&ids[0]) {
                return;
            }
            let balls = doubt.balls();
            for ball in balls {
                prefetch_index(&shelves.gas.state.trajectories, ball as usize);
            }
            let candidate = Candidate {
                entries: doubt.entries,
                balls,
                owners: origins.map(|origin| origin.owner),
                cell: doubt.cell,
                generation: origins[0].generation.max(origins[1].generation),
            };
            candidates.push(candidate.in_order());
        });
    }

    /// Decides which candidates meet, and lists the pieces that will follow if they do.
    fn decide(&mut self, shelves: &Shelves, mut own: Option<&mut Own>) {
        self.sift(shelves, own.as_deref());
        let candidates = std::mem::take(&mut self.candidates);
        for candidates in candidates.chunks(LOADED_AT_ONCE) {
            let own = own.as_deref_mut();
            // Compiled for the machine that runs it, as the filter is: that makes the gas a twentieth faster.
            Arch::new().dispatch(|| self.decide_few(shelves, own, candidates));
        }
        self.candidates = candidates;
        self.candidates.empty();
    }

    #[inline(always)]
    fn decide_few(
        &mut self,
        shelves: &Shelves,
        mut own: Option<&mut Own>,
        candidates: &[Candidate],
    ) {
        let gas = shelves.gas;
        let found = view(shelves, own.as_deref());
        // Loaded on their own, that the memory can be asked for several at a time.
        self.loaded.clear();
        self.loaded.extend(candidates.iter().map(|candidate| {
            let [first, second] = candidate.entries.map(number_of);
            [
                *found.trajectory(first, candidate.balls[0]),
                *found.trajectory(second, candidate.balls[1]),
            ]
        }));
        for (index, candidate) in candidates.iter().enumerate() {
            let pair = self.loaded[index];
            // Only the cell that holds the contact point counts a meeting: both are listed there.
            let Some(mut meeting) = candidate.meeting(&gas, &pair, Some(candidate.cell)) else {
                continue;
            };
            let ids = [meeting.piece, meeting.other];
            if let Some((kind, pieces)) = own.as_deref_mut()
                && candidate.generation < MOST_GENERATIONS
                && !self.lists.is_crowded(candidate.cell as usize)
                && pieces.lines.len() < MOST_FORESEEN[0] * self.flights.len() + MOST_FORESEEN[1]
                && is_first(&gas, ids, meeting.time, (*kind, pieces))
            {
                let time = gas.window.instant(meeting.time);
                let bodies = candidate.balls.map(|ball| gas.body(ball));
                let shift = candidate.image(&gas).1;
                let (after, _) = contact::pair(candidate.balls, pair, bodies, shift, time);
                for one in [0, 1] {
                    meeting.next[one] = self.begin(
                        gas,
                        after[one],
                        candidate.balls[one],
                        Origin {
                            owner: meeting.owners[one],
                            parents: ids,
                            partner: candidate.balls[1 - one],
                            generation: candidate.generation + 1,
                        },
                        (*kind, pieces),
                    );
                }
            }
            self.meetings.push(meeting);
        }
        self.list_ways(&gas);
    }

    /// Lists pieces in cells of this region and finds their meetings with those listed there before.
    pub fn visit(&mut self, shelves: &Shelves, passages: &[Vec<Passage>]) {
        self.deliver(passages);
        self.follow_up(shelves, None);
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use crate::domain::{Boundary, Domain};
    use crate::engine::Engine;
    use crate::engine::windowed::Windowed;
    use crate::state::{Body, Placement, State};

    /// Balls on a lattice have their first collisions all at about the same time, where they see each other's flights and many
    /// that might follow.
    #[test]
    fn what_is_foreseen_does_not_fill_the_cells_of_a_lattice_that_melts() {
        const SIDE: i32 = 32;
        const SPACING: f64 = 2.9;
        let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
        let mut draw = || {
            let drawn: [f64; 3] = std::array::from_fn(|_| random.random_range(-1.0..1.0));
            DVec3::from_array(drawn)
        };
        let sites =
            (0..SIDE.pow(3)).map(|site| [site / SIDE / SIDE, site / SIDE % SIDE, site % SIDE]);
        let edge = SPACING * f64::from(SIDE);
        let position = |site: [i32; 3]| {
            DVec3::from_array(site.map(|step| (f64::from(step) + 0.5) * SPACING - 0.5 * edge))
        };
        let positions: Vec<_> = sites.map(position).collect();
        let state = State::new(&Placement {
            domain: Domain {
                boundary: Boundary::Periodic,
                ..Domain::container(DVec3::splat(0.5 * edge))
            },
            center: DVec3::ZERO,
            bodies: vec![Body {
                radius: 0.5,
                mass: 1.0,
            }],
            body_of: Vec::new(),
            velocities: positions.iter().map(|_| draw()).collect(),
            positions,
        });
        let mut engine = Windowed::with_regions(state, 2);
        for _ in 0..8 {
            let next = engine
                .state()
                .now
                .after(engine.window_length())
                .expect("a time");
            engine.advance(next, &mut |_| ()).expect("room to move");
        }
        let fullest = engine
            .regions
            .iter()
            .map(|region| region.lists.fullest())
            .max();
        assert!(fullest < Some(200), "{fullest:?}");
    }
}
