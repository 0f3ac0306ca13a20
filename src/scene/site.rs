//! The sites of a lattice, centred on the origin.

use glam::DVec3;

/// The cell that a lattice repeats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cell {
    /// Simple cubic: one site per cell; neighbours are one spacing apart.
    Cubic,
    /// Face-centred cubic: four sites per cell; neighbours are `spacing / sqrt(2)` apart.
    Fcc,
}

impl Cell {
    /// Sites of one cell, in units of its edge.
    fn basis(self) -> &'static [DVec3] {
        const CUBIC: [DVec3; 1] = [DVec3::ZERO];
        const FCC: [DVec3; 4] = [
            DVec3::ZERO,
            DVec3::new(0.0, 0.5, 0.5),
            DVec3::new(0.5, 0.0, 0.5),
            DVec3::new(0.5, 0.5, 0.0),
        ];
        match self {
            Self::Cubic => &CUBIC,
            Self::Fcc => &FCC,
        }
    }

    /// Cells along an edge of the smallest cube of cells with at least `count` sites.
    pub(super) fn edge_for(self, count: usize) -> usize {
        let sites = self.basis().len();
        let mut edge = (count as f64 / sites as f64).cbrt() as usize;
        while edge.pow(3) * sites < count {
            edge += 1;
        }
        edge
    }

    /// Sites of that cube.
    pub fn sites_of_cube(self, count: usize) -> usize {
        self.edge_for(count).pow(3) * self.basis().len()
    }

    /// Neighbouring sites are this many cell edges apart.
    pub(super) fn neighbour_distance(self) -> f64 {
        match self {
            Self::Cubic => 1.0,
            Self::Fcc => std::f64::consts::FRAC_1_SQRT_2,
        }
    }

    /// Distance between the outermost sites along an axis, in cell edges.
    pub(super) fn extent(self, edge: usize) -> f64 {
        match self {
            Self::Cubic => edge.saturating_sub(1) as f64,
            Self::Fcc => edge as f64 - 0.5,
        }
    }

    /// `count` sites of the smallest cube of cells that has them, cell by cell with z fastest, centred on the origin.
    ///
    /// When the cube has more sites than balls, the empty sites are spread evenly over the order.
    pub fn sites(self, count: usize, spacing: DVec3) -> impl Iterator<Item = DVec3> {
        let basis = self.basis();
        let edge = self.edge_for(count);
        let site_count = self.sites_of_cube(count);
        let first = -0.5 * self.extent(edge);
        (0..count).map(move |ball| {
            let site = (ball as u128 * site_count as u128 / count as u128) as usize;
            let (cell, offset) = (site / basis.len(), basis[site % basis.len()]);
            let place =
                [cell / (edge * edge), cell / edge % edge, cell % edge].map(|step| step as f64);
            (DVec3::from_array(place) + offset + first) * spacing
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lattice_is_the_smallest_that_holds_the_balls() {
        assert_eq!(
            [0, 1, 2, 8, 9, 704_969].map(|count| Cell::Cubic.edge_for(count)),
            [0, 1, 2, 2, 3, 89]
        );
        assert_eq!(
            [1, 4, 5, 32, 33].map(|count| Cell::Fcc.edge_for(count)),
            [1, 1, 2, 2, 3]
        );
    }

    #[test]
    fn z_runs_fastest_and_the_centre_is_the_origin() {
        let sites: Vec<DVec3> = Cell::Cubic.sites(8, DVec3::splat(2.0)).collect();
        assert_eq!(sites[0], DVec3::splat(-1.0));
        assert_eq!(sites[1], DVec3::new(-1.0, -1.0, 1.0));
        assert_eq!(sites[7], DVec3::splat(1.0));
    }

    #[test]
    fn left_out_sites_are_spread_evenly() {
        let sites: Vec<DVec3> = Cell::Cubic.sites(4, DVec3::ONE).collect();
        assert_eq!(
            sites.iter().sum::<DVec3>().z,
            -2.0,
            "every second site is empty"
        );
    }

    #[test]
    fn neighbours_in_a_face_centred_lattice_are_as_far_apart_as_said() {
        let sites: Vec<DVec3> = Cell::Fcc.sites(32, DVec3::splat(3.0)).collect();
        let nearest = sites[1..]
            .iter()
            .map(|site| (*site - sites[0]).length())
            .fold(f64::MAX, f64::min);
        assert!((nearest / (3.0 * Cell::Fcc.neighbour_distance()) - 1.0).abs() < 1e-15);
    }
}
