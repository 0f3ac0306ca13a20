//! Signals that ask the program to stop: the first one ends the run in good order, the second one ends the program at once.

use std::fs;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;

use crate::error::{Error, Result};

/// Which stop signal arrived first, if any.
#[derive(Clone, Debug)]
pub struct Signals {
    stop: Arc<AtomicBool>,
    number: Arc<AtomicUsize>,
}

impl Signals {
    /// Takes over SIGINT, SIGTERM and SIGHUP; a SIGHUP that is ignored, as under `nohup`, stays ignored.
    ///
    /// # Errors
    /// [`Error::Engine`] when the system refuses.
    pub fn listen() -> Result<Self> {
        let signals = Self {
            stop: Arc::default(),
            number: Arc::default(),
        };
        for number in [SIGINT, SIGTERM, SIGHUP] {
            if number == SIGHUP && ignored(SIGHUP) {
                continue;
            }
            // In this order: a signal that finds `stop` set exits; otherwise it sets the number, then `stop`.
            flag::register_conditional_shutdown(number, 128 + number, Arc::clone(&signals.stop))
                .and_then(|_| {
                    flag::register_usize(number, Arc::clone(&signals.number), number as usize)
                })
                .and_then(|_| flag::register(number, Arc::clone(&signals.stop)))
                .map_err(|error| {
                    Error::Engine(format!("signal {number} cannot be caught: {error}"))
                })?;
        }
        Ok(signals)
    }

    /// Set as soon as a signal has arrived.
    pub fn stop(&self) -> &AtomicBool {
        &self.stop
    }

    /// The signal that arrived, if any.
    pub fn received(&self) -> Option<i32> {
        let arrived = self.stop.load(Ordering::SeqCst);
        arrived.then(|| i32::try_from(self.number.load(Ordering::SeqCst)).unwrap_or(SIGTERM))
    }
}

fn ignored(number: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .unwrap_or(0);
    mask >> (number - 1) & 1 == 1
}
