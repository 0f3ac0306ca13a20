//! Gases made directly, for experiments and tests: lattices, random places, the seed's scene.
//!
//! Same arguments, same bits: all randomness comes from one seeded generator per gas.

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::domain::{Boundary, Domain};
pub use crate::normal::normal_vector as normal;
use crate::state::{Body, Placement};

/// The generator that a seed starts.
pub fn generator(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

/// A direction, all alike.
pub fn direction(random: &mut Xoshiro256PlusPlus) -> DVec3 {
    normal(random).normalize()
}

/// A place in a box of this half size around the origin, all alike.
pub fn place_in(half_size: DVec3, random: &mut Xoshiro256PlusPlus) -> DVec3 {
    DVec3::from_array(
        half_size
            .to_array()
            .map(|half| half * (2.0 * random.random::<f64>() - 1.0)),
    )
}

/// The seed's scene: `n^3` balls of mass 1 and radius 1/2 on a lattice of spacing 1.5 in a container with edge `1.5 n + 1.5`,
/// velocities normal with deviation 1.
pub fn seed_scene(n: usize, seed: u64) -> Placement {
    lattice(n, 1.5, 1.5 * n as f64 + 1.5, seed)
}

/// `n^3` balls of mass 1 and radius 1/2 on a cubic lattice in the middle of a cubic container.
pub fn lattice(n: usize, spacing: f64, edge: f64, seed: u64) -> Placement {
    let coordinate = |index: usize| (index as f64 - 0.5 * (n as f64 - 1.0)) * spacing;
    let sites = (0..n * n * n).map(|site| [site / (n * n), site / n % n, site % n]);
    let positions = sites
        .map(|site| DVec3::from_array(site.map(coordinate)))
        .collect();
    with_normal_velocities(container(DVec3::splat(0.5 * edge), positions), seed)
}

/// `4 n^3` balls of mass 1 and diameter 1 on a face-centred cubic lattice that fills a periodic box at a number density, at rest
/// as a whole.
pub fn face_centred(n: usize, density: f64, seed: u64) -> Placement {
    let edge = (4.0 / density).cbrt();
    let half = 0.5 * n as f64 * edge;
    let corners = (0..n * n * n).map(|cell| [cell / (n * n), cell / n % n, cell % n]);
    let basis = [
        [0.0, 0.0, 0.0],
        [0.0, 0.5, 0.5],
        [0.5, 0.0, 0.5],
        [0.5, 0.5, 0.0],
    ];
    let positions = corners
        .flat_map(|corner| {
            basis.map(|site| {
                let coordinate =
                    |axis: usize| (corner[axis] as f64 + site[axis] + 0.25) * edge - half;
                DVec3::new(coordinate(0), coordinate(1), coordinate(2))
            })
        })
        .collect();
    let mut gas = with_normal_velocities(container(DVec3::splat(half), positions), seed);
    gas.domain.boundary = Boundary::Periodic;
    stop_drift(&mut gas);
    gas
}

/// Balls of mass 1 and radius 1/2 at random places without overlap in a container.
pub fn random(count: usize, half_size: DVec3, seed: u64) -> Placement {
    let mut random = generator(seed);
    let mut positions: Vec<DVec3> = Vec::with_capacity(count);
    while positions.len() < count {
        let place = place_in(half_size - 0.5, &mut random);
        if positions
            .iter()
            .all(|other| other.distance_squared(place) > 1.0)
        {
            positions.push(place);
        }
    }
    with_normal_velocities(container(half_size, positions), seed)
}

/// Balls of mass 1 and radius 1/2 at rest at these places in a container.
pub fn container(half_size: DVec3, positions: Vec<DVec3>) -> Placement {
    Placement {
        domain: Domain::container(half_size),
        center: DVec3::ZERO,
        bodies: vec![Body {
            radius: 0.5,
            mass: 1.0,
        }],
        body_of: Vec::new(),
        velocities: vec![DVec3::ZERO; positions.len()],
        positions,
    }
}

/// The same gas with normal velocities of deviation 1.
pub fn with_normal_velocities(mut gas: Placement, seed: u64) -> Placement {
    let mut random = generator(seed);
    gas.velocities
        .iter_mut()
        .for_each(|velocity| *velocity = normal(&mut random));
    gas
}

/// Takes the mean velocity away from every ball; all must have one mass.
pub fn stop_drift(gas: &mut Placement) {
    let mean = gas.velocities.iter().sum::<DVec3>() / gas.velocities.len() as f64;
    gas.velocities
        .iter_mut()
        .for_each(|velocity| *velocity -= mean);
}

/// Radius and mass of a ball.
pub fn body_of(gas: &Placement, ball: usize) -> Body {
    gas.bodies[gas.body_of.get(ball).map_or(0, |&kind| kind as usize)]
}

/// A mixture at random places in a container: 2 to 300 balls of up to three sizes, the largest up to fifty times the smallest.
pub fn random_mixture(seed: u64) -> Placement {
    let mut random = generator(seed);
    let count = (2.0 * 150.0_f64.powf(random.random::<f64>())) as usize;
    let mut half = || random.random_range(2.0..8.0);
    let mut gas = container(DVec3::new(half(), half(), half()), Vec::new());
    let body = |random: &mut Xoshiro256PlusPlus| Body {
        radius: random.random_range(0.02..1.0),
        mass: random.random_range(0.1..100.0),
    };
    gas.bodies = (0..random.random_range(1..4))
        .map(|_| body(&mut random))
        .collect();
    for _ in 0..count {
        let kind = random.random_range(0..gas.bodies.len());
        let radius = gas.bodies[kind].radius;
        for _attempt in 0..100 {
            let place = place_in(gas.domain.half_size - radius, &mut random);
            let free = gas.positions.iter().enumerate().all(|(other, position)| {
                position.distance(place) > radius + body_of(&gas, other).radius
            });
            if free {
                gas.positions.push(place);
                gas.body_of.push(kind as u32);
                gas.velocities.push(normal(&mut random));
                break;
            }
        }
    }
    gas
}
