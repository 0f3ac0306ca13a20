//! The cells in which partners are drawn: equal boxes that fill the space open to the centres of the balls.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::domain::{Boundary, Domain};

/// Most cells along an axis.
const MOST: f64 = (1 << 20) as f64;

/// Added to a number in `[0, 2^22)`, it leaves the nearest whole number in the low bits; numbers are moved down by one half
/// beforehand, so that it is the whole number below.
const MAGIC: f32 = (1 << 23) as f32;

/// The grid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cells {
    /// How far a centre gets from the middle, along each axis \[length\].
    pub reach: DVec3,
    /// Cells along each axis.
    pub dimensions: [usize; 3],
    scale: [f32; 3],
    offset: [f32; 3],
}

impl Cells {
    /// Cells at most `width` wide, for centres that keep `radius` from the walls of a container.
    pub fn new(domain: &Domain, radius: f64, width: f64) -> Self {
        let reach = if domain.boundary == Boundary::Periodic {
            domain.half_size
        } else {
            domain.half_size - radius
        };
        let cells = (2.0 * reach / width)
            .ceil()
            .clamp(DVec3::ONE, DVec3::splat(MOST));
        Self {
            reach,
            dimensions: cells.to_array().map(|cells| cells as usize),
            scale: (0.5 * cells / reach).as_vec3().to_array(),
            offset: (0.5 * cells - 0.5).as_vec3().to_array(),
        }
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.dimensions.iter().product()
    }

    /// Cells in a plane perpendicular to z: consecutive ones.
    pub fn per_plane(&self) -> usize {
        self.dimensions[0] * self.dimensions[1]
    }

    /// Volume of a cell \[length^3\].
    pub fn volume(&self) -> f64 {
        8.0 * self.reach.element_product() / self.count() as f64
    }

    /// Longest edge of a cell \[length\].
    pub fn width(&self) -> f64 {
        let dimensions = self.dimensions.map(|cells| cells as f64);
        (2.0 * self.reach / DVec3::from_array(dimensions)).max_element()
    }

    /// The cell of a centre; the outermost take what is beyond.
    ///
    /// In 32 bits and without a branch, so that many are worked out side by side; there are fewer cells than balls.
    #[inline(always)]
    pub fn of(&self, position: [f32; 3]) -> u32 {
        let [x, y, z] = [
            self.coordinate(position, 0),
            self.coordinate(position, 1),
            self.coordinate(position, 2),
        ];
        (z * self.dimensions[1] as u32 + y) * self.dimensions[0] as u32 + x
    }

    #[inline(always)]
    fn coordinate(&self, position: [f32; 3], axis: usize) -> u32 {
        let place = position[axis] * self.scale[axis] + self.offset[axis];
        let whole = (place.max(0.0) + MAGIC).to_bits() & 0x007f_ffff;
        whole.min(self.dimensions[axis] as u32 - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_in_the_cell_that_holds_it() {
        let domain = Domain::container(DVec3::new(1.5, 1.0, 1.25));
        let cells = Cells::new(&domain, 0.25, 0.5);
        assert_eq!(cells.dimensions, [5, 3, 4]);
        assert_eq!(cells.count(), 60);
        assert!((cells.volume() - 2.5 * 1.5 * 2.0 / 60.0).abs() < 1e-15);
        assert_eq!(cells.of([-1.2, -0.7, -0.9]), 0);
        assert_eq!(cells.of([-0.7, -0.7, -0.9]), 1);
        assert_eq!(cells.of([-1.2, -0.2, -0.9]), 5);
        assert_eq!(cells.of([-1.2, -0.7, 0.9]), 45);
        assert_eq!(cells.of([1.3, 0.8, 1.1]), 59, "beyond the corner");
        assert_eq!(cells.of([-1.3, -0.8, -1.1]), 0);
    }
}
