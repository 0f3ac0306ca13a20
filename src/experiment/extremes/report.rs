//! The verdicts as a table on the terminal, as JSON and as Markdown.

use std::fmt::Write as _;

use serde::Serialize;

use super::{Done, Options, Outcome};
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
struct Document<'a> {
    schema: &'static str,
    version: &'static str,
    optimized: bool,
    machine: String,
    rows: &'a [Done],
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
    pub fn write(&self, rows: &[Done]) -> Result<()> {
        if let Some(target) = &self.json {
            target.write(|file| file.write_all(json(rows).as_bytes()))?;
        }
        if let Some(target) = &self.markdown {
            target.write(|file| file.write_all(markdown(rows).as_bytes()))?;
        }
        Ok(())
    }
}

fn json(rows: &[Done]) -> String {
    let document = Document {
        schema: "moltop.extremes/1",
        version: env!("CARGO_PKG_VERSION"),
        optimized: !cfg!(debug_assertions),
        machine: machine(),
        rows,
    };
    let text = serde_json::to_string_pretty(&document).expect("verdicts are plain data");
    format!("{text}\n")
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

/// The last line, or all of the JSON.
///
/// # Errors
/// [`Error::File`] when stdout takes nothing more.
pub fn finish(rows: &[Done], as_json: bool) -> Result<()> {
    let text = if as_json { json(rows) } else { last_line(rows) };
    print(&text)
}

fn last_line(rows: &[Done]) -> String {
    let count = |outcome| rows.iter().filter(|row| row.outcome == outcome).count();
    let [passed, failed, not_run] = [Outcome::Pass, Outcome::Fail, Outcome::NotRun].map(count);
    let seconds: f64 = rows.iter().map(|row| row.wall_time_s).sum();
    let time = crate::quantity::duration(seconds);
    format!("{passed} passed, {failed} failed, {not_run} not run, in {time}\n")
}

fn markdown(rows: &[Done]) -> String {
    let mut text = format!("# Extremes\n\n{}{}\n\n", last_line(rows), machine());
    text.push_str(
        "| # | extreme | engines | tier | verdict | figures | s |\n|---|---|---|---|---|---|---|\n",
    );
    for row in rows {
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
