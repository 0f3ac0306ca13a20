//! The dashboard: a run on the terminal.
//!
//! Sees only [`Feed`] and [`Snapshot`](crate::snapshot::Snapshot). The newest snapshot wins; keys are acted on at once; a
//! frame is drawn only when something changed, at the rates of [`pace`]. The screen is a function of [`app::App`], see [`view::draw`].

pub mod app;
pub mod camera;
pub mod ceiling;
pub mod config;
pub mod copy;
pub mod format;
pub mod frame;
pub mod help;
pub mod input;
pub mod keys;
pub mod link;
pub mod options;
pub mod pace;
pub mod picture;
pub mod plain;
pub mod receipt;
pub mod span;
pub mod suspension;
pub mod terminal;
pub mod theme;
pub mod trails;
pub mod view;
pub mod visit;

use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ratatui::buffer::Buffer;
use ratatui::crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use ratatui::layout::{Position, Rect};

use crate::error::Result;
use crate::feed::{Access, Command, Feed};
use crate::snapshot::Phase;
use app::{App, Request};
use link::Meter;
pub use options::Options;
use pace::{Due, News, Pace};
use suspension::Suspension;
use terminal::Screen;
use theme::Theme;

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

/// Longest wait, so that a signal or a new window size is noticed.
const TICK: Duration = Duration::from_millis(50);
/// Ctrl-Z, which raw mode takes from the shell.
const SUSPEND: Event = Event::Key(KeyEvent::new(KeyCode::Char('z'), KeyModifiers::CONTROL));
/// Between two looks for the run's answer to a key.
const ANSWER: Duration = Duration::from_millis(5);
/// Longest wait for the first picture.
const FIRST_PICTURE: Duration = Duration::from_millis(60);
/// Longest wait for that answer.
const PATIENCE: Duration = Duration::from_millis(100);

/// Shows the dashboard until the user leaves, `stop` is raised or the terminal vanishes.
///
/// The terminal is given back on every way out. The run is asked for pictures while the dashboard is up.
///
/// # Errors
/// When standard output is no terminal, or the terminal refuses.
pub fn run(feed: &dyn Feed, access: Access, stop: &AtomicBool, options: &Options) -> Result<Leave> {
    if options.plain || !plain::can_draw() {
        return plain::run(feed, access, stop, options);
    }
    let mut screen = Screen::take(options.palette(), options.mouse())?;
    feed.send(Command::Watch(true));
    await_picture(feed);
    let mut watcher = Watcher::new(feed, access, options);
    let left = watcher.watch(stop, &mut screen);
    if watcher.app.visit.is_some() {
        feed.send(Command::Goto(None));
    }
    feed.send(Command::Watch(false));
    let last = copy::text(screen.shown());
    drop(screen);
    if options.keeps_screen() && !matches!(left, Err(_) | Ok(Leave::HangUp)) {
        let _ = io::stdout().write_all(last.as_bytes()); // whoever has gone since then misses nothing
    }
    left
}

/// Gives a run that is going on the moment that it needs for its first picture, so that the first screen has it.
fn await_picture(feed: &dyn Feed) {
    let deadline = Instant::now() + FIRST_PICTURE;
    while Instant::now() < deadline {
        let latest = feed.latest();
        if latest.sample.is_some() || latest.phase == Phase::Starting {
            break;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The dashboard between its frames.
struct Watcher<'a> {
    feed: &'a dyn Feed,
    app: App,
    pace: Pace,
    meter: Meter,
    news: News,
    /// When a key asked something of the run that it has not answered yet.
    asked: Option<Instant>,
    /// When a frame was last left out.
    left_out: Instant,
    size: (u16, u16),
    theme: Theme,
}

impl<'a> Watcher<'a> {
    fn new(feed: &'a dyn Feed, access: Access, options: &Options) -> Self {
        let now = Instant::now();
        let mut app = App::new(feed.latest(), options.is_ascii());
        app.keymap = options.config.keymap.clone();
        app.access = access;
        Self {
            feed,
            app,
            pace: Pace::new(options.budget(), options.picture_rate(), now),
            meter: Meter::new(options.budget(), access, now),
            news: News::default(),
            asked: None,
            left_out: now,
            size: (0, 0),
            theme: options.theme(),
        }
    }

    fn watch(&mut self, stop: &AtomicBool, screen: &mut Screen) -> Result<Leave> {
        loop {
            if stop.load(Ordering::SeqCst) {
                // The signal may be the one that says that the terminal is gone.
                let gone = screen.wait(Duration::ZERO).is_none();
                return Ok(if gone { Leave::HangUp } else { Leave::Signal });
            }
            if self.feed.was_stopped() {
                return Ok(Leave::Stopped);
            }
            if screen.was_suspended()? {
                self.news.response = true;
                self.pace.hurry();
            }
            self.look(screen.size());
            self.draw(screen)?;
            self.asked = self.asked.filter(|asked| asked.elapsed() < PATIENCE);
            let rest = if self.asked.is_some() { ANSWER } else { TICK };
            let Some(keys_wait) = screen.wait(rest) else {
                return Ok(Leave::HangUp);
            };
            screen.deliver()?;
            if keys_wait {
                for event in screen.events() {
                    if let Some(leave) = self.obey(&event) {
                        return Ok(leave);
                    }
                    self.grant(screen);
                }
            }
        }
    }

    /// Looks for a new window size and a new snapshot.
    fn look(&mut self, size: (u16, u16)) {
        if std::mem::replace(&mut self.size, size) != size {
            self.news.response = true;
            self.pace.hurry();
        }
        let newest = self.feed.latest();
        if newest.sequence == self.app.latest.sequence {
            return;
        }
        let new_state = self.app.observe(newest);
        if new_state {
            self.pace.hurry();
        }
        // The run's answer to a key is shown as soon as it is there.
        self.news.response |= new_state | self.asked.take().is_some();
        self.news.numbers = !self.app.frozen;
        self.news.picture = !self.app.frozen;
    }

    /// Draws what is due, if the terminal has taken the frame before.
    fn draw(&mut self, screen: &mut Screen) -> Result<()> {
        let now = Instant::now();
        self.news.picture |= self.app.turning && !self.app.frozen;
        let due = self.pace.due(self.news, now);
        // A terminal without a size shows nothing.
        if due == Due::Nothing || self.size.0 == 0 || self.size.1 == 0 {
            return Ok(());
        }
        if !screen.is_ready(self.news.response) {
            if now.duration_since(self.left_out) >= pace::NUMBERS {
                self.left_out = now;
                self.meter.dropped();
            }
            return Ok(());
        }
        if due == Due::Everything {
            self.app.turn_by_itself();
        }
        if due != Due::Response {
            self.app.link = self.meter.read(now);
            self.app.link.round_trip = screen.round_trip();
            self.app.refresh(due == Due::Everything);
            self.news.numbers = false;
        }
        self.news.response = false;
        self.news.picture &= due != Due::Everything;
        let area = Rect::new(0, 0, self.size.0, self.size.1);
        let mut frame = Buffer::empty(area);
        view::draw(&self.app, area, &mut frame);
        let bytes = screen.show(frame)?;
        self.meter.drew(bytes);
        self.pace.drew(due, bytes, now);
        Ok(())
    }

    fn obey(&mut self, event: &Event) -> Option<Leave> {
        let leave = match event {
            event if *event == SUSPEND => {
                Suspension::ask();
                None
            }
            Event::Key(key) => {
                let feed = self.feed;
                self.app.press(*key, &mut |command| feed.send(command))
            }
            Event::Mouse(mouse) => {
                let area = Rect::new(0, 0, self.size.0, self.size.1);
                let at = Position::new(mouse.column, mouse.row);
                let panels = view::panels(&self.app, area);
                let under = panels.iter().find(|(_, place)| place.contains(at));
                let on_title = under.is_some_and(|(_, place)| place.y == mouse.row);
                self.app
                    .point(mouse, under.map(|(panel, _)| *panel), on_title);
                None
            }
            _ => None,
        };
        self.news.response = true;
        self.asked = Some(Instant::now());
        leave
    }

    /// Does what a key asked for and only the terminal's holder can do.
    fn grant(&mut self, screen: &mut Screen) {
        match self.app.request.take() {
            Some(Request::Copy) => {
                let written = copy::write(screen.shown(), self.theme);
                self.app.message = Some(match written {
                    Ok(name) => format!("written to {name}.txt and {name}.svg"),
                    Err(error) => format!("the copy could not be written: {error}"),
                });
            }
            Some(Request::Redraw) => screen.forget(),
            None => {}
        }
    }
}

/// The dashboard of a run as it stands after some time, in a window of a size: for pictures.
pub fn screenshot(feed: &dyn Feed, options: &Options, size: (u16, u16), after: Duration) -> Buffer {
    let mut app = App::new(feed.latest(), options.is_ascii());
    app.keymap = options.config.keymap.clone();
    feed.send(Command::Watch(true));
    let start = Instant::now();
    while start.elapsed() < after {
        std::thread::sleep(TICK);
        let newest = feed.latest();
        if newest.sequence != app.latest.sequence {
            app.observe(newest);
        }
    }
    feed.send(Command::Watch(false));
    app.refresh(true);
    let area = Rect::new(0, 0, size.0, size.1);
    let mut screen = Buffer::empty(area);
    view::draw(&app, area, &mut screen);
    screen
}
