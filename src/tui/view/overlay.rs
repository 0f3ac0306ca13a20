//! Panels over the dashboard: help, the question before leaving, why a run failed, and what a small window needs.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::widgets::{Clear, Widget};

use super::SMALLEST;
use super::text::{framed, put, title, width, wrap};
use crate::feed::Access;
use crate::snapshot::Phase;
use crate::tui::app::{App, Overlay};
use crate::tui::keys::KEYS;
use crate::tui::theme;

/// The question before a run ends with its dashboard.
const QUIT: [&str; 4] = [
    "Stop the run and leave?",
    "",
    "y or enter  yes",
    "n or esc    no",
];

/// The question before leaving a run that can go on alone.
const LEAVE: [&str; 5] = [
    "Leave the run?",
    "",
    "d or enter  yes, and let it go on",
    "y           yes, and stop it: its results are written",
    "n or esc    no",
];

/// Draws the overlay that is up, if any.
pub(super) fn panel(app: &App, area: Rect, buffer: &mut Buffer) {
    match app.overlay {
        Some(Overlay::Help) => help(area, buffer),
        Some(Overlay::QuitQuestion) => {
            let lines = if app.access == Access::Owner {
                QUIT.as_slice()
            } else {
                &LEAVE
            };
            let lines: Vec<String> = lines.iter().copied().map(String::from).collect();
            show("quit", &lines, theme::VALUE, area, buffer);
        }
        Some(Overlay::Failure) => {
            if let Phase::Failed(why) = &app.latest.phase {
                failure(why, area, buffer);
            }
        }
        None => {}
    }
}

/// What the marks on the screen mean.
const MARKS: [&str; 6] = [
    "290.0 ps per s: simulated time per second on your clock",
    "theory +1.0σ: difference in standard errors",
    "echo: how far time can be reversed   Z: p V / (N k T)",
    "o  Maxwell's curve   KS: Kolmogorov-Smirnov distance",
    "tagged molecules leave trails, at any depth",
    "any key closes this help",
];

fn help(area: Rect, buffer: &mut Buffer) {
    let mut lines: Vec<String> = KEYS
        .iter()
        .map(|binding| format!("{}{}", padded(binding.shown, 7), binding.help))
        .collect();
    lines.push(String::new());
    lines.extend(MARKS.map(String::from));
    let widest = lines.iter().map(|line| width(line)).max().unwrap_or(0);
    if widest + 4 > area.width || lines.len() as u16 + 2 > area.height {
        lines = short_help();
    }
    show("help", &lines, theme::VALUE, area, buffer);
}

/// The keys in two columns of few words, for a small window.
fn short_help() -> Vec<String> {
    let rows = KEYS.len().div_ceil(2);
    let words = |index: usize| {
        KEYS.get(index).map_or(String::new(), |binding| {
            format!("{}{}", padded(binding.shown, 6), binding.short)
        })
    };
    let mut lines: Vec<String> = (0..rows)
        .map(|row| format!("{}{}", padded(&words(row), 20), words(row + rows)))
        .collect();
    lines.extend([String::new(), "any key closes this help".into()]);
    lines
}

fn padded(text: &str, columns: u16) -> String {
    let blanks = columns.saturating_sub(width(text));
    format!("{text}{}", " ".repeat(usize::from(blanks)))
}

fn failure(why: &str, area: Rect, buffer: &mut Buffer) {
    let columns = area.width.saturating_sub(6).min(72);
    let mut lines = wrap(why, columns);
    lines.extend([String::new(), "q leaves, any other key closes this".into()]);
    show("the run failed", &lines, theme::VALUE, area, buffer);
}

/// A framed panel in the middle; lines that are too long are wrapped, and what is too much is cut at the foot.
fn show(name: &str, lines: &[String], style: Style, area: Rect, buffer: &mut Buffer) {
    let most = area.width.saturating_sub(4);
    let lines: Vec<String> = lines
        .iter()
        .flat_map(|line| {
            if width(line) <= most {
                vec![line.clone()]
            } else {
                wrap(line, most)
            }
        })
        .collect();
    let widest = lines.iter().map(|line| width(line)).max().unwrap_or(0);
    let size = (
        (widest + 4).max(width(name) + 4).min(area.width),
        (lines.len() as u16 + 2).min(area.height),
    );
    let place = Rect {
        x: area.x + (area.width - size.0) / 2,
        y: area.y + (area.height - size.1) / 2,
        width: size.0,
        height: size.1,
    };
    Clear.render(place, buffer);
    let inner = framed(buffer, place, title(name, ""));
    let text = Rect {
        x: inner.x + 1,
        width: inner.width.saturating_sub(2),
        ..inner
    };
    let rows = usize::from(text.height);
    for (row, line) in lines.iter().take(rows).enumerate() {
        let cut = row + 1 == rows && lines.len() > rows;
        let line = if cut {
            "(more in a larger window)"
        } else {
            line
        };
        put(buffer, text, (0, row as u16), line, style);
    }
}

/// What the dashboard needs, in as many words as fit.
pub(super) fn too_small(area: Rect, buffer: &mut Buffer) {
    let (columns, rows) = SMALLEST;
    let words = format!(
        "moltop needs {columns}x{rows}, has {}x{}",
        area.width, area.height
    );
    for (row, line) in wrap(&words, area.width).iter().enumerate() {
        put(buffer, area, (0, row as u16), line, theme::VALUE);
    }
}
