//! A run in a process of its own, which outlives the terminal it was started from.
//!
//! The process is this program once more, with the same arguments, in a session of its own: no terminal can hang it up. It
//! speaks through the starter's stderr until the run is going on, says then on its stdout where the run is, and from then on
//! has its directory only.

pub mod logout;

use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use crate::cli::RunOptions;
use crate::error::{Error, Result};
use crate::headless;
use crate::run::Prepared;
use crate::run_directory::{Found, LOG};
use crate::signals::Signals;

/// What has become of a start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Started {
    /// The run is going on.
    Run(Found),
    /// It could not start, for reasons that it has told; its exit code.
    Refused(u8),
}

/// Starts a run with the arguments of this process, in a process of its own.
///
/// # Errors
/// [`Error::Engine`] when the system gives no process.
pub fn start() -> Result<Started> {
    let failed =
        |error: io::Error| Error::Engine(format!("the run's process cannot be started: {error}"));
    let mut child = Command::new(std::env::current_exe().map_err(failed)?)
        .arg("--run-process")
        .args(std::env::args_os().skip(1))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(failed)?;
    let mut place = Vec::new();
    if let Some(mut words) = child.stdout.take() {
        words.read_to_end(&mut place).map_err(failed)?;
    }
    // A name has no line feed, and a path may have any byte.
    if let Some(end) = place.iter().position(|&byte| byte == b'\n') {
        let path = PathBuf::from(OsString::from_vec(place.split_off(end + 1)));
        place.truncate(end);
        let name = String::from_utf8_lossy(&place).into_owned();
        return Ok(Started::Run(Found { name, path }));
    }
    let status = child.wait().map_err(failed)?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    code.filter(|&code| code != 0)
        .map(Started::Refused)
        .ok_or_else(|| Error::Engine(format!("the run's process ended before the run: {status}")))
}

/// Is the run: what the process does that [`start`] starts.
///
/// # Errors
/// What keeps the run from starting.
pub fn run(options: &RunOptions, program_start: Instant) -> Result<u8> {
    let _ = rustix::process::setsid(); // whoever leads a group already has no other terminal to lose
    let prepared = Prepared::new(options)?;
    let signals = Signals::without_terminal()?;
    let mut run = prepared.start(program_start)?;
    let Some(directory) = run.directory() else {
        return Err(Error::Usage(
            "without a directory nothing can watch the run: give --run-dir DIR, or --in-process"
                .to_owned(),
        ));
    };
    let log = directory.path().join(LOG);
    let place = [
        directory.name().as_bytes(),
        b"\n",
        directory.path().as_os_str().as_bytes(),
    ]
    .concat();
    run.serve()?;
    let _ = io::stdout()
        .write_all(&place)
        .and_then(|()| io::stdout().flush());
    leave_terminal(&log).map_err(|source| Error::File {
        path: log,
        action: "write",
        source,
    })?;
    let exit = headless::wait_silently(&run.feed(), &signals);
    Ok(run.finish(exit).code)
}

/// Lets go of everything that this process was started with: what a panic says goes to the log.
fn leave_terminal(log: &Path) -> io::Result<()> {
    let nothing: OwnedFd = OpenOptions::new()
        .read(true)
        .write(true)
        .open("/dev/null")?
        .into();
    let log: OwnedFd = File::options().append(true).open(log)?.into();
    rustix::stdio::dup2_stdin(&nothing)?;
    rustix::stdio::dup2_stdout(&nothing)?;
    rustix::stdio::dup2_stderr(&log)?;
    Ok(())
}
