//! A stretch of cells along the curve and the balls in it: what one thread lists and searches.
//!
//! Threads share what is fixed in a phase and own their region; what concerns another region's cells goes into an outbox that
//! is delivered between the phases. How many regions there are changes no meeting.

use std::ops::Range;

use glam::DVec3;

use super::filter::{Filter, Start};
use super::grid::{Grid, Lists};
use super::meeting::{AT_WALL, Meeting};
use super::pieces::{Id, NONE, Piece, Pieces};
use crate::collision::{pair_time, wall_time};
use crate::engine::contact;
use crate::event::Wall;
use crate::state::{Body, State, Time, Trajectory};

/// A window of time, ends included.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// When it begins.
    pub begin: Time,
    /// When it ends.
    pub end: Time,
}

impl Window {
    /// The instant that lies `time` epochs after the beginning of the window's first epoch.
    pub fn instant(self, time: f64) -> Time {
        let whole = time as u64;
        Time {
            epoch: self.begin.epoch + whole,
            local: time - whole as f64,
        }
    }

    /// Where a piece's path in the window begins and ends; `hit` is when it reaches a wall.
    fn path(self, trajectory: &Trajectory, hit: Option<Time>) -> (DVec3, DVec3) {
        let from = if trajectory.begin > self.begin {
            trajectory.begin
        } else {
            self.begin
        };
        (
            trajectory.position_at(from),
            trajectory.position_at(hit.unwrap_or(self.end)),
        )
    }

    /// Where a piece would be at the window's beginning.
    fn start(self, trajectory: &Trajectory) -> Start {
        Start::new(trajectory.position_at(self.begin), trajectory.velocity)
    }
}

/// A piece and a cell that it passes.
pub type Passage = (Id, u32);

/// What all threads read while they list.
#[derive(Clone, Copy)]
pub struct Gas<'a> {
    /// Bodies and domain.
    pub state: &'a State,
    /// The cells.
    pub grid: &'a Grid,
    /// The flights with which the balls enter the window, and whose they are.
    pub flights: &'a [Trajectory],
    pub balls: &'a [u32],
    /// The window.
    pub window: Window,
}

impl Gas<'_> {
    fn body(&self, owner: u32) -> Body {
        self.state.bodies.of(self.balls[owner as usize] as usize)
    }

    /// The first wall that a piece reaches in the window.
    fn next_wall(&self, trajectory: &Trajectory, body: Body) -> Option<(Time, Wall)> {
        let mut hit: Option<(Time, Wall)> = None;
        for axis in 0..3 {
            let speed = trajectory.velocity[axis];
            let limit = (self.state.domain.half_size[axis] - body.radius).copysign(speed);
            if let Some(time) = wall_time(trajectory, axis, limit)
                && time <= self.window.end
                && hit.is_none_or(|(earliest, _)| time < earliest)
            {
                hit = Some((
                    time,
                    Wall {
                        axis,
                        upper: speed > 0.0,
                    },
                ));
            }
        }
        hit
    }

    /// Follows a piece through its wall hits to the end of the window: `pass` gets each piece's number with each of its cells,
    /// `hit` each wall hit, `add` numbers each further piece.
    pub fn trace(
        &self,
        id: Id,
        trajectory: Trajectory,
        owner: u32,
        mut add: impl FnMut(Trajectory, Start) -> Id,
        mut pass: impl FnMut(usize, Id),
        mut hit: impl FnMut(Meeting),
    ) {
        let body = self.body(owner);
        let (mut id, mut trajectory) = (id, trajectory);
        loop {
            let wall = self.next_wall(&trajectory, body);
            let (from, to) = self.window.path(&trajectory, wall.map(|(time, _)| time));
            self.grid
                .reach(from, to, body.radius)
                .for_each(|place| pass(self.grid.cell(place), id));
            let Some((time, wall)) = wall else { return };
            let ball = self.balls[owner as usize];
            let limit = self.state.domain.half_size[wall.axis] - body.radius;
            let (after, _) = contact::wall(ball, trajectory, body, wall, limit, time);
            let next = add(after, self.window.start(&after));
            let number = 2 * wall.axis as u32 + u32::from(wall.upper);
            hit(Meeting {
                time: time.relative_to(self.window.begin.epoch),
                piece: id,
                other: AT_WALL + number,
                next: [next, NONE],
                rank: (ball, number),
            });
            (id, trajectory) = (next, after);
        }
    }
}

/// Where pieces are found by their numbers.
#[derive(Clone, Copy)]
pub struct Shelves<'a> {
    /// The flights and what all threads read.
    pub gas: Gas<'a>,
    /// The flights' starts.
    pub starts: &'a [Start],
    /// First pieces, by region.
    pub firsts: &'a [Pieces],
    /// Fresh pieces.
    pub fresh: Fresh<'a>,
}

/// Which fresh pieces are in sight.
#[derive(Clone, Copy)]
pub enum Fresh<'a> {
    /// Those of one region; no other's are listed there yet.
    Of(&'a Pieces),
    /// Those of all regions.
    In(&'a [Region]),
}

impl<'a> Shelves<'a> {
    #[inline]
    fn fresh(&self, region: usize) -> &'a Pieces {
        match self.fresh {
            Fresh::Of(pieces) => pieces,
            Fresh::In(regions) => &regions[region].fresh,
        }
    }

    /// A piece.
    #[inline]
    pub fn trajectory(&self, id: Id) -> &'a Trajectory {
        match Piece::of(id) {
            Piece::Flight(flight) => &self.gas.flights[flight],
            Piece::First(region, place) => &self.firsts[region].trajectories[place],
            Piece::Fresh(region, place) => &self.fresh(region).trajectories[place],
        }
    }

    #[inline]
    fn start(&self, id: Id) -> &'a Start {
        match Piece::of(id) {
            Piece::Flight(flight) => &self.starts[flight],
            Piece::First(region, place) => &self.firsts[region].starts[place],
            Piece::Fresh(region, place) => &self.fresh(region).starts[place],
        }
    }

    /// The flight that a piece belongs to.
    #[inline]
    pub fn owner(&self, id: Id) -> u32 {
        match Piece::of(id) {
            Piece::Flight(flight) => flight as u32,
            Piece::First(region, place) => self.firsts[region].owners[place],
            Piece::Fresh(region, place) => self.fresh(region).owners[place],
        }
    }

    fn parents(&self, id: Id) -> [Id; 2] {
        match Piece::of(id) {
            Piece::Flight(_) | Piece::First(..) => [NONE; 2],
            Piece::Fresh(region, place) => self.fresh(region).parents[place],
        }
    }

    /// The ball that a piece belongs to.
    pub fn ball(&self, id: Id) -> u32 {
        self.gas.balls[self.owner(id) as usize]
    }

    fn radius(&self, id: Id) -> f64 {
        self.gas.body(self.owner(id)).radius
    }

    /// The meeting of two pieces in the window, if they meet in this cell.
    fn meeting(&self, piece: Id, other: Id, cell: usize) -> Option<Meeting> {
        let balls = [self.ball(piece), self.ball(other)];
        if balls[0] == balls[1]
            || self.parents(piece).contains(&other)
            || self.parents(other).contains(&piece)
        {
            return None;
        }
        let window = self.gas.window;
        let radii = [self.radius(piece), self.radius(other)];
        let pair = [self.trajectory(piece), self.trajectory(other)];
        let time =
            pair_time(pair[0], pair[1], radii[0] + radii[1]).filter(|&time| time <= window.end)?;
        // Only the cell that holds the contact point counts the meeting: both are listed there.
        let places = pair.map(|trajectory| trajectory.position_at(time));
        let contact = places[0] + (places[1] - places[0]) * (radii[0] / (radii[0] + radii[1]));
        (self.gas.grid.cell_at(contact) == cell).then(|| Meeting {
            time: time.relative_to(window.begin.epoch),
            piece,
            other,
            next: [NONE; 2],
            rank: (balls[0].min(balls[1]), balls[0].max(balls[1])),
        })
    }
}

/// A filter and what it has let through.
#[derive(Clone, Debug, Default)]
pub struct Lookout {
    filter: Filter,
    hits: Vec<(u32, u32)>,
}

impl Lookout {
    /// Begins a window.
    pub fn begin_window(&mut self, contact: f64, extent: f64) {
        self.filter.begin_window(contact, extent);
    }

    /// Finds the meetings of a piece that has just been listed in a cell with those listed there before it.
    pub fn look(
        &mut self,
        shelves: &Shelves,
        lists: &Lists,
        (piece, cell): Passage,
        found: &mut Vec<Meeting>,
    ) {
        let listed = lists.pieces(cell as usize);
        let row = listed
            .iter()
            .rposition(|&other| other == piece)
            .expect("the piece has just been listed here");
        self.filter
            .begin_cell(row + 1, listed[..=row].iter().map(|&id| shelves.start(id)));
        self.hits.clear();
        self.filter.find(row, &mut self.hits);
        for &(_, other) in &self.hits {
            found.extend(shelves.meeting(piece, listed[other as usize], cell as usize));
        }
    }
}

/// What one thread lists and searches.
#[derive(Clone, Debug)]
pub struct Region {
    /// Which region this is.
    pub number: usize,
    /// Its flights.
    pub flights: Range<usize>,
    /// What passes its cells.
    pub lists: Lists,
    /// Pieces that follow pair collisions foreseen or carried out here.
    pub fresh: Pieces,
    /// Meetings found here.
    pub meetings: Vec<Meeting>,
    /// Largest component of its flights' velocities.
    pub fastest: f64,
    /// Passages through other regions' cells.
    pub outbox: Vec<Passage>,
    filter: Filter,
    lookout: Lookout,
    hits: Vec<(u32, u32)>,
    passages: Vec<Passage>,
}

impl Region {
    /// A region of these cells and flights.
    pub fn new(number: usize, cells: Range<usize>, flights: Range<usize>) -> Self {
        let expected = 4 * flights.len() / cells.len().max(1);
        Self {
            number,
            flights,
            lists: Lists::new(cells, expected),
            fresh: Pieces::default(),
            meetings: Vec::new(),
            fastest: 0.0,
            outbox: Vec::new(),
            filter: Filter::default(),
            lookout: Lookout::default(),
            hits: Vec::new(),
            passages: Vec::new(),
        }
    }

    /// Lists the region's flights and those that follow their wall hits. `starts` are those of its flights.
    pub fn list(&mut self, gas: Gas, starts: &mut [Start], firsts: &mut Pieces) {
        self.lists.clear();
        self.fresh.clear();
        self.meetings.clear();
        self.outbox.clear();
        firsts.clear();
        let cells = self.lists.cells();
        let half_size = gas.state.domain.half_size;
        let (number, lists, outbox, meetings) = (
            self.number,
            &mut self.lists,
            &mut self.outbox,
            &mut self.meetings,
        );
        let mut pass = |cell: usize, id: Id| {
            if cells.contains(&cell) {
                lists.insert(cell, id);
            } else {
                outbox.push((id, cell as u32));
            }
        };
        self.fastest = 0.0;
        for (flight, start) in self.flights.clone().zip(starts) {
            let trajectory = gas.flights[flight];
            self.fastest = self.fastest.max(trajectory.velocity.abs().max_element());
            let (from, to) = gas.window.path(&trajectory, None);
            *start = Start::new(from, trajectory.velocity);
            let radius = gas.body(flight as u32).radius;
            if to.abs().cmpge(half_size - radius).any() {
                let add = |after, start| {
                    Piece::First(number, firsts.push(after, start, flight as u32, [NONE; 2])).id()
                };
                gas.trace(
                    flight as u32,
                    trajectory,
                    flight as u32,
                    add,
                    &mut pass,
                    |meeting| meetings.push(meeting),
                );
            } else {
                gas.grid
                    .reach(from, to, radius)
                    .for_each(|place| pass(gas.grid.cell(place), flight as u32));
            }
        }
    }

    /// Finds the meetings in the region's cells, after the others' `mail` has been listed. `contact` is the largest contact
    /// distance, `extent` bounds all coordinates.
    pub fn find(
        &mut self,
        gas: Gas,
        starts: &[Start],
        firsts: &[Pieces],
        mail: &[Vec<Passage>],
        (contact, extent): (f64, f64),
    ) {
        self.outbox.clear();
        let cells = self.lists.cells();
        for &(id, cell) in mail
            .iter()
            .flatten()
            .filter(|(_, cell)| cells.contains(&(*cell as usize)))
        {
            self.lists.insert(cell as usize, id);
        }
        let mut filter = std::mem::take(&mut self.filter);
        let mut hits = std::mem::take(&mut self.hits);
        filter.begin_window(contact, extent);
        self.lookout.begin_window(contact, extent);
        for cell in cells {
            let shelves = self.shelves(gas, starts, firsts);
            let listed = self.lists.pieces(cell);
            filter.begin_cell(listed.len(), listed.iter().map(|&id| shelves.start(id)));
            hits.clear();
            filter.find(1, &mut hits);
            let mut next = 0;
            while let Some(&(row, other)) = hits.get(next) {
                next += 1;
                let pair = [row, other].map(|row| self.lists.pieces(cell)[row as usize]);
                let shelves = self.shelves(gas, starts, firsts);
                let Some(mut meeting) = shelves.meeting(pair[0], pair[1], cell) else {
                    continue;
                };
                if pair
                    .iter()
                    .all(|&id| !matches!(Piece::of(id), Piece::Fresh(..)))
                {
                    meeting.next = self.foresee(&meeting, cell, gas, starts, firsts);
                    // What follows in this cell joins its rows.
                    let shelves = self.shelves(gas, starts, firsts);
                    let first = filter.len();
                    self.lists.pieces(cell)[first..]
                        .iter()
                        .for_each(|&id| filter.push(shelves.start(id)));
                    filter.find(first, &mut hits);
                }
                self.meetings.push(meeting);
            }
        }
        self.meetings.sort_unstable_by(Meeting::order);
        (self.filter, self.hits) = (filter, hits);
    }

    fn shelves<'a>(
        &'a self,
        gas: Gas<'a>,
        starts: &'a [Start],
        firsts: &'a [Pieces],
    ) -> Shelves<'a> {
        Shelves {
            gas,
            starts,
            firsts,
            fresh: Fresh::Of(&self.fresh),
        }
    }

    /// Lists the pieces that will follow a meeting if it comes about, while its surroundings are at hand. Cells up to the
    /// present one have been looked through, so what is listed there is tested now; the others will see it when their turn
    /// comes. Gives the pieces after the meeting's `piece` and `other`.
    fn foresee(
        &mut self,
        meeting: &Meeting,
        cell: usize,
        gas: Gas,
        starts: &[Start],
        firsts: &[Pieces],
    ) -> [Id; 2] {
        let shelves = self.shelves(gas, starts, firsts);
        let pair = meeting.in_order(&shelves);
        let owners = pair.map(|id| shelves.owner(id));
        let before = pair.map(|id| *shelves.trajectory(id));
        let balls = owners.map(|owner| gas.balls[owner as usize]);
        let time = gas.window.instant(meeting.time);
        let (after, _) = contact::pair(
            balls,
            before,
            owners.map(|owner| gas.body(owner)),
            DVec3::ZERO,
            time,
        );
        let mut next = [NONE; 2];
        for one in [0, 1] {
            let passages = self.add(after[one], owners[one], pair, gas);
            next[usize::from(pair[one] != meeting.piece)] = passages.0;
            for (id, place) in passages.1 {
                if (place as usize) < cell {
                    let Self {
                        lists,
                        fresh,
                        lookout,
                        meetings,
                        ..
                    } = self;
                    let shelves = Shelves {
                        gas,
                        starts,
                        firsts,
                        fresh: Fresh::Of(fresh),
                    };
                    lookout.look(&shelves, lists, (id, place), meetings);
                }
            }
        }
        next
    }

    /// Adds a fresh piece and those that follow its wall hits, lists them in the region's cells and puts their passages through
    /// others into the outbox. Gives the piece, and the passages through this region's cells.
    fn add(
        &mut self,
        trajectory: Trajectory,
        owner: u32,
        parents: [Id; 2],
        gas: Gas,
    ) -> (Id, Vec<Passage>) {
        let Self {
            number,
            lists,
            fresh,
            meetings,
            outbox,
            passages,
            ..
        } = self;
        let cells = lists.cells();
        passages.clear();
        let id = Piece::Fresh(
            *number,
            fresh.push(trajectory, gas.window.start(&trajectory), owner, parents),
        )
        .id();
        gas.trace(
            id,
            trajectory,
            owner,
            |after, start| Piece::Fresh(*number, fresh.push(after, start, owner, [NONE; 2])).id(),
            |cell, id| {
                if cells.contains(&cell) {
                    lists.insert(cell, id);
                    passages.push((id, cell as u32));
                } else {
                    outbox.push((id, cell as u32));
                }
            },
            |meeting| meetings.push(meeting),
        );
        (id, passages.clone())
    }
}
