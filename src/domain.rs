//! Where the balls live, centred on the origin, in whatever unit the caller keeps.

use glam::DVec3;

/// The region open to the balls.
#[derive(Clone, Debug, PartialEq)]
pub enum Domain {
    /// Six hard walls; `half_size` is half the inner edge along each axis.
    Container {
        /// Distance from the centre to the walls \[length\].
        half_size: DVec3,
    },
}

impl Domain {
    /// Volume enclosed by the walls \[length^3\].
    pub fn volume(&self) -> f64 {
        let Self::Container { half_size } = self;
        8.0 * half_size.x * half_size.y * half_size.z
    }

    /// Inner area of all six walls \[length^2\].
    pub fn wall_area(&self) -> f64 {
        let Self::Container { half_size: h } = self;
        8.0 * (h.x * h.y + h.y * h.z + h.z * h.x)
    }

    /// Half the edge along each axis \[length\].
    pub fn half_size(&self) -> DVec3 {
        let Self::Container { half_size } = self;
        *half_size
    }
}
