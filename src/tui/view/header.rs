//! What runs, how far it is and when it ends.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::text::{put, put_before, width};
use crate::feed::Access;
use crate::snapshot::{Phase, Snapshot};
use crate::tui::app::App;
use crate::tui::format::{MISSING, clock, duration_range, quantity};
use crate::tui::theme;

/// Draws the two header rows.
pub(super) fn panel(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    title_row(app, snapshot, area, buffer);
    if area.height < 2 {
        return;
    }
    let left = match app.access {
        Access::Replay => String::new(),
        _ => left(snapshot),
    };
    let fields = [
        (time(snapshot), 22),
        (format!("wall {}", clock(snapshot.wall_time_s)), 13),
        (rate(snapshot), 14),
    ];
    let mut column = 1;
    for (text, least) in fields {
        put(buffer, area, (column, 1), &text, theme::VALUE);
        column += width(&text).max(least) + 2;
    }
    let start = (area.width - 1).saturating_sub(width(&left)).max(column);
    put(buffer, area, (start, 1), &left, theme::VALUE);
}

/// Program, scene, engine and state.
pub(super) fn title_row(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let state = state(app);
    let style = theme::state_style(&app.latest.phase, app.latest.reversed);
    let start = area.width.saturating_sub(width(&state) + 1);
    put(buffer, area, (start, 0), &state, style);
    let before = Rect {
        width: start.saturating_sub(2),
        ..area
    };
    let column = put(buffer, before, (1, 0), "moltop", theme::STRONG);
    let room = before
        .width
        .saturating_sub(column + width(&snapshot.scene.title) + 5);
    let names = [
        if snapshot.is_approximate() {
            format!("engine {}, approximate", snapshot.engine)
        } else {
            format!("engine {}", snapshot.engine)
        },
        format!("engine {}", snapshot.engine),
        snapshot.engine.to_string(),
    ];
    if let Some(name) = names.iter().find(|name| width(name) < room) {
        put_before(buffer, before, (before.width, 0), name, theme::QUIET);
    }
    put(
        buffer,
        before,
        (column + 2, 0),
        &snapshot.scene.title,
        theme::VALUE,
    );
}

/// The state in words.
pub(super) fn state(app: &App) -> String {
    let words = match (&app.latest.phase, app.latest.reversed) {
        (Phase::Starting, _) if app.access == Access::Replay => "being read",
        _ if app.access == Access::Replay => "ended",
        (Phase::Starting, _) => "starting",
        (Phase::Running, false) => "running",
        (Phase::Running, true) => "running reversed",
        (Phase::Paused, false) => "paused",
        (Phase::Paused, true) => "paused reversed",
        (Phase::Finished, _) => "finished",
        (Phase::Failed(_), _) => "failed",
    };
    if app.frozen {
        format!("● screen frozen, run {words}")
    } else if let Some(visit) = app.visit {
        let units = app.latest.scene.units;
        let wanted = quantity(Some(visit.time), "s", units, 3);
        match app.latest.past.as_ref().map(|past| &past.phase) {
            Some(Phase::Finished) => format!("● the past at {wanted}, run {words}"),
            _ => format!("● going back to {wanted}, run {words}"),
        }
    } else {
        format!("● {words}")
    }
}

/// Simulated time and where it ends.
pub(super) fn time(snapshot: &Snapshot) -> String {
    let units = snapshot.scene.units;
    let now = quantity(Some(snapshot.time), "s", units, 4);
    match snapshot.until {
        Some(until) => format!("t {now} of {}", quantity(Some(until), "s", units, 4)),
        None => format!("t {now}, no end set"),
    }
}

/// Simulated time per wall second.
pub(super) fn rate(snapshot: &Snapshot) -> String {
    format!(
        "{} per s",
        quantity(snapshot.time_rate, "s", snapshot.scene.units, 4)
    )
}

/// Wall time left.
pub(super) fn left(snapshot: &Snapshot) -> String {
    match (&snapshot.phase, snapshot.until, snapshot.time_left_s) {
        (Phase::Finished, ..) => "done".into(),
        (Phase::Failed(why), ..) => format!("stopped: {}", why.lines().next().unwrap_or_default()),
        (_, None, _) => String::new(),
        (_, _, Some(range)) => format!("left {}", duration_range(range)),
        (_, _, None) => format!("left {MISSING}"),
    }
}
