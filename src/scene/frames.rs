//! Balls from the last frame of a trajectory: extended XYZ or a LAMMPS dump, compressed or not.
//!
//! Other programs' files do as well, as far as their columns say what they are; the box that a frame tells of is not looked at:
//! the scene has its own.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use glam::DVec3;

use super::memory;
use super::reader::one_line;
use super::table::{FINITE, Limit, MASS, Rows};
use super::table::{MOST_FAULTS, RADIUS};
use crate::trajectory_file::{Format, Layout};

type Faults = Vec<String>;

/// Where a frame's rows have what.
#[derive(Clone, Debug, Default, PartialEq)]
struct Columns {
    names: Vec<String>,
    position: Option<[usize; 3]>,
    velocity: Option<[usize; 3]>,
    radius: Option<usize>,
    mass: Option<usize>,
    id: Option<usize>,
}

struct Lines<'p> {
    path: &'p Path,
    reader: Box<dyn BufRead>,
    number: u64,
    text: String,
}

/// Reads the last frame, or says in one line per fault why not.
pub(super) fn read(path: &Path, format: Format) -> Result<Rows, Faults> {
    let mut lines = Lines::open(path, format.compressed)?;
    let mut last = None;
    loop {
        let begun = match format.layout {
            Layout::ExtendedXyz => begin_xyz(&mut lines)?,
            Layout::LammpsDump => begin_dump(&mut lines)?,
        };
        let Some((count, columns)) = begun else {
            return last.ok_or_else(|| vec![format!("{}: holds no frame", path.display())]);
        };
        last = Some(read_rows(&mut lines, count, &columns)?);
    }
}

impl Lines<'_> {
    fn open(path: &Path, compressed: bool) -> Result<Lines<'_>, Faults> {
        let refuse =
            |error: std::io::Error| vec![format!("{}: cannot read: {error}", path.display())];
        let file = File::open(path).map_err(refuse)?;
        let reader: Box<dyn BufRead> = if compressed {
            Box::new(BufReader::new(zstd::Decoder::new(file).map_err(refuse)?))
        } else {
            Box::new(BufReader::new(file))
        };
        Ok(Lines {
            path,
            reader,
            number: 0,
            text: String::new(),
        })
    }

    /// Goes to the next line; false at the end of the file.
    fn advance(&mut self) -> Result<bool, Faults> {
        self.text.clear();
        self.number += 1;
        match self.reader.read_line(&mut self.text) {
            Ok(read) => Ok(read > 0),
            Err(error) => Err(self.refuse(&format!("cannot read: {error}"))),
        }
    }

    /// The next line, which must be there.
    fn expect(&mut self, what: &str) -> Result<&str, Faults> {
        if self.advance()? {
            return Ok(self.text.trim());
        }
        Err(self.refuse(&format!(
            "the file ends before {what}: its last frame is cut short"
        )))
    }

    fn refuse(&self, words: &str) -> Faults {
        vec![self.fault(words)]
    }

    fn fault(&self, words: &str) -> String {
        format!(
            "{}:{}: {}",
            self.path.display(),
            self.number,
            one_line(words)
        )
    }

    /// The number of balls that stands in this line.
    fn count(&self) -> Result<usize, Faults> {
        let most = memory::available().map_or(u64::MAX, |bytes| bytes / memory::BYTES_PER_BALL);
        match self.text.trim().parse::<u64>() {
            Ok(count) if count <= most => Ok(count as usize),
            Ok(count) => Err(self.refuse(&format!(
                "{count} balls: more than {most} do not fit in memory"
            ))),
            Err(_) => {
                let words = format!("{}: must be the number of balls", self.shown());
                Err(self.refuse(&words))
            }
        }
    }

    /// The beginning of the line, for messages.
    fn shown(&self) -> String {
        self.text.trim().chars().take(40).collect()
    }
}

/// Reads the two lines before the rows of an extended XYZ frame; `None` at the end of the file.
fn begin_xyz(lines: &mut Lines) -> Result<Option<(usize, Columns)>, Faults> {
    loop {
        if !lines.advance()? {
            return Ok(None);
        }
        if !lines.text.trim().is_empty() {
            break;
        }
    }
    let count = lines.count()?;
    let comment = lines.expect("the frame's second line")?;
    let properties = comment.split_once("Properties=").map(|(_, rest)| {
        let rest = rest.trim_start_matches('"');
        let end = rest.find(|letter: char| letter.is_whitespace() || letter == '"');
        &rest[..end.unwrap_or(rest.len())]
    });
    let mut names = Vec::new();
    let mut parts = properties.unwrap_or("species:S:1:pos:R:3").split(':');
    while let Some(name) = parts.next() {
        let width = (parts.next()).and_then(|_| parts.next()?.parse::<usize>().ok());
        let Some(width) = width.filter(|width| (1..=64).contains(width)) else {
            return Err(lines.refuse("Properties: must be name:type:columns, one after the other"));
        };
        names.extend((0..width).map(|part| (name.to_owned(), part, width)));
    }
    let vector = |known: &[&str]| {
        let first = (names.iter())
            .position(|(name, part, width)| (*part, *width) == (0, 3) && known.contains(&&**name));
        first.map(|first| [first, first + 1, first + 2])
    };
    let scalar = |known: &[&str]| {
        (names.iter()).position(|(name, _, width)| *width == 1 && known.contains(&&**name))
    };
    let columns = Columns {
        position: vector(&["pos", "positions"]),
        velocity: vector(&["velo", "vel", "velocity", "velocities"]),
        radius: scalar(&["radius"]),
        mass: scalar(&["mass", "masses"]),
        id: scalar(&["id"]),
        names: names.into_iter().map(|(name, ..)| name).collect(),
    };
    if columns.position.is_none() {
        return Err(lines.refuse("Properties: pos:R:3 is needed"));
    }
    Ok(Some((count, columns)))
}

/// Reads what stands before the rows of a dump's frame; `None` at the end of the file.
fn begin_dump(lines: &mut Lines) -> Result<Option<(usize, Columns)>, Faults> {
    let mut count = None;
    let mut begun = false;
    loop {
        if !lines.advance()? {
            if begun {
                return Err(
                    lines.refuse("the file ends before ITEM: ATOMS: its last frame is cut short")
                );
            }
            return Ok(None);
        }
        let line = lines.text.trim().to_owned();
        if line.is_empty() && !begun {
            continue;
        }
        begun = true;
        let Some(item) = line.strip_prefix("ITEM: ") else {
            let words = format!("{}: must be an ITEM: of a LAMMPS dump", lines.shown());
            return Err(lines.refuse(&words));
        };
        if let Some(header) = item.strip_prefix("ATOMS") {
            let columns = dump_columns(header);
            if columns.position.is_none() {
                return Err(lines.refuse("ITEM: ATOMS: the columns x y z (or xu yu zu) are needed"));
            }
            let count =
                count.ok_or_else(|| lines.refuse("ITEM: NUMBER OF ATOMS must come before"))?;
            return Ok(Some((count, columns)));
        }
        if item.starts_with("NUMBER OF ATOMS") {
            lines.expect("the number of balls")?;
            count = Some(lines.count()?);
            continue;
        }
        let values = if item.starts_with("BOX BOUNDS") { 3 } else { 1 };
        for _ in 0..values {
            lines.expect("the values of an ITEM")?;
        }
    }
}

fn dump_columns(header: &str) -> Columns {
    let names: Vec<String> = header.split_whitespace().map(str::to_owned).collect();
    let at = |wanted: &str| names.iter().position(|name| name == wanted);
    let vector = |wanted: [&str; 3]| {
        let [x, y, z] = wanted.map(at);
        Some([x?, y?, z?])
    };
    Columns {
        position: vector(["x", "y", "z"]).or_else(|| vector(["xu", "yu", "zu"])),
        velocity: vector(["vx", "vy", "vz"]),
        radius: at("radius"),
        mass: at("mass"),
        id: at("id"),
        names,
    }
}

/// Reads the rows of a frame, in the order of their ids where there are any.
fn read_rows(lines: &mut Lines, count: usize, columns: &Columns) -> Result<Rows, Faults> {
    let mut faults = Vec::new();
    let mut rows = Vec::with_capacity(count);
    for row in 0..count {
        lines.expect(&format!("ball {} of {count}", row + 1))?;
        let cells: Vec<&str> = lines.text.split_whitespace().collect();
        if cells.len() < columns.names.len() {
            let (found, wanted) = (cells.len(), columns.names.len());
            return Err(lines.refuse(&format!("{found} columns: must be {wanted}")));
        }
        let mut number = |column: usize, (accept, limit): Limit| {
            let value = cells[column].parse::<f64>().ok();
            value.filter(|value| accept(*value)).unwrap_or_else(|| {
                let shown: String = cells[column].chars().take(40).collect();
                let name = &columns.names[column];
                faults.push(lines.fault(&format!("{name} = {shown}: {limit}")));
                1.0
            })
        };
        let mut vector = |columns: Option<[usize; 3]>| {
            columns.map_or(DVec3::ZERO, |columns| {
                DVec3::from_array(columns.map(|column| number(column, FINITE)))
            })
        };
        let (position, velocity) = (vector(columns.position), vector(columns.velocity));
        let radius = columns.radius.map_or(0.0, |column| number(column, RADIUS));
        let mass = columns.mass.map_or(0.0, |column| number(column, MASS));
        let id = columns
            .id
            .map_or(0, |column| cells[column].parse::<u64>().unwrap_or(0));
        rows.push((id, position, velocity, radius, mass));
        if faults.len() >= MOST_FAULTS {
            break;
        }
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    rows.sort_by_key(|(id, ..)| *id);
    Ok(Rows {
        positions: rows.iter().map(|row| row.1).collect(),
        velocities: columns
            .velocity
            .map(|_| rows.iter().map(|row| row.2).collect()),
        radii: columns
            .radius
            .map(|_| rows.iter().map(|row| row.3).collect()),
        masses: columns.mass.map(|_| rows.iter().map(|row| row.4).collect()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(name: &str, text: &str) -> Result<Rows, Faults> {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let path = directory.path().join(name);
        std::fs::write(&path, text).expect("a small file");
        let home = format!("{}/", directory.path().display());
        let format = Format::of(&path).expect("a trajectory's name");
        read(&path, format).map_err(|faults| {
            faults
                .iter()
                .map(|fault| fault.replace(&home, ""))
                .collect()
        })
    }

    #[track_caller]
    fn check(name: &str, text: &str, expected: &str) {
        assert_eq!(rows(name, text).expect_err("a bad file"), [expected]);
    }

    #[test]
    fn the_last_frame_of_another_programs_files_is_read() {
        let plain = rows("balls.xyz", "1\nfirst\nAr 0 0 0\n1\nsecond\nAr 1 2 3\n").expect("good");
        assert_eq!(plain.positions, [DVec3::new(1.0, 2.0, 3.0)]);
        assert_eq!((plain.velocities, plain.radii), (None, None));
        let dump = "ITEM: UNITS\nlj\nITEM: TIMESTEP\n5\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n0 1\n\
                    ITEM: ATOMS id x y z mass\n2 0.2 0 0 8\n1 0.1 0 0 7\n";
        let dump = rows("balls.dump", dump).expect("good");
        assert_eq!(dump.positions, [DVec3::X * 0.1, DVec3::X * 0.2]);
        assert_eq!(dump.masses, Some(vec![7.0, 8.0]));
    }

    #[test]
    fn faults_name_the_line() {
        check(
            "b.xyz",
            "two\n",
            "b.xyz:1: two: must be the number of balls",
        );
        check("b.xyz", "", "b.xyz: holds no frame");
        check(
            "b.xyz",
            "1\n\nAr 0 nan 0\n",
            "b.xyz:3: pos = nan: must be a finite number",
        );
        check(
            "b.xyz",
            "1\nProperties=species:S:1\nAr\n",
            "b.xyz:2: Properties: pos:R:3 is needed",
        );
        check("b.xyz", "1\n\nAr 0 0\n", "b.xyz:3: 3 columns: must be 4");
        check(
            "b.xyz",
            "2\n\nAr 0 0 0\n",
            "b.xyz:4: the file ends before ball 2 of 2: its last frame is cut short",
        );
        check(
            "b.dump",
            "junk\n",
            "b.dump:1: junk: must be an ITEM: of a LAMMPS dump",
        );
        check(
            "b.dump",
            "ITEM: TIMESTEP\n0\n",
            "b.dump:3: the file ends before ITEM: ATOMS: its last frame is cut short",
        );
        let scaled = "ITEM: NUMBER OF ATOMS\n1\nITEM: ATOMS id xs ys zs\n1 0 0 0\n";
        check(
            "b.dump",
            scaled,
            "b.dump:3: ITEM: ATOMS: the columns x y z (or xu yu zu) are needed",
        );
    }
}
