//! A run that goes on from its checkpoint: what of the command line may still change it, and where it lives.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::ValueEnum;

use crate::cli::RunOptions;
use crate::error::{Error, Result};
use crate::quantity::{Quantity, duration, plain, quantity};
use crate::run_directory::{Found, RunDirectory};
use crate::worker::SavedRun;
use crate::worker::engines::{Choice, EngineName};

use super::say;

/// Estimated wall time above which a run needs the user's consent.
const LONG_RUN: Duration = Duration::from_secs(3600);

/// A run as its checkpoint has it, with the wishes of the command line.
pub struct Resumed {
    /// The run.
    pub saved: SavedRun,
    /// The directory that its checkpoint lies in, if that is a run directory.
    home: Option<Found>,
}

impl Resumed {
    /// Reads a checkpoint and checks that the options do not contradict it.
    ///
    /// # Errors
    /// [`Error::Usage`] with the file or the option that is wrong.
    pub fn new(path: &Path, options: &RunOptions) -> Result<Self> {
        let (mut saved, file, damage) = SavedRun::load(path)?;
        if let Some(damage) = damage {
            say(&format!(
                "moltop: warning: {damage}; going on from {}",
                file.display()
            ));
        }
        let refuse = |option: &str, why: &str| {
            let file = file.display();
            Err(Error::Usage(format!("{option}: {file} {why}")))
        };
        let name = saved.engine.name();
        if let Some(engine) = options.engine.and_then(|engine| engine.to_possible_value())
            && options.engine != Some(EngineName::Auto)
            && engine.get_name() != name
        {
            let why = format!("is a run of engine {name}, which it keeps");
            return refuse(&format!("--engine {}", engine.get_name()), &why);
        }
        match (options.calendar, saved.engine) {
            (None, _) => {}
            (Some(calendar), Choice::Event(_)) => saved.engine = Choice::Event(calendar),
            (Some(_), _) => return refuse("--calendar", &format!("is a run of engine {name}")),
        }
        match (options.step, saved.engine) {
            (Some(step), Choice::Step(kept)) if step == kept => {}
            (Some(_), Choice::Step(kept)) => {
                let why = format!("is a run in steps of {}, which it keeps", plain(kept));
                return refuse("--dt", &why);
            }
            (Some(_), _) => return refuse("--dt", &format!("is a run of engine {name}")),
            (None, _) => {}
        }
        if let (Some(threads), Choice::Windowed(_)) = (options.threads, saved.engine) {
            saved.engine = Choice::Windowed(usize::from(threads));
        }
        let own_sample = saved.origin.card.sample;
        if options.sample.is_some_and(|sample| sample != own_sample) {
            let why = format!("has rows every {}, which it keeps", plain(own_sample));
            return refuse("--sample", &why);
        }
        if options.seed.is_some() {
            return refuse("--seed", "has its balls placed already");
        }
        saved.until = options.until.or(saved.until);
        let units = saved.origin.card.units;
        if let Some(until) = saved.until.filter(|&until| until < saved.time) {
            let show = |time: f64| quantity(time, Quantity::Time, units);
            let why = format!("has come to {} already: give a later end", show(saved.time));
            return refuse(&format!("--until {}", plain(until)), &why);
        }
        if saved.until == Some(saved.time) {
            say("moltop: the run has come to its end already: --until T goes on");
        }
        let directory = file
            .parent()
            .filter(|parent| !parent.as_os_str().is_empty());
        let directory = directory.unwrap_or(Path::new("."));
        Ok(Self {
            saved,
            home: Found::by_name(&directory.display().to_string()).ok(),
        })
    }

    /// Why the run needs `--yes`, if it does: it has no end in sight, or takes more than an hour at its own speed.
    pub fn needs_consent(&self) -> Option<String> {
        let Some(until) = self.saved.until else {
            let words = "the run has no end: give --until T, or --yes to run until it is stopped";
            return Some(words.to_owned());
        };
        let average = self.saved.time / self.saved.wall_time_s;
        let left = (until - self.saved.time) / self.saved.time_rate.unwrap_or(average);
        (left > LONG_RUN.as_secs_f64()).then(|| {
            let until = quantity(until, Quantity::Time, self.saved.origin.card.units);
            let left = duration(left);
            format!(
                "the run to {until} would take another {left} at its speed so far: give a smaller --until, or --yes to accept it"
            )
        })
    }

    /// Whether the run goes on where its checkpoint lies.
    pub fn is_at_home(&self, wish: Option<&PathBuf>) -> bool {
        self.home.is_some() && wish.is_none()
    }

    /// The directory that the run goes on in: its own, unless the user wants another.
    ///
    /// # Errors
    /// As [`RunDirectory::reopen`] has them, above all while the run is still going on.
    pub fn directory(&self, wish: Option<&PathBuf>) -> Result<Option<RunDirectory>> {
        let own = self.home.clone().filter(|_| self.is_at_home(wish));
        own.map(RunDirectory::reopen).transpose()
    }
}
