//! The run's side of its socket: serves any number of watchers from one thread.
//!
//! Always holds: a watcher has at most one message under way, and gets the next one only after it has asked for it; so one
//! that has stopped takes no time and no more memory than that message, and the engine waits for none. Pictures are asked of
//! the engine only while somebody who wants them takes them.

use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec};

use super::message::{self, Ending, Frame, PROTOCOL, Reply, Request};
use super::{Command, Feed, place};
use crate::error::{Error, Result};
use crate::run_directory::SOCKET;
use crate::snapshot::Snapshot;
use crate::worker::LocalFeed;

/// Most watchers at a time.
const MOST_WATCHERS: usize = 64;

/// Longest request \[bytes\].
const LONGEST_REQUEST: usize = 256;

/// How long a watcher that has been sent a snapshot counts as watching, until it asks for the next.
const PATIENCE: Duration = Duration::from_secs(1);

/// How long watchers have to take the last messages.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// A run that can be watched from other processes.
pub struct Server {
    ending: Sender<Ending>,
    waker: UnixStream,
    thread: JoinHandle<()>,
}

impl Server {
    /// Opens the socket in a run's directory and serves it.
    ///
    /// # Errors
    /// [`Error::File`] when the socket cannot be made.
    pub fn start(directory: &Path, feed: LocalFeed) -> Result<Self> {
        let start = || {
            let listener = place::listen(directory)?;
            listener.set_nonblocking(true)?;
            let (alarm, waker) = UnixStream::pair()?;
            alarm.set_nonblocking(true)?;
            waker.set_nonblocking(true)?;
            feed.wake_on_news(waker.try_clone()?);
            let (ending, last) = mpsc::channel();
            let mut serving = Serving {
                directory: directory.to_owned(),
                feed,
                listener,
                alarm,
                watchers: Vec::new(),
                picture: false,
                count: 0,
            };
            let body = move || serving.go(&last);
            let thread = thread::Builder::new().name("watchers".into()).spawn(body)?;
            Ok(Self {
                ending,
                waker,
                thread,
            })
        };
        start().map_err(|source: io::Error| Error::File {
            path: directory.join(SOCKET),
            action: "open",
            source,
        })
    }

    /// Hands all watchers the last snapshot and the ending, and closes.
    pub fn finish(mut self, ending: Ending) {
        let _ = self.ending.send(ending);
        let _ = self.waker.write(&[1]);
        // A watcher's thread that panicked has nothing to say any more.
        let _ = self.thread.join();
    }
}

struct Serving {
    directory: PathBuf,
    feed: LocalFeed,
    listener: UnixListener,
    /// Readable when there is a new snapshot or the end has come.
    alarm: UnixStream,
    watchers: Vec<Watcher>,
    /// Whether the engine has been asked for pictures.
    picture: bool,
    /// How many watchers had said hello when the engine was last asked.
    count: u32,
}

struct Watcher {
    stream: UnixStream,
    arrived: Vec<u8>,
    /// What is under way, and how much of it has gone.
    leaving: (Vec<u8>, usize),
    /// Whether it may only look; `None` before it has said hello.
    read_only: Option<bool>,
    wants_picture: bool,
    /// Whether it has asked for a snapshot that it has not got.
    asks: bool,
    /// The snapshot it has, and since when.
    has: Option<(Arc<Snapshot>, Instant)>,
    /// Whether it is to be let go when all has been sent.
    last: bool,
}

impl Serving {
    fn go(&mut self, ending: &Receiver<Ending>) {
        loop {
            self.wait(None);
            let mut bytes = [0; 64];
            while (&self.alarm)
                .read(&mut bytes)
                .is_ok_and(|count| count == bytes.len())
            {}
            if let Ok(ending) = ending.try_recv() {
                place::close(&self.directory);
                return self.part(&ending);
            }
            self.welcome();
            self.converse();
        }
    }

    /// Waits for something to do.
    fn wait(&self, limit: Option<Duration>) {
        let wish = |watcher: &Watcher| {
            if watcher.is_sending() {
                PollFlags::IN | PollFlags::OUT
            } else {
                PollFlags::IN
            }
        };
        let mut fds = vec![
            PollFd::from_borrowed_fd(self.alarm.as_fd(), PollFlags::IN),
            PollFd::from_borrowed_fd(self.listener.as_fd(), PollFlags::IN),
        ];
        let watchers = self.watchers.iter();
        fds.extend(watchers.map(|one| PollFd::from_borrowed_fd(one.stream.as_fd(), wish(one))));
        let limit = limit.map(|limit| Timespec {
            tv_sec: limit.as_secs().cast_signed(),
            tv_nsec: i64::from(limit.subsec_nanos()),
        });
        let _ = rustix::event::poll(&mut fds, limit.as_ref()); // interrupted: all the same
    }

    fn welcome(&mut self) {
        while let Ok((stream, _)) = self.listener.accept() {
            let mut watcher = Watcher::new(stream);
            if watcher.stream.set_nonblocking(true).is_err() {
                continue;
            }
            if !place::is_ours(&watcher.stream) {
                watcher.refuse("this run belongs to another user");
            } else if self.watchers.len() >= MOST_WATCHERS {
                watcher.refuse("this run has as many watchers as it can serve");
            }
            self.watchers.push(watcher);
        }
    }

    fn converse(&mut self) {
        let Self { feed, watchers, .. } = self;
        watchers.retain_mut(|watcher| watcher.listen(feed).is_ok());
        let count = counted(watchers);
        let latest = feed.latest();
        watchers.retain_mut(|watcher| {
            watcher.tell(&latest, count);
            watcher.send().is_ok()
        });
        let picture = watchers.iter().any(Watcher::takes_pictures);
        let now = (picture, counted(watchers));
        if (self.picture, self.count) == now {
            return;
        }
        if now.1 == 0 {
            feed.send(Command::Goto(None)); // nobody looks at the past any more
        }
        (self.picture, self.count) = now;
        // Also a snapshot with the new count, for those who stay.
        feed.send(Command::Watch(picture));
    }

    /// Says good-bye.
    fn part(&mut self, ending: &Ending) {
        let latest = self.feed.latest();
        self.watchers.retain(|watcher| watcher.read_only.is_some());
        let count = counted(&self.watchers);
        for watcher in &mut self.watchers {
            watcher.add(&Reply::News(Box::new(watcher.frame(&latest, count))));
            watcher.add(&Reply::Ended(ending.clone()));
            watcher.last = true;
        }
        let deadline = Instant::now() + LAST_WORDS;
        while !self.watchers.is_empty() && Instant::now() < deadline {
            let feed = &self.feed;
            (self.watchers).retain_mut(|one| one.listen(feed).is_ok() && one.send().is_ok());
            if !self.watchers.is_empty() {
                self.wait(Some(Duration::from_millis(20)));
            }
        }
    }
}

impl Watcher {
    fn new(stream: UnixStream) -> Self {
        Self {
            stream,
            arrived: Vec::new(),
            leaving: (Vec::new(), 0),
            read_only: None,
            wants_picture: false,
            asks: false,
            has: None,
            last: false,
        }
    }

    fn is_sending(&self) -> bool {
        self.leaving.1 < self.leaving.0.len()
    }

    fn takes_pictures(&self) -> bool {
        let lately = || {
            self.has
                .as_ref()
                .is_some_and(|(_, since)| since.elapsed() < PATIENCE)
        };
        self.wants_picture && (self.asks && !self.is_sending() || lately())
    }

    fn add(&mut self, reply: &Reply) {
        self.leaving.0.extend(message::encode(reply));
    }

    fn refuse(&mut self, why: &str) {
        self.add(&Reply::Refused(why.to_owned()));
        self.last = true;
    }

    /// Hears what it has to say; an error ends the connection.
    fn listen(&mut self, feed: &LocalFeed) -> io::Result<()> {
        let mut bytes = [0; 4096];
        match self.stream.read(&mut bytes) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(_) if self.last => return Ok(()),
            Ok(count) => self.arrived.extend_from_slice(&bytes[..count]),
            Err(error) if is_for_later(&error) => return Ok(()),
            Err(error) => return Err(error),
        }
        while !self.last
            && let Some(request) = message::take(&mut self.arrived, LONGEST_REQUEST)?
        {
            self.obey(&request, feed);
        }
        Ok(())
    }

    fn obey(&mut self, request: &Request, feed: &LocalFeed) {
        match (request, self.read_only) {
            (Request::Hello { protocol, .. }, _) if *protocol != PROTOCOL => {
                let version = env!("CARGO_PKG_VERSION");
                let pid = std::process::id();
                self.refuse(&format!(
                    "this run was started by another moltop ({version}, protocol {PROTOCOL}, not {protocol}): watch it with \
                     that one; `kill {pid}` ends the run in good order"
                ));
            }
            (Request::Hello { read_only, .. }, _) => {
                self.read_only = Some(*read_only);
                self.asks = true;
            }
            (_, None) => self.refuse("a watcher has to say hello first"),
            (Request::Next, _) => self.asks = true,
            (Request::Obey(Command::Watch(wants)), _) => self.wants_picture = *wants,
            (Request::Obey(_), Some(true)) => {}
            (Request::Obey(command), Some(false)) => feed.send(*command),
        }
    }

    fn frame(&self, latest: &Snapshot, watchers: u32) -> Frame {
        let has = self.has.as_ref().map(|(has, _)| has.as_ref());
        Frame::between(has, latest).with_watchers(watchers)
    }

    /// Answers the question for news, if there are any.
    fn tell(&mut self, latest: &Arc<Snapshot>, watchers: u32) {
        let has = self.has.as_ref().map(|(has, _)| has.sequence);
        if self.asks && !self.is_sending() && has != Some(latest.sequence) {
            let frame = self.frame(latest, watchers);
            self.add(&Reply::News(Box::new(frame)));
            self.has = Some((Arc::clone(latest), Instant::now()));
            self.asks = false;
        }
    }

    /// Sends what it takes now; an error ends the connection.
    fn send(&mut self) -> io::Result<()> {
        while self.is_sending() {
            match self.stream.write(&self.leaving.0[self.leaving.1..]) {
                Ok(count) => self.leaving.1 += count,
                Err(error) if is_for_later(&error) => return Ok(()),
                Err(error) => return Err(error),
            }
        }
        self.leaving.0.clear();
        self.leaving.1 = 0;
        if self.last {
            return Err(ErrorKind::ConnectionAborted.into());
        }
        Ok(())
    }
}

/// Those that have said hello.
fn counted(watchers: &[Watcher]) -> u32 {
    let greeted = watchers.iter().filter(|one| one.read_only.is_some());
    greeted.count() as u32
}

fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}
