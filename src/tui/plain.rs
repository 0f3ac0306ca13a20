//! A run in plain lines: no cursor, no colour, nothing that is drawn over. Where standard output is no terminal or a dumb one,
//! and for screen readers.

use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::error::Result;
use crate::feed::{Access, Feed};
use crate::snapshot::Phase;
use crate::tui::app::App;
use crate::tui::{Leave, Options, view};

/// Between two looks at the run.
const LOOK: Duration = Duration::from_millis(50);

/// Whether the terminal can draw a dashboard.
pub fn can_draw() -> bool {
    let dumb = std::env::var_os("TERM").is_some_and(|kind| kind == "dumb");
    io::stdout().is_terminal() && !dumb
}

/// Writes a line now and then, and whenever the state of the run changes, until the run ends or `stop` is raised.
///
/// # Errors
/// None: a reader that is gone ends it.
pub fn run(feed: &dyn Feed, access: Access, stop: &AtomicBool, options: &Options) -> Result<Leave> {
    let mut app = App::new(feed.latest(), options.is_ascii());
    app.access = access;
    let mut written: Option<Instant> = None;
    loop {
        let changed = app.observe(feed.latest());
        let ended = matches!(app.latest.phase, Phase::Finished | Phase::Failed(_));
        let due = written.is_none_or(|written| written.elapsed() >= options.line_every());
        if due || changed || ended {
            app.refresh(false);
            written = Some(Instant::now());
            let line = view::sentence(&app);
            let mut stdout = io::stdout().lock();
            if writeln!(stdout, "{line}")
                .and_then(|()| stdout.flush())
                .is_err()
            {
                return Ok(Leave::HangUp);
            }
        }
        if ended {
            return Ok(Leave::Quit);
        }
        if stop.load(Ordering::SeqCst) {
            return Ok(Leave::Signal);
        }
        if feed.was_stopped() {
            return Ok(Leave::Stopped);
        }
        std::thread::sleep(LOOK);
    }
}
