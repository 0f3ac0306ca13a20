//! The search for a ball's next collision among the balls that share a cell with it.
//!
//! Almost all pairs miss each other by far. That is seen on the rounded trajectories, with a margin that no rounding
//! reaches; the rest is decided on integers.

use glam::DVec3;

use crate::cell_list::{CellList, Company};
use crate::collision::separation_at_later_begin;
use crate::engine::reversible::gas::Gas;
use crate::state::Trajectory;

/// What rounding can do to a distance \[length\], with a wide margin: coordinates are below 4 and have 53 bits.
const ROUNDING: f64 = 1.0 / (1_u64 << 44) as f64;

/// Share of `|r|^2 |v|^2` by which a rejection may be wrong through rounding, with a wide margin.
const REJECTION_MARGIN: f64 = 1e-12;

/// The earliest pair collision that a ball knows of.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// When.
    pub tick: i128,
    /// With whom; `u32::MAX` for nobody.
    pub partner: u32,
    /// Boxes by which the ball is moved to meet its partner; zero but across a periodic face.
    pub image: [i8; 3],
}

impl Candidate {
    /// Later than any collision.
    pub const NONE: Self = Self {
        tick: i128::MAX,
        partner: u32::MAX,
        image: [0; 3],
    };
}

/// A ball's search.
#[derive(Clone, Copy, Debug)]
pub struct Search {
    ball: usize,
    /// The ball it has just collided with; `u32::MAX` for none.
    partner: u32,
    /// The earliest collision found.
    pub best: Candidate,
    /// Whether that partner is seen to part from it, as a reversed run must see it.
    pub parts: bool,
    /// Whether another ball is seen to part from it, which a reversed run would take for a collision, or to overlap with it.
    pub disturbed: bool,
}

impl Search {
    /// Goes on from a collision that the ball knows of.
    #[inline]
    pub fn new(ball: usize, known: Candidate, partner: Option<usize>) -> Self {
        Self {
            ball,
            partner: partner.map_or(u32::MAX, |partner| partner as u32),
            best: known,
            parts: false,
            disturbed: false,
        }
    }

    /// Looks among the balls of a cell.
    #[inline]
    pub fn look(&mut self, gas: &Gas, cells: &CellList, company: Company) {
        let trajectories = &gas.state.trajectories;
        let bodies = &gas.state.bodies;
        let trajectory = trajectories[self.ball];
        let radius = bodies.of(self.ball).radius + ROUNDING;
        for &other in company.balls {
            if other as usize == self.ball {
                continue;
            }
            let place = &trajectories[other as usize];
            let reach = radius + bodies.of(other as usize).radius;
            match company.at_face {
                None if may_meet(&trajectory, place, reach, DVec3::ZERO) => {
                    self.consider(gas, other, [0; 3]);
                }
                None => {}
                Some(cell) => cells.for_each_image(cell, other, |image| {
                    let shift = image.as_dvec3() * gas.state.domain.period();
                    if may_meet(&trajectory, place, reach, shift) {
                        self.consider(gas, other, image.to_array().map(|boxes| boxes as i8));
                    }
                }),
            }
        }
    }

    /// Takes the collision with `other` if it comes earlier.
    #[inline(never)]
    fn consider(&mut self, gas: &Gas, other: u32, image: [i8; 3]) {
        let approach = gas.approach(self.ball, other as usize, image);
        // What began earlier has been judged then.
        let begins = approach.since() == gas.now();
        if begins && approach.overlaps() {
            self.disturbed = true;
        }
        if approach.parts() {
            self.parts |= begins && other == self.partner;
            self.disturbed |= begins && other != self.partner;
        } else if let Some(tick) = approach.meeting()
            && (tick < self.best.tick || (tick == self.best.tick && self.precedes_best(other)))
        {
            self.best = Candidate {
                tick,
                partner: other,
                image,
            };
        }
    }

    /// Whether the pair with `other` comes before the best one at the same instant.
    fn precedes_best(&self, other: u32) -> bool {
        let ball = self.ball as u32;
        let pair = |other: u32| (ball.min(other), ball.max(other));
        pair(other) < pair(self.best.partner)
    }
}

/// Whether two balls could come within `reach` of each other, or are; the first is moved by `shift`.
#[inline(always)] // the rejections must stand in the caller's loop: most pairs end there
fn may_meet(first: &Trajectory, second: &Trajectory, reach: f64, shift: DVec3) -> bool {
    let separation = separation_at_later_begin(first, second).1 + shift;
    let velocity = first.velocity - second.velocity;
    let radial = separation.dot(velocity);
    let distance_squared = separation.length_squared();
    let beyond = distance_squared - reach * reach;
    if radial >= 0.0 {
        return beyond <= 0.0;
    }
    let speed_squared = velocity.length_squared();
    radial * radial + REJECTION_MARGIN * distance_squared * speed_squared >= speed_squared * beyond
}
