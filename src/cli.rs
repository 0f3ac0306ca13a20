//! The command line: what was typed, in types.

use std::path::PathBuf;
use std::time::Duration;

use clap::builder::FalseyValueParser;
use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;

use crate::experiment::{extremes, gas, observables, page, trade};
use crate::generate::{Draw, Format, GASES};
use crate::scene::observe::Name;
use crate::tui;
use crate::worker::OnTrouble;
use crate::worker::engines::{Accuracy, CalendarName, EngineName};

const EXAMPLES: &str = "\
Examples:
  moltop                                     watch oxygen near standard conditions
  moltop configs/seed-512.toml               watch 512 balls
  moltop check configs/oxygen.toml           what it is and what it will cost, before it runs
  moltop run configs/seed-512.toml --summary out.json --series out.csv
  moltop run configs/oxygen.toml --until 1e-10 --state end.csv
  moltop run configs/seed-512.toml --engine step --dt 0.01
  moltop run configs/oxygen.toml --until 1e-8 --accuracy 1%
  moltop run configs/oxygen.toml --yes       all 20 microseconds: days
  moltop list                                what is running; `moltop attach` watches the newest
  moltop stop oxygen                         end a run in good order, by the beginning of its name
  moltop clean                               remove runs that have ended
  moltop run ~/.local/state/moltop/NAME      go on with a run from its last checkpoint

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
    /// Keep run and dashboard in one process: the run ends with its dashboard
    #[arg(long, env = "MOLTOP_IN_PROCESS", value_parser = FalseyValueParser::new())]
    pub in_process: bool,
    /// Be the run, for the process that started this one.
    #[arg(long, hide = true)]
    pub run_process: bool,
    /// How the run is shown.
    #[command(flatten)]
    pub screen: tui::Options,
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
    /// Watch a run that is going on
    #[command(
        after_help = "Any number of dashboards can watch a run. `d` leaves and lets the run go on, `q` asks whether to stop it."
    )]
    Attach {
        /// Name of the run, or the beginning of it [default: the newest one that is going on]
        run: Option<String>,
        /// Look only: no key reaches the run
        #[arg(long, env = "MOLTOP_READ_ONLY", value_parser = FalseyValueParser::new())]
        read_only: bool,
        /// How the run is shown.
        #[command(flatten)]
        screen: tui::Options,
    },
    /// Look at a run that has ended, on the dashboard: its last state, its charts and, with `g`, any moment of its past
    #[command(
        after_help = "Nothing of the run is changed. `g` makes the state at a past time again from the nearest checkpoint before it; `<` and `>` go through the charts. To go on with the run, name its directory: `moltop RUNDIR`."
    )]
    Replay {
        /// Name of the run, or the beginning of it; or a directory, or a checkpoint of any name [default: the newest one that
        /// has ended]
        run: Option<String>,
        /// How the run is shown.
        #[command(flatten)]
        screen: tui::Options,
    },
    /// List the runs: those that are going on, and those that have ended
    List {
        /// Print JSON: an array of what `status --json` prints
        #[arg(long)]
        json: bool,
    },
    /// Say how a run is going
    Status {
        /// Name of the run, or the beginning of it [default: the newest one that is going on]
        run: Option<String>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Pause a run
    Pause {
        /// Name of the run, or the beginning of it
        run: String,
    },
    /// Let a run go on
    Resume {
        /// Name of the run, or the beginning of it
        run: String,
    },
    /// Reverse time in a run: every molecule turns back
    Reverse {
        /// Name of the run, or the beginning of it
        run: String,
    },
    /// End a run in good order, and wait until its results are written
    Stop {
        /// Name of the run, or the beginning of it
        #[arg(required_unless_present = "all")]
        run: Option<String>,
        /// End all runs that are going on
        #[arg(long, conflicts_with = "run")]
        all: bool,
    },
    /// Remove the directories of runs that have ended, with their summaries and checkpoints
    #[command(
        after_help = "Without a name, all runs that have ended. A run in a directory of --run-dir keeps its files.\n\
                            Example: moltop clean --older-than 30days"
    )]
    Clean {
        /// Names of the runs, or the beginnings of them
        runs: Vec<String>,
        /// Only runs that were started so long ago, such as 7days
        #[arg(long, value_name = "DURATION", value_parser = humantime::parse_duration)]
        older_than: Option<Duration>,
        /// Do not ask
        #[arg(long, env = "MOLTOP_YES", value_parser = FalseyValueParser::new())]
        yes: bool,
    },
    /// Print how a run is going, a line now and then, until it ends
    #[command(
        after_help = "The exit code is the run's. Example:\n  moltop watch oxygen --jsonl --every 10s | jq .temperature"
    )]
    Watch {
        /// Name of the run, or the beginning of it [default: the newest one that is going on]
        run: Option<String>,
        /// Print JSON, an object a line, with what is measured
        #[arg(long)]
        jsonl: bool,
        /// Time between two lines
        #[arg(long, value_name = "DURATION", default_value = "1s", value_parser = pause)]
        every: Duration,
    },
    /// Print the report of a run that has ended, as Markdown, and write it with its plots (SVG) into its directory
    Report {
        /// Name of the run, or the beginning of it, or its directory
        #[arg(value_name = "RUNDIR")]
        run: String,
        /// Write into this directory instead
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Check a scene, say what it is and what it will cost, and run nothing
    Check {
        /// Scene file [default: oxygen near standard conditions]
        scene: Option<PathBuf>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Measure the program itself
    #[command(subcommand)]
    Experiment(Experiment),
    /// Write a scene made from a few numbers
    Generate {
        /// What to make
        #[command(subcommand)]
        what: Generate,
    },
    /// Write a scene's balls one by one: as TOML, the seed's text or a CSV state
    #[command(
        after_help = "IN is a scene (TOML or the seed's text, by its content) or a CSV state or a trajectory (by its name).\n\
                            Every number of OUT reads back bit for bit."
    )]
    Convert {
        /// Scene or CSV state
        #[arg(value_name = "IN")]
        input: PathBuf,
        /// File to write: .toml, .txt or .seed, .csv
        #[arg(value_name = "OUT")]
        output: PathBuf,
        /// Scene whose domain and units the balls of a CSV state live in [default: open space, reduced units]
        #[arg(long, value_name = "SCENE")]
        domain_of: Option<PathBuf>,
        /// Overwrite a file that exists
        #[arg(long, env = "MOLTOP_FORCE", value_parser = FalseyValueParser::new())]
        force: bool,
    },
    /// Print a shell's completions
    #[command(
        after_help = "Example: moltop completions bash > ~/.local/share/bash-completion/completions/moltop"
    )]
    Completions {
        /// Which shell
        shell: Shell,
    },
    /// Run a scene for a while and print the dashboard as text, or write it as SVG
    #[command(
        after_help = "Example: moltop screenshot configs/seed-512.toml --size 120x40 --after 5 --svg balls.svg"
    )]
    Screenshot {
        /// Scene of the run, which leaves nothing else behind
        #[command(flatten)]
        options: RunOptions,
        /// Columns and rows
        #[arg(long, value_name = "CxR", default_value = "80x24", value_parser = window)]
        size: (u16, u16),
        /// Seconds that the run is watched
        #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = positive)]
        after: f64,
        /// Write a picture too
        #[arg(long, value_name = "FILE")]
        svg: Option<PathBuf>,
        /// How the run is shown.
        #[command(flatten)]
        screen: tui::Options,
    },
    /// Print a template of the dashboard's settings: looks, rates and keys
    #[command(after_help = "Example: moltop config > ~/.config/moltop/config.toml")]
    Config {
        /// Look for faults in the settings instead
        #[arg(long)]
        check: bool,
        /// File to look at [default: the user's]
        #[arg(requires = "check")]
        file: Option<PathBuf>,
    },
    /// Print the manual page
    #[command(after_help = "Example: moltop man | man -l -")]
    Man,
}

/// What to measure.
#[derive(Clone, Debug, Subcommand)]
pub enum Experiment {
    /// Numbers at their limits: 42 rows, each measured against a threshold, with a verdict
    #[command(
        after_help = "Tier A takes a minute, B a few minutes, C an hour. Exit code 1 if a row fails.\n\n\
                      Examples:\n  moltop experiment extremes --quick --out results\n  moltop experiment extremes --row 8 25"
    )]
    Extremes(extremes::Options),
    /// How run time grows with the number of balls, engine by engine, at a known accuracy
    #[command(
        after_help = "Takes some five minutes, --quick half a minute. Example:\n  moltop experiment growth --quick --out results"
    )]
    Growth(page::Options),
    /// How far a gas finds the way back after its velocities have been turned round
    #[command(
        after_help = "Takes some minutes, --quick a minute. Example:\n  moltop experiment reversal --quick --out results"
    )]
    Reversal(page::Options),
    /// How many events wait, and what they cost in memory, calendar by calendar
    #[command(
        after_help = "Takes some minutes, --quick ten seconds. Example:\n  moltop experiment queue --quick --out results"
    )]
    Queue(page::Options),
    /// Oxygen near standard conditions: temperature and pressure, sample by sample, against theory
    #[command(
        after_help = "Takes some minutes on two cores, --quick ten seconds, --full hours. With --out, one that was killed goes on from its last checkpoint when it is started again. Example:\n  moltop experiment gas --full --out results"
    )]
    Gas(gas::Options),
    /// Speed against accuracy on a scene of yours: what each engine and step costs, what it gets wrong, and which to take
    #[command(
        after_help = "Takes some eight minutes, --quick a minute. With --out, one that was interrupted takes over the settings that it has measured when it is started again. Example:\n  moltop experiment trade configs/seed-512.toml --quick --out results"
    )]
    Trade(trade::Options),
    /// Structure, diffusion, viscosity and conductivity of hard spheres against density, beside the literature
    #[command(
        after_help = "Takes some minutes, --quick half a minute. Example:\n  moltop experiment fluid --quick --out results"
    )]
    Fluid(page::Options),
    /// What each observable costs: how much longer a collision takes, on the oxygen, in a dense fluid, or in a scene of yours
    #[command(
        after_help = "Takes twelve minutes, --quick three. Example:\n  moltop experiment observables configs/mixture.toml --quick"
    )]
    Observables(observables::Options),
}

/// What `generate` makes.
#[derive(Clone, Debug, Subcommand)]
pub enum Generate {
    /// A cube of balls on a lattice, in a container one spacing wider
    #[command(
        after_help = "A radius, mass or speed is a number, uniform:MAXIMUM or normal:MEAN,DEVIATION, drawn anew for each ball.\n\
                            Directions are drawn; a normal speed is the normal distribution of each component."
    )]
    Balls {
        /// Balls along an edge of the cube
        #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
        edge: u32,
        /// Distance of neighbours
        #[arg(long, value_name = "X", default_value_t = 1.5, value_parser = positive)]
        spacing: f64,
        /// Radius; a drawn one is at most half the spacing
        #[arg(long, value_name = "X", default_value = "0.5")]
        radius: Draw,
        /// Mass
        #[arg(long, value_name = "X", default_value = "1")]
        mass: Draw,
        /// Speed
        #[arg(long, value_name = "X", default_value = "normal:0,1")]
        speed: Draw,
        /// Where the scene goes
        #[command(flatten)]
        output: GenerateOutput,
    },
    /// A real gas, as many molecules as its pressure, volume and temperature need
    Gas {
        /// Formula
        #[arg(long, value_parser = GASES.map(|gas| gas.name), default_value = "O2")]
        gas: String,
        /// Pressure in Pa
        #[arg(long, value_name = "PA", default_value_t = 101_325.0, value_parser = positive)]
        pressure: f64,
        /// Temperature in K
        #[arg(long, value_name = "K", default_value_t = 273.15, value_parser = positive)]
        temperature: f64,
        /// Edge of the cube in m [default: 1e-7]
        #[arg(long, value_name = "M", conflicts_with = "volume", value_parser = positive)]
        edge: Option<f64>,
        /// Volume of the cube in m^3
        #[arg(long, value_name = "M3", value_parser = positive)]
        volume: Option<f64>,
        /// Where the scene goes
        #[command(flatten)]
        output: GenerateOutput,
    },
}

/// Where a generated scene goes.
#[derive(Clone, Debug, Args)]
pub struct GenerateOutput {
    /// Scene file, or the seed's text
    #[arg(long, value_enum, default_value = "toml")]
    pub format: Format,
    /// File to write [default: stdout]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Seed of everything that is drawn
    #[arg(long, value_name = "N", env = "MOLTOP_SEED", default_value_t = 1)]
    pub seed: u64,
    /// Overwrite a file that exists
    #[arg(long, env = "MOLTOP_FORCE", value_parser = FalseyValueParser::new())]
    pub force: bool,
}

/// Scene and outputs of a run.
#[derive(Clone, Debug, Args)]
pub struct RunOptions {
    /// Scene file, or a checkpoint or run directory to go on from [default: oxygen near standard conditions]
    pub scene: Option<PathBuf>,
    /// Simulated time at which the run ends, in the scene's units
    #[arg(long, value_name = "T", env = "MOLTOP_UNTIL", allow_negative_numbers = true, value_parser = positive)]
    pub until: Option<f64>,
    /// End the run once the standard error of the pressure is at most this share of it, as 0.001 or 0.1%
    #[arg(long, value_name = "SHARE", env = "MOLTOP_UNTIL_ERROR", value_parser = share)]
    pub until_error: Option<f64>,
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
    /// Engine and step by the largest error of pressure, collision rate, diffusion and viscosity [default: exact]
    #[arg(long, value_name = "SHARE", env = "MOLTOP_ACCURACY")]
    pub accuracy: Option<Accuracy>,
    /// Length of a step of engine statistical, in mean free times [default: 0.2]
    #[arg(long, value_name = "F", env = "MOLTOP_STEP_FRACTION", allow_negative_numbers = true, value_parser = positive)]
    pub step_fraction: Option<f64>,
    /// Cells of engine statistical along a mean free path, as far as there are balls enough for them [default: 6]
    #[arg(long, value_name = "N", env = "MOLTOP_CELLS_PER_PATH", allow_negative_numbers = true, value_parser = positive)]
    pub cells_per_path: Option<f64>,
    /// Threads of engines windowed and statistical [default: one for each core]; their number changes no collision
    #[arg(long, value_name = "N", env = "MOLTOP_THREADS", value_parser = clap::value_parser!(u16).range(1..=64))]
    pub threads: Option<u16>,
    /// Seed of the random placement, instead of the scene's
    #[arg(long, value_name = "N", env = "MOLTOP_SEED")]
    pub seed: Option<u64>,
    /// Observe these, beside what the scene asks for
    #[arg(
        long,
        value_name = "NAME,...",
        env = "MOLTOP_OBSERVE",
        value_delimiter = ','
    )]
    pub observe: Vec<Name>,
    /// Write the summary of the run as JSON
    #[arg(long, value_name = "FILE", env = "MOLTOP_SUMMARY")]
    pub summary: Option<PathBuf>,
    /// Write the course of the run as CSV, one row per sample
    #[arg(long, value_name = "FILE", env = "MOLTOP_SERIES")]
    pub series: Option<PathBuf>,
    /// Write all balls at the end as CSV
    #[arg(long, value_name = "FILE", env = "MOLTOP_STATE")]
    pub state: Option<PathBuf>,
    /// Write every observable over the whole run as CSV: finer for the recent past, with mean, lowest and highest value
    #[arg(long, value_name = "FILE", env = "MOLTOP_HISTORY")]
    pub history: Option<PathBuf>,
    /// Write all balls now and then, for OVITO, ASE and the like: extended XYZ (.xyz, .extxyz) or a LAMMPS dump
    /// (.lammpstrj, .dump), compressed if the name ends in .zst
    #[arg(long, value_name = "FILE", env = "MOLTOP_TRAJECTORY")]
    pub trajectory: Option<PathBuf>,
    /// Simulated time between two frames of the trajectory, in the scene's units [default: that between two rows of the series]
    #[arg(long, value_name = "T", env = "MOLTOP_TRAJECTORY_EVERY", allow_negative_numbers = true, value_parser = positive)]
    pub trajectory_every: Option<f64>,
    /// Directory of the run, new or empty [default: one named after the scene, in ~/.local/state/moltop]
    #[arg(long, value_name = "DIR", env = "MOLTOP_RUN_DIR")]
    pub run_dir: Option<PathBuf>,
    /// Wall time between two checkpoints, such as 30s, 10min or 2h
    #[arg(long, value_name = "DURATION", env = "MOLTOP_CHECKPOINT_EVERY", default_value = "10min", value_parser = pause)]
    pub checkpoint_every: Duration,
    /// What to do once a figure of the run's accuracy is beyond its limit, such as its energy drift: it is shown and logged anyway
    #[arg(
        long,
        value_name = "WHAT",
        env = "MOLTOP_ON_TROUBLE",
        default_value = "ignore"
    )]
    pub on_trouble: OnTrouble,
    /// Overwrite output files that exist; run engine statistical although the gas is too dense for it
    #[arg(long, env = "MOLTOP_FORCE", value_parser = FalseyValueParser::new())]
    pub force: bool,
}

/// Shortest wall time between two checkpoints.
const SHORTEST_PAUSE: Duration = Duration::from_millis(10);

fn pause(text: &str) -> Result<Duration, String> {
    match humantime::parse_duration(text) {
        Ok(pause) if pause >= SHORTEST_PAUSE => Ok(pause),
        Ok(_) => Err("must be at least 10ms".to_owned()),
        Err(error) => Err(format!(
            "must be a duration such as 30s, 10min or 2h: {error}"
        )),
    }
}

fn window(text: &str) -> Result<(u16, u16), String> {
    let parts = text.split_once('x');
    let size = parts.and_then(|(columns, rows)| Some((columns.parse().ok()?, rows.parse().ok()?)));
    size.filter(|size| (1..=500).contains(&size.0) && (1..=200).contains(&size.1))
        .ok_or_else(|| "must be columns x rows, such as 80x24, up to 500x200".to_owned())
}

fn share(text: &str) -> Result<f64, String> {
    match text.strip_suffix('%') {
        Some(percent) => positive(percent.trim_end()).map(|percent| percent / 100.0),
        None => positive(text),
    }
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
