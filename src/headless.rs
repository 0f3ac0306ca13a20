//! A run without a screen: waits for its end and says how far it is.
//!
//! On a terminal one line on stderr is rewritten; elsewhere a plain line appears there every few seconds. A run that has
//! neither writes a line into its log now and then.

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use crate::feed::{Command, Feed};
use crate::quantity::{Quantity, duration, plain, quantity};
use crate::signals::Signals;
use crate::snapshot::{Phase, Snapshot};
use crate::summary::Exit;

/// How often the run is looked at.
const LOOK: Duration = Duration::from_millis(20);

/// Time between two states of the line on a terminal.
const REWRITE: Duration = Duration::from_millis(250);

/// Time between two plain lines.
const NEXT_LINE: Duration = Duration::from_secs(5);

/// Time between two lines of the log.
const NEXT_ENTRY: Duration = Duration::from_secs(600);

/// Waits until the run ends or a signal arrives, whichever comes first; tells on stderr how far it is.
pub fn wait(feed: &dyn Feed, signals: &Signals) -> Exit {
    let mut progress = Progress::new();
    let exit = wait_and(feed, signals, &mut |snapshot| progress.show(snapshot));
    progress.clear();
    exit
}

/// The same, telling the log alone.
pub fn wait_silently(feed: &dyn Feed, signals: &Signals) -> Exit {
    let mut last = Instant::now();
    wait_and(feed, signals, &mut |snapshot| {
        if last.elapsed() >= NEXT_ENTRY {
            last = Instant::now();
            tracing::info!("{}", line(snapshot));
        }
    })
}

fn wait_and(feed: &dyn Feed, signals: &Signals, tell: &mut dyn FnMut(&Snapshot)) -> Exit {
    loop {
        let snapshot = feed.latest();
        match &snapshot.phase {
            Phase::Finished => return Exit::Finished,
            Phase::Failed(why) => return Exit::Failed(why.clone()),
            _ => {}
        }
        if let Some(signal) = signals.received() {
            return Exit::Signal(signal);
        }
        if signals.takes_checkpoint() {
            feed.send(Command::Checkpoint);
        }
        if feed.was_stopped() {
            return Exit::Quit;
        }
        tell(&snapshot);
        std::thread::sleep(LOOK);
    }
}

struct Progress {
    on_terminal: bool,
    last: Option<Instant>,
}

impl Progress {
    fn new() -> Self {
        Self {
            on_terminal: io::stderr().is_terminal(),
            last: None,
        }
    }

    fn show(&mut self, snapshot: &Snapshot) {
        let pause = if self.on_terminal { REWRITE } else { NEXT_LINE };
        if self.last.is_some_and(|last| last.elapsed() < pause) {
            return;
        }
        self.last = Some(Instant::now());
        let line = line(snapshot);
        if self.on_terminal {
            // A line that wraps cannot be rewritten.
            let width = crossterm::terminal::size().map_or(80, |(width, _)| usize::from(width));
            let line: String = line.chars().take(width.saturating_sub(1)).collect();
            let _ = write!(io::stderr(), "\r\x1b[K{line}");
        } else {
            let _ = writeln!(io::stderr(), "{line}");
        }
    }

    fn clear(&self) {
        if self.on_terminal && self.last.is_some() {
            let _ = write!(io::stderr(), "\r\x1b[K");
        }
    }
}

/// How far a run is, in a line.
pub fn line(snapshot: &Snapshot) -> String {
    let units = snapshot.scene.units;
    if snapshot.phase == Phase::Starting {
        return format!("starting with {} balls", snapshot.scene.ball_count);
    }
    let time = quantity(snapshot.time, Quantity::Time, units);
    let mut parts = vec![match snapshot.until {
        Some(until) => {
            let share = 100.0 * snapshot.time / until;
            format!(
                "{time} of {} ({share:.2} %)",
                quantity(until, Quantity::Time, units)
            )
        }
        None => time,
    }];
    if let Some(rate) = snapshot.collisions_per_wall_second {
        parts.push(format!("{} collisions/s", plain(rate)));
    }
    let left = |(low, high): (f64, f64)| {
        let (low, high) = (duration(low), duration(high));
        if low == high {
            format!("{low} left")
        } else {
            format!("{low} to {high} left")
        }
    };
    parts.extend(snapshot.time_left_s.map(left));
    if let Some((wanted, error)) = snapshot.until_error.zip(snapshot.pressure_error) {
        let (error, wanted) = (plain(100.0 * error), plain(100.0 * wanted));
        let left = snapshot
            .error_left_s
            .map_or(String::new(), |range| format!(", {}", left(range)));
        parts.push(format!("P to {error} % of {wanted} %{left}"));
    }
    if let Some(pressure) = snapshot.pressure.wall {
        parts.push(format!(
            "P {}",
            quantity(pressure, Quantity::Pressure, units)
        ));
    }
    parts.join("  ")
}
