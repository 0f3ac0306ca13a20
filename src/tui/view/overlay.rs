//! Panels over the dashboard: help, the question before leaving, why a run failed, and what a small window needs.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::widgets::{Clear, Widget};

use super::SMALLEST;
use super::text::{framed, put, title, width, wrap};
use crate::feed::Access;
use crate::snapshot::{Phase, Units};
use crate::tui::app::{App, Overlay};
use crate::tui::format::quantity;
use crate::tui::help::Help;
use crate::tui::keys::KEYS;
use crate::tui::theme;
use crate::tui::visit::Prompt;

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
    match &app.overlay {
        Some(Overlay::Help(state)) => help(app, state, area, buffer),
        Some(Overlay::QuitQuestion) => {
            let lines = if app.access == Access::Owner {
                QUIT.as_slice()
            } else {
                &LEAVE
            };
            let lines: Vec<String> = lines.iter().copied().map(String::from).collect();
            show("quit", &lines, theme::VALUE, area, buffer);
        }
        Some(Overlay::Goto(prompt)) => goto(app, prompt, area, buffer),
        Some(Overlay::Failure) => {
            if let Phase::Failed(why) = &app.latest.phase {
                failure(why, area, buffer);
            }
        }
        None => {}
    }
}

/// What the marks on the screen mean.
const MARKS: [&str; 8] = [
    "290.0 ps per s: simulated time per second on your clock",
    "theory +1.0σ: difference in standard errors",
    "echo: how far time can be reversed   Z: p V / (N k T)",
    "o  Maxwell's curve   KS: Kolmogorov-Smirnov distance",
    "trust: sound while no figure of panel 7 is beyond its limit",
    "tagged molecules leave trails, at any depth",
    "freeze holds this screen, pause holds the run",
    "mouse: click a panel's title, drag the gas, wheel to zoom",
];

/// Columns of the keys.
const KEYS_WIDTH: u16 = 14;

/// The help: all that fits, from a line on, of what contains the search.
fn help(app: &App, state: &Help, area: Rect, buffer: &mut Buffer) {
    let keys = KEYS.iter().map(|binding| {
        format!(
            "{}{}",
            padded(&app.keymap.shown(binding), KEYS_WIDTH),
            binding.help
        )
    });
    let all = keys.chain(MARKS.map(String::from));
    let found = |line: &String| line.to_lowercase().contains(&state.search.to_lowercase());
    let most = area.width.saturating_sub(6);
    let lines: Vec<String> = all
        .filter(found)
        .flat_map(|line| wrapped(&line, most, KEYS_WIDTH))
        .collect();
    let rows = usize::from(area.height.saturating_sub(4)).max(1);
    let scroll = usize::from(state.scroll).min(lines.len().saturating_sub(rows));
    let foot = if state.typing {
        format!("search: {}_  enter, esc", state.search)
    } else if lines.len() > rows {
        let last = (scroll + rows).min(lines.len());
        format!(
            "{}-{last} of {}  ↑↓ scroll  / search",
            scroll + 1,
            lines.len()
        )
    } else {
        "/ search, any other key closes this help".into()
    };
    let mut shown: Vec<String> = lines.into_iter().skip(scroll).take(rows).collect();
    if shown.is_empty() {
        shown.push(format!("nothing about {}", state.search));
    }
    shown.push(String::new());
    shown.push(foot);
    show("help", &shown, theme::VALUE, area, buffer);
}

/// A line in so many columns; what is wrapped stands below the text, not below the keys.
fn wrapped(line: &str, columns: u16, indent: u16) -> Vec<String> {
    if width(line) <= columns {
        return vec![line.to_owned()];
    }
    let head: String = line.chars().take(usize::from(indent)).collect();
    let rest: String = line.chars().skip(usize::from(indent)).collect();
    let lines = wrap(&rest, columns.saturating_sub(indent).max(8));
    let first = |index: usize| {
        if index == 0 {
            head.clone()
        } else {
            " ".repeat(usize::from(indent))
        }
    };
    lines
        .iter()
        .enumerate()
        .map(|(index, line)| format!("{}{line}", first(index)))
        .collect()
}

/// The question for a past time.
fn goto(app: &App, prompt: &Prompt, area: Rect, buffer: &mut Buffer) {
    let units = app.latest.scene.units;
    let now = quantity(Some(app.latest.time), "s", units, 4);
    let examples = match units {
        Units::Si => "such as 12.5 ns, 3e-9 or 50%",
        Units::Reduced => "such as 12.5 or 50%",
    };
    let mut lines = vec![
        format!("See the gas as it was at a time from 0 to {now},"),
        examples.to_owned(),
        String::new(),
        format!("> {}_", prompt.typed),
        String::new(),
    ];
    lines.push(match &prompt.fault {
        Some(fault) => fault.clone(),
        None => "enter  go; the run goes on meanwhile    esc  no".into(),
    });
    show("go to a past time", &lines, theme::VALUE, area, buffer);
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
    for (row, line) in wrap(&format!("needs {columns}x{rows}"), area.width)
        .iter()
        .enumerate()
    {
        put(buffer, area, (0, row as u16), line, theme::VALUE);
    }
}
