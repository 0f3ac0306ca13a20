//! Kinds of balls for kinetic theory: how many there are of each radius and mass, and how often two of them touch.

use std::f64::consts::PI;

use crate::state::Placement;

/// More kinds of balls than this are lumped into so many groups of like radius.
const MOST_KINDS: usize = 64;

/// Balls alike, lengths in units of the largest edge.
#[derive(Clone, Copy)]
pub(super) struct Kind {
    pub(super) count: f64,
    pub(super) diameter: f64,
    pub(super) mass: f64,
    /// Number per volume of the bulk, far from the walls.
    pub(super) density: f64,
}

/// Sums over all pairs of kinds.
pub(super) struct Pairs {
    /// Pressure beyond the ideal gas's, over kT.
    pub(super) excess: f64,
    /// Collisions per volume and time, over sqrt(kT).
    pub(super) collisions: f64,
}

impl Pairs {
    /// Sums over kinds with contact values by their shape, `d_i d_j / (d_i + d_j)`.
    ///
    /// A ball does not collide with itself: `others` is the share of N^2 pairs that are pairs of two.
    pub(super) fn of(kinds: &[Kind], others: f64, contact_value: impl Fn(f64) -> f64) -> Self {
        let (mut excess, mut collisions) = (0.0, 0.0);
        for a in kinds {
            for b in kinds {
                let distance = 0.5 * (a.diameter + b.diameter);
                if distance == 0.0 {
                    continue; // two points never meet
                }
                let contact = contact_value(0.5 * a.diameter * b.diameter / distance);
                let pairs = others * a.density * b.density * contact;
                excess += 2.0 * PI / 3.0 * pairs * distance.powi(3);
                let spread = 8.0 * PI * (1.0 / a.mass + 1.0 / b.mass);
                collisions += 0.5 * pairs * distance.powi(2) * spread.sqrt();
            }
        }
        Self { excess, collisions }
    }
}

/// Contact value of two balls in a mixture by their shape (BMCSL; Carnahan-Starling for balls alike).
pub(super) fn mixture_contact_value(kinds: &[Kind]) -> impl Fn(f64) -> f64 {
    let [_, _, xi2, xi3, _] = moments(kinds);
    let free = 1.0 - xi3;
    move |shape| {
        1.0 / free + 3.0 * xi2 * shape / (free * free) + 2.0 * (xi2 * shape).powi(2) / free.powi(3)
    }
}

/// `pi / 6 sum n_i d_i^k` for k from 0 to 4.
pub(super) fn moments(kinds: &[Kind]) -> [f64; 5] {
    [0, 1, 2, 3, 4].map(|k| {
        PI / 6.0
            * kinds
                .iter()
                .map(|kind| kind.density * kind.diameter.powi(k))
                .sum::<f64>()
    })
}

/// The kinds of a placement's balls, lengths in `unit`; their densities are left at zero.
pub(super) fn kinds(placement: &Placement, unit: f64) -> Vec<Kind> {
    let mut counts = vec![0_usize; placement.bodies.len()];
    match placement.body_of.as_slice() {
        [] => counts.fill(placement.positions.len()),
        body_of => body_of.iter().for_each(|&body| counts[body as usize] += 1),
    }
    let mut kinds: Vec<Kind> = (placement.bodies.iter().zip(counts))
        .map(|(body, count)| Kind {
            count: count as f64,
            diameter: 2.0 * body.radius / unit,
            mass: body.mass,
            density: 0.0,
        })
        .collect();
    if kinds.len() > MOST_KINDS {
        kinds.sort_by(|a, b| a.diameter.total_cmp(&b.diameter));
        kinds = kinds
            .chunks(kinds.len().div_ceil(MOST_KINDS))
            .map(lump)
            .collect();
    }
    kinds
}

/// One kind with the mean radius and mass of several.
fn lump(kinds: &[Kind]) -> Kind {
    let count: f64 = kinds.iter().map(|kind| kind.count).sum();
    let mean =
        |of: fn(&Kind) -> f64| kinds.iter().map(|kind| kind.count * of(kind)).sum::<f64>() / count;
    Kind {
        count,
        diameter: mean(|kind| kind.diameter),
        mass: mean(|kind| kind.mass),
        density: 0.0,
    }
}
