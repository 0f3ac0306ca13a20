//! Two pieces that the filter lets through, and whether they meet.

use glam::DVec3;

use crate::engine::image::{image_of, number_of, steps_of};
use crate::engine::windowed::grid::Entry;
use crate::engine::windowed::meeting::Meeting;
use crate::engine::windowed::paths::Gas;
use crate::engine::windowed::pieces::Id;
use crate::state::Trajectory;

/// Two pieces that may meet in a cell, the one of the lower ball first.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Their entries in the cell's list.
    pub entries: [Entry; 2],
    /// Their balls.
    pub balls: [u32; 2],
    /// The flights with which these entered the window.
    pub owners: [Id; 2],
    /// The cell.
    pub cell: u32,
    /// How many collisions were foreseen on the way to the later one.
    pub generation: u32,
}

impl Candidate {
    /// The same, the piece of the lower ball first.
    #[inline(always)]
    pub fn in_order(self) -> Self {
        let swap = self.balls[0] > self.balls[1];
        let sorted = |[one, other]: [u32; 2]| if swap { [other, one] } else { [one, other] };
        Self {
            entries: sorted(self.entries),
            balls: sorted(self.balls),
            owners: sorted(self.owners),
            ..self
        }
    }

    /// The meeting of two pieces in the window, if there is one. Given a `cell`, if it is there.
    #[inline(always)]
    pub fn meeting(&self, gas: &Gas, pair: &[Trajectory; 2], cell: Option<u32>) -> Option<Meeting> {
        let [radius, other_radius] = self.balls.map(|ball| gas.body(ball).radius);
        let contact = radius + other_radius;
        let (image, shift) = self.image(gas);
        let time = gas.pair_time(pair, contact, (image, shift))?;
        if let Some(cell) = cell {
            let place = pair[0].position_at(time);
            let other = pair[1].position_at(time) - shift;
            let point = place + (other - place) * (radius / contact);
            let here = cell | (self.entries[0] - number_of(self.entries[0]));
            if gas.grid.target_at(point) != here {
                return None;
            }
        }
        let pieces = self.entries.map(number_of);
        Some(gas.meeting_of(pieces, time, (self.balls, self.owners), image))
    }

    /// By how many boxes the first ball is moved to touch the second, and by what length.
    #[inline]
    pub fn image(&self, gas: &Gas) -> ([i8; 3], DVec3) {
        let images = self.entries.map(image_of);
        if images == [0, 0] {
            return ([0; 3], DVec3::ZERO);
        }
        let [first, second] = images.map(steps_of);
        let image = std::array::from_fn(|axis| first[axis] - second[axis]);
        (image, gas.shift_by(image))
    }
}
