//! Small gases for the tests, made without the scene format.

use glam::DVec3;
use moltop::domain::Domain;
pub use moltop::normal::normal_vector as normal;
use moltop::state::{Body, Placement};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

/// The seed's scene: `n^3` balls of mass 1 and radius 1/2 on a lattice of spacing 1.5 in a container with edge `1.5 n + 1.5`,
/// velocities normal with deviation 1.
pub fn seed_scene(n: usize, seed: u64) -> Placement {
    lattice(n, 1.5, 1.5 * n as f64 + 1.5, seed)
}

/// `n^3` balls of mass 1 and radius 1/2 on a cubic lattice in the middle of a cubic container.
pub fn lattice(n: usize, spacing: f64, edge: f64, seed: u64) -> Placement {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let coordinate = |index: usize| (index as f64 - 0.5 * (n as f64 - 1.0)) * spacing;
    let sites = (0..n * n * n).map(|site| [site / (n * n), site / n % n, site % n]);
    let positions: Vec<_> = sites
        .map(|site| DVec3::from_array(site.map(coordinate)))
        .collect();
    Placement {
        domain: Domain::container(DVec3::splat(0.5 * edge)),
        center: DVec3::ZERO,
        bodies: vec![Body {
            radius: 0.5,
            mass: 1.0,
        }],
        body_of: Vec::new(),
        velocities: positions.iter().map(|_| normal(&mut random)).collect(),
        positions,
    }
}
