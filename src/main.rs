//! The `moltop` program: arguments to a task, a task to an exit code.

use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::{CommandFactory, Parser};
use moltop::check::Report;
use moltop::cli::{Cli, Command, Experiment, Generate, RunOptions};
use moltop::convert::convert;
use moltop::error::{Error, Result};
use moltop::experiment::extremes;
use moltop::generate::{self, Balls, Extent, GASES};
use moltop::headless;
use moltop::output::Target;
use moltop::run::{Prepared, load, say};
use moltop::signals::Signals;
use moltop::summary::Exit;
use moltop::tui::{self, Leave};
use signal_hook::consts::SIGHUP;

fn main() -> ExitCode {
    let program_start = Instant::now();
    let cli = Cli::parse();
    let done = match cli.command {
        None => watch(&cli.watch, &cli.screen, program_start),
        Some(Command::Run { options, yes }) => run(&options, yes, program_start),
        Some(Command::Check { scene, json }) => check(scene.as_ref(), json),
        Some(Command::Experiment(Experiment::Extremes(options))) => extremes::run(&options),
        Some(Command::Generate { what }) => generate(&what),
        Some(Command::Convert {
            input,
            output,
            domain_of,
            force,
        }) => convert(&input, &output, domain_of.as_deref(), force).map(|()| 0),
        Some(Command::Completions { shell }) => {
            let mut text = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "moltop", &mut text);
            print(&text)
        }
        Some(Command::Man) => man(),
    };
    match done {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            // A scene's faults are lines of their own, each with its file.
            let name = if matches!(error, Error::Scene(_)) {
                ""
            } else {
                "moltop: "
            };
            say(&format!("{name}{error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(options: &RunOptions, yes: bool, program_start: Instant) -> Result<u8> {
    let prepared = Prepared::new(options)?;
    if let Some(why) = prepared.report.needs_consent().filter(|_| !yes) {
        return Err(Error::Usage(why));
    }
    let signals = Signals::listen()?;
    let run = prepared.start(program_start)?;
    let exit = headless::wait(&run.feed(), &signals);
    Ok(run.finish(exit)?.code())
}

fn watch(options: &RunOptions, screen: &tui::Options, program_start: Instant) -> Result<u8> {
    if !io::stdout().is_terminal() {
        return Err(Error::Usage(
            "the dashboard needs a terminal: `moltop run SCENE` needs none".to_owned(),
        ));
    }
    let prepared = Prepared::new(options)?;
    let signals = Signals::listen()?;
    let run = prepared.start(program_start)?;
    let left = tui::run(&run.feed(), signals.stop(), screen);
    let exit = match (&left, signals.received()) {
        (_, Some(number)) => Exit::Signal(number),
        (Ok(Leave::HangUp), None) => Exit::Signal(SIGHUP),
        _ => Exit::Quit,
    };
    let code = run.finish(exit)?.code(); // whatever became of the screen, the results are written
    left.map(|_| code)
}

fn check(scene: Option<&PathBuf>, json: bool) -> Result<u8> {
    let scene = load(scene)?;
    let report = Report::new(&scene, &scene.place()?, scene.until);
    if json {
        let text = serde_json::to_string_pretty(&report).expect("a report is plain data");
        print(format!("{text}\n").as_bytes())
    } else {
        print(report.for_people().as_bytes())
    }
}

fn generate(what: &Generate) -> Result<u8> {
    let (Generate::Balls { output, .. } | Generate::Gas { output, .. }) = what;
    let target = output
        .output
        .as_ref()
        .map(|path| Target::new(path, output.force))
        .transpose()?;
    let (scene, balls) = match what {
        Generate::Balls {
            edge,
            spacing,
            radius,
            mass,
            speed,
            output,
        } => Balls {
            edge: *edge,
            spacing: *spacing,
            radius: *radius,
            mass: *mass,
            speed: *speed,
            seed: output.seed,
        }
        .scene()?,
        Generate::Gas {
            gas: name,
            pressure,
            temperature,
            edge,
            volume,
            output,
        } => {
            let gas = GASES
                .iter()
                .find(|gas| gas.name == name)
                .expect("the command line knows the names");
            let extent = volume.map_or(Extent::Edge(edge.unwrap_or(1e-7)), Extent::Volume);
            generate::gas(gas, *pressure, extent, *temperature, output.seed)?
        }
    };
    let text = generate::write(&scene, &balls, output.format)?;
    match target {
        Some(target) => target.write(|writer| writer.write_all(&text)).map(|()| 0),
        None => print(&text),
    }
}

fn man() -> Result<u8> {
    let mut text = Vec::new();
    clap_mangen::Man::new(Cli::command())
        .render(&mut text)
        .expect("memory takes all");
    print(&text)
}

/// Writes to stdout; a reader that has seen enough, such as `head`, is no failure.
fn print(bytes: &[u8]) -> Result<u8> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Err(source) if source.kind() != io::ErrorKind::BrokenPipe => Err(Error::File {
            path: PathBuf::from("stdout"),
            action: "write",
            source,
        }),
        _ => Ok(0),
    }
}
