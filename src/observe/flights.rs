//! Flights between two collisions of a ball with others: their lengths and times; and the push on each wall by itself.
//!
//! A wall turns a flight but does not end it.

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
    /// Where each ball's flight began; `None` before its first collision with another.
    began: Vec<Option<Time>>,
    length_bin: f64,
    time_bin: f64,
    lengths: Vec<u64>,
    times: Vec<u64>,
    last_look: Time,
    /// Push on each wall since the last look, which joins the sums together with its time.
    pushes: [f64; 6],
    /// Flights, their lengths, their times, the time since the look before, the push on each of six walls.
    sums: BlockSums,
}

impl Flights {
    /// No flight yet. The histograms reach eight times as far as the expected mean path \[length\] and mean time \[epochs\].
    pub fn new(state: &State, mean_path: f64, mean_time: f64) -> Self {
        Self {
            began: vec![None; state.ball_count()],
            length_bin: mean_path / BINS_PER_MEAN,
            time_bin: mean_time / BINS_PER_MEAN,
            lengths: vec![0; BIN_COUNT],
            times: vec![0; BIN_COUNT],
            last_look: state.now,
            pushes: [0.0; 6],
            sums: BlockSums::new(10),
        }
    }

    /// Takes a collision into account; the velocities are those before it.
    #[inline]
    pub fn record(&mut self, collision: &Collision, velocities: &Velocities) {
        match collision.participants {
            Participants::Pair(first, second) => {
                for ball in [first, second] {
                    let began = self.began[ball as usize].replace(collision.time);
                    if let Some(began) = began.filter(|_| velocities.mass(ball).is_finite()) {
                        let time = collision.time.since(began);
                        self.end(time * velocities.of_ball(ball).length(), time);
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
    fn end(&mut self, length: f64, time: f64) {
        let bin = |value: f64, width: f64| ((value / width) as usize).min(BIN_COUNT - 1);
        self.lengths[bin(length, self.length_bin)] += 1;
        self.times[bin(time, self.time_bin)] += 1;
        let sums = self.sums.open();
        sums[0] += 1.0;
        sums[1] += length;
        sums[2] += time;
    }

    /// Closes a stretch of the averages.
    pub fn look(&mut self, state: &State) {
        let sums = self.sums.open();
        sums[3] += state.now.since(self.last_look);
        for (sum, push) in sums[4..].iter_mut().zip(std::mem::take(&mut self.pushes)) {
            *sum += push;
        }
        self.last_look = state.now;
        self.sums.close_record();
    }

    /// A reversal ends no flight, but what follows is no part of it.
    pub fn interrupt(&mut self) {
        self.began.fill(None);
    }

    /// Mean path \[length\].
    pub fn mean_path(&self) -> Estimate {
        self.sums
            .estimate(|sums| (sums[0] > 0.0).then(|| sums[1] / sums[0]))
    }

    /// Mean time of a flight \[epochs\].
    pub fn mean_time(&self) -> Estimate {
        self.sums
            .estimate(|sums| (sums[0] > 0.0).then(|| sums[2] / sums[0]))
    }

    /// Force on one of the six walls, lower and upper of each axis in turn.
    pub fn wall_force(&self, wall: usize) -> Estimate {
        self.sums
            .estimate(|sums| (sums[3] > 0.0).then(|| sums[4 + wall] / sums[3]))
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
