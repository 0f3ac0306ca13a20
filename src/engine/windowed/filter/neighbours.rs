//! Which pieces of one cell are neighbours, and which of a ball's neighbours it may touch: the questions of windows in which every
//! ball knows its neighbours.

use pulp::{Simd, WithSimd};

use super::{Filter, Hits, ReadAhead, lanes_of, pairs_that_pass, write_down};
use crate::engine::turn::SIDE;
use crate::engine::windowed::questions::{BallsTouch, Limits, Near, others};
use crate::engine::windowed::sheet::{Block, LANES, Row, Rows, Sheet};

impl Filter {
    /// Fills `sheet` with the flights of a cell and gives each pair of neighbours that are to be noted in it, the later row first;
    /// and for each whether they may touch in the window.
    ///
    /// Of all the cells in which two are listed they are noted in the lowest: the one that along each axis is the first for either
    /// of them. `firsts` are the least coordinates of those for which the cell is the first one.
    pub fn neighbours(
        &mut self,
        sheet: &mut Sheet,
        flights: impl Rows,
        firsts: [f32; 3],
        ahead: ReadAhead,
    ) -> (&[(u32, u32)], &[bool]) {
        let count = self.machine.dispatch(FindNeighbours {
            sheet,
            flights,
            firsts,
            ahead,
            limits: &self.limits,
            hits: &mut self.hits,
            pairs: &mut self.pairs,
            touching: &mut self.touching,
        });
        (&self.pairs[..count], &self.touching[..count])
    }

    /// Which of some neighbours a ball may touch in the window, whose flight begins in it where it has met a `partner`: a bit for each.
    #[inline]
    pub fn touching(&self, row: &Row, partner: u32, others: &[Row; LANES]) -> u64 {
        self.machine.dispatch(Touching {
            row,
            partner,
            others,
            limits: &self.limits,
        })
    }
}

struct FindNeighbours<'a, P> {
    sheet: &'a mut Sheet,
    flights: P,
    firsts: [f32; 3],
    ahead: ReadAhead<'a>,
    limits: &'a Limits,
    hits: &'a mut Vec<Hits>,
    pairs: &'a mut Vec<(u32, u32)>,
    touching: &'a mut Vec<bool>,
}

impl<P: Rows> WithSimd for FindNeighbours<'_, P> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let Self {
            sheet,
            flights,
            firsts,
            ahead,
            limits,
            hits,
            pairs,
            touching,
        } = self;
        sheet.fill(simd, &flights, flights.entries());
        sheet.mark(simd, firsts);
        let test = Near::new(simd, limits);
        let (found, rotated) = pairs_that_pass(simd, sheet, hits, &test, ahead);
        let count = write_down(&hits[..found], rotated, pairs);
        if touching.len() < count + LANES {
            touching.resize(2 * count + LANES, false);
        }
        let rows = sheet.rows();
        let test = BallsTouch::new(simd, limits);
        let (mut ones, mut others) = (Block::default(), Block::default());
        for first in (0..count).step_by(LANES) {
            let some = &pairs[first..count.next_multiple_of(SIDE).min(first + LANES)];
            for (part, pairs) in some.as_chunks::<SIDE>().0.iter().enumerate() {
                ones.turn(simd, part, &pairs.map(|(row, _)| rows[row as usize]));
                others.turn(simd, part, &pairs.map(|(_, row)| rows[row as usize]));
            }
            let mut touch = 0;
            for vector in 0..some.len().div_ceil(S::F32_LANES) {
                let [one, other] = [&ones, &others].map(|block| block.columns(simd, vector));
                touch |= lanes_of(simd, test.at_first(simd, one, other)) << (vector * S::F32_LANES);
            }
            for (lane, touching) in touching[first..][..LANES].iter_mut().enumerate() {
                *touching = touch >> lane & 1 == 1;
            }
        }
        count
    }
}

struct Touching<'a> {
    row: &'a Row,
    partner: u32,
    others: &'a [Row; LANES],
    limits: &'a Limits,
}

impl WithSimd for Touching<'_> {
    type Output = u64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> u64 {
        let test = BallsTouch::<S>::new(simd, self.limits);
        let mut block = Block::default();
        for (part, rows) in self.others.as_chunks::<SIDE>().0.iter().enumerate() {
            block.turn(simd, part, rows);
        }
        let mut touching = 0;
        for vector in 0..LANES / S::F32_LANES {
            let columns = block.columns(simd, vector);
            let others = others(simd, self.row, self.partner, columns);
            let may_meet = test.passes(simd, self.row, columns);
            let lanes = lanes_of(simd, simd.and_m32s(others, may_meet));
            touching |= lanes << (vector * S::F32_LANES);
        }
        touching
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use pulp::{Scalar, Scalar128b, Scalar256b, Scalar512b};
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use crate::engine::windowed::grid::Entry;
    use crate::engine::windowed::pieces::NONE;
    use crate::engine::windowed::questions::Margins;

    struct Flights {
        entries: Vec<Entry>,
        rows: Vec<Row>,
    }

    impl Rows for &Flights {
        fn entries(&self) -> &[Entry] {
            &self.entries
        }

        fn row(&self, entry: Entry) -> Row {
            self.rows[entry as usize]
        }

        fn partner(&self, _: Entry) -> u32 {
            NONE
        }
    }

    fn neighbours(
        simd: impl Simd,
        flights: &Flights,
        limits: &Limits,
        firsts: [f32; 3],
    ) -> Vec<(u32, u32, bool)> {
        let (mut pairs, mut touching) = (Vec::new(), Vec::new());
        let count = FindNeighbours {
            sheet: &mut Sheet::default(),
            flights,
            firsts,
            ahead: ReadAhead::default(),
            limits,
            hits: &mut Vec::new(),
            pairs: &mut pairs,
            touching: &mut touching,
        }
        .with_simd(simd);
        let found = pairs[..count].iter().zip(&touching);
        let mut found: Vec<_> = found.map(|(&(a, b), &may)| (a, b, may)).collect();
        found.sort_unstable();
        found
    }

    #[test]
    fn vectors_of_every_width_find_the_same_neighbours_and_whom_they_may_touch() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(17);
        let limits = Limits::new(Margins {
            contact: 0.2,
            least_contact: 0.2,
            edges: [1.0; 3],
            fastest: 0.1,
            ..Margins::default()
        });
        let mut vector = |size: f64| -> DVec3 {
            let drawn: [f64; 3] = std::array::from_fn(|_| random.random_range(-size..size));
            drawn.into()
        };
        let (mut found_in_all, mut touch_in_all) = (0, 0);
        for count in [0, 1, 7, 16, 17, 60, 120] {
            let entries: Vec<Entry> = (0..count).collect();
            let row = |&ball: &Entry| Row::new(vector(0.5), vector(0.05), ball);
            let rows: Vec<Row> = entries.iter().map(row).collect();
            let flights = Flights { entries, rows };
            let firsts = [0.1, -0.2, f32::NEG_INFINITY];
            let found = neighbours(Scalar::new(), &flights, &limits, firsts);
            let others = [
                neighbours(Scalar128b, &flights, &limits, firsts),
                neighbours(Scalar256b, &flights, &limits, firsts),
                neighbours(Scalar512b, &flights, &limits, firsts),
            ];
            assert!(others.iter().all(|other| *other == found));

            let place =
                |row: u32| DVec3::from(flights.rows[row as usize].position().map(f64::from));
            let pairs = (0..count).flat_map(|a| (0..a).map(move |b| (a, b)));
            let expected = pairs.filter(|&(a, b)| {
                let (one, two) = (place(a), place(b));
                let first = |axis: usize| one[axis].max(two[axis]) >= f64::from(firsts[axis]);
                one.distance(two) < 0.4 && (0..3).all(first)
            });
            assert!(expected.eq(found.iter().map(|&(a, b, _)| (a, b))));
            for &(a, b, touch) in &found {
                // Where they are closest in the window.
                let velocity = |row: u32| -> DVec3 {
                    flights.rows[row as usize].velocity().map(f64::from).into()
                };
                let (apart, relative) = (place(a) - place(b), velocity(a) - velocity(b));
                let approaching = apart.dot(relative) < 0.0;
                let when = (-apart.dot(relative) / relative.length_squared()).clamp(0.0, 1.0);
                let closest = (apart + when * relative).length();
                assert_eq!(touch, approaching && closest < 0.2, "{closest}");
                touch_in_all += u32::from(touch);
            }
            found_in_all += found.len();

            let mut rows = [Row::NOBODY; LANES];
            for (row, &other) in rows.iter_mut().zip(&flights.rows) {
                *row = other;
            }
            for (row, partner) in flights.rows.iter().zip(1..).take(20) {
                let row = row.beginning(0.5);
                let touching = || Touching {
                    row: &row,
                    partner,
                    others: &rows,
                    limits: &limits,
                };
                let one = touching().with_simd(Scalar::new());
                assert_eq!(touching().with_simd(Scalar256b), one);
                assert_eq!(touching().with_simd(Scalar512b), one);
            }
        }
        assert!(found_in_all > 100 && touch_in_all > 20);
    }
}
