//! A run of another process, through its socket.
//!
//! A thread of its own takes the news, so that the newest snapshot is at hand at any time; when this process is stopped, the
//! thread asks for no more, and the run has nothing to wait for.

use std::io::{self, Write};
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::thread;
use std::time::{Duration, Instant};

use super::message::{self, Ending, PROTOCOL, Reply, Request};
use super::{Command, Feed, place};
use crate::error::{Error, Result};
use crate::run_directory::{Found, LOG};
use crate::snapshot::{Phase, Snapshot};

/// How long a run may take to answer, or to take a command.
const ANSWER: Duration = Duration::from_secs(3);

/// A run that this process watches.
pub struct SocketFeed {
    run: Found,
    read_only: bool,
    shared: Arc<Shared>,
}

struct Shared {
    stream: UnixStream,
    /// One message at a time.
    sending: Mutex<()>,
    news: Mutex<News>,
    changed: Condvar,
}

struct News {
    latest: Arc<Snapshot>,
    end: Option<End>,
}

enum End {
    Told(Ending),
    /// The run's process is gone without a word.
    Lost,
}

impl SocketFeed {
    /// Connects to a run, and waits for its first snapshot.
    ///
    /// # Errors
    /// [`Error::Usage`] when it has ended, [`Error::Engine`] when it does not answer or refuses.
    pub fn connect(run: &Found, read_only: bool) -> Result<Self> {
        let failed = |why: String| Error::Engine(format!("{}: {why}", run.name));
        let deadline = Instant::now() + ANSWER;
        let stream = loop {
            match place::connect(&run.path) {
                Ok(stream) => break stream,
                Err(_) if !run.is_going_on() => {
                    let (name, results) = (&run.name, run.path.display());
                    return Err(Error::Usage(format!(
                        "{name}: has ended: its results are in {results}; `moltop replay {name}` shows them"
                    )));
                }
                // A run that has just begun opens its socket in a moment.
                Err(_) if Instant::now() < deadline => thread::sleep(Duration::from_millis(10)),
                Err(error) => return Err(failed(format!("cannot connect: {error}"))),
            }
        };
        let first = greet(&stream, read_only).map_err(|error| {
            failed(match (error.kind(), run.pid()) {
                (io::ErrorKind::InvalidData, Some(pid)) => format!(
                    "was started by another moltop, which this one does not understand: watch it with that one; \
                     `kill {pid}` ends the run in good order"
                ),
                (io::ErrorKind::WouldBlock, Some(pid)) => {
                    format!("does not answer; is process {pid} stopped?")
                }
                _ => format!("cannot connect: {error}"),
            })
        })?;
        let latest = match first {
            Reply::News(frame) => frame.after(None),
            Reply::Refused(why) => return Err(failed(why)),
            Reply::Ended(_) => return Err(failed("has just ended".to_owned())),
        };
        let shared = Arc::new(Shared {
            stream,
            sending: Mutex::new(()),
            news: Mutex::new(News {
                latest: Arc::new(latest),
                end: None,
            }),
            changed: Condvar::new(),
        });
        let listener = Arc::clone(&shared);
        thread::Builder::new()
            .name("news".into())
            .spawn(move || listener.listen())
            .map_err(|error| failed(format!("cannot be watched: {error}")))?;
        Ok(Self {
            run: run.clone(),
            read_only,
            shared,
        })
    }

    /// Waits for a snapshot that fits; `None` if there is none in that time or the run has ended before.
    ///
    /// # Panics
    /// Never: nothing panics while it holds the news.
    ///
    /// # Panics
    /// Never: nothing panics while it holds the news.
    pub fn wait_for(
        &self,
        limit: Duration,
        fits: impl Fn(&Snapshot) -> bool,
    ) -> Option<Arc<Snapshot>> {
        let unfit = |news: &mut News| news.end.is_none() && !fits(&news.latest);
        let waited = self
            .shared
            .changed
            .wait_timeout_while(self.shared.news(), limit, unfit);
        let (news, _) = waited.expect(WHOLE);
        fits(&news.latest).then(|| Arc::clone(&news.latest))
    }

    /// Waits for the run to end, and says how; `None` if it does not in that time.
    ///
    /// # Errors
    /// [`Error::Engine`] when its process is gone without a word.
    ///
    /// # Panics
    /// Never: nothing panics while it holds the news.
    pub fn wait_for_end(&self, limit: Duration) -> Option<Result<Ending>> {
        let goes_on = |news: &mut News| news.end.is_none();
        let waited = (self.shared.changed).wait_timeout_while(self.shared.news(), limit, goes_on);
        let (news, _) = waited.expect(WHOLE);
        Some(match news.end.as_ref()? {
            End::Told(ending) => Ok(ending.clone()),
            End::Lost => {
                let log = self.run.path.join(LOG);
                Err(Error::Engine(format!(
                    "{}: {GONE}; {} may tell more",
                    self.run.name,
                    log.display()
                )))
            }
        })
    }
}

impl Feed for SocketFeed {
    fn latest(&self) -> Arc<Snapshot> {
        Arc::clone(&self.shared.news().latest)
    }

    fn send(&self, command: Command) {
        if !self.read_only || matches!(command, Command::Watch(_)) {
            // A run that has ended obeys nothing, and nothing is lost by that.
            let _ = self.shared.say(&Request::Obey(command));
        }
    }
}

impl Drop for SocketFeed {
    fn drop(&mut self) {
        let _ = self.shared.stream.shutdown(std::net::Shutdown::Both); // ends the thread, too
    }
}

const GONE: &str = "the process of the run is gone, without a word";

const WHOLE: &str = "nothing panics while it holds the news";

impl Shared {
    fn news(&self) -> MutexGuard<'_, News> {
        self.news.lock().expect(WHOLE)
    }

    fn say(&self, request: &Request) -> io::Result<()> {
        let _one_at_a_time = self.sending.lock().expect("nothing panics while it sends");
        (&self.stream).write_all(&message::encode(request))
    }

    /// Takes the news until the run ends.
    fn listen(&self) {
        let end = loop {
            // A run that has just ended hears no more, but what it said before is still to be read.
            let _ = self.say(&Request::Next);
            match message::read(&mut &self.stream) {
                Ok(Reply::News(frame)) => {
                    let mut news = self.news();
                    news.latest = Arc::new(frame.after(Some(&news.latest)));
                    self.changed.notify_all();
                }
                Ok(Reply::Ended(ending)) => break End::Told(ending),
                Ok(Reply::Refused(_)) | Err(_) => break End::Lost,
            }
        };
        let mut news = self.news();
        if matches!(end, End::Lost) {
            news.latest = Arc::new(Snapshot {
                phase: Phase::Failed(format!("{GONE}; its log may tell more")),
                sequence: news.latest.sequence + 1,
                ..Snapshot::clone(&news.latest)
            });
        }
        news.end = Some(end);
        self.changed.notify_all();
    }
}

fn greet(stream: &UnixStream, read_only: bool) -> io::Result<Reply> {
    stream.set_write_timeout(Some(ANSWER))?;
    stream.set_read_timeout(Some(ANSWER))?;
    let hello = Request::Hello {
        protocol: PROTOCOL,
        read_only,
    };
    let sent = (&mut &*stream).write_all(&message::encode(&hello));
    // Who is not welcome is told so, and heard no more.
    let reply = message::read(&mut &*stream).map_err(|error| sent.err().unwrap_or(error))?;
    stream.set_read_timeout(None)?; // a paused run has no news
    Ok(reply)
}
