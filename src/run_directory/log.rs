//! The log of a run: what `tracing` events say, one a line, in two files of bounded size.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

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
        .finish();
    let _ = tracing::subscriber::set_global_default(subscriber);
    Ok(())
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
