//! Removes what runs that have ended have left.

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, SystemTime};

use crate::error::{Error, Result};
use crate::run::say;
use crate::run_directory::Found;

/// Removes the directories of runs that have ended, all of them or those that are named, after a question unless `yes`.
///
/// # Errors
/// [`Error::Usage`] when a run that is named does not exist or is going on, or nobody can be asked; [`Error::File`] when the
/// system refuses.
pub fn clean(names: &[String], older_than: Option<Duration>, yes: bool) -> Result<u8> {
    let mut runs = if names.is_empty() {
        let mut all = Found::all()?;
        all.retain(|run| !run.is_going_on());
        all
    } else {
        let named = names.iter().map(|name| Found::by_name(name));
        named.collect::<Result<Vec<_>>>()?
    };
    if let Some(run) = runs.iter().find(|run| run.is_going_on()) {
        let name = &run.name;
        return Err(Error::Usage(format!(
            "{name}: is going on: `moltop stop {name}` ends it"
        )));
    }
    if let Some(age) = older_than {
        let old = |run: &Found| {
            let since = run
                .started()
                .and_then(|begun| SystemTime::now().duration_since(begun).ok());
            since.is_some_and(|since| since >= age)
        };
        runs.retain(old);
    }
    runs.sort_by(|one, other| one.name.cmp(&other.name));
    runs.dedup();
    if runs.is_empty() {
        say("no run has ended: there is nothing to remove");
        return Ok(0);
    }
    let mut sum = 0;
    for run in &runs {
        if run.lives_elsewhere() {
            say(&format!(
                "{}  stays in {}, and is listed no more",
                run.name,
                run.path.display()
            ));
        } else {
            let size = run.disk_usage();
            sum += size;
            say(&format!("{}  {}", run.name, megabytes(size)));
        }
    }
    if !yes && !ask(runs.len(), sum)? {
        say("nothing was removed");
        return Ok(0);
    }
    for run in &runs {
        run.remove()?;
    }
    say(&format!("removed {}", counted(runs.len())));
    Ok(0)
}

fn megabytes(size: u64) -> String {
    format!("{:.1} MB", size as f64 / 1e6)
}

fn counted(runs: usize) -> String {
    if runs == 1 {
        "1 run".to_owned()
    } else {
        format!("{runs} runs")
    }
}

/// Asks on the terminal.
fn ask(runs: usize, size: u64) -> Result<bool> {
    if !io::stdin().is_terminal() {
        return Err(Error::Usage(
            "nobody can be asked here: --yes removes these runs".to_owned(),
        ));
    }
    let mut stderr = io::stderr();
    let _ = write!(
        stderr,
        "remove {}, {}, with summaries and checkpoints? y or n: ",
        counted(runs),
        megabytes(size)
    );
    let _ = stderr.flush();
    let mut answer = String::new();
    io::stdin()
        .read_line(&mut answer)
        .map_err(Error::Terminal)?;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}
