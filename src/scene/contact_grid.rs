//! Finds balls that are near one another, for scenes whose radii may differ by any factor.
//!
//! Balls are kept in levels of like size (diameters within a factor of two), each a hashed grid whose cells are as wide as
//! the level's largest ball, or wider where there is room between the balls. A cell holds few balls that do not overlap, so a query
//! costs a constant; a query with a ball far wider than a level's cells looks at all balls of that level instead of at countless
//! cells. Spatial hashing: Teschner et
//! al., Optimized Spatial Hashing for Collision Detection of Deformable Objects, VMV 2003.

use std::collections::BTreeMap;

use glam::DVec3;

/// End of a chain.
const NONE: u32 = u32::MAX;

/// Width of the cells in mean spacings of a level's balls, where those are far apart: flat around.
const SPACINGS_PER_CELL: f64 = 0.7;

/// The level of the balls without size.
const POINTS: i32 = i32::MIN;

/// Balls by place and size.
pub(super) struct ContactGrid {
    levels: BTreeMap<i32, Level>,
}

struct Level {
    /// No ball is wider.
    widest: f64,
    cell_width: f64,
    /// First ball of each bucket; a power of two in length.
    first: Vec<u32>,
    /// Balls in the order of insertion, and the next one of the same bucket.
    balls: Vec<(u32, DVec3, f64)>,
    next: Vec<u32>,
}

impl ContactGrid {
    /// An empty grid with room for balls of these radii, in about this volume.
    pub(super) fn new(radii: impl Iterator<Item = f64>, volume: f64) -> Self {
        let mut counts: BTreeMap<i32, usize> = BTreeMap::new();
        for radius in radii {
            *counts.entry(level_of(radius)).or_default() += 1;
        }
        // Points are looked for from balls only, so their cells are as wide as those of the smallest balls.
        let smallest = counts.keys().copied().find(|&exponent| exponent != POINTS);
        let widest = |exponent: i32| match smallest {
            Some(smallest) => widest(exponent.max(smallest)),
            None => 1.0, // nobody looks for them
        };
        let level = |(exponent, count): (i32, usize)| {
            let first = vec![NONE; count.next_power_of_two()];
            let spacing = (volume / count as f64).cbrt();
            (
                exponent,
                Level {
                    widest: widest(exponent),
                    cell_width: widest(exponent).max(SPACINGS_PER_CELL * spacing),
                    first,
                    balls: Vec::new(),
                    next: Vec::new(),
                },
            )
        };
        Self {
            levels: counts.into_iter().map(level).collect(),
        }
    }

    /// Adds a ball whose radius was announced to [`ContactGrid::new`].
    pub(super) fn insert(&mut self, index: u32, position: DVec3, radius: f64) {
        let level = self
            .levels
            .get_mut(&level_of(radius))
            .expect("every radius was announced");
        let [x, y, z] = cell_of(position, level.cell_width);
        let bucket = bucket_of(x, y, z, level.first.len());
        level.next.push(level.first[bucket]);
        level.first[bucket] = level.balls.len() as u32;
        level.balls.push((index, position, radius));
    }

    /// Whether a ball would touch none.
    pub(super) fn is_free(&self, position: DVec3, radius: f64) -> bool {
        let mut free = true;
        self.near(position, radius, |_, _, _| {
            free = false;
            false
        });
        free
    }

    /// Calls `visit(index, distance, contact distance)` for every ball that may touch the given one; stops at `false`.
    pub(super) fn near(
        &self,
        position: DVec3,
        radius: f64,
        mut visit: impl FnMut(u32, f64, f64) -> bool,
    ) {
        let mut look = |&(index, other, other_radius): &(u32, DVec3, f64)| {
            let contact = radius + other_radius;
            let distance = (position - other).length();
            distance >= contact || visit(index, distance, contact)
        };
        for (exponent, level) in &self.levels {
            if *exponent == POINTS && radius == 0.0 {
                continue; // two points never touch
            }
            let reach = DVec3::splat(radius + 0.5 * level.widest);
            let low = cell_of(position - reach, level.cell_width);
            let high = cell_of(position + reach, level.cell_width);
            let cells: f64 = (0..3)
                .map(|axis| (high[axis] - low[axis] + 1) as f64)
                .product();
            if cells > level.balls.len() as f64 {
                if !level.balls.iter().all(&mut look) {
                    return;
                }
                continue;
            }
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    for z in low[2]..=high[2] {
                        let mut slot = level.first[bucket_of(x, y, z, level.first.len())];
                        while slot != NONE {
                            let ball = &level.balls[slot as usize];
                            // Other cells may share the bucket; a ball of theirs must not be seen twice.
                            if cell_of(ball.1, level.cell_width) == [x, y, z] && !look(ball) {
                                return;
                            }
                            slot = level.next[slot as usize];
                        }
                    }
                }
            }
        }
    }
}

/// The exponent of the power of two at or above the radius.
fn level_of(radius: f64) -> i32 {
    radius.log2().ceil() as i32 // the logarithm of zero is cut to the smallest number
}

/// Diameter of the widest ball of a level, and a little more because a logarithm rounds.
fn widest(exponent: i32) -> f64 {
    2.001 * 2f64.powi(exponent)
}

fn cell_of(position: DVec3, cell_width: f64) -> [i64; 3] {
    (position / cell_width).to_array().map(|place| {
        // Rounded down without a call.
        let cell = place as i64;
        cell - i64::from(cell as f64 > place)
    })
}

fn bucket_of(x: i64, y: i64, z: i64, bucket_count: usize) -> usize {
    // Odd constants spread rows over the buckets; z stays in order, so a row of cells is a row of memory.
    let row = x.wrapping_mul(0x1E37_79B9_7F4A_7C15_i64) ^ y.wrapping_mul(0x5851_F42D_4C95_7F2D_i64);
    let mixed = row ^ (row >> 29);
    mixed.wrapping_add(z) as usize & (bucket_count - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(balls: &[(DVec3, f64)]) -> Vec<(u32, u32)> {
        let mut grid = ContactGrid::new(balls.iter().map(|ball| ball.1), 1000.0);
        let mut found = Vec::new();
        for (index, &(position, radius)) in balls.iter().enumerate() {
            grid.near(position, radius, |other, _, _| {
                found.push((other, index as u32));
                true
            });
            grid.insert(index as u32, position, radius);
        }
        found.sort_unstable();
        found
    }

    #[test]
    fn it_finds_the_pairs_that_all_pairs_finds() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(7);
        for spread in [1.0, 3.0, 30.0] {
            let balls: Vec<(DVec3, f64)> = (0..300)
                .map(|_| {
                    let position = DVec3::from_array(random.random::<[f64; 3]>()) * 10.0 - 5.0;
                    (position, 0.3 * f64::powf(spread, random.random::<f64>()))
                })
                .collect();
            let mut expected = Vec::new();
            for j in 0..balls.len() {
                for i in 0..j {
                    if (balls[i].0 - balls[j].0).length() < balls[i].1 + balls[j].1 {
                        expected.push((i as u32, j as u32));
                    }
                }
            }
            expected.sort_unstable();
            assert!(expected.len() > 10);
            assert_eq!(
                pairs(&balls),
                expected,
                "radii up to {spread} times the smallest"
            );
        }
    }

    #[test]
    fn a_giant_among_dust_is_found_without_visiting_countless_cells() {
        let dust = (0..100).map(|i| (DVec3::new(f64::from(i), 0.0, 0.0), 1e-6));
        let balls: Vec<(DVec3, f64)> = dust.chain([(DVec3::new(50.0, 1e4, 0.0), 1e4)]).collect();
        assert!(pairs(&balls).contains(&(50, 100)));
    }
}
