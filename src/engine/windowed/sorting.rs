//! Sorts the balls by where they are, and settles from the state and from counts how the windows until the next sorting are.

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
        let places = first_places(&censuses);
        drop(censuses);
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
            region.reset(number, first..end, &places[first..=end]);
        }
        let mut balls = vec![0_u32; count];
        let shares = self
            .regions
            .iter()
            .zip(by_region(&mut balls, &self.regions));
        self.team.work(shares, |(region, balls)| {
            region.sort_balls(&self.lines, &cells, balls);
        });
        drop((cells, places));
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
        let (then, before) = self.last_sort;
        let elapsed = self.state.now.since(then);
        let rate = if elapsed > 0.0 {
            2.0 * (self.counters.pair_collisions - before) as f64 / (count * elapsed)
        } else {
            0.0
        };
        let width = self.grid.width().min_element();
        // A window that was cut short says little.
        if !self.too_fast {
            self.last_sort = (self.state.now, self.counters.pair_collisions);
            let work = std::mem::take(&mut self.work);
            // Windows among neighbours are planned only where they pay. A gas may begin as a lattice, in which hardly anything happens
            // yet: its first windows say little.
            self.paying = self.drift.is_some()
                || self.sorts < 2
                || work.pays(&self.state, width, deviation * elapsed);
            self.sorts += 1;
        }
        let plan = tuning::Plan::new(&self.state, width, (deviation, fastest), rate);
        self.length = plan.length;
        self.drift = plan.drift.map(|drift| (drift * self.grid.scale) as f32);
    }
}

/// The first ball's place in each cell, and the one after the last, from how many balls of each share are in each.
fn first_places(censuses: &[Vec<u32>]) -> Vec<u32> {
    let mut next = 0;
    let cells = 0..censuses[0].len();
    let place = |cell: usize| {
        let place = next;
        next += censuses.iter().map(|census| census[cell]).sum::<u32>();
        place
    };
    let mut places: Vec<_> = cells.map(place).collect();
    places.push(next);
    places
}
