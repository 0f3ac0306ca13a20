//! Engine `windowed`: exact collisions found window by window instead of ball by ball.
//!
//! In a dilute gas a classical event queue spends nearly all of its time on cell crossings that miss the cache. This engine has
//! neither crossings nor a queue of all balls. It cuts time into short windows, all balls at once:
//!
//! 1. **List** each ball in the cells that its straight path in the window reaches into (`listing.rs`), along with the pieces of
//!    path that follow where it meets what bounds the domain (`paths.rs`).
//! 2. **Find**, cell by cell, the pairs of pieces that meet: a fast conservative filter first (`filter.rs`), then the exact
//!    prediction. The pieces that will follow are listed and tested at once, while their surroundings are at hand (`region.rs`).
//! 3. **Commit** the meetings in order of time (`commits.rs`). One is valid if both pieces are then their balls' present flights.
//!
//! In a dense gas balls do not get far between their collisions. There a window begins with a note of everybody's *neighbours*: all
//! whom a ball may touch in it, whatever happens to both of them. Nothing is foreseen then, but at each collision the two balls look
//! at their neighbours (`looking.rs`). A window is cut short where a ball gets faster than that allows.
//!
//! What always holds: every two pieces are tested when the later one is listed, in the cell of their contact point; whether a
//! piece has begun or ended before a meeting is settled when that meeting's turn comes; among collisions at one instant, a turn
//! that came before its cause is taken up again. So the collisions are those of the true dynamics, and since predictions are pure
//! functions of trajectories they are those of engine `event`, bit for bit.
//!
//! The exact flights are in the state, by ball. Beside them the engine keeps one `Line` of 32 bytes for each: where it is at
//! the beginning of the window and its velocity, in f32, moved on from window to window and made anew from the exact flight at
//! each collision and each sorting. Lines are sorted along a Morton curve through the cells. The curve is cut into regions, one
//! for each thread; only the commits are done by one.

mod agenda;
mod commits;
mod filter;
mod follow_ups;
mod grid;
mod listing;
mod lists;
mod looking;
mod meeting;
mod neighbours;
mod passages;
mod paths;
mod pieces;
mod questions;
mod region;
mod scratch;
mod sheet;
mod shelves;
mod sorting;
mod team;
mod touch;
mod tuning;
mod ways;

use crate::engine::contact::InstantWatch;
use crate::engine::{Counters, Engine, Saved, Stuck, Tally};
use crate::event::Collision;
use crate::state::{Placement, State, Time};
use agenda::Agenda;
use follow_ups::FollowUps;
use grid::Grid;
use listing::Flights;
use looking::Glimpse;
use meeting::Meeting;
use paths::{Gas, Window};
use pieces::{FRESH, LATER, Line, MOST_REGIONS, Numbering, Past, Pieces};
use questions::Margins;
use region::Region;
use scratch::Scratch;
use shelves::Shelves;
use team::Team;
use touch::Offsets;
use tuning::Work;

/// Windows between two sortings of the balls.
const WINDOWS_PER_SORT: u32 = 6;

/// Collisions per ball with which a window is full, because its length was foreseen for a gas with room.
const MOST_PER_WINDOW: usize = 4;

/// Meetings known at a window's beginning for each slice of those that are found in it.
const MEETINGS_PER_SLICE: usize = 16;

/// Fewest balls for a thread: it must have enough to do to be worth starting.
const BALLS_PER_THREAD: usize = 10_000;

/// The windowed engine.
#[derive(Clone, Debug)]
pub struct Windowed {
    state: State,
    grid: Grid,
    offsets: Offsets,
    numbering: Numbering,
    team: Team,
    regions: Vec<Region>,
    /// Every flight as the filter sees it, sorted.
    lines: Vec<Line>,
    /// Every flight's radius in grid lengths, unless all are alike.
    radii: Vec<f32>,
    /// The other pieces, by kind and region.
    pieces: [Vec<Pieces>; 3],
    past: Past,
    window: Option<Window>,
    length: f64,
    /// Whether the lines are still at the beginning of the window before.
    behind: bool,
    windows_since_sort: u32,
    /// When the balls were last sorted, and the pair collisions before that.
    last_sort: (Time, u64),
    /// How often a ball met another between the last two sortings, in collisions per epoch.
    rate: f64,
    /// Flights begun in this window.
    turns: usize,
    /// Largest speed of any piece since the balls were sorted.
    fastest: f32,
    /// How far a ball may get in a window, in grid lengths, in windows in which every ball knows its neighbours.
    drift: Option<f32>,
    /// Flights begun in such a window.
    begun: usize,
    /// Whether a ball has become faster than that allows.
    too_fast: bool,
    /// How often the balls have been sorted.
    sorts: u32,
    /// What the windows since the last time took.
    work: Work,
    /// Whether the windows before that were worth their work.
    paying: bool,
    /// Meetings found before the window's commits began, but for those that are done.
    agenda: Agenda,
    /// Meetings of pieces that began during the commits.
    follow_ups: FollowUps,
    /// Those that balls may touch whose flights have just begun.
    glimpses: Vec<Glimpse>,
    /// Meetings of the instant that has been reached which were not valid when their turn came.
    put_off: Vec<Meeting>,
    instants: InstantWatch,
    counters: Counters,
}

impl Windowed {
    /// Whether this engine can run a gas: a container, perhaps with planes, or a periodic box that is wider than any ball;
    /// every ball free to move, some moving.
    pub fn supports(gas: &Placement) -> bool {
        tuning::supports(gas)
    }

    /// Whether this engine is faster than `event` for a gas: enough balls of like size, far enough apart.
    pub fn pays(gas: &Placement) -> bool {
        tuning::pays(gas)
    }

    /// Prepares a gas that this engine supports, to be run by so many threads at the most. Their number changes no collision.
    ///
    /// # Panics
    /// If [`Self::supports`] does not hold.
    pub fn new(state: State, threads: usize) -> Self {
        let worth_it = state.ball_count() / BALLS_PER_THREAD;
        Self::with_regions(state, threads.min(worth_it))
    }

    /// Goes on from what an event-driven or windowed engine has saved.
    ///
    /// # Panics
    /// If [`Self::supports`] does not hold.
    pub fn resume(state: State, threads: usize, tally: Tally) -> Self {
        let mut engine = Self::new(state, threads);
        engine.counters = tally.counters;
        engine.instants = tally.instants;
        engine.last_sort.1 = engine.counters.pair_collisions;
        engine
    }

    /// Length of a window \[epochs\].
    pub fn window_length(&self) -> f64 {
        self.length
    }

    /// Like [`Engine::advance`], but stops where windows have turned out not to pay: when one is full and no time has passed, or
    /// when those between two sortings took more work than engine `event` would have. Gives whether it came to `until`.
    ///
    /// To go on all the same, it can be called again. Where it stops does not depend on the number of threads.
    ///
    /// # Errors
    /// As [`Engine::advance`].
    pub fn advance_while_it_pays(
        &mut self,
        until: Time,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<bool, Stuck> {
        while self.state.now < until {
            let window = if let Some(window) = self.window {
                window
            } else {
                if self.windows_since_sort >= WINDOWS_PER_SORT {
                    self.sort();
                    if !self.paying {
                        return Ok(false);
                    }
                }
                self.open()
            };
            let limit = if until < window.end {
                until
            } else {
                window.end
            };
            // Long lists are slow to search: when the window is full, a new one begins.
            let full = self.commit_until(limit, window, report)?;
            if !full {
                self.state.now = limit;
            }
            self.counters.queue_length_max = self
                .counters
                .queue_length_max
                .max(self.queue_length() as u64);
            if full || limit == window.end {
                self.close();
            }
            if full {
                self.windows_since_sort = WINDOWS_PER_SORT;
                if self.state.now == window.begin && !self.too_fast {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Like [`Self::new`], with a thread for each of so many regions even if that does not pay.
    ///
    /// # Panics
    /// If [`Self::supports`] does not hold.
    pub fn with_regions(state: State, regions: usize) -> Self {
        assert!(
            tuning::is_suitable(&state.domain, state.bodies.largest_radius())
                && !state.bodies.any_fixed(),
            "the caller has asked whether this engine supports the gas"
        );
        let count = state.ball_count();
        let region_count = regions.clamp(1, MOST_REGIONS);
        let grid = Grid::new(&state.domain, tuning::cell_width(&state), count);
        let pieces = || vec![Pieces::default(); region_count];
        let mut engine = Self {
            offsets: Offsets::new(grid.strides),
            grid,
            numbering: Numbering::new(region_count),
            team: Team::new(region_count),
            regions: vec![Region::default(); region_count],
            lines: Vec::new(),
            radii: Vec::new(),
            pieces: [pieces(), pieces(), pieces()],
            past: Past(std::array::from_fn(|_| {
                vec![Scratch::default(); region_count]
            })),
            window: None,
            length: 1.0,
            behind: false,
            windows_since_sort: 0,
            last_sort: (state.now, 0),
            rate: 0.0,
            sorts: 0,
            work: Work::default(),
            paying: true,
            turns: 0,
            fastest: 0.0,
            drift: None,
            begun: 0,
            too_fast: false,
            agenda: Agenda::default(),
            follow_ups: FollowUps::default(),
            glimpses: Vec::new(),
            put_off: Vec::new(),
            instants: InstantWatch::default(),
            counters: Counters::default(),
            state,
        };
        let gas = engine.gas(engine.next_window());
        let flights = engine.state.trajectories.iter().zip(0..);
        engine.lines = flights
            .map(|(flight, ball)| gas.line(flight, ball))
            .collect();
        engine.sort();
        engine
    }

    /// The window that begins at the present.
    fn next_window(&self) -> Window {
        let begin = self.state.now;
        let end = begin.after(self.length);
        Window {
            begin,
            end: end.expect("a window is a few epochs long"),
        }
    }

    fn gas(&self, window: Window) -> Gas<'_> {
        Gas {
            state: &self.state,
            grid: &self.grid,
            offsets: &self.offsets,
            numbering: self.numbering,
            window,
            per_epoch: 1.0 / self.length,
            speed_scale: self.grid.scale * self.length,
            slack: 2.0 * self.line_error() + grid::SLACK,
            drift: self.drift.map(f64::from),
        }
    }

    /// By how much a line's position may be wrong, in grid lengths: by the rounding at each of the windows since it was made,
    /// and by that of its velocity.
    fn line_error(&self) -> f64 {
        let fastest = f64::from(self.drift.unwrap_or(self.fastest));
        let extent = self.grid.extent() + 4.0 * fastest;
        f64::from(f32::EPSILON) * f64::from(WINDOWS_PER_SORT + 4) * extent
    }

    /// Lists all balls and finds the meetings of the window that begins at the present.
    fn open(&mut self) -> Window {
        self.windows_since_sort += 1;
        self.turns = 0;
        (self.begun, self.too_fast) = (0, false);
        let window = self.next_window();
        for (past, pieces) in self.past.0.iter_mut().zip(&mut self.pieces) {
            for (past, pieces) in past.iter_mut().zip(pieces) {
                std::mem::swap(past, &mut pieces.lines);
                pieces.clear();
            }
        }
        let (least, most) = (
            self.state.bodies.smallest_radius(),
            self.state.bodies.largest_radius(),
        );
        let margins = Margins {
            contact: 2.0 * most * self.grid.scale,
            least_contact: 2.0 * least * self.grid.scale,
            off_middle: 0.5 * (most - least) * self.grid.scale,
            position: self.line_error(),
            edges: self.grid.edges,
            fastest: self.drift.unwrap_or(self.fastest),
        };
        let advance = f32::from(std::mem::replace(&mut self.behind, true));
        let mut lines = std::mem::take(&mut self.lines);
        let mut regions = std::mem::take(&mut self.regions);
        let mut pieces = std::mem::take(&mut self.pieces);
        let [firsts, fresh, later] = &mut pieces;
        let gas = self.gas(window);

        let shares = by_region(&mut lines, &regions);
        let lists = regions.iter_mut().zip(shares).zip(firsts.iter_mut());
        self.team.work(lists, |((region, lines), firsts)| {
            let radii = if self.radii.is_empty() || self.drift.is_some() {
                &[]
            } else {
                &self.radii[region.flights.clone()]
            };
            let flights = Flights {
                lines,
                radii,
                past: self.drift.is_none().then_some(&self.past),
                advance,
            };
            region.list(gas, flights, margins, firsts);
        });

        let mut shelves = Shelves {
            gas,
            lines: &lines,
            kinds: [firsts, &[], &[]],
        };
        let mail = outboxes(&mut regions);
        if self.drift.is_some() {
            self.team.work(regions.iter_mut(), |region| {
                region.find_neighbours(shelves, &mail)
            });
        } else {
            self.team.work(
                regions.iter_mut().zip(fresh.iter_mut()),
                |(region, fresh)| region.find(shelves, &mail, (FRESH, fresh)),
            );
        }
        shelves.kinds[FRESH] = fresh;
        let mail = outboxes(&mut regions);
        if self.drift.is_some() {
            self.team.work(regions.iter_mut(), |region| {
                region.deliver_neighbours(mail.iter().flatten())
            });
        } else if mail.iter().any(|mail| !mail.is_empty()) {
            // What was foreseen across a region's border is listed and tested there, now that all have finished.
            self.team.work(
                regions.iter_mut().zip(later.iter_mut()),
                |(region, later)| region.find_visitors(shelves, &mail, Some((LATER, later))),
            );
            shelves.kinds[LATER] = later;
            let mail = outboxes(&mut regions);
            self.team.work(regions.iter_mut(), |region| {
                region.find_visitors(shelves, &mail, None)
            });
        }
        let found: Vec<_> = regions.iter().map(|region| &region.meetings).collect();
        self.agenda.fill(&self.team, &found);
        let slices = self.agenda.left() / MEETINGS_PER_SLICE + 1;
        self.follow_ups.begin(window.span(), slices);
        for region in &mut regions {
            region.meetings.empty();
        }
        self.work.windows += 1;
        for region in &regions {
            self.work.census += region.census;
        }

        self.fastest = regions.iter().fold(self.fastest, |fastest, region| {
            region.fastest().max(fastest)
        });
        (self.lines, self.regions, self.pieces) = (lines, regions, pieces);
        self.window = Some(window);
        window
    }

    /// Ends a window.
    fn close(&mut self) {
        self.fastest = self.regions.iter().fold(self.fastest, |fastest, region| {
            region.fastest().max(fastest)
        });
        self.work.turns += self.turns as u64;
        self.follow_ups.clear();
        self.put_off.clear();
        self.agenda.clear();
        self.window = None;
    }
}

/// What belongs to each region's flights.
fn by_region<'l, T>(
    lines: &'l mut [T],
    regions: &[Region],
) -> impl Iterator<Item = &'l mut [T]> + use<'l, T> {
    let lengths: Vec<usize> = regions.iter().map(|region| region.flights.len()).collect();
    let mut rest = lines;
    lengths.into_iter().map(move |length| {
        rest.split_off_mut(..length)
            .expect("regions share all lines")
    })
}

/// What regions have for each other's cells. Every region allows for the fastest piece of any.
fn outboxes(regions: &mut [Region]) -> Vec<Vec<region::Passage>> {
    allow_for_all(regions);
    regions
        .iter_mut()
        .map(|region| std::mem::take(&mut region.outbox))
        .collect()
}

/// Makes every region allow for the fastest piece of any.
fn allow_for_all(regions: &mut [Region]) {
    let fastest = regions.iter().map(Region::fastest).fold(0.0, f32::max);
    for region in regions {
        region.allow(fastest);
    }
}

impl Engine for Windowed {
    fn name(&self) -> &'static str {
        "windowed"
    }

    fn advance(&mut self, until: Time, report: &mut dyn FnMut(&Collision)) -> Result<(), Stuck> {
        while !self.advance_while_it_pays(until, report)? {}
        Ok(())
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn reverse(&mut self) {
        self.close();
        self.state.reverse();
        self.instants.clear();
        self.sort();
    }

    fn save(&self) -> Saved {
        Saved::Exact(Tally {
            counters: self.counters,
            instants: self.instants.clone(),
        })
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn queue_length(&self) -> usize {
        self.agenda.left() + self.follow_ups.left()
    }
}
