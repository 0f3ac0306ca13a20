//! `moltop experiment`: its files, what it refuses, and that an interrupted one keeps what it has measured.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

fn experiment(name: &str, out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_moltop"));
    command
        .args(["experiment", name, "--quick", "--out"])
        .arg(out)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

#[test]
fn results_are_not_overwritten_and_that_is_known_before_anything_is_measured() {
    for (name, file) in [
        ("growth", "growth-times.csv"),
        ("reversal", "reversal-position.svg"),
        ("queue", "queue.json"),
        ("gas", "gas.md"),
        ("trade", "trade-faith.csv"),
        ("fluid", "fluid-transport.csv"),
        ("observables", "observables-cost.csv"),
    ] {
        let out = tempfile::tempdir().expect("a temporary directory");
        fs::write(out.path().join(file), "mine").expect("written");
        let output = experiment(name, out.path())
            .output()
            .expect("the program starts");
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{words}");
        assert!(words.contains(file) && words.contains("--force"), "{words}");
        let left = fs::read_to_string(out.path().join(file)).expect("still there");
        assert_eq!(left, "mine");
    }
}

#[test]
fn an_interrupted_experiment_writes_what_it_has() {
    let out = tempfile::tempdir().expect("a temporary directory");
    let mut child = experiment("growth", out.path())
        .spawn()
        .expect("the program starts");
    let mut stderr = BufReader::new(child.stderr.take().expect("a pipe"));
    let mut progress = String::new();
    stderr.read_line(&mut progress).expect("progress");
    assert!(progress.contains("left"), "{progress}");
    kill_process(Pid::from_child(&child), Signal::INT).expect("the program runs");
    let status = child.wait().expect("the program ends");
    let mut words = String::new();
    stderr.read_to_string(&mut words).expect("text");
    assert_eq!(status.code(), Some(130), "{words}");
    let read = |file: &str| fs::read_to_string(out.path().join(file)).expect("written");
    let document: Value = serde_json::from_str(&read("growth.json")).expect("JSON");
    assert_eq!(document["schema"], "moltop.growth/1");
    assert_eq!(document["tables"]["seed"]["rows"][2]["balls"], 15_625);
    assert!(
        read("growth.md").contains("Interrupted")
            && read("growth.md").contains("](growth-time.svg)")
    );
    assert!(read("growth-times.csv").starts_with("engine,balls,time_s,"));
    assert!(read("growth-time.svg").contains("processor time [s]"));
}

/// Waits until a file has been written again, and so is longer than it was at first.
fn await_growth(file: &Path, child: &mut Child) {
    let length = || fs::metadata(file).map_or(0, |found| found.len());
    let mut first = 0;
    while first == 0 || length() <= first {
        if first == 0 {
            first = length();
        }
        let ended = child.try_wait().expect("a child");
        assert!(ended.is_none(), "it ended before it could be interrupted");
        std::thread::yield_now();
    }
}

#[test]
fn a_killed_trade_takes_over_what_was_measured_and_only_for_its_own_scene() {
    let out = tempfile::tempdir().expect("a temporary directory");
    let unfinished = out.path().join("trade.unfinished");
    let file = out.path().join("scene.toml");
    fs::write(&file, scene(60.0, WARM)).expect("written");
    let command = |scene: &Path| {
        let mut command = experiment("trade", out.path());
        command.args(["--seconds", "0.2"]).arg(scene);
        command
    };
    let mut child = command(&file).spawn().expect("the program starts");
    await_growth(&unfinished, &mut child);
    child.kill().expect("the program runs");
    child.wait().expect("the program ends");
    let other = out.path().join("other.toml");
    fs::write(&other, scene(61.0, WARM)).expect("written");
    let output = command(&other).output().expect("the program starts");
    assert_eq!(output.status.code(), Some(2));
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(
        words.contains("of another scene") && words.contains("--force"),
        "{words}"
    );
    let output = command(&file).output().expect("the program starts");
    let words = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{words}");
    assert!(words.contains("measured before"), "{words}");
    assert!(!unfinished.exists(), "the results are whole");
    let page = fs::read_to_string(out.path().join("trade.md")).expect("written");
    assert!(page.contains("until they had settled"), "{page}");
}

#[test]
fn a_killed_gas_goes_on_from_its_checkpoint_to_the_same_numbers() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let file = directory.path().join("scene.toml");
    let text = "units = \"si\"\n[domain]\nkind = \"container\"\nsize = [2e-8, 2e-8, 2e-8]\n[[species]]\ncount = 1000\n\
                radius = 1.73e-10\nmass = 5.3e-26\nvelocity = { kind = \"maxwell\", temperature = 273.15 }\n";
    fs::write(&file, text).expect("written");
    let command = |out: &Path| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_moltop"));
        command
            .args(["experiment", "gas", "--full", "--length", "3e-8"])
            .args(["--checkpoint-every", "0s", "--out"])
            .args([out, file.as_path()])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    };
    let numbers = |out: &Path| fs::read_to_string(out.join("gas-samples.csv")).expect("written");
    let whole = directory.path().join("whole");
    let output = command(&whole).output().expect("the program starts");
    let words = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{words}");
    let killed = directory.path().join("killed");
    let unfinished = killed.join("gas.unfinished");
    for _ in 0..3 {
        let mut child = command(&killed).spawn().expect("the program starts");
        await_growth(&unfinished, &mut child);
        child.kill().expect("the program runs");
        child.wait().expect("the program ends");
    }
    let output = command(&killed).output().expect("the program starts");
    let words = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{words}");
    assert!(words.contains("goes on from"), "{words}");
    assert!(!unfinished.exists(), "the results are whole");
    assert_eq!(numbers(&killed), numbers(&whole));
    assert_eq!(numbers(&whole).lines().count(), 21);
}

/// What `experiment trade` says of a scene in a moment.
fn trade(scene: &str) -> Value {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let file = directory.path().join("scene.toml");
    fs::write(&file, scene).expect("written");
    let output = Command::new(env!("CARGO_BIN_EXE_moltop"))
        .args([
            "experiment",
            "trade",
            "--quick",
            "--json",
            "--seconds",
            "0.05",
        ])
        .arg(&file)
        .output()
        .expect("the program starts");
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{words}");
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn scene(size: f64, velocity: &str) -> String {
    format!(
        "units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [{size}, {size}, {size}]\n[[species]]\ncount = 1000\n\
         radius = 0.5\nmass = 1.0\nvelocity = {velocity}\n"
    )
}

const WARM: &str = "{ kind = \"maxwell\", temperature = 1.0 }";

#[test]
fn trade_measures_every_setting_that_a_scene_allows_and_recommends() {
    let document = trade(&scene(60.0, WARM));
    let rows = |table: &str| document["tables"][table]["rows"].as_array().cloned();
    let settings = rows("settings").expect("settings");
    let has = |name: &str| {
        settings.iter().any(|row| {
            row["setting"]
                .as_str()
                .is_some_and(|setting| setting.starts_with(name))
        })
    };
    for name in [
        "event",
        "windowed",
        "reversible",
        "step, 1/60",
        "statistical, f = 0.2",
    ] {
        assert!(has(name), "{name}");
    }
    assert!(rows("refused").is_none());
    let faith = rows("faith").expect("trajectories");
    let off = |name: &str| {
        let row = faith.iter().find(|row| row["setting"] == name);
        row.expect("a row")["off_after_0_5_d"]
            .as_f64()
            .expect("followed")
    };
    // From 106 bits; a ball of this gas moves by 30 diameters in half a mean free time.
    assert!(off("event") < 1e-8 && off("step, 1/15 d/sigma") > 1e-3);
    let numbers = rows("numbers").expect("numbers");
    for row in &numbers {
        let number = |key: &str| row[key].as_f64().expect("a number");
        // Six standard errors: the rows are many. A first row is its own reference.
        let setting = row["setting"].as_str().expect("a name");
        let (error, noise) = (number("wall_pressure_error"), number("wall_pressure_noise"));
        assert!(
            error.abs() < 6.0 * noise + 0.02,
            "{setting}: {error} {noise}"
        );
    }
    let words = document["paragraphs"].to_string();
    assert!(
        words.contains("For pressure: within 10 %") && words.contains("For trajectories"),
        "{words}"
    );
}

#[test]
fn trade_says_who_refuses_a_scene_and_that_resting_balls_have_nothing_to_trade() {
    let document = trade(&scene(14.0, WARM));
    let refused = &document["tables"]["refused"]["rows"][0];
    assert_eq!(refused["engine"], "statistical");
    assert!(
        refused["reason"].to_string().contains("too dense"),
        "{refused}"
    );
    let directory = tempfile::tempdir().expect("a temporary directory");
    let file = directory.path().join("rest.toml");
    fs::write(&file, scene(14.0, "{ kind = \"rest\" }")).expect("written");
    let output = Command::new(env!("CARGO_BIN_EXE_moltop"))
        .args(["experiment", "trade"])
        .arg(&file)
        .output()
        .expect("the program starts");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("nothing moves"));
}
