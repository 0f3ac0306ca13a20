//! Where the picture is seen from, and the orthographic projection that follows from it.
//!
//! Lengths become columns; a row is as high as two columns are wide. Depth grows away from the eye, and is zero in the
//! middle of the container.

/// What the user set: direction, zoom, slab.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Turn about the vertical axis in degrees, in `0..360`.
    pub azimuth: i32,
    /// Height of the eye in degrees, in `-90..=90`.
    pub elevation: i32,
    /// Steps of zoom from the fit; one step is a factor of 1.25.
    pub zoom_steps: i32,
    /// Steps of slab thickness from the default; two steps are a factor of 2.
    pub slab_steps: i32,
    /// Slabs between the middle and the one that is shown; positive is farther from the eye.
    pub slice: i32,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            azimuth: 30,
            elevation: 20,
            zoom_steps: 0,
            slab_steps: 0,
            slice: 0,
        }
    }
}

impl Camera {
    /// Turns by whole degrees; elevation stops at the poles.
    pub fn turn(&mut self, azimuth: i32, elevation: i32) {
        self.azimuth = (self.azimuth + azimuth).rem_euclid(360);
        self.elevation = (self.elevation + elevation).clamp(-90, 90);
    }

    /// Zooms by steps, from a quarter to some hundreds of times the fit.
    pub fn zoom_by(&mut self, steps: i32) {
        self.zoom_steps = (self.zoom_steps + steps).clamp(-6, 28);
    }

    /// Makes the slab thicker by steps.
    pub fn thicken(&mut self, steps: i32) {
        self.slab_steps = (self.slab_steps + steps).clamp(-12, 12);
    }

    /// Moves the slab along the line of sight.
    pub fn move_slab(&mut self, slabs: i32) {
        self.slice = (self.slice + slabs).clamp(-50, 50);
    }

    /// Magnification over the fit.
    pub fn zoom(&self) -> f64 {
        1.25_f64.powi(self.zoom_steps)
    }

    /// Slab thickness over the default.
    pub fn slab_factor(&self) -> f64 {
        2_f64.powf(f64::from(self.slab_steps) / 2.0)
    }
}

/// A point on the pane: column and row as real numbers, cell `(i, j)` covering `[i, i + 1) x [j, j + 1)`; and its depth
/// \[length\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Distance from the left edge in columns.
    pub column: f64,
    /// Distance from the top edge in rows.
    pub row: f64,
    /// Distance behind the middle plane \[length\].
    pub depth: f64,
}

/// The projection of one frame.
#[derive(Clone, Debug)]
pub struct Projection {
    right: [f64; 3],
    up: [f64; 3],
    forward: [f64; 3],
    middle: [f64; 2],
    /// Columns per length.
    pub scale: f64,
}

impl Projection {
    /// Fits a box of the given edges into a pane, then applies the camera's zoom.
    pub fn new(camera: &Camera, size: [f64; 3], width: u16, height: u16) -> Self {
        let (sin_a, cos_a) = f64::from(camera.azimuth).to_radians().sin_cos();
        let (sin_e, cos_e) = f64::from(camera.elevation).to_radians().sin_cos();
        let right = [cos_a, sin_a, 0.0];
        let up = [-sin_a * sin_e, cos_a * sin_e, cos_e];
        let forward = [-sin_a * cos_e, cos_a * cos_e, -sin_e];
        let extent = |axis: [f64; 3]| -> f64 { (0..3).map(|i| size[i] * axis[i].abs()).sum() };
        let fit = (f64::from(width) / extent(right)).min(2.0 * f64::from(height) / extent(up));
        Self {
            right,
            up,
            forward,
            middle: [f64::from(width) / 2.0, f64::from(height) / 2.0],
            scale: 0.97 * fit * camera.zoom(),
        }
    }

    /// Where a point relative to the container's centre appears.
    pub fn project(&self, point: [f64; 3]) -> Spot {
        Spot {
            column: self.middle[0] + dot(self.right, point) * self.scale,
            row: self.middle[1] - dot(self.up, point) * self.scale / 2.0,
            depth: dot(self.forward, point),
        }
    }

    /// Length of the line of sight through a point of the pane inside a box of the given edges \[length\].
    pub fn chord(&self, size: [f64; 3], column: f64, row: f64) -> f64 {
        let across = (column - self.middle[0]) / self.scale;
        let upward = (self.middle[1] - row) * 2.0 / self.scale;
        let mut enter = f64::NEG_INFINITY;
        let mut leave = f64::INFINITY;
        for (axis, edge) in size.iter().enumerate() {
            let origin = across * self.right[axis] + upward * self.up[axis];
            let (slope, half) = (self.forward[axis], edge / 2.0);
            if slope.abs() < 1e-12 {
                if origin.abs() > half {
                    return 0.0;
                }
                continue;
            }
            let (first, second) = ((-half - origin) / slope, (half - origin) / slope);
            enter = enter.max(first.min(second));
            leave = leave.min(first.max(second));
        }
        (leave - enter).max(0.0)
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen_from(azimuth: i32, elevation: i32, point: [f64; 3]) -> (f64, f64, f64) {
        let camera = Camera {
            azimuth,
            elevation,
            ..Camera::default()
        };
        let spot = Projection::new(&camera, [2.0; 3], 40, 20).project(point);
        let round = |x: f64| (x * 1e9).round() / 1e9;
        (
            round((spot.column - 20.0) / 19.4),
            round((10.0 - spot.row) / 9.7),
            round(spot.depth),
        )
    }

    #[test]
    fn without_turn_x_goes_right_y_away_and_z_up() {
        assert_eq!(seen_from(0, 0, [1.0, 0.0, 0.0]), (1.0, 0.0, 0.0));
        assert_eq!(seen_from(0, 0, [0.0, 1.0, 0.0]), (0.0, 0.0, 1.0));
        assert_eq!(seen_from(0, 0, [0.0, 0.0, 1.0]), (0.0, 1.0, 0.0));
    }

    #[test]
    fn a_quarter_turn_swaps_the_horizontal_axes() {
        assert_eq!(seen_from(90, 0, [0.0, 1.0, 0.0]), (1.0, 0.0, 0.0));
        assert_eq!(seen_from(90, 0, [1.0, 0.0, 0.0]), (0.0, 0.0, -1.0));
    }

    #[test]
    fn from_above_the_vertical_axis_points_at_the_eye() {
        assert_eq!(seen_from(0, 90, [0.0, 0.0, 1.0]), (0.0, 0.0, -1.0));
        assert_eq!(seen_from(0, 90, [0.0, 1.0, 0.0]), (0.0, 1.0, 0.0));
    }

    #[test]
    fn the_line_of_sight_through_the_middle_is_as_long_as_the_box() {
        let camera = Camera {
            azimuth: 0,
            elevation: 0,
            ..Camera::default()
        };
        let projection = Projection::new(&camera, [2.0; 3], 41, 21);
        assert!((projection.chord([2.0; 3], 20.5, 10.5) - 2.0).abs() < 1e-12);
        assert_eq!(projection.chord([2.0; 3], 0.5, 0.5), 0.0);
    }
}
