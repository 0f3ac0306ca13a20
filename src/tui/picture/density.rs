//! The whole depth, shaded by density relative to the mean of the gas.
//!
//! Each cell compares the balls seen in it with what an even gas would put there along the same line of sight.

use super::{Layer, Picture};
use crate::snapshot::{Sample, SceneCard};
use crate::tui::camera::Projection;
use crate::tui::theme::SHADES;

/// Balls of an even gas lent to each cell, so that a cell with few balls is not shaded by chance.
const LOAN: f64 = 4.0;

/// Draws the density.
pub(super) fn draw(
    picture: &mut Picture,
    scene: &SceneCard,
    sample: &Sample,
    projection: &Projection,
) {
    let mut seen = vec![0.0_f64; picture.cells.len()];
    for (position, radius) in sample.positions.iter().zip(&sample.radii) {
        let spot = projection.project(position.map(f64::from));
        let reach = f64::from(*radius) * projection.scale;
        if super::balls::are_discs(f64::from(*radius), projection.scale) {
            spread(picture, &mut seen, spot.column, spot.row, reach);
        } else if let Some(cell) = picture.cell(spot.column, spot.row) {
            seen[cell] += 1.0;
        }
    }
    let volume: f64 = scene.size.iter().product();
    let cell_area = 2.0 / (projection.scale * projection.scale);
    let per_length = sample.positions.len() as f64 * cell_area / volume;
    for (cell, count) in seen.iter().enumerate() {
        let (column, row) = ((cell % picture.width) as f64, (cell / picture.width) as f64);
        let expected = per_length * mean_chord(projection, scene.size, column, row);
        // In open space balls leave the box.
        if expected <= 0.0 && *count == 0.0 {
            continue;
        }
        let ratio = (count + LOAN) / (expected + LOAN);
        let shade = (ratio * 5.0).round().clamp(0.0, 9.0) as usize;
        let empty_gas = *count == 0.0 && expected < 0.5;
        // A blank cell lets the container's edges through.
        if shade > 0 && !empty_gas {
            picture.cells[cell] = (SHADES[shade], Layer::Shade);
        }
    }
}

/// Mean line of sight of a cell: at the rim of the box the middle alone would mislead.
fn mean_chord(projection: &Projection, size: [f64; 3], column: f64, row: f64) -> f64 {
    let places = [0.125, 0.375, 0.625, 0.875];
    let chords = places.map(|i| places.map(|j| projection.chord(size, column + i, row + j)));
    chords.iter().flatten().sum::<f64>() / 16.0
}

/// Spreads one ball evenly over the cells its disc covers.
fn spread(picture: &Picture, seen: &mut [f64], column: f64, row: f64, reach: f64) {
    let weight = 2.0 / (std::f64::consts::PI * reach * reach);
    let first = |center: f64, reach: f64| (center - reach).floor().max(0.0) as usize;
    let last =
        |center: f64, reach: f64, end: usize| ((center + reach).ceil().max(0.0) as usize).min(end);
    for j in first(row, reach / 2.0)..last(row, reach / 2.0, picture.height) {
        for i in first(column, reach)..last(column, reach, picture.width) {
            let (across, down) = (i as f64 + 0.5 - column, (j as f64 + 0.5 - row) * 2.0);
            if across * across + down * down <= reach * reach {
                seen[j * picture.width + i] += weight;
            }
        }
    }
}
