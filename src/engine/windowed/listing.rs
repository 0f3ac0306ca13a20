//! Lists a region's flights in the cells that they pass in a window: the pass that reads every ball.
//!
//! Flights are taken in blocks. What cells a straight path touches is found for all flights of a block at once, without
//! branches, if it reaches into at most three cells along each axis; the few others, and those that may meet a wall, a plane or
//! a face, are put aside.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::grid::{Inserted, Lists, Tails};
use super::paths::Gas;
use super::pieces::{Id, Line, NONE, Numbering, Past};
use super::region::Passage;
use super::touch::{
    BLOCK, Block, Bounds, CUBE, NEAR_BOUNDARY, Offsets, PARTS, WIDE, avoid, planes, touch,
};
use crate::engine::image::number_of;
use crate::engine::turn::SIDE;

/// Cells of a flight's path that are written down without a branch.
const WITHOUT_BRANCHES: usize = 4;

/// How many blocks before its turn the memory for the cells of a block's flights is asked for.
const BLOCKS_AHEAD: usize = 16;

/// Passages of a block: as many as all its flights can have.
pub const MOST_PASSAGES: usize = (BLOCK * CUBE + WITHOUT_BRANCHES).next_power_of_two();

/// A passage: the place's number, and above [`FLIGHT_SHIFT`] the flight's.
pub type Passing = u64;

/// See [`Passing`].
const FLIGHT_SHIFT: u32 = u32::BITS;

/// Where it is.
#[inline(always)]
pub fn place_of(passing: Passing) -> usize {
    passing as u32 as usize
}

/// Whose it is.
#[inline(always)]
pub fn flight_of(passing: Passing) -> Id {
    (passing >> FLIGHT_SHIFT) as Id
}

/// Which flights of a block left the last window along another piece.
struct Turned {
    lanes: [u8; BLOCK],
    count: usize,
}

impl Turned {
    /// Finds them among a block's lines and asks for the memory of their pieces.
    #[inline(always)]
    fn read_ahead(lines: &[Line], past: Option<&Past>, numbering: Numbering) -> Self {
        let mut turned = Self {
            lanes: [0; BLOCK],
            count: 0,
        };
        for (lane, line) in lines.iter().enumerate().take(BLOCK) {
            turned.lanes[turned.count] = lane as u8;
            turned.count += usize::from(line.link() != NONE);
        }
        if let Some(past) = past {
            for &lane in turned.lanes() {
                past.read_ahead(numbering, lines[lane as usize].link());
            }
        }
        turned
    }

    #[inline(always)]
    fn lanes(&self) -> &[u8] {
        &self.lanes[..self.count]
    }
}

/// A region's flights.
pub struct Flights<'a> {
    /// Their lines.
    pub lines: &'a mut [Line],
    /// Their radii in grid lengths, unless all are taken for alike.
    pub radii: &'a [f32],
    /// The pieces with which balls left the last window, if they did not do so along their lines.
    pub past: Option<&'a Past>,
    /// One to move all on by a window, zero if they are at its beginning.
    pub advance: f32,
}

/// The pass through a region's flights.
pub struct Listing<'a, 'f> {
    /// What all threads read.
    pub gas: Gas<'a>,
    /// Index of the first flight.
    pub first: usize,
    /// The flights.
    pub flights: Flights<'f>,
    /// Where flights are listed.
    pub lists: &'a mut Lists,
    /// Passages through other regions' cells.
    pub outbox: &'a mut Vec<Passage>,
    /// Receives flights that need a closer look, with their balls.
    pub aside: &'a mut Vec<(Id, u32)>,
}

impl Listing<'_, '_> {
    /// Moves all flights to the window's beginning and lists them.
    pub fn run(self, machine: Arch) {
        machine.dispatch(self);
    }
}

impl WithSimd for Listing<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let bounds = Bounds::new(&self.gas);
        let planes = planes(&self.gas);
        let mut block = Block::new(bounds.radius);
        let targets = &self.gas.grid.targets[..];
        let mut tails = self.lists.tails();
        let cells = tails.cells();
        let mut first = self.first as u32;
        let Flights {
            lines: all,
            radii,
            past,
            advance,
        } = self.flights;
        let blocks = all.len().div_ceil(BLOCK);
        // About where a block's flights are.
        let cell_of = |block: usize| cells.start + cells.len() * block / blocks;
        let read_ahead = |lines: &[Line]| {
            let lines = &lines[..BLOCK.min(lines.len())];
            Turned::read_ahead(lines, past, self.gas.numbering)
        };
        let mut next_turned = read_ahead(all);
        let mut passages: [Passing; MOST_PASSAGES] = [0; MOST_PASSAGES];
        for number in 0..blocks {
            let (_, lines) = all.split_at_mut(number * BLOCK);
            let (lines, next) = lines.split_at_mut(BLOCK.min(lines.len()));
            let turned = std::mem::replace(&mut next_turned, read_ahead(next));
            for cell in cell_of(number + BLOCKS_AHEAD)..cell_of(number + BLOCKS_AHEAD + 1) {
                tails.read_ahead(cell);
            }
            for &lane in turned.lanes() {
                let line = &mut lines[lane as usize];
                if let Some(past) = past {
                    *line = *past.line(self.gas.numbering, line.link());
                }
                line.set_link(NONE);
            }
            let count_of_lines = lines.len();
            let (parts, rest) = lines.as_chunks_mut::<SIDE>();
            let mut padded = [Line([0.0; SIDE]); SIDE];
            padded[..rest.len()].copy_from_slice(rest);
            for (part, lines) in parts.iter().chain([&padded]).enumerate().take(PARTS) {
                block.read(simd, part, lines);
            }
            if !radii.is_empty() {
                let radii = &radii[number * BLOCK..][..count_of_lines];
                block.radius[..radii.len()].copy_from_slice(radii);
            }
            touch(simd, &mut block, &bounds, advance, BLOCK);
            for (part, lines) in parts
                .iter_mut()
                .chain([&mut padded])
                .enumerate()
                .take(PARTS)
            {
                block.write(simd, part, lines);
            }
            rest.copy_from_slice(&padded[..rest.len()]);
            for plane in &planes {
                avoid(&mut block, *plane, bounds.slack);
            }
            let aside = |touched: u32, id: Id| {
                let aside = touched & (WIDE | NEAR_BOUNDARY) != 0;
                if aside {
                    self.aside.push((id, block.ball((id - first) as usize)));
                }
                aside
            };
            let ids = first..first + count_of_lines as Id;
            let count = pass(&block, self.gas.offsets, ids, &mut passages, aside);
            let mut passages = &passages[..count];
            while let Some(rest) = list(passages, targets, &mut tails, self.outbox) {
                passages = rest;
                self.lists.widen();
                tails = self.lists.tails();
            }
            first += count_of_lines as u32;
        }
    }
}

/// Writes down the passages of a block's flights, but for those which `aside` takes by the bits of what they touch; gives how many
/// passages.
#[inline(always)]
pub fn pass(
    block: &Block,
    offsets: &Offsets,
    flights: Range<Id>,
    passages: &mut [Passing],
    mut aside: impl FnMut(u32, Id) -> bool,
) -> usize {
    let passages = &mut passages[..MOST_PASSAGES];
    let mut count = 0;
    for (id, lane) in flights.zip(0..BLOCK) {
        let touched = block.touched[lane];
        if aside(touched, id) {
            continue;
        }
        let offsets = offsets.of_way(touched);
        let start = Passing::from(id) << FLIGHT_SHIFT | Passing::from(block.place[lane]);
        let mut cells = touched & (WIDE - 1);
        let mut next = |cells: &mut u32| {
            let bit = cells.trailing_zeros() as usize % offsets.len();
            passages[count % MOST_PASSAGES] = start.wrapping_add(offsets[bit]);
            count += usize::from(*cells != 0);
            *cells &= cells.wrapping_sub(1);
        };
        // How many cells it is cannot be foreseen: most flights are done in so many steps without a branch.
        for _ in 0..WITHOUT_BRANCHES {
            next(&mut cells);
        }
        while cells != 0 {
            next(&mut cells);
        }
    }
    count
}

/// Lists passages until one finds no room; gives those that are left then.
// A function of its own, that what it needs stays in registers.
#[inline(never)]
fn list<'p>(
    passages: &'p [Passing],
    targets: &[u32],
    tails: &mut Tails,
    outbox: &mut Vec<Passage>,
) -> Option<&'p [Passing]> {
    for (number, &passing) in passages.iter().enumerate() {
        let target = targets[place_of(passing)];
        let id = flight_of(passing);
        let cell = number_of(target);
        let entry = id | (target - cell);
        match tails.insert(cell as usize, entry) {
            Inserted::Yes => (),
            Inserted::Elsewhere => outbox.push((entry, cell)),
            Inserted::NoRoom => return Some(&passages[number..]),
        }
    }
    None
}
