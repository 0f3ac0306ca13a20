//! Engine `windowed`: exact collisions found window by window instead of ball by ball.
//!
//! In a dilute gas a classical event queue spends nearly all of its time on cell crossings that miss the cache. This engine has
//! neither crossings nor a queue of all balls. It cuts time into short windows, all balls at once:
//!
//! 1. **List** each ball in the cells that its straight path in the window reaches into, along with the pieces of path that
//!    follow its wall hits.
//! 2. **Find**, cell by cell, the pairs of pieces that meet: a fast conservative filter first, then the exact prediction.
//! 3. **Commit** the meetings in order of time. One is valid if both pieces are then their balls' present flights. The new
//!    flights are listed and tested in turn, and what they meet joins the line.
//!
//! What always holds: every two pieces are tested when the later one is listed, in the cell of their contact point; whether a
//! piece has begun or ended before a meeting is settled when that meeting's turn comes. So the collisions are those of the true
//! dynamics, and since predictions are pure functions of trajectories they are those of engine `event`, bit for bit.
//!
//! Balls are kept sorted along a Morton curve through the cells and sorted again now and then; the state keeps its own order.

mod filter;
mod grid;

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::DVec3;

use crate::collision::{pair_time, wall_time};
use crate::domain::Boundary;
use crate::engine::contact::{self, InstantWatch};
use crate::engine::{Counters, Engine, Stuck};
use crate::event::{Collision, Wall};
use crate::state::{State, Time, Trajectory};
use filter::{Filter, Start};
use grid::Grid;

/// Cell width in mean spacings of the balls; measured to be best, and flat around.
const SPACINGS_PER_CELL: f64 = 3.0;

/// Window length in mean times that a ball takes from one cell into the next.
const CROSSINGS_PER_WINDOW: f64 = 0.8;

/// Mean number of cell faces that a Maxwellian ball crosses while moving one cell width at the speed `sqrt(k T / m)`:
/// `3 sqrt(2 / pi)`, derived here.
const CROSSINGS_PER_WIDTH: f64 = 2.394;

/// Most pair collisions per ball in a window.
const COLLISIONS_PER_WINDOW: f64 = 0.1;

/// Longest window \[epochs\]: times in it stay exact relative to its first epoch.
const LONGEST_WINDOW: f64 = 4.0;

/// Windows between two sortings of the balls.
const WINDOWS_PER_SORT: u32 = 8;

/// A meeting of two pieces, or of a piece and a wall.
#[derive(Clone, Copy, Debug)]
struct Meeting {
    /// When, in epochs from the window's first epoch.
    time: f64,
    /// The piece, or the first of the two.
    piece: u32,
    /// The other piece; [`AT_WALL`] and the wall's number for a wall.
    other: u32,
    /// The pieces that follow, where they have been listed and tested already: `piece`'s and `other`'s.
    next: [u32; 2],
    /// Orders meetings at one instant as all exact engines do.
    rank: (u32, u32),
}

/// A piece that does not exist yet.
const NONE: u32 = u32::MAX;

/// Numbers from here on are walls, not pieces.
const AT_WALL: u32 = u32::MAX - 5;

impl Meeting {
    fn order(&self, other: &Self) -> Ordering {
        let kind = |meeting: &Self| meeting.other < AT_WALL;
        let ties = || (kind(self), self.rank).cmp(&(kind(other), other.rank));
        self.time.total_cmp(&other.time).then_with(ties)
    }
}

/// The earliest is the greatest: what a heap gives first.
impl Ord for Meeting {
    fn cmp(&self, other: &Self) -> Ordering {
        other.order(self)
    }
}

impl PartialOrd for Meeting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Meeting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Meeting {}

/// A window of time, ends included.
#[derive(Clone, Copy, Debug)]
struct Window {
    begin: Time,
    end: Time,
}

/// The windowed engine.
#[derive(Clone, Debug)]
pub struct Windowed {
    state: State,
    grid: Grid,
    filter: Filter,
    /// Another filter, for cells looked at out of their turn, and what it lets through.
    lookout: Filter,
    hits: Vec<(u32, u32)>,
    /// The balls' flights at the beginning of the window, sorted: pieces `0..N`.
    flights: Vec<Trajectory>,
    /// The ball of each flight.
    balls: Vec<u32>,
    /// Pieces that begin within the window: `N` and up; the flights they follow; and the two pieces whose meeting they began
    /// at, which they cannot meet again.
    pieces: Vec<Trajectory>,
    owners: Vec<u32>,
    /// The window's beginning of each flight and piece, for the filter.
    starts: Vec<Start>,
    parents: Vec<[u32; 2]>,
    /// The cells of the pieces last listed.
    passed: Vec<(u32, u32)>,
    /// Each flight's present piece.
    present: Vec<u32>,
    /// Flights whose present piece is not their own.
    changed: Vec<u32>,
    window: Option<Window>,
    length: f64,
    windows_since_sort: u32,
    /// Meetings found before the window's commits began, in order, and how many of them are done.
    meetings: Vec<Meeting>,
    done: usize,
    found: Vec<Meeting>,
    /// Meetings of pieces that began during the commits.
    follow_ups: BinaryHeap<Meeting>,
    instants: InstantWatch,
    counters: Counters,
}

impl Windowed {
    /// Whether this engine can run a gas: a container without planes, every ball free to move.
    pub fn supports(state: &State) -> bool {
        state.domain.boundary == Boundary::Container
            && state.domain.planes.is_empty()
            && !state.bodies.any_fixed()
            && state.kinetic_energy() > 0.0
    }

    /// Prepares a gas that this engine supports.
    ///
    /// # Panics
    /// If [`Self::supports`] does not hold.
    pub fn new(state: State) -> Self {
        assert!(
            Self::supports(&state),
            "the caller asks first whether the windowed engine supports the gas"
        );
        let count = state.ball_count();
        let volume = state.domain.volume();
        let spacing = (volume / count as f64).cbrt();
        let diameter = 2.0 * state.bodies.mean_radius();
        let grid = Grid::new(
            state.domain.half_size,
            (SPACINGS_PER_CELL * spacing).max(diameter),
            count,
        );
        let squares: f64 = state
            .trajectories
            .iter()
            .map(|flight| flight.velocity.length_squared())
            .sum();
        let deviation = (squares / (3.0 * count as f64)).sqrt();
        // Pair collisions per ball and time, from kinetic theory with the contact value of Carnahan and Starling.
        let packing = (std::f64::consts::PI / 6.0 * diameter * diameter * diameter * count as f64
            / volume)
            .min(0.7);
        let contact_value =
            (1.0 - 0.5 * packing) / ((1.0 - packing) * (1.0 - packing) * (1.0 - packing));
        let section = 2.0 * std::f64::consts::PI.sqrt() * diameter * diameter * contact_value;
        let rate = section * count as f64 / volume * deviation;
        let transit =
            CROSSINGS_PER_WINDOW * grid.width().min_element() / (CROSSINGS_PER_WIDTH * deviation);
        let mut engine = Self {
            grid,
            filter: Filter::default(),
            lookout: Filter::default(),
            hits: Vec::new(),
            flights: Vec::new(),
            balls: Vec::new(),
            pieces: Vec::new(),
            owners: Vec::new(),
            starts: Vec::new(),
            parents: Vec::new(),
            passed: Vec::new(),
            present: (0..count as u32).collect(),
            changed: Vec::new(),
            window: None,
            length: transit
                .min(COLLISIONS_PER_WINDOW / rate)
                .min(LONGEST_WINDOW),
            windows_since_sort: 0,
            meetings: Vec::new(),
            done: 0,
            found: Vec::new(),
            follow_ups: BinaryHeap::new(),
            instants: InstantWatch::new(count),
            counters: Counters::default(),
            state,
        };
        engine.balls = (0..count as u32).collect();
        engine.flights.clone_from(&engine.state.trajectories);
        engine.sort();
        engine
    }

    /// Sorts the balls along the curve through the cells, by where they are at the present.
    fn sort(&mut self) {
        self.windows_since_sort = 0;
        let cells: Vec<u32> = self
            .flights
            .iter()
            .map(|flight| self.grid.cell_at(flight.position_at(self.state.now)) as u32)
            .collect();
        let mut places = vec![0_u32; self.grid.cell_count() + 1];
        for &cell in &cells {
            places[cell as usize + 1] += 1;
        }
        for cell in 1..places.len() {
            places[cell] += places[cell - 1];
        }
        let mut flights = self.flights.clone();
        let mut balls = self.balls.clone();
        for (index, &cell) in cells.iter().enumerate() {
            let place = &mut places[cell as usize];
            flights[*place as usize] = self.flights[index];
            balls[*place as usize] = self.balls[index];
            *place += 1;
        }
        (self.flights, self.balls) = (flights, balls);
    }

    /// Lists all balls and finds the meetings of the window that begins at the present.
    fn open(&mut self) {
        if self.windows_since_sort >= WINDOWS_PER_SORT {
            self.sort();
        }
        self.windows_since_sort += 1;
        let begin = self.state.now;
        let end = begin
            .after(self.length)
            .expect("a window is a few epochs long");
        self.window = Some(Window { begin, end });
        self.list(begin, end);
        self.find(begin, end);
        self.meetings.sort_unstable_by(Meeting::order);
    }

    /// Lists every ball's path in the window, reflected at the walls.
    #[inline(never)]
    fn list(&mut self, begin: Time, end: Time) {
        self.grid.clear();
        self.pieces.clear();
        self.owners.clear();
        self.parents.clear();
        self.starts.clear();
        self.done = 0;
        for flight in &self.flights {
            self.starts
                .push(Start::new(flight.position_at(begin), flight.velocity));
        }
        let (mut meetings, mut passed) = (
            std::mem::take(&mut self.meetings),
            std::mem::take(&mut self.passed),
        );
        meetings.clear();
        let half_size = self.state.domain.half_size;
        for flight in 0..self.flights.len() {
            let trajectory = self.flights[flight];
            let radius = self.state.bodies.of(self.balls[flight] as usize).radius;
            let (from, to) = (trajectory.position_at(begin), trajectory.position_at(end));
            if to.abs().cmpge(half_size - radius).any() {
                self.launch(flight as u32, begin, end, &mut passed, &mut |meeting| {
                    meetings.push(meeting)
                });
            } else {
                let grid = &mut self.grid;
                let range = grid.reach(from, to, radius);
                range.for_each(|place| {
                    let cell = grid.cell(place);
                    grid.insert(cell, flight as u32);
                });
            }
        }
        (self.meetings, self.passed) = (meetings, passed);
        self.passed.clear();
    }

    /// Lists a piece and those that follow its wall hits within the window; `passed` gets each piece with each of its cells,
    /// `found` each wall hit.
    fn launch(
        &mut self,
        piece: u32,
        begin: Time,
        end: Time,
        passed: &mut Vec<(u32, u32)>,
        found: &mut dyn FnMut(Meeting),
    ) {
        let owner = self.owner(piece);
        let ball = self.balls[owner as usize];
        let body = self.state.bodies.of(ball as usize);
        let room = self.state.domain.half_size - body.radius;
        let mut piece = piece;
        loop {
            let trajectory = self.piece(piece);
            let mut hit: Option<(Time, Wall)> = None;
            for axis in 0..3 {
                let speed = trajectory.velocity[axis];
                if let Some(time) = wall_time(&trajectory, axis, room[axis].copysign(speed))
                    && time <= end
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
            let from = trajectory.position_at(if trajectory.begin > begin {
                trajectory.begin
            } else {
                begin
            });
            let to = trajectory.position_at(hit.map_or(end, |(time, _)| time));
            let grid = &mut self.grid;
            grid.reach(from, to, body.radius).for_each(|place| {
                let cell = grid.cell(place);
                grid.insert(cell, piece);
                passed.push((piece, cell as u32));
            });
            let Some((time, wall)) = hit else { return };
            let (after, _) = contact::wall(ball, trajectory, body, wall, room[wall.axis], time);
            let next = self.add(after, owner, [NONE; 2], begin);
            let number = 2 * wall.axis as u32 + u32::from(wall.upper);
            let time = time.relative_to(begin.epoch);
            found(Meeting {
                time,
                piece,
                other: AT_WALL + number,
                next: [next, NONE],
                rank: (ball, number),
            });
            piece = next;
        }
    }

    /// Finds the meetings of all listed pieces.
    #[inline(never)]
    fn find(&mut self, begin: Time, end: Time) {
        let contact = 2.0 * self.state.bodies.largest_radius();
        let fastest = self.flights.iter().fold(0.0, |fastest: f64, flight| {
            fastest.max(flight.velocity.abs().max_element())
        });
        // A piece may be drawn back beyond the box, by its path in the window.
        let extent = self.state.domain.half_size.max_element() + 4.0 * fastest * end.since(begin);
        let expected = self.flights.len() + self.pieces.len();
        let mut filter = std::mem::take(&mut self.filter);
        filter.begin_window(contact, extent);
        self.lookout.begin_window(contact, extent);
        let mut hits = Vec::new();
        for cell in 0..self.grid.cell_count() {
            filter.begin_cell(self.grid.pieces(cell), &self.starts);
            hits.clear();
            filter.find(1, &mut hits);
            let mut next = 0;
            while let Some(&(row, other)) = hits.get(next) {
                next += 1;
                let pair = [row, other].map(|index| self.grid.pieces(cell)[index as usize]);
                let Some(mut meeting) = self.meeting(pair[0], pair[1], cell, begin, end) else {
                    continue;
                };
                if pair.iter().all(|&piece| (piece as usize) < expected) {
                    meeting.next = self.foresee(&meeting, cell, Window { begin, end });
                    // What follows in this cell joins its rows.
                    let first = filter.len();
                    for &piece in &self.grid.pieces(cell)[first..] {
                        filter.push(&self.starts[piece as usize]);
                    }
                    filter.find(first, &mut hits);
                }
                self.meetings.push(meeting);
            }
        }
        self.filter = filter;
    }

    /// Lists the pieces that will follow a meeting if it comes about, while its surroundings are at hand. Cells up to the
    /// present one have been looked through, so what is listed there is tested now; the others will see it when their turn
    /// comes. Gives the pieces after the meeting's `piece` and `other`.
    fn foresee(&mut self, meeting: &Meeting, cell: usize, window: Window) -> [u32; 2] {
        let mut pieces = [meeting.piece, meeting.other];
        let swapped = self.ball(pieces[0]) > self.ball(pieces[1]);
        if swapped {
            pieces.swap(0, 1);
        }
        let owners = pieces.map(|piece| self.owner(piece));
        let balls = owners.map(|owner| self.balls[owner as usize]);
        let bodies = balls.map(|ball| self.state.bodies.of(ball as usize));
        let time = time_in(window, meeting.time);
        let (after, _) = contact::pair(
            balls,
            pieces.map(|piece| self.piece(piece)),
            bodies,
            DVec3::ZERO,
            time,
        );
        let mut next = [0, 1].map(|one| {
            let piece = self.add(after[one], owners[one], pieces, window.begin);
            self.foresee_path(piece, cell, window);
            piece
        });
        if swapped {
            next.swap(0, 1);
        }
        next
    }

    /// Lists a foreseen piece and those that follow its wall hits, and tests them in the cells that have had their turn.
    fn foresee_path(&mut self, piece: u32, cell: usize, window: Window) {
        let mut passed = std::mem::take(&mut self.passed);
        let mut meetings = std::mem::take(&mut self.meetings);
        passed.clear();
        self.launch(
            piece,
            window.begin,
            window.end,
            &mut passed,
            &mut |meeting| meetings.push(meeting),
        );
        for &(piece, place) in passed.iter().filter(|&&(_, place)| (place as usize) < cell) {
            self.look_in_cell(piece, place as usize, window, &mut meetings);
        }
        self.meetings = meetings;
        self.passed = passed;
    }

    /// The meeting of two pieces in the window, if they meet in this cell.
    #[inline]
    fn meeting(
        &self,
        piece: u32,
        other: u32,
        cell: usize,
        begin: Time,
        end: Time,
    ) -> Option<Meeting> {
        let pair = [
            piece_of(&self.flights, &self.pieces, piece),
            piece_of(&self.flights, &self.pieces, other),
        ];
        let contact = match self.state.bodies.uniform() {
            Some(body) => 2.0 * body.radius,
            None => self.radius(piece) + self.radius(other),
        };
        let time = pair_time(pair[0], pair[1], contact).filter(|&time| time <= end)?;
        self.meeting_at(piece, other, time, cell, begin)
    }

    /// The rest of [`Self::meeting`], for the few that the prediction lets through.
    #[inline(never)]
    fn meeting_at(
        &self,
        piece: u32,
        other: u32,
        time: Time,
        cell: usize,
        begin: Time,
    ) -> Option<Meeting> {
        let balls = [self.ball(piece), self.ball(other)];
        if balls[0] == balls[1]
            || self.parents(piece).contains(&other)
            || self.parents(other).contains(&piece)
        {
            return None;
        }
        // Only the cell that holds the contact point counts the meeting: both are listed there.
        let radii = [self.radius(piece), self.radius(other)];
        let places = [piece, other].map(|piece| self.piece(piece).position_at(time));
        let contact = places[0] + (places[1] - places[0]) * (radii[0] / (radii[0] + radii[1]));
        (self.grid.cell_at(contact) == cell).then(|| Meeting {
            time: time.relative_to(begin.epoch),
            piece,
            other,
            next: [NONE; 2],
            rank: (balls[0].min(balls[1]), balls[0].max(balls[1])),
        })
    }

    /// The next meeting in order, if it comes no later than `limit`.
    fn take_next(&mut self, limit: f64) -> Option<Meeting> {
        let found = self.meetings.get(self.done);
        let follow_up = self.follow_ups.peek();
        let from_follow_ups = match (found, follow_up) {
            (Some(found), Some(follow_up)) => follow_up.order(found) == Ordering::Less,
            (found, _) => found.is_none(),
        };
        let next = if from_follow_ups { follow_up } else { found };
        let next = next.copied().filter(|meeting| meeting.time <= limit)?;
        if from_follow_ups {
            self.follow_ups.pop();
        } else {
            self.done += 1;
        }
        Some(next)
    }

    /// Carries out a meeting if its pieces are still their balls' present flights.
    fn commit(
        &mut self,
        meeting: Meeting,
        window: Window,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let time = time_in(window, meeting.time);
        if meeting.other >= AT_WALL {
            self.hit_wall(meeting, time, report)
        } else {
            self.meet(meeting, time, window, report)
        }
    }

    fn hit_wall(
        &mut self,
        meeting: Meeting,
        time: Time,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let owner = self.owner(meeting.piece);
        if self.present[owner as usize] != meeting.piece {
            self.counters.stale_events += 1;
            return Ok(());
        }
        self.state.now = time;
        let ball = self.balls[owner as usize];
        let body = self.state.bodies.of(ball as usize);
        let number = meeting.other - AT_WALL;
        let wall = Wall {
            axis: number as usize / 2,
            upper: number % 2 == 1,
        };
        let limit = self.state.domain.half_size[wall.axis] - body.radius;
        let before = self.piece(meeting.piece);
        let (after, collision) = contact::wall(ball, before, body, wall, limit, time);
        self.counters.wall_collisions += 1;
        self.instants.note(
            &collision,
            &[(ball as usize, self.last_contact(ball))],
            &mut self.counters,
        )?;
        self.turn(owner, meeting.next[0], after);
        report(&collision);
        Ok(())
    }

    #[inline(never)]
    fn meet(
        &mut self,
        meeting: Meeting,
        time: Time,
        window: Window,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let mut pieces = [meeting.piece, meeting.other];
        let mut next = meeting.next;
        if self.ball(pieces[0]) > self.ball(pieces[1]) {
            pieces.swap(0, 1);
            next.swap(0, 1);
        }
        let owners = pieces.map(|piece| self.owner(piece));
        if (0..2).any(|one| self.present[owners[one] as usize] != pieces[one]) {
            self.counters.stale_events += 1;
            return Ok(());
        }
        let late = time < self.state.now;
        self.counters.late_events += u64::from(late);
        let now = if late { self.state.now } else { time };
        self.state.now = now;
        let balls = owners.map(|owner| self.balls[owner as usize]);
        let bodies = balls.map(|ball| self.state.bodies.of(ball as usize));
        let before = pieces.map(|piece| self.piece(piece));
        let (after, collision) = contact::pair(balls, before, bodies, DVec3::ZERO, now);
        self.counters.pair_collisions += 1;
        let watched = balls.map(|ball| (ball as usize, self.last_contact(ball)));
        self.instants
            .note(&collision, &watched, &mut self.counters)?;
        for one in [0, 1] {
            if next[one] == NONE || late {
                let piece = self.add(after[one], owners[one], pieces, window.begin);
                self.turn(owners[one], piece, after[one]);
                self.pursue(piece, window);
            } else {
                self.turn(owners[one], next[one], after[one]);
            }
        }
        report(&collision);
        Ok(())
    }

    /// Lists a piece that has just begun and those that follow its wall hits, and tests them against all that is listed where
    /// they pass.
    fn pursue(&mut self, piece: u32, window: Window) {
        let mut passed = std::mem::take(&mut self.passed);
        let mut found = std::mem::take(&mut self.found);
        passed.clear();
        found.clear();
        self.launch(
            piece,
            window.begin,
            window.end,
            &mut passed,
            &mut |meeting| found.push(meeting),
        );
        for &(piece, cell) in &passed {
            self.look_in_cell(piece, cell as usize, window, &mut found);
        }
        self.follow_ups.extend(&found);
        (self.passed, self.found) = (passed, found);
    }

    /// Finds the meetings of a listed piece with those listed in a cell before it.
    fn look_in_cell(&mut self, piece: u32, cell: usize, window: Window, found: &mut Vec<Meeting>) {
        let listed = self.grid.pieces(cell);
        let row = listed
            .iter()
            .rposition(|&other| other == piece)
            .expect("the piece has just been listed here");
        self.lookout.begin_cell(&listed[..=row], &self.starts);
        self.hits.clear();
        self.lookout.find(row, &mut self.hits);
        for &(_, other) in &self.hits {
            let other = self.grid.pieces(cell)[other as usize];
            found.extend(self.meeting(piece, other, cell, window.begin, window.end));
        }
    }

    /// A ball goes on along another piece.
    fn turn(&mut self, owner: u32, piece: u32, after: Trajectory) {
        self.present[owner as usize] = piece;
        self.changed.push(owner);
        let ball = self.balls[owner as usize] as usize;
        self.state.trajectories[ball] = after;
        self.state.collisions[ball] += 1;
    }

    /// Ends a window: every ball's present piece becomes its flight.
    fn close(&mut self) {
        for owner in std::mem::take(&mut self.changed) {
            self.flights[owner as usize] =
                self.state.trajectories[self.balls[owner as usize] as usize];
            self.present[owner as usize] = owner;
        }
        self.follow_ups.clear();
        self.meetings.clear();
        self.done = 0;
        self.window = None;
    }

    fn add(&mut self, trajectory: Trajectory, owner: u32, parents: [u32; 2], begin: Time) -> u32 {
        self.starts.push(Start::new(
            trajectory.position_at(begin),
            trajectory.velocity,
        ));
        self.pieces.push(trajectory);
        self.owners.push(owner);
        self.parents.push(parents);
        (self.flights.len() + self.pieces.len() - 1) as u32
    }

    #[inline]
    fn piece(&self, piece: u32) -> Trajectory {
        *piece_of(&self.flights, &self.pieces, piece)
    }

    /// The flight that a piece belongs to.
    #[inline]
    fn owner(&self, piece: u32) -> u32 {
        (piece as usize)
            .checked_sub(self.flights.len())
            .map_or(piece, |new| self.owners[new])
    }

    /// The ball that a piece belongs to.
    #[inline]
    fn ball(&self, piece: u32) -> u32 {
        self.balls[self.owner(piece) as usize]
    }

    /// Radius of the ball that a piece belongs to.
    #[inline]
    fn radius(&self, piece: u32) -> f64 {
        self.state.bodies.of(self.ball(piece) as usize).radius
    }

    /// The pieces whose meeting a piece began at, if it did.
    #[inline]
    fn parents(&self, piece: u32) -> [u32; 2] {
        (piece as usize)
            .checked_sub(self.flights.len())
            .map_or([NONE; 2], |new| self.parents[new])
    }

    /// When a ball's last collision was, if it had one.
    fn last_contact(&self, ball: u32) -> Option<Time> {
        let ball = ball as usize;
        (self.state.collisions[ball] > 0).then(|| self.state.trajectories[ball].begin)
    }
}

/// The instant that lies `time` epochs after the beginning of the window's first epoch.
fn time_in(window: Window, time: f64) -> Time {
    let whole = time as u64;
    Time {
        epoch: window.begin.epoch + whole,
        local: time - whole as f64,
    }
}

#[inline]
fn piece_of<'a>(flights: &'a [Trajectory], pieces: &'a [Trajectory], piece: u32) -> &'a Trajectory {
    let piece = piece as usize;
    if piece < flights.len() {
        &flights[piece]
    } else {
        &pieces[piece - flights.len()]
    }
}

impl Engine for Windowed {
    fn name(&self) -> &'static str {
        "windowed"
    }

    fn advance(&mut self, until: Time, report: &mut dyn FnMut(&Collision)) -> Result<(), Stuck> {
        while self.state.now < until {
            if self.window.is_none() {
                self.open();
            }
            let window = self.window.expect("a window has just been opened");
            let limit = if until < window.end {
                until
            } else {
                window.end
            };
            while let Some(meeting) = self.take_next(limit.relative_to(window.begin.epoch)) {
                self.commit(meeting, window, report)?;
            }
            self.state.now = limit;
            let waiting = (self.meetings.len() - self.done + self.follow_ups.len()) as u64;
            self.counters.queue_length_max = self.counters.queue_length_max.max(waiting);
            if limit == window.end {
                self.close();
            }
        }
        Ok(())
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn reverse(&mut self) {
        self.close();
        self.state.reverse();
        self.instants.clear();
        for (flight, &ball) in self.flights.iter_mut().zip(&self.balls) {
            *flight = self.state.trajectories[ball as usize];
        }
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn queue_length(&self) -> usize {
        self.meetings.len() - self.done + self.follow_ups.len()
    }
}
