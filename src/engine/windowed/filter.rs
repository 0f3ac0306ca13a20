//! Which pieces of one cell can meet at all: a conservative test in f32, many pairs at a time.
//!
//! The filter never rejects a pair that can come about and that the exact prediction ([`crate::collision::pair_time`]) accepts; it
//! lets some through that the exact test then rejects, so how wide the machine's vectors are changes the cost and never a collision.
//! Two pieces cannot both come about if one would be inside the other when the later one begins, or if one has ended where the
//! other begins. The margins are derived from the rounding of f32 at the largest coordinates and velocities the filter sees.
//!
//! All is in grid lengths and windows: the window lasts from time 0 to time 1.

mod hits;
mod neighbours;
mod read_ahead;
mod sift;

use pulp::{Arch, Simd, WithSimd, bytemuck};

use super::pieces::NONE;
use super::questions::{BallsTouch, Limits, LinesTouch, Margins, Test, WithinReach, others};
use super::scratch::Scratch;
use super::sheet::{Columns, LANES, Rows, Sheet};
#[cfg(target_arch = "x86_64")]
use crate::engine::turn::as_v3;
use hits::{Hits, ROWS_AT_ONCE, before, room_for, write_down};
pub use read_ahead::ReadAhead;
use sift::Doubt;

/// The filter.
#[derive(Clone, Debug)]
pub struct Filter {
    machine: Arch,
    hits: Vec<Hits>,
    pairs: Vec<(u32, u32)>,
    touching: Vec<bool>,
    doubts: Scratch<Doubt>,
    margins: Margins,
    limits: Limits,
}

impl Default for Filter {
    fn default() -> Self {
        Self {
            machine: Arch::new(),
            hits: Vec::new(),
            pairs: Vec::new(),
            touching: Vec::new(),
            doubts: Scratch::default(),
            margins: Margins::default(),
            limits: Limits::default(),
        }
    }
}

impl Filter {
    /// Begins a window.
    pub fn begin_window(&mut self, margins: Margins) {
        self.margins = margins;
        self.limits = Limits::new(margins);
    }

    /// Allows for a piece as fast as this.
    #[inline]
    pub fn allow(&mut self, speed: f32) {
        if speed > self.margins.fastest {
            self.begin_window(Margins {
                fastest: speed,
                position: self.margins.position + f64::from(f32::EPSILON * speed),
                ..self.margins
            });
        }
    }

    /// Largest speed that it allows for.
    pub fn fastest(&self) -> f32 {
        self.margins.fastest
    }

    /// Puts on `sheet` those pieces of a cell that are not on it yet, and asks of each pair of a piece from row `first` on and a
    /// piece before it whether they may meet in the window: in doubt it is added to those that [`Self::sift`] asks more closely.
    /// The cell comes with its middle.
    pub fn find(
        &mut self,
        sheet: &mut Sheet,
        pieces: impl Rows,
        first: usize,
        (cell, middle): (u32, [f32; 3]),
        ahead: ReadAhead,
    ) {
        self.machine.dispatch(Find {
            sheet,
            pieces,
            first,
            ahead,
            cell,
            middle,
            limits: &self.limits,
            hits: &mut self.hits,
            pairs: &mut self.pairs,
            doubts: &mut self.doubts,
        });
    }
}

struct Find<'a, P> {
    sheet: &'a mut Sheet,
    pieces: P,
    first: usize,
    ahead: ReadAhead<'a>,
    cell: u32,
    middle: [f32; 3],
    limits: &'a Limits,
    hits: &'a mut Vec<Hits>,
    pairs: &'a mut Vec<(u32, u32)>,
    doubts: &'a mut Vec<Doubt>,
}

impl<P: Rows> WithSimd for Find<'_, P> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            sheet,
            pieces,
            first,
            ahead,
            cell,
            middle,
            limits,
            hits,
            pairs,
            doubts,
        } = self;
        let entries = pieces.entries();
        let (found, rotated) = if first > 0 {
            if sheet.rows().is_empty() {
                sheet.fill(simd, &pieces, &entries[..first]);
            }
            for &entry in &entries[first..] {
                sheet.push(pieces.row(entry));
            }
            let found = few_pairs_that_pass(simd, sheet, &pieces, first, (hits, limits));
            (found, 0)
        } else {
            sheet.fill(simd, &pieces, entries);
            if limits.by_distance {
                let test = WithinReach::<S> {
                    reach_squared: simd.splat_f32s(limits.reach_squared),
                    least_approach: simd.splat_f32s(-limits.receding),
                };
                pairs_that_pass(simd, sheet, hits, &test, ahead)
            } else {
                let test = LinesTouch::<S>(simd.splat_f32s(-limits.contact_squared));
                pairs_that_pass(simd, sheet, hits, &test, ahead)
            }
        };
        let count = write_down(&hits[..found], rotated, pairs);
        let rows = sheet.rows();
        doubts.extend(pairs[..count].iter().map(|&(row, other)| Doubt {
            rows: [row, other].map(|row| rows[row as usize]),
            entries: [row, other].map(|row| entries[row as usize]),
            cell,
            middle,
        }));
    }
}

/// Fewest rows of a block that are worth being compared with the block's columns all at once.
const ROWS_TO_ROTATE: usize = LANES / 2 + 2;

/// The lanes of the last rotations that are asked for: half a turn brings each pair together twice.
const LAST_LANES: u64 = u64::MAX >> (LANES / 2);

/// Writes down the pairs of rows that pass a test; gives how many hits that took, and how many of them, which come first, are of a
/// block's columns and the same ones rotated by as much as the hits' row says. Meanwhile it asks for the memory of the lines that are
/// needed next.
///
/// Free of branches that depend on the pieces: hits are written down by advancing past them. Where the next ones are written is
/// looked up before the rows are read, not in between: so a row's numbers go from memory into all lanes at once.
#[inline(always)]
fn pairs_that_pass<S: Simd>(
    simd: S,
    sheet: &Sheet,
    hits: &mut Vec<Hits>,
    test: &impl Test<S>,
    mut ahead: ReadAhead,
) -> (usize, usize) {
    let rows = sheet.rows();
    let lanes = S::F32_LANES;
    let hits = room_for(hits, rows.len() * rows.len().div_ceil(lanes));
    let mut found = 0;
    // Where vectors are as long as blocks, half as many questions do for the pairs within a block.
    let blocks_to_rotate = if const { S::F32_LANES == LANES } {
        (rows.len() + LANES - ROWS_TO_ROTATE) / LANES
    } else {
        0
    };
    for (number, block) in sheet.blocks()[..blocks_to_rotate].iter().enumerate() {
        let columns = block.columns(simd, 0);
        for first in (1..=LANES / 2).step_by(ROWS_AT_ONCE) {
            ahead.read_some();
            let next = &mut hits[found];
            let mut lanes = 0;
            for place in 0..ROWS_AT_ONCE {
                let rotated = columns.rotated(simd, first + place);
                lanes |= lanes_of(simd, test.passes(simd, rotated, columns)) << (place * LANES);
            }
            if first + ROWS_AT_ONCE > LANES / 2 {
                lanes &= LAST_LANES;
            }
            *next = Hits::new(first, number * LANES, lanes);
            found += usize::from(lanes != 0);
        }
    }
    let rotated = found;
    for (number, block) in sheet.blocks().iter().enumerate() {
        for vector in 0..LANES / lanes {
            let column = number * LANES + vector * lanes;
            let mut row = if number < blocks_to_rotate {
                column + lanes
            } else {
                column + 1
            };
            let Some(rows) = rows.get(row..) else { break };
            let columns = block.columns(simd, vector);
            let (groups, rest) = rows.as_chunks::<ROWS_AT_ONCE>();
            for group in groups {
                ahead.read_some();
                let next = &mut hits[found];
                let mut lanes = 0;
                for (place, row) in group.iter().enumerate() {
                    let row = Columns::all_like(simd, row);
                    lanes |= lanes_of(simd, test.passes(simd, row, columns)) << (place * LANES);
                }
                lanes &= before(row, column);
                *next = Hits::new(row, column, lanes);
                found += usize::from(lanes != 0);
                row += ROWS_AT_ONCE;
            }
            for one in rest {
                let next = &mut hits[found];
                let one = Columns::all_like(simd, one);
                let lanes = lanes_of(simd, test.passes(simd, one, columns));
                let lanes = lanes & before(row, column);
                *next = Hits::new(row, column, lanes);
                found += usize::from(lanes != 0);
                row += 1;
            }
        }
    }
    ahead.read_rest();
    (found, rotated)
}

/// The same for rows from the first on, which are few and mostly begin at collisions.
#[inline(always)]
fn few_pairs_that_pass<S: Simd>(
    simd: S,
    sheet: &Sheet,
    pieces: &impl Rows,
    first: usize,
    (hits, limits): (&mut Vec<Hits>, &Limits),
) -> usize {
    let lanes = S::F32_LANES;
    let (rows, entries) = (&sheet.rows()[first..], &pieces.entries()[first..]);
    let hits = room_for(hits, rows.len() * sheet.rows().len().div_ceil(lanes));
    let lines = LinesTouch::<S>(simd.splat_f32s(-limits.contact_squared));
    let balls = BallsTouch::<S>::new(simd, limits);
    // First what is asked quickly; of what passes, which is little, the rest.
    let mut found = 0;
    let groups = rows.chunks(ROWS_AT_ONCE).zip(entries.chunks(ROWS_AT_ONCE));
    for ((rows, entries), row) in groups.zip((first..).step_by(ROWS_AT_ONCE)) {
        let mut partners = [NONE; ROWS_AT_ONCE];
        for (partner, &entry) in partners.iter_mut().zip(entries) {
            *partner = pieces.partner(entry);
        }
        for (number, block) in sheet.blocks().iter().enumerate() {
            for vector in 0..LANES / lanes {
                let column = number * LANES + vector * lanes;
                let next = &mut hits[found];
                let columns = block.columns(simd, vector);
                let mut lanes = 0;
                for (place, (row, &partner)) in rows.iter().zip(&partners).enumerate() {
                    let touch = lines.passes(simd, Columns::all_like(simd, row), columns);
                    let others = others(simd, row, partner, columns);
                    lanes |= lanes_of(simd, simd.and_m32s(touch, others)) << (place * LANES);
                }
                lanes &= before(row, column);
                *next = Hits::new(row, column, lanes);
                found += usize::from(lanes != 0);
            }
        }
    }
    let mut kept = 0;
    for place in 0..found {
        let mut one = hits[place];
        let block = &sheet.blocks()[one.column() / LANES];
        let columns = block.columns(simd, one.column() % LANES / lanes);
        let mut lanes = 0;
        let rows = &sheet.rows()[one.row()..];
        for (place, row) in rows.iter().enumerate().take(ROWS_AT_ONCE) {
            if one.lanes_of_row(place) != 0 {
                lanes |= lanes_of(simd, balls.passes(simd, row, columns)) << (place * LANES);
            }
        }
        one.keep(lanes);
        hits[kept] = one;
        kept += usize::from(one.any());
    }
    kept
}

/// A comparison's outcome as a number with a bit for each lane.
#[inline(always)]
fn lanes_of<S: Simd>(simd: S, mask: S::m32s) -> u64 {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = as_v3(simd) {
        // One instruction instead of eight.
        let lanes = simd.avx._mm256_movemask_ps(bytemuck::cast(mask));
        return u64::from(lanes.cast_unsigned());
    }
    const { assert!(size_of::<S::f32s>() <= LANES * size_of::<f32>()) };
    if const { size_of::<S::m32s>() == size_of::<u16>() } {
        u64::from(bytemuck::cast::<S::m32s, u16>(mask))
    } else if const { size_of::<S::m32s>() == size_of::<u8>() } {
        u64::from(bytemuck::cast::<S::m32s, u8>(mask)) & ((1 << S::F32_LANES) - 1)
    } else {
        let masks = [mask];
        let lanes: &[u32] = bytemuck::cast_slice(&masks);
        lanes
            .iter()
            .enumerate()
            .fold(0, |bits, (lane, &set)| bits | u64::from(set & 1) << lane)
    }
}

#[cfg(test)]
mod tests {
    use pulp::{Scalar, Scalar128b, Scalar256b, Scalar512b};

    use glam::DVec3;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::sift::Sift;
    use super::*;
    use crate::collision::approach_time;
    use crate::engine::windowed::grid::Entry;
    use crate::engine::windowed::pieces::NONE;
    use crate::engine::windowed::sheet::Row;

    /// Pieces on a line that all fly towards its middle, so that the lines of any two touch and they meet there.
    struct Crowd(Vec<Entry>);

    impl Rows for Crowd {
        fn entries(&self) -> &[Entry] {
            &self.0
        }

        fn row(&self, entry: Entry) -> Row {
            let place = f64::from(entry) - 0.5 * (self.0.len() as f64 - 1.0);
            Row::new(DVec3::X * place, DVec3::X * -place, entry)
        }

        fn partner(&self, _: Entry) -> u32 {
            NONE
        }
    }

    /// The pairs of rows that vectors of one width find.
    fn pairs(simd: impl Simd, count: usize, first: usize, by_distance: bool) -> Vec<(u32, u32)> {
        let limits = &Limits {
            edges: [100.0; 3],
            off_middle: 0.1,
            contact_squared: 0.01,
            reach_squared: 1e4,
            by_distance,
            ..Limits::default()
        };
        let mut doubts = Vec::new();
        Find {
            sheet: &mut Sheet::default(),
            pieces: Crowd((0..count as Entry).collect()),
            first,
            ahead: ReadAhead::default(),
            cell: 0,
            middle: [0.0; 3],
            limits,
            hits: &mut Vec::new(),
            pairs: &mut Vec::new(),
            doubts: &mut doubts,
        }
        .with_simd(simd);
        let sifted = doubts.chunks(LANES).flat_map(|doubts| {
            let can_meet = Sift { doubts, limits }.with_simd(simd);
            let bits = doubts.iter().zip(0..);
            bits.filter(move |(_, lane)| can_meet >> lane & 1 == 1)
        });
        let mut pairs: Vec<_> = sifted.map(|(doubt, _)| doubt.entries.into()).collect();
        pairs.sort_unstable();
        pairs
    }

    #[test]
    fn vectors_of_every_width_find_all_pairs_of_a_crowd() {
        for count in [1, 2, 7, 16, 17, 45] {
            for first in [0, count / 2, count] {
                let rows = first as u32..count as u32;
                let all: Vec<_> = rows
                    .flat_map(|row| (0..row).map(move |other| (row, other)))
                    .collect();
                for by_distance in [false, true] {
                    assert_eq!(pairs(Scalar::new(), count, first, by_distance), all);
                    assert_eq!(pairs(Scalar128b, count, first, by_distance), all);
                    assert_eq!(pairs(Scalar256b, count, first, by_distance), all);
                    assert_eq!(pairs(Scalar512b, count, first, by_distance), all);
                }
            }
        }
    }

    /// How many of a cell's pairs the filter lets through.
    fn count(filter: &mut Filter, pieces: impl Rows, first: usize) -> usize {
        let (here, ahead) = ((0, [20.0; 3]), ReadAhead::default());
        filter.find(&mut Sheet::default(), pieces, first, here, ahead);
        let mut count = 0;
        filter.sift(|_| count += 1);
        count
    }

    /// Two pieces; the second began where its ball met this one.
    struct Pair([Row; 2], u32);

    impl Rows for Pair {
        fn entries(&self) -> &[Entry] {
            &[0, 1]
        }

        fn row(&self, entry: Entry) -> Row {
            self.0[entry as usize]
        }

        fn partner(&self, entry: Entry) -> u32 {
            if entry == 1 { self.1 } else { NONE }
        }
    }

    #[test]
    fn nearly_those_pairs_are_found_that_meet_after_both_have_begun() {
        const CONTACT: f64 = 0.1;
        const EDGE: f64 = 1.0;
        let place = DVec3::splat(20.0);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(11);
        for reach in [0.05, 2.0] {
            let mut filter = Filter::default();
            filter.begin_window(Margins {
                contact: CONTACT,
                least_contact: CONTACT,
                off_middle: 0.0,
                position: f64::from(f32::EPSILON) * 24.0,
                edges: [EDGE as f32; 3],
                fastest: 2.0 * reach as f32,
            });
            let (mut meet, mut found) = (0, [0; 2]);
            for _ in 0..40_000 {
                let mut vector = |size: f64| {
                    DVec3::from_array(std::array::from_fn(|_| random.random_range(-size..size)))
                };
                // They touch near the cell's middle, now and then without approaching each other, at a time around the window.
                let [velocity, mut other_velocity] = [vector(reach), vector(reach)];
                let normal = vector(1.0).normalize();
                let point = place + vector(0.55 * EDGE);
                let begins: [f64; 2] = std::array::from_fn(|_| random.random_range(0.0..0.9));
                let later = begins[0].max(begins[1]);
                let touch = match random.random_range(0..4) {
                    0 => later,
                    _ => random.random_range(-0.2..1.1),
                };
                if random.random_range(0..4) == 0 {
                    // Like two pieces of which one began when the other was hit.
                    let along = (velocity - other_velocity).dot(normal);
                    other_velocity += normal * along;
                }
                let middle = 0.5 * CONTACT * normal;
                let starts = [
                    point + middle - velocity * touch,
                    point - middle - other_velocity * touch,
                ];
                let row = |one: usize, velocity| {
                    Row::new(starts[one], velocity, one as u32).beginning(begins[one])
                };
                let rows = [row(0, velocity), row(1, other_velocity)];
                let relative = velocity - other_velocity;
                let separation = starts[0] - starts[1] + relative * later;
                // Who is inside another when the later one begins should have met it before: both cannot come about.
                let clear = separation.length() > (1.0 - 1e-6) * CONTACT;
                let time = approach_time(separation, relative, CONTACT).filter(|_| clear);
                let meets_here = time.is_some_and(|time| {
                    let time = later + time;
                    let [one, other] = [
                        starts[0] + velocity * time,
                        starts[1] + other_velocity * time,
                    ];
                    let apart = (0.5 * (one + other) - place).abs().max_element();
                    time <= 1.0 && apart <= 0.5 * EDGE
                });
                meet += usize::from(meets_here);
                // Both at once, and one later.
                for (first, found) in found.iter_mut().enumerate() {
                    let pairs = count(&mut filter, Pair(rows, NONE), first);
                    assert!(pairs > 0 || !meets_here, "{first} {rows:?}");
                    *found += pairs;
                }
            }
            assert!(
                meet > 5_000 && found.iter().all(|&found| found < meet + 3_000),
                "{meet} {found:?}"
            );
        }
    }

    #[test]
    fn a_piece_does_not_meet_those_its_parents_ball_was_on_before() {
        let mut filter = Filter::default();
        filter.begin_window(Margins {
            contact: 0.1,
            least_contact: 0.1,
            position: f64::from(f32::EPSILON) * 24.0,
            edges: [1.0; 3],
            fastest: 1.0,
            ..Margins::default()
        });
        // They meet in the middle at time 0.9.
        let row = |side: f64, ball: u32| {
            let velocity = -0.5 * side * DVec3::X;
            Row::new(
                DVec3::splat(20.0) + 0.05 * side * DVec3::X - 0.9 * velocity,
                velocity,
                ball,
            )
        };
        let begin = 0.5;
        let mut count = |other: Row, partner: u32| {
            let rows = [other, row(1.0, 5).beginning(begin)];
            self::count(&mut filter, Pair(rows, partner), 1)
        };
        let earlier = f64::from((begin as f32).next_down());
        assert_eq!(count(row(-1.0, 7), 7), 0);
        assert_eq!(count(row(-1.0, 7).beginning(earlier), 7), 0);
        // Those that begin with it or after it, and other balls'.
        assert_eq!(count(row(-1.0, 7).beginning(begin), 7), 1);
        assert_eq!(count(row(-1.0, 7).beginning(0.6), 7), 1);
        assert_eq!(count(row(-1.0, 7), 8), 1);
        assert_eq!(count(row(-1.0, 7).beginning(earlier), NONE), 1);
    }
}
