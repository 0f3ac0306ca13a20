//! Signals. Those that ask the program to stop: the first one ends the run in good order, the second one ends the program at
//! once. SIGUSR1 asks for a checkpoint.

use std::fs;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
use signal_hook::flag;

use crate::error::{Error, Result};

/// Which stop signal arrived first, if any, and whether a checkpoint is wanted.
#[derive(Clone, Debug)]
pub struct Signals {
    stop: Arc<AtomicBool>,
    number: Arc<AtomicUsize>,
    checkpoint: Arc<AtomicBool>,
}

impl Signals {
    /// Takes over SIGINT, SIGTERM, SIGUSR1 and SIGHUP; a SIGHUP that is ignored, as under `nohup`, stays ignored.
    ///
    /// # Errors
    /// [`Error::Engine`] when the system refuses.
    pub fn listen() -> Result<Self> {
        let ignored = ignored(SIGHUP);
        let signals = Self::without_terminal()?;
        if !ignored {
            signals.stop_on(SIGHUP)?;
        }
        Ok(signals)
    }

    /// Takes over SIGINT, SIGTERM and SIGUSR1, for a process that has no terminal; a SIGHUP is not meant for it.
    ///
    /// # Errors
    /// [`Error::Engine`] when the system refuses.
    pub fn without_terminal() -> Result<Self> {
        let signals = Self {
            stop: Arc::default(),
            number: Arc::default(),
            checkpoint: Arc::default(),
        };
        for number in [SIGINT, SIGTERM] {
            signals.stop_on(number)?;
        }
        flag::register(SIGUSR1, Arc::clone(&signals.checkpoint))
            .and_then(|_| flag::register(SIGHUP, Arc::default())) // heard and forgotten
            .map_err(|error| refused(&error))?;
        Ok(signals)
    }

    fn stop_on(&self, number: i32) -> Result<()> {
        // In this order: a signal that finds `stop` set exits; otherwise it sets the number, then `stop`.
        flag::register_conditional_shutdown(number, 128 + number, Arc::clone(&self.stop))
            .and_then(|_| flag::register_usize(number, Arc::clone(&self.number), number as usize))
            .and_then(|_| flag::register(number, Arc::clone(&self.stop)))
            .map_err(|error| refused(&error))?;
        Ok(())
    }

    /// Set as soon as a stop signal has arrived.
    pub fn stop(&self) -> &AtomicBool {
        &self.stop
    }

    /// The stop signal that arrived, if any.
    pub fn received(&self) -> Option<i32> {
        let arrived = self.stop.load(Ordering::SeqCst);
        arrived.then(|| i32::try_from(self.number.load(Ordering::SeqCst)).unwrap_or(SIGTERM))
    }

    /// Whether a checkpoint has been asked for since the last call.
    pub fn takes_checkpoint(&self) -> bool {
        self.checkpoint.swap(false, Ordering::SeqCst)
    }
}

fn refused(error: &std::io::Error) -> Error {
    Error::Engine(format!("a signal cannot be caught: {error}"))
}

fn ignored(number: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .unwrap_or(0);
    mask >> (number - 1) & 1 == 1
}
