//! Flights between two collisions of a ball with others: their lengths and times; and the push on each wall by itself.
//!
//! A wall turns a flight but does not end it.
//!
//! The means are what all balls have flown over how many flights ended: in a run of a few flights per ball, the mean of those
//! that ended would be too short, as long ones are still going on. For the same reason the histograms begin only after the time
//! that they reach: of flights that end from then on, however long, it is known where they began.

use serde::{Deserialize, Serialize};

use crate::event::{Collision, Participants};
use crate::observe::block_sums::{BlockSums, Estimate};
use crate::observe::velocities::Velocities;
use crate::state::{State, Time};

/// Bins of a histogram; the last one also holds everything longer.
pub const BIN_COUNT: usize = 160;

/// Bins per expected mean.
const BINS_PER_MEAN: f64 = 20.0;

/// Flights of all balls, and the walls they hit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Flights {
    /// Where each ball's flight began, or the count of it.
    began: Vec<Time>,
    /// Where the count began or was interrupted.
    opened: Time,
    /// Balls that can fly.
    moving: f64,
    /// What the flights that are going on had been flown at the last look.
    under_way: f64,
    length_bin: f64,
    time_bin: f64,
    lengths: Vec<u64>,
    times: Vec<u64>,
    last_look: Time,
    /// Since the last look, what joins the sums together with the time: ends of flights and their lengths.
    ended: [f64; 2],
    /// The same: push on each wall.
    pushes: [f64; 6],
    /// Ends of flights, what was flown, the time since the look before, the push on each of six walls.
    sums: BlockSums,
}

impl Flights {
    /// No flight yet. The histograms reach eight times as far as the expected mean path \[length\] and mean time \[epochs\].
    pub fn new(state: &State, mean_path: f64, mean_time: f64) -> Self {
        Self {
            began: vec![state.now; state.ball_count()],
            opened: state.now,
            moving: (0..state.ball_count())
                .filter(|&ball| state.bodies.of(ball).mass.is_finite())
                .count() as f64,
            under_way: 0.0,
            length_bin: mean_path / BINS_PER_MEAN,
            time_bin: mean_time / BINS_PER_MEAN,
            lengths: vec![0; BIN_COUNT],
            times: vec![0; BIN_COUNT],
            last_look: state.now,
            ended: [0.0; 2],
            pushes: [0.0; 6],
            sums: BlockSums::new(9),
        }
    }

    /// Takes a collision into account; the velocities are those before it.
    #[inline]
    pub fn record(&mut self, collision: &Collision, velocities: &Velocities) {
        match collision.participants {
            Participants::Pair(first, second) => {
                let reach = BIN_COUNT as f64 * self.time_bin;
                let counts = collision.time.since(self.opened) >= reach;
                for ball in [first, second] {
                    let began = std::mem::replace(&mut self.began[ball as usize], collision.time);
                    if velocities.mass(ball).is_finite() {
                        let time = collision.time.since(began);
                        self.end(time * velocities.of_ball(ball).length(), time, counts);
                    }
                }
            }
            Participants::Wall(_, wall) => {
                let side = 2 * wall.axis + usize::from(wall.upper);
                self.pushes[side] += collision.impulse.length();
            }
            Participants::Plane(..) | Participants::Face(..) => {}
        }
    }

    #[inline]
    fn end(&mut self, length: f64, time: f64, counts: bool) {
        if counts {
            let bin = |value: f64, width: f64| ((value / width) as usize).min(BIN_COUNT - 1);
            self.lengths[bin(length, self.length_bin)] += 1;
            self.times[bin(time, self.time_bin)] += 1;
        }
        self.ended[0] += 1.0;
        self.ended[1] += length;
    }

    /// Closes a stretch of the averages; the velocities are those of the present.
    pub fn look(&mut self, state: &State, velocities: &Velocities) {
        let under_way = self.under_way_at(state.now, velocities);
        let sums = self.sums.open();
        let [ends, lengths] = std::mem::take(&mut self.ended);
        sums[0] += ends;
        sums[1] += lengths + under_way - self.under_way;
        sums[2] += state.now.since(self.last_look);
        for (sum, push) in sums[3..].iter_mut().zip(std::mem::take(&mut self.pushes)) {
            *sum += push;
        }
        self.under_way = under_way;
        self.last_look = state.now;
        self.sums.close_record();
    }

    /// What the flights that are going on have flown so far.
    fn under_way_at(&self, now: Time, velocities: &Velocities) -> f64 {
        (self.began.iter())
            .zip(velocities.all())
            .filter(|(_, (_, mass))| mass.is_finite())
            .map(|(began, (velocity, _))| now.since(*began) * velocity.length())
            .sum()
    }

    /// A reversal ends no flight, but what follows is no part of it.
    pub fn interrupt(&mut self, state: &State, velocities: &Velocities) {
        let under_way = self.under_way_at(state.now, velocities);
        self.ended[1] += under_way - self.under_way;
        self.under_way = 0.0;
        self.began.fill(state.now);
        self.opened = state.now;
    }

    /// Mean path \[length\].
    pub fn mean_path(&self) -> Estimate {
        self.sums
            .estimate(|sums| (sums[0] > 0.0).then(|| sums[1] / sums[0]))
    }

    /// Mean time of a flight \[epochs\].
    pub fn mean_time(&self) -> Estimate {
        self.sums
            .estimate(|sums| (sums[0] > 0.0).then(|| self.moving * sums[2] / sums[0]))
    }

    /// Force on one of the six walls, lower and upper of each axis in turn.
    pub fn wall_force(&self, wall: usize) -> Estimate {
        self.sums
            .estimate(|sums| (sums[2] > 0.0).then(|| sums[3 + wall] / sums[2]))
    }

    /// Width of a bin of lengths \[length\], and flights per bin.
    pub fn lengths(&self) -> (f64, &[u64]) {
        (self.length_bin, &self.lengths)
    }

    /// Width of a bin of times \[epochs\], and flights per bin.
    pub fn times(&self) -> (f64, &[u64]) {
        (self.time_bin, &self.times)
    }
}
