//! A run that goes on from its checkpoint is the run that was never stopped, bit for bit; a damaged checkpoint is refused.

mod common;
#[path = "common/records.rs"]
mod records;

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use common::{lattice, seed_scene};
use moltop::checkpoint;
use moltop::domain::{Boundary, Plane};
use moltop::engine::{Engine, Saved};
use moltop::feed::{self, Feed, PastFeed};
use moltop::scene::Scene;
use moltop::snapshot::{Phase, Snapshot};
use moltop::state::{Placement, State};
use moltop::worker::engines::{CalendarName, Choice};
use moltop::worker::{Options, SavedRun, Worker};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use records::{advance, counted};
use serde_json::Value;
use tempfile::TempDir;

/// Through a file's bytes and back.
fn through_a_file(engine: &dyn Engine) -> (State, Saved) {
    let mut bytes = Vec::new();
    checkpoint::write(&(engine.state(), engine.save()), 7, &mut bytes).expect("memory takes all");
    checkpoint::decode(&bytes).expect("whole").0
}

/// Stops a run at several moments, also just before and after a reversal, and goes on from a checkpoint each time.
#[track_caller]
fn check_engine(choice: Choice, placement: &Placement, until: f64, fewest: usize) {
    let mut whole = choice.engine(State::new(placement));
    let mut parts = choice.engine(State::new(placement));
    let mut collisions = 0;
    for (stop, reverse) in [(0.31, false), (0.5, true), (0.777, false), (1.0, false)] {
        let (state, saved) = through_a_file(&*parts);
        assert!(saved.fits(state.ball_count()), "{choice:?}");
        parts = choice.resume(state, saved).expect("the same engine");
        let expected = advance(&mut *whole, until * stop);
        assert_eq!(advance(&mut *parts, until * stop), expected, "{choice:?}");
        collisions += expected.len();
        if reverse {
            whole.reverse();
            let (state, saved) = through_a_file(&*parts);
            parts = choice.resume(state, saved).expect("the same engine");
            parts.reverse();
        }
    }
    assert!(collisions >= fewest, "{choice:?}: {collisions}");
    assert_eq!(counted(&*parts), counted(&*whole), "{choice:?}");
    parts.settle();
    whole.settle();
    assert_eq!(parts.state(), whole.state(), "{choice:?}");
}

#[test]
fn every_engine_goes_on_bit_for_bit() {
    let dense = seed_scene(6, 1);
    let mut periodic = lattice(5, 1.3, 6.5, 2);
    periodic.domain.boundary = Boundary::Periodic;
    let mut halved = seed_scene(4, 3);
    halved.domain.planes.push(Plane {
        normal: glam::DVec3::X,
        offset: 0.0,
    });
    let calendars = [
        CalendarName::Indexed,
        CalendarName::Lazy,
        CalendarName::Bounded,
    ];
    for choice in calendars
        .map(Choice::Event)
        .into_iter()
        .chain([Choice::Reversible, Choice::Step(0.01)])
    {
        check_engine(choice, &dense, 6.0, 1000);
        check_engine(choice, &periodic, 4.0, 1000);
        check_engine(choice, &halved, 6.0, 200);
    }
    check_engine(Choice::Step(0.4), &dense, 6.0, 200);
    check_engine(Choice::Windowed(1), &dense, 6.0, 1000);
    check_engine(Choice::Windowed(2), &lattice(28, 4.0, 113.0, 4), 12.0, 5000);
}

/// A scene of 64 balls that are named and counted, and a checkpoint of it.
const SMALL: &str = "units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [8.0, 8.0, 8.0]\n[[species]]\ncount = 64\n\
                     radius = 0.5\nmass = 1.0\nvelocity = { kind = \"normal\", deviation = 1.0 }\n[run]\nsample = 0.1\n";

fn moltop(directory: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_moltop"));
    let settings = std::env::vars_os().map(|(name, _)| name);
    for name in settings.filter(|name| name.to_string_lossy().starts_with("MOLTOP_")) {
        command.env_remove(name);
    }
    command
        .current_dir(directory)
        .env("XDG_STATE_HOME", directory.join("state"))
        .args(arguments)
        .stdin(Stdio::null());
    command
}

#[track_caller]
fn output(directory: &Path, arguments: &[&str]) -> Output {
    moltop(directory, arguments)
        .output()
        .expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[track_caller]
fn run(directory: &Path, arguments: &[&str]) {
    let output = output(directory, arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

/// A directory with a scene, and a run in `begun` that has come to time 2.
fn small_run() -> TempDir {
    let directory = tempfile::tempdir().expect("a directory");
    fs::write(directory.path().join("scene.toml"), SMALL).expect("it can be written");
    let arguments = ["run", "scene.toml", "--until", "2", "--run-dir", "begun"];
    run(directory.path(), &arguments);
    directory
}

fn read(directory: &Path, name: &str) -> String {
    fs::read_to_string(directory.join(name)).expect("the file was written")
}

/// A summary without what depends on the wall clock or on how often a calendar was made.
fn summary(directory: &Path, name: &str) -> Value {
    let mut summary: Value = serde_json::from_str(&read(directory, name)).expect("JSON");
    let keys = summary.as_object_mut().expect("an object");
    for key in [
        "wall_time_s",
        "setup_time_s",
        "collisions_per_wall_second",
        "peak_rss_bytes",
        "queue_length",
    ] {
        keys.remove(key);
    }
    let counters = keys["counters"].as_object_mut().expect("an object");
    counters.remove("cell_crossings");
    counters.remove("stale_events");
    summary
}

/// Rows of a series without the wall time.
fn rows(series: &str) -> Vec<String> {
    let row = |line: &str| {
        let cells = line.split(',').enumerate();
        let kept: Vec<_> = cells.filter(|(column, _)| *column != 1).collect();
        kept.into_iter()
            .map(|(_, cell)| cell)
            .collect::<Vec<_>>()
            .join(",")
    };
    series.lines().skip(1).map(row).collect()
}

#[test]
fn a_run_that_goes_on_without_its_scene_file_has_the_same_summary_rows_and_state() {
    for engine in [&["event"][..], &["reversible"], &["step", "--dt", "0.01"]] {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path();
        fs::write(path.join("scene.toml"), SMALL).expect("it can be written");
        let whole = ["run", "scene.toml", "--until", "5", "--engine"];
        let files = [
            "--summary",
            "whole.json",
            "--series",
            "whole.csv",
            "--state",
            "whole-end.csv",
        ];
        run(path, &[&whole[..], engine, &files].concat());
        let half = [
            "run",
            "scene.toml",
            "--run-dir",
            "half",
            "--until",
            "2.345",
            "--engine",
        ];
        run(path, &[&half[..], engine].concat());
        fs::remove_file(path.join("scene.toml")).expect("it was there");
        let rest = [
            "run",
            "half",
            "--until",
            "5",
            "--summary",
            "rest.json",
            "--series",
            "rest.csv",
        ];
        run(path, &[&rest[..], &["--state", "rest-end.csv"]].concat());
        assert_eq!(
            summary(path, "rest.json"),
            summary(path, "whole.json"),
            "{engine:?}"
        );
        assert_eq!(read(path, "rest-end.csv"), read(path, "whole-end.csv"));
        let (rest, whole) = (
            rows(&read(path, "rest.csv")),
            rows(&read(path, "whole.csv")),
        );
        assert_eq!((rest.len(), whole.len()), (27, 50));
        assert_eq!(rest, whole[23..]);
        let history = read(path, "half/history.csv");
        let second = history.lines().nth(1).expect("a stretch");
        assert!(
            second.starts_with("0.0,"),
            "the history begins with the run: {second}"
        );
    }
}

/// The run in this process, with its checkpoints in a directory.
fn worker(directory: &Path, until: Option<f64>) -> Worker {
    let scene = Scene::parse(Path::new("small.toml"), SMALL).expect("a good scene");
    let placement = scene.place().expect("it fits");
    let options = Options {
        engine: Choice::default(),
        until,
        until_error: None,
        reversals: Vec::new(),
        series: None,
        directory: Some(directory.to_owned()),
        replay: false,
        checkpoint_every: Duration::from_millis(20),
        on_trouble: None,
        trajectory: None,
        program_start: Instant::now(),
    };
    Worker::start(&scene, placement, options)
}

/// Waits for a snapshot, at most a minute.
#[track_caller]
fn wait_for(feed: &dyn Feed, what: impl Fn(&Snapshot) -> bool) -> Arc<Snapshot> {
    let began = Instant::now();
    loop {
        let latest = feed.latest();
        if what(&latest) {
            return latest;
        }
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "{:?}",
            latest.notice
        );
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn the_past_is_made_again_bit_for_bit_across_a_reversal_and_the_run_goes_on() {
    let directory = tempfile::tempdir().expect("a directory");
    let running = worker(directory.path(), None);
    let feed = running.feed();
    wait_for(&feed, |run| {
        run.last_checkpoint.is_some_and(|time| time > 1.0)
    });
    feed.send(feed::Command::Pause);
    let turned = wait_for(&feed, |run| run.phase == Phase::Paused);
    feed.send(feed::Command::Reverse);
    feed.send(feed::Command::Resume);
    wait_for(&feed, |run| {
        run.last_checkpoint
            .is_some_and(|time| time > turned.time + 5.0)
    });
    // The state then, from a run that was stopped there.
    let hash = |times: &[f64]| {
        let alone = tempfile::tempdir().expect("a directory");
        let scene = Scene::parse(Path::new("small.toml"), SMALL).expect("a good scene");
        let options = Options {
            engine: Choice::default(),
            until: Some(times[times.len() - 1]),
            until_error: None,
            reversals: times[..times.len() - 1].to_vec(),
            series: None,
            directory: Some(alone.path().to_owned()),
            replay: false,
            checkpoint_every: Duration::MAX,
            on_trouble: None,
            trajectory: None,
            program_start: Instant::now(),
        };
        let placement = scene.place().expect("it fits");
        Worker::start(&scene, placement, options)
            .join()
            .snapshot
            .state_hash
    };
    for (time, reversals) in [(0.5, vec![]), (turned.time + 1.25, vec![turned.time])] {
        let before = feed.latest().time;
        feed.send(feed::Command::Goto(Some(time)));
        let then = |run: &Snapshot| {
            (run.past.as_ref()).is_some_and(|past| past.time == time && past.state_hash.is_some())
        };
        let now = wait_for(&feed, then);
        let past = PastFeed(&feed).latest();
        assert_eq!((past.time, past.phase.clone()), (time, Phase::Finished));
        assert!(past.sample.is_some() && past.reversed != reversals.is_empty());
        assert_eq!(past.state_hash, hash(&[&reversals[..], &[time]].concat()));
        assert!(
            now.time >= before && now.phase == Phase::Running,
            "the run goes on"
        );
    }
    feed.send(feed::Command::Goto(Some(1e9)));
    let refused = wait_for(&feed, |run| run.notice.is_some());
    assert!(
        refused
            .notice
            .as_deref()
            .is_some_and(|why| why.contains("has not been there"))
    );
    feed.send(feed::Command::Goto(None));
    wait_for(&feed, |run| run.past.is_none());
    feed.send(feed::Command::Stop);
    running.join();
    let kept = fs::read_dir(directory.path().join("past"))
        .expect("checkpoints")
        .count();
    assert!((1..=16).contains(&kept), "{kept}");
}

#[test]
fn a_run_ends_when_the_pressure_is_known_well_enough() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path();
    fs::write(path.join("scene.toml"), SMALL).expect("it can be written");
    let files = ["--summary", "end.json", "--until", "100000", "--yes"];
    run(
        path,
        &[&["run", "scene.toml", "--until-error", "2%"], &files[..]].concat(),
    );
    let summary = summary(path, "end.json");
    let pressure = |key: &str| summary["pressure"][key].as_f64().expect("a pressure");
    let error = pressure("standard_error") / pressure("wall");
    assert!((0.005..=0.02).contains(&error), "{error}");
    assert_eq!(summary["exit"], "finished");
    assert!(summary["time"].as_f64().is_some_and(|time| time < 1e4));
}

/// Kills a run at random moments, with a checkpoint every 10 ms, and goes on each time; the end is that of a run in one go.
fn check_kills(kills: u32, seed: u64) {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/seed-512.toml");
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let until = (7 * kills).to_string(); // far enough to survive most of them
    run(
        path,
        &["run", scene, "--until", &until, "--summary", "whole.json"],
    );
    let mut begun = false;
    let mut killed = 0;
    let often = ["--checkpoint-every", "10ms", "--until", &until];
    for _ in 0..kills {
        let what = if begun {
            vec!["run", "killed"]
        } else {
            let _ = fs::remove_dir_all(path.join("killed"));
            vec!["run", scene, "--run-dir", "killed"]
        };
        let mut child = moltop(path, &[&what[..], &often].concat())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        std::thread::sleep(Duration::from_millis(random.random_range(5..150)));
        child.kill().expect("it is ours");
        let status = child.wait().expect("it has ended");
        let names =
            ["checkpoint", "checkpoint.previous"].map(|name| path.join("killed").join(name));
        begun = names.iter().any(|name| name.exists());
        if status.code() == Some(0) {
            break; // it was through
        }
        killed += 1;
    }
    if begun {
        println!("killed {killed} times");
        let rest = output(path, &["run", "killed", "--until", &until]);
        let words = text(&rest.stderr);
        assert!(rest.status.success(), "{words}");
        let (whole, rest) = (
            summary(path, "whole.json"),
            summary(path, "killed/summary.json"),
        );
        assert_eq!(rest["state_hash"], whole["state_hash"]);
        assert_eq!(rest["pair_collisions"], whole["pair_collisions"]);
        assert_eq!(rest["pressure"], whole["pressure"]);
    }
}

#[test]
fn a_run_killed_at_random_moments_ends_as_if_nothing_had_happened() {
    // MOLTOP_KILLS=100 cargo test --test checkpoint killed: a hundred, which takes a minute.
    let kills = std::env::var("MOLTOP_KILLS").ok();
    check_kills(kills.map_or(6, |kills| kills.parse().expect("a number")), 1);
}

#[test]
fn every_truncation_and_ten_thousand_flipped_bits_are_refused() {
    let directory = small_run();
    let file = directory.path().join("begun/checkpoint");
    let bytes = fs::read(&file).expect("a checkpoint");
    let refused = |bytes: &[u8]| {
        let read = checkpoint::decode::<SavedRun>(bytes);
        read.expect_err("a damaged checkpoint is refused")
    };
    for length in 0..bytes.len() {
        refused(&bytes[..length]);
    }
    refused(&[&bytes[..], &[0]].concat());
    let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
    let mut damaged = bytes.clone();
    for _ in 0..10_000 {
        let bit = random.random_range(0..8 * bytes.len());
        damaged[bit / 8] ^= 1 << (bit % 8);
        refused(&damaged);
        damaged[bit / 8] = bytes[bit / 8];
    }
    // The program says so, and goes on from the checkpoint before, if it is told the directory.
    let length = bytes.len();
    fs::write(&file, &bytes[..length / 2]).expect("it can be written");
    let output = output(
        directory.path(),
        &["run", "begun/checkpoint", "--until", "3"],
    );
    assert_eq!(output.status.code(), Some(2));
    let words = text(&output.stderr);
    assert!(
        words.contains("begun/checkpoint: not a checkpoint that can be used: it is cut short"),
        "{words}"
    );
    fs::write(directory.path().join("begun/checkpoint.previous"), &bytes)
        .expect("it can be written");
    run(directory.path(), &["run", "begun", "--until", "3"]);
}

#[test]
fn options_that_contradict_a_checkpoint_are_refused() {
    let directory = small_run();
    let check = |option: &[&str], why: &str| {
        let arguments = [&["run", "begun/checkpoint"], option].concat();
        let output = output(directory.path(), &arguments);
        let words = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{words}");
        assert!(words.contains(why), "{words}");
    };
    check(
        &["--until", "1.5"],
        "has come to 2.000 already: give a later end",
    );
    check(
        &["--until", "9", "--engine", "step"],
        "--engine step: begun/checkpoint is a run of engine event",
    );
    check(
        &["--until", "9", "--dt", "0.1"],
        "--dt: begun/checkpoint is a run of engine event",
    );
    check(
        &["--until", "9", "--seed", "4"],
        "--seed: begun/checkpoint has its balls placed already",
    );
    check(&["--until", "9", "--sample", "4"], "has rows every 0.1");
    check(&["--until", "1e15"], "give a smaller --until, or --yes");
}

#[test]
fn a_checkpoint_that_cannot_be_written_does_not_stop_the_run() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path();
    fs::write(path.join("scene.toml"), SMALL).expect("it can be written");
    let begun = ["run", "scene.toml", "--run-dir", "begun", "--until", "2"];
    run(path, &begun);
    // A directory that is not empty stands where the checkpoint before is to go.
    fs::remove_file(path.join("begun/checkpoint.previous")).expect("it was there");
    fs::create_dir_all(path.join("begun/checkpoint.previous/full")).expect("it can be made");
    let before = fs::read(path.join("begun/checkpoint")).expect("a checkpoint");
    let started = Instant::now();
    run(
        path,
        &[
            "run",
            "begun/checkpoint",
            "--until",
            "20",
            "--checkpoint-every",
            "10ms",
        ],
    );
    assert!(started.elapsed() < Duration::from_secs(60));
    assert_eq!(
        fs::read(path.join("begun/checkpoint")).expect("it is safe"),
        before
    );
    assert!(
        read(path, "begun/log").contains("checkpoint: cannot write"),
        "{}",
        read(path, "begun/log")
    );
    let summary = summary(path, "begun/summary.json");
    assert_eq!(summary["time"], 20.0);
}

#[test]
fn a_run_directory_that_becomes_read_only_does_not_stop_the_run() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path();
    fs::write(path.join("scene.toml"), SMALL).expect("it can be written");
    let held = path.join("held");
    // Permissions do not bind root; this flag does, where the file system has it.
    let seal = |flag: &str| {
        let done = Command::new("chattr")
            .arg(flag)
            .arg(&held)
            .stderr(Stdio::null())
            .status();
        done.is_ok_and(|status| status.success())
    };
    let arguments = [
        "run",
        "scene.toml",
        "--run-dir",
        "held",
        "--until",
        "1e9",
        "--yes",
    ];
    let mut child = moltop(
        path,
        &[&arguments[..], &["--checkpoint-every", "20ms"]].concat(),
    )
    .stderr(Stdio::null())
    .spawn()
    .expect("the program starts");
    let wait_for = |what: &str, holds: &dyn Fn() -> bool| {
        let began = Instant::now();
        while !holds() {
            assert!(began.elapsed() < Duration::from_secs(60), "{what}");
            std::thread::sleep(Duration::from_millis(10));
        }
    };
    let log = || fs::read_to_string(held.join("log")).unwrap_or_default();
    wait_for("a checkpoint", &|| {
        held.join("checkpoint.previous").exists()
    });
    if !seal("+i") {
        child.kill().expect("it is ours");
        child.wait().expect("it has ended");
        return; // nobody can make it read-only here
    }
    let told = || log().matches("checkpoint: ").count();
    wait_for("two refusals", &|| told() >= 2);
    let whole = SavedRun::load(&held).is_ok();
    assert!(seal("-i"));
    let before = log().matches("INFO checkpoint").count();
    wait_for("the next checkpoint", &|| {
        log().matches("INFO checkpoint").count() > before
    });
    assert!(whole, "what was safe before is so still");
    child.kill().expect("it is ours");
    child.wait().expect("it has ended");
    assert!(SavedRun::load(&held).is_ok());
}
