//! The `moltop` program: arguments to a task, a task to an exit code.

use std::io::{self, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{self, ExitCode};
use std::time::{Duration, Instant};
use std::{env, fs};

use clap::{CommandFactory, Parser};
use moltop::check;
use moltop::cli::{Cli, Command, Experiment, Generate, RunOptions};
use moltop::convert::convert;
use moltop::error::{Error, Result};
use moltop::experiment::{extremes, fluid, gas, growth, observables, queue, reversal, trade};
use moltop::feed::socket::SocketFeed;
use moltop::feed::{self, Access, Feed};
use moltop::generate::{self, Balls, Extent, GASES};
use moltop::headless;
use moltop::output::Target;
use moltop::report::Report;
use moltop::run::{Prepared, load, say, tell};
use moltop::run_directory::Found;
use moltop::run_process::{self, Started, logout};
use moltop::runs;
use moltop::signals::Signals;
use moltop::summary::Exit;
use moltop::tui::{self, Leave};
use moltop::worker::{SavedRun, Worker};
use signal_hook::consts::SIGHUP;

fn main() -> ExitCode {
    let program_start = Instant::now();
    let cli = Cli::parse();
    let has_gas = cli.run_process
        || cli.in_process
        || matches!(
            cli.command,
            Some(Command::Run { .. } | Command::Experiment(_))
        );
    if has_gas {
        begin_anew_with_tunables();
    }
    let done = match cli.command {
        None if cli.run_process => run_process::run(&cli.watch, program_start),
        None if cli.in_process => watch_here(&cli.watch, cli.screen, program_start),
        None => start_and_watch(cli.screen),
        Some(Command::Attach {
            run,
            read_only,
            screen,
        }) => attach(run.as_deref(), read_only, screen),
        Some(Command::Replay { run, screen }) => replay(run.as_deref(), screen, program_start),
        Some(Command::List { json }) => runs::list(json).and_then(|text| print(text.as_bytes())),
        Some(Command::Status { run, json }) => {
            runs::status(run.as_deref(), json).and_then(|text| print(text.as_bytes()))
        }
        Some(Command::Pause { run }) => runs::command(&run, feed::Command::Pause),
        Some(Command::Resume { run }) => runs::command(&run, feed::Command::Resume),
        Some(Command::Reverse { run }) => runs::command(&run, feed::Command::Reverse),
        Some(Command::Stop { run, .. }) => stop(run.as_deref()),
        Some(Command::Clean {
            runs,
            older_than,
            yes,
        }) => runs::clean(&runs, older_than, yes),
        Some(Command::Watch { run, jsonl, every }) => runs::watch(run.as_deref(), jsonl, every),
        Some(Command::Report { run, out }) => report(&run, out.as_deref()),
        Some(Command::Run { options, yes }) => run(&options, yes, program_start),
        Some(Command::Check { scene, json }) => check(scene.as_ref(), json),
        Some(Command::Experiment(what)) => experiment(&what),
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
        Some(Command::Screenshot {
            options,
            size,
            after,
            svg,
            screen,
        }) => screenshot(&options, size, after, svg.as_ref(), screen, program_start),
        Some(Command::Config { check, file }) => config(check, file),
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

/// Begins this process once more with what glibc is told only before a program starts: large pages for large arrays, where the system
/// gives them to who asks, as a large gas is read all over and places in small pages are looked up again and again; and that every
/// array of a mebibyte or more goes back to the system when it is no longer needed, instead of being kept for later ones.
///
/// Whatever keeps it from that, the program goes on as it is. Source: the manual of glibc, memory allocation tunables.
fn begin_anew_with_tunables() {
    const NAME: &str = "GLIBC_TUNABLES";
    const TUNABLES: &str = "glibc.malloc.hugetlb=1:glibc.malloc.mmap_threshold=1048576";
    // A program with rights of its own never sees that variable, and would begin anew for ever.
    const BEGUN: &str = "MOLTOP_BEGUN_ANEW";
    let asked = [NAME, BEGUN].map(env::var_os) != [None, None];
    if cfg!(target_env = "gnu")
        && !asked
        && let Ok(program) = env::current_exe()
    {
        let mut arguments = env::args_os();
        let _ = process::Command::new(program)
            .arg0(arguments.next().unwrap_or_default())
            .args(arguments)
            .env(NAME, TUNABLES)
            .env(BEGUN, "1")
            .exec();
    }
}

fn run(options: &RunOptions, yes: bool, program_start: Instant) -> Result<u8> {
    let prepared = Prepared::new(options)?;
    if let Some(why) = prepared.needs_consent().filter(|_| !yes) {
        return Err(Error::Usage(why));
    }
    let signals = Signals::listen()?;
    let mut run = prepared.start(program_start)?;
    if let Err(error) = run.serve() {
        say(&format!(
            "moltop: warning: nobody can attach to this run: {error}"
        ));
    }
    let exit = headless::wait(&run.feed(), &signals);
    Ok(tell(&run.finish(exit)))
}

/// Starts a run in a process of its own, and watches it.
fn start_and_watch(screen: tui::Options) -> Result<u8> {
    let screen = &screen.with_settings()?;
    match run_process::start()? {
        Started::Run(run) => watch(&run, Access::Watcher, screen),
        Started::Refused(code) => Ok(code),
    }
}

fn attach(run: Option<&str>, read_only: bool, screen: tui::Options) -> Result<u8> {
    let screen = &screen.with_settings()?;
    let run = run.map_or_else(Found::newest, Found::by_name)?;
    let access = if read_only {
        Access::ReadOnly
    } else {
        Access::Watcher
    };
    watch(&run, access, screen)
}

/// Shows a run that has ended, or any checkpoint.
fn replay(run: Option<&str>, screen: tui::Options, program_start: Instant) -> Result<u8> {
    let screen = &screen.with_settings()?;
    let file = run.map(Path::new).filter(|path| path.is_file());
    let found = match (file, run) {
        (Some(_), _) => None,
        (None, Some(run)) => Some(Found::by_name(run)?),
        (None, None) => Some(Found::newest_ended()?),
    };
    if let Some(run) = found.as_ref().filter(|run| run.is_going_on()) {
        let name = &run.name;
        return Err(Error::Usage(format!(
            "{name}: is going on: `moltop attach {name}` watches it"
        )));
    }
    let directory = found.map(|run| run.path);
    let place = directory.as_deref().or(file);
    let place = place.expect("a run has a directory, and what has none is a file");
    let (saved, file, damage) = SavedRun::load(place)?;
    if let Some(damage) = damage {
        let file = file.display();
        say(&format!("moltop: warning: {damage}; showing {file}"));
    }
    let signals = Signals::listen()?;
    let worker = Worker::replay(saved, directory, program_start);
    let left = tui::run(&worker.feed(), Access::Replay, signals.stop(), screen);
    worker.feed().send(feed::Command::Stop);
    worker.join();
    Ok(match (left?, signals.received()) {
        (_, Some(signal)) => Exit::Signal(signal).code(),
        (Leave::HangUp, None) => Exit::Signal(SIGHUP).code(),
        _ => 0,
    })
}

fn report(run: &str, out: Option<&Path>) -> Result<u8> {
    let run = Found::by_name(run)?;
    if run.is_going_on() {
        let name = &run.name;
        return Err(Error::Usage(format!(
            "{name}: is going on, and has its report when it ends: `moltop status {name}` says how it is going"
        )));
    }
    let report = Report::of(&run.path)?;
    report.write(out.unwrap_or(&run.path))?;
    print(report.markdown.as_bytes())
}

/// Ends a run, or all that are going on.
fn stop(run: Option<&str>) -> Result<u8> {
    let runs = if let Some(run) = run {
        vec![Found::by_name(run)?]
    } else {
        let all = Found::all()?;
        all.into_iter().filter(Found::is_going_on).collect()
    };
    runs::stop(&runs)
}

/// Watches a run of another process until the user leaves it.
fn watch(run: &Found, access: Access, screen: &tui::Options) -> Result<u8> {
    let signals = Signals::listen()?;
    let feed = SocketFeed::connect(run, access == Access::ReadOnly)?;
    let left = tui::run(&feed, access, signals.stop(), screen);
    let goes_on = || {
        let name = &run.name;
        say(&format!(
            "{name} goes on: `moltop attach {name}` watches it, `moltop stop {name}` ends it"
        ));
        if let Some(warning) = logout::warning() {
            say(&format!("moltop: warning: {warning}"));
        }
    };
    match left? {
        Leave::Detach => goes_on(),
        Leave::Signal => {
            goes_on();
            return Ok(signals
                .received()
                .map_or(0, |signal| Exit::Signal(signal).code()));
        }
        Leave::HangUp => return Ok(Exit::Signal(SIGHUP).code()),
        Leave::Quit | Leave::Stopped => {
            feed.send(feed::Command::Stop);
            return runs::wait_for_end(&feed, &signals).map(|ending| tell(&ending));
        }
    }
    Ok(0)
}

/// Runs and watches in one process.
fn watch_here(options: &RunOptions, screen: tui::Options, program_start: Instant) -> Result<u8> {
    let screen = &screen.with_settings()?;
    let prepared = Prepared::new(options)?;
    let signals = Signals::listen()?;
    let run = prepared.start(program_start)?;
    let left = tui::run(&run.feed(), Access::Owner, signals.stop(), screen);
    let exit = match (&left, signals.received()) {
        (_, Some(number)) => Exit::Signal(number),
        (Ok(Leave::HangUp), None) => Exit::Signal(SIGHUP),
        _ => Exit::Quit,
    };
    let code = tell(&run.finish(exit)); // whatever became of the screen, the results are written
    left.map(|_| code)
}

fn experiment(what: &Experiment) -> Result<u8> {
    match what {
        Experiment::Extremes(options) => extremes::run(options),
        Experiment::Growth(options) => growth::run(options),
        Experiment::Reversal(options) => reversal::run(options),
        Experiment::Queue(options) => queue::run(options),
        Experiment::Gas(options) => gas::run(options),
        Experiment::Trade(options) => trade::run(options),
        Experiment::Fluid(options) => fluid::run(options),
        Experiment::Observables(options) => observables::run(options),
    }
}

fn check(scene: Option<&PathBuf>, json: bool) -> Result<u8> {
    let scene = load(scene)?;
    let report = check::Report::new(&scene, &scene.place()?, scene.until);
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
    text.extend(tui::keys::manual().bytes());
    print(&text)
}

/// Runs a scene for a while and prints its dashboard.
fn screenshot(
    options: &RunOptions,
    size: (u16, u16),
    after: f64,
    svg: Option<&PathBuf>,
    screen: tui::Options,
    program_start: Instant,
) -> Result<u8> {
    let screen = screen.with_settings()?;
    let target = svg
        .map(|path| Target::new(path, options.force))
        .transpose()?;
    let run = Prepared::new(options)?.start_without_directory(program_start)?;
    let shot = tui::screenshot(&run.feed(), &screen, size, Duration::from_secs_f64(after));
    run.finish(Exit::Quit);
    if let Some(target) = target {
        let picture = tui::copy::svg(&shot, screen.theme());
        target.write(|writer| writer.write_all(picture.as_bytes()))?;
    }
    print(tui::copy::text(&shot).as_bytes())
}

/// Prints a template of the dashboard's settings, or looks for faults in a file.
fn config(check: bool, file: Option<PathBuf>) -> Result<u8> {
    use tui::config;
    if !check {
        return print(config::template().as_bytes());
    }
    let path = file.or_else(config::path);
    let Some(path) = path.filter(|path| path.exists()) else {
        return print(b"no settings: all are at their defaults\n");
    };
    let text = fs::read_to_string(&path).map_err(|source| Error::File {
        path: path.clone(),
        action: "read",
        source,
    })?;
    config::parse(&path, &text)?;
    print(format!("{}: good\n", path.display()).as_bytes())
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
