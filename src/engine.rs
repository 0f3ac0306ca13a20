//! Engines: what moves a [`crate::state::State`] forward in time.

use serde::{Deserialize, Serialize};

use crate::engine::contact::InstantWatch;
use crate::event::{Collision, Participants};
use crate::state::{State, Time};

pub mod alternating;
pub mod contact;
pub mod event_driven;
mod image;
pub mod reversible;
pub mod statistical;
pub mod step_clock;
pub mod time_stepping;
mod turn;
pub mod windowed;

/// What moves a gas forward in time: a function of its state, which alone decides what comes next.
pub trait Engine: Send {
    /// Its name, as `--engine` takes it.
    fn name(&self) -> &'static str;

    /// Runs up to and including `until`, reporting each collision. Where one call ends and the next begins changes nothing.
    ///
    /// # Errors
    /// [`Stuck`] if a ball collides without end at one instant, as in a packing without room.
    fn advance(&mut self, until: Time, report: &mut dyn FnMut(&Collision)) -> Result<(), Stuck>;

    /// Like [`Engine::advance`], but an engine that goes in steps may sum up what happens in each, which is much cheaper.
    ///
    /// # Errors
    /// As [`Engine::advance`].
    fn advance_in_sums(
        &mut self,
        until: Time,
        report: &mut dyn FnMut(Report),
    ) -> Result<(), Stuck> {
        self.advance(until, &mut |collision| report(Report::One(collision)))
    }

    /// The gas: its present, and the balls as of the last time it was settled, if the engine has to.
    fn state(&self) -> &State;

    /// Makes the state as exact as the engine knows it, for an engine that knows more than the state; changes no event.
    fn settle(&mut self) {}

    /// Negates all velocities.
    fn reverse(&mut self);

    /// What it must be given beside its state to go on as if it had never stopped; see [`Saved`].
    fn save(&self) -> Saved;

    /// What has been counted since the engine was made.
    fn counters(&self) -> Counters;

    /// Events waiting; zero for an engine without a queue.
    fn queue_length(&self) -> usize;

    /// When the gas last went from one method to another, if it has: [`Engine::name`] is that of the one that has it.
    fn last_change(&self) -> Option<Time> {
        None
    }
}

/// What an engine reports.
#[derive(Clone, Copy, Debug)]
pub enum Report<'a> {
    /// A collision.
    One(&'a Collision),
    /// All collisions in a stretch of time.
    Sums(&'a Sums),
}

/// What happened in a stretch of time, spread evenly over it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sums {
    /// When the stretch begins.
    pub begin: Time,
    /// When it ends.
    pub end: Time,
    /// Ball-ball collisions.
    pub pair_collisions: u64,
    /// Collisions with container walls.
    pub wall_collisions: u64,
    /// `sum of r . dp` over the pair collisions.
    pub pair_virial: f64,
    /// Momentum given to the walls, perpendicular to them.
    pub wall_impulse: f64,
}

impl Sums {
    /// The part of these sums that falls into the first `share` of their time; counts are rounded down.
    #[must_use]
    pub fn share(&self, share: f64) -> Self {
        let part = |all: u64| (all as f64 * share) as u64;
        Self {
            begin: self.begin,
            end: self
                .begin
                .after(share * self.end.since(self.begin))
                .unwrap_or(self.end),
            pair_collisions: part(self.pair_collisions),
            wall_collisions: part(self.wall_collisions),
            pair_virial: share * self.pair_virial,
            wall_impulse: share * self.wall_impulse,
        }
    }

    /// What is left of these sums when an earlier part, with the same beginning, is taken away.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            begin: earlier.end,
            end: self.end,
            pair_collisions: self.pair_collisions - earlier.pair_collisions,
            wall_collisions: self.wall_collisions - earlier.wall_collisions,
            pair_virial: self.pair_virial - earlier.pair_virial,
            wall_impulse: self.wall_impulse - earlier.wall_impulse,
        }
    }
}

/// What an engine knows beyond its [`State`] and cannot work out from it, between two calls of [`Engine::advance`].
///
/// Each engine has a `resume` that takes a state and this, and from there on gives the same collisions, bit for bit. What can be
/// worked out (cells, calendars, windows) is not kept. An engine of another kind adds its variant at the end, so that the
/// checkpoints there are can still be read.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Saved {
    /// An event-driven or windowed engine: between collisions, the trajectories say all but what has been counted.
    Exact(Tally),
    /// The reversible engine.
    Reversible(reversible::Saved),
    /// The engine of fixed steps.
    Step(time_stepping::Saved),
    /// The statistical engine.
    Statistical(Box<statistical::Saved>),
    /// Engines windowed and event in turns.
    Alternating(alternating::Saved),
}

/// What an exact engine has counted.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Tally {
    /// Since the engine was made.
    pub counters: Counters,
    /// Collisions at one instant.
    pub instants: InstantWatch,
}

impl Saved {
    /// Whether it belongs to a gas of so many balls.
    pub fn fits(&self, ball_count: usize) -> bool {
        match self {
            Self::Exact(tally) => tally.instants.fits(ball_count),
            Self::Reversible(saved) => saved.fits(ball_count),
            Self::Step(saved) => saved.fits(ball_count),
            Self::Statistical(saved) => saved.fits(ball_count),
            Self::Alternating(saved) => saved.fits(ball_count),
        }
    }
}

/// What an engine has counted since it was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Ball-ball collisions.
    pub pair_collisions: u64,
    /// Collisions with container walls.
    pub wall_collisions: u64,
    /// Collisions with planes.
    pub plane_collisions: u64,
    /// Balls reaching into a new cell, or leaving the shell within which their list of neighbours is good.
    pub cell_crossings: u64,
    /// Queued collisions whose partner had changed course meanwhile.
    pub stale_events: u64,
    /// Collisions found only after their time; zero in a sound run that started without overlaps.
    pub late_events: u64,
    /// Collisions at the same instant as the collision before.
    pub ties: u64,
    /// Collisions of a ball at the same instant as its own collision before.
    pub zero_time_events: u64,
    /// Collisions that had to be remembered because a reversed run could not find them: several of one ball at one instant.
    pub remembered_events: u64,
    /// Balls that overlap, or part from a touch, just as the run starts: at that instant a reversed run takes it for a collision.
    pub irreversible_starts: u64,
    /// Most events ever in the calendar.
    pub queue_length_max: u64,
    /// Steps of an engine that goes in steps.
    pub steps: u64,
    /// Steps in which missed collisions were looked for: all but those in which balls fly farther than pairs are listed.
    pub audited_steps: u64,
    /// Pairs that met and parted again within an audited step, and so did not collide.
    pub missed_collisions: u64,
    /// Collisions of a pair that has not parted since its last one, because something drove it together again.
    pub double_bounces: u64,
}

/// Why an engine cannot go on: a ball collides again and again without time passing.
#[derive(Clone, Debug, PartialEq)]
pub struct Stuck {
    /// When.
    pub time: Time,
    /// The collision that repeats.
    pub participants: Participants,
    /// How often the ball has collided at this instant.
    pub repeats: u32,
}

impl std::fmt::Display for Stuck {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        let who = match self.participants {
            Participants::Pair(first, second) => format!("balls {first} and {second}"),
            Participants::Wall(ball, _) | Participants::Face(ball, _) => {
                format!("ball {ball} and a wall")
            }
            Participants::Plane(ball, plane) => format!("ball {ball} and plane {plane}"),
        };
        write!(
            formatter,
            "no time progress: {who} collided {} times at one instant; they have no room to move",
            self.repeats
        )
    }
}
