//! Lists a region's flights in the cells that they pass in a window: the pass that reads every ball.
//!
//! Flights are taken in blocks. What cells a straight path touches is found for all flights of a block at once, without
//! branches, if it reaches into at most three cells along each axis; the few others, and those that may meet a wall, a plane or
//! a face, are put aside.

use pulp::{Arch, Simd, WithSimd};

use super::grid::listed_at;
use super::lists::{Inserted, Lists, Tails};
use super::passages::Passages;
use super::paths::Gas;
use super::pieces::{Id, Line, NONE, Numbering, Past};
use super::region::Passage;
use super::touch::{BLOCK, Block, Bounds, NEAR_BOUNDARY, PARTS, WIDE, avoid, planes, touch};
use crate::engine::turn::SIDE;

/// How many blocks before its turn the memory for the cells of a block's flights is asked for.
const BLOCKS_AHEAD: usize = 16;

/// Which flights of a block left the last window along another piece.
struct Turned {
    lanes: [u8; BLOCK],
    count: usize,
}

impl Turned {
    /// Finds them among a block's lines and asks for the memory of their pieces.
    #[inline(always)]
    fn read_ahead(lines: &[Line], past: Option<&Past>, numbering: Numbering) -> Self {
        // The number apart from the lanes, that it stays in a register.
        let (mut lanes, mut count) = ([0; BLOCK], 0);
        for (lane, line) in lines.iter().enumerate().take(BLOCK) {
            lanes[count] = lane as u8;
            count += usize::from(line.link() != NONE);
        }
        let turned = Self { lanes, count };
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
        let mut passages = Passages::default();
        for number in 0..blocks {
            let (_, lines) = all.split_at_mut(number * BLOCK);
            let (lines, next) = lines.split_at_mut(BLOCK.min(lines.len()));
            let turned = std::mem::replace(&mut next_turned, read_ahead(next));
            for cell in cell_of(number + BLOCKS_AHEAD)..cell_of(number + BLOCKS_AHEAD + 1) {
                tails.read_ahead(self.gas.grid, cell);
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
            passages.find(simd, &block, self.gas.offsets, ids, aside);
            let (mut places, mut ids) = (passages.places(), passages.flights());
            loop {
                let (count, next) = list(places, ids, targets, &mut tails);
                (places, ids) = (&places[count..], &ids[count..]);
                match next {
                    Inserted::Yes => break,
                    Inserted::Elsewhere => {
                        let (cell, entry) = listed_at(targets[places[0] as usize], ids[0]);
                        self.outbox.push((entry, cell));
                        (places, ids) = (&places[1..], &ids[1..]);
                    }
                    Inserted::NoRoom => {
                        self.lists.widen();
                        tails = self.lists.tails();
                    }
                }
            }
            first += count_of_lines as u32;
        }
    }
}

/// Lists passages until one belongs elsewhere or finds no room; gives how many it has listed, and what became of the next.
// A function of its own, without calls, that what it needs stays in registers.
#[inline(never)]
fn list(places: &[u32], flights: &[Id], targets: &[u32], tails: &mut Tails) -> (usize, Inserted) {
    for (number, (&place, &id)) in places.iter().zip(flights).enumerate() {
        let (cell, entry) = listed_at(targets[place as usize], id);
        let inserted = tails.insert(cell as usize, entry);
        if inserted != Inserted::Yes {
            return (number, inserted);
        }
    }
    (places.len(), Inserted::Yes)
}
