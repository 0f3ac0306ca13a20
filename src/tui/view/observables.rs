//! What is observed on demand: which observables are on, and of the chosen one its figures beside theory and its curve.

use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};

use super::chart::braille_dot;
use super::text::{framed, put, put_before, title, width, wrap};
use crate::snapshot::{Curve, Figure, ObservableName, Observed, Snapshot, Units};
use crate::tui::app::App;
use crate::tui::format::{MISSING, percent_off, plain, quantity, scientific, sigmas, with_error};
use crate::tui::theme;

/// Columns of the list of observables.
const LIST: u16 = 26;

/// Columns of the names of figures, of the figures with their errors, and of theory.
const COLUMNS: [u16; 3] = [34, 28, 14];

/// Least columns and rows of a curve.
const LEAST_CURVE: (u16, u16) = (24, 4);

/// Draws the panel.
pub(super) fn panel(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let remark = "o the next one, O on or off";
    let inner = framed(buffer, area, title("9 observables", remark));
    // In a narrow window the list stands above.
    let [side, main] = if inner.width >= 70 {
        Layout::horizontal([Constraint::Length(LIST), Constraint::Fill(1)]).areas(inner)
    } else {
        let rows = ObservableName::ALL.len() as u16 + 1;
        Layout::vertical([Constraint::Length(rows), Constraint::Fill(1)]).areas(inner)
    };
    for (row, name) in ObservableName::ALL.into_iter().enumerate() {
        let on = snapshot.observed(name).is_some();
        let style = if name == app.observable {
            theme::CHOSEN
        } else {
            theme::VALUE
        };
        put(buffer, side, (0, row as u16), &words(name), style);
        let (word, style) = if on {
            ("on", theme::GOOD)
        } else {
            ("off", theme::QUIET)
        };
        put_before(buffer, side, (LIST - 3, row as u16), word, style);
    }
    let Some(observed) = snapshot.observed(app.observable) else {
        let words = "Not observed, and so without cost: O begins here and now. What was found is dropped when it is \
                     switched off.";
        for (row, line) in wrap(words, main.width).iter().enumerate() {
            put(buffer, main, (0, row as u16), line, theme::QUIET);
        }
        return;
    };
    let units = snapshot.scene.units;
    let room = main.height.saturating_sub(LEAST_CURVE.1 + 2);
    let used = figures(observed, units, room.max(main.height / 2), main, buffer);
    let below = Rect {
        y: main.y + used,
        height: main.height.saturating_sub(used),
        ..main
    };
    curve(observed, Curve::of(app.observable), units, below, buffer);
}

fn words(name: ObservableName) -> String {
    name.key().replace('_', " ")
}

/// Draws at most so many rows of figures; gives back how many rows they took, with an empty one below.
fn figures(observed: &Observed, units: Units, most: u16, area: Rect, buffer: &mut Buffer) -> u16 {
    let narrow = area.width < COLUMNS.iter().sum::<u16>() + 8;
    let [names, values, theories] = if narrow {
        [area.width.saturating_sub(24), 24, 0]
    } else {
        COLUMNS
    };
    let mut row = 0;
    for figure in &observed.figures {
        if row >= most {
            break;
        }
        let name = figure.name.replace(['_', '.'], " ");
        put(
            buffer,
            area,
            (0, row),
            &shortened(&name, names),
            theme::QUIET,
        );
        let value = shown(figure, units);
        let end = (names + values, row);
        put_before(buffer, area, end, &value, theme::STRONG);
        if let Some(expected) = figure.expected {
            let theory = one(Some(expected), &figure.unit, units);
            let off = sigmas(figure.value, Some(expected), figure.standard_error)
                .or_else(|| percent_off(figure.value, Some(expected)))
                .unwrap_or_default();
            if theories > 0 {
                let end = (names + values + theories, row);
                put_before(buffer, area, end, &theory, theme::THEORY);
                put(buffer, area, (end.0 + 1, row), &off, theme::VALUE);
            } else if row + 1 < most {
                row += 1;
                let words = format!("theory {theory}  {off}");
                put_before(buffer, area, (area.width, row), &words, theme::THEORY);
            }
        }
        row += 1;
    }
    row + u16::from(row > 0)
}

/// A name in so many columns: its end says more than its beginning.
fn shortened(name: &str, columns: u16) -> String {
    let columns = usize::from(columns.saturating_sub(1));
    let count = name.chars().count();
    if count <= columns {
        return name.to_owned();
    }
    let rest = name.chars().skip(count + 1 - columns);
    std::iter::once('…').chain(rest).collect()
}

/// A figure with its error.
fn shown(figure: &Figure, units: Units) -> String {
    // A prefix before a square would be squared with it.
    if figure.unit.contains('²') {
        let error = figure.standard_error.map(|error| scientific(error, 2));
        let error = error.map_or(String::new(), |error| format!(" ±{error}"));
        let value = figure.value.map(|value| scientific(value, 4));
        return format!("{}{error} {}", value.unwrap_or(MISSING.into()), figure.unit);
    }
    let units = units_of(&figure.unit, units);
    with_error(figure.value, figure.standard_error, &figure.unit, units)
}

fn one(value: Option<f64>, unit: &str, units: Units) -> String {
    if unit.contains('²') {
        return value.map_or(MISSING.into(), |value| scientific(value, 4));
    }
    quantity(value, unit, units_of(unit, units), 4)
}

/// A bare number has no prefix in SI either.
fn units_of(unit: &str, units: Units) -> Units {
    if unit.is_empty() {
        Units::Reduced
    } else {
        units
    }
}

/// Draws the curve that the observable is known by, and what theory expects of it.
fn curve(observed: &Observed, curve: Curve, units: Units, area: Rect, buffer: &mut Buffer) {
    if area.width < LEAST_CURVE.0 || area.height < LEAST_CURVE.1 {
        return;
    }
    let place = |(x, y): (f64, f64)| {
        let place = if curve.logarithmic {
            (x.log10(), y.log10())
        } else {
            (x, y)
        };
        (place.0.is_finite() && place.1.is_finite()).then_some(place)
    };
    let points = |y: &str| -> Vec<(f64, f64)> {
        let points = observed.points(curve.x, y).into_iter();
        points.filter_map(place).collect()
    };
    let found = points(curve.y);
    let expected = if curve.expected.is_empty() {
        Vec::new()
    } else {
        points(curve.expected)
    };
    put(buffer, area, (0, 0), curve.title, theme::QUIET);
    let ends = |values: &dyn Fn(&(f64, f64)) -> f64| {
        let all = found.iter().chain(&expected).map(values);
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        })
    };
    let ((left, right), (low, high)) = (ends(&|point| point.0), ends(&|point| point.1));
    if !(left < right) {
        put(buffer, area, (2, 1), "nothing found yet", theme::QUIET);
        return;
    }
    let high = if low < high { high } else { low + 1.0 };
    let plot = Rect {
        y: area.y + 1,
        height: area.height - 2,
        ..area
    };
    let mut dots = Dots::new(plot);
    let span = (right - left, high - low);
    let dot = |&(x, y): &(f64, f64)| ((x - left) / span.0, (y - low) / span.1);
    dots.line(expected.iter().map(dot));
    dots.draw(plot, theme::THEORY, buffer);
    let mut dots = Dots::new(plot);
    dots.line(found.iter().map(dot));
    dots.draw(plot, theme::BAR, buffer);
    // As many digits as tell the ends apart.
    let closeness = (low.abs().max(high.abs()) / (high - low)).log10().ceil();
    let digits = (2.0 + closeness).clamp(3.0, 9.0) as usize;
    let number = |value: f64| {
        if curve.logarithmic {
            plain(10_f64.powf(value), 3)
        } else {
            plain(value, digits)
        }
    };
    let x = |value: f64| {
        let value = if curve.logarithmic {
            10_f64.powf(value)
        } else {
            value
        };
        quantity(Some(value), curve.x_unit, units, 3)
    };
    put(buffer, plot, (0, 0), &number(high), theme::QUIET);
    let last = plot.height - 1;
    put(buffer, plot, (0, last), &number(low), theme::QUIET);
    let foot = area.height - 1;
    put(buffer, area, (0, foot), &x(left), theme::QUIET);
    put_before(buffer, area, (area.width, foot), &x(right), theme::QUIET);
    if !expected.is_empty() && area.width > width(curve.title) + 12 {
        put_before(buffer, area, (area.width, 0), "theory", theme::THEORY);
    }
}

/// Dots of braille cells.
struct Dots {
    columns: usize,
    rows: usize,
    cells: Vec<u8>,
}

impl Dots {
    fn new(plot: Rect) -> Self {
        let (columns, rows) = (usize::from(plot.width), usize::from(plot.height));
        Self {
            columns,
            rows,
            cells: vec![0; columns * rows],
        }
    }

    /// Straight lines through points given as shares of width and height.
    fn line(&mut self, points: impl Iterator<Item = (f64, f64)>) {
        let (wide, high) = (2 * self.columns - 1, 4 * self.rows - 1);
        let mut before: Option<(f64, f64)> = None;
        for (x, y) in points {
            let to = (x * wide as f64, (1.0 - y) * high as f64);
            let from = before.replace(to).unwrap_or(to);
            let steps = (to.0 - from.0).abs().max((to.1 - from.1).abs()).ceil();
            for step in 0..=steps as usize {
                let part = step as f64 / steps.max(1.0);
                let column = (from.0 + (to.0 - from.0) * part).round() as usize;
                let row = (from.1 + (to.1 - from.1) * part).round() as usize;
                let (column, row) = (column.min(wide), row.min(high));
                self.cells[row / 4 * self.columns + column / 2] |= braille_dot(column % 2, row % 4);
            }
        }
    }

    fn draw(&self, plot: Rect, style: ratatui::style::Style, buffer: &mut Buffer) {
        for (cell, dots) in self
            .cells
            .iter()
            .enumerate()
            .filter(|(_, dots)| **dots != 0)
        {
            let glyph = char::from_u32(0x2800 + u32::from(*dots)).unwrap_or(' ');
            let at = ((cell % self.columns) as u16, (cell / self.columns) as u16);
            put(buffer, plot, at, glyph.encode_utf8(&mut [0; 4]), style);
        }
    }
}
