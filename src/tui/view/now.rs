//! The state of the gas: each quantity with its error, what theory expects, and its history.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::chart::{self, Series};
use super::text::{framed, put, put_before, title};
use crate::snapshot::{Observable, Snapshot, Units};
use crate::tui::app::App;
use crate::tui::format::{
    MISSING, count, percent_off, plain, quantity, scientific, si, sigmas, with_error,
};
use crate::tui::span::Span;
use crate::tui::theme;

/// A quantity with its history.
pub(super) struct Entry<'a> {
    /// Its name.
    pub label: &'static str,
    /// Its value now.
    pub value: String,
    /// What theory says of it, if anything.
    pub theory: String,
    /// A second remark beside the theory.
    pub remark: String,
    /// Its history.
    pub series: Series<'a>,
    /// Writes a value of the axis.
    pub axis: Box<dyn Fn(f64) -> String>,
}

/// Rows of a chart from which on it deserves axes.
const CHART: u16 = 3;

/// Draws the panel.
pub(super) fn panel(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let inner = framed(buffer, area, title("2 now", &span_words(app, snapshot)));
    let entries = entries(app, snapshot);
    let marks = app.marks();
    let words: u16 = entries
        .iter()
        .map(|entry| 1 + u16::from(!entry.theory.is_empty()))
        .sum();
    let charts = inner.height.saturating_sub(words);
    let most = if app.enlarged.is_some() { 24 } else { 10 };
    let share = (charts.saturating_sub(1) / entries.len() as u16).min(most);
    let with_axes = share >= CHART;
    let mut row = 0;
    for entry in &entries {
        put(buffer, inner, (0, row), entry.label, theme::QUIET);
        put_before(
            buffer,
            inner,
            (inner.width, row),
            &entry.value,
            theme::STRONG,
        );
        row += 1;
        if !entry.theory.is_empty() {
            let known = !entry.theory.ends_with(MISSING);
            let style = if known { theme::THEORY } else { theme::QUIET };
            put(buffer, inner, (0, row), &entry.theory, style);
            put_before(
                buffer,
                inner,
                (inner.width, row),
                &entry.remark,
                theme::VALUE,
            );
            row += 1;
        }
        let height = if with_axes { share } else { 1 };
        let plot = Rect {
            y: inner.y + row,
            height,
            ..inner
        }
        .intersection(inner);
        if with_axes {
            chart::chart(&entry.series, &marks, &*entry.axis, plot, buffer);
        } else {
            chart::sparkline(&entry.series, plot, buffer);
        }
        row += height;
    }
    let ends = chart::time_ends(&entries[0].series, inner.width);
    if let (true, Some((first, last))) = (with_axes, ends) {
        let units = snapshot.scene.units;
        let axis = Rect {
            y: inner.y + row,
            height: 1,
            ..inner
        }
        .intersection(inner);
        let time = |time: f64| quantity(Some(time), "s", units, 3);
        chart::time_axis(&time(first), &time(last), axis, buffer);
    }
}

/// Beginning and end of what the charts show.
pub(super) fn span(app: &App, snapshot: &Snapshot) -> Option<(f64, f64)> {
    snapshot.history.bounds().map(|bounds| app.span.of(bounds))
}

/// Which part of the history is shown, if not all of it.
pub(super) fn span_words(app: &App, snapshot: &Snapshot) -> String {
    let Some((from, to)) = span(app, snapshot).filter(|_| app.span != Span::default()) else {
        return String::new();
    };
    let time = |time: f64| quantity(Some(time), "s", snapshot.scene.units, 3);
    if app.span.end.is_some() {
        format!("past: {} to {}", time(from), time(to))
    } else {
        format!("the last {}", time(to - from))
    }
}

/// Temperature, pressure, collision rate and queue length.
pub(super) fn entries<'a>(app: &App, snapshot: &'a Snapshot) -> [Entry<'a>; 4] {
    let span = span(app, snapshot);
    let units = snapshot.scene.units;
    let pressure = snapshot.pressure;
    let measured = pressure.wall.or(pressure.virial); // a periodic box has no walls
    let expected = snapshot.expected;
    let history = |observable: Observable, expected: Option<f64>| Series {
        history: &snapshot.history,
        observable,
        span,
        expected,
    };
    let pressure_route = if pressure.wall.is_some() {
        Observable::PressureWall
    } else {
        Observable::PressureVirial
    };
    let axis = move |unit: &'static str| -> Box<dyn Fn(f64) -> String> {
        Box::new(move |value| quantity(Some(value), unit, units, 4))
    };
    let beside = |expected: Option<f64>, write: &dyn Fn(f64) -> String| {
        format!("theory {}", expected.map_or(MISSING.into(), write))
    };
    let temperature = Entry {
        label: "temperature",
        value: quantity(snapshot.temperature, "K", units, 5),
        theory: String::new(),
        remark: String::new(),
        series: history(Observable::Temperature, None),
        axis: axis("K"),
    };
    let pressure = Entry {
        label: "pressure",
        value: with_error(measured, pressure.standard_error, "Pa", units),
        theory: beside(expected.pressure, &|value| {
            quantity(Some(value), "Pa", units, 5)
        }),
        remark: pressure_remark(snapshot, measured),
        series: history(pressure_route, expected.pressure),
        axis: axis("Pa"),
    };
    let collisions = Entry {
        label: "collisions",
        value: rate(snapshot.pair_rate, units),
        theory: beside(expected.pair_rate, &|value| rate(Some(value), units)),
        remark: percent_off(snapshot.pair_rate, expected.pair_rate).unwrap_or_default(),
        series: history(Observable::PairRate, expected.pair_rate),
        axis: Box::new(move |value| match units {
            Units::Si => scientific(value, 4),
            Units::Reduced => plain(value, 4),
        }),
    };
    let queue = Entry {
        label: "queue",
        value: match snapshot.queue_length_max {
            0 => format!("{} events", count(snapshot.queue_length)),
            peak => format!("{}, peak {}", count(snapshot.queue_length), count(peak)),
        },
        theory: String::new(),
        remark: String::new(),
        series: history(Observable::QueueLength, None),
        axis: Box::new(|value| si(value, "", 4)),
    };
    [temperature, pressure, collisions, queue]
}

/// Distance from theory, and `Z = p V / (N k T)`.
fn pressure_remark(snapshot: &Snapshot, measured: Option<f64>) -> String {
    let error = snapshot.pressure.standard_error;
    let off = sigmas(measured, snapshot.expected.pressure, error);
    let factor = format!("Z {}", factor(snapshot, 5));
    off.map_or(factor.clone(), |off| format!("{off}  {factor}"))
}

/// `p V / (N k T)`; planes cut off a part of the volume that is not known.
pub(super) fn factor(snapshot: &Snapshot, digits: usize) -> String {
    let known = snapshot.scene.planes.is_empty();
    let factor = snapshot.compressibility_factor.filter(|_| known);
    factor.map_or(MISSING.into(), |factor| plain(factor, digits))
}

/// Events per simulated time.
pub(super) fn rate(value: Option<f64>, units: Units) -> String {
    match (value, units) {
        (Some(value), Units::Si) => format!("{} per s", scientific(value, 4)),
        (value, _) => quantity(value, "", Units::Reduced, 4),
    }
}
