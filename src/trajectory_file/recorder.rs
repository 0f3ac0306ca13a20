//! The file that a run adds its frames to, and the thread that does.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;

use rustix::fs::{FlockOperation, flock};
use serde::{Deserialize, Serialize};

use super::{Format, Frame};
use crate::error::{Error, Result};

/// How far a trajectory has come, as a checkpoint has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// The file.
    pub path: PathBuf,
    /// Simulated time between two frames.
    pub every: f64,
    /// Number of the next frame.
    pub next: u64,
    /// Length of the file \[bytes\].
    length: u64,
    /// Length of its last frame \[bytes\], and that frame's checksum: to know the file again.
    last: (u64, u32),
}

impl Mark {
    /// Whether a path leads to this file.
    pub fn is_in(&self, path: &Path) -> bool {
        std::path::absolute(path).is_ok_and(|path| path == self.path)
    }
}

/// What has become of the frames.
#[derive(Debug, Default)]
struct Progress {
    lost: u64,
    trouble: Option<String>,
}

/// Adds frames to a file while a run goes on.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    every: f64,
    first: u64,
    progress: Arc<Mutex<Progress>>,
    thread: Option<(SyncSender<Order>, JoinHandle<()>)>,
}

#[derive(Debug)]
enum Order {
    Frame(Box<Frame>),
    /// Wants to know where the file ends, once all before is on the disk.
    Tell(Sender<(u64, (u64, u32))>),
}

/// The file, which ends with a whole frame.
#[derive(Debug)]
struct Tail {
    file: File,
    length: u64,
    last: (u64, u32),
}

impl Recorder {
    /// Begins a file, with the first frame at or after `time`.
    ///
    /// # Errors
    /// [`Error::File`] when the file cannot be made; without `overwrite`, when it exists.
    pub fn create(path: &Path, every: f64, time: f64, overwrite: bool) -> Result<Self> {
        let open = || {
            let path = std::path::absolute(path)?;
            let mut options = OpenOptions::new();
            options.write(true).create(overwrite).create_new(!overwrite);
            let file = options.open(&path)?;
            lock_file(&file)?;
            file.set_len(0)?;
            Ok((path, file))
        };
        let (path, file) = open().map_err(|error| failure(path, error))?;
        let mut first = (time / every) as u64;
        if (first as f64) * every < time {
            first += 1;
        }
        let tail = Tail {
            file,
            length: 0,
            last: (0, 0),
        };
        Self::start(path, every, first, tail)
    }

    /// Goes on with the file of a checkpoint: what was written after it is cut off.
    ///
    /// # Errors
    /// [`Error::File`] when the file is not the one of the checkpoint, or cannot be written.
    pub fn resume(mark: &Mark) -> Result<Self> {
        let open = || {
            let mut file = OpenOptions::new().read(true).write(true).open(&mark.path)?;
            lock_file(&file)?;
            if last_frame(&mut file, mark)? != Some(mark.last.1) {
                return Err(io::Error::other(
                    "is not as the checkpoint has it: --trajectory FILE writes what follows into another file",
                ));
            }
            file.set_len(mark.length)?;
            file.seek(SeekFrom::End(0))?;
            Ok(file)
        };
        let tail = Tail {
            file: open().map_err(|error| failure(&mark.path, error))?,
            length: mark.length,
            last: mark.last,
        };
        Self::start(mark.path.clone(), mark.every, mark.next, tail)
    }

    fn start(path: PathBuf, every: f64, first: u64, tail: Tail) -> Result<Self> {
        let format = Format::of(&path).ok_or_else(|| {
            let words = format!("must end in {}", super::ENDINGS);
            failure(&path, io::Error::other(words))
        })?;
        let (sender, orders) = sync_channel(1);
        let progress = Arc::new(Mutex::new(Progress::default()));
        let shared = Arc::clone(&progress);
        let thread = std::thread::spawn(move || obey(tail, format, &orders, &shared));
        Ok(Self {
            path,
            every,
            first,
            progress,
            thread: Some((sender, thread)),
        })
    }

    /// Number of the first frame that is to come.
    pub fn first(&self) -> u64 {
        self.first
    }

    /// Simulated time of a frame.
    pub fn time_of(&self, number: u64) -> f64 {
        number as f64 * self.every
    }

    /// Hands over a frame; waits while two others are not on the disk yet.
    pub fn add(&self, frame: Frame) {
        if let Some((orders, _)) = &self.thread {
            // Should the thread be gone, the run goes on without.
            let _ = orders.send(Order::Frame(Box::new(frame)));
        }
    }

    /// Waits until all frames are on the disk, and says where the file ends; `next` is the number of the next frame.
    pub fn mark(&self, next: u64) -> Option<Mark> {
        let (orders, _) = self.thread.as_ref()?;
        let (answer, answers) = channel();
        orders.send(Order::Tell(answer)).ok()?;
        let (length, last) = answers.recv().ok()?;
        Some(Mark {
            path: self.path.clone(),
            every: self.every,
            next,
            length,
            last,
        })
    }

    /// Why the newest frame is not in the file, if it could not be written.
    pub fn trouble(&self) -> Option<String> {
        lock(&self.progress).trouble.clone()
    }

    /// What is to be asked at the end of the run whether all frames were written.
    pub fn witness(&self) -> Witness {
        Witness {
            path: self.path.clone(),
            progress: Arc::clone(&self.progress),
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Some((orders, thread)) = self.thread.take() {
            drop(orders);
            let _ = thread.join();
        }
    }
}

/// Knows at the end of a run whether its trajectory is complete.
#[derive(Debug)]
pub struct Witness {
    path: PathBuf,
    progress: Arc<Mutex<Progress>>,
}

impl Witness {
    /// Whether every frame was written.
    ///
    /// # Errors
    /// [`Error::File`] with how many were not, and why the last of them was not.
    pub fn testify(&self) -> Result<()> {
        let progress = lock(&self.progress);
        match (progress.lost, &progress.trouble) {
            (0, _) => Ok(()),
            (lost, trouble) => {
                let why = trouble.as_deref().unwrap_or("later ones could be written");
                let words = format!("{lost} frames are missing: {why}");
                Err(failure(&self.path, io::Error::other(words)))
            }
        }
    }
}

/// Writes frames as they come.
fn obey(mut tail: Tail, format: Format, orders: &Receiver<Order>, progress: &Mutex<Progress>) {
    while let Ok(order) = orders.recv() {
        match order {
            Order::Frame(frame) => {
                let written = tail.add(format, &frame);
                let mut progress = lock(progress);
                if let Err(error) = &written {
                    progress.lost += 1;
                    if progress.trouble.is_none() {
                        tracing::warn!(time = frame.time, "trajectory: no frame: {error}");
                    }
                } else if progress.trouble.is_some() {
                    tracing::info!(time = frame.time, "trajectory: frames again");
                }
                progress.trouble = (written.err())
                    .map(|error| format!("trajectory: {} frames lost: {error}", progress.lost));
            }
            Order::Tell(answer) => {
                if let Err(error) = tail.file.sync_data() {
                    tracing::warn!("trajectory: {error}");
                }
                let _ = answer.send((tail.length, tail.last));
            }
        }
    }
}

impl Tail {
    /// Adds a whole frame, or leaves the file as it was.
    fn add(&mut self, format: Format, frame: &Frame) -> io::Result<()> {
        let mut counted = Counted {
            file: &self.file,
            length: 0,
            checksum: crc32fast::Hasher::new(),
        };
        let mut buffer = BufWriter::with_capacity(1 << 18, &mut counted);
        let written = format
            .write(frame, &mut buffer)
            .and_then(|()| buffer.flush());
        let _ = buffer.into_parts(); // without another try to write what could not be written
        if let Err(error) = written {
            self.file.set_len(self.length)?;
            self.file.seek(SeekFrom::Start(self.length))?;
            return Err(error);
        }
        self.length += counted.length;
        self.last = (counted.length, counted.checksum.finalize());
        Ok(())
    }
}

/// Counts and sums up the bytes on their way into the file.
struct Counted<'f> {
    file: &'f File,
    length: u64,
    checksum: crc32fast::Hasher,
}

impl Write for Counted<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.length += written as u64;
        self.checksum.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Checksum of the frame that the checkpoint's file ended with; `None` if the file is too short.
fn last_frame(file: &mut File, mark: &Mark) -> io::Result<Option<u32>> {
    let Some(begin) = mark.length.checked_sub(mark.last.0) else {
        return Ok(None);
    };
    file.seek(SeekFrom::Start(begin))?;
    let mut checksum = crc32fast::Hasher::new();
    let mut left = mark.last.0;
    let mut buffer = vec![0; 1 << 16];
    while left > 0 {
        let wanted = buffer
            .len()
            .min(usize::try_from(left).unwrap_or(usize::MAX));
        let read = file.read(&mut buffer[..wanted])?;
        if read == 0 {
            return Ok(None);
        }
        checksum.update(&buffer[..read]);
        left -= read as u64;
    }
    Ok(Some(checksum.finalize()))
}

/// Two runs must not add to one file.
fn lock_file(file: &File) -> io::Result<()> {
    flock(file, FlockOperation::NonBlockingLockExclusive)
        .map_err(|_| io::Error::other("another run writes it"))
}

fn failure(path: &Path, source: io::Error) -> Error {
    Error::File {
        path: path.to_owned(),
        action: "write",
        source,
    }
}

fn lock(progress: &Mutex<Progress>) -> MutexGuard<'_, Progress> {
    (progress.lock()).expect("nothing panics while it holds the progress")
}
