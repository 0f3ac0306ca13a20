//! Charts of every observable over the run, or over a part of it.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::chart::{self, Series};
use super::now;
use super::text::{framed_with_foot, put, put_before, title, width};
use crate::snapshot::Observable as O;
use crate::snapshot::{Snapshot, Units};
use crate::tui::app::App;
use crate::tui::format::{bytes, percent_off, plain, quantity, relative, scientific, si};
use crate::tui::theme;

/// Rows of a chart with its heading, at least and at most.
const ROWS: (u16, u16) = (4, 12);
/// Columns from which on charts stand in two columns.
const TWO_COLUMNS: u16 = 110;

/// An observable as the panel shows it.
struct Chart {
    observable: O,
    label: &'static str,
    expected: Option<f64>,
    write: Box<dyn Fn(f64) -> String>,
}

/// Draws the panel.
pub(super) fn panel(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let words = now::span_words(app, snapshot);
    let remark = if words.is_empty() {
        "the whole run"
    } else {
        &words
    };
    let foot = " line: mean, shade: lowest to highest · [ ] span  < > past  0 now  m mark ";
    let inner = framed_with_foot(buffer, area, title("5 history", remark), foot);
    let charts = charts(snapshot);
    let columns = if inner.width >= TWO_COLUMNS { 2 } else { 1 };
    let room = inner.height.saturating_sub(1) / ROWS.0;
    let shown = charts.len().min(usize::from(room * columns));
    let rows = (shown as u16).div_ceil(columns).max(1);
    let height = (inner.height.saturating_sub(1) / rows).clamp(ROWS.0, ROWS.1);
    let gap = 2 * (columns - 1);
    let each = inner.width.saturating_sub(gap) / columns;
    let marks = app.marks();
    for (index, chart) in charts.iter().take(shown).enumerate() {
        let (column, row) = (index as u16 / rows, index as u16 % rows);
        let place = Rect {
            x: inner.x + column * (each + 2),
            y: inner.y + row * height,
            width: each,
            height,
        }
        .intersection(inner);
        draw(app, snapshot, chart, &marks, place, buffer);
    }
    let series = series(app, snapshot, &charts[0]);
    let Some((from, to)) = chart::time_ends(&series, each) else {
        return;
    };
    let time = |time: f64| quantity(Some(time), "s", snapshot.scene.units, 3);
    for column in 0..columns {
        let axis = Rect {
            x: inner.x + column * (each + 2),
            y: inner.y + rows * height,
            width: each,
            height: 1,
        }
        .intersection(inner);
        chart::time_axis(&time(from), &time(to), axis, buffer);
    }
}

fn series<'a>(app: &App, snapshot: &'a Snapshot, chart: &Chart) -> Series<'a> {
    Series {
        history: &snapshot.history,
        observable: chart.observable,
        span: now::span(app, snapshot),
        expected: chart.expected,
    }
}

fn draw(
    app: &App,
    snapshot: &Snapshot,
    chart: &Chart,
    marks: &[f64],
    area: Rect,
    buffer: &mut Buffer,
) {
    let series = series(app, snapshot, chart);
    let column = put(buffer, area, (0, 0), chart.label, theme::QUIET);
    let whole = now::span(app, snapshot)
        .and_then(|span| snapshot.history.columns(chart.observable, span, 1)[0]);
    if let Some(range) = whole {
        let off = percent_off(Some(range.mean), chart.expected);
        let off = off.map_or(String::new(), |off| format!(", {off} off theory"));
        let ends = format!(
            "{} to {}",
            (chart.write)(range.low),
            (chart.write)(range.high)
        );
        let mean = format!("mean {}", (chart.write)(range.mean));
        let fitting = [
            format!("{ends}, {mean}{off}"),
            format!("{ends}, {mean}"),
            ends,
        ];
        let fits = |words: &&String| column + 2 + width(words) <= area.width;
        let words = fitting.iter().find(fits).unwrap_or(&mean);
        let room = Rect {
            x: area.x + (column + 2).min(area.width),
            width: area.width.saturating_sub(column + 2),
            ..area
        };
        put_before(buffer, room, (room.width, 0), words, theme::VALUE);
    }
    let plot = Rect {
        y: area.y + 1,
        height: area.height.saturating_sub(1),
        ..area
    };
    chart::chart(&series, marks, &*chart.write, plot, buffer);
}

/// The observables, the most wanted first; those that the run does not have are left out.
fn charts(snapshot: &Snapshot) -> Vec<Chart> {
    let units = snapshot.scene.units;
    let expected = snapshot.expected;
    let with = move |unit: &'static str| -> Box<dyn Fn(f64) -> String> {
        Box::new(move |value| quantity(Some(value), unit, units, 4))
    };
    let small = || -> Box<dyn Fn(f64) -> String> { Box::new(|value| relative(Some(value))) };
    let rate = || -> Box<dyn Fn(f64) -> String> {
        Box::new(move |value| match units {
            Units::Si => scientific(value, 4),
            Units::Reduced => plain(value, 4),
        })
    };
    let chart = |observable, label, expected, write| Chart {
        observable,
        label,
        expected,
        write,
    };
    let all = vec![
        chart(O::Temperature, "temperature", None, with("K")),
        chart(
            O::PressureWall,
            "wall pressure",
            expected.pressure,
            with("Pa"),
        ),
        chart(O::PairRate, "collisions", expected.pair_rate, rate()),
        chart(
            O::QueueLength,
            "queue",
            None,
            Box::new(|value| si(value, "", 4)),
        ),
        chart(
            O::PressureVirial,
            "virial pressure",
            expected.pressure,
            with("Pa"),
        ),
        chart(
            O::CompressibilityFactor,
            "Z = p V / N k T",
            None,
            Box::new(|value| plain(value, 5)),
        ),
        chart(O::WallRate, "wall hits", expected.wall_rate, rate()),
        chart(
            O::SpeedDeviation,
            "KS of critical",
            None,
            Box::new(|value| plain(value, 3)),
        ),
        chart(O::EnergyDrift, "energy drift", None, small()),
        chart(O::MomentumDrift, "momentum drift", None, small()),
        chart(O::MaxOverlap, "largest overlap", None, small()),
        chart(
            O::Speed,
            "collisions per wall second",
            None,
            Box::new(|value| si(value, "", 3)),
        ),
        chart(
            O::Memory,
            "memory",
            None,
            Box::new(|value| bytes(Some(value as u64))),
        ),
    ];
    let bounds = snapshot.history.bounds();
    all.into_iter()
        .filter(|chart| {
            let known = || snapshot.history.columns(chart.observable, bounds?, 1)[0];
            chart.observable == O::Temperature || bounds.is_none() || known().is_some()
        })
        .collect()
}
