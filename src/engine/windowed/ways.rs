//! Straight ways of pieces that are found one by one, and what they pass: found for many at a time.

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use super::grid::NOWHERE;
use super::passages::Passages;
use super::paths::Gas;
use super::pieces::{Id, Line};
use super::scratch::Scratch;
use super::touch::{BLOCK, Block, Bounds, PARTS, touch};
use crate::engine::turn::SIDE;

/// Longest way, with the ball's extent, that surely reaches into no more cells than are told apart, in their widths.
const LONGEST: f64 = 1.99;

/// Ways whose passages are still to be found.
#[derive(Clone, Debug, Default)]
pub struct Ways {
    /// Where each begins, its way in place of the velocity, and its piece in place of the ball.
    lines: Scratch<Line>,
    /// The balls' radii in grid lengths.
    radii: Scratch<f32>,
    passages: Passages,
    /// What longer ways pass, and the pieces.
    of_longer: Vec<(u32, Id)>,
}

impl Ways {
    /// Adds the way of a piece of a ball of this radius, inside the box but for rounding.
    #[inline(always)]
    pub fn add(&mut self, gas: &Gas, id: Id, ends: [DVec3; 2], radius: f64) {
        // So no way reaches beyond the layer of places around the cells.
        let half_size = gas.state.domain.half_size;
        let [from, to] = ends.map(|end| end.clamp(-half_size, half_size));
        let way = to - from;
        let extent = way.abs() + 2.0 * radius;
        if extent.cmple(LONGEST * gas.grid.width()).all() {
            let line = Line::new(gas.grid.to_grid(from), way * gas.grid.scale, id);
            self.lines.push(line);
            self.radii.push((radius * gas.grid.scale) as f32);
        } else {
            let pass = |target| self.of_longer.push((target, id));
            gas.grid.for_each_on_way(from, to, radius, pass);
        }
    }

    /// Visits all that they pass, as the grid's targets, with the piece that does; and forgets them.
    pub fn visit(&mut self, gas: &Gas, mut visit: impl FnMut(u32, Id)) {
        let machine = Arch::new();
        let bounds = Bounds::new(gas);
        let ways = self.lines.chunks(BLOCK).zip(self.radii.chunks(BLOCK));
        for (lines, radii) in ways {
            machine.dispatch(Pass {
                gas,
                bounds: &bounds,
                lines,
                radii,
                passages: &mut self.passages,
            });
            let flights = self.passages.flights();
            for (&place, &flight) in self.passages.places().iter().zip(flights) {
                let target = gas.grid.targets[place as usize];
                if target != NOWHERE {
                    visit(target, lines[flight as usize].ball());
                }
            }
        }
        self.lines.empty();
        self.radii.empty();
        for (target, id) in self.of_longer.drain(..) {
            visit(target, id);
        }
    }
}

/// Finds the passages of a block of ways.
struct Pass<'a> {
    gas: &'a Gas<'a>,
    bounds: &'a Bounds,
    lines: &'a [Line],
    radii: &'a [f32],
    passages: &'a mut Passages,
}

impl WithSimd for Pass<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut block = Block::new(self.bounds.radius);
        let (parts, rest) = self.lines.as_chunks::<SIDE>();
        let mut padded = [Line([0.0; SIDE]); SIDE];
        padded[..rest.len()].copy_from_slice(rest);
        for (part, lines) in parts.iter().chain([&padded]).enumerate().take(PARTS) {
            block.read(simd, part, lines);
        }
        block.radius[..self.radii.len()].copy_from_slice(self.radii);
        let count = self.lines.len();
        touch(simd, &mut block, self.bounds, 0.0, count);
        let ids = 0..count as Id;
        self.passages
            .find(simd, &block, self.gas.offsets, ids, |_, _| false);
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use crate::domain::{Boundary, Domain};
    use crate::engine::windowed::Windowed;
    use crate::state::{Body, Placement, State};

    /// Balls on a lattice that moves.
    fn crystal(boundary: Boundary) -> Placement {
        let sites = (0..12_i32.pow(3)).map(|site| [site / 144, site / 12 % 12, site % 12]);
        let positions: Vec<DVec3> = sites
            .map(|site| DVec3::from_array(site.map(|step| 1.5 * f64::from(step) - 8.25)))
            .collect();
        Placement {
            domain: Domain {
                boundary,
                ..Domain::container(DVec3::splat(9.0))
            },
            center: DVec3::ZERO,
            bodies: vec![Body {
                radius: 0.5,
                mass: 1.0,
            }],
            body_of: Vec::new(),
            velocities: vec![DVec3::ONE; positions.len()],
            positions,
        }
    }

    #[test]
    fn ways_pass_the_cells_that_they_reach_into_and_hardly_any_others() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
        for boundary in [Boundary::Container, Boundary::Periodic] {
            let mut engine = Windowed::with_regions(State::new(&crystal(boundary)), 1);
            engine.drift = None;
            let gas = engine.gas(engine.next_window());
            let radius = gas.body(0).radius;
            let limit = gas.state.domain.half_size
                - match boundary {
                    Boundary::Container => radius,
                    _ => 0.0,
                };
            let mut vector = |size: DVec3| {
                let drawn: [f64; 3] = std::array::from_fn(|_| random.random_range(-1.0..1.0));
                DVec3::from_array(drawn) * size
            };
            let mut ends = Vec::new();
            for size in [0.5, 1.0, 3.0] {
                // From and to inside, some of them at a wall.
                ends.extend((0..300).map(|_| {
                    let from = vector(1.2 * limit).clamp(-limit, limit);
                    let to = from + vector(size * gas.grid.width());
                    [from, to.clamp(-limit, limit)]
                }));
            }
            let mut ways = Ways::default();
            for (&ends, id) in ends.iter().zip(0..) {
                ways.add(&gas, id, ends, radius);
            }
            assert!(!ways.of_longer.is_empty() && ways.lines.len() > 600);
            let mut passed = vec![Vec::new(); ends.len()];
            ways.visit(&gas, |target, id| passed[id as usize].push(target));
            for ([from, to], mut passed) in ends.into_iter().zip(passed) {
                passed.sort_unstable();
                let on_way = |radius: f64| {
                    let mut targets = Vec::new();
                    let visit = |target| targets.push(target);
                    gas.grid.for_each_on_way(from, to, radius, visit);
                    targets.sort_unstable();
                    targets
                };
                let wider = on_way(radius + 2.0 * gas.slack / gas.grid.scale);
                assert!(on_way(radius).iter().all(|target| passed.contains(target)));
                assert!(passed.iter().all(|target| wider.contains(target)));
                assert!(passed.is_sorted_by(|one, next| one < next));
            }
            // All is forgotten.
            ways.visit(&gas, |_, _| unreachable!());
        }
    }
}
