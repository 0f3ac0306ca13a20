//! A run of another process, through its socket.
//!
//! A thread of its own takes the news, so that the newest snapshot is at hand at any time; when this process is stopped, the
//! thread asks for no more, and the run has nothing to wait for.

use std::io::{self, Write};
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::thread;
use std::time::Duration;

use super::message::{self, Ending, PROTOCOL, Reply, Request};
use super::{Command, Feed, place};
use crate::error::{Error, Result};
use crate::run_directory::Found;
use crate::snapshot::{Phase, Snapshot};

/// How long a run may take to answer, or to take a command.
const ANSWER: Duration = Duration::from_secs(5);

/// A run that this process watches.
pub struct SocketFeed {
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
        let stream = place::connect(&run.path).map_err(|error| {
            if run.is_going_on() {
                failed(format!("cannot connect: {error}"))
            } else {
                let report = run.path.display();
                Error::Usage(format!(
                    "{}: has ended: its results are in {report}",
                    run.name
                ))
            }
        })?;
        let first = greet(&stream, read_only).map_err(|error| {
            failed(match (error.kind(), run.pid()) {
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
        Ok(Self { read_only, shared })
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

    /// Waits for the run to end, and says how; `None` if it does not in that time, or if its process is gone without a word.
    ///
    /// # Panics
    /// Never: nothing panics while it holds the news.
    pub fn wait_for_end(&self, limit: Duration) -> Option<Ending> {
        let waited = (self.shared.changed)
            .wait_timeout_while(self.shared.news(), limit, |news| news.end.is_none());
        let (news, _) = waited.expect(WHOLE);
        match &news.end {
            Some(End::Told(ending)) => Some(ending.clone()),
            Some(End::Lost) | None => None,
        }
    }

    /// Whether the run's process is gone without a word.
    pub fn is_lost(&self) -> bool {
        matches!(self.shared.news().end, Some(End::Lost))
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
            if self.say(&Request::Next).is_err() {
                break End::Lost;
            }
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
                phase: Phase::Failed(
                    "the process of the run is gone, without a word; its log may tell more"
                        .to_owned(),
                ),
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
    (&mut &*stream).write_all(&message::encode(&hello))?;
    let reply = message::read(&mut &*stream)?;
    stream.set_read_timeout(None)?; // a paused run has no news
    Ok(reply)
}
