//! Planes through the box: the outline of each one's cut with it, dotted, behind the balls.

use super::edges::{cells_between, corner, edges};
use super::{Layer, Picture};
use crate::snapshot::SceneCard;
use crate::tui::camera::Projection;
use crate::tui::theme::Glyphs;

/// Draws the outlines.
pub(super) fn draw(
    picture: &mut Picture,
    scene: &SceneCard,
    projection: &Projection,
    glyphs: &Glyphs,
) {
    for (normal, offset) in &scene.planes {
        let outline = outline(scene.size, *normal, *offset);
        for (index, from) in outline.iter().enumerate() {
            let to = outline[(index + 1) % outline.len()];
            let ends = [projection.project(*from), projection.project(to)];
            let steep = (ends[1].row - ends[0].row).abs() > (ends[1].column - ends[0].column).abs();
            let every = if steep { 1 } else { 2 }; // a row is as high as two columns are wide
            for (step, column, row) in cells_between(picture, ends) {
                if let Some(cell) = picture.cell(column, row).filter(|_| step % every == 0) {
                    picture.cells[cell] = (glyphs.plane, Layer::Plane);
                }
            }
        }
    }
}

/// Corners of the cut of a plane with a box, one after the other round it; empty where they do not meet.
fn outline(size: [f64; 3], normal: [f64; 3], offset: f64) -> Vec<[f64; 3]> {
    let height = |point: [f64; 3]| dot(normal, point) - offset;
    let mut corners: Vec<[f64; 3]> = edges()
        .map(|ends| ends.map(|end| corner(size, end)))
        .filter_map(|[from, to]| {
            let (start, end) = (height(from), height(to));
            let part = start / (start - end);
            // An edge that lies in the plane has its ends from its neighbours.
            ((0.0..=1.0).contains(&part))
                .then(|| [0, 1, 2].map(|axis| from[axis] + part * (to[axis] - from[axis])))
        })
        .collect();
    let count = corners.len().max(1) as f64;
    let middle =
        [0, 1, 2].map(|axis| corners.iter().map(|corner| corner[axis]).sum::<f64>() / count);
    let [across, along] = directions_in(normal);
    let angle = |point: &[f64; 3]| {
        let arm = [0, 1, 2].map(|axis| point[axis] - middle[axis]);
        dot(arm, along).atan2(dot(arm, across))
    };
    corners.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    corners
}

/// Two directions in a plane, perpendicular to each other and to its normal.
fn directions_in(normal: [f64; 3]) -> [[f64; 3]; 2] {
    let helper = if normal[0].abs() < 0.6 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let across = cross(normal, helper);
    [across, cross(normal, across)].map(|direction| {
        let length = dot(direction, direction).sqrt();
        direction.map(|component| component / length)
    })
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Length of the way round the cut with a cube of edge 2.
    #[track_caller]
    fn check(normal: [f64; 3], offset: f64, expected: f64) {
        let outline = outline([2.0; 3], normal, offset);
        let sides = (0..outline.len()).map(|index| {
            let (from, to) = (outline[index], outline[(index + 1) % outline.len()]);
            let side = [0, 1, 2].map(|axis| to[axis] - from[axis]);
            dot(side, side).sqrt()
        });
        let round: f64 = sides.sum();
        assert!((round - expected).abs() < 1e-12, "{round}, not {expected}");
    }

    #[test]
    fn the_cut_goes_once_round() {
        let [half, third] = [0.5_f64.sqrt(), (1.0_f64 / 3.0).sqrt()];
        check([1.0, 0.0, 0.0], 0.3, 8.0);
        check([0.0, 0.0, -1.0], 0.9, 8.0);
        check([half, half, 0.0], 0.0, 4.0 + 4.0 * 2.0_f64.sqrt());
        check([third; 3], 0.0, 6.0 * 2.0_f64.sqrt());
        check([1.0, 0.0, 0.0], 1.5, 0.0);
    }

    #[test]
    fn a_plane_in_a_face_outlines_it() {
        check([1.0, 0.0, 0.0], 1.0, 8.0);
    }
}
