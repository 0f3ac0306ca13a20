//! The screen as a function of the dashboard's state: which panel goes where.
//!
//! From 80x24 on everything is there; a bigger window gives the picture and the histories the room. Below, down to
//! [`SMALLEST`], numbers come first and the picture if there is room; below that, one row of numbers. A panel can fill the window.
//! Any size is safe, also none.

mod chart;
mod events;
mod footer;
mod gas;
mod header;
mod history;
mod link;
mod now;
mod observables;
mod overlay;
mod run;
mod sentence;
mod small;
mod speeds;
mod text;
mod trust;

pub use sentence::sentence;

use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};

use crate::tui::app::{App, Panel};
use crate::tui::theme;

/// Least columns and rows of a usable dashboard.
pub const SMALLEST: (u16, u16) = (40, 12);
/// Least columns of one row of numbers.
const ONE_ROW: u16 = 20;
/// Least columns and rows of the full dashboard.
pub const FULL: (u16, u16) = (80, 24);

/// Draws the whole dashboard.
pub fn draw(app: &App, area: Rect, buffer: &mut Buffer) {
    let area = area.intersection(buffer.area);
    if area.is_empty() {
        return;
    }
    if area.width < ONE_ROW {
        overlay::too_small(area, buffer);
    } else if area.width < SMALLEST.0 || area.height < SMALLEST.1 {
        let [numbers, below] = Layout::vertical([
            Constraint::Fill(1),
            Constraint::Length(u16::from(area.height > 1)),
        ])
        .areas(area);
        small::bare_numbers(app, app.shown(), numbers, buffer);
        overlay::too_small(below, buffer);
    } else {
        let panels = panels(app, area);
        if panels.is_empty() {
            small::panel(app, app.shown(), area, buffer);
        } else {
            frame(app, area, buffer);
        }
        for (panel, place) in panels {
            draw_panel(app, panel, place, buffer);
        }
        overlay::panel(app, area, buffer);
    }
    if app.ascii {
        theme::to_ascii(buffer);
    }
}

/// Which panel is where: the one that fills the window, or those side by side; none in a small window.
pub fn panels(app: &App, area: Rect) -> Vec<(Panel, Rect)> {
    if area.width < SMALLEST.0 || area.height < SMALLEST.1 {
        return Vec::new();
    }
    let [_, body, _] = rows(area);
    if let Some(panel) = app.enlarged {
        return vec![(panel, body)];
    }
    if area.width < FULL.0 || area.height < FULL.1 {
        return Vec::new();
    }
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
    let [left, right] =
        Layout::horizontal([Constraint::Fill(1), Constraint::Length(right_width)]).areas(body);
    let split = |low| Layout::vertical([Constraint::Fill(1), Constraint::Length(low)]);
    let [gas, speeds] = split(low_height).areas(left);
    let [now, run] = split(run_height).areas(right);
    vec![
        (Panel::Gas, gas),
        (Panel::Now, now),
        (Panel::Speeds, speeds),
        (Panel::Run, run),
    ]
}

/// Head, body and foot.
fn rows(area: Rect) -> [Rect; 3] {
    // A narrow window has no room for the second row of the head.
    let head = if area.width < FULL.0 { 1 } else { 2 };
    Layout::vertical([
        Constraint::Length(head),
        Constraint::Fill(1),
        Constraint::Length(1),
    ])
    .areas(area)
}

/// Draws head and foot.
fn frame(app: &App, area: Rect, buffer: &mut Buffer) {
    let [head, _, foot] = rows(area);
    header::panel(app, app.shown(), head, buffer);
    footer::panel(app, foot, buffer);
}

fn draw_panel(app: &App, panel: Panel, area: Rect, buffer: &mut Buffer) {
    let snapshot = app.shown();
    match panel {
        Panel::Gas => gas::panel(app, area, buffer),
        Panel::Now => now::panel(app, snapshot, area, buffer),
        Panel::Speeds => speeds::panel(app, snapshot, area, buffer),
        Panel::Run => run::panel(app, snapshot, area, buffer),
        Panel::History => history::panel(app, snapshot, area, buffer),
        Panel::Events => events::panel(app, snapshot, area, buffer),
        Panel::Trust => trust::panel(snapshot, area, buffer),
        Panel::Link => link::panel(app, snapshot, area, buffer),
        Panel::Observables => observables::panel(app, snapshot, area, buffer),
    }
    if app.chosen == Some(panel) && app.enlarged.is_none() {
        text::mark_chosen(buffer, area);
    }
}
