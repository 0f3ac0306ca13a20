//! Back in time: the state at a past moment, made again from the nearest checkpoint before it, beside the run that goes on.
//!
//! What always holds: the run is only asked for its newest checkpoints' directory and its reversals. A second worker loads the
//! nearest checkpoint at or before the wanted time and runs on to it, on one thread; what it comes to is, bit for bit, what the
//! run was then.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::engines::Choice;
use super::saved::SavedRun;
use super::{Options, Slot, Worker};
use crate::checkpoint;
use crate::feed::{Command, Feed};
use crate::snapshot::{Phase, Snapshot};

/// Directory of the checkpoints that the way back starts from, in a run directory.
const PAST: &str = "past";

/// Most checkpoints kept for the way back.
const MOST: usize = 16;

/// Most bytes that they may take on the disk, the first and the last apart.
const MOST_BYTES: u64 = 1 << 30;

/// How often the second run is looked at.
const LOOK: Duration = Duration::from_millis(20);

/// Keeps the newest checkpoint of a run directory for the way back, under its simulated time; of many, those far apart.
///
/// # Errors
/// What the system answers.
pub fn keep(directory: &Path, time: f64) -> std::io::Result<()> {
    let past = directory.join(PAST);
    fs::create_dir_all(&past)?;
    let name = past.join(format!("{time:e}"));
    if !name.exists() {
        // A second name for the same bytes.
        fs::hard_link(directory.join(checkpoint::NEWEST), name)?;
    }
    let mut kept = kept(directory);
    let size = |path: &Path| fs::metadata(path).map_or(0, |file| file.len());
    while kept.len() > 2
        && (kept.len() > MOST || kept.iter().map(|(_, path)| size(path)).sum::<u64>() > MOST_BYTES)
    {
        // The one whose absence leaves the smallest gap; first and last stay.
        let gap = |index: usize| kept[index + 1].0 - kept[index - 1].0;
        let least = (1..kept.len() - 1).min_by(|&one, &other| gap(one).total_cmp(&gap(other)));
        let (_, path) = kept.remove(least.expect("there are more than two"));
        fs::remove_file(path)?;
    }
    Ok(())
}

/// Simulated times and files of the checkpoints kept, the earliest first.
fn kept(directory: &Path) -> Vec<(f64, PathBuf)> {
    let entries = fs::read_dir(directory.join(PAST)).into_iter().flatten();
    let time = |path: &Path| path.file_name()?.to_str()?.parse::<f64>().ok();
    let mut kept: Vec<_> = entries
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            Some((time(&path)?, path))
        })
        .collect();
    kept.sort_by(|one, other| one.0.total_cmp(&other.0));
    kept
}

/// A second run on its way to a past moment, or there.
pub struct Past {
    slot: Slot,
    stop: Arc<AtomicBool>,
}

impl Past {
    /// Starts on the way to `time`; `now` is the run's newest snapshot, `reversals` its reversals so far.
    pub fn start(directory: PathBuf, time: f64, now: &Snapshot, reversals: Vec<f64>) -> Self {
        let first = Snapshot {
            until: Some(time),
            ..Snapshot::starting(Arc::clone(&now.scene), "", Some(time))
        };
        let slot = Slot::new(Snapshot {
            engine: now.engine.clone(),
            ..first
        });
        let stop = Arc::new(AtomicBool::new(false));
        let (shown, stopped) = (slot.clone(), Arc::clone(&stop));
        std::thread::spawn(move || {
            if let Err(why) = follow(&directory, time, reversals, &shown, &stopped) {
                let last = shown.get();
                shown.put(Snapshot {
                    phase: Phase::Failed(why),
                    sequence: last.sequence + 1,
                    ..(*last).clone()
                });
            }
        });
        Self { slot, stop }
    }

    /// The second run's newest snapshot.
    pub fn latest(&self) -> Arc<Snapshot> {
        self.slot.get()
    }

    /// Whether it is still on its way.
    pub fn is_on_its_way(&self) -> bool {
        matches!(self.latest().phase, Phase::Starting | Phase::Running)
    }
}

impl Drop for Past {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Loads the nearest checkpoint, runs on from it, and shows what it comes to.
fn follow(
    directory: &Path,
    time: f64,
    reversals: Vec<f64>,
    shown: &Slot,
    stopped: &AtomicBool,
) -> Result<(), String> {
    let program_start = Instant::now();
    let kept = kept(directory);
    let nearest = kept.iter().rev().find(|(begin, _)| *begin <= time);
    let Some((_, file)) = nearest else {
        return Err("no checkpoint is that old".to_owned());
    };
    let (saved, ..) = SavedRun::load(file).map_err(|error| error.to_string())?;
    let engine = match saved.engine {
        Choice::Windowed(_) => Choice::Windowed(1),
        other => other,
    };
    let ahead = reversals.into_iter().skip(saved.reversals.len());
    let options = Options {
        engine,
        until: Some(time),
        until_error: None,
        series: None,
        directory: None,
        replay: false,
        trajectory: None,
        checkpoint_every: Duration::MAX,
        on_trouble: None,
        reversals: ahead.filter(|&turn| turn < time).collect(),
        program_start,
    };
    let worker = Worker::resume(saved, options);
    let feed = worker.feed();
    feed.send(Command::Watch(true));
    loop {
        let latest = feed.latest();
        let over = latest.state_hash.is_some() || matches!(latest.phase, Phase::Failed(_));
        if latest.sequence > 0 {
            shown.put((*latest).clone());
        }
        if over || stopped.load(Ordering::Relaxed) {
            feed.send(Command::Stop);
            worker.join();
            return Ok(());
        }
        std::thread::sleep(LOOK);
    }
}
