//! The dashboard: a run on the terminal.
//!
//! Sees only [`Feed`] and [`Snapshot`](crate::snapshot::Snapshot). The newest snapshot wins; keys are acted on at once; a
//! frame is drawn only when something changed. The screen is a function of [`app::App`], see [`view::draw`].

pub mod app;
pub mod camera;
pub mod format;
pub mod frame;
pub mod keys;
pub mod picture;
pub mod terminal;
pub mod theme;
pub mod trails;
pub mod view;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ratatui::buffer::Buffer;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyModifiers};
use ratatui::layout::Rect;

use crate::error::{Error, Result};
use crate::feed::{Access, Command, Feed};
use app::App;
use terminal::Screen;

/// How the dashboard is to look.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// 7-bit characters only.
    pub ascii: bool,
}

impl Options {
    /// What the locale in the environment asks for.
    pub fn from_environment() -> Self {
        Self {
            ascii: !theme::locale_is_utf8(|name| std::env::var(name).ok()),
        }
    }
}

/// Why the dashboard ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leave {
    /// The user wants to leave: the run is to be stopped if it still goes on.
    Quit,
    /// The user wants to leave; the run goes on.
    Detach,
    /// Somebody else has stopped the run.
    Stopped,
    /// `stop` was raised.
    Signal,
    /// The terminal is gone; nothing more may be printed to it.
    HangUp,
}

/// Least time between two frames that only new data asks for.
const FRAME: Duration = Duration::from_millis(100);
/// Bytes per second that such frames may take: a large window is drawn less often, which keeps slow lines usable.
const BUDGET: f64 = 10_000.0;
/// Longest wait, so that a signal or a new window size is noticed.
const TICK: Duration = Duration::from_millis(50);

/// Ctrl-Z, which raw mode takes from the shell.
const SUSPEND: Event = Event::Key(KeyEvent::new(KeyCode::Char('z'), KeyModifiers::CONTROL));

/// Between two looks for the run's answer to a key.
const ANSWER: Duration = Duration::from_millis(5);

/// Shows the dashboard until the user leaves, `stop` is raised or the terminal vanishes.
///
/// The terminal is given back on every way out. The run is asked for pictures while the dashboard is up.
///
/// # Errors
/// When standard output is no terminal, or the terminal refuses.
pub fn run(feed: &dyn Feed, access: Access, stop: &AtomicBool, options: &Options) -> Result<Leave> {
    let mut screen = Screen::take()?;
    feed.send(Command::Watch(true));
    let left = watch(feed, access, stop, options, &mut screen);
    feed.send(Command::Watch(false));
    left
}

fn watch(
    feed: &dyn Feed,
    access: Access,
    stop: &AtomicBool,
    options: &Options,
    screen: &mut Screen,
) -> Result<Leave> {
    let mut app = App::new(feed.latest(), options.ascii);
    app.access = access;
    let mut size = (0, 0);
    let mut urgent = true;
    let mut changed = true;
    let mut drawn = Instant::now();
    let mut pause = FRAME;
    let mut asked: Option<Instant> = None;
    loop {
        if stop.load(Ordering::SeqCst) {
            // The signal may be the one that says that the terminal is gone.
            let gone = screen.wait(Duration::ZERO).is_none();
            return Ok(if gone { Leave::HangUp } else { Leave::Signal });
        }
        if feed.was_stopped() {
            return Ok(Leave::Stopped);
        }
        if screen.was_suspended()? {
            urgent = true;
        }
        let now_size = screen.size();
        urgent |= std::mem::replace(&mut size, now_size) != now_size;
        let newest = feed.latest();
        if newest.sequence != app.latest.sequence {
            changed |= app.observe(newest);
            // The run's answer to a key is shown as soon as it is there.
            urgent |= std::mem::take(&mut asked).is_some();
        }
        let due = urgent || changed && drawn.elapsed() >= pause;
        // A terminal without a size shows nothing.
        if due && screen.is_ready() && size.0 > 0 && size.1 > 0 {
            let area = Rect::new(0, 0, size.0, size.1);
            let mut frame = Buffer::empty(area);
            view::draw(&app, area, &mut frame);
            let bytes = screen.show(frame)?;
            drawn = Instant::now();
            pause = FRAME.max(Duration::from_secs_f64((bytes as f64 / BUDGET).min(1.0)));
            (urgent, changed) = (false, false);
        }
        asked = asked.filter(|asked: &Instant| asked.elapsed() < FRAME);
        let rest = if asked.is_some() {
            ANSWER
        } else if changed {
            pause.saturating_sub(drawn.elapsed()).min(TICK)
        } else {
            TICK
        };
        let Some(keys_wait) = screen.wait(rest.max(Duration::from_millis(1))) else {
            return Ok(Leave::HangUp);
        };
        screen.deliver()?;
        while keys_wait && event::poll(Duration::ZERO).map_err(Error::Terminal)? {
            let event = event::read().map_err(Error::Terminal)?;
            if event == SUSPEND {
                screen.suspend();
            } else if let Event::Key(key) = event
                && let Some(leave) = app.press(key, &mut |command| feed.send(command))
            {
                return Ok(leave);
            }
            urgent = true;
            asked = Some(Instant::now());
        }
    }
}
