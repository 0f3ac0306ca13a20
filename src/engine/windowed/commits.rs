//! Carries out a window's meetings in order of time, on one thread.
//!
//! A meeting is valid if its pieces are then their balls' present ones. What follows has mostly been foreseen, listed and tested
//! already; the rest is done here and now.

use std::cmp::Ordering;

use prefetch_index::prefetch_index;

use super::meeting::{Bound, Meeting};
use super::paths::Window;
use super::pieces::{Id, LATER, Line, NONE, Origin};
use super::shelves::Shelves;
use super::{MOST_PER_WINDOW, Windowed, allow_for_all, looking};
use crate::engine::Stuck;
use crate::engine::contact;
use crate::event::{Collision, Participants, Wall};
use crate::state::{State, Time, Trajectory};

/// How many meetings ahead of their turn balls are asked for.
const READ_AHEAD: usize = 24;

impl Windowed {
    /// Carries out the meetings that come no later than `limit`; gives whether it stopped earlier, because the window is full.
    pub(super) fn commit_until(
        &mut self,
        limit: Time,
        window: Window,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<bool, Stuck> {
        let most = MOST_PER_WINDOW * self.lines.len();
        let limit = limit.relative_to(window.begin.epoch);
        while let Some(meeting) = self.take_next(limit) {
            match meeting.bound() {
                Some(bound) => self.meet_bound(meeting, bound, window, report)?,
                None => self.meet(meeting, window, report)?,
            }
            if self.turns > most || self.too_fast {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The next meeting in order, if it comes no later than `limit`.
    #[inline]
    fn take_next(&mut self, limit: f64) -> Option<Meeting> {
        if self.follow_ups.is_slice_done() {
            self.go_on();
        }
        let found = self.agenda.next();
        let follow_up = self.follow_ups.next();
        let from_follow_ups = match (found, follow_up) {
            (Some(found), Some(follow_up)) => follow_up.order(found) == Ordering::Less,
            (found, _) => found.is_none(),
        };
        let next = if from_follow_ups { follow_up } else { found };
        let next = next.copied().filter(|meeting| meeting.time <= limit)?;
        if from_follow_ups {
            self.follow_ups.pop();
        } else {
            self.read_ahead();
            self.agenda.advance();
        }
        Some(next)
    }

    /// Goes on to the next slice of what has been found since the window began, and asks for the memory of its balls.
    fn go_on(&mut self) {
        self.follow_ups.go_on();
        let (state, lines, regions) = (&self.state, &self.lines, &self.regions);
        let (next, later) = self.follow_ups.soon();
        for meeting in later {
            read_ahead(state, lines, meeting);
            if self.drift.is_some() {
                looking::read_lists_ahead(regions, meeting);
            }
        }
        if self.drift.is_some() {
            for meeting in next {
                looking::read_neighbours_ahead(regions, lines, meeting);
            }
        }
    }

    /// Asks for the memory of balls whose turn comes soon.
    #[inline]
    fn read_ahead(&self) {
        let (state, lines, regions) = (&self.state, &self.lines, &self.regions);
        if let Some(meeting) = self.agenda.later(READ_AHEAD) {
            read_ahead(state, lines, meeting);
            if self.drift.is_some() {
                looking::read_lists_ahead(regions, meeting);
            }
        }
        if self.drift.is_some()
            && let Some(meeting) = self.agenda.later(READ_AHEAD / 2)
        {
            looking::read_neighbours_ahead(regions, lines, meeting);
        }
    }

    /// A meeting whose turn has come is not valid now. At the same instant it may still become so: when another one begins its
    /// pieces, whose own turn comes later although it is the cause.
    #[inline]
    fn put_off(&mut self, meeting: Meeting) {
        self.counters.stale_events += 1;
        if self
            .put_off
            .first()
            .is_some_and(|first| first.time != meeting.time)
        {
            self.put_off.clear();
        }
        self.put_off.push(meeting);
    }

    /// Takes up again what was put off and has become valid through what has just happened at `time`.
    #[inline]
    fn take_up(&mut self, time: f64) {
        if self.put_off.first().is_some_and(|first| first.time == time) {
            self.take_up_now();
        }
    }

    #[cold]
    fn take_up_now(&mut self) {
        let mut put_off = std::mem::take(&mut self.put_off);
        put_off.retain(|meeting| {
            let alone = meeting.bound().is_some();
            let [owner, other_owner] = meeting.owners;
            let valid = self.is_present(meeting.piece, owner)
                && (alone || self.is_present(meeting.other, other_owner));
            if valid {
                self.follow_ups.push(*meeting);
            }
            !valid
        });
        self.put_off = put_off;
    }

    /// Whether a piece, of the flight `owner`, is the one its ball is on.
    #[inline]
    fn is_present(&self, piece: Id, owner: Id) -> bool {
        let link = self.lines[owner as usize].link();
        link == if piece == owner { NONE } else { piece }
    }

    fn meet_bound(
        &mut self,
        meeting: Meeting,
        bound: Bound,
        window: Window,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let owner = meeting.owners[0];
        if !self.is_present(meeting.piece, owner) {
            self.put_off(meeting);
            return Ok(());
        }
        let ball = meeting.rank.0;
        let time = window.instant(meeting.time);
        self.state.now = time;
        let before = self.state.trajectories[ball as usize];
        let (after, collision) = self.gas(window).after(ball, before, bound, time);
        if let Participants::Face(_, Wall { axis, upper }) = collision.participants {
            self.state.images[ball as usize][axis] += if upper { 1 } else { -1 };
            self.begin_flight(ball, owner, meeting.next[0], after);
            self.follow_across_face(owner, axis, upper);
        } else {
            match bound {
                Bound::Wall(_) => self.counters.wall_collisions += 1,
                Bound::Plane(_) => self.counters.plane_collisions += 1,
            }
            let watched = [(ball, self.last_contact(ball))];
            self.instants
                .note(&collision, &watched, &mut self.counters)?;
            self.turn(ball, owner, meeting.next[0], after);
        }
        self.look(&[(owner, NONE)], window);
        self.take_up(meeting.time);
        report(&collision);
        Ok(())
    }

    fn meet(
        &mut self,
        meeting: Meeting,
        window: Window,
        report: &mut dyn FnMut(&Collision),
    ) -> Result<(), Stuck> {
        let pieces = [meeting.piece, meeting.other];
        let owners = meeting.owners;
        if (0..2).any(|one| !self.is_present(pieces[one], owners[one])) {
            self.put_off(meeting);
            return Ok(());
        }
        let time = window.instant(meeting.time);
        let late = time < self.state.now;
        self.counters.late_events += u64::from(late);
        let now = if late { self.state.now } else { time };
        self.state.now = now;
        let balls = [meeting.rank.0, meeting.rank.1];
        let before = balls.map(|ball| self.state.trajectories[ball as usize]);
        let bodies = balls.map(|ball| self.state.bodies.of(ball as usize));
        let shift = self.gas(window).shift_by(meeting.image);
        let (after, collision) = contact::pair(balls, before, bodies, shift, now);
        self.counters.pair_collisions += 1;
        let watched = balls.map(|ball| (ball, self.last_contact(ball)));
        self.instants
            .note(&collision, &watched, &mut self.counters)?;
        // A late collision does not happen where it was foreseen.
        let foreseen = self.drift.is_some() || (meeting.next[0] != NONE && !late);
        let next = if foreseen {
            meeting.next
        } else {
            let mut next = [NONE; 2];
            for one in [0, 1] {
                let origin = Origin {
                    owner: owners[one],
                    parents: pieces,
                    partner: balls[1 - one],
                    generation: 0,
                };
                next[one] = self.pursue(after[one], balls[one], origin, window);
            }
            next
        };
        for one in [0, 1] {
            self.turn(balls[one], owners[one], next[one], after[one]);
        }
        self.look(&[(owners[0], balls[1]), (owners[1], balls[0])], window);
        self.take_up(meeting.time);
        report(&collision);
        Ok(())
    }

    /// Lists a ball's piece that begins now and those that follow, and tests them against all that is listed where they pass. Gives
    /// the piece.
    fn pursue(&mut self, after: Trajectory, ball: u32, origin: Origin, window: Window) -> Id {
        let mut regions = std::mem::take(&mut self.regions);
        let mut pieces = std::mem::take(&mut self.pieces[LATER][0]);
        let region = &mut regions[0];
        let gas = self.gas(window);
        let own = (LATER, &mut pieces);
        let id = region.begin(gas, after, ball, origin, own);
        region.list_ways(&gas);
        self.pieces[LATER][0] = pieces;
        let passages = [std::mem::take(&mut region.outbox)];
        let [firsts, fresh, later] = &self.pieces;
        let shelves = Shelves {
            gas: self.gas(window),
            lines: &self.lines,
            kinds: [firsts, fresh, later],
        };
        allow_for_all(&mut regions);
        for region in &mut regions {
            region.visit(&shelves, &passages);
        }
        for region in &mut regions {
            for meeting in region.meetings.drain() {
                self.follow_ups.push(meeting);
            }
        }
        self.regions = regions;
        id
    }

    /// A ball goes on along another piece, after a collision.
    #[inline]
    fn turn(&mut self, ball: u32, owner: Id, piece: Id, after: Trajectory) {
        self.turns += 1;
        self.begin_flight(ball, owner, piece, after);
        self.state.collisions[ball as usize] += 1;
    }

    /// A ball goes on along another piece.
    #[inline]
    fn begin_flight(&mut self, ball: u32, owner: Id, piece: Id, after: Trajectory) {
        self.lines[owner as usize].set_link(piece);
        self.state.trajectories[ball as usize] = after;
    }

    /// When a ball's last collision was, if it had one.
    fn last_contact(&self, ball: u32) -> Option<Time> {
        let ball = ball as usize;
        (self.state.collisions[ball] > 0).then(|| self.state.trajectories[ball].begin)
    }
}

/// Asks for the memory of a meeting's balls.
#[inline]
fn read_ahead(state: &State, lines: &[Line], meeting: &Meeting) {
    let (ball, other) = meeting.rank;
    // The number of a bound names a ball, too, if not one that is needed.
    for ball in [ball, other] {
        prefetch_index(&state.trajectories, ball as usize);
        prefetch_index(&state.collisions, ball as usize);
    }
    for owner in meeting.owners {
        prefetch_index(lines, owner as usize);
    }
    if meeting.bound().is_some() && !state.images.is_empty() {
        prefetch_index(&state.images, ball as usize);
    }
}
