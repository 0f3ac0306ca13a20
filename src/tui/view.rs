//! The screen as a function of the dashboard's state: which panel goes where.
//!
//! From 80x24 on everything is there; a bigger window gives the picture and the histories the room. Below, down to
//! [`SMALLEST`], numbers come first and the picture if there is room. Any size is safe, also none.

mod chart;
mod footer;
mod gas;
mod header;
mod now;
mod overlay;
mod run;
mod small;
mod speeds;
mod text;
mod trust;

use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};

use crate::tui::app::App;
use crate::tui::theme;

/// Least columns and rows of a usable dashboard.
pub const SMALLEST: (u16, u16) = (40, 12);
/// Least columns and rows of the full dashboard.
pub const FULL: (u16, u16) = (80, 24);

/// Draws the whole dashboard.
pub fn draw(app: &App, area: Rect, buffer: &mut Buffer) {
    let area = area.intersection(buffer.area);
    if area.is_empty() {
        return;
    }
    if area.width < SMALLEST.0 || area.height < SMALLEST.1 {
        overlay::too_small(area, buffer);
    } else {
        if area.width < FULL.0 || area.height < FULL.1 {
            small::panel(app, app.shown(), area, buffer);
        } else {
            full(app, area, buffer);
        }
        overlay::panel(app, area, buffer);
    }
    if app.ascii {
        theme::to_ascii(buffer);
    }
}

fn full(app: &App, area: Rect, buffer: &mut Buffer) {
    let snapshot = app.shown();
    let low_height = if area.height < 30 {
        8
    } else {
        (area.height * 3 / 10).clamp(8, 18)
    };
    // The run's numbers get more rows than the speeds need, as far as the histories can spare them.
    let run_height = if area.height < 30 {
        9
    } else {
        (area.height * 2 / 5).clamp(12, 24)
    };
    // The picture gets the width that its height can use, the histories the rest.
    let picture_width = 2 * (area.height - low_height - 5) + 8;
    let right_width = (area.width - picture_width.min(area.width)).clamp(34, area.width * 9 / 20);
    let [head, body, foot] = Layout::vertical([
        Constraint::Length(2),
        Constraint::Fill(1),
        Constraint::Length(1),
    ])
    .areas(area);
    let [left, right] =
        Layout::horizontal([Constraint::Fill(1), Constraint::Length(right_width)]).areas(body);
    let split = |low| Layout::vertical([Constraint::Fill(1), Constraint::Length(low)]);
    let [gas, speeds] = split(low_height).areas(left);
    let [now, run] = split(run_height).areas(right);
    header::panel(app, snapshot, head, buffer);
    gas::panel(app, gas, buffer);
    now::panel(app, snapshot, now, buffer);
    speeds::panel(snapshot, speeds, buffer);
    run::panel(app, snapshot, run, buffer);
    footer::panel(foot, buffer);
}
