//! Trajectories: what is in the file, that it reads back, and that nothing is lost or written twice whatever ends a run.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

const SCENE: &str = "units = \"reduced\"\n[domain]\nkind = \"periodic\"\nsize = [8, 9, 10]\ncenter = [1, 2, 3]\n\
    [[species]]\ncount = 60\nradius = 0.5\nmass = 1\nvelocity = { kind = \"normal\", deviation = 1 }\n\
    [[species]]\ncount = 20\nradius = 0.25\nmass = 3\nplacement = { kind = \"random\" }\nvelocity = { kind = \"normal\", deviation = 1 }\n\
    [run]\nsample = 0.25\n";

const NAMES: [&str; 4] = ["t.xyz", "t.lammpstrj", "t.extxyz.zst", "t.dump.zst"];

fn directory() -> TempDir {
    let directory = tempfile::tempdir().expect("a directory");
    fs::write(directory.path().join("scene.toml"), SCENE).expect("a small file");
    directory
}

fn command(directory: &TempDir, program: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(program);
    for (name, _) in std::env::vars_os() {
        if name.to_string_lossy().starts_with("MOLTOP_") {
            command.env_remove(name);
        }
    }
    command
        .current_dir(directory.path())
        .env("XDG_STATE_HOME", directory.path().join("state"))
        .args(arguments)
        .stdin(Stdio::null());
    command
}

fn output(directory: &TempDir, arguments: &[&str]) -> Output {
    let output = command(directory, env!("CARGO_BIN_EXE_moltop"), arguments).output();
    output.expect("the program starts")
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[track_caller]
fn run(directory: &TempDir, arguments: &[&str]) {
    let output = output(directory, &[&["run"], arguments].concat());
    assert!(output.status.success(), "{}", words(&output));
}

#[track_caller]
fn refused(directory: &TempDir, arguments: &[&str], why: &str) {
    let output = output(directory, &[&["run"], arguments].concat());
    let words = words(&output);
    assert!(matches!(output.status.code(), Some(1 | 2)), "{words}");
    assert!(words.contains(why), "{words}");
}

fn read(directory: &TempDir, name: &str) -> Vec<u8> {
    fs::read(directory.path().join(name)).expect("the file was written")
}

fn plain(directory: &TempDir, name: &str) -> String {
    let bytes = read(directory, name);
    let bytes = if Path::new(name).extension().is_some_and(|end| end == "zst") {
        zstd::decode_all(&*bytes).expect("whole")
    } else {
        bytes
    };
    String::from_utf8(bytes).expect("text")
}

/// Numbers of a state file: place, velocity, radius and mass of each ball.
fn state(directory: &TempDir, name: &str) -> Vec<Vec<f64>> {
    let text = plain(directory, name);
    let numbers = |line: &str| -> Vec<f64> {
        let cells = line.split(',').skip(1).take(8);
        cells.map(|cell| cell.parse().expect("a number")).collect()
    };
    text.lines().skip(1).map(numbers).collect()
}

/// The same of a frame.
fn frame(lines: &[&str], first: usize) -> Vec<Vec<f64>> {
    let numbers = |line: &&str| -> Vec<f64> {
        let cells = line.split(' ').skip(first).take(8);
        cells.map(|cell| cell.parse().expect("a number")).collect()
    };
    lines.iter().map(numbers).collect()
}

#[test]
fn every_frame_is_the_state_at_its_time() {
    let directory = directory();
    for name in NAMES {
        let until = ["scene.toml", "--until", "1", "--run-dir", name];
        run(
            &directory,
            &[&until[..], &["--trajectory", &format!("of-{name}")]].concat(),
        );
    }
    let at = |name: &str| plain(&directory, &format!("of-{name}"));
    assert_eq!(at("t.xyz"), at("t.extxyz.zst"));
    assert_eq!(at("t.lammpstrj"), at("t.dump.zst"));
    let (xyz, dump) = (at("t.xyz"), at("t.lammpstrj"));
    let xyz: Vec<&str> = xyz.lines().collect();
    let dump: Vec<&str> = dump.lines().collect();
    let (xyz, dump): (Vec<_>, Vec<_>) = (xyz.chunks(82).collect(), dump.chunks(89).collect());
    assert_eq!((xyz.len(), dump.len()), (5, 5));
    for (number, time) in [(1, "0.25"), (4, "1")] {
        run(
            &directory,
            &[
                "scene.toml",
                "--until",
                time,
                "--state",
                "end.csv",
                "--force",
            ],
        );
        let state = state(&directory, "end.csv");
        assert_eq!(frame(&xyz[number][2..], 1), state, "{time}");
        assert_eq!(frame(&dump[number][9..], 2), state, "{time}");
        let time: f64 = time.parse().expect("a number");
        assert!(
            xyz[number][1].ends_with(&format!(" Time={time:?}")),
            "{}",
            xyz[number][1]
        );
        assert_eq!(dump[number][1], number.to_string());
    }
    assert!(
        xyz[0][1].starts_with(
            "Lattice=\"8.0 0.0 0.0 0.0 9.0 0.0 0.0 0.0 10.0\" Origin=\"-3.0 -2.5 -2.0\" pbc=\"T T T\" "
        ),
        "{}",
        xyz[0][1]
    );
    let bounds = [
        "ITEM: BOX BOUNDS pp pp pp",
        "-3.0 5.0",
        "-2.5 6.5",
        "-2.0 8.0",
    ];
    assert_eq!(dump[0][4..8], bounds);
}

#[test]
fn the_last_frame_places_the_balls_of_another_run_bit_for_bit() {
    let directory = directory();
    for name in NAMES {
        let output = ["--trajectory", name, "--state", "end.csv", "--force"];
        run(
            &directory,
            &[&["scene.toml", "--until", "1"], &output[..]].concat(),
        );
        let scene = format!(
            "units = \"reduced\"\n[domain]\nkind = \"periodic\"\nsize = [8, 9, 10]\ncenter = [1, 2, 3]\n\
             [[species]]\ncount = 80\nplacement = {{ kind = \"file\", path = \"{name}\" }}\n"
        );
        fs::write(directory.path().join("again.toml"), scene).expect("a small file");
        for input in ["again.toml", name] {
            let domain: &[&str] = if input == name {
                &["--domain-of", "scene.toml"]
            } else {
                &[]
            };
            let arguments = [&["convert", input, "again.csv", "--force"], domain].concat();
            let done = self::output(&directory, &arguments);
            assert!(done.status.success(), "{}", words(&done));
            assert_eq!(
                state(&directory, "again.csv"),
                state(&directory, "end.csv"),
                "{input}"
            );
        }
    }
}

#[test]
fn a_trajectory_changes_nothing_of_what_it_shows() {
    let directory = directory();
    for engine in ["event", "windowed", "reversible", "step", "statistical"] {
        let hash = |trajectory: &[&str]| {
            let until = ["scene.toml", "--until", "3", "--engine", engine];
            let outputs = ["--summary", "s.json", "--force"];
            let step: &[&str] = if engine == "step" {
                &["--dt", "0.01"]
            } else {
                &[]
            };
            let arguments = [&until[..], &outputs, trajectory, step];
            run(&directory, &arguments.concat());
            let summary: serde_json::Value =
                serde_json::from_slice(&read(&directory, "s.json")).expect("JSON");
            (
                summary["state_hash"].clone(),
                summary["pair_collisions"].clone(),
            )
        };
        let without = hash(&[]);
        let with = hash(&["--trajectory", "t.dump", "--trajectory-every", "0.0703125"]);
        assert_eq!(with, without, "{engine}");
        let frames = plain(&directory, "t.dump")
            .matches("ITEM: TIMESTEP")
            .count();
        assert_eq!(frames, 43, "{engine}");
    }
}

#[test]
fn a_run_that_goes_on_from_its_checkpoint_goes_on_with_its_trajectory() {
    let directory = directory();
    for name in NAMES {
        let whole = format!("whole-{name}");
        let of = ["--run-dir", &format!("dir-{name}"), "--trajectory", name];
        run(
            &directory,
            &["scene.toml", "--until", "4", "--trajectory", &whole],
        );
        run(
            &directory,
            &[&["scene.toml", "--until", "2"], &of[..]].concat(),
        );
        let first = read(&directory, name);
        // As if the run had been killed while it wrote frames that its checkpoint does not have.
        let more = [&first[..], &first[..first.len() / 3]].concat();
        fs::write(directory.path().join(name), more).expect("it can be written");
        run(&directory, &[of[1], "--until", "4"]);
        assert_eq!(read(&directory, name), read(&directory, &whole), "{name}");
    }
    // Elsewhere it leaves the file alone, and may begin another.
    let before = read(&directory, "t.xyz");
    let elsewhere = ["dir-t.xyz/checkpoint", "--until", "5", "--run-dir", "fork"];
    run(
        &directory,
        &[&elsewhere[..], &["--trajectory", "rest.xyz"]].concat(),
    );
    assert_eq!(read(&directory, "t.xyz"), before);
    let rest = plain(&directory, "rest.xyz");
    let times: Vec<_> = rest
        .lines()
        .filter_map(|line| line.split_once(" Time="))
        .collect();
    let times: Vec<_> = times.into_iter().map(|(_, time)| time).collect();
    assert_eq!(times, ["4.0", "4.25", "4.5", "4.75", "5.0"]);
    let every = ["dir-t.xyz", "--until", "6", "--trajectory-every", "1"];
    refused(&directory, &every, "t.xyz has a frame every 0.25");
    // A file that is another now is not touched.
    fs::write(directory.path().join("t.xyz"), &before[1..]).expect("it can be written");
    let on = ["dir-t.xyz", "--until", "6"];
    refused(
        &directory,
        &on,
        "t.xyz: cannot write: is not as the checkpoint has it",
    );
    assert_eq!(read(&directory, "t.xyz"), &before[1..]);
}

#[test]
fn a_killed_run_loses_no_frame_but_the_last() {
    let directory = directory();
    let many = [
        "scene.toml",
        "--until",
        "400",
        "--trajectory-every",
        "0.03125",
    ];
    run(
        &directory,
        &[&many[..], &["--trajectory", "whole.xyz"]].concat(),
    );
    let whole = read(&directory, "whole.xyz");
    let of = [
        "--trajectory",
        "t.xyz",
        "--run-dir",
        "killed",
        "--checkpoint-every",
        "20ms",
    ];
    let arguments = [&["run"], &many[..], &of[..]].concat();
    let mut child = command(&directory, env!("CARGO_BIN_EXE_moltop"), &arguments)
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    let file = directory.path().join("t.xyz");
    let deadline = Instant::now() + Duration::from_secs(60);
    while file.metadata().map_or(0, |file| file.len()) < 1_000_000 && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().expect("it is ours");
    child.wait().expect("it has ended");
    let found = read(&directory, "t.xyz");
    assert!(found.len() >= 1_000_000);
    assert!(
        whole.starts_with(&found),
        "what is there is as it should be"
    );
    run(&directory, &["killed", "--until", "400"]);
    assert!(read(&directory, "t.xyz") == whole);
}

/// The limit on the size of files stands for a full disk: both refuse to write on.
#[test]
fn a_full_disk_costs_frames_and_not_the_run() {
    let directory = directory();
    for name in ["t.xyz", "t.dump.zst"] {
        let moltop = env!("CARGO_BIN_EXE_moltop");
        let script = format!(
            "trap '' XFSZ; ulimit -f 120; exec {moltop} run scene.toml --until 30 --trajectory {name} --run-dir {name}.d \
             --checkpoint-every 100000s --state end.csv --force"
        );
        let output = command(&directory, "sh", &["-c", &script]).output();
        let output = output.expect("there is a shell");
        let words = words(&output);
        assert_eq!(output.status.code(), Some(1), "{words}");
        assert!(words.contains("frames are missing"), "{words}");
        let log = String::from_utf8(read(&directory, &format!("{name}.d/log"))).expect("text");
        assert!(log.contains("trajectory: no frame"), "{log}");
        // What is there is whole.
        let text = plain(&directory, name);
        let lines = if name == "t.xyz" { 82 } else { 89 };
        let found = text.lines().count();
        assert!(found > lines && found.is_multiple_of(lines));
        assert_eq!(state(&directory, "end.csv").len(), 80);
    }
}

#[test]
fn names_that_are_taken_or_say_nothing_are_refused() {
    let directory = directory();
    fs::write(directory.path().join("taken.xyz"), "precious").expect("a small file");
    let check = |arguments: &[&str], why: &str| {
        refused(
            &directory,
            &[&["scene.toml", "--until", "1"], arguments].concat(),
            why,
        )
    };
    check(
        &["--trajectory", "taken.xyz"],
        "taken.xyz: exists: --force overwrites it",
    );
    assert_eq!(read(&directory, "taken.xyz"), b"precious");
    check(
        &["--trajectory", "balls.pdb"],
        "--trajectory balls.pdb: must end in .xyz",
    );
    check(
        &["--trajectory-every", "1"],
        "--trajectory-every: goes with --trajectory",
    );
    check(&["--trajectory", "nowhere/t.xyz"], "cannot write here");
    check(
        &["--trajectory", "a.xyz", "--state", "a.xyz"],
        "two outputs have the same name",
    );
}
