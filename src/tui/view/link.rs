//! What watching costs: the line, the frames, the processor.

use std::time::Duration;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::text::{framed, put, put_before, title};
use crate::snapshot::Snapshot;
use crate::tui::app::App;
use crate::tui::format::{MISSING, bytes, count, si};
use crate::tui::theme;

/// Columns of names and values.
const WIDTH: u16 = 60;

/// Draws the panel.
pub(super) fn panel(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let inner = framed(buffer, area, title("8 link", "what this dashboard takes"));
    let link = &app.link;
    let or_dash = |value: Option<String>| value.unwrap_or(MISSING.into());
    let milliseconds = |time: Duration| format!("{:.0} ms", 1e3 * time.as_secs_f64());
    let sample = snapshot
        .sample
        .as_ref()
        .map(|sample| sample.positions.len());
    let rows = [
        (
            "sent, lately",
            or_dash(link.bytes_per_s.map(|rate| si(rate, "B/s", 3))),
        ),
        ("at the most (--max-bytes-per-s)", si(link.budget, "B/s", 3)),
        ("sent since the start", bytes(Some(link.bytes))),
        ("frames sent", count(link.frames)),
        ("frames dropped, the line was full", count(link.dropped)),
        (
            "from a frame to the terminal's receipt",
            link.round_trip.map_or("it gives none".into(), milliseconds),
        ),
        (
            "processor time of watching",
            or_dash(
                link.cpu_share
                    .map(|share| format!("{:.2} % of a core", 100.0 * share)),
            ),
        ),
        (
            "balls in the picture's sample",
            or_dash(sample.map(|balls| count(balls as u64))),
        ),
        (
            "watchers of this run",
            (snapshot.watchers).map_or("this one only".into(), |many| count(u64::from(many))),
        ),
        ("snapshots of the run so far", count(snapshot.sequence)),
        ("window", format!("{}x{}", area.width, area.height + 3)),
        (
            "characters",
            if app.ascii { "7 bits" } else { "UTF-8" }.into(),
        ),
    ];
    let width = WIDTH.min(inner.width);
    for (row, (label, value)) in rows.iter().enumerate() {
        put(buffer, inner, (0, row as u16), label, theme::QUIET);
        put_before(buffer, inner, (width, row as u16), value, theme::VALUE);
    }
}
