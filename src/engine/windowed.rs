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
//! The curve is cut into regions, one for each thread (`windowed/region.rs`); only the commits are done by one.

mod filter;
mod grid;
mod meeting;
mod pieces;
mod region;

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::DVec3;

use crate::domain::Boundary;
use crate::engine::contact::{self, InstantWatch};
use crate::engine::{Counters, Engine, Stuck};
use crate::event::{Collision, Wall};
use crate::state::{Placement, State, Time, Trajectory};
use filter::Start;
use grid::Grid;
use meeting::{AT_WALL, Meeting};
use pieces::{Id, MOST_BALLS, MOST_REGIONS, NONE, Piece, Pieces};
use region::{Fresh, Gas, Lookout, Passage, Region, Shelves, Window};

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

/// Collisions per ball with which a window is full, because its length was foreseen for a gas with room.
const MOST_PER_WINDOW: usize = 4;

/// Windows between two sortings of the balls.
const WINDOWS_PER_SORT: u32 = 8;

/// From which numbers of balls, and at which mean spacing in diameters, this engine is the faster one (measured).
const FEW_BALLS: usize = 1000;
const MANY_BALLS: usize = 20_000;
const DILUTE_FEW: f64 = 2.75;
const DILUTE_MANY: f64 = 1.75;

/// Largest radius in smallest ones up to which the filter, which knows the largest only, lets little through in vain.
const SIMILAR_SIZE: f64 = 4.0;

/// Fewest balls in a region: a thread must have enough to do to be worth starting.
const BALLS_PER_REGION: usize = 10_000;

/// The windowed engine.
#[derive(Clone, Debug)]
pub struct Windowed {
    state: State,
    grid: Grid,
    region_count: usize,
    regions: Vec<Region>,
    /// The balls' flights at the beginning of the window, sorted; and the ball of each.
    flights: Vec<Trajectory>,
    balls: Vec<u32>,
    /// The flights' starts.
    starts: Vec<Start>,
    /// Pieces that follow the flights' wall hits, by region.
    firsts: Vec<Pieces>,
    /// Each flight's present piece.
    present: Vec<Id>,
    /// Flights whose present piece is not their own.
    changed: Vec<u32>,
    window: Option<Window>,
    length: f64,
    windows_since_sort: u32,
    /// Meetings found before the window's commits began, in order, and how many of them are done.
    meetings: Vec<Meeting>,
    done: usize,
    /// Meetings of pieces that began during the commits.
    follow_ups: BinaryHeap<Meeting>,
    lookout: Lookout,
    found: Vec<Meeting>,
    passages: Vec<Passage>,
    instants: InstantWatch,
    counters: Counters,
}

impl Windowed {
    /// Whether this engine can run a gas: a container without planes, every ball free to move, some moving.
    pub fn supports(gas: &Placement) -> bool {
        gas.domain.boundary == Boundary::Container
            && gas.domain.planes.is_empty()
            && gas.bodies.iter().all(|body| body.mass.is_finite())
            && gas.positions.len() < MOST_BALLS
            && gas
                .velocities
                .iter()
                .any(|&velocity| velocity != DVec3::ZERO)
    }

    /// Whether this engine is faster than `event` for a gas: enough balls of like size, far enough apart.
    pub fn pays(gas: &Placement) -> bool {
        let count = gas.positions.len();
        let spacing = (gas.domain.volume() / count as f64).cbrt();
        let radii = || gas.bodies.iter().map(|body| body.radius);
        let largest = radii().fold(0.0, f64::max);
        let alike = largest <= SIMILAR_SIZE * radii().fold(f64::INFINITY, f64::min);
        let dilute = if count >= MANY_BALLS {
            DILUTE_MANY
        } else {
            DILUTE_FEW
        };
        count >= FEW_BALLS && alike && spacing >= dilute * 2.0 * largest && Self::supports(gas)
    }

    /// Prepares a gas that this engine supports, to be run by so many threads at the most. Their number changes no collision.
    ///
    /// # Panics
    /// If [`Self::supports`] does not hold.
    pub fn new(state: State, threads: usize) -> Self {
        let worth_it = state.ball_count() / BALLS_PER_REGION;
        Self::with_regions(state, threads.min(worth_it))
    }

    /// Like [`Self::new`], with a thread for each of so many regions even if that does not pay.
    ///
    /// # Panics
    /// If [`Self::supports`] does not hold.
    pub fn with_regions(state: State, regions: usize) -> Self {
        let walls_only =
            state.domain.boundary == Boundary::Container && state.domain.planes.is_empty();
        assert!(
            walls_only && !state.bodies.any_fixed(),
            "the caller has asked whether this engine supports the gas"
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
            region_count: regions.clamp(1, MOST_REGIONS),
            regions: Vec::new(),
            flights: state.trajectories.clone(),
            balls: (0..count as u32).collect(),
            starts: vec![Start::default(); count],
            firsts: Vec::new(),
            present: (0..count as u32).collect(),
            changed: Vec::new(),
            window: None,
            length: transit
                .min(COLLISIONS_PER_WINDOW / rate)
                .min(LONGEST_WINDOW),
            windows_since_sort: 0,
            meetings: Vec::new(),
            done: 0,
            follow_ups: BinaryHeap::new(),
            lookout: Lookout::default(),
            found: Vec::new(),
            passages: Vec::new(),
            instants: InstantWatch::new(count),
            counters: Counters::default(),
            state,
        };
        engine.sort();
        engine
    }

    /// Sorts the balls along the curve through the cells, by where they are at the present, and cuts the curve into regions of
    /// about as many balls each.
    fn sort(&mut self) {
        self.windows_since_sort = 0;
        let now = self.state.now;
        let cell_of = |flight: &Trajectory| self.grid.cell_at(flight.position_at(now)) as u32;
        let cells: Vec<u32> = self.flights.iter().map(cell_of).collect();
        let mut places = vec![0_u32; self.grid.cell_count() + 1];
        for &cell in &cells {
            places[cell as usize + 1] += 1;
        }
        for cell in 1..places.len() {
            places[cell] += places[cell - 1];
        }
        let count = self.flights.len();
        let region_count = self.region_count;
        let cut = |region: usize| {
            let balls = (count * region / region_count) as u32;
            if region == region_count {
                self.grid.cell_count()
            } else {
                places.partition_point(|&place| place < balls)
            }
        };
        let cuts: Vec<usize> = (0..=region_count).map(cut).collect();
        let region = |number: usize| {
            let (first, end) = (cuts[number], cuts[number + 1]);
            Region::new(
                number,
                first..end,
                places[first] as usize..places[end] as usize,
            )
        };
        self.regions = (0..region_count).map(region).collect();
        self.firsts.resize(region_count, Pieces::default());
        let (mut flights, mut balls) = (self.flights.clone(), self.balls.clone());
        for (index, &cell) in cells.iter().enumerate() {
            let place = &mut places[cell as usize];
            flights[*place as usize] = self.flights[index];
            balls[*place as usize] = self.balls[index];
            *place += 1;
        }
        (self.flights, self.balls) = (flights, balls);
    }

    /// Lists all balls and finds the meetings of the window that begins at the present.
    fn open(&mut self) -> Window {
        if self.windows_since_sort >= WINDOWS_PER_SORT {
            self.sort();
        }
        self.windows_since_sort += 1;
        let begin = self.state.now;
        let window = Window {
            begin,
            end: begin
                .after(self.length)
                .expect("a window is a few epochs long"),
        };
        let Self {
            state,
            grid,
            regions,
            flights,
            balls,
            starts,
            firsts,
            lookout,
            meetings,
            ..
        } = self;
        let gas = Gas {
            state,
            grid,
            flights,
            balls,
            window,
        };

        let mut rest = &mut starts[..];
        let shares: Vec<_> = regions
            .iter()
            .map(|region| rest.split_off_mut(..region.flights.len()).expect("a share"))
            .collect();
        let lists = regions.iter_mut().zip(shares).zip(firsts.iter_mut());
        side_by_side(lists, |((region, starts), firsts)| {
            region.list(gas, starts, firsts)
        });

        let fastest = regions
            .iter()
            .fold(0.0, |fastest: f64, region| fastest.max(region.fastest));
        // Pieces may be drawn back beyond the box, by their path in the window; none is four times as fast as all flights.
        let extent = state.domain.half_size.max_element() + 4.0 * fastest * window.end.since(begin);
        let margins = (2.0 * state.bodies.largest_radius(), extent);
        let mail: Vec<_> = regions
            .iter_mut()
            .map(|region| std::mem::take(&mut region.outbox))
            .collect();
        side_by_side(regions.iter_mut(), |region| {
            region.find(gas, starts, firsts, &mail, margins)
        });

        meetings.clear();
        self.done = 0;
        for region in regions.iter() {
            meetings.extend(&region.meetings);
        }
        lookout.begin_window(margins.0, margins.1);
        // What was foreseen across a region's border is listed and tested there, now that all have finished.
        let mail: Vec<_> = regions
            .iter_mut()
            .flat_map(|region| std::mem::take(&mut region.outbox))
            .collect();
        for (id, cell) in mail {
            let region = region_of(regions, cell);
            regions[region].lists.insert(cell as usize, id);
            let shelves = Shelves {
                gas,
                starts,
                firsts,
                fresh: Fresh::In(regions),
            };
            lookout.look(&shelves, &regions[region].lists, (id, cell), meetings);
        }
        // Made of sorted stretches: a sort that looks for such is quick.
        meetings.sort_by(Meeting::order);
        self.window = Some(window);
        window
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

    fn shelves(&self, window: Window) -> Shelves<'_> {
        let Self {
            state,
            grid,
            regions,
            flights,
            balls,
            starts,
            firsts,
            ..
        } = self;
        Shelves {
            gas: Gas {
                state,
                grid,
                flights,
                balls,
                window,
            },
            starts,
            firsts,
            fresh: Fresh::In(regions),
        }
    }

    fn hit_wall(
        &mut self,
        meeting: Meeting,
        window: Window,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let shelves = self.shelves(window);
        let owner = shelves.owner(meeting.piece);
        if self.present[owner as usize] != meeting.piece {
            self.counters.stale_events += 1;
            return Ok(());
        }
        let before = *shelves.trajectory(meeting.piece);
        let time = window.instant(meeting.time);
        self.state.now = time;
        let ball = self.balls[owner as usize];
        let body = self.state.bodies.of(ball as usize);
        let number = meeting.other - AT_WALL;
        let wall = Wall {
            axis: number as usize / 2,
            upper: number % 2 == 1,
        };
        let limit = self.state.domain.half_size[wall.axis] - body.radius;
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

    fn meet(
        &mut self,
        meeting: Meeting,
        window: Window,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let shelves = self.shelves(window);
        let pair = meeting.in_order(&shelves);
        let owners = pair.map(|id| shelves.owner(id));
        if (0..2).any(|one| self.present[owners[one] as usize] != pair[one]) {
            self.counters.stale_events += 1;
            return Ok(());
        }
        let before = pair.map(|id| *shelves.trajectory(id));
        let time = window.instant(meeting.time);
        let late = time < self.state.now;
        self.counters.late_events += u64::from(late);
        let now = if late { self.state.now } else { time };
        self.state.now = now;
        let balls = owners.map(|owner| self.balls[owner as usize]);
        let bodies = balls.map(|ball| self.state.bodies.of(ball as usize));
        let (after, collision) = contact::pair(balls, before, bodies, DVec3::ZERO, now);
        self.counters.pair_collisions += 1;
        let watched = balls.map(|ball| (ball as usize, self.last_contact(ball)));
        self.instants
            .note(&collision, &watched, &mut self.counters)?;
        for one in [0, 1] {
            let foreseen = meeting.next[usize::from(pair[one] != meeting.piece)];
            // A late collision does not happen where it was foreseen.
            let next = if foreseen == NONE || late {
                self.pursue(after[one], owners[one], pair, window)
            } else {
                foreseen
            };
            self.turn(owners[one], next, after[one]);
        }
        report(&collision);
        Ok(())
    }

    /// Lists a piece that begins now and those that follow its wall hits, and tests them against all that is listed where they
    /// pass. Gives the piece.
    fn pursue(&mut self, after: Trajectory, owner: u32, parents: [Id; 2], window: Window) -> Id {
        let Self {
            state,
            grid,
            regions,
            flights,
            balls,
            starts,
            firsts,
            lookout,
            found,
            passages,
            follow_ups,
            ..
        } = self;
        let gas = Gas {
            state,
            grid,
            flights,
            balls,
            window,
        };
        found.clear();
        passages.clear();
        let mut fresh = std::mem::take(&mut regions[0].fresh);
        let start = Start::new(after.position_at(window.begin), after.velocity);
        let id = Piece::Fresh(0, fresh.push(after, start, owner, parents)).id();
        let add = |after, start| Piece::Fresh(0, fresh.push(after, start, owner, [NONE; 2])).id();
        gas.trace(
            id,
            after,
            owner,
            add,
            |cell, id| passages.push((id, cell as u32)),
            |meeting| found.push(meeting),
        );
        regions[0].fresh = fresh;
        for &(id, cell) in passages.iter() {
            let region = region_of(regions, cell);
            regions[region].lists.insert(cell as usize, id);
            let shelves = Shelves {
                gas,
                starts,
                firsts,
                fresh: Fresh::In(regions),
            };
            lookout.look(&shelves, &regions[region].lists, (id, cell), found);
        }
        follow_ups.extend(found.iter());
        id
    }

    /// A ball goes on along another piece.
    fn turn(&mut self, owner: u32, piece: Id, after: Trajectory) {
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

    /// When a ball's last collision was, if it had one.
    fn last_contact(&self, ball: u32) -> Option<Time> {
        let ball = ball as usize;
        (self.state.collisions[ball] > 0).then(|| self.state.trajectories[ball].begin)
    }
}

/// Does the work for each share on a thread of its own, the first on this one.
fn side_by_side<T: Send>(mut shares: impl Iterator<Item = T>, work: impl Fn(T) + Copy + Send) {
    let Some(first) = shares.next() else { return };
    std::thread::scope(|scope| {
        shares.for_each(|share| {
            scope.spawn(move || work(share));
        });
        work(first);
    });
}

fn region_of(regions: &[Region], cell: u32) -> usize {
    regions.partition_point(|region| region.lists.cells().end <= cell as usize)
}

impl Engine for Windowed {
    fn name(&self) -> &'static str {
        "windowed"
    }

    fn advance(&mut self, until: Time, report: &mut dyn FnMut(&Collision)) -> Result<(), Stuck> {
        while self.state.now < until {
            let window = self.window.unwrap_or_else(|| self.open());
            let mut limit = if until < window.end {
                until
            } else {
                window.end
            };
            let mut full = false;
            while let Some(meeting) = self.take_next(limit.relative_to(window.begin.epoch)) {
                if meeting.other >= AT_WALL {
                    self.hit_wall(meeting, window, report)?;
                } else {
                    self.meet(meeting, window, report)?;
                }
                // Long lists are slow to search: a new window begins here.
                full = self.changed.len() > MOST_PER_WINDOW * self.balls.len();
                if full {
                    limit = self.state.now;
                    break;
                }
            }
            self.state.now = limit;
            self.counters.queue_length_max = self
                .counters
                .queue_length_max
                .max(self.queue_length() as u64);
            if full || limit == window.end {
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
