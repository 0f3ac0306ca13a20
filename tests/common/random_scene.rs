//! Scenes of all kinds, for comparing an engine with one that looks at all pairs.

use glam::DVec3;
use moltop::domain::{Boundary, Domain, Plane};
use moltop::state::{Body, Placement};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::common::normal;

/// Balls of one or several sizes at random places without overlap, now and then an obstacle or a point among them, in a
/// container, a periodic box or open space, with up to two planes.
pub fn random_scene(seed: u64) -> Placement {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let count = random.random_range(2..45);
    let kinds: u32 = random.random_range(1..4);
    let body = |random: &mut Xoshiro256PlusPlus| Body {
        radius: if random.random_range(0..8) == 0 {
            0.0
        } else {
            random.random_range(0.02..1.0)
        },
        mass: if random.random_range(0..10) == 0 {
            f64::INFINITY
        } else {
            random.random_range(0.1..100.0)
        },
    };
    let bodies: Vec<Body> = (0..kinds).map(|_| body(&mut random)).collect();
    let half_size = DVec3::new(
        random.random_range(2.0..8.0),
        random.random_range(2.0..8.0),
        random.random_range(2.0..8.0),
    );
    let boundary =
        [Boundary::Container, Boundary::Periodic, Boundary::Open][random.random_range(0..3)];
    // A plane cannot pass through a face whose two sides are one.
    let plane_count = if boundary == Boundary::Periodic {
        0
    } else {
        random.random_range(0..3)
    };
    let plane = |random: &mut Xoshiro256PlusPlus| Plane {
        normal: normal(random).normalize(),
        offset: random.random_range(-1.0..1.0),
    };
    let planes: Vec<Plane> = (0..plane_count).map(|_| plane(&mut random)).collect();
    let mut placement = Placement {
        domain: Domain {
            boundary,
            half_size,
            planes,
        },
        center: DVec3::ZERO,
        bodies,
        body_of: Vec::new(),
        positions: Vec::new(),
        velocities: Vec::new(),
    };
    let period = placement.domain.period();
    for _ in 0..count {
        let kind = random.random_range(0..kinds);
        let Body { radius, mass } = placement.bodies[kind as usize];
        let room = half_size - radius;
        for _attempt in 0..100 {
            let place =
                DVec3::from_array(room.to_array().map(|room| random.random_range(-room..room)));
            let near = |other: DVec3| {
                let apart = place - other;
                if period == DVec3::ZERO {
                    apart
                } else {
                    apart - (apart / period).round() * period
                }
            };
            let free = placement
                .positions
                .iter()
                .zip(&placement.body_of)
                .all(|(other, &kind)| {
                    near(*other).length() > radius + placement.bodies[kind as usize].radius
                })
                && placement
                    .domain
                    .planes
                    .iter()
                    .all(|plane| plane.distance(place).abs() > radius);
            if free {
                placement.positions.push(place);
                placement.body_of.push(kind);
                placement.velocities.push(if mass.is_finite() {
                    normal(&mut random)
                } else {
                    DVec3::ZERO
                });
                break;
            }
        }
    }
    placement
}
