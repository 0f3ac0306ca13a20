//! Ticks that a reversed run could not work out by itself, remembered: what happened, in which order.
//!
//! A gas of many balls never needs this (a tick is 2^-49 epochs); a symmetric scene, where a ball meets several others at once,
//! does. What is remembered lies behind the present or, after a reversal, ahead of it: there it is undone instead of
//! predicted, which puts it behind again. So time can be turned any number of times.

use serde::{Deserialize, Serialize};

use crate::event::Participants;

/// Something that changed velocities; doing it again undoes it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub enum Deed {
    /// A ball turned at a wall or plane that is perpendicular to an axis.
    Bounce {
        /// The ball.
        ball: usize,
        /// 0, 1, 2 for x, y, z.
        axis: usize,
        /// The ball and the wall or plane.
        participants: Participants,
    },
    /// Two balls collided.
    Pair {
        /// The balls.
        balls: [usize; 2],
        /// From the second to the first, in integer units.
        separation: [i128; 3],
    },
}

impl Deed {
    /// The balls that changed course; a single one twice.
    pub fn balls(&self) -> [usize; 2] {
        match *self {
            Self::Bounce { ball, .. } => [ball, ball],
            Self::Pair { balls, .. } => balls,
        }
    }
}

/// All that happened at a tick, in order.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Happening {
    /// When.
    pub tick: i128,
    /// What.
    pub deeds: Vec<Deed>,
}

/// What is remembered.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Memory {
    behind: Vec<Happening>,
    ahead: Vec<Happening>,
    /// What has happened at the present tick, until it is known whether it must be kept.
    present: Happening,
    keep: bool,
}

impl Memory {
    /// Takes note of a deed; `keep` if a reversed run could not work it out.
    #[inline]
    pub fn add(&mut self, tick: i128, deed: Deed, keep: bool) {
        if self.present.tick != tick {
            self.close();
            self.present.tick = tick;
        }
        self.present.deeds.push(deed);
        self.keep |= keep;
    }

    /// The next tick at which what is remembered is to be undone.
    #[inline]
    pub fn next_tick(&self) -> Option<i128> {
        self.ahead.last().map(|happening| happening.tick)
    }

    /// Takes out the deeds of that tick, in the order in which they are to be done.
    pub fn recall(&mut self) -> Happening {
        self.close();
        let mut happening = self.ahead.pop().expect("a tick to be undone");
        happening.deeds.reverse();
        self.behind.push(happening.clone());
        happening
    }

    /// Whether it speaks of no more than so many balls.
    pub fn fits(&self, ball_count: usize) -> bool {
        let present = std::iter::once(&self.present);
        let all = self.behind.iter().chain(&self.ahead).chain(present);
        let mut balls = all.flat_map(|happening| happening.deeds.iter().flat_map(Deed::balls));
        balls.all(|ball| ball < ball_count)
    }

    /// Follows a reversal at a tick.
    pub fn reverse(&mut self, now: i128) {
        self.close();
        std::mem::swap(&mut self.behind, &mut self.ahead);
        for happening in self.behind.iter_mut().chain(&mut self.ahead) {
            happening.tick = 2 * now - happening.tick;
        }
    }

    #[inline]
    fn close(&mut self) {
        if self.keep {
            self.behind.push(std::mem::take(&mut self.present));
            self.keep = false;
        }
        self.present.deeds.clear();
    }
}
