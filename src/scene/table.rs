//! Balls from a CSV file: the columns of a state file, found by name, in any order, with some left out.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use glam::DVec3;

use super::reader::one_line;
use super::{frames, memory};
use crate::trajectory_file::Format;

/// Most faults reported for one file.
pub(super) const MOST_FAULTS: usize = 20;

/// The rows of a file of balls; columns that the file does not have are `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Columns `x`, `y`, `z` \[length\].
    pub positions: Vec<DVec3>,
    /// Columns `vx`, `vy`, `vz` \[speed\].
    pub velocities: Option<Vec<DVec3>>,
    /// Column `radius` \[length\].
    pub radii: Option<Vec<f64>>,
    /// Column `mass` \[mass\].
    pub masses: Option<Vec<f64>>,
}

/// Which numbers are good, and that in words.
pub(super) type Limit = (fn(f64) -> bool, &'static str);

/// Any number but infinities and NaN.
pub(super) const FINITE: Limit = (f64::is_finite, "must be a finite number");

/// A radius; 0 is a point.
pub(super) const RADIUS: Limit = (
    |radius| radius.is_finite() && (radius == 0.0 || radius >= f64::MIN_POSITIVE),
    "must be a finite number, 0 or greater",
);

/// A mass; infinite for a ball that never moves.
pub(super) const MASS: Limit = (
    |mass| mass >= f64::MIN_POSITIVE,
    "must be greater than 0, or inf for a ball that never moves",
);

/// Columns that are known and not needed here.
const IGNORED: [&str; 2] = ["index", "collisions"];

/// Reads balls from a file, a trajectory's last frame or CSV by its name, or says in one line per fault why not.
pub(super) fn read(path: &Path) -> Result<Rows, Vec<String>> {
    if let Some(format) = Format::of(path) {
        return frames::read(path, format);
    }
    let refuse = |words: String| vec![format!("{}: {}", path.display(), one_line(&words))];
    let file = File::open(path).map_err(|error| refuse(format!("cannot read: {error}")))?;
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(BufReader::new(file));
    let header = reader
        .headers()
        .map_err(|error| refuse(error.to_string()))?
        .clone();
    let column = |name: &str| header.iter().position(|cell| cell == name);
    let unknown = |cell: &&str| {
        !COLUMNS
            .iter()
            .copied()
            .flatten()
            .chain(&IGNORED)
            .any(|name| name == cell)
    };
    if let Some(cell) = header.iter().find(unknown) {
        let shown: String = cell.chars().take(40).collect();
        return Err(refuse(format!(
            "{shown}: unknown column: known are x, y, z, vx, vy, vz, radius, mass, index, collisions"
        )));
    }
    let mut columns = Vec::new();
    for group in COLUMNS {
        let found: Vec<usize> = group.iter().filter_map(|name| column(name)).collect();
        if found.len() != group.len() && (!found.is_empty() || group[0] == "x") {
            return Err(refuse(format!(
                "columns: {} are needed together",
                group.join(", ")
            )));
        }
        columns.push(found);
    }
    let most_rows = memory::available().map_or(u64::MAX, |bytes| bytes / memory::BYTES_PER_BALL);
    let mut rows = Rows {
        positions: Vec::new(),
        velocities: (!columns[1].is_empty()).then(Vec::new),
        radii: (!columns[2].is_empty()).then(Vec::new),
        masses: (!columns[3].is_empty()).then(Vec::new),
    };
    let mut faults = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| refuse(error.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        if rows.positions.len() as u64 >= most_rows {
            return Err(vec![format!(
                "{}:{line}: rows: more than {most_rows} do not fit in memory",
                path.display()
            )]);
        }
        let mut number = |column: usize, (accept, limit): Limit| {
            let cell = &record[column];
            if let Some(value) = cell.parse::<f64>().ok().filter(|value| accept(*value)) {
                return value;
            }
            let shown: String = cell.chars().take(40).collect();
            faults.push(format!(
                "{}:{line}: {} = {}: {limit}",
                path.display(),
                &header[column],
                one_line(&shown)
            ));
            1.0
        };
        let vector = |columns: &[usize], number: &mut dyn FnMut(usize, Limit) -> f64| {
            DVec3::from_array([0, 1, 2].map(|axis| number(columns[axis], FINITE)))
        };
        rows.positions.push(vector(&columns[0], &mut number));
        if let Some(velocities) = &mut rows.velocities {
            velocities.push(vector(&columns[1], &mut number));
        }
        if let Some(radii) = &mut rows.radii {
            radii.push(number(columns[2][0], RADIUS));
        }
        if let Some(masses) = &mut rows.masses {
            masses.push(number(columns[3][0], MASS));
        }
        if faults.len() >= MOST_FAULTS {
            break;
        }
    }
    if faults.is_empty() {
        Ok(rows)
    } else {
        Err(faults)
    }
}

/// Columns by what they make together; only the first group must be there.
const COLUMNS: [&[&str]; 4] = [
    &["x", "y", "z"],
    &["vx", "vy", "vz"],
    &["radius"],
    &["mass"],
];

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str) -> Result<Rows, Vec<String>> {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let path = directory.path().join("balls.csv");
        std::fs::write(&path, text).expect("a small file");
        read(&path).map_err(|faults| {
            let home = format!("{}/", directory.path().display());
            faults
                .into_iter()
                .map(|fault| fault.replace(&home, ""))
                .collect()
        })
    }

    #[test]
    fn columns_are_found_by_name() {
        let rows = rows("mass,z,y,x\n2,0.3,0.2,1e-1\n").expect("a good file");
        assert_eq!(rows.positions, [DVec3::new(0.1, 0.2, 0.3)]);
        assert_eq!(
            (rows.masses, rows.radii, rows.velocities),
            (Some(vec![2.0]), None, None)
        );
    }

    #[track_caller]
    fn check(text: &str, expected: &[&str]) {
        assert_eq!(rows(text).expect_err("a bad file"), expected);
    }

    #[test]
    fn faults_name_the_line_and_the_column() {
        check(
            "x,y,z,radius\n1,nan,0,1\n0,0,0,-1\n",
            &[
                "balls.csv:2: y = nan: must be a finite number",
                "balls.csv:3: radius = -1: must be a finite number, 0 or greater",
            ],
        );
    }

    #[test]
    fn a_file_without_positions_is_refused() {
        check(
            "x,y\n1,2\n",
            &["balls.csv: columns: x, y, z are needed together"],
        );
    }

    #[test]
    fn a_column_nobody_knows_is_refused() {
        check(
            "x,y,z,colour\n",
            &[
                "balls.csv: colour: unknown column: known are x, y, z, vx, vy, vz, radius, mass, index, collisions",
            ],
        );
    }
}
