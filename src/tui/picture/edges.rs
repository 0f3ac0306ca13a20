//! The twelve edges of the container, behind everything else; those that lie behind the gas are broken lines.

use super::{Layer, Picture};
use crate::tui::camera::{Projection, Spot};
use crate::tui::theme::Glyphs;

/// Draws the edges of a box.
pub(super) fn draw(
    picture: &mut Picture,
    size: [f64; 3],
    projection: &Projection,
    glyphs: &Glyphs,
) {
    let corner = |index: usize| {
        let side = |axis: usize| if index >> axis & 1 == 1 { 0.5 } else { -0.5 };
        projection.project([0, 1, 2].map(|axis| side(axis) * size[axis]))
    };
    let farthest = (0..8)
        .max_by(|a, b| corner(*a).depth.total_cmp(&corner(*b).depth))
        .expect("a box has corners");
    let pairs = (0..8).flat_map(|from| (0..3).map(move |axis| (from, from | 1 << axis)));
    let edges: Vec<_> = pairs.filter(|(from, to)| from != to).collect();
    // Hidden edges first: where two meet, the one in front stays.
    for hidden in [true, false] {
        for (from, to) in &edges {
            if (*from == farthest || *to == farthest) == hidden {
                line(picture, corner(*from), corner(*to), hidden, glyphs);
            }
        }
    }
}

fn line(picture: &mut Picture, from: Spot, to: Spot, hidden: bool, glyphs: &Glyphs) {
    let (columns, rows) = (to.column - from.column, to.row - from.row);
    let steps = columns.abs().max(rows.abs()).ceil().max(1.0);
    // Far outside the pane a zoomed edge has many steps and no cells.
    let limit = 64.0 * (picture.width + picture.height) as f64;
    if !steps.is_finite() || steps > limit {
        return;
    }
    let slope = (2.0 * rows.abs()).atan2(columns.abs()).to_degrees();
    let [high, level, low, upright, rising, falling] = glyphs.edge;
    for step in 0..=steps as usize {
        if hidden && step % 2 == 1 {
            continue;
        }
        let part = step as f64 / steps;
        let (column, row) = (from.column + part * columns, from.row + part * rows);
        let Some(cell) = picture.cell(column, row) else {
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
