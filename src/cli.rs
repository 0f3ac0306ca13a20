//! The command line: what was typed, in types.

use std::path::PathBuf;

use clap::builder::FalseyValueParser;
use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;

use crate::worker::engines::{CalendarName, EngineName};

const EXAMPLES: &str = "\
Examples:
  moltop                                     watch oxygen near standard conditions
  moltop configs/seed-512.toml               watch 512 balls
  moltop check configs/oxygen.toml           what it is and what it will cost, before it runs
  moltop run configs/seed-512.toml --summary out.json --series out.csv
  moltop run configs/oxygen.toml --until 1e-10 --state end.csv
  moltop run configs/seed-512.toml --engine step --dt 0.01
  moltop run configs/oxygen.toml --yes       all 20 microseconds: days

A scene is a TOML file; its numbers are in its own units, and so are --until and --sample.
Each option can be given as an environment variable, MOLTOP_UNTIL for --until.

Exit codes: 0 done, 1 failed while running, 2 usage or invalid input, 130 or 143 stopped by SIGINT or SIGTERM.";

/// top for molecules: runs a gas of hard spheres, event by event, and lets you watch it
#[derive(Debug, Parser)]
#[command(version, after_help = EXAMPLES, args_conflicts_with_subcommands = true, max_term_width = 100)]
pub struct Cli {
    /// What to do; without it, watch a scene
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Scene and outputs of a run that is watched.
    #[command(flatten)]
    pub watch: RunOptions,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a scene without a screen: progress on stderr, results in files
    #[command(
        after_help = "Without --until, the scene's own end counts. The summary is written on every way out: at the end, \
                            after Ctrl-C or SIGTERM, and when the engine fails."
    )]
    Run {
        /// Scene and outputs.
        #[command(flatten)]
        options: RunOptions,
        /// Accept a run whose estimated cost is above an hour, or that has no end
        #[arg(long, env = "MOLTOP_YES", value_parser = FalseyValueParser::new())]
        yes: bool,
    },
    /// Check a scene, say what it is and what it will cost, and run nothing
    Check {
        /// Scene file [default: oxygen near standard conditions]
        scene: Option<PathBuf>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Print a shell's completions
    #[command(
        after_help = "Example: moltop completions bash > ~/.local/share/bash-completion/completions/moltop"
    )]
    Completions {
        /// Which shell
        shell: Shell,
    },
    /// Print the manual page
    #[command(after_help = "Example: moltop man | man -l -")]
    Man,
}

/// Scene and outputs of a run.
#[derive(Clone, Debug, Args)]
pub struct RunOptions {
    /// Scene file [default: oxygen near standard conditions]
    pub scene: Option<PathBuf>,
    /// Simulated time at which the run ends, in the scene's units
    #[arg(long, value_name = "T", env = "MOLTOP_UNTIL", allow_negative_numbers = true, value_parser = positive)]
    pub until: Option<f64>,
    /// Simulated time between two rows of the series, in the scene's units
    #[arg(long, value_name = "T", env = "MOLTOP_SAMPLE", allow_negative_numbers = true, value_parser = positive)]
    pub sample: Option<f64>,
    /// What moves the balls, instead of the scene's choice
    #[arg(long, value_name = "NAME", env = "MOLTOP_ENGINE")]
    pub engine: Option<EngineName>,
    /// How engine event keeps its events in order
    #[arg(long, value_name = "NAME", env = "MOLTOP_CALENDAR")]
    pub calendar: Option<CalendarName>,
    /// Length of a step of engine step, in the scene's units
    #[arg(long = "dt", value_name = "T", env = "MOLTOP_DT", allow_negative_numbers = true, value_parser = positive)]
    pub step: Option<f64>,
    /// Threads of engine windowed [default: one for each core]; their number changes no collision
    #[arg(long, value_name = "N", env = "MOLTOP_THREADS", value_parser = clap::value_parser!(u16).range(1..=64))]
    pub threads: Option<u16>,
    /// Seed of the random placement, instead of the scene's
    #[arg(long, value_name = "N", env = "MOLTOP_SEED")]
    pub seed: Option<u64>,
    /// Write the summary of the run as JSON
    #[arg(long, value_name = "FILE", env = "MOLTOP_SUMMARY")]
    pub summary: Option<PathBuf>,
    /// Write the course of the run as CSV, one row per sample
    #[arg(long, value_name = "FILE", env = "MOLTOP_SERIES")]
    pub series: Option<PathBuf>,
    /// Write all balls at the end as CSV
    #[arg(long, value_name = "FILE", env = "MOLTOP_STATE")]
    pub state: Option<PathBuf>,
    /// Overwrite output files that exist
    #[arg(long, env = "MOLTOP_FORCE", value_parser = FalseyValueParser::new())]
    pub force: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        Ok(_) => Err("must be finite and greater than 0".to_owned()),
        Err(_) => Err("must be a number, with a point and not a comma".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_contradicts_itself_nowhere() {
        Cli::command().debug_assert();
    }
}
