//! The log of a run: what `tracing` events say, one a line, in two files of bounded size. The newest warnings are kept in
//! memory too, for the dashboard.

use std::collections::VecDeque;
use std::fmt::{Debug, Write as _};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};

/// Size at which a log makes room for the next: it becomes `log.1`, and the one before is gone.
const LARGEST: u64 = 1 << 20;

/// Sends the events of this process to a file; the first log of a process stays its log.
pub(super) fn start(path: &Path) -> io::Result<()> {
    let log = Log::open(path)?;
    let subscriber = tracing_subscriber::fmt()
        .with_ansi(false)
        .with_target(false)
        .log_internal_errors(false) // a full disk is no reason to write to a terminal that may be gone
        .with_writer(Mutex::new(log))
        .finish()
        .with(Newest);
    let _ = tracing::subscriber::set_global_default(subscriber);
    Ok(())
}

/// Most warnings that are kept in memory.
const MOST_WARNINGS: usize = 8;

/// How many warnings there have been, and the newest of them.
static WARNINGS: Mutex<(u64, VecDeque<String>)> = Mutex::new((0, VecDeque::new()));

fn warnings() -> MutexGuard<'static, (u64, VecDeque<String>)> {
    WARNINGS
        .lock()
        .expect("nothing panics while it holds the warnings")
}

/// The warnings and errors that have been logged after the first `seen`, as far as they are kept; `seen` then counts all.
pub(crate) fn newest_warnings(seen: &mut u64) -> Vec<String> {
    let (count, kept) = &*warnings();
    let new = (*count - std::mem::replace(seen, *count)) as usize;
    kept.iter()
        .skip(kept.len().saturating_sub(new))
        .cloned()
        .collect()
}

/// Keeps the newest warnings in memory.
struct Newest;

impl<S: Subscriber> Layer<S> for Newest {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        if *event.metadata().level() > Level::WARN {
            return;
        }
        let mut words = Words(String::new());
        event.record(&mut words);
        let (count, kept) = &mut *warnings();
        *count += 1;
        if kept.len() == MOST_WARNINGS {
            kept.pop_front();
        }
        kept.push_back(words.0);
    }
}

/// What an event says.
struct Words(String);

impl Visit for Words {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            let _ = write!(self.0, "{value:?}");
        }
    }
}

struct Log {
    path: PathBuf,
    file: File,
    size: u64,
}

impl Log {
    fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new()
            .create(true)
            .append(true)
            .mode(0o600)
            .open(path)?;
        let size = file.metadata()?.len();
        Ok(Self {
            path: path.to_owned(),
            file,
            size,
        })
    }
}

impl Write for Log {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        if self.size + line.len() as u64 > LARGEST {
            fs::rename(&self.path, self.path.with_extension("1"))?;
            *self = Self::open(&self.path)?;
        }
        let written = self.file.write(line)?;
        self.size += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_never_takes_more_than_two_files_of_its_size() {
        let place = tempfile::tempdir().expect("a temporary directory");
        let path = place.path().join("log");
        let mut log = Log::open(&path).expect("a new file");
        let line = [b'x'; 1000];
        for _ in 0..3000 {
            log.write_all(&line).expect("room on the disk");
        }
        let size = |name: &str| fs::metadata(place.path().join(name)).expect("a log").len();
        assert!(size("log") <= LARGEST && size("log.1") <= LARGEST);
        assert_eq!(fs::read_dir(place.path()).expect("a directory").count(), 2);
    }
}
