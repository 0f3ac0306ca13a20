//! The twelve edges of the box, behind everything else; those that lie behind the gas are broken lines.
//!
//! Edges of a container are solid, those of a periodic box are dashes, and open space has none.

use super::{Layer, Picture};
use crate::snapshot::{Boundary, SceneCard};
use crate::tui::camera::{Projection, Spot};
use crate::tui::theme::Glyphs;

/// Draws the edges of the box.
pub(super) fn draw(
    picture: &mut Picture,
    scene: &SceneCard,
    projection: &Projection,
    glyphs: &Glyphs,
) {
    let glyphs = match scene.boundary {
        Boundary::Container => glyphs.edge,
        Boundary::Periodic => glyphs.open_edge,
        Boundary::Open => return,
    };
    let dashed = scene.boundary == Boundary::Periodic;
    let corner = |index: usize| projection.project(corner(scene.size, index));
    let farthest = (0..8)
        .max_by(|a, b| corner(*a).depth.total_cmp(&corner(*b).depth))
        .expect("a box has corners");
    // Hidden edges first: where two meet, the one in front stays.
    for hidden in [true, false] {
        // Of a pattern of four cells, these are drawn.
        let pattern = match (hidden, dashed) {
            (false, false) => [true; 4],
            (true, false) => [true, false, true, false],
            (false, true) => [true, true, true, false],
            (true, true) => [true, false, false, false],
        };
        for [from, to] in edges() {
            if (from == farthest || to == farthest) == hidden {
                line(picture, [corner(from), corner(to)], pattern, glyphs);
            }
        }
    }
}

/// A corner of a box; each bit of the index is a side.
pub(super) fn corner(size: [f64; 3], index: usize) -> [f64; 3] {
    let side = |axis: usize| if index >> axis & 1 == 1 { 0.5 } else { -0.5 };
    [0, 1, 2].map(|axis| side(axis) * size[axis])
}

/// The corners at the ends of the twelve edges.
pub(super) fn edges() -> impl Iterator<Item = [usize; 2]> {
    let pairs = (0..8).flat_map(|from| (0..3).map(move |axis| [from, from | 1 << axis]));
    pairs.filter(|[from, to]| from != to)
}

/// Cells from one spot to another, at the most one for each column or row; none of a line that is much longer than the pane.
pub(super) fn cells_between(
    picture: &Picture,
    [from, to]: [Spot; 2],
) -> impl Iterator<Item = (usize, f64, f64)> + use<> {
    let (columns, rows) = (to.column - from.column, to.row - from.row);
    let steps = columns.abs().max(rows.abs()).ceil().max(1.0);
    // Far outside the pane a zoomed edge has many steps and no cells.
    let limit = 64.0 * (picture.width + picture.height) as f64;
    let count = if steps <= limit {
        steps as usize + 1
    } else {
        0
    };
    (0..count).map(move |step| {
        let part = step as f64 / steps;
        (step, from.column + part * columns, from.row + part * rows)
    })
}

fn line(picture: &mut Picture, ends: [Spot; 2], pattern: [bool; 4], glyphs: [char; 6]) {
    let [from, to] = ends;
    let (columns, rows) = (to.column - from.column, to.row - from.row);
    let slope = (2.0 * rows.abs()).atan2(columns.abs()).to_degrees();
    let [high, level, low, upright, rising, falling] = glyphs;
    for (step, column, row) in cells_between(picture, ends) {
        let Some(cell) = picture.cell(column, row).filter(|_| pattern[step % 4]) else {
            continue;
        };
        let glyph = match slope {
            ..50.0 if slope < 4.0 => level,
            ..50.0 => [high, level, low][((row - row.floor()) * 3.0) as usize % 3],
            75.0.. => upright,
            _ if (columns < 0.0) == (rows < 0.0) => falling,
            _ => rising,
        };
        picture.cells[cell] = (glyph, Layer::Edge);
    }
}
