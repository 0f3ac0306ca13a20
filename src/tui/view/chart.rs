//! Histories: a row of bars, or a chart with axes when there is room.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;

use super::text::{put, put_before};
use crate::tui::theme;

/// A quantity over simulated time.
pub(super) struct Series {
    /// Times and values, oldest first.
    pub points: Vec<(f64, f64)>,
    /// What theory expects, if anything.
    pub expected: Option<f64>,
}

/// Bars of an eighth of a row each.
pub(super) const BARS: [&str; 8] = ["▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"];
/// Least height of the value axis relative to the values: round-off must not look like a storm.
const CALM: f64 = 0.02;
/// Columns that one mean of a chart takes: straight lines run between them, as noise is not news.
const KNOT: usize = 2;
/// Columns of the labels at the value axis.
const LABELS: u16 = 10;

/// Draws one row of bars.
pub(super) fn sparkline(series: &Series, area: Rect, buffer: &mut Buffer) {
    let columns = Columns::of(&series.points, usize::from(area.width)).values;
    let Some((low, high)) = range(&columns, series.expected) else {
        return;
    };
    for (column, value) in columns.iter().enumerate() {
        let level = ((value - low) / (high - low) * 7.0).round().clamp(0.0, 7.0) as usize;
        put(buffer, area, (column as u16, 0), BARS[level], theme::BAR);
    }
}

/// Draws a line over a value axis; `label` writes a value of the axis.
pub(super) fn chart(
    series: &Series,
    label: &dyn Fn(f64) -> String,
    area: Rect,
    buffer: &mut Buffer,
) {
    if area.height < 2 || area.width < LABELS + 8 {
        sparkline(series, area, buffer);
        return;
    }
    let plot = Rect {
        x: area.x + LABELS + 1,
        width: area.width - LABELS - 1,
        ..area
    };
    let knots = Columns::of(&series.points, usize::from(plot.width) / KNOT).values;
    let Some((low, high)) = range(&knots, None).and(range(&knots, series.expected)) else {
        put(buffer, area, (2, 0), "no history yet", theme::QUIET);
        return;
    };
    for row in 0..area.height {
        let end = row == 0 || row + 1 == area.height;
        let tick = if end { "┤" } else { "│" };
        put(buffer, area, (LABELS, row), tick, theme::FRAME);
    }
    put_before(buffer, area, (LABELS, 0), &label(high), theme::QUIET);
    put_before(
        buffer,
        area,
        (LABELS, area.height - 1),
        &label(low),
        theme::QUIET,
    );
    let dots = 4 * usize::from(plot.height);
    let height_of = |value: f64| {
        let height = (value - low) / (high - low) * (dots - 1) as f64;
        (height.round().max(0.0) as usize).min(dots - 1)
    };
    if let Some(expected) = series.expected {
        let row = plot.height - 1 - (height_of(expected) / 4) as u16;
        for column in (0..plot.width).step_by(2) {
            put(buffer, plot, (column, row), "╌", theme::THEORY);
        }
    }
    let mut cells = vec![0_u8; usize::from(plot.width) * usize::from(plot.height)];
    let mut before: Option<usize> = None;
    for (column, value) in lines_between(&knots, 2 * KNOT).enumerate() {
        let height = height_of(value);
        let start = before.unwrap_or(height);
        // Each column reaches to its neighbour, so that the line has no gaps.
        for dot in start.min(height)..=start.max(height) {
            let down = dots - 1 - dot;
            cells[down / 4 * usize::from(plot.width) + column / 2] |=
                braille_dot(column % 2, down % 4);
        }
        before = Some(height);
    }
    for (cell, dots) in cells.iter().enumerate().filter(|(_, dots)| **dots != 0) {
        let glyph = char::from_u32(0x2800 + u32::from(*dots))
            .unwrap_or(' ')
            .to_string();
        let at = (cell as u16 % plot.width, cell as u16 / plot.width);
        put(buffer, plot, at, &glyph, theme::BAR);
    }
}

/// Values on straight lines from knot to knot, `steps` to each.
fn lines_between(knots: &[f64], steps: usize) -> impl Iterator<Item = f64> {
    let last = knots.len().saturating_sub(1);
    let count = if knots.is_empty() {
        0
    } else {
        steps * last + 1
    };
    (0..count).map(move |index| {
        let (from, part) = (index / steps, (index % steps) as f64 / steps as f64);
        let to = (from + 1).min(last);
        knots[from] + (knots[to] - knots[from]) * part
    })
}

/// First and last moment of the time axis of charts so wide.
pub(super) fn time_ends(points: &[(f64, f64)], width: u16) -> Option<(f64, f64)> {
    let room = usize::from(width.saturating_sub(LABELS + 1)) / KNOT;
    let columns = Columns::of(points, room);
    let whole = columns.width * room as f64;
    (!columns.values.is_empty()).then_some((columns.start, columns.start + whole))
}

/// Draws the time axis below charts.
pub(super) fn time_axis(from: &str, to: &str, area: Rect, buffer: &mut Buffer) {
    let style: Style = theme::FRAME;
    put_before(buffer, area, (LABELS, 0), "time", theme::QUIET);
    put(buffer, area, (LABELS, 0), "└", style);
    for column in LABELS + 1..area.width {
        put(buffer, area, (column, 0), "─", style);
    }
    put(
        buffer,
        area,
        (LABELS + 2, 0),
        &format!(" {from} "),
        theme::QUIET,
    );
    put_before(
        buffer,
        area,
        (area.width.saturating_sub(1), 0),
        &format!(" {to} "),
        theme::QUIET,
    );
}

/// Dot of a braille cell, by column and row from the upper left. Source: the Unicode standard, block 2800.
fn braille_dot(column: usize, row: usize) -> u8 {
    [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]][row][column]
}

/// Means over equal spans of time, oldest first.
///
/// Always holds: a new point changes the last span or adds one behind it; only when the room is full do the spans grow, by
/// steps, and all change at once. So a chart rests while it grows, and takes few bytes.
pub(super) struct Columns {
    /// The mean over each span; one without a point has the mean of the next, as a point covers the time before it.
    pub values: Vec<f64>,
    /// Where the first span begins.
    pub start: f64,
    /// How long a span is.
    pub width: f64,
}

impl Columns {
    /// The means over as many spans as there is room for, or somewhat fewer.
    pub fn of(points: &[(f64, f64)], room: usize) -> Self {
        let good = || {
            let finite = |point: &&(f64, f64)| point.0.is_finite() && point.1.is_finite();
            points.iter().filter(finite)
        };
        let first = good().map(|point| point.0).reduce(f64::min);
        let last = good().map(|point| point.0).reduce(f64::max);
        let (Some(first), Some(last), true) = (first, last, room > 0) else {
            return Self {
                values: Vec::new(),
                start: 0.0,
                width: 0.0,
            };
        };
        let width = width_of_spans(first, last, room);
        let start = (first / width).floor();
        let place = |time: f64| ((time / width).floor() - start).clamp(0.0, (room - 1) as f64);
        let mut sums = vec![(0.0, 0_u32); place(last) as usize + 1];
        for (time, value) in good() {
            let sum = &mut sums[place(*time) as usize];
            *sum = (sum.0 + value, sum.1 + 1);
        }
        let mut next = 0.0;
        for sum in sums.iter_mut().rev() {
            if sum.1 > 0 {
                next = sum.0 / f64::from(sum.1);
            }
            sum.0 = next;
        }
        Self {
            values: sums.into_iter().map(|(mean, _)| mean).collect(),
            start: start * width,
            width,
        }
    }
}

/// Length of the spans: a power of two times 4, 5, 6 or 7, so that it seldom changes and still fills most of the room.
fn width_of_spans(first: f64, last: f64, room: usize) -> f64 {
    let least = ((last - first) / room as f64).max(last.abs() * 1e-9);
    if !least.is_normal() {
        return 1.0;
    }
    let power = least.log2().floor() as i32 - 2;
    let fits = |width: &f64| (last / width).floor() - (first / width).floor() < room as f64;
    (power..power + 4)
        .flat_map(|power| [4.0, 5.0, 6.0, 7.0].map(|digit| digit * 2_f64.powi(power)))
        .filter(|width| *width >= least)
        .find(fits)
        .unwrap_or(4.0 * least)
}

/// Ends of the value axis around values and expectation: round numbers, so that they rest while the values move.
fn range(values: &[f64], expected: Option<f64>) -> Option<(f64, f64)> {
    let all = || {
        let expected = expected.filter(|value| value.is_finite());
        values.iter().copied().chain(expected)
    };
    let low = all().reduce(f64::min)?;
    let high = all().reduce(f64::max)?;
    let middle = f64::midpoint(low, high);
    let half = (0.5 * (high - low))
        .max(0.5 * CALM * middle.abs())
        .max(f64::MIN_POSITIVE);
    let step = round_above(half / 4.0);
    let low = ((middle - half) / step).floor() * step;
    let high = ((middle + half) / step).ceil() * step;
    (low.is_finite() && high.is_finite() && high > low).then_some((low, high))
}

/// The least of 1, 2, 5 times a power of ten that is not below a number.
fn round_above(value: f64) -> f64 {
    let power = 10_f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0]
        .map(|digit| digit * power)
        .into_iter()
        .find(|step| *step >= value)
        .unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_without_a_point_shows_the_next() {
        assert_eq!(
            Columns::of(&[(0.0, 1.0), (4.0, 5.0)], 5).values,
            [1.0, 5.0, 5.0, 5.0, 5.0]
        );
    }

    #[test]
    fn a_lonely_point_is_one_column() {
        assert_eq!(Columns::of(&[(3.0, 7.0)], 3).values, [7.0]);
    }

    #[test]
    fn a_new_point_changes_the_last_column_only_or_all_of_them_rarely() {
        let value = |i: i32| (f64::from(i), f64::from(i * i % 7));
        let mut points = vec![value(0)];
        let mut before = Columns::of(&points, 30);
        let mut rescaled = 0;
        for i in 1..2000 {
            points.push(value(i));
            let after = Columns::of(&points, 30);
            let kept = before.values.len() - 1;
            assert!(after.values.len() <= 30);
            if after.width == before.width {
                assert_eq!(after.values[..kept], before.values[..kept], "{i}");
            } else {
                rescaled += 1;
                assert!(after.values.len() > 20, "{i}");
            }
            before = after;
        }
        assert!(rescaled < 50, "{rescaled}"); // four times for each doubling
    }

    #[test]
    fn many_points_are_averaged() {
        let points: Vec<_> = (0..=1000)
            .map(|i| (f64::from(i), f64::from(i % 2)))
            .collect();
        let values = Columns::of(&points, 11).values;
        let whole = &values[..values.len() - 1];
        assert!(whole.iter().all(|value| (value - 0.5).abs() < 0.01));
    }

    #[test]
    fn hostile_points_make_no_values() {
        assert!(Columns::of(&[(f64::NAN, 1.0)], 3).values.is_empty());
        assert!(Columns::of(&[(1.0, 1.0)], 0).values.is_empty());
        for pair in [
            [1.0, 1.0],
            [-1e300, 1e300],
            [1e-300, 0.0],
            [1e9, 1e9 + 1e-9],
        ] {
            let points = pair.map(|time| (time, 1.0));
            assert!((1..=9).contains(&Columns::of(&points, 9).values.len()));
        }
    }

    #[test]
    fn round_off_does_not_fill_the_axis() {
        let (low, high) = range(&[100.0, 100.0 + 1e-12], None).unwrap();
        assert!(high - low > 1.0);
    }

    #[test]
    fn the_axis_ends_at_round_numbers() {
        assert_eq!(range(&[273.1, 273.2], None), Some((270.0, 276.0)));
    }
}
