//! The dashboard in less than 80x24: numbers with short histories, and the picture if there is room.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::text::{put, put_before, width};
use super::{chart, footer, gas, header, now, speeds, trust};
use crate::snapshot::Snapshot;
use crate::tui::app::{App, Overlay};
use crate::tui::format::{MISSING, clock, count, quantity};
use crate::tui::theme;

/// Columns of the numbers when the picture stands beside them.
const NUMBERS: u16 = 40;
/// Rows of the numbers.
const ROWS: u16 = 10;
/// Least columns and rows of a picture.
const PICTURE: (u16, u16) = (26, 8);

/// Draws nothing but numbers, as many as fit: one row of them, or a few.
pub(super) fn bare_numbers(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let units = snapshot.scene.units;
    let question = matches!(app.overlay, Some(Overlay::QuitQuestion));
    let pressure = snapshot.pressure.wall.or(snapshot.pressure.virial);
    let parts = [
        header::state(app),
        if question {
            "leave? y n".into()
        } else {
            String::new()
        },
        header::time(snapshot),
        format!("T {}", quantity(snapshot.temperature, "K", units, 5)),
        format!("p {}", quantity(pressure, "Pa", units, 4)),
        format!("queue {}", count(snapshot.queue_length)),
        header::left(snapshot),
    ];
    let (mut column, mut row) = (0, 0);
    for part in parts.iter().filter(|part| !part.is_empty()) {
        if column > 0 && column + width(part) > area.width {
            (column, row) = (0, row + 1);
        }
        column = put(buffer, area, (column, row), part, theme::VALUE) + 2;
    }
}

/// Draws the reduced dashboard.
pub(super) fn panel(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    header::title_row(app, snapshot, area, buffer);
    let foot = Rect {
        y: area.bottom() - 1,
        height: 1,
        ..area
    };
    footer::panel(app, foot, buffer);
    let mut body = Rect {
        y: area.y + 1,
        height: area.height - 2,
        ..area
    };
    if body.width >= NUMBERS + PICTURE.0 {
        let picture = Rect {
            x: body.x + NUMBERS,
            width: body.width - NUMBERS,
            ..body
        };
        gas::panel(app, picture, buffer);
        body.width = NUMBERS;
    } else if body.height >= ROWS + PICTURE.1 {
        let picture = Rect {
            y: body.y + ROWS,
            height: body.height - ROWS,
            ..body
        };
        gas::panel(app, picture, buffer);
        body.height = ROWS;
    }
    let inner = Rect {
        x: body.x + 1,
        width: body.width - 2,
        ..body
    };
    numbers(app, snapshot, inner, buffer);
}

fn numbers(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let mut at = 0;
    for entry in now::entries(app, snapshot) {
        let end = line(buffer, area, at, entry.label, &entry.value);
        let plot = Rect {
            x: area.x + (end + 1).min(area.width),
            y: area.y + at,
            width: area.width.saturating_sub(end + 1),
            height: 1,
        };
        chart::sparkline(&entry.series, plot.intersection(area), buffer);
        at += 1;
        if !entry.theory.is_empty() {
            put(buffer, area, (2, at), &entry.theory, theme::THEORY);
            put_before(buffer, area, (area.width, at), &entry.remark, theme::VALUE);
            at += 1;
        }
    }
    let verdict = snapshot
        .speeds
        .as_ref()
        .map_or(MISSING.into(), |speeds| speeds::verdict(speeds));
    put(buffer, area, (0, at), "speeds", theme::QUIET);
    put_before(buffer, area, (area.width, at), &verdict, theme::VALUE);
    let wall = clock(snapshot.wall_time_s);
    let rows = [
        (
            header::time(snapshot),
            format!("trust {}", trust::word(snapshot)),
        ),
        (header::rate(snapshot), format!("wall {wall}")),
        (header::left(snapshot), String::new()),
    ];
    for (left, right) in rows {
        at += 1;
        put(buffer, area, (0, at), &left, theme::VALUE);
        put_before(buffer, area, (area.width, at), &right, theme::VALUE);
    }
}

/// A label and a value in a fixed field; returns the column after it.
fn line(buffer: &mut Buffer, area: Rect, at: u16, label: &str, value: &str) -> u16 {
    put(buffer, area, (0, at), label, theme::QUIET);
    let end = (12 + width(value)).max(26);
    put_before(buffer, area, (end, at), value, theme::STRONG);
    end
}
