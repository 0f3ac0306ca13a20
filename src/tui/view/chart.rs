//! Histories: a row of bars, or a chart with axes when there is room.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::text::{put, put_before};
use crate::snapshot::{History, Observable, Range};
use crate::tui::theme;

/// A quantity over simulated time.
pub(super) struct Series<'a> {
    /// The history of the run.
    pub history: &'a History,
    /// Which observable.
    pub observable: Observable,
    /// Beginning and end of what is shown; `None` while there is no history.
    pub span: Option<(f64, f64)>,
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
    let values = Columns::of(series, usize::from(area.width)).values;
    let means: Vec<f64> = values.iter().flatten().map(|range| range.mean).collect();
    let Some((low, high)) = axis(&means, series.expected) else {
        return;
    };
    for (column, value) in values.iter().enumerate() {
        let Some(value) = value else { continue };
        let share = (value.mean - low) / (high - low);
        let level = (share * 7.0).round().clamp(0.0, 7.0) as usize;
        put(buffer, area, (column as u16, 0), BARS[level], theme::BAR);
    }
}

/// Draws a line over a value axis, and behind it how far the values reach; `label` writes a value of the axis.
pub(super) fn chart(
    series: &Series,
    marks: &[f64],
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
    let columns = Columns::of(series, usize::from(plot.width) / KNOT);
    let known: Vec<Range> = columns.values.iter().flatten().copied().collect();
    // What lies far outside must not press the line flat: the axis is made for the means.
    let means: Vec<f64> = known.iter().map(|range| range.mean).collect();
    let Some((low, high)) = axis(&means, series.expected).filter(|_| !means.is_empty()) else {
        put(buffer, area, (2, 0), "no history yet", theme::QUIET);
        return;
    };
    for row in 0..area.height {
        let end = row == 0 || row + 1 == area.height;
        let tick = if end { "┤" } else { "│" };
        put(buffer, area, (LABELS, row), tick, theme::FRAME);
    }
    let last = area.height - 1;
    put_before(buffer, area, (LABELS, 0), &label(high), theme::QUIET);
    put_before(buffer, area, (LABELS, last), &label(low), theme::QUIET);
    let scale = Scale {
        low,
        high,
        dots: 4 * usize::from(plot.height),
    };
    reach(&columns, &scale, plot, buffer);
    for time in marks {
        let place = (time - columns.start) / columns.width;
        if (0.0..columns.values.len() as f64).contains(&place) {
            for row in 0..plot.height {
                let at = ((place * KNOT as f64) as u16, row);
                put(buffer, plot, at, "┊", theme::THEORY);
            }
        }
    }
    if let Some(expected) = series.expected.filter(|value| value.is_finite()) {
        let row = plot.height - 1 - (scale.height(expected) / 4) as u16;
        for column in (0..plot.width).step_by(2) {
            put(buffer, plot, (column, row), "╌", theme::THEORY);
        }
    }
    line(&columns, &scale, plot, buffer);
}

/// From values to dots above the foot of a chart.
struct Scale {
    low: f64,
    high: f64,
    dots: usize,
}

impl Scale {
    fn height(&self, value: f64) -> usize {
        let height = (value - self.low) / (self.high - self.low) * (self.dots - 1) as f64;
        (height.round().max(0.0) as usize).min(self.dots - 1)
    }
}

/// Shades from the lowest to the highest value of each column, where that is more than the line itself.
fn reach(columns: &Columns, scale: &Scale, plot: Rect, buffer: &mut Buffer) {
    for (index, range) in columns.values.iter().enumerate() {
        let Some(range) = range else { continue };
        let (from, to) = (scale.height(range.low) / 4, scale.height(range.high) / 4);
        if from == to {
            continue;
        }
        for row in from..=to {
            for part in 0..KNOT {
                let at = ((index * KNOT + part) as u16, plot.height - 1 - row as u16);
                put(buffer, plot, at, "░", theme::FRAME);
            }
        }
    }
}

/// Draws straight lines from mean to mean in braille.
fn line(columns: &Columns, scale: &Scale, plot: Rect, buffer: &mut Buffer) {
    let width = usize::from(plot.width);
    let mut cells = vec![0_u8; width * usize::from(plot.height)];
    let mut before: Option<usize> = None;
    for (column, value) in columns.line(2 * KNOT).into_iter().enumerate() {
        let Some(value) = value else {
            before = None;
            continue;
        };
        let height = scale.height(value);
        let start = before.unwrap_or(height);
        // Each column reaches to its neighbour, so that the line has no gaps.
        for dot in start.min(height)..=start.max(height) {
            let down = scale.dots - 1 - dot;
            cells[down / 4 * width + column / 2] |= braille_dot(column % 2, down % 4);
        }
        before = Some(height);
    }
    for (cell, dots) in cells.iter().enumerate().filter(|(_, dots)| **dots != 0) {
        let glyph = char::from_u32(0x2800 + u32::from(*dots)).unwrap_or(' ');
        let at = ((cell % width) as u16, (cell / width) as u16);
        put(buffer, plot, at, glyph.encode_utf8(&mut [0; 4]), theme::BAR);
    }
}

/// First and last moment of the time axis of charts so wide.
pub(super) fn time_ends(series: &Series, width: u16) -> Option<(f64, f64)> {
    let room = usize::from(width.saturating_sub(LABELS + 1)) / KNOT;
    let columns = Columns::of(series, room);
    let whole = columns.width * room as f64;
    (!columns.values.is_empty()).then_some((columns.start, columns.start + whole))
}

/// Draws the time axis below charts.
pub(super) fn time_axis(from: &str, to: &str, area: Rect, buffer: &mut Buffer) {
    put_before(buffer, area, (LABELS, 0), "time", theme::QUIET);
    put(buffer, area, (LABELS, 0), "└", theme::FRAME);
    for column in LABELS + 1..area.width {
        put(buffer, area, (column, 0), "─", theme::FRAME);
    }
    let from = format!(" {from} ");
    put(buffer, area, (LABELS + 2, 0), &from, theme::QUIET);
    let end = area.width.saturating_sub(1);
    put_before(buffer, area, (end, 0), &format!(" {to} "), theme::QUIET);
}

/// Dot of a braille cell, by column and row from the upper left. Source: the Unicode standard, block 2800.
pub(super) fn braille_dot(column: usize, row: usize) -> u8 {
    [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]][row][column]
}

/// Lowest, mean and highest value over equal spans of time, oldest first.
///
/// Always holds: a new stretch of the history changes the last span or adds one behind it; only when the room is full do the
/// spans grow, by steps, and all change at once. So a chart rests while it grows, and takes few bytes.
struct Columns {
    /// The values of each span; `None` where there are none.
    values: Vec<Option<Range>>,
    /// Where the first span begins.
    start: f64,
    /// How long a span is.
    width: f64,
}

impl Columns {
    /// As many spans as there is room for, or somewhat fewer.
    fn of(series: &Series, room: usize) -> Self {
        let finite = |(from, to): &(f64, f64)| from.is_finite() && to.is_finite() && from < to;
        let Some((from, to)) = series.span.filter(finite).filter(|_| room > 0) else {
            return Self {
                values: Vec::new(),
                start: 0.0,
                width: 0.0,
            };
        };
        let width = width_of_spans(from, to, room);
        let first = (from / width).floor();
        let count = ((to / width).ceil() - first).clamp(1.0, room as f64);
        let (start, count) = (first * width, count as usize);
        let end = start + count as f64 * width;
        let mut values = series
            .history
            .columns(series.observable, (start, end), count);
        for value in &mut values {
            *value = value.filter(|range| {
                range.low.is_finite() && range.mean.is_finite() && range.high.is_finite()
            });
        }
        Self {
            values,
            start,
            width,
        }
    }

    /// Values on straight lines from span to span, `steps` to each; none beside a span without values.
    fn line(&self, steps: usize) -> Vec<Option<f64>> {
        let means: Vec<Option<f64>> = self
            .values
            .iter()
            .map(|range| range.map(|range| range.mean))
            .collect();
        let last = means.len().saturating_sub(1);
        let count = if means.is_empty() {
            0
        } else {
            steps * last + 1
        };
        let value = |index: usize| {
            let (from, part) = (index / steps, (index % steps) as f64 / steps as f64);
            let (here, next) = (means[from]?, means[(from + 1).min(last)]);
            match next {
                Some(next) => Some(here + (next - here) * part),
                None => (part == 0.0).then_some(here),
            }
        };
        (0..count).map(value).collect()
    }
}

/// Length of the spans: a power of two times 4, 5, 6 or 7, so that it seldom changes and still fills most of the room.
fn width_of_spans(first: f64, last: f64, room: usize) -> f64 {
    let least = ((last - first) / room as f64).max(last.abs() * 1e-9);
    if !least.is_normal() {
        return 1.0;
    }
    let power = least.log2().floor() as i32 - 2;
    let fits = |width: &f64| (last / width).ceil() - (first / width).floor() <= room as f64;
    (power..power + 4)
        .flat_map(|power| [4.0, 5.0, 6.0, 7.0].map(|digit| digit * 2_f64.powi(power)))
        .filter(|width| *width >= least)
        .find(fits)
        .unwrap_or(4.0 * least)
}

/// Ends of the value axis around values and expectation: round numbers, so that they rest while the values move.
fn axis(values: &[f64], expected: Option<f64>) -> Option<(f64, f64)> {
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
    use crate::snapshot::Stretch;

    /// A history of stretches of length one.
    fn history(values: impl IntoIterator<Item = f64>) -> History {
        let mut history = History::default();
        for (index, value) in values.into_iter().enumerate() {
            let begin = index as f64;
            let stretch = Stretch::new(begin, begin + 1.0, begin);
            history.push(stretch.with(Observable::Temperature, Some(value)));
        }
        history
    }

    fn columns(history: &History, room: usize) -> Columns {
        let series = Series {
            history,
            observable: Observable::Temperature,
            span: history.bounds(),
            expected: None,
        };
        Columns::of(&series, room)
    }

    fn means(columns: &Columns) -> Vec<f64> {
        columns
            .values
            .iter()
            .flatten()
            .map(|range| range.mean)
            .collect()
    }

    #[test]
    fn a_lonely_stretch_fills_the_room() {
        let columns = columns(&history([7.0]), 8);
        assert_eq!(means(&columns), [7.0; 8]);
    }

    #[test]
    fn a_new_stretch_changes_the_last_column_only_or_all_of_them_rarely() {
        let mut history = History::default();
        let mut before = columns(&history, 30);
        let mut rescaled = 0;
        for i in 0..400 {
            let begin = f64::from(i);
            let stretch = Stretch::new(begin, begin + 1.0, begin);
            history.push(stretch.with(Observable::Temperature, Some(f64::from(i * i % 7))));
            let after = columns(&history, 30);
            let kept = before.values.len().saturating_sub(1);
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
    fn many_stretches_are_averaged_and_keep_their_extremes() {
        let columns = columns(&history((0..1000).map(|i| f64::from(i % 2))), 11);
        let whole = &columns.values[..columns.values.len() - 1];
        for range in whole.iter().flatten() {
            assert!((range.mean - 0.5).abs() < 0.02);
            assert_eq!((range.low, range.high), (0.0, 1.0));
        }
    }

    #[test]
    fn hostile_spans_make_no_values() {
        let history = history([1.0, 2.0]);
        for span in [
            (f64::NAN, 1.0),
            (1.0, 1.0),
            (2.0, 1.0),
            (0.0, f64::INFINITY),
        ] {
            let series = Series {
                history: &history,
                observable: Observable::Temperature,
                span: Some(span),
                expected: None,
            };
            assert!(Columns::of(&series, 9).values.is_empty());
        }
        assert!(columns(&history, 0).values.is_empty());
    }

    #[test]
    fn round_off_does_not_fill_the_axis() {
        let (low, high) = axis(&[100.0, 100.0 + 1e-12], None).unwrap();
        assert!(high - low > 1.0);
    }

    #[test]
    fn the_axis_ends_at_round_numbers() {
        assert_eq!(axis(&[273.1, 273.2], None), Some((270.0, 276.0)));
    }
}
