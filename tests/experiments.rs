//! `moltop experiment`: its files, what it refuses, and that an interrupted one keeps what it has measured.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};

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
