//! What an experiment leaves: tables on the terminal, and with `--out` a page of Markdown with plots, the tables as CSV, and all of
//! it as JSON.
//!
//! The files are checked before anything is measured, and each appears whole or not at all. A table is one set of numbers: the
//! terminal and the page show four digits of each, CSV and JSON every digit.

use std::fmt::Write as _;
use std::fs;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Map, Value as Json, json};

use crate::error::{Error, Result};
use crate::experiment::plot::Plot;
use crate::output::Target;
use crate::quantity::plain;

/// What every experiment is asked.
#[derive(Clone, Debug, Default, Args)]
pub struct Options {
    /// Smaller and shorter, in about a minute
    #[arg(long)]
    pub quick: bool,
    /// Write the results into this directory: a page (.md) with its plots (.svg), tables (.csv), and all of it as .json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Overwrite files that exist
    #[arg(long)]
    pub force: bool,
    /// Print JSON instead of tables
    #[arg(long)]
    pub json: bool,
}

/// One field of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Words.
    Text(String),
    /// A measured number.
    Number(f64),
    /// A measured number, with so many decimals for people.
    Fixed(f64, usize),
    /// A count.
    Count(u64),
    /// Not measured, or does not exist.
    Nothing,
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        if number.is_finite() {
            Self::Number(number)
        } else {
            Self::Nothing
        }
    }
}

impl From<u64> for Value {
    fn from(count: u64) -> Self {
        Self::Count(count)
    }
}

impl<T: Into<Value>> From<Option<T>> for Value {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Nothing, Into::into)
    }
}

impl Value {
    fn for_people(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(number) => plain(*number),
            Self::Fixed(number, decimals) => format!("{number:.decimals$}"),
            Self::Count(count) => count.to_string(),
            Self::Nothing => "–".to_owned(),
        }
    }

    fn exact(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(number) | Self::Fixed(number, _) => format!("{number:?}"),
            Self::Count(count) => count.to_string(),
            Self::Nothing => String::new(),
        }
    }

    fn json(&self) -> Json {
        match self {
            Self::Text(text) => json!(text),
            Self::Number(number) | Self::Fixed(number, _) => json!(number),
            Self::Count(count) => json!(count),
            Self::Nothing => Json::Null,
        }
    }
}

/// Rows under named columns.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// A word for file names and JSON.
    pub name: &'static str,
    /// What it shows.
    pub title: String,
    /// Heads, with units: `time [s]`; in CSV and JSON `time_s`.
    pub columns: Vec<String>,
    /// As many values as columns in each.
    pub rows: Vec<Vec<Value>>,
    /// Too long to be read: shown in files of numbers only.
    files_only: bool,
}

impl Table {
    /// A table without rows.
    pub fn new(name: &'static str, title: impl Into<String>, columns: &[&str]) -> Self {
        Self {
            name,
            title: title.into(),
            columns: columns.iter().map(|&column| column.to_owned()).collect(),
            rows: Vec::new(),
            files_only: false,
        }
    }

    /// A table that only programs will read: CSV and JSON.
    pub fn only_in_files(name: &'static str, title: &str, columns: &[&str]) -> Self {
        Self {
            files_only: true,
            ..Self::new(name, title, columns)
        }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If it has not one value for each column.
    pub fn push<const N: usize>(&mut self, row: [Value; N]) {
        assert_eq!(
            N,
            self.columns.len(),
            "a value for each column of {}",
            self.name
        );
        self.rows.push(row.into());
    }

    fn keys(&self) -> Vec<String> {
        self.columns.iter().map(|column| key(column)).collect()
    }

    fn for_terminal(&self) -> String {
        let shown: Vec<Vec<String>> = self
            .rows
            .iter()
            .map(|row| row.iter().map(Value::for_people).collect())
            .collect();
        let widths: Vec<usize> = (0..self.columns.len())
            .map(|column| {
                let cells = shown.iter().map(|row| row[column].chars().count());
                cells.fold(self.columns[column].chars().count(), usize::max)
            })
            .collect();
        let line = |cells: &[String], row: Option<&Vec<Value>>| {
            let mut text = String::from(" ");
            for (column, cell) in cells.iter().enumerate() {
                let room = " ".repeat(widths[column] - cell.chars().count());
                let left = row.map_or_else(|| self.is_text(column), |row| is_text(&row[column]));
                if left {
                    write!(text, " {cell}{room} ").expect("memory takes all");
                } else {
                    write!(text, " {room}{cell} ").expect("memory takes all");
                }
            }
            format!("{}\n", text.trim_end())
        };
        let mut text = format!("{}\n{}", self.title, line(&self.columns, None));
        for (cells, row) in shown.iter().zip(&self.rows) {
            text.push_str(&line(cells, Some(row)));
        }
        text
    }

    /// Whether a column holds words.
    fn is_text(&self, column: usize) -> bool {
        self.rows.first().is_some_and(|row| is_text(&row[column]))
    }

    fn markdown(&self) -> String {
        let mut text = format!("**{}**\n\n|", self.title);
        let add = |text: &mut String, cell: &str| {
            write!(text, " {} |", cell.replace('|', "\\|")).expect("memory takes all");
        };
        self.columns
            .iter()
            .for_each(|column| add(&mut text, column));
        text.push_str("\n|");
        for column in 0..self.columns.len() {
            text.push_str(if self.is_text(column) {
                "---|"
            } else {
                "---:|"
            });
        }
        for row in &self.rows {
            text.push_str("\n|");
            for value in row {
                add(&mut text, &value.for_people());
            }
        }
        text.push('\n');
        text
    }

    fn write_csv(&self, file: &mut dyn Write) -> io::Result<()> {
        let mut writer = csv::Writer::from_writer(file);
        writer.write_record(self.keys())?;
        for row in &self.rows {
            writer.write_record(row.iter().map(Value::exact))?;
        }
        writer.flush()
    }

    fn json(&self) -> Json {
        let keys = self.keys();
        let object = |row: &Vec<Value>| -> Json {
            let fields = keys.iter().cloned().zip(row.iter().map(Value::json));
            Json::Object(fields.collect::<Map<_, _>>())
        };
        json!({ "title": self.title, "rows": self.rows.iter().map(object).collect::<Vec<_>>() })
    }
}

fn is_text(value: &Value) -> bool {
    matches!(value, Value::Text(_))
}

/// A head as a key: lower case, everything between words an underscore.
fn key(head: &str) -> String {
    let spaced: String = head
        .replace('%', "percent")
        .chars()
        .map(|letter| match letter {
            'A'..='Z' => letter.to_ascii_lowercase(),
            'a'..='z' | '0'..='9' => letter,
            _ => ' ',
        })
        .collect();
    spaced.split_whitespace().collect::<Vec<_>>().join("_")
}

/// The results of an experiment.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// The experiment, as the command line names it: also the files' name.
    pub name: &'static str,
    /// What was asked.
    pub title: &'static str,
    /// The command that made this.
    pub command: String,
    /// The numbers.
    pub tables: Vec<Table>,
    /// What they say, a paragraph each.
    pub paragraphs: Vec<String>,
    /// Pictures of them.
    pub plots: Vec<Plot>,
}

/// Where a page goes; checked before anything is measured.
#[derive(Debug)]
pub struct Outputs {
    name: &'static str,
    options: Options,
}

impl Outputs {
    /// Makes the directory, and checks that the files can be written: `plots` and `tables` are their names.
    ///
    /// # Errors
    /// [`Error::Usage`] for files that exist, [`Error::File`] if the directory cannot be made.
    pub fn new(
        name: &'static str,
        options: &Options,
        tables: &[&str],
        plots: &[&str],
    ) -> Result<Self> {
        let outputs = Self {
            name,
            options: options.clone(),
        };
        if let Some(directory) = &options.out {
            make_directory(directory)?;
            let tables = tables.iter().map(|table| outputs.file(table, "csv"));
            let plots = plots.iter().map(|plot| outputs.file(plot, "svg"));
            let whole = ["md", "json"].map(|kind| outputs.file("", kind));
            for file in tables.chain(plots).chain(whole) {
                Target::new(&directory.join(file), options.force)?;
            }
        }
        Ok(outputs)
    }

    fn file(&self, part: &str, kind: &str) -> String {
        let dash = if part.is_empty() { "" } else { "-" };
        format!("{}{dash}{part}.{kind}", self.name)
    }

    /// Prints the page, and writes its files.
    ///
    /// # Errors
    /// [`Error::File`] with what the system answered.
    pub fn finish(&self, page: &Page) -> Result<()> {
        let document = page.json();
        if self.options.json {
            print(&document)?;
        } else {
            print(&page.for_terminal())?;
        }
        let Some(directory) = &self.options.out else {
            return Ok(());
        };
        let target = |file: &str| Target::new(&directory.join(file), self.options.force);
        for table in &page.tables {
            target(&self.file(table.name, "csv"))?.write(|file| table.write_csv(file))?;
        }
        let mut pictures = Vec::new();
        for plot in &page.plots {
            let file = self.file(plot.name, "svg");
            target(&file)?.write(|writer| writer.write_all(plot.svg().as_bytes()))?;
            pictures.push(file);
        }
        target(&self.file("", "json"))?.write(|file| file.write_all(document.as_bytes()))?;
        let text = page.markdown(&pictures);
        target(&self.file("", "md"))?.write(|file| file.write_all(text.as_bytes()))
    }
}

impl Page {
    fn to_be_read(&self) -> impl Iterator<Item = &Table> {
        self.tables.iter().filter(|table| !table.files_only)
    }

    fn for_terminal(&self) -> String {
        let tables = self.to_be_read().map(|table| table.for_terminal() + "\n");
        tables
            .chain(
                self.paragraphs
                    .iter()
                    .map(|paragraph| format!("{paragraph}\n")),
            )
            .collect()
    }

    fn markdown(&self, pictures: &[String]) -> String {
        let mut text = format!(
            "# {}\n\n`{}`, moltop {}, {}\n",
            self.title,
            self.command,
            env!("CARGO_PKG_VERSION"),
            machine()
        );
        for paragraph in &self.paragraphs {
            write!(text, "\n{paragraph}\n").expect("memory takes all");
        }
        for table in self.to_be_read() {
            write!(text, "\n{}", table.markdown()).expect("memory takes all");
        }
        for (plot, file) in self.plots.iter().zip(pictures) {
            write!(text, "\n![{}]({file})\n", plot.title).expect("memory takes all");
        }
        text
    }

    fn json(&self) -> String {
        let tables: Map<_, _> = self
            .tables
            .iter()
            .map(|table| (table.name.to_owned(), table.json()))
            .collect();
        let document = json!({
            "schema": format!("moltop.{}/1", self.name),
            "version": env!("CARGO_PKG_VERSION"),
            "command": self.command,
            "optimized": !cfg!(debug_assertions),
            "machine": machine(),
            "tables": tables,
            "paragraphs": self.paragraphs,
        });
        let text = serde_json::to_string_pretty(&document).expect("a page is plain data");
        format!("{text}\n")
    }
}

/// Makes a directory for results.
///
/// # Errors
/// [`Error::File`] with what the system answered.
pub fn make_directory(directory: &Path) -> Result<()> {
    fs::create_dir_all(directory).map_err(|source| Error::File {
        path: directory.to_owned(),
        action: "create",
        source,
    })
}

/// Architecture, system and processor, as far as the system tells.
pub fn machine() -> String {
    let information = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = information
        .lines()
        .find_map(|line| line.strip_prefix("model name"))
        .map_or("", |rest| rest.trim_start_matches([' ', '\t', ':']));
    let (architecture, system) = (std::env::consts::ARCH, std::env::consts::OS);
    format!("{architecture} {system} {model}")
        .trim_end()
        .to_owned()
}

/// Writes to stdout; a reader that has seen enough, such as `head`, is no failure.
///
/// # Errors
/// [`Error::File`] when stdout takes nothing more.
pub fn print(text: &str) -> Result<()> {
    if io::stderr().is_terminal() {
        let _ = write!(io::stderr(), "\r\x1b[K"); // the progress gives way
    }
    let mut stdout = io::stdout().lock();
    match stdout
        .write_all(text.as_bytes())
        .and_then(|()| stdout.flush())
    {
        Err(source) if source.kind() != io::ErrorKind::BrokenPipe => Err(Error::File {
            path: "stdout".into(),
            action: "write",
            source,
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new("t", "A table", &["engine", "Time [s]", "ΔP [%]"]);
        table.push(["event".into(), 0.1.into(), f64::NAN.into()]);
        table.push(["step".into(), 12.0.into(), 3_u64.into()]);
        table
    }

    #[test]
    fn a_table_is_aligned_for_people_and_exact_for_programs() {
        let expected = "A table\n  engine  Time [s]  ΔP [%]\n  event     0.1000       –\n  step       12.00       3\n";
        assert_eq!(table().for_terminal(), expected);
        let mut csv = Vec::new();
        table().write_csv(&mut csv).expect("memory takes all");
        assert_eq!(
            String::from_utf8_lossy(&csv),
            "engine,time_s,p_percent\nevent,0.1,\nstep,12.0,3\n"
        );
        assert_eq!(
            table().json()["rows"][0],
            json!({ "engine": "event", "time_s": 0.1, "p_percent": null })
        );
    }
}
