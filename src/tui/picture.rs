//! The gas in characters: a slab of single molecules, or the density over the whole depth.
//!
//! Always holds: which molecules may appear depends on the scene, the camera and the pane, never on where they happen to be,
//! so that the same ones can be followed from frame to frame.

mod balls;
mod density;
mod edges;
mod planes;

use crate::snapshot::{Sample, SceneCard};
use crate::tui::camera::{Camera, Projection};
use crate::tui::theme::Glyphs;
use crate::tui::trails::{Trails, mean_edge};

/// What the picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Single molecules of a slab through the middle.
    Slab,
    /// The whole depth, shaded by density.
    Depth,
}

/// What a cell of the picture is part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Nothing.
    Empty,
    /// An edge of the box.
    Edge,
    /// The outline of a plane.
    Plane,
    /// A molecule in the far, middle or near third of the slab.
    Molecule(u8),
    /// Density.
    Shade,
    /// The trail of a tagged molecule.
    Trail(u8),
    /// A tagged molecule.
    Tag(u8),
}

/// A grid of characters, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Character and layer of each cell.
    pub cells: Vec<(char, Layer)>,
    /// Columns per length.
    pub scale: f64,
    /// What of the gas is shown.
    pub portion: Portion,
}

/// What of the gas a picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Portion {
    /// Thickness of the slab \[length\]; `None` is the whole depth.
    pub slab: Option<f64>,
    /// Distance of the slab's middle behind the middle of the box \[length\].
    pub depth: f64,
    /// How many balls of the sample, from its head, take part.
    pub prefix: usize,
    /// Molecules of the gas for each one that takes part.
    pub one_in: f64,
}

impl Picture {
    /// Draws a sample into a pane; an empty pane or box gives an empty picture.
    pub fn draw(
        scene: &SceneCard,
        sample: &Sample,
        trails: &Trails,
        view: (&Camera, Mode),
        pane: (u16, u16),
        glyphs: &Glyphs,
    ) -> Self {
        let (camera, mode) = view;
        let projection = Projection::new(camera, scene.size, pane.0, pane.1);
        let mut picture = Self {
            width: usize::from(pane.0),
            height: usize::from(pane.1),
            cells: vec![(' ', Layer::Empty); usize::from(pane.0) * usize::from(pane.1)],
            scale: projection.scale,
            portion: portion(scene, sample, camera, mode, pane),
        };
        if picture.cells.is_empty() || !projection.scale.is_normal() {
            return picture;
        }
        edges::draw(&mut picture, scene, &projection, glyphs);
        planes::draw(&mut picture, scene, &projection, glyphs);
        match mode {
            Mode::Slab => balls::draw(&mut picture, sample, &projection, glyphs),
            Mode::Depth => density::draw(&mut picture, scene, sample, &projection),
        }
        balls::draw_tags(&mut picture, sample, trails, &projection, glyphs);
        picture
    }

    /// The character at a cell.
    pub fn at(&self, column: usize, row: usize) -> char {
        self.cells[row * self.width + column].0
    }

    /// The cell a point falls into, if it is on the pane.
    fn cell(&self, column: f64, row: f64) -> Option<usize> {
        let inside =
            (0.0..self.width as f64).contains(&column) && (0.0..self.height as f64).contains(&row);
        inside.then(|| row as usize * self.width + column as usize)
    }
}

/// Share of the cells that molecules occupy in slab mode.
const OCCUPANCY: f64 = 0.2;
/// Thickness of the slab in mean edges of the container, unless the gas is too thin or the balls too large for it.
const SLAB: f64 = 0.05;

/// Chooses slab and prefix from what rests between frames.
fn portion(
    scene: &SceneCard,
    sample: &Sample,
    camera: &Camera,
    mode: Mode,
    pane: (u16, u16),
) -> Portion {
    let length = sample.positions.len();
    let one_in = |prefix: usize| scene.ball_count as f64 / prefix.max(1) as f64;
    let whole = Portion {
        slab: None,
        depth: 0.0,
        prefix: length,
        one_in: one_in(length),
    };
    let edge = mean_edge(scene.size);
    let radius = usual_radius(sample);
    if mode == Mode::Depth || length == 0 || !edge.is_normal() {
        return whole;
    }
    // The fit of the default direction, so that turning the box changes nothing but the direction.
    let rest = Camera {
        zoom_steps: camera.zoom_steps,
        ..Camera::default()
    };
    let scale = Projection::new(&rest, scene.size, pane.0, pane.1).scale;
    let cell_area = 2.0 / (scale * scale);
    let fit_area = cell_area * camera.zoom() * camera.zoom();
    let volume = edge.powi(3);
    // With few balls the slab must be thick enough to hold some.
    let enough = OCCUPANCY * volume / (fit_area * length as f64);
    let standard = (SLAB * edge).max(2.0 * radius).max(enough.min(edge));
    let thickness = standard * camera.slab_factor();
    // n balls fall on m cells of the slab's cross-section: n / m = prefix * (cell area * thickness / volume).
    let prefix = if balls::are_discs(radius, scale) {
        length
    } else {
        ((OCCUPANCY * volume / (cell_area * thickness)) as usize).clamp(1, length)
    };
    let diagonal = scene
        .size
        .iter()
        .map(|edge| edge * edge)
        .sum::<f64>()
        .sqrt();
    let in_slab = thickness < diagonal;
    let most = ((diagonal - thickness) / 2.0).max(0.0);
    let depth = (f64::from(camera.slice) * thickness).clamp(-most, most);
    Portion {
        slab: in_slab.then_some(thickness),
        depth: if in_slab { depth } else { 0.0 },
        prefix,
        one_in: one_in(prefix),
    }
}

/// Radius that half of the balls do not exceed: one grain among molecules must not decide how these are drawn.
fn usual_radius(sample: &Sample) -> f64 {
    let mut radii = sample.radii.clone();
    let middle = radii.len() / 2;
    if radii.is_empty() {
        return 0.0;
    }
    f64::from(*radii.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests;
