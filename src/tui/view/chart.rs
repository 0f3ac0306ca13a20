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
/// Columns of the labels at the value axis.
const LABELS: u16 = 10;

/// Draws one row of bars.
pub(super) fn sparkline(series: &Series, area: Rect, buffer: &mut Buffer) {
    let columns = resample(&series.points, usize::from(area.width));
    let Some((low, high)) = range(&columns, series.expected) else {
        return;
    };
    for (column, value) in columns.iter().enumerate() {
        let Some(value) = value else { continue };
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
    // A mean over two cells, and straight lines between: noise is not news.
    let knots = resample(&series.points, usize::from(plot.width) / 2);
    let Some((low, high)) = range(&knots, None).and(range(&knots, series.expected)) else {
        put(buffer, area, (2, 0), "no history yet", theme::QUIET);
        return;
    };
    for row in 0..area.height {
        let end = row == 0 || row + 1 == area.height;
        let tick = if end { "┤" } else { "│" };
        put(buffer, area, (LABELS, row), tick, theme::QUIET);
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
    for (column, value) in lines_between(&knots, 2 * usize::from(plot.width)).enumerate() {
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

/// Values on straight lines from the first knot to the last.
fn lines_between(knots: &[Option<f64>], count: usize) -> impl Iterator<Item = f64> {
    let knots: Vec<f64> = knots.iter().copied().flatten().collect();
    let count = if knots.is_empty() { 0 } else { count };
    (0..count).map(move |index| {
        let place = index as f64 / (count.max(2) - 1) as f64 * (knots.len() - 1) as f64;
        let from = place as usize;
        let to = (from + 1).min(knots.len() - 1);
        knots[from] + (knots[to] - knots[from]) * place.fract()
    })
}

/// Draws the time axis below charts.
pub(super) fn time_axis(from: &str, to: &str, area: Rect, buffer: &mut Buffer) {
    let style: Style = theme::QUIET;
    put_before(buffer, area, (LABELS, 0), "time", style);
    put(buffer, area, (LABELS, 0), "└", style);
    for column in LABELS + 1..area.width {
        put(buffer, area, (column, 0), "─", style);
    }
    put(buffer, area, (LABELS + 2, 0), &format!(" {from} "), style);
    put_before(
        buffer,
        area,
        (area.width.saturating_sub(1), 0),
        &format!(" {to} "),
        style,
    );
}

/// Dot of a braille cell, by column and row from the upper left. Source: the Unicode standard, block 2800.
fn braille_dot(column: usize, row: usize) -> u8 {
    [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]][row][column]
}

/// Means over equal spans of time. A point covers the time since the point before it, so a span without a point shows the
/// next one.
pub(super) fn resample(points: &[(f64, f64)], columns: usize) -> Vec<Option<f64>> {
    let good = || {
        points
            .iter()
            .filter(|(time, value)| time.is_finite() && value.is_finite())
    };
    let mut sums = vec![(0.0, 0_u32); columns];
    let (Some(first), Some(last), true) = (good().next(), good().next_back(), columns > 0) else {
        return vec![None; columns];
    };
    let span = (last.0 - first.0).max(f64::MIN_POSITIVE);
    for (time, value) in good() {
        let place = ((time - first.0) / span * (columns - 1) as f64).ceil();
        let sum = &mut sums[(place.max(0.0) as usize).min(columns - 1)];
        *sum = (sum.0 + value, sum.1 + 1);
    }
    let mut next = None;
    let mut means: Vec<_> = sums
        .into_iter()
        .rev()
        .map(|(sum, count)| {
            if count > 0 {
                next = Some(sum / f64::from(count));
            }
            next
        })
        .collect();
    means.reverse();
    means
}

/// Ends of the value axis around values and expectation.
fn range(values: &[Option<f64>], expected: Option<f64>) -> Option<(f64, f64)> {
    let all = || {
        values
            .iter()
            .copied()
            .flatten()
            .chain(expected.filter(|value| value.is_finite()))
    };
    let low = all().reduce(f64::min)?;
    let high = all().reduce(f64::max)?;
    let middle = f64::midpoint(low, high);
    let half = (0.55 * (high - low))
        .max(0.5 * CALM * middle.abs())
        .max(f64::MIN_POSITIVE);
    (half.is_finite() && middle.is_finite()).then_some((middle - half, middle + half))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_without_a_point_shows_the_next() {
        let points = [(0.0, 1.0), (4.0, 5.0)];
        let values: Vec<f64> = resample(&points, 5).into_iter().flatten().collect();
        assert_eq!(values, [1.0, 5.0, 5.0, 5.0, 5.0]);
    }

    #[test]
    fn many_points_are_averaged() {
        let points: Vec<_> = (0..=1000)
            .map(|i| (f64::from(i), f64::from(i % 2)))
            .collect();
        let values = resample(&points, 11);
        assert!(
            values[1..]
                .iter()
                .all(|value| (value.unwrap() - 0.5).abs() < 0.01)
        );
    }

    #[test]
    fn hostile_points_make_no_values() {
        assert_eq!(resample(&[(f64::NAN, 1.0)], 3), [None; 3]);
        assert_eq!(resample(&[(1.0, 1.0)], 0), []);
    }

    #[test]
    fn round_off_does_not_fill_the_axis() {
        let (low, high) = range(&[Some(100.0), Some(100.0 + 1e-12)], None).unwrap();
        assert!(high - low > 1.0);
    }
}
