//! The terminal: taken over, written to and given back.
//!
//! Always holds: whoever took the terminal gives it back, on return, error and panic; a terminal that is gone is never
//! written to; and a terminal that does not read never blocks us, because writes go through a non-blocking description of
//! our own. Frames are the difference to what was delivered last, in one write, wrapped in synchronized update (DEC 2026);
//! the next one waits until the terminal has taken this one.

use std::io::{self, Write};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::panic;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use ratatui::buffer::Buffer;
use ratatui::crossterm::event::Event;
use ratatui::crossterm::{cursor, execute, queue, terminal};
use ratatui::layout::Rect;
use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::fs::{Mode, OFlags};

use crate::error::{Error, Result};
use crate::tui::frame;
use crate::tui::input::Input;
use crate::tui::receipt::{self, Receipts};
use crate::tui::suspension::Suspension;
use crate::tui::theme::Palette;

/// The thread that holds the terminal, if any.
static HOLDER: Mutex<Option<ThreadId>> = Mutex::new(None);
/// What other threads said in panics while the dashboard was up.
static OVERHEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());
/// Whether our panic hook is in place.
static HOOKED: AtomicBool = AtomicBool::new(false);
/// Buttons and drags, but not every move, which would flood a slow line; in the form without limits. Source: xterm's ctlseqs.
const MOUSE_ON: &[u8] = b"\x1b[?1002h\x1b[?1006h";
const MOUSE_OFF: &[u8] = b"\x1b[?1002l\x1b[?1006l";
/// Longest wait for a stalled terminal to take the last bytes.
const LAST_WORDS: Duration = Duration::from_millis(300);

/// Within which a terminal answers that has nothing else to do.
const SOON: Duration = Duration::from_millis(20);

/// The terminal while the dashboard holds it.
pub struct Screen {
    output: OwnedFd,
    input: Input,
    pending: Vec<u8>,
    delivered: Buffer,
    alive: bool,
    palette: Palette,
    receipts: Receipts,
    mouse: bool,
    suspension: Suspension,
}

impl Screen {
    /// Takes the terminal over: raw mode, alternate screen, no cursor.
    ///
    /// # Errors
    /// When standard output is no terminal or refuses.
    pub fn take(palette: Palette, mouse: bool) -> Result<Self> {
        hook_panics();
        let output = own_description(rustix::stdio::stdout()).map_err(Error::Terminal)?;
        // Where standard input is no terminal, keys come from the one that is drawn on.
        let input = own_description(rustix::stdio::stdin())
            .or_else(|_| own_description(rustix::stdio::stdout()))
            .map_err(Error::Terminal)?;
        *locked(&HOLDER) = Some(thread::current().id());
        let mut screen = Self {
            output,
            input: Input::new(input),
            pending: Vec::new(),
            delivered: Buffer::empty(Rect::ZERO),
            alive: true,
            palette,
            receipts: Receipts::default(),
            mouse,
            suspension: Suspension::listen().map_err(Error::Terminal)?,
        };
        screen.enter()?;
        Ok(screen)
    }

    fn enter(&mut self) -> Result<()> {
        terminal::enable_raw_mode().map_err(Error::Terminal)?;
        queue!(self.pending, terminal::EnterAlternateScreen, cursor::Hide)
            .map_err(Error::Terminal)?;
        if self.mouse {
            self.pending.extend_from_slice(MOUSE_ON);
        }
        Ok(())
    }

    /// Gives the terminal back.
    fn leave(&mut self) {
        if self.mouse {
            self.pending.extend_from_slice(MOUSE_OFF);
        }
        // Writing to a Vec does not fail.
        let _ = queue!(
            self.pending,
            terminal::EndSynchronizedUpdate,
            terminal::LeaveAlternateScreen,
            cursor::Show
        );
        let deadline = Instant::now() + LAST_WORDS;
        while !self.pending.is_empty() && Instant::now() < deadline {
            if self.deliver().is_err() || self.wait(Duration::from_millis(20)).is_none() {
                break;
            }
        }
        // A receipt that comes later would be taken for something typed; one that is long overdue does not come.
        let usual = self.round_trip().unwrap_or_default();
        let overdue = Instant::now() + (2 * usual + SOON).min(LAST_WORDS);
        while self.receipts.is_awaited() && self.round_trip().is_some() {
            let left = overdue.saturating_duration_since(Instant::now());
            if left.is_zero() || self.wait(left).is_none() {
                break;
            }
            self.events();
        }
        let _ = rustix::termios::tcflush(&self.output, rustix::termios::QueueSelector::IFlush);
        let _ = terminal::disable_raw_mode();
    }

    /// Stops this process if that has been asked for, with the terminal given back meanwhile. Says whether it was stopped,
    /// also in another way: the next frame is then a full one.
    ///
    /// # Errors
    /// When the terminal cannot be taken again.
    pub fn was_suspended(&mut self) -> Result<bool> {
        if self.suspension.is_wanted() {
            self.leave();
            self.suspension.rest();
        }
        let over = self.suspension.is_over();
        if over {
            self.pending.clear(); // what a stalled terminal has not taken
            let _ = terminal::disable_raw_mode(); // whoever had the terminal meanwhile may have set it anew
            self.enter()?;
            self.forget();
        }
        Ok(over)
    }

    /// Columns and rows; zero when the terminal does not know.
    pub fn size(&self) -> (u16, u16) {
        rustix::termios::tcgetwinsize(&self.output)
            .map_or((0, 0), |size| (size.ws_col, size.ws_row))
    }

    /// Waits for a key, for room to write, or for the time to pass. Says whether keys wait to be read; `None` when the
    /// terminal is gone.
    ///
    /// This is the only wait.
    pub fn wait(&mut self, time: Duration) -> Option<bool> {
        let wish = if self.pending.is_empty() {
            PollFlags::empty()
        } else {
            PollFlags::OUT
        };
        let mut fds = [
            PollFd::from_borrowed_fd(self.input.terminal(), PollFlags::IN),
            PollFd::from_borrowed_fd(self.output.as_fd(), wish),
        ];
        let timeout = Timespec {
            tv_sec: time.as_secs().cast_signed(),
            tv_nsec: i64::from(time.subsec_nanos()),
        };
        match rustix::event::poll(&mut fds, Some(&timeout)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(_) => self.alive = false,
        }
        let gone = PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL;
        let keys = fds[0].revents().contains(PollFlags::IN);
        self.alive &= !fds.iter().any(|fd| fd.revents().intersects(gone));
        self.alive.then_some(keys)
    }

    /// Whether the last frame has gone out, and has arrived as far as the terminal says so, so that another may follow;
    /// `response` says that a key waits for it.
    pub fn is_ready(&self, response: bool) -> bool {
        self.pending.is_empty() && self.receipts.allow(response, Instant::now())
    }

    /// What was pressed since the last look.
    pub fn events(&mut self) -> Vec<Event> {
        let arrived = self.input.read();
        if arrived.receipt {
            self.receipts.answer(Instant::now());
        }
        arrived.events
    }

    /// Time from a frame to its receipt; `None` where the terminal gives none.
    pub fn round_trip(&self) -> Option<Duration> {
        self.receipts.round_trip
    }

    /// The frame that the terminal shows, or will when it has taken what is under way.
    pub fn shown(&self) -> &Buffer {
        &self.delivered
    }

    /// Makes the next frame a full one.
    pub fn forget(&mut self) {
        self.delivered = Buffer::empty(Rect::ZERO);
    }

    /// Shows a frame: sends what differs from the last. Returns the number of bytes that takes.
    ///
    /// # Errors
    /// When the terminal refuses; one that is only slow keeps the rest for [`Screen::deliver`].
    pub fn show(&mut self, frame: Buffer) -> Result<usize> {
        let mut bytes = Vec::new();
        if self.delivered.area != frame.area {
            self.delivered = Buffer::empty(frame.area);
            queue!(bytes, terminal::Clear(terminal::ClearType::All)).map_err(Error::Terminal)?;
        }
        frame::encode(&self.delivered, &frame, &self.palette, &mut bytes);
        if !bytes.is_empty() {
            queue!(self.pending, terminal::BeginSynchronizedUpdate).map_err(Error::Terminal)?;
            self.pending.append(&mut bytes);
            queue!(self.pending, terminal::EndSynchronizedUpdate).map_err(Error::Terminal)?;
            if self.receipts.are_wanted() {
                self.pending.extend_from_slice(receipt::QUESTION);
                self.receipts.ask(Instant::now());
            }
        }
        self.delivered = frame;
        let size = self.pending.len();
        self.deliver()?;
        Ok(size)
    }

    /// Writes what the terminal takes now.
    ///
    /// # Errors
    /// When the terminal refuses for another reason than being slow or gone.
    pub fn deliver(&mut self) -> Result<()> {
        while self.alive && !self.pending.is_empty() {
            match rustix::io::write(&self.output, &self.pending) {
                Ok(written) => drop(self.pending.drain(..written)),
                Err(rustix::io::Errno::AGAIN) => break,
                Err(rustix::io::Errno::INTR) => {}
                Err(rustix::io::Errno::IO | rustix::io::Errno::PIPE) => self.alive = false,
                Err(error) => return Err(Error::Terminal(error.into())),
            }
        }
        Ok(())
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // After a panic the hook has given the terminal back, and its words must not be overwritten.
        let held = locked(&HOLDER).take().is_some();
        if held && self.alive {
            self.leave();
        }
        for words in locked(&OVERHEARD).drain(..) {
            // A dead terminal must not turn a message into a second panic.
            let _ = writeln!(io::stderr(), "{words}");
        }
    }
}

/// A non-blocking description of a terminal that shares its flags with nobody: standard output's own must stay blocking for
/// whoever started us.
fn own_description(stream: BorrowedFd) -> io::Result<OwnedFd> {
    if !rustix::termios::isatty(stream) {
        return Err(io::Error::other("standard output is not a terminal"));
    }
    let flags = OFlags::RDWR | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    let opened = rustix::termios::ttyname(stream, Vec::new())
        .and_then(|name| rustix::fs::open(name, flags, Mode::empty()))
        .or_else(|_| rustix::fs::open("/dev/tty", flags, Mode::empty()));
    Ok(opened?)
}

/// Gives the terminal back before a panic of its holder is reported; keeps the words of other threads for later.
fn hook_panics() {
    if HOOKED.swap(true, Ordering::SeqCst) {
        return;
    }
    let before = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        let holder = *locked(&HOLDER);
        match holder {
            Some(thread) if thread == thread::current().id() => {
                *locked(&HOLDER) = None;
                let _ = io::stdout().write_all(MOUSE_OFF);
                let restored = execute!(
                    io::stdout(),
                    terminal::EndSynchronizedUpdate,
                    terminal::LeaveAlternateScreen,
                    cursor::Show
                );
                let _ = terminal::disable_raw_mode();
                if restored.is_ok() {
                    before(info);
                }
            }
            Some(_) => locked(&OVERHEARD).push(info.to_string()),
            None => before(info),
        }
    }));
}

/// The value of a lock, also after a panic of another holder: it is always whole.
fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}
