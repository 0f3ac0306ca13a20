//! How far an experiment is: one line on stderr, and whether the user has had enough.

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use crate::error::Result;
use crate::quantity::duration;
use crate::run::say;
use crate::signals::Signals;

/// Between two lines where stderr is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Between two lines on a terminal.
const REFRESH_EVERY: Duration = Duration::from_millis(200);

/// Share of the work from which on the time spent says more about the rest than the estimate does.
const KNOWN_SHARE: f64 = 0.02;

/// Work done and to do, in expected seconds.
#[derive(Debug)]
pub struct Progress {
    signals: Signals,
    began: Instant,
    told: Option<Instant>,
    total: f64,
    done: f64,
    /// Done by a run before this one.
    before: f64,
}

impl Progress {
    /// Nothing done yet of work that is expected to take `total` seconds.
    ///
    /// # Errors
    /// [`crate::error::Error::Engine`] when the system does not let signals be caught.
    pub fn new(total: f64) -> Result<Self> {
        Ok(Self {
            signals: Signals::listen()?,
            began: Instant::now(),
            told: None,
            total,
            done: 0.0,
            before: 0.0,
        })
    }

    /// The work turns out to be another amount in all.
    pub fn expect(&mut self, total: f64) {
        self.total = total;
    }

    /// So many seconds of work were done by a run before this one.
    pub fn already(&mut self, seconds: f64) {
        self.before += seconds;
    }

    /// Says what is being done, now and then, with the time that is left; `seconds` of work have been done since the last call.
    pub fn tell(&mut self, seconds: f64, words: &str) {
        self.done += seconds;
        let terminal = io::stderr().is_terminal();
        let pause = if terminal { REFRESH_EVERY } else { LINE_EVERY };
        if self.told.is_some_and(|told| told.elapsed() < pause) {
            return;
        }
        self.told = Some(Instant::now());
        let share = ((self.before + self.done) / self.total).min(1.0);
        let pace = if self.done < KNOWN_SHARE * (self.total - self.before) {
            1.0
        } else {
            self.began.elapsed().as_secs_f64() / self.done
        };
        let left = duration((self.total - self.before - self.done).max(0.0) * pace);
        let line = format!("{:3.0} %, about {left} left: {words}", 100.0 * share);
        if terminal {
            let _ = write!(io::stderr(), "\r\x1b[K{line}\r");
        } else {
            say(&line);
        }
    }

    /// Whether a signal asks to stop: then what has been measured is written, and the rest left out.
    pub fn stopped(&self) -> bool {
        self.signals.received().is_some()
    }

    /// The exit code: 0, or that of the signal.
    pub fn code(&self) -> u8 {
        self.signals
            .received()
            .map_or(0, |signal| 128 + signal as u8)
    }
}
