//! All balls, shared out among threads: each has the bins of its own stretch of cells, and bins for balls that it sends to
//! others'.

use std::ops::Range;

use super::bins::{Bins, Record, Row};

/// By what part of its fair share a thread may have more.
const UNEVEN: u64 = 16;

/// The balls.
#[derive(Clone, Debug)]
pub struct Stock {
    /// For each thread, the balls in its own cells that it has put there.
    pub own: Vec<Bins>,
    /// For each thread, the balls that it has put into others' cells.
    pub sent: Vec<Bins>,
    /// Bins for the balls that will be sent.
    pub spare: Vec<Bins>,
    /// The first plane of each thread, and the number of planes.
    cuts: Vec<usize>,
    per_plane: usize,
}

impl Stock {
    /// No balls, but room for so many.
    pub fn new(planes: usize, per_plane: usize, threads: usize, balls: usize) -> Self {
        let cells = planes * per_plane;
        let sent = vec![Bins::new(cells, 0); threads];
        Self {
            own: vec![Bins::new(cells, balls / threads); threads],
            spare: sent.clone(),
            sent,
            cuts: cuts(&vec![1; planes], threads),
            per_plane,
        }
    }

    /// Takes all balls out.
    pub fn clear(&mut self) {
        let all = self.own.iter_mut().chain(&mut self.sent);
        all.for_each(Bins::clear);
    }

    /// Each thread's planes.
    pub fn planes(&self) -> impl Iterator<Item = Range<usize>> {
        self.cuts.windows(2).map(|cut| cut[0]..cut[1])
    }

    /// Puts a ball into the bin of a cell.
    pub fn put(&mut self, cell: usize, row: Row) {
        let owner = self.owner(cell);
        self.own[owner].writer(1).put(cell, row);
    }

    fn owner(&self, cell: usize) -> usize {
        self.cuts
            .partition_point(|&cut| cut <= cell / self.per_plane)
            - 1
    }

    /// The balls of a cell, in stretches: in the order of the cells they come from.
    pub fn of(&self, cell: usize) -> impl Iterator<Item = &[Row]> {
        let owner = self.owner(cell);
        let (lower, upper) = self.sent.split_at(owner);
        let bins = lower.iter().chain([&self.own[owner]]).chain(&upper[1..]);
        bins.flat_map(move |bins| bins.of(cell))
    }

    /// Every ball, to be changed in place.
    pub fn for_each_mut(&mut self, mut change: impl FnMut(&mut Record)) {
        for bins in self.own.iter_mut().chain(&mut self.sent) {
            bins.for_each_mut(&mut change);
        }
    }

    /// Cuts the planes anew, if some thread has many more balls than others, given those of each plane.
    pub fn share_out(&mut self, balls: &[u64]) {
        let threads = self.own.len();
        let all: u64 = balls.iter().sum();
        let shares = self
            .planes()
            .map(|planes| balls[planes].iter().sum::<u64>());
        let most = shares.max().unwrap_or(0) * threads as u64;
        if most <= all + all / UNEVEN {
            return;
        }
        let cuts = cuts(balls, threads);
        if cuts == self.cuts {
            return;
        }
        let cells = balls.len() * self.per_plane;
        let all: Vec<Vec<Row>> = (0..cells)
            .map(|cell| self.of(cell).flatten().copied().collect())
            .collect();
        self.clear();
        self.cuts = cuts;
        for (cell, balls) in all.into_iter().enumerate() {
            for row in balls {
                self.put(cell, row);
            }
        }
    }
}

/// The first plane of each thread, and the number of planes, so that each gets about as many balls; none is without a plane.
fn cuts(balls: &[u64], threads: usize) -> Vec<usize> {
    let all: u64 = balls.iter().sum();
    let (mut cuts, mut so_far) = (vec![0], 0);
    for (plane, balls_here) in balls.iter().enumerate() {
        so_far += balls_here;
        let left = balls.len() - plane - 1;
        let full = so_far * threads as u64 >= cuts.len() as u64 * all;
        if (full || left <= threads - cuts.len()) && cuts.len() < threads && left > 0 {
            cuts.push(plane + 1);
        }
    }
    cuts.push(balls.len());
    cuts
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn each_thread_gets_about_as_many_balls_and_at_least_a_plane() {
        assert_eq!(cuts(&[1; 6], 3), [0, 2, 4, 6]);
        assert_eq!(cuts(&[100, 1, 1, 1], 3), [0, 1, 2, 4]);
        assert_eq!(cuts(&[1, 1, 1, 100], 3), [0, 2, 3, 4]);
        assert_eq!(cuts(&[0, 0, 0], 3), [0, 1, 2, 3]);
    }

    #[test]
    fn sharing_out_anew_keeps_every_cell_in_order() {
        let mut stock = Stock::new(4, 2, 2, 100);
        let row = |ball: usize| Row::from(Record::new(ball, DVec3::ZERO, DVec3::ZERO));
        for ball in 0..100 {
            stock.put(ball % 8, row(ball));
        }
        // What the other thread sends comes before or after what its owner has put there.
        stock.sent[0].writer(1).put(4, row(100));
        stock.sent[1].writer(1).put(1, row(101));
        let balls = |stock: &Stock, cell| -> Vec<u32> {
            let rows = stock.of(cell).flatten();
            rows.map(|&row| Record::from(row).ball).collect()
        };
        assert_eq!(balls(&stock, 4)[0], 100);
        assert_eq!(balls(&stock, 1).last(), Some(&101));
        let before: Vec<_> = (0..8).map(|cell| balls(&stock, cell)).collect();
        stock.share_out(&[2, 2, 2, 90]);
        let planes: Vec<_> = stock.planes().collect();
        assert_eq!(planes, [0..3, 3..4]);
        let after: Vec<_> = (0..8).map(|cell| balls(&stock, cell)).collect();
        assert_eq!(before, after);
    }
}
