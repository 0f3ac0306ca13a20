//! Writes checkpoints on a thread of its own: the engine only waits while the run is copied.

use std::path::PathBuf;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;

use super::past;
use super::saved::SavedRun;
use crate::checkpoint;

/// What has become of the checkpoints so far.
#[derive(Debug, Default)]
struct Progress {
    busy: bool,
    written: Option<f64>,
    count: u64,
    trouble: Option<String>,
}

/// The thread that writes.
#[derive(Debug)]
pub struct Writer {
    progress: Arc<Mutex<Progress>>,
    thread: Option<(SyncSender<Box<SavedRun>>, JoinHandle<()>)>,
}

impl Writer {
    /// Writes into a run directory.
    pub fn start(directory: PathBuf) -> Self {
        let (sender, receiver) = sync_channel::<Box<SavedRun>>(1);
        let progress = Arc::new(Mutex::new(Progress::default()));
        let shared = Arc::clone(&progress);
        let thread = std::thread::spawn(move || {
            while let Ok(run) = receiver.recv() {
                let time = run.time;
                let stored =
                    checkpoint::store(&directory, |writer| run.write(writer)).map(|()| time);
                if stored.is_ok()
                    && let Err(error) = past::keep(&directory, time)
                {
                    tracing::warn!("checkpoint for the way back: {error}");
                }
                drop(run);
                let mut progress = lock(&shared);
                progress.busy = false;
                match stored {
                    Ok(time) => {
                        tracing::info!(time, "checkpoint");
                        (progress.written, progress.trouble) = (Some(time), None);
                        progress.count += 1;
                    }
                    Err(error) => {
                        tracing::warn!("checkpoint: {error}");
                        progress.trouble = Some(format!("no checkpoint: {error}"));
                    }
                }
            }
        });
        Self {
            progress,
            thread: Some((sender, thread)),
        }
    }

    /// Whether a checkpoint is still on its way to the disk.
    pub fn is_busy(&self) -> bool {
        lock(&self.progress).busy
    }

    /// Simulated time of the newest checkpoint on the disk.
    pub fn written(&self) -> Option<f64> {
        lock(&self.progress).written
    }

    /// How many have been written.
    pub fn count(&self) -> u64 {
        lock(&self.progress).count
    }

    /// Why the newest checkpoint is not on the disk, if it could not be written.
    pub fn trouble(&self) -> Option<String> {
        lock(&self.progress).trouble.clone()
    }

    /// Hands over a run; waits for the one before.
    pub fn write(&mut self, run: SavedRun) {
        if let Some((sender, _)) = &self.thread {
            lock(&self.progress).busy = true;
            // Should the thread be gone, the run goes on without.
            let _ = sender.send(Box::new(run));
        }
    }

    /// Waits until all is written.
    pub fn finish(&mut self) {
        if let Some((sender, thread)) = self.thread.take() {
            drop(sender);
            let _ = thread.join();
        }
    }
}

fn lock(progress: &Mutex<Progress>) -> MutexGuard<'_, Progress> {
    progress
        .lock()
        .expect("nothing panics while it holds the progress")
}
