//! Where a run keeps what it leaves: one directory of its own, for the user's eyes only.
//!
//! Always holds: whoever writes into a run directory holds its lock, so two runs never share one, and a run is going on
//! exactly as long as its lock is held, whatever files a crash has left behind. Runs are found below
//! `$XDG_STATE_HOME/moltop`; one that was told to live elsewhere has a link there.

pub(crate) mod log;

use std::collections::HashSet;
use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use etcetera::base_strategy::{BaseStrategy, Xdg};
use rustix::fs::{FlockOperation, flock};

use crate::error::{Error, Result};
use crate::output::Target;

/// The scene as it was read; of a scene in the seed's text, [`SCENE_IN_SEED_TEXT`].
pub const SCENE: &str = "scene.toml";
/// The scene as it was read, in the seed's text.
pub const SCENE_IN_SEED_TEXT: &str = "scene.txt";
/// Where watchers connect.
pub const SOCKET: &str = "socket";
/// What happened.
pub const LOG: &str = "log";
/// The summary as JSON.
pub const SUMMARY: &str = "summary.json";
/// The summary as Markdown.
pub const REPORT: &str = "summary.md";
/// Every observable over the whole run.
pub const HISTORY: &str = "history.csv";
/// Exit code and reason, once the run has ended.
pub const EXIT: &str = "exit";
/// Held by the run, and tells its process id.
const LOCK: &str = "lock";

/// Longest part of a run's name that comes from the scene's title.
const LONGEST_SLUG: usize = 24;

/// The directory of a run that is going on in this process.
#[derive(Debug)]
pub struct RunDirectory {
    path: PathBuf,
    name: String,
    _lock: File,
}

/// A run directory as others see it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Name of the run.
    pub name: String,
    /// Its directory.
    pub path: PathBuf,
}

impl RunDirectory {
    /// Makes a directory for a new run: `wish`, or one below the user's state directory that is named after the title.
    ///
    /// # Errors
    /// [`Error::Usage`] when `wish` holds a run already, [`Error::File`] when the system refuses.
    pub fn create(title: &str, wish: Option<&Path>) -> Result<Self> {
        if let Some(path) = wish {
            return Self::create_at(path, title);
        }
        let make = |path: &Path| DirBuilder::new().mode(0o700).create(path);
        let (name, path) = numbered(title, make)?;
        Self::take(path, name)
    }

    fn create_at(path: &Path, title: &str) -> Result<Self> {
        make_private(path)?;
        if path.join(LOCK).exists() {
            return Err(Error::Usage(format!(
                "--run-dir {}: holds a run already: name a directory that is new or empty",
                path.display()
            )));
        }
        let path = fs::canonicalize(path).map_err(|error| failure(path, "open", error))?;
        forget_links_to(&path); // of runs whose files are gone
        // Without its link the run is found by its directory alone.
        let linked = numbered(title, |link| symlink(&path, link));
        let name = linked.map_or_else(|_| path.display().to_string(), |(name, _)| name);
        Self::take(path, name)
    }

    /// Takes over the directory of a run that has ended, to go on in it.
    ///
    /// # Errors
    /// [`Error::Usage`] while a run is going on in it, [`Error::File`] when the system refuses.
    pub fn reopen(found: Found) -> Result<Self> {
        Self::take(found.path, found.name)
    }

    fn take(path: PathBuf, name: String) -> Result<Self> {
        let file = path.join(LOCK);
        let mut lock = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(&file)
            .map_err(|error| failure(&file, "create", error))?;
        // Those who only look hold it shared, for a moment; a run holds it for good.
        while flock(&lock, FlockOperation::NonBlockingLockExclusive).is_err() {
            if flock(&lock, FlockOperation::NonBlockingLockShared).is_err() {
                return Err(Error::Usage(format!(
                    "{}: a run is going on here: `moltop attach {name}` watches it",
                    path.display()
                )));
            }
        }
        lock.set_len(0)
            .and_then(|()| writeln!(lock, "{}", std::process::id()))
            .map_err(|error| failure(&file, "write", error))?;
        let _ = fs::remove_file(path.join(EXIT)); // of an earlier run that is gone on with
        Ok(Self {
            path,
            name,
            _lock: lock,
        })
    }

    /// Name of the run, as commands take it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The directory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A file of the directory that is to be written whole.
    pub fn target(&self, file: &str) -> Target {
        Target::replacing(self.path.join(file))
    }

    /// Lets all that this process reports from now on (`tracing`) go to the run's log.
    ///
    /// # Errors
    /// [`Error::File`] when the log cannot be opened.
    pub fn start_log(&self) -> Result<()> {
        let path = self.path.join(LOG);
        log::start(&path).map_err(|error| failure(&path, "open", error))
    }
}

impl Found {
    /// All runs of this user, by name.
    ///
    /// # Errors
    /// [`Error::File`] when the state directory cannot be read; one that does not exist has no runs.
    pub fn all() -> Result<Vec<Self>> {
        let root = root()?;
        let entries = match fs::read_dir(&root) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(failure(&root, "read", error)),
        };
        let mut runs: Vec<Self> = entries
            .filter_map(|entry| {
                let entry = entry.ok()?;
                let path = fs::canonicalize(entry.path()).ok()?; // a link to nowhere is no run
                path.join(LOCK).is_file().then(|| Self {
                    name: entry.file_name().to_string_lossy().into_owned(),
                    path,
                })
            })
            .collect();
        runs.sort_by(|one, other| one.name.cmp(&other.name));
        Ok(runs)
    }

    /// The run that the user means: by name, by the beginning of one name, or by directory.
    ///
    /// # Errors
    /// [`Error::Usage`] with the runs there are, when none or several fit.
    pub fn by_name(wish: &str) -> Result<Self> {
        let runs = Self::all()?;
        if let Some(run) = runs.iter().find(|run| run.name == wish) {
            return Ok(run.clone());
        }
        if let Ok(path) = fs::canonicalize(wish)
            && path.join(LOCK).is_file()
        {
            let known = runs.into_iter().find(|run| run.path == path);
            let name = path.display().to_string();
            return Ok(known.unwrap_or(Self { name, path }));
        }
        let fitting: Vec<&Self> = runs
            .iter()
            .filter(|run| run.name.starts_with(wish))
            .collect();
        match fitting.as_slice() {
            [run] => Ok((*run).clone()),
            [] => Err(Error::Usage(format!(
                "{wish}: no such run: {}",
                listed(&runs)
            ))),
            several => Err(Error::Usage(format!(
                "{wish}: could be {}",
                several
                    .iter()
                    .map(|run| run.name.as_str())
                    .collect::<Vec<_>>()
                    .join(" or ")
            ))),
        }
    }

    /// The newest run that is going on.
    ///
    /// # Errors
    /// [`Error::Usage`] when none is.
    pub fn newest() -> Result<Self> {
        Self::newest_of(Self::is_going_on, "is going on")
    }

    /// The run that was started last of those that have ended.
    ///
    /// # Errors
    /// [`Error::Usage`] when none has.
    pub fn newest_ended() -> Result<Self> {
        Self::newest_of(|run| !run.is_going_on(), "has ended")
    }

    fn newest_of(is_meant: impl Fn(&Self) -> bool, what: &str) -> Result<Self> {
        let runs = Self::all()?;
        let newest = (runs.iter().filter(|run| is_meant(run))).max_by_key(|run| run.started());
        newest.cloned().ok_or_else(|| {
            let known = listed(&runs);
            Error::Usage(format!("no run {what}: {known}"))
        })
    }

    /// When the run was started, or gone on with.
    pub fn started(&self) -> Option<SystemTime> {
        let lock = fs::metadata(self.path.join(LOCK)).ok()?;
        lock.modified().ok()
    }

    /// Whether the run is going on: its lock is held, and it has not said how it ended.
    pub fn is_going_on(&self) -> bool {
        let held = |lock: File| flock(&lock, FlockOperation::NonBlockingLockShared).is_err();
        !self.path.join(EXIT).exists() && File::open(self.path.join(LOCK)).is_ok_and(held)
    }

    /// Removes the directory of a run that has ended. One that was told to live elsewhere keeps its files, and is known no more.
    ///
    /// # Errors
    /// [`Error::Usage`] while it is going on, [`Error::File`] when the system refuses.
    pub fn remove(&self) -> Result<()> {
        let lock = self.path.join(LOCK);
        let held = File::open(&lock).map_err(|error| failure(&lock, "open", error))?;
        if flock(&held, FlockOperation::NonBlockingLockExclusive).is_err() {
            let name = &self.name;
            return Err(Error::Usage(format!(
                "{name}: is going on: `moltop stop {name}` ends it"
            )));
        }
        let place = root()?.join(&self.name);
        let removed = if place.is_symlink() {
            fs::remove_file(&place)
        } else {
            fs::remove_dir_all(&place)
        };
        removed.map_err(|error| failure(&place, "remove", error))
    }

    /// Whether its directory is one that was named for it, outside of the runs'.
    pub fn lives_elsewhere(&self) -> bool {
        root().is_ok_and(|root| !self.path.starts_with(root.canonicalize().unwrap_or(root)))
    }

    /// What its files take on the disk \[bytes\]; a file of two names counts once.
    pub fn disk_usage(&self) -> u64 {
        let mut size = 0;
        let mut seen = HashSet::new();
        let mut directories = vec![self.path.clone()];
        while let Some(directory) = directories.pop() {
            for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
                let Ok(file) = entry.metadata() else { continue };
                if file.is_dir() {
                    directories.push(entry.path());
                } else if seen.insert(file.ino()) {
                    size += 512 * file.blocks();
                }
            }
        }
        size
    }

    /// Process id of the run, or of the last process that ran it.
    pub fn pid(&self) -> Option<u32> {
        let mut text = String::new();
        File::open(self.path.join(LOCK))
            .ok()?
            .read_to_string(&mut text)
            .ok()?;
        text.trim().parse().ok()
    }
}

/// The runs in words, for those who named another.
pub fn listed(runs: &[Found]) -> String {
    if runs.is_empty() {
        return "there is none; `moltop SCENE` starts one".to_owned();
    }
    let verb = if runs.len() == 1 { "is" } else { "are" };
    let names: Vec<&str> = runs.iter().map(|run| run.name.as_str()).collect();
    format!("there {verb} {}", names.join(", "))
}

/// Where the runs of this user are.
fn root() -> Result<PathBuf> {
    let state = Xdg::new().ok().and_then(|base| base.state_dir());
    state.map(|state| state.join("moltop")).ok_or_else(|| {
        Error::Usage(
            "no place for runs: set HOME or XDG_STATE_HOME, or give --run-dir DIR".to_owned(),
        )
    })
}

/// Removes the names that lead to a directory.
fn forget_links_to(directory: &Path) {
    let Ok(root) = root() else { return };
    for entry in fs::read_dir(root).into_iter().flatten().flatten() {
        let link = entry.path();
        if fs::read_link(&link).is_ok_and(|target| target == directory) {
            let _ = fs::remove_file(&link); // who cannot is left with a name too many
        }
    }
}

/// Makes the first of `title-1`, `title-2`, ... that does not exist, and gives back its name and path.
fn numbered(title: &str, make: impl Fn(&Path) -> io::Result<()>) -> Result<(String, PathBuf)> {
    let root = root()?;
    make_private(&root)?;
    let slug = slug(title);
    for number in 1_u64.. {
        let name = format!("{slug}-{number}");
        let path = root.join(&name);
        match make(&path) {
            Ok(()) => return Ok((name, path)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(failure(&path, "create", error)),
        }
    }
    unreachable!("there are more numbers than directories")
}

fn make_private(path: &Path) -> Result<()> {
    let made = DirBuilder::new().recursive(true).mode(0o700).create(path);
    made.map_err(|error| failure(path, "create", error))
}

fn failure(path: &Path, action: &'static str, source: io::Error) -> Error {
    Error::File {
        path: path.to_owned(),
        action,
        source,
    }
}

/// A title as part of a file's name: words of small letters and digits, as many as fit.
fn slug(title: &str) -> String {
    let mut slug = String::new();
    let words = title.split(|letter: char| !letter.is_ascii_alphanumeric());
    for word in words.filter(|word| !word.is_empty()) {
        if !slug.is_empty() && slug.len() + 1 + word.len() > LONGEST_SLUG {
            break;
        }
        if !slug.is_empty() {
            slug.push('-');
        }
        slug.push_str(&word.to_ascii_lowercase());
    }
    slug.truncate(LONGEST_SLUG); // ASCII, so every place is a boundary
    if slug.is_empty() {
        "run".to_owned()
    } else {
        slug
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_from_titles() {
        assert_eq!(
            slug("Oxygen near standard conditions"),
            "oxygen-near-standard"
        );
        assert_eq!(slug("512 Bälle, µ = 0.1"), "512-b-lle-0-1");
        assert_eq!(slug("水"), "run");
        assert_eq!(slug(&"x".repeat(300)).len(), LONGEST_SLUG);
        assert_eq!(slug("../../etc/passwd"), "etc-passwd");
    }

    #[test]
    fn a_directory_takes_one_run_at_a_time_and_says_who_has_it() {
        let place = tempfile::tempdir().expect("a temporary directory");
        let path = place.path().join("run");
        fs::create_dir(&path).expect("a directory");
        let found = Found {
            name: "run".to_owned(),
            path,
        };
        assert!(!found.is_going_on());
        let held = RunDirectory::reopen(found.clone()).expect("nobody has it");
        assert!(found.is_going_on());
        assert_eq!(found.pid(), Some(std::process::id()));
        let refused = RunDirectory::reopen(found.clone()).expect_err("it is taken");
        assert!(
            refused.to_string().contains("moltop attach run"),
            "{refused}"
        );
        drop(held);
        assert!(!found.is_going_on());
        RunDirectory::reopen(found).expect("it is free again");
    }
}
