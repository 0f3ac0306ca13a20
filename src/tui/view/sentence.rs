//! The dashboard in a sentence: for logs, pipes, plain terminals and those who listen to their screen.

use super::{header, now, speeds, trust};
use crate::tui::app::App;
use crate::tui::format::{MISSING, clock};
use crate::tui::theme;

/// What the dashboard shows, in one line of words and numbers.
pub fn sentence(app: &App) -> String {
    let snapshot = app.shown();
    let state = header::state(app).replace("● ", "");
    let share = snapshot
        .until
        .map(|until| 100.0 * snapshot.time / until)
        .filter(|share| share.is_finite())
        .map_or(String::new(), |share| format!(" ({share:.2} %)"));
    let mut parts = vec![
        format!("{}{share}", header::time(snapshot)),
        state,
        format!("wall {}", clock(snapshot.wall_time_s).trim_start()),
        header::rate(snapshot),
        header::left(snapshot),
    ];
    for entry in now::entries(app, snapshot) {
        parts.push(format!("{} {}", entry.label, entry.value));
        parts.push(entry.theory);
        parts.push(entry.remark.replace("  ", ", "));
    }
    let verdict = snapshot.speeds.as_ref();
    let verdict = verdict.map_or(MISSING.into(), |speeds| speeds::verdict(speeds));
    parts.push(format!("speeds {verdict}"));
    parts.push(format!("trust {}", trust::words(snapshot)));
    parts.push(format!("echo {}", trust::echo(snapshot)));
    parts.retain(|part| !part.is_empty());
    let line = parts.join(", ");
    if app.ascii {
        theme::text_in_ascii(&line)
    } else {
        line
    }
}
