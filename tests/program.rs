//! The program itself, as a user runs it: exit codes, files, words on stderr and nothing on stdout that nobody asked for.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use moltop::scene::Scene;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use tempfile::TempDir;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/seed-512.toml");

/// Where the runs of a test have their directories.
const STATE_HOME: &str = ".state";

/// The program in a directory of its own, with no setting of the user's.
fn moltop(directory: &TempDir, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_moltop"));
    command
        .current_dir(directory.path())
        .args(arguments)
        .env("XDG_STATE_HOME", directory.path().join(STATE_HOME))
        .stdin(Stdio::null());
    for (name, _) in
        std::env::vars_os().filter(|(name, _)| name.to_string_lossy().starts_with("MOLTOP_"))
    {
        command.env_remove(name);
    }
    command
}

fn output(directory: &TempDir, arguments: &[&str]) -> Output {
    moltop(directory, arguments)
        .output()
        .expect("the program starts")
}

fn directory() -> TempDir {
    tempfile::tempdir().expect("a temporary directory")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("text")
}

fn read(directory: &TempDir, name: &str) -> String {
    fs::read_to_string(directory.path().join(name)).expect("the file was written")
}

fn json(directory: &TempDir, name: &str) -> Value {
    serde_json::from_str(&read(directory, name)).expect("JSON")
}

fn files(directory: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(directory.path()).expect("a directory");
    let mut names: Vec<String> = entries
        .map(|entry| {
            entry
                .expect("an entry")
                .file_name()
                .to_string_lossy()
                .into_owned()
        })
        .filter(|name| name != STATE_HOME)
        .collect();
    names.sort();
    names
}

/// Checks that the program refuses its input: exit code 2, one line that says why, and nothing written.
#[track_caller]
fn check_refused(arguments: &[&str], why: &str) {
    let directory = directory();
    let output = output(&directory, arguments);
    let words = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{words}");
    assert!(words.contains(why), "{words}");
    assert!(output.stdout.is_empty() && files(&directory).is_empty());
    assert!(!directory.path().join(STATE_HOME).exists());
}

#[test]
fn a_run_writes_its_summary_series_and_state_and_prints_nothing() {
    let directory = directory();
    let arguments = [
        "run",
        SCENE,
        "--until",
        "2",
        "--summary",
        "out.json",
        "--series",
        "out.csv",
        "--state",
        "end.csv",
    ];
    let output = output(&directory, &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(output.stdout.is_empty());
    assert!(text(&output.stderr).contains("512 balls: finished at 2"));
    assert_eq!(files(&directory), ["end.csv", "out.csv", "out.json"]);

    let summary = json(&directory, "out.json");
    let series = read(&directory, "out.csv");
    let last = series.lines().last().expect("a row");
    assert_eq!(
        last.split(',').nth(5),
        Some(summary["pair_collisions"].to_string().as_str()),
        "{last}"
    );
    assert_eq!(
        series.lines().count(),
        21,
        "a header and one row per sample"
    );
    assert_eq!(
        series.lines().next(),
        Some(
            "time,wall_time_s,temperature,pressure_wall,pressure_virial,pair_collisions,wall_collisions,queue_length,\
             max_overlap,energy_drift"
        )
    );
    assert!(
        read(&directory, "end.csv").starts_with("index,x,y,z,vx,vy,vz,radius,mass,collisions\n0,")
    );
    assert_eq!(read(&directory, "end.csv").lines().count(), 513);
}

#[test]
fn the_summary_has_every_key_of_its_schema() {
    let directory = directory();
    output(
        &directory,
        &["run", SCENE, "--until", "5", "--summary", "out.json"],
    );
    let summary = json(&directory, "out.json");
    let keys = |value: &Value| {
        value
            .as_object()
            .expect("an object")
            .keys()
            .cloned()
            .collect::<Vec<String>>()
            .join(" ")
    };
    assert_eq!(summary["schema"], "moltop.summary/1");
    assert_eq!(
        keys(&summary),
        "accuracy collision_rate collisions_per_wall_second compressibility_factor counters echo echo_horizon energy_drift engine exit kinetic_energy \
         max_overlap mean_free_path momentum_drift named_balls observables pair_collisions peak_rss_bytes plane_collisions pressure queue_length \
         scene schema setup_time_s speeds state_hash temperature time until virial_residual wall_collisions wall_time_s"
    );
    assert_eq!(
        keys(&summary["scene"]),
        "ball_count packing_fraction title units"
    );
    assert_eq!(keys(&summary["pressure"]), "standard_error virial wall");
    assert_eq!(keys(&summary["speeds"]), "histogram ks ks_critical");
    assert_eq!(
        keys(&summary["speeds"]["histogram"]),
        "bin_width counts maxwell"
    );
    assert_eq!(keys(&summary["queue_length"]), "max now");
    assert_eq!(
        keys(&summary["counters"]),
        "audited_steps cell_crossings double_bounces irreversible_starts late_events missed_collisions remembered_events stale_events steps ties zero_time_events"
    );
    assert_eq!(summary["exit"], "finished");
    assert!(summary["pair_collisions"].as_u64() > Some(2000));
    assert_eq!(summary["state_hash"].as_str().map(str::len), Some(16));
}

#[test]
fn the_same_seed_gives_the_same_state_and_another_seed_another() {
    let directory = directory();
    let hash = |name: &str, seed: &str| {
        output(
            &directory,
            &[
                "run",
                SCENE,
                "--until",
                "1",
                "--seed",
                seed,
                "--summary",
                name,
            ],
        );
        json(&directory, name)["state_hash"].clone()
    };
    let first = hash("a.json", "5");
    assert!(first.is_string());
    assert_eq!(hash("b.json", "5"), first);
    assert_ne!(hash("c.json", "6"), first);
}

#[test]
fn the_exact_engines_agree_and_steps_own_up_to_what_they_get_wrong() {
    let directory = directory();
    let run = |name: &str, choice: &[&str]| {
        let run = ["run", SCENE, "--until", "6", "--summary", name];
        let output = output(&directory, &[&run, choice].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        (json(&directory, name), text(&output.stderr))
    };
    let (exact, words) = run("event.json", &["--engine", "event"]);
    assert!(!words.contains("missed collisions"), "{words}");
    assert!(exact["counters"]["missed_collisions"].is_null());
    for (name, choice) in [
        ("lazy.json", ["--calendar", "lazy"]),
        ("bounded.json", ["--calendar", "bounded"]),
        ("windowed.json", ["--engine", "windowed"]),
    ] {
        let (summary, _) = run(name, &choice);
        assert_eq!(summary["state_hash"], exact["state_hash"], "{name}");
    }
    let (stepped, words) = run("step.json", &["--engine", "step", "--dt", "0.2"]);
    assert_eq!(stepped["engine"], "step");
    assert_eq!(stepped["counters"]["steps"], 30);
    assert!(stepped["counters"]["missed_collisions"].as_u64() > Some(10));
    assert!(stepped["max_overlap"].as_f64() > Some(0.1));
    assert!(stepped["virial_residual"].as_f64() < Some(1e-12));
    assert!(words.contains("missed collisions"), "{words}");
    assert!(
        words.contains("warning: --dt 0.2000: balls fly 0.19"),
        "{words}"
    );
}

#[test]
fn an_approximate_engine_says_so_and_has_no_overlaps() {
    let directory = directory();
    let arguments = [
        "run",
        SCENE,
        "--engine",
        "statistical",
        "--until",
        "1",
        "--force",
        "--summary",
        "s.json",
    ];
    let words = text(&output(&directory, &arguments).stderr);
    assert!(
        words.contains("engine statistical, approximate: steps of 0.2"),
        "{words}"
    );
    assert!(
        words.contains("warning: engine statistical: a packing fraction of 0.10"),
        "{words}"
    );
    let summary = json(&directory, "s.json");
    assert_eq!(summary["engine"], "statistical");
    assert!(summary["pair_collisions"].as_u64() > Some(100));
    for key in [
        "max_overlap",
        "momentum_drift",
        "virial_residual",
        "echo_horizon",
    ] {
        assert!(summary[key].is_null(), "{key}");
    }
    assert!(summary["energy_drift"].as_f64().expect("a number").abs() < 1e-6);
}

#[test]
fn a_scene_names_its_engine_and_the_command_line_another() {
    let directory = directory();
    let scene = fs::read_to_string(SCENE).expect("the scene");
    let scene = scene.replace("engine = \"auto\"", "engine = \"step\"");
    fs::write(directory.path().join("step.toml"), scene).expect("a small file");
    let run = |choice: &[&str]| {
        let run = ["run", "step.toml", "--until", "1", "--summary", "out.json"];
        let output = output(&directory, &[&run, choice, &["--force"]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        json(&directory, "out.json")["engine"].clone()
    };
    assert_eq!(run(&["--dt", "0.01"]), "step");
    assert_eq!(run(&["--engine", "event"]), "event");
}

#[test]
fn a_state_file_is_a_scene_to_go_on_from() {
    let directory = directory();
    output(
        &directory,
        &["run", SCENE, "--until", "1", "--state", "end.csv"],
    );
    let scene = "units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [13.5, 13.5, 13.5]\n\
                 [[species]]\nplacement = { kind = \"file\", path = \"end.csv\" }\n";
    fs::write(directory.path().join("next.toml"), scene).expect("a small file");
    let balls = Scene::load(&directory.path().join("next.toml"))
        .and_then(|scene| scene.place())
        .expect("a good scene");
    assert_eq!((balls.positions.len(), balls.bodies.len()), (512, 1));
    let output = output(&directory, &["run", "next.toml", "--until", "1"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

#[test]
fn a_run_leaves_a_directory_of_its_own() {
    let directory = directory();
    let run = |arguments: &[&str]| {
        let run = ["run", SCENE, "--until", "1"];
        output(&directory, &[&run, arguments].concat())
    };
    for _ in 0..2 {
        assert_eq!(run(&[]).status.code(), Some(0));
    }
    let of_runs = directory.path().join(STATE_HOME).join("moltop");
    let of_run = |number: u32| of_runs.join(format!("512-balls-{number}"));
    for number in [1, 2] {
        let read = |file: &str| fs::read_to_string(of_run(number).join(file)).expect(file);
        assert_eq!(read("exit"), "0 finished\n");
        assert_eq!(
            read("scene.toml"),
            fs::read_to_string(SCENE).expect("a scene")
        );
        assert!(read("summary.json").contains("\"exit\": \"finished\""));
        assert!(read("log").contains("INFO ended: finished"));
        let page = output(&directory, &["report", &format!("512-balls-{number}")]);
        assert!(
            text(&page.stdout).starts_with("# 512 balls\n")
                && text(&page.stdout) == read("summary.md")
        );
        assert!(read("speeds.svg").starts_with("<svg"));
    }
    let mode = |path: &Path| {
        fs::metadata(path)
            .expect("a directory")
            .permissions()
            .mode()
            & 0o777
    };
    assert_eq!((mode(&of_runs), mode(&of_run(1))), (0o700, 0o700));
    // A directory of the user's choice has a link among the others.
    assert_eq!(run(&["--run-dir", "here"]).status.code(), Some(0));
    assert!(of_run(3).join("exit").is_file() && directory.path().join("here/exit").is_file());
    let again = run(&["--run-dir", "here"]);
    assert_eq!(again.status.code(), Some(2));
    assert!(text(&again.stderr).contains("--run-dir here: holds a run already"));
    // Deleted and used again, it is the new run's and has one name.
    fs::remove_dir_all(directory.path().join("here")).expect("an ended run");
    assert_eq!(run(&["--run-dir", "here"]).status.code(), Some(0));
    let names = text(&output(&directory, &["list"]).stdout);
    assert_eq!(names.matches("512-balls-").count(), 3, "{names}");
}

#[test]
fn a_run_that_can_have_no_directory_runs_all_the_same() {
    let directory = directory();
    fs::write(directory.path().join(STATE_HOME), "in the way").expect("a small file");
    let output = output(&directory, &["run", SCENE, "--until", "1"]);
    assert_eq!(output.status.code(), Some(0));
    let words = text(&output.stderr);
    assert!(
        words.contains("warning: the run has no directory"),
        "{words}"
    );
}

/// A run that would take days, once it has taken over the signals.
fn endless(directory: &TempDir) -> (Child, BufReader<impl Read>) {
    let arguments = [
        "run",
        SCENE,
        "--until",
        "1e9",
        "--yes",
        "--sample",
        "1",
        "--summary",
        "out.json",
        "--series",
        "out.csv",
    ];
    let mut child = moltop(directory, &arguments)
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut words = BufReader::new(child.stderr.take().expect("stderr is a pipe"));
    let mut line = String::new();
    words.read_line(&mut line).expect("a first line"); // it appears after the signals were taken over
    (child, words)
}

#[track_caller]
fn check_signal(signal: Signal, code: i32) {
    let directory = directory();
    let (mut child, mut words) = endless(&directory);
    kill_process(Pid::from_child(&child), signal).expect("the program runs");
    let mut rest = String::new();
    words.read_to_string(&mut rest).expect("text");
    assert_eq!(child.wait().expect("it ends").code(), Some(code), "{rest}");
    assert_eq!(
        json(&directory, "out.json")["exit"],
        format!("signal {}", code - 128)
    );
    assert_eq!(files(&directory), ["out.csv", "out.json"]);
}

#[test]
fn sigterm_ends_a_run_in_good_order() {
    check_signal(Signal::TERM, 143);
}

#[test]
fn sigint_ends_a_run_in_good_order() {
    check_signal(Signal::INT, 130);
}

#[test]
fn a_closed_stderr_does_not_end_a_run() {
    let directory = directory();
    let mut child = moltop(
        &directory,
        &["run", SCENE, "--until", "1", "--summary", "out.json"],
    )
    .stderr(Stdio::piped())
    .spawn()
    .expect("the program starts");
    drop(child.stderr.take());
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
    assert_eq!(files(&directory), ["out.json"]);
}

#[test]
fn a_reader_that_leaves_early_is_no_failure() {
    let directory = directory();
    for arguments in [
        ["check", SCENE].as_slice(),
        &["man"],
        &["completions", "bash"],
    ] {
        let mut child = moltop(&directory, arguments)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        drop(child.stdout.take());
        assert_eq!(
            child.wait().expect("it ends").code(),
            Some(0),
            "{arguments:?}"
        );
    }
}

#[test]
fn options_come_from_the_environment_too() {
    let directory = directory();
    let mut command = moltop(&directory, &["run", SCENE]);
    command
        .env("MOLTOP_UNTIL", "0.5")
        .env("MOLTOP_SUMMARY", "out.json")
        .env("MOLTOP_SAMPLE", "0.25");
    command
        .env("MOLTOP_FORCE", "0")
        .env("MOLTOP_SERIES", "out.csv");
    assert_eq!(
        command.status().expect("the program starts").code(),
        Some(0)
    );
    assert_eq!(json(&directory, "out.json")["time"], 0.5);
    assert_eq!(read(&directory, "out.csv").lines().count(), 3);
}

#[test]
fn existing_outputs_are_refused_before_the_run_unless_forced() {
    let directory = directory();
    fs::write(directory.path().join("out.json"), "precious").expect("a small file");
    let arguments = [
        "run",
        SCENE,
        "--until",
        "1",
        "--summary",
        "out.json",
        "--state",
        "end.csv",
    ];
    let refused = output(&directory, &arguments);
    assert_eq!(refused.status.code(), Some(2));
    assert_eq!(
        text(&refused.stderr),
        "moltop: out.json: exists: --force overwrites it\n"
    );
    assert_eq!(
        (files(&directory).len(), read(&directory, "out.json")),
        (1, "precious".to_owned())
    );
    let forced = output(&directory, &[arguments.as_slice(), &["--force"]].concat());
    assert_eq!(forced.status.code(), Some(0));
    assert_eq!(json(&directory, "out.json")["exit"], "finished");
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_the_run() {
    check_refused(
        &["run", SCENE, "--summary", "nowhere/out.json"],
        "nowhere/out.json: cannot write here",
    );
    check_refused(&["run", SCENE, "--series", "."], "is a directory");
    check_refused(
        &["run", SCENE, "--series", "x", "--state", "x"],
        "two outputs have the same name",
    );
}

#[test]
fn a_run_of_days_or_without_an_end_needs_yes() {
    check_refused(&["run", "--summary", "out.json"], "--yes to accept it"); // the embedded scene: weeks
    let directory = directory();
    let endless = fs::read_to_string(SCENE)
        .expect("a scene")
        .replace("until = 10.0", "");
    fs::write(directory.path().join("endless.toml"), endless).expect("a small file");
    let output = output(&directory, &["run", "endless.toml"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("the run has no end: give --until T"));
}

#[test]
fn bad_input_has_exit_code_2() {
    check_refused(
        &["run", "nowhere.toml"],
        "nowhere.toml: cannot read: No such file or directory",
    );
    check_refused(&["check", "nowhere.toml"], "nowhere.toml: cannot read");
    check_refused(
        &["run", SCENE, "--until", "-1"],
        "must be finite and greater than 0",
    );
    check_refused(
        &["run", SCENE, "--until", "nan"],
        "must be finite and greater than 0",
    );
    check_refused(
        &["run", SCENE, "--until", "0,5"],
        "with a point and not a comma",
    );
    check_refused(
        &["run", SCENE, "--engine", "warp"],
        "possible values: auto, event, windowed, reversible, step, statistical",
    );
    check_refused(&["run", SCENE, "--engine", "step"], "needs --dt T");
    check_refused(
        &["run", SCENE, "--engine", "step", "--dt", "-1"],
        "must be finite and greater than 0",
    );
    check_refused(
        &["run", SCENE, "--engine", "step", "--dt", "NaN"],
        "must be finite and greater than 0",
    );
    let long = [
        "run", SCENE, "--engine", "step", "--dt", "2", "--until", "1",
    ];
    check_refused(&long, "must not be longer than the run");
    let fine = ["run", SCENE, "--engine", "step", "--dt", "1e-14"];
    check_refused(&fine, "time itself has a grid");
    let slow = ["run", SCENE, "--engine", "step", "--dt", "1e-9"];
    check_refused(&slow, "--yes to accept it");
    check_refused(&["run", SCENE, "--dt", "0.1"], "--dt is for engine step");
    let other = ["run", SCENE, "--engine", "windowed", "--calendar", "lazy"];
    check_refused(&other, "--calendar is for engine event");
    check_refused(
        &["run", SCENE, "--step-fraction", "0.1"],
        "are for engine statistical",
    );
    let dense = ["run", SCENE, "--engine", "statistical", "--until", "1"];
    check_refused(&dense, "is too dense: at most 0.01");
    let twice = ["run", SCENE, "--engine", "event", "--accuracy", "1%"];
    check_refused(&twice, "--accuracy chooses the engine");
}

#[test]
fn without_a_terminal_the_dashboard_is_plain_lines() {
    let directory = directory();
    let arguments = [
        SCENE,
        "--in-process",
        "--until",
        "3",
        "--plain-every",
        "0.05",
    ];
    let mut command = moltop(&directory, &arguments);
    let output = command.env("LC_ALL", "C").output().expect("it starts");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let words = text(&output.stdout);
    assert!(words.is_ascii() && !words.contains('\x1b'), "{words}");
    let last = words.lines().last().expect("a line");
    assert!(
        last.starts_with("t 3.000 of 3.000 (100.00 %), finished, wall "),
        "{last}"
    );
    assert!(
        last.contains("temperature ") && last.contains("trust sound"),
        "{last}"
    );
}

#[test]
fn check_says_what_a_scene_is_and_will_cost() {
    let directory = directory();
    let words = text(&output(&directory, &["check", SCENE]).stdout);
    assert!(
        words.contains("512 balls") && words.contains("packing fraction  0.1090"),
        "{words}"
    );
    let lines: Vec<&str> = (words.lines())
        .filter(|line| line.starts_with("observe"))
        .collect();
    assert_eq!(lines.len(), 6, "{words}");
    assert!(lines.iter().any(
        |line| line.contains("flights: off; ") && line.contains("% more time in a dilute gas")
    ));
    assert!(
        lines
            .iter()
            .any(|line| line.ends_with("transport: not in this scene"))
    );
    let oxygen: Value =
        serde_json::from_slice(&output(&directory, &["check", "--json"]).stdout).expect("JSON");
    assert_eq!(
        (oxygen["ball_count"].as_u64(), oxygen["units"].as_str()),
        (Some(704_969), Some("si"))
    );
    let close = |value: &Value, expected: f64| {
        (value.as_f64().expect("a number") / expected - 1.0).abs() < 5e-3
    };
    assert!(
        close(&oxygen["expected"]["pressure"], 98_804.0)
            && close(&oxygen["cost"]["pair_collisions"], 4.18e10)
    );
    assert!(
        oxygen["warnings"][0]
            .as_str()
            .expect("words")
            .contains("--yes")
    );
    assert!(files(&directory).is_empty());
}

#[test]
fn help_names_every_command_and_shows_examples() {
    let directory = directory();
    let words = text(&output(&directory, &["--help"]).stdout);
    for part in [
        "Examples:",
        "run ",
        "check ",
        "completions ",
        "man ",
        "MOLTOP_UNTIL",
        "Exit codes",
    ] {
        assert!(words.contains(part), "{part}");
    }
    assert!(text(&output(&directory, &["man"]).stdout).contains(".TH moltop 1"));
    assert!(
        text(&output(&directory, &["completions", "zsh"]).stdout).starts_with("#compdef moltop")
    );
}

fn source(name: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).expect("the file")
}

#[test]
fn the_readme_has_the_one_command_that_the_ci_script_runs_as_tests() {
    let readme = source("README.md");
    let commands = readme.lines().filter(|line| line.starts_with("cargo test"));
    assert_eq!(commands.count(), 1);
    assert!(source(".ci/run").contains("grep -E '^cargo test' README.md"));
}

#[test]
fn the_scene_in_the_readme_is_a_good_one() {
    let readme = source("README.md");
    let scene = readme
        .split("```toml\n")
        .nth(1)
        .and_then(|rest| rest.split("```").next())
        .expect("a scene");
    let scene = Scene::parse(Path::new("README.md"), scene).expect("a good scene");
    assert_eq!(scene.named_balls(), [("pollen".to_owned(), 704_969)]);
}

#[test]
fn the_readme_names_every_option() {
    let readme = source("README.md");
    let directory = directory();
    let help = text(&output(&directory, &["run", "--help"]).stdout);
    for option in help
        .split_whitespace()
        .filter(|word| word.starts_with("--") && word.len() > 3 && *word != "--help")
    {
        let option = option.trim_end_matches([',', '.']);
        assert!(readme.contains(&format!("`{option}")), "{option}");
    }
}

#[test]
fn generated_and_converted_scenes_run() {
    let directory = directory();
    let run = |arguments: &[&str]| {
        let output = output(&directory, arguments);
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let seed = [
        "generate",
        "balls",
        "--edge",
        "3",
        "--format",
        "seed",
        "--radius",
        "uniform:0.5",
    ];
    let printed = run(&seed);
    run(&[seed.as_slice(), &["-o", "balls.any"]].concat());
    assert_eq!(printed, read(&directory, "balls.any"));
    run(&["convert", "balls.any", "balls.toml"]);
    // A file's content says what it is, and both say the same.
    let hash = |scene: &str, summary: &str| {
        run(&["run", scene, "--until", "5", "--summary", summary]);
        json(&directory, summary)["state_hash"].clone()
    };
    assert_eq!(hash("balls.any", "a.json"), hash("balls.toml", "b.json"));
    run(&[
        "generate",
        "gas",
        "--gas",
        "Ar",
        "--edge",
        "2e-8",
        "-o",
        "argon.toml",
    ]);
    assert!(run(&["check", "argon.toml"]).contains("Ar at 101325 Pa"));
    check_refused(
        &["generate", "gas", "--gas", "Xe"],
        "possible values: O2, N2, H2, He, Ar",
    );
    check_refused(&["generate", "balls", "--radius", "0,5"], "0,5");
    check_refused(&["convert", SCENE, "here"], "must end in .toml");
}

#[test]
fn a_run_of_whole_samples_ends_with_a_row() {
    let directory = directory();
    let options = ["--until", "0.3", "--sample", "0.1", "--series", "rows.csv"];
    let run = output(&directory, &[&["run", SCENE][..], &options].concat());
    assert!(run.status.success(), "{}", text(&run.stderr));
    let rows = fs::read_to_string(directory.path().join("rows.csv")).expect("the series");
    let last = rows.lines().last().expect("a row");
    assert_eq!(
        (rows.lines().count(), last.split(',').next()),
        (4, Some("0.3"))
    );
}

#[test]
fn check_knows_how_much_memory_a_run_takes() {
    let directory = directory();
    let scene = "units = \"reduced\"\n[domain]\nkind = \"periodic\"\nsize = [60, 60, 60]\n\
                 [[species]]\ncount = 100000\nradius = 0.5\nmass = 1\nvelocity = { kind = \"normal\", deviation = 1 }\n";
    fs::write(directory.path().join("scene.toml"), scene).expect("a small file");
    let check = output(&directory, &["check", "scene.toml", "--json"]);
    let report: Value = serde_json::from_slice(&check.stdout).expect("JSON");
    let options = ["--until", "0.2", "--sample", "1", "--summary", "out.json"];
    let run = output(&directory, &[&["run", "scene.toml"][..], &options].concat());
    assert!(run.status.success(), "{}", text(&run.stderr));
    let taken = json(&directory, "out.json")["peak_rss_bytes"].as_f64();
    let expected = report["memory_bytes"].as_f64().expect("a number");
    if let Some(taken) = taken {
        assert!((taken / expected - 1.0).abs() < 0.25, "{taken} {expected}");
    }
}
