//! The terminal: taken over, written to and given back.
//!
//! Always holds: whoever took the terminal gives it back, on return, error and panic; a terminal that is gone is never
//! written to; and a terminal that does not read never blocks us, because writes go through a non-blocking description of
//! our own. Frames are the difference to what was delivered last, in one write, wrapped in synchronized update (DEC 2026).

use std::io::{self, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::panic;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use ratatui::buffer::Buffer;
use ratatui::crossterm::{cursor, execute, queue, terminal};
use ratatui::layout::Rect;
use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::fs::{Mode, OFlags};
use rustix::process::{Signal, kill_current_process_group};
use signal_hook::consts::{SIGCONT, SIGTSTP};
use signal_hook::low_level::unregister;
use signal_hook::{SigId, flag};

use crate::error::{Error, Result};
use crate::tui::frame;

/// The thread that holds the terminal, if any.
static HOLDER: Mutex<Option<ThreadId>> = Mutex::new(None);
/// What other threads said in panics while the dashboard was up.
static OVERHEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());
/// Whether our panic hook is in place.
static HOOKED: AtomicBool = AtomicBool::new(false);
/// Longest wait for a stalled terminal to take the last bytes.
const LAST_WORDS: Duration = Duration::from_millis(300);

/// The terminal while the dashboard holds it.
pub struct Screen {
    output: OwnedFd,
    pending: Vec<u8>,
    delivered: Buffer,
    alive: bool,
    colors: bool,
    suspension: Suspension,
}

impl Screen {
    /// Takes the terminal over: raw mode, alternate screen, no cursor.
    ///
    /// # Errors
    /// When standard output is no terminal or refuses.
    pub fn take() -> Result<Self> {
        hook_panics();
        let output = own_description().map_err(Error::Terminal)?;
        *locked(&HOLDER) = Some(thread::current().id());
        let mut screen = Self {
            output,
            pending: Vec::new(),
            delivered: Buffer::empty(Rect::ZERO),
            alive: true,
            // Source: no-color.org: set and not empty.
            colors: std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty()),
            suspension: Suspension::listen().map_err(Error::Terminal)?,
        };
        screen.enter()?;
        Ok(screen)
    }

    fn enter(&mut self) -> Result<()> {
        terminal::enable_raw_mode().map_err(Error::Terminal)?;
        queue!(self.pending, terminal::EnterAlternateScreen, cursor::Hide).map_err(Error::Terminal)
    }

    /// Gives the terminal back.
    fn leave(&mut self) {
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
        let _ = terminal::disable_raw_mode();
    }

    /// Stops this process if that has been asked for, with the terminal given back meanwhile. Says whether it was stopped,
    /// also in another way: the next frame is then a full one.
    ///
    /// # Errors
    /// When the terminal cannot be taken again.
    pub fn was_suspended(&mut self) -> Result<bool> {
        if self.suspension.wanted.swap(false, Ordering::SeqCst) {
            self.leave();
            let _ = signal_hook::low_level::emulate_default_handler(SIGTSTP);
            self.suspension.over.store(true, Ordering::SeqCst);
        }
        let over = self.suspension.over.swap(false, Ordering::SeqCst);
        if over {
            self.pending.clear(); // what a stalled terminal has not taken
            let _ = terminal::disable_raw_mode(); // whoever had the terminal meanwhile has set it anew
            self.enter()?;
            self.forget();
        }
        Ok(over)
    }

    /// Asks for a stop of all that the shell started with us, as the key does outside of raw mode.
    pub fn suspend(&self) {
        let _ = kill_current_process_group(Signal::TSTP);
    }

    /// Columns and rows; zero when the terminal does not know.
    pub fn size(&self) -> (u16, u16) {
        rustix::termios::tcgetwinsize(&self.output)
            .map_or((0, 0), |size| (size.ws_col, size.ws_row))
    }

    /// Waits for a key, for room to write, or for the time to pass. Says whether keys wait to be read; `None` when the
    /// terminal is gone.
    ///
    /// This is the only wait: crossterm's own would spin for ever on a terminal that vanishes (crossterm#793).
    pub fn wait(&mut self, time: Duration) -> Option<bool> {
        let stdin = io::stdin();
        let input = if rustix::termios::isatty(&stdin) {
            stdin.as_fd()
        } else {
            self.output.as_fd()
        };
        let wish = if self.pending.is_empty() {
            PollFlags::empty()
        } else {
            PollFlags::OUT
        };
        let mut fds = [
            PollFd::from_borrowed_fd(input, PollFlags::IN),
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

    /// Whether the last frame has gone out, so that another may follow.
    pub fn is_ready(&self) -> bool {
        self.pending.is_empty()
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
        frame::encode(&self.delivered, &frame, self.colors, &mut bytes);
        if !bytes.is_empty() {
            queue!(self.pending, terminal::BeginSynchronizedUpdate).map_err(Error::Terminal)?;
            self.pending.append(&mut bytes);
            queue!(self.pending, terminal::EndSynchronizedUpdate).map_err(Error::Terminal)?;
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

/// Signals that stop this process and let it go on.
struct Suspension {
    /// SIGTSTP has arrived.
    wanted: Arc<AtomicBool>,
    /// SIGCONT has arrived.
    over: Arc<AtomicBool>,
    handlers: Vec<SigId>,
}

impl Suspension {
    fn listen() -> io::Result<Self> {
        let (wanted, over): (Arc<AtomicBool>, Arc<AtomicBool>) = Default::default();
        let handlers = vec![
            flag::register(SIGTSTP, Arc::clone(&wanted))?,
            flag::register(SIGCONT, Arc::clone(&over))?,
        ];
        Ok(Self {
            wanted,
            over,
            handlers,
        })
    }
}

impl Drop for Suspension {
    fn drop(&mut self) {
        self.handlers.drain(..).for_each(|handler| {
            unregister(handler);
        });
    }
}

/// A non-blocking description of the terminal that shares its flags with nobody: standard output's own must stay blocking
/// for whoever started us.
fn own_description() -> io::Result<OwnedFd> {
    let stdout = rustix::stdio::stdout();
    if !rustix::termios::isatty(stdout) {
        return Err(io::Error::other("standard output is not a terminal"));
    }
    let flags = OFlags::RDWR | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    let opened = rustix::termios::ttyname(stdout, Vec::new())
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
