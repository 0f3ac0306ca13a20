//! Runs that outlive their terminals: real processes in pseudo-terminals.

mod bytes;
mod matrix;
mod terminal;

use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use moltop::feed::message::{self, PROTOCOL, Reply, Request};
use rustix::process::{Pid, Signal, kill_process};

use terminal::{Runs, Terminal, wait_until};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/seed-512.toml");

const PROGRAM: &str = env!("CARGO_BIN_EXE_moltop");

/// The name that a run of the scene gets.
const RUN: &str = "512-balls-1";

/// A run that ends when it is stopped, and its dashboard.
fn watched(runs: &Runs) -> Terminal {
    let terminal = Terminal::start(&mut runs.moltop(&[SCENE, "--until", "1e9"]), 80, 24);
    terminal.wait_for("running");
    terminal
}

fn pid_of(runs: &Runs, run: &str) -> Pid {
    let pid = runs.status(run)["pid"].as_i64().expect("it is going on");
    Pid::from_raw(pid as i32).expect("a process")
}

/// Waits until the run has come further, and says that it runs.
#[track_caller]
fn check_goes_on(runs: &Runs) {
    let before = runs.status(RUN)["time"].as_f64();
    let news = || runs.status(RUN);
    wait_until(
        "the run to go on",
        || news()["time"].as_f64() > before,
        || news().to_string(),
    );
    assert_eq!(news()["state"], "running");
}

#[track_caller]
fn check_stops(runs: &Runs) {
    runs.output(&["stop", RUN]);
    assert_eq!(runs.status(RUN)["state"], "stopped");
    let read = |file: &str| {
        std::fs::read_to_string(runs.path().join("moltop").join(RUN).join(file)).expect(file)
    };
    assert_eq!(read("exit"), "0 quit\n");
    assert!(read("summary.json").contains("\"exit\": \"quit\""));
    assert!(!runs.path().join("moltop").join(RUN).join("socket").exists());
}

#[test]
fn a_run_outlives_its_terminal() {
    let runs = Runs::new();
    let mut terminal = watched(&runs);
    terminal.close();
    assert_eq!(terminal.wait().code(), Some(129), "the watcher leaves");
    check_goes_on(&runs);
    check_stops(&runs);
}

#[test]
fn a_run_outlives_a_watcher_that_is_killed_and_the_shell_it_was_started_from() {
    let runs = Runs::new();
    let mut terminal = Terminal::start(&mut runs.shell(), 80, 24);
    terminal.press(&format!("{PROGRAM} {SCENE} --until 1e9\n"));
    terminal.wait_for("running");
    terminal.signal(Signal::KILL);
    terminal.wait();
    terminal.close();
    check_goes_on(&runs);

    let mut watcher = Terminal::start(&mut runs.moltop(&["attach"]), 80, 24);
    watcher.wait_for("running");
    watcher.signal(Signal::KILL);
    watcher.wait();
    check_goes_on(&runs);
    check_stops(&runs);
}

#[test]
fn a_stopped_watcher_costs_the_run_nothing_and_comes_back() {
    let runs = Runs::new();
    let terminal = watched(&runs);
    let run = pid_of(&runs, RUN);
    let memory = || {
        let status = std::fs::read_to_string(format!("/proc/{}/status", run.as_raw_nonzero()))
            .expect("it runs");
        let line = status
            .lines()
            .find_map(|line| line.strip_prefix("VmRSS:"))
            .expect("a line");
        line.trim()
            .trim_end_matches(" kB")
            .parse::<u64>()
            .expect("a number")
    };
    terminal.signal(Signal::STOP);
    check_goes_on(&runs);
    let before = memory();
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(2) {
        check_goes_on(&runs);
    }
    assert!(
        memory() < before + 1024,
        "{} kB, then {} kB",
        before,
        memory()
    );
    runs.output(&["pause", RUN]);
    terminal.signal(Signal::CONT);
    terminal.wait_for("paused");
    check_stops(&runs);
}

#[test]
fn several_watchers_see_one_run_and_only_some_command_it() {
    let runs = Runs::new();
    let mut first = watched(&runs);
    let mut looker = Terminal::start(&mut runs.moltop(&["attach", "512", "--read-only"]), 120, 40);
    looker.wait_for("running");
    looker.press(" ");
    let mut other = Terminal::start(&mut runs.moltop(&["attach", RUN]), 40, 12);
    other.wait_for("running");
    other.press(" ");
    for terminal in [&first, &looker, &other] {
        terminal.wait_for("paused");
    }
    looker.press(" ");
    looker.press("q"); // a reader leaves without a question
    assert_eq!(looker.wait().code(), Some(0));
    assert_eq!(runs.status(RUN)["state"], "paused");
    let (words, code) = runs.refused(&["replay", RUN]);
    assert!(words.contains("is going on") && code == Some(2), "{words}");
    other.press("d");
    assert_eq!(other.wait().code(), Some(0));
    other.wait_for("512-balls-1 goes on");
    first.press("q");
    first.wait_for("let it go on");
    first.press("y");
    assert_eq!(first.wait().code(), Some(0));
    first.wait_for("512 balls: quit");
    assert_eq!(runs.status(RUN)["state"], "stopped");
}

#[test]
fn the_run_ends_in_good_order_after_a_signal_and_its_watchers_say_so() {
    for (signal, code) in [(Signal::TERM, 143), (Signal::INT, 130)] {
        let runs = Runs::new();
        let mut terminal = watched(&runs);
        let run = pid_of(&runs, RUN);
        for harmless in [Signal::USR1, Signal::HUP] {
            kill_process(run, harmless).expect("it runs");
        }
        check_goes_on(&runs);
        kill_process(run, signal).expect("it runs");
        assert_eq!(terminal.wait().code(), Some(code));
        terminal.wait_for(&format!("512 balls: signal {}", code - 128));
        let exit = std::fs::read_to_string(runs.path().join("moltop").join(RUN).join("exit"));
        assert_eq!(
            exit.expect("a file"),
            format!("{code} signal {}\n", code - 128)
        );
    }
}

#[test]
fn a_signal_and_a_key_ask_for_a_checkpoint() {
    let runs = Runs::new();
    let terminal = watched(&runs);
    let file = runs.path().join("moltop").join(RUN).join("checkpoint");
    let written = || {
        std::fs::metadata(&file)
            .and_then(|file| file.modified())
            .ok()
    };
    wait_until("the first checkpoint", || written().is_some(), String::new);
    let before = written();
    kill_process(pid_of(&runs, RUN), Signal::USR1).expect("it runs");
    wait_until("a newer one", || written() > before, String::new);
    runs.output(&["pause", RUN]);
    let before = written();
    terminal.press("c");
    terminal.wait_for("is on the disk");
    wait_until("one more", || written() > before, String::new);
    check_stops(&runs);
}

#[test]
fn marks_outlive_their_watcher_and_the_past_is_beside_the_run() {
    let runs = Runs::new();
    let mut terminal = watched(&runs);
    check_goes_on(&runs);
    terminal.press("m");
    terminal.wait_for("mark 1 at");
    terminal.press("g50%\r");
    terminal.wait_for("the past at");
    check_goes_on(&runs);
    terminal.press("0");
    terminal.wait_for("● running");
    terminal.press("d");
    terminal.wait();
    let mut again = Terminal::start(&mut runs.moltop(&["attach"]), 80, 24);
    again.wait_for("running");
    again.press("m");
    again.wait_for("mark 2 at");
    again.press("d");
    again.wait();
    check_stops(&runs);
}

#[test]
fn a_run_that_has_ended_is_looked_at_again_with_its_past_and_is_not_changed() {
    let runs = Runs::new();
    runs.output(&["run", SCENE, "--until", "20", "--checkpoint-every", "1s"]);
    let directory = runs.path().join("moltop").join(RUN);
    let files = || {
        let entries = std::fs::read_dir(&directory).expect("a directory");
        let written = entries.map(|entry| {
            let entry = entry.expect("an entry");
            let modified = entry.metadata().and_then(|file| file.modified());
            (entry.file_name(), modified.expect("a time"))
        });
        let mut written: Vec<_> = written.collect();
        written.sort();
        written
    };
    let before = files();
    let mut terminal = Terminal::start(&mut runs.moltop(&["replay"]), 80, 24);
    terminal.wait_for("● ended");
    terminal.wait_for("t 20.00 of 20.00");
    terminal.press(" ");
    terminal.wait_for("the run has ended: `moltop RUN` goes on with it");
    terminal.press("g50%\r");
    terminal.wait_for("the past at 10.0, run ended");
    terminal.press("0");
    terminal.wait_for("● ended");
    terminal.press("q");
    assert_eq!(terminal.wait().code(), Some(0));
    assert!(terminal.is_sane());

    let checkpoint = directory.join("checkpoint");
    let path = checkpoint.to_str().expect("a path");
    let mut keeping = Terminal::start(&mut runs.moltop(&["replay", path, "--keep-screen"]), 80, 24);
    keeping.wait_for("t 20.00 of 20.00");
    keeping.press("d");
    assert_eq!(keeping.wait().code(), Some(0));
    // Where the shell goes on, which takes the last line; the first one has moved up.
    keeping.wait_for("t 20.00 of 20.00");
    assert!(keeping.is_sane());
    assert_eq!(files(), before);
}

#[test]
fn runs_that_have_ended_are_removed_and_no_others() {
    let runs = Runs::new();
    runs.output(&["run", SCENE, "--until", "1"]);
    runs.output(&["run", SCENE, "--until", "1", "--run-dir", "elsewhere"]);
    let mut terminal = watched(&runs);
    let kept = "512-balls-3";
    let (words, code) = runs.refused(&["clean", kept, "--yes"]);
    assert!(words.contains("is going on") && code == Some(2), "{words}");
    let (words, code) = runs.refused(&["clean"]);
    assert!(words.contains("--yes") && code == Some(2), "{words}");
    runs.output(&["clean", "--older-than", "1day", "--yes"]);
    assert_eq!(runs.output(&["list"]).lines().count(), 4);
    runs.output(&["clean", "--yes"]);
    assert!(!runs.path().join("moltop").join(RUN).exists());
    assert!(runs.path().join("elsewhere/summary.json").exists());
    let left = runs.output(&["list"]);
    assert!(left.lines().count() == 2 && left.contains(kept), "{left}");
    terminal.press("qy");
    terminal.wait();
}

#[test]
fn a_run_that_is_killed_is_known_as_such_and_its_watchers_say_so() {
    let runs = Runs::new();
    let mut terminal = watched(&runs);
    kill_process(pid_of(&runs, RUN), Signal::KILL).expect("it runs");
    terminal.wait_for("is gone");
    terminal.press("q");
    assert_eq!(terminal.wait().code(), Some(1));
    assert_eq!(runs.status(RUN)["state"], "killed");
    // Its socket is still there, and does not mislead.
    let (words, code) = runs.refused(&["stop", RUN]);
    assert!(words.contains("has ended") && code == Some(2), "{words}");
}

#[test]
fn runs_are_listed_commanded_and_followed_from_the_command_line() {
    let runs = Runs::new();
    assert!(
        runs.refused(&["status"])
            .0
            .contains("no run is going on: there is none")
    );
    assert_eq!(runs.output(&["list"]), "");
    let mut terminal = watched(&runs);
    terminal.press("d");
    assert_eq!(terminal.wait().code(), Some(0));

    let listed: serde_json::Value =
        serde_json::from_str(&runs.output(&["list", "--json"])).expect("JSON");
    let keys: Vec<&String> = listed[0].as_object().expect("an object").keys().collect();
    assert_eq!(
        keys,
        [
            "collisions_per_wall_second",
            "engine",
            "name",
            "pid",
            "run_dir",
            "scene",
            "state",
            "time",
            "until",
            "wall_time_s"
        ]
    );
    assert_eq!(listed[0]["scene"], "512 balls");
    assert!(
        runs.output(&["list"])
            .lines()
            .nth(1)
            .expect("a run")
            .starts_with("512-balls-1  running  ")
    );
    assert!(
        runs.output(&["status", "5"])
            .contains("scene       512 balls\n")
    );

    runs.output(&["pause", RUN]);
    runs.output(&["reverse", RUN]);
    assert_eq!(runs.status(RUN)["state"], "paused");
    runs.output(&["resume", RUN]);
    check_goes_on(&runs);

    let (words, code) = runs.refused(&["pause", "nitrogen"]);
    assert_eq!(
        (words.as_str(), code),
        (
            "moltop: nitrogen: no such run: there is 512-balls-1\n",
            Some(2)
        )
    );
    let (words, _) = runs.refused(&["run", SCENE, "--run-dir", &format!("moltop/{RUN}")]);
    assert!(words.contains("holds a run already"), "{words}");

    let mut follower = runs.moltop(&["watch", RUN, "--jsonl", "--every", "100ms"]);
    let follower = follower
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    check_goes_on(&runs);
    runs.output(&["stop", "--all"]);
    let output = follower.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0));
    let text = String::from_utf8(output.stdout).expect("text");
    let lines: Vec<serde_json::Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect();
    assert!(
        lines.len() > 1 && lines[0]["reversed"] == true && lines[0]["pressure"]["wall"].is_f64()
    );
    assert_eq!(lines[lines.len() - 1]["state"], "stopped");
}

#[test]
fn a_run_without_a_screen_can_be_watched_too() {
    let runs = Runs::new();
    let mut command = runs.moltop(&["run", SCENE, "--until", "1e9", "--yes", "--run-dir", "here"]);
    let mut run = command
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    wait_until(
        "the run",
        || {
            runs.moltop(&["status", RUN])
                .output()
                .is_ok_and(|output| output.status.success())
        },
        String::new,
    );
    let mut watcher = Terminal::start(&mut runs.moltop(&["attach", "here"]), 80, 24);
    watcher.wait_for("running");
    watcher.press("qy");
    assert_eq!(watcher.wait().code(), Some(0));
    assert_eq!(run.wait().expect("it ends").code(), Some(0));
}

#[test]
fn a_scene_that_cannot_run_is_refused_on_the_terminal_before_the_dashboard() {
    let runs = Runs::new();
    let mut terminal = Terminal::start(&mut runs.moltop(&["nowhere.toml"]), 80, 24);
    assert_eq!(terminal.wait().code(), Some(2));
    terminal.wait_for("nowhere.toml: cannot read");
    assert!(!terminal.bytes().contains(&0x1b));
}

/// Says something to a run's socket; gives back the answer.
fn answer(directory: &Path, request: &Request) -> std::io::Result<Reply> {
    let mut stream = UnixStream::connect(directory.join("socket"))?;
    std::io::Write::write_all(&mut stream, &message::encode(request))?;
    message::read(&mut stream)
}

#[test]
fn who_speaks_another_language_is_told_so_and_rubbish_is_cut_off() {
    let runs = Runs::new();
    let mut terminal = watched(&runs);
    let directory = runs.path().join("moltop").join(RUN);
    let hello = Request::Hello {
        protocol: PROTOCOL + 1,
        read_only: true,
    };
    let Ok(Reply::Refused(why)) = answer(&directory, &hello) else {
        panic!("a stranger was welcome");
    };
    assert!(why.contains("another moltop"), "{why}");
    assert!(matches!(
        answer(&directory, &Request::Next),
        Ok(Reply::Refused(_))
    ));
    let mut stream = UnixStream::connect(directory.join("socket")).expect("a run");
    std::io::Write::write_all(&mut stream, &[0xff; 4096]).expect("it reads");
    assert!(message::read::<Reply>(&mut stream).is_err());
    check_goes_on(&runs);
    terminal.press("qy");
    terminal.wait();
}

#[test]
fn another_user_cannot_connect() {
    if !rustix::process::geteuid().is_root() {
        return; // nobody else can be asked to try
    }
    let runs = Runs::new();
    let mut terminal = watched(&runs);
    let directory = runs.path().join("moltop").join(RUN);
    let program = runs.path().join("moltop-copy");
    // A copy of our own making might still be open in a process that another test starts just now.
    let copied = Command::new("cp").arg(PROGRAM).arg(&program).status();
    assert!(copied.expect("cp").success());
    let open = |path: &Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).expect("ours")
    };
    let attempt = || {
        let mut stranger = Command::new("setpriv");
        stranger
            .args(["--reuid=65534", "--regid=65534", "--clear-groups"])
            .arg(&program);
        let output = stranger
            .arg("watch")
            .arg(&directory)
            .current_dir("/")
            .env("HOME", "/nonexistent")
            .output();
        let output = output.expect("setpriv");
        assert!(!output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    open(runs.path(), 0o755);
    assert!(
        attempt().contains("no such run"),
        "the directory keeps others out"
    );
    // Even with all doors open the run knows its own.
    open(&runs.path().join("moltop"), 0o755);
    open(&directory, 0o755);
    open(&directory.join("lock"), 0o644);
    open(&directory.join("socket"), 0o666);
    let words = attempt();
    assert!(words.contains("belongs to another user"), "{words}");
    terminal.press("qy");
    terminal.wait();
}
