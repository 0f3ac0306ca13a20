//! The stops of a job that the shell controls: Ctrl-Z, and what brings us back.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::process::{Signal, kill_current_process_group};
use signal_hook::consts::{SIGCONT, SIGTSTP};
use signal_hook::low_level::{emulate_default_handler, unregister};
use signal_hook::{SigId, flag};

/// Signals that stop this process and let it go on, while the dashboard is up.
pub struct Suspension {
    wanted: Arc<AtomicBool>,
    over: Arc<AtomicBool>,
    handlers: [SigId; 2],
}

impl Suspension {
    /// Takes over SIGTSTP and SIGCONT.
    ///
    /// # Errors
    /// What the system answers.
    pub fn listen() -> io::Result<Self> {
        let (wanted, over): (Arc<AtomicBool>, Arc<AtomicBool>) = Default::default();
        let handlers = [
            flag::register(SIGTSTP, Arc::clone(&wanted))?,
            flag::register(SIGCONT, Arc::clone(&over))?,
        ];
        Ok(Self {
            wanted,
            over,
            handlers,
        })
    }

    /// Whether a stop has been asked for since the last call.
    pub fn is_wanted(&self) -> bool {
        self.wanted.swap(false, Ordering::SeqCst)
    }

    /// Whether this process has been stopped and let go on since the last call.
    pub fn is_over(&self) -> bool {
        self.over.swap(false, Ordering::SeqCst)
    }

    /// Stops until somebody lets us go on.
    pub fn rest(&self) {
        let _ = emulate_default_handler(SIGTSTP);
        self.over.store(true, Ordering::SeqCst); // the signal itself may be on its way still
    }

    /// Asks for a stop of all that the shell started with us, as the key does where it is not taken from the terminal.
    pub fn ask() {
        let _ = kill_current_process_group(Signal::TSTP);
    }
}

impl Drop for Suspension {
    fn drop(&mut self) {
        for handler in self.handlers {
            unregister(handler);
        }
    }
}
