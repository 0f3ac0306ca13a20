//! A terminal for the tests: a pseudo-terminal with the program in a session of its own, read by a terminal emulator.

use std::num::NonZero;
use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, Winsize, tcgetattr, tcsetwinsize};

/// Longest wait for anything; machines that build at the same time are slow.
pub const LONG: Duration = Duration::from_secs(30);

/// The question that a terminal answers when it has come to it, and an answer. Source: ECMA-48, device status report.
const QUESTION: &[u8] = b"\x1b[6n";
const ANSWER: &[u8] = b"\x1b[1;1R";

/// Times a second that a line of a limited speed is read.
const READS: usize = 50;

/// A terminal and what runs in it.
pub struct Terminal {
    master: Option<Arc<OwnedFd>>,
    state: Arc<State>,
    reader: Option<JoinHandle<()>>,
    child: Child,
}

struct State {
    parser: Mutex<vt100::Parser>,
    bytes: Mutex<Vec<u8>>,
    /// Whether somebody reads at the other end of the line.
    reads: AtomicBool,
    /// Whether it answers the question that ends each frame.
    answers: AtomicBool,
    /// Bytes per second that the line carries; 0 for as many as come.
    line: AtomicUsize,
    closed: AtomicBool,
}

impl Terminal {
    /// Runs a command with the terminal as its controlling one.
    pub fn start(command: &mut Command, columns: u16, rows: u16) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)
            .expect("a terminal");
        grantpt(&master).expect("ours");
        unlockpt(&master).expect("ours");
        let size = Winsize {
            ws_row: rows,
            ws_col: columns,
            ws_xpixel: 0,
            ws_ypixel: 0,
        };
        tcsetwinsize(&master, size).expect("a size");
        let name = ptsname(&master, Vec::new())
            .expect("a name")
            .into_string()
            .expect("text");
        let slave = || {
            Stdio::from(
                std::fs::OpenOptions::new()
                    .read(true)
                    .write(true)
                    .open(&name)
                    .expect("the other end"),
            )
        };
        // Only a new session can have the terminal as its own.
        let mut session = Command::new("setsid");
        session
            .arg("--ctty")
            .arg(command.get_program())
            .args(command.get_args());
        if let Some(directory) = command.get_current_dir() {
            session.current_dir(directory);
        }
        for (name, value) in command.get_envs() {
            match value {
                Some(value) => session.env(name, value),
                None => session.env_remove(name),
            };
        }
        let child = session
            .stdin(slave())
            .stdout(slave())
            .stderr(slave())
            .spawn()
            .expect("setsid");
        let state = Arc::new(State {
            parser: Mutex::new(vt100::Parser::new(nonzero(rows), nonzero(columns), 0)),
            bytes: Mutex::default(),
            reads: AtomicBool::new(true),
            answers: AtomicBool::new(true),
            line: AtomicUsize::new(0),
            closed: AtomicBool::new(false),
        });
        let master = Arc::new(master);
        let reader = {
            let (master, state) = (Arc::clone(&master), Arc::clone(&state));
            thread::spawn(move || read(&master, &state))
        };
        Self {
            master: Some(master),
            state,
            reader: Some(reader),
            child,
        }
    }

    /// Types.
    pub fn press(&self, keys: &str) {
        let master = self.master.as_ref().expect("an open terminal");
        rustix::io::write(master, keys.as_bytes()).expect("room for keys");
    }

    /// What is on the screen.
    pub fn screen(&self) -> String {
        self.state.parser.lock().expect("whole").screen().contents()
    }

    /// Whether a full-screen program has the terminal.
    pub fn is_taken(&self) -> bool {
        self.state
            .parser
            .lock()
            .expect("whole")
            .screen()
            .alternate_screen()
    }

    /// Whether the cursor is to be seen.
    pub fn shows_cursor(&self) -> bool {
        !(self.state.parser.lock().expect("whole").screen()).hide_cursor()
    }

    /// Sends a signal to the job in the foreground.
    pub fn signal_foreground(&self, signal: Signal) {
        let master = self.master.as_ref().expect("an open terminal");
        let job = rustix::termios::tcgetpgrp(master).expect("a job");
        kill_process_group(job, signal).expect("it runs");
    }

    /// Waits until all that had been held back has come; gives back how much there is.
    pub fn settle(&self) -> usize {
        let mut length = self.bytes().len();
        loop {
            thread::sleep(Duration::from_millis(50));
            let now = self.bytes().len();
            if now == length {
                return now;
            }
            length = now;
        }
    }

    /// Whether the line discipline is that of a shell: lines, and keys that make signals.
    pub fn is_sane(&self) -> bool {
        let modes = tcgetattr(self.master.as_ref().expect("an open terminal"))
            .expect("modes")
            .local_modes;
        modes.contains(LocalModes::ICANON | LocalModes::ECHO | LocalModes::ISIG)
    }

    /// All that has been written so far.
    pub fn bytes(&self) -> Vec<u8> {
        self.state.bytes.lock().expect("whole").clone()
    }

    /// Waits until the screen shows something.
    #[track_caller]
    pub fn wait_for(&self, words: &str) {
        wait_until(words, || self.screen().contains(words), || self.screen());
    }

    /// Whether somebody reads what is written.
    pub fn read(&self, reads: bool) {
        self.state.reads.store(reads, Ordering::SeqCst);
    }

    /// Whether the terminal answers the question that ends each frame.
    pub fn answer(&self, answers: bool) {
        self.state.answers.store(answers, Ordering::SeqCst);
    }

    /// Lets the line carry so many bytes per second.
    pub fn carry(&self, bytes_per_second: usize) {
        self.state.line.store(bytes_per_second, Ordering::SeqCst);
    }

    /// Bytes up to the end of the first frame, which is waited for.
    #[track_caller]
    pub fn first_paint(&self) -> usize {
        const END: &[u8] = b"\x1b[?2026l";
        let mut end = None;
        wait_until(
            "the end of the first frame",
            || {
                let bytes = self.bytes();
                end = bytes.windows(END.len()).position(|part| part == END);
                end.is_some()
            },
            || self.screen(),
        );
        end.expect("it was waited for") + END.len()
    }

    /// Hangs up.
    pub fn close(&mut self) {
        self.state.closed.store(true, Ordering::SeqCst);
        self.reader.take().map(JoinHandle::join);
        self.master = None;
    }

    /// The process that was started.
    pub fn pid(&self) -> Pid {
        Pid::from_child(&self.child)
    }

    /// Sends it a signal.
    pub fn signal(&self, signal: Signal) {
        kill_process(self.pid(), signal).expect("it runs");
    }

    /// Waits for its end.
    #[track_caller]
    pub fn wait(&mut self) -> ExitStatus {
        let mut status = None;
        let screen = Arc::clone(&self.state);
        let child = &mut self.child;
        wait_until(
            "the end of the process",
            || {
                status = child.try_wait().expect("a child");
                status.is_some()
            },
            || screen.parser.lock().expect("whole").screen().contents(),
        );
        status.expect("it has ended")
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.close();
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn nonzero(value: u16) -> NonZero<u16> {
    value.try_into().expect("not zero")
}

fn read(master: &OwnedFd, state: &State) {
    let mut room = [0; 4096];
    while !state.closed.load(Ordering::SeqCst) {
        let mut fds = [PollFd::from_borrowed_fd(master.as_fd(), PollFlags::IN)];
        let pause = Timespec {
            tv_sec: 0,
            tv_nsec: 5_000_000,
        };
        let _ = poll(&mut fds, Some(&pause));
        let readable = fds[0].revents().contains(PollFlags::IN);
        if !readable || !state.reads.load(Ordering::SeqCst) {
            if fds[0].revents().contains(PollFlags::HUP) || !state.reads.load(Ordering::SeqCst) {
                thread::sleep(Duration::from_millis(5)); // poll does not wait then
            }
            continue;
        }
        let line = state.line.load(Ordering::SeqCst);
        let most = match line {
            0 => room.len(),
            line => (line / READS).clamp(1, room.len()),
        };
        let Ok(count) = rustix::io::read(master, &mut room[..most]) else {
            continue;
        };
        if line > 0 {
            thread::sleep(Duration::from_secs(1) / READS as u32);
        }
        let bytes = &room[..count];
        state.parser.lock().expect("whole").process(bytes);
        let mut all = state.bytes.lock().expect("whole");
        // The question may come in two parts.
        let before = all.len().saturating_sub(QUESTION.len() - 1);
        all.extend_from_slice(bytes);
        let questions = all[before..].windows(QUESTION.len());
        let asked = questions.filter(|part| *part == QUESTION).count();
        drop(all);
        if state.answers.load(Ordering::SeqCst) {
            for _ in 0..asked {
                let _ = rustix::io::write(master, ANSWER);
            }
        }
    }
}

/// Waits until something holds; after a long time it says what was there instead.
#[track_caller]
pub fn wait_until(what: &str, mut holds: impl FnMut() -> bool, instead: impl Fn() -> String) {
    let deadline = Instant::now() + LONG;
    while !holds() {
        assert!(
            Instant::now() < deadline,
            "waited for {what} in vain:\n{}",
            instead()
        );
        thread::sleep(Duration::from_millis(10));
    }
}

/// Runs of a test: their directories, and no process that outlives the test.
pub struct Runs(tempfile::TempDir);

impl Runs {
    /// A place for runs.
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary directory"))
    }

    /// The place.
    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// The program with its runs here, and with no setting of the user's.
    pub fn moltop(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(crate::PROGRAM);
        self.settle(command.args(arguments));
        command
    }

    /// A shell; with an editor for its lines, the terminal would be as little in order as under a full-screen program.
    pub fn shell(&self) -> Command {
        let mut command = Command::new("bash");
        self.settle(command.args(["--norc", "--noediting", "-i"]));
        command
    }

    /// Gives a command its place and its environment.
    pub fn settle<'c>(&self, command: &'c mut Command) -> &'c mut Command {
        command
            .current_dir(self.path())
            .env("XDG_STATE_HOME", self.path());
        command
            .env("TERM", "xterm-256color")
            .env("LC_ALL", "C.UTF-8");
        for (name, _) in std::env::vars_os() {
            let name = name.to_string_lossy();
            if name.starts_with("MOLTOP_")
                || ["NO_COLOR", "CLICOLOR_FORCE"].contains(&name.as_ref())
            {
                command.env_remove(name.as_ref());
            }
        }
        command.stdin(Stdio::null())
    }

    /// What a command prints; it has to succeed.
    #[track_caller]
    pub fn output(&self, arguments: &[&str]) -> String {
        let output = self.moltop(arguments).output().expect("the program starts");
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments:?}: {words}");
        String::from_utf8(output.stdout).expect("text")
    }

    /// What a command that must fail says on stderr, and its exit code.
    #[track_caller]
    pub fn refused(&self, arguments: &[&str]) -> (String, Option<i32>) {
        let output = self.moltop(arguments).output().expect("the program starts");
        assert!(!output.status.success(), "{arguments:?}");
        (
            String::from_utf8_lossy(&output.stderr).into_owned(),
            output.status.code(),
        )
    }

    /// The status of a run, as JSON.
    #[track_caller]
    pub fn status(&self, run: &str) -> serde_json::Value {
        serde_json::from_str(&self.output(&["status", run, "--json"])).expect("JSON")
    }

    fn pids(&self) -> impl Iterator<Item = Pid> {
        let runs = std::fs::read_dir(self.path().join("moltop"))
            .into_iter()
            .flatten()
            .flatten();
        runs.filter_map(|run| {
            let pid = std::fs::read_to_string(run.path().join("lock")).ok()?;
            Pid::from_raw(pid.trim().parse().ok()?)
        })
    }
}

impl Drop for Runs {
    fn drop(&mut self) {
        for pid in self.pids() {
            // A number may belong to another process by now: it is ours only if it is the program.
            let link = std::fs::read_link(format!("/proc/{}/exe", pid.as_raw_nonzero()));
            if link.is_ok_and(|program| program == Path::new(crate::PROGRAM)) {
                let _ = kill_process(pid, Signal::KILL);
            }
        }
    }
}
