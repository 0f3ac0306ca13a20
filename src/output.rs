//! Files that a run leaves: each appears whole under its name or not at all.
//!
//! Every file is written under a temporary name in its own directory, flushed to the disk, and renamed. Targets are checked
//! before the run starts, so that a run of hours does not end with nowhere to put its results.

use std::ffi::OsString;
use std::fs::{File, Permissions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;
use std::thread::JoinHandle;

use tempfile::NamedTempFile;

use crate::error::{Error, Result};
use crate::history::{History, Observable};
use crate::snapshot::{Observed, SeriesRow};
use crate::state::Placement;

/// Header of a series file.
pub const SERIES_COLUMNS: [&str; 10] = [
    "time",
    "wall_time_s",
    "temperature",
    "pressure_wall",
    "pressure_virial",
    "pair_collisions",
    "wall_collisions",
    "queue_length",
    "max_overlap",
    "energy_drift",
];

/// Header of a state file.
pub const STATE_COLUMNS: [&str; 10] = [
    "index",
    "x",
    "y",
    "z",
    "vx",
    "vy",
    "vz",
    "radius",
    "mass",
    "collisions",
];

/// A file that will be written at the end of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    path: PathBuf,
    overwrite: bool,
}

impl Target {
    /// Checks that the file may be written: it does not exist yet (or `overwrite`), and its directory takes files.
    ///
    /// # Errors
    /// [`Error::Usage`], because the run has not started.
    pub fn new(path: &Path, overwrite: bool) -> Result<Self> {
        let target = Self {
            path: path.to_owned(),
            overwrite,
        };
        let refuse = |why: &str| Err(Error::Usage(format!("{}: {why}", path.display())));
        match path.symlink_metadata() {
            Ok(found) if found.is_dir() => {
                return refuse("is a directory: must be the name of a file");
            }
            Ok(found) if !found.is_file() && !found.is_symlink() => {
                return refuse("is not a regular file");
            }
            Ok(_) if !overwrite => return refuse("exists: --force overwrites it"),
            _ => {}
        }
        match target.open() {
            Ok(_) => Ok(target), // the temporary file goes away again
            Err(error) => refuse(&format!("cannot write here: {error}")),
        }
    }

    /// A file of our own, which is replaced whenever it is written.
    pub fn replacing(path: PathBuf) -> Self {
        Self {
            path,
            overwrite: true,
        }
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the file whole.
    ///
    /// # Errors
    /// [`Error::File`] with what the system answered; the target is then as it was before.
    pub fn write(&self, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
        let written = self.open().and_then(|file| {
            let mut buffer = BufWriter::new(file);
            fill(&mut buffer)?;
            self.publish(buffer.into_inner()?)
        });
        written.map_err(|error| self.failure(error))
    }

    /// A temporary file beside the target.
    fn open(&self) -> io::Result<NamedTempFile> {
        tempfile::Builder::new()
            .prefix(&self.hidden_name())
            .permissions(Permissions::from_mode(0o666)) // less what the user's umask takes away
            .tempfile_in(self.directory())
    }

    /// Gives a temporary file its name, once its bytes are on the disk.
    fn publish(&self, file: NamedTempFile) -> io::Result<()> {
        file.as_file().sync_all()?;
        if self.overwrite {
            file.persist(&self.path)?
        } else {
            file.persist_noclobber(&self.path)?
        };
        // The rename is on the disk only with the directory; some file systems cannot do that, and the file is good anyway.
        let _ = File::open(self.directory()).and_then(|directory| directory.sync_all());
        Ok(())
    }

    fn directory(&self) -> &Path {
        self.path
            .parent()
            .filter(|parent| !parent.as_os_str().is_empty())
            .unwrap_or(Path::new("."))
    }

    fn hidden_name(&self) -> OsString {
        let mut name = OsString::from(".");
        name.push(self.path.file_name().unwrap_or_default());
        name.push(".");
        name
    }

    fn failure(&self, source: io::Error) -> Error {
        Error::File {
            path: self.path.clone(),
            action: "write",
            source,
        }
    }
}

/// Writes the rows of a series as they come, on a thread of its own: a screen must not delay them.
pub struct SeriesWriter {
    target: Target,
    thread: JoinHandle<io::Result<NamedTempFile>>,
}

impl SeriesWriter {
    /// Opens the temporary file and takes rows until their sender is gone.
    ///
    /// # Errors
    /// [`Error::File`] when the temporary file cannot be created.
    pub fn start(target: Target, rows: Receiver<SeriesRow>) -> Result<Self> {
        let file = target.open().map_err(|error| target.failure(error))?;
        let thread = std::thread::spawn(move || write_rows(file, &rows));
        Ok(Self { target, thread })
    }

    /// Waits for the last row and publishes the file.
    ///
    /// # Errors
    /// [`Error::File`] when a row or the file could not be written.
    ///
    /// # Panics
    /// When the writing thread panicked.
    pub fn finish(self) -> Result<()> {
        let written = self
            .thread
            .join()
            .expect("the series' thread only writes rows");
        written
            .and_then(|file| self.target.publish(file))
            .map_err(|error| self.target.failure(error))
    }
}

fn write_rows(file: NamedTempFile, rows: &Receiver<SeriesRow>) -> io::Result<NamedTempFile> {
    let mut table = table(file);
    table.write_record(SERIES_COLUMNS)?;
    table.flush()?;
    while let Ok(row) = rows.recv() {
        table.serialize(row)?;
        for row in rows.try_iter() {
            table.serialize(row)?;
        }
        table.flush()?; // what came so far is in the file, should the machine stop
    }
    table.into_inner().map_err(csv::IntoInnerError::into_error)
}

fn table<W: Write>(writer: W) -> csv::Writer<W> {
    csv::WriterBuilder::new()
        .has_headers(false)
        .from_writer(writer)
}

/// Writes an observable's table; what does not exist is an empty cell.
///
/// # Errors
/// What the writer answers.
pub fn write_observed(writer: &mut dyn Write, observed: &Observed) -> io::Result<()> {
    let mut table = table(writer);
    let columns = &observed.columns;
    table.write_record(columns.iter().map(|column| &column.name))?;
    for row in 0..columns.first().map_or(0, |column| column.values.len()) {
        let cells = columns
            .iter()
            .map(|column| column.values.get(row).copied().flatten());
        table.serialize(cells.collect::<Vec<_>>())?;
    }
    table.flush()
}

/// Writes all balls at one instant; `collisions` has one entry per ball.
///
/// # Errors
/// What the writer answers.
pub fn write_state(
    writer: &mut dyn Write,
    balls: &Placement,
    collisions: &[u64],
) -> io::Result<()> {
    let mut table = table(writer);
    table.write_record(STATE_COLUMNS)?;
    let balls_at = balls
        .positions
        .iter()
        .zip(&balls.velocities)
        .zip(collisions)
        .enumerate();
    for (index, ((position, velocity), collisions)) in balls_at {
        let body = balls.bodies[balls.body_of.get(index).map_or(0, |&body| body as usize)];
        table.serialize((
            index,
            position.to_array(),
            velocity.to_array(),
            body.radius,
            body.mass,
            collisions,
        ))?;
    }
    table.flush()
}

/// Writes the whole history, a row for each stretch as fine as it is still known; of each observable its mean, lowest and
/// highest value, empty where it did not exist.
///
/// # Errors
/// What the writer answers.
pub fn write_history(writer: &mut dyn Write, history: &History) -> io::Result<()> {
    let mut table = table(writer);
    let names = Observable::ALL.map(Observable::name);
    let header = ["begin", "end", "wall_time_s"].map(str::to_owned);
    let columns = names.iter().flat_map(|name| {
        [
            (*name).to_owned(),
            format!("{name}_low"),
            format!("{name}_high"),
        ]
    });
    table.write_record(header.into_iter().chain(columns))?;
    for stretch in history.whole() {
        let values: Vec<_> = Observable::ALL
            .iter()
            .flat_map(|&observable| {
                let range = stretch.get(observable);
                [
                    range.map(|range| range.mean),
                    range.map(|range| range.low),
                    range.map(|range| range.high),
                ]
            })
            .collect();
        table.serialize((stretch.begin, stretch.end, stretch.wall_time_s, values))?;
    }
    table.flush()
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::sync::mpsc;

    use glam::DVec3;

    use super::*;
    use crate::domain::Domain;
    use crate::state::Body;

    fn directory() -> tempfile::TempDir {
        tempfile::tempdir().expect("a temporary directory")
    }

    fn names(directory: &Path) -> Vec<OsString> {
        fs::read_dir(directory)
            .expect("a directory")
            .map(|entry| entry.expect("an entry").file_name())
            .collect()
    }

    #[test]
    fn a_file_that_fails_half_way_leaves_nothing() {
        let directory = directory();
        let target = Target::new(&directory.path().join("out"), false).expect("a good target");
        let failed = target.write(|writer| {
            writer.write_all(b"half")?;
            Err(io::Error::other("the disk is full"))
        });
        assert!(
            failed
                .expect_err("it failed")
                .to_string()
                .ends_with("out: cannot write: the disk is full")
        );
        assert_eq!(names(directory.path()), [] as [&str; 0]);
    }

    #[test]
    fn an_existing_file_is_kept_unless_forced() {
        let directory = directory();
        let path = directory.path().join("out");
        fs::write(&path, "old").expect("a file");
        assert!(
            Target::new(&path, false)
                .expect_err("it exists")
                .to_string()
                .contains("--force")
        );
        let target = Target::new(&path, true).expect("it may be overwritten");
        target
            .write(|writer| writer.write_all(b"new"))
            .expect("it can be written");
        assert_eq!(fs::read(&path).expect("a file"), b"new");
        assert_eq!(names(directory.path()), ["out"]);
    }

    #[test]
    fn a_file_that_appears_during_the_run_is_kept() {
        let directory = directory();
        let path = directory.path().join("out");
        let target = Target::new(&path, false).expect("a good target");
        fs::write(&path, "another run's").expect("a file");
        assert!(target.write(|writer| writer.write_all(b"ours")).is_err());
        assert_eq!(fs::read(&path).expect("a file"), b"another run's");
    }

    #[test]
    fn what_cannot_be_a_file_is_refused_before_the_run() {
        for path in ["/", "/nowhere/out", "/dev/null"] {
            assert!(
                matches!(Target::new(Path::new(path), true), Err(Error::Usage(_))),
                "{path}"
            );
        }
    }

    #[test]
    fn a_series_has_the_agreed_columns_and_empty_cells_for_what_does_not_exist() {
        let directory = directory();
        let path = directory.path().join("series.csv");
        let (sender, receiver) = mpsc::channel();
        let writer =
            SeriesWriter::start(Target::new(&path, false).expect("a good target"), receiver)
                .expect("it opens");
        let row = SeriesRow {
            time: 1e-9,
            wall_time_s: 0.25,
            temperature: Some(273.15),
            pressure_wall: None,
            pressure_virial: Some(0.1 + 0.2),
            pair_collisions: 7,
            wall_collisions: 5,
            queue_length: 3,
            max_overlap: None,
            energy_drift: Some(-0.0),
        };
        sender.send(row).expect("the writer listens");
        drop(sender);
        writer.finish().expect("it is written");
        let text = fs::read_to_string(&path).expect("a file");
        let header = "time,wall_time_s,temperature,pressure_wall,pressure_virial,pair_collisions,wall_collisions,\
                      queue_length,max_overlap,energy_drift";
        assert_eq!(
            text,
            format!("{header}\n1e-9,0.25,273.15,,0.30000000000000004,7,5,3,,-0.0\n")
        );
    }

    #[test]
    fn a_state_reads_back_bit_for_bit() {
        let balls = Placement {
            domain: Domain::container(DVec3::ONE),
            center: DVec3::ZERO,
            bodies: vec![Body {
                radius: 0.1,
                mass: 5.3e-26,
            }],
            body_of: Vec::new(),
            positions: vec![DVec3::new(1.0 / 3.0, -0.0, 5e-324)],
            velocities: vec![DVec3::new(1e300, 0.1 + 0.2, -1.0)],
        };
        let mut bytes = Vec::new();
        write_state(&mut bytes, &balls, &[9]).expect("memory takes all");
        let text = String::from_utf8(bytes).expect("text");
        assert!(text.starts_with("index,x,y,z,vx,vy,vz,radius,mass,collisions\n0,"));
        let cells: Vec<f64> = text
            .lines()
            .nth(1)
            .expect("a row")
            .split(',')
            .map(|cell| cell.parse().expect("a number"))
            .collect();
        let expected = [
            0.0,
            1.0 / 3.0,
            -0.0,
            5e-324,
            1e300,
            0.1 + 0.2,
            -1.0,
            0.1,
            5.3e-26,
            9.0,
        ];
        assert_eq!(
            cells.iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
            expected.map(f64::to_bits)
        );
    }
}
