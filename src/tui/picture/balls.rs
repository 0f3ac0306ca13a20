//! Single molecules: dots by depth while a ball is smaller than a cell, lit spheres when it is larger; tags and trails.

use super::{Layer, Picture};
use crate::snapshot::Sample;
use crate::tui::camera::{Projection, Spot};
use crate::tui::theme::{Glyphs, SHADES};
use crate::tui::trails::{Trails, tag_count};

/// Whether a ball covers enough of a cell to be drawn as a disc.
pub(super) fn are_discs(radius: f64, scale: f64) -> bool {
    radius * scale >= 0.75
}

/// Draws the molecules of the slab, nearest on top.
pub(super) fn draw(
    picture: &mut Picture,
    sample: &Sample,
    projection: &Projection,
    glyphs: &Glyphs,
) {
    let half = picture
        .portion
        .slab
        .map_or(f64::INFINITY, |slab| slab / 2.0);
    let middle = picture.portion.depth;
    // A ball larger than the slab is seen where the middle cuts it.
    let spots: Vec<(Spot, f64)> = sample.positions[..picture.portion.prefix]
        .iter()
        .zip(&sample.radii)
        .map(|(position, radius)| {
            let spot = projection.project(position.map(f64::from));
            (spot, f64::from(*radius))
        })
        .filter(|(spot, radius)| (spot.depth - middle).abs() <= half.max(*radius))
        .collect();
    let deepest = spots
        .iter()
        .map(|(spot, _)| (spot.depth - middle).abs())
        .fold(0.0, f64::max);
    // Thirds of the slab, or of the gas if that is thinner.
    let third = half.min(deepest).max(f64::MIN_POSITIVE) / 1.5;
    let level = |depth: f64| (1.5 - (depth - middle) / third).clamp(0.0, 2.0) as u8;
    let mut nearest = vec![f64::INFINITY; picture.cells.len()];
    for (spot, radius) in spots {
        let disc = are_discs(radius, projection.scale);
        if disc {
            let glyph = glyphs.disc[usize::from(level(spot.depth))];
            draw_disc(
                picture,
                &mut nearest,
                spot,
                radius,
                level(spot.depth),
                glyph,
            );
        }
        let Some(cell) = picture.cell(spot.column, spot.row) else {
            continue;
        };
        if !disc && spot.depth < nearest[cell] {
            nearest[cell] = spot.depth;
            let level = level(spot.depth);
            picture.cells[cell] = (glyphs.depth[usize::from(level)], Layer::Molecule(level));
        }
    }
}

/// Columns from which on a ball's radius shows light and shadow; below, a shaded ball would look like litter.
const LIT: f64 = 3.5;

/// A sphere lit from the upper left, or a plain disc if it is small.
fn draw_disc(
    picture: &mut Picture,
    nearest: &mut [f64],
    spot: Spot,
    radius: f64,
    level: u8,
    plain: char,
) {
    let reach = radius * picture.scale;
    let first = |center: f64, reach: f64| (center - reach).floor().max(0.0) as usize;
    let last =
        |center: f64, reach: f64, end: usize| ((center + reach).ceil().max(0.0) as usize).min(end);
    for row in first(spot.row, reach / 2.0)..last(spot.row, reach / 2.0, picture.height) {
        for column in first(spot.column, reach)..last(spot.column, reach, picture.width) {
            let across = (column as f64 + 0.5 - spot.column) / reach;
            let down = (row as f64 + 0.5 - spot.row) * 2.0 / reach;
            let height = 1.0 - across * across - down * down;
            let cell = row * picture.width + column;
            let depth = spot.depth - height.max(0.0).sqrt() * radius;
            if height < 0.0 || depth >= nearest[cell] {
                continue;
            }
            nearest[cell] = depth;
            let light = 0.45 * -across + 0.55 * -down + 0.7 * height.sqrt();
            let shade = 1.0 + light.max(0.0) * 8.0;
            let glyph = if reach < LIT {
                plain
            } else {
                SHADES[(shade as usize).min(9)]
            };
            picture.cells[cell] = (glyph, Layer::Molecule(level));
        }
    }
}

/// Draws the tagged molecules and their trails over everything, whatever their depth.
pub(super) fn draw_tags(
    picture: &mut Picture,
    sample: &Sample,
    trails: &Trails,
    projection: &Projection,
    glyphs: &Glyphs,
) {
    let tags = tag_count(&sample.names, sample.positions.len());
    for tag in 0..tags {
        let mut before: Option<Spot> = None;
        for point in trails.path(tag) {
            let spot = projection.project(point);
            if let Some(before) = before {
                draw_trail(picture, before, spot, tag as u8, glyphs.trail);
            }
            before = Some(spot);
        }
    }
    for tag in (0..tags).rev() {
        let spot = projection.project(sample.positions[tag].map(f64::from));
        if let Some(cell) = picture.cell(spot.column, spot.row) {
            picture.cells[cell] = (glyphs.tags[tag], Layer::Tag(tag as u8));
        }
    }
}

fn draw_trail(picture: &mut Picture, from: Spot, to: Spot, tag: u8, glyph: char) {
    let (columns, rows) = (to.column - from.column, to.row - from.row);
    let steps = columns.abs().max(rows.abs()).ceil().clamp(1.0, 512.0);
    for step in 0..=steps as usize {
        let part = step as f64 / steps;
        if let Some(cell) = picture.cell(from.column + part * columns, from.row + part * rows) {
            picture.cells[cell] = (glyph, Layer::Trail(tag));
        }
    }
}
