//! The verdicts as a table on the terminal, as JSON and as Markdown.

use std::fmt::Write as _;

use serde::Serialize;

use super::{Done, Options, Outcome, ROWS, part};
use crate::error::Result;
use crate::experiment::page::{machine, make_directory, print};
use crate::output::Target;

/// Files to be written at the end.
pub struct Outputs {
    json: Option<Target>,
    markdown: Option<Target>,
}

/// What `--json` prints and `extremes.json` holds.
#[derive(Serialize)]
pub struct Report<'a> {
    schema: &'static str,
    version: &'static str,
    optimized: bool,
    machine: String,
    rows: &'a [Done],
    /// Parts of the matrix that this run leaves out.
    left_out: Vec<String>,
}

impl Outputs {
    /// Checks that the files can be written.
    ///
    /// # Errors
    /// [`Error::Usage`] if not, [`Error::File`] if the directory cannot be made.
    pub fn new(options: &Options) -> Result<Self> {
        let Some(directory) = &options.out else {
            return Ok(Self {
                json: None,
                markdown: None,
            });
        };
        make_directory(directory)?;
        let target = |name: &str| Target::new(&directory.join(name), options.force).map(Some);
        Ok(Self {
            json: target("extremes.json")?,
            markdown: target("extremes.md")?,
        })
    }

    /// Writes them.
    ///
    /// # Errors
    /// [`Error::File`] with what the system answered.
    pub fn write(&self, report: &Report) -> Result<()> {
        if let Some(target) = &self.json {
            target.write(|file| file.write_all(report.json().as_bytes()))?;
        }
        if let Some(target) = &self.markdown {
            target.write(|file| file.write_all(report.markdown().as_bytes()))?;
        }
        Ok(())
    }
}

fn heading(row: &Done) -> String {
    let Done {
        number,
        title,
        tier,
        outcome,
        wall_time_s,
        ..
    } = row;
    let word = outcome.word();
    format!("{number:>3}  {tier:?}  {word:<8}{wall_time_s:>9.2} s  {title}")
}

/// Prints a row that has just been run: one line, and one more for each figure.
///
/// # Errors
/// [`Error::File`] when stdout takes nothing more.
pub fn print_row(row: &Done) -> Result<()> {
    let mut text = format!("{}\n", heading(row));
    for line in row.verdict.lines() {
        writeln!(text, "       {line}").expect("memory takes all");
    }
    print(&text)
}

impl<'a> Report<'a> {
    /// Of these rows, of all there are.
    pub fn new(rows: &'a [Done]) -> Self {
        let ran = |part: &&super::Row| {
            let same = |row: &Done| (row.number, row.title) == (part.number, part.title);
            rows.iter().any(same)
        };
        Self {
            schema: "moltop.extremes/1",
            version: env!("CARGO_PKG_VERSION"),
            optimized: !cfg!(debug_assertions),
            machine: machine(),
            rows,
            left_out: ROWS.iter().filter(|row| !ran(row)).map(part).collect(),
        }
    }

    /// Prints the last lines, or all of the JSON.
    ///
    /// # Errors
    /// [`Error::File`] when stdout takes nothing more.
    pub fn finish(&self, as_json: bool) -> Result<()> {
        print(&if as_json {
            self.json()
        } else {
            self.last_lines()
        })
    }

    fn json(&self) -> String {
        let text = serde_json::to_string_pretty(self).expect("verdicts are plain data");
        format!("{text}\n")
    }

    /// How many passed and failed, and what was not run.
    fn last_lines(&self) -> String {
        let count = |outcome| {
            self.rows
                .iter()
                .filter(|row| row.outcome == outcome)
                .count()
        };
        let [passed, failed, not_run] = [Outcome::Pass, Outcome::Fail, Outcome::NotRun].map(count);
        let seconds: f64 = self.rows.iter().map(|row| row.wall_time_s).sum();
        let time = crate::quantity::duration(seconds);
        let mut text = format!("{passed} passed, {failed} failed, {not_run} not run, in {time}\n");
        let in_part = self
            .rows
            .iter()
            .filter(|row| !row.verdict.not_run.is_empty());
        let in_part: Vec<String> = in_part.map(|row| row.number.to_string()).collect();
        if !in_part.is_empty() {
            writeln!(text, "run in part: row {}", in_part.join(", ")).expect("memory takes all");
        }
        if !self.left_out.is_empty() {
            let parts = self.left_out.join(", ");
            writeln!(text, "left out: row {parts}").expect("memory takes all");
        }
        text
    }

    fn markdown(&self) -> String {
        let lines = self.last_lines().replace('\n', "\n\n");
        let mut text = format!("# Extremes\n\n{lines}{}\n\n", self.machine);
        text.push_str(
            "| # | extreme | engines | tier | verdict | figures | s |\n|---|---|---|---|---|---|---|\n",
        );
        for row in self.rows {
            let figures = row.verdict.to_string().replace('|', "\\|");
            let (number, title, engines, tier) = (row.number, row.title, row.engines, row.tier);
            let (word, figures, seconds) = (row.outcome.word(), figures, row.wall_time_s);
            writeln!(
                text,
                "| {number} | {title} | {engines} | {tier:?} | {word} | {figures} | {seconds:.2} |"
            )
            .expect("memory takes all");
        }
        text
    }
}
