//! Sorts the balls by where they are, and settles from the state and from counts how the windows until the next sorting are.

use std::sync::atomic::{AtomicU32, Ordering};

use prefetch_index::prefetch_index;

use super::pieces::{Line, NONE, Piece};
use super::{Windowed, by_region, tuning};

/// Balls whose speeds are summed up together.
const BALLS_AT_ONCE: usize = 1 << 14;

/// How many flights before its turn the memory of a flight is asked for.
const FLIGHTS_AHEAD: usize = 16;

impl Windowed {
    /// Sorts the balls along the curve through the cells, by where they are at the present, cuts the curve into regions of
    /// about as many balls each, and makes all lines from the exact flights.
    pub(super) fn sort(&mut self) {
        let share = f32::from(self.behind);
        let cell_of = |line: &Line| {
            let line = match self.numbering.piece(line.link()) {
                _ if line.link() == NONE || self.drift.is_some() => line,
                Piece::Other(kind, region, place) => &self.pieces[kind][region].lines[place],
                Piece::Flight(_) => unreachable!("a ball leaves its flight along another piece"),
            };
            let (position, velocity) = (line.position(), line.velocity());
            let position = std::array::from_fn(|axis| position[axis] + share * velocity[axis]);
            self.grid.cell_at(position) as u32
        };
        let (count, cell_count) = (self.lines.len(), self.grid.cell_count());
        let region_count = self.regions.len();
        let share = count.div_ceil(region_count);
        let mut cells = vec![0_u32; count];
        let mut censuses = vec![vec![0_u32; cell_count]; region_count];
        let chunks = self.lines.chunks(share).zip(cells.chunks_mut(share));
        let chunks = chunks.zip(&mut censuses);
        self.team.work(chunks, |((lines, cells), census)| {
            for (line, cell) in lines.iter().zip(cells) {
                *cell = cell_of(line);
                census[*cell as usize] += 1;
            }
        });
        let places = first_places(&mut censuses);
        let cut = |region: usize| {
            let balls = (count * region / region_count) as u32;
            if region == region_count {
                cell_count
            } else {
                places.partition_point(|&place| place < balls)
            }
        };
        let cuts: Vec<usize> = (0..=region_count).map(cut).collect();
        for (number, region) in self.regions.iter_mut().enumerate() {
            let (first, end) = (cuts[number], cuts[number + 1]);
            let flights = places[first] as usize..places[end] as usize;
            region.reset(number, first..end, flights);
        }
        // Each has its place; that no two have the same one the compiler cannot know.
        let balls: Vec<AtomicU32> = (0..count).map(|_| AtomicU32::new(0)).collect();
        let chunks = self.lines.chunks(share).zip(cells.chunks(share));
        let chunks = chunks.zip(&mut censuses);
        self.team.work(chunks, |((lines, cells), next_places)| {
            for (line, &cell) in lines.iter().zip(cells) {
                let place = &mut next_places[cell as usize];
                balls[*place as usize].store(line.ball(), Ordering::Relaxed);
                *place += 1;
            }
        });
        let balls: Vec<u32> = balls.into_iter().map(AtomicU32::into_inner).collect();
        drop((cells, places, censuses));
        self.tune();

        let mut lines = std::mem::take(&mut self.lines);
        let gas = self.gas(self.next_window());
        let mut fastest = vec![0.0; region_count];
        let shares = self
            .regions
            .iter()
            .zip(by_region(&mut lines, &self.regions));
        let shares = shares.zip(&mut fastest);
        self.team.work(shares, |((region, lines), fastest)| {
            let balls = &balls[region.flights.clone()];
            for (index, (line, &ball)) in lines.iter_mut().zip(balls).enumerate() {
                if let Some(&ahead) = balls.get(index + FLIGHTS_AHEAD) {
                    prefetch_index(&gas.state.trajectories, ahead as usize);
                }
                *line = gas.line(&gas.state.trajectories[ball as usize], ball);
                *fastest = line.speed().max(*fastest);
            }
        });
        if self.state.bodies.uniform().is_none() {
            let radius = |line: &Line| (gas.body(line.ball()).radius * self.grid.scale) as f32;
            self.radii = lines.iter().map(radius).collect();
        }
        self.fastest = fastest.into_iter().fold(0.0, f32::max);
        self.lines = lines;
        self.behind = false;
        self.windows_since_sort = 0;
    }

    /// Chooses the length of the windows until the next sorting, from the state and from counts alone.
    fn tune(&mut self) {
        let count = self.lines.len() as f64;
        // Sums of so many balls each: rounding must not depend on the number of threads.
        let mut squares = vec![(0.0, 0.0); self.lines.len().div_ceil(BALLS_AT_ONCE)];
        let share = squares.len().div_ceil(self.regions.len());
        let flights = self.state.trajectories.chunks(share * BALLS_AT_ONCE);
        self.team
            .work(flights.zip(squares.chunks_mut(share)), |(flights, sums)| {
                for (flights, sum) in flights.chunks(BALLS_AT_ONCE).zip(sums) {
                    *sum = flights.iter().fold((0.0, 0.0), |(sum, most), flight| {
                        let square = flight.velocity.length_squared();
                        (sum + square, square.max(most))
                    });
                }
            });
        let (sum, most) = squares
            .into_iter()
            .fold((0.0, 0.0_f64), |(sum, most), (squares, largest)| {
                (sum + squares, largest.max(most))
            });
        let (deviation, fastest) = ((sum / (3.0 * count)).sqrt(), most.sqrt());
        let width = self.grid.width().min_element();
        // A window that was cut short says little.
        if !self.too_fast {
            let (then, before) = self.last_sort;
            let (elapsed, pairs) = (self.state.now.since(then), self.counters.pair_collisions);
            if elapsed > 0.0 {
                self.rate = 2.0 * (pairs - before) as f64 / (count * elapsed);
            }
            self.last_sort = (self.state.now, pairs);
            let work = std::mem::take(&mut self.work);
            // Windows among neighbours are planned only where they pay. A gas may begin as a lattice, in which hardly anything happens
            // yet: its first windows say little.
            self.paying = self.drift.is_some()
                || self.sorts < 2
                || work.pays(&self.state, width, deviation * elapsed);
            self.sorts += 1;
        }
        let plan = tuning::Plan::new(&self.state, width, (deviation, fastest), self.rate);
        self.length = plan.length;
        self.drift = plan.drift.map(|drift| (drift * self.grid.scale) as f32);
    }
}

/// The first ball's place in each cell, and the one after the last, from how many balls of each share are in each: of these it makes
/// where the share's first is.
fn first_places(censuses: &mut [Vec<u32>]) -> Vec<u32> {
    let mut next = 0;
    let cells = 0..censuses[0].len();
    let place = |cell: usize| {
        let place = next;
        for census in censuses.iter_mut() {
            let first = next;
            next += census[cell];
            census[cell] = first;
        }
        place
    };
    let mut places: Vec<_> = cells.map(place).collect();
    places.push(next);
    places
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use crate::domain::{Boundary, Domain};
    use crate::engine::windowed::Windowed;
    use crate::state::{Body, Placement, State};

    /// In the little of it that has passed, a ball has always just collided.
    #[test]
    fn a_window_that_is_cut_short_does_not_tell_how_often_balls_collide() {
        let sites = (0..9_u32.pow(3)).map(|site| [site / 81, site / 9 % 9, site % 9]);
        let places: Vec<_> = sites.map(|site| site.map(f64::from)).collect();
        let gas = Placement {
            domain: Domain {
                boundary: Boundary::Periodic,
                ..Domain::container(DVec3::splat(5.4))
            },
            center: DVec3::ZERO,
            bodies: vec![Body {
                radius: 0.5,
                mass: 1.0,
            }],
            body_of: Vec::new(),
            velocities: places
                .iter()
                .map(|&[x, y, z]| DVec3::new((3.0 * y + z).sin(), (5.0 * z + x).sin(), x.sin()))
                .collect(),
            positions: places
                .iter()
                .map(|&place| 1.2 * DVec3::from_array(place) - 4.8)
                .collect(),
        };
        let mut engine = Windowed::with_regions(State::new(&gas), 1);
        engine.sort();
        let (drift, rate) = (engine.drift, engine.rate);
        assert!(drift.is_some());
        let soon = engine.state.now.after(1e-6 * engine.length);
        engine.state.now = soon.expect("a time");
        engine.counters.pair_collisions += 1;
        engine.too_fast = true;
        engine.sort();
        assert_eq!((engine.drift, engine.rate), (drift, rate));
        // It is not forgotten either: the next sorting tells of both.
        engine.too_fast = false;
        engine.sort();
        assert!(engine.rate > rate);
    }
}
