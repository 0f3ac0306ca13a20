//! The program in a pseudo-terminal: keys go in, bytes and screens come out.

#![allow(dead_code, reason = "not every user of this file needs all of it")]

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};

/// Longest that a test waits for something to appear, on a loaded machine.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A running program and the terminal it draws on.
pub struct Terminal {
    pub child: Child,
    master: File,
    /// What the terminal shows.
    pub screen: vt100::Parser,
    /// Every byte that came.
    pub bytes: Vec<u8>,
    /// Bytes per second that the line carries; `None` for as many as come.
    pub line: Option<usize>,
    /// Where the program keeps its runs and settings.
    pub home: tempfile::TempDir,
    /// Whether the terminal answers the question that ends each frame.
    pub answers: bool,
}

impl Terminal {
    /// Starts the program with arguments and environment variables of its own.
    pub fn start(size: (u16, u16), arguments: &[&str], variables: &[(&str, &str)]) -> Self {
        let (columns, rows) = size;
        let home = tempfile::tempdir().expect("a temporary directory");
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
        grantpt(&master).expect("granted");
        unlockpt(&master).expect("unlocked");
        let name = ptsname(&master, Vec::new()).expect("a name");
        let slave = || -> OwnedFd {
            rustix::fs::open(&name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).expect("it opens")
        };
        let window = Winsize {
            ws_col: columns,
            ws_row: rows,
            ws_xpixel: 0,
            ws_ypixel: 0,
        };
        tcsetwinsize(&master, window).expect("a size");
        let mut command = Command::new(env!("CARGO_BIN_EXE_moltop"));
        command
            .args(arguments)
            .stdin(Stdio::from(slave()))
            .stdout(Stdio::from(slave()))
            .stderr(Stdio::from(slave()));
        for (name, _) in std::env::vars_os() {
            let name = name.to_string_lossy().into_owned();
            if ["MOLTOP_", "LC_", "XDG_"]
                .iter()
                .any(|prefix| name.starts_with(prefix))
            {
                command.env_remove(name);
            }
        }
        command
            .env_remove("NO_COLOR")
            .env("XDG_STATE_HOME", home.path())
            .env("XDG_CONFIG_HOME", home.path())
            .env("LANG", "C.UTF-8")
            .env("TERM", "xterm-256color")
            .envs(variables.iter().copied());
        command.current_dir(home.path());
        let child = command.spawn().expect("the program starts");
        Self {
            child,
            master: File::from(master),
            screen: vt100::Parser::new(
                rows.try_into().expect("not zero"),
                columns.try_into().expect("not zero"),
                0,
            ),
            bytes: Vec::new(),
            line: None,
            answers: false,
            home,
        }
    }

    /// Presses keys.
    pub fn press(&mut self, keys: &str) {
        self.master.write_all(keys.as_bytes()).expect("a key");
    }

    /// Reads for a time; returns the number of bytes that came.
    pub fn read_for(&mut self, time: Duration) -> usize {
        let end = Instant::now() + time;
        let before = self.bytes.len();
        while self.read_until(end) {}
        self.bytes.len() - before
    }

    /// Reads until the screen shows what is wanted; panics with the screen when it does not come.
    #[track_caller]
    pub fn wait_for(&mut self, wanted: &str) {
        let end = Instant::now() + PATIENCE;
        while !self.text().contains(wanted) {
            assert!(
                self.read_until(end),
                "no {wanted:?} on the screen:\n{}",
                self.text()
            );
        }
    }

    /// Reads on until the program ends.
    #[track_caller]
    pub fn wait_for_end(&mut self) -> ExitStatus {
        let end = Instant::now() + PATIENCE;
        loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                return status;
            }
            let tick = Instant::now() + Duration::from_millis(5);
            self.read_until(tick.min(end));
            assert!(Instant::now() < end, "no end:\n{}", self.text());
        }
    }

    /// What the terminal shows.
    pub fn text(&self) -> String {
        self.screen.screen().contents()
    }

    /// Reads once what comes before a moment; says whether there is time left.
    fn read_until(&mut self, end: Instant) -> bool {
        let left = end.saturating_duration_since(Instant::now());
        let timeout = Timespec {
            tv_sec: left.as_secs().cast_signed(),
            tv_nsec: i64::from(left.subsec_nanos()),
        };
        let mut fds = [PollFd::new(&self.master, PollFlags::IN)];
        let ready = poll(&mut fds, Some(&timeout)).expect("poll") > 0;
        if ready {
            let mut part = vec![0; self.line.map_or(65_536, |line| (line / 50).max(1))];
            // A terminal without a program answers with an error.
            let count = self.master.read(&mut part).unwrap_or(0);
            self.screen.process(&part[..count]);
            // The question may come in two parts.
            let before = self.bytes.len().saturating_sub(3);
            self.bytes.extend_from_slice(&part[..count]);
            let asked = self.bytes[before..]
                .windows(4)
                .any(|four| four == b"\x1b[6n");
            if self.answers && asked {
                self.press("\x1b[1;1R");
            }
            if self.line.is_some() || count == 0 {
                std::thread::sleep(Duration::from_millis(20));
            }
        }
        Instant::now() < end
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
