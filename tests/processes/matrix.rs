//! What a full-screen program must not do to its terminal, for a dashboard beside its run and for one in the same process.

use std::process::Command;
use std::time::{Duration, Instant};

use rustix::process::Signal;

use crate::terminal::{LONG, Runs, Terminal, wait_until};
use crate::{PROGRAM, SCENE};

const MODES: [&[&str]; 2] = [&[], &["--in-process"]];

/// The program's arguments in a mode.
fn arguments(mode: &[&'static str]) -> Vec<&'static str> {
    [&[SCENE, "--until", "1e9"], mode].concat()
}

/// A dashboard with something set in its environment.
fn dashboard(
    runs: &Runs,
    mode: &[&'static str],
    setting: (&str, &str),
    size: (u16, u16),
) -> Terminal {
    let mut command = runs.moltop(&arguments(mode));
    command.env(setting.0, setting.1);
    Terminal::start(&mut command, size.0, size.1)
}

const NO_SETTING: (&str, &str) = ("NOTHING", "");

#[track_caller]
fn check_given_back(terminal: &Terminal) {
    wait_until(
        "the terminal to be given back",
        || !terminal.is_taken() && terminal.is_sane() && terminal.shows_cursor(),
        || terminal.screen(),
    );
}

#[test]
fn a_signal_ends_the_dashboard_and_the_terminal_is_as_before() {
    for mode in MODES {
        for (signal, code) in [(Signal::TERM, 143), (Signal::HUP, 129), (Signal::INT, 130)] {
            let runs = Runs::new();
            let mut terminal = dashboard(&runs, mode, NO_SETTING, (80, 24));
            terminal.wait_for("running");
            terminal.signal(signal);
            assert_eq!(terminal.wait().code(), Some(code), "{mode:?}");
            check_given_back(&terminal);
            let words = if mode.is_empty() {
                "goes on"
            } else {
                "512 balls: signal"
            };
            terminal.wait_for(words);
        }
    }
}

#[test]
fn a_stop_gives_the_terminal_to_the_shell_and_the_dashboard_comes_back_whole() {
    for mode in MODES {
        let runs = Runs::new();
        let mut terminal = Terminal::start(&mut runs.shell(), 80, 24);
        terminal.press(&format!("{PROGRAM} {}\n", arguments(mode).join(" ")));
        for stop in ["key", "signal"] {
            terminal.wait_for("running");
            if stop == "key" {
                terminal.press("\x1a");
            } else {
                terminal.signal_foreground(Signal::TSTP);
            }
            terminal.wait_for("Stopped");
            check_given_back(&terminal);
            terminal.press("clear; fg\n");
        }
        terminal.wait_for("running");
        assert!(terminal.is_taken() && !terminal.is_sane());
        terminal.press("qy");
        terminal.wait_for("512 balls: quit");
        terminal.press("exit\n");
        terminal.wait();
    }
}

/// Escape sequences that choose a colour.
fn colours(bytes: &[u8]) -> usize {
    let text = String::from_utf8_lossy(bytes);
    let sequences = text.split("\x1b[").filter_map(|rest| {
        let end = rest.find(|letter: char| letter.is_ascii_alphabetic())?;
        (rest.as_bytes()[end] == b'm').then(|| rest[..end].to_owned())
    });
    let is_colour = |code: &str| {
        code.parse()
            .is_ok_and(|code: u32| (30..=49).contains(&code) || (90..=107).contains(&code))
    };
    sequences
        .filter(|codes| codes.split(';').any(is_colour))
        .count()
}

/// A variable of the environment, and what the bytes sent must be like.
type Rule = ((&'static str, &'static str), fn(&[u8]) -> bool);

#[test]
fn colours_and_letters_are_those_that_the_environment_allows() {
    for mode in MODES {
        let rules: [Rule; 3] = [
            (NO_SETTING, |bytes| colours(bytes) > 10 && !bytes.is_ascii()),
            (("NO_COLOR", "1"), |bytes| colours(bytes) == 0),
            (("LC_ALL", "C"), <[u8]>::is_ascii),
        ];
        for (setting, is_right) in rules {
            let runs = Runs::new();
            let mut terminal = dashboard(&runs, mode, setting, (80, 24));
            terminal.wait_for("running");
            terminal.press("?");
            terminal.wait_for("pause the run");
            terminal.signal(Signal::TERM);
            terminal.wait();
            assert!(
                is_right(&terminal.bytes()),
                "{mode:?} {setting:?}: {} colours",
                colours(&terminal.bytes())
            );
        }
    }
}

#[test]
fn a_terminal_that_cannot_move_its_cursor_and_a_pipe_get_plain_lines() {
    for mode in MODES {
        let runs = Runs::new();
        let mut terminal = dashboard(&runs, mode, ("TERM", "dumb"), (80, 24));
        terminal.wait_for("running, wall");
        terminal.signal(Signal::TERM);
        assert_eq!(terminal.wait().code(), Some(143));
        assert!(!terminal.bytes().contains(&0x1b));
        let short = [&[SCENE, "--until", "3"], mode].concat();
        let words = runs.output(&short);
        assert!(
            words.contains("finished, wall") && !words.contains('\x1b'),
            "{words}"
        );
    }
}

#[test]
fn a_dashboard_leaves_a_dead_terminal_at_once_also_where_nobody_is_told_of_it() {
    for mode in MODES {
        for ignored in [false, true] {
            let runs = Runs::new();
            let mut terminal = if ignored {
                let line = format!("trap '' HUP; exec {PROGRAM} {}", arguments(mode).join(" "));
                let mut shell = Command::new("sh");
                Terminal::start(runs.settle(shell.args(["-c", &line])), 80, 24)
            } else {
                dashboard(&runs, mode, NO_SETTING, (80, 24))
            };
            terminal.wait_for("running");
            terminal.close();
            let begin = Instant::now();
            assert_eq!(
                terminal.wait().code(),
                Some(129),
                "{mode:?}, ignored: {ignored}"
            );
            assert!(begin.elapsed() < LONG / 2);
        }
    }
}

#[test]
fn a_line_that_takes_nothing_gets_one_screen_when_it_takes_something_again() {
    const SIZE: (u16, u16) = (80, 24);
    for mode in MODES {
        let runs = Runs::new();
        let mut terminal = dashboard(&runs, mode, NO_SETTING, SIZE);
        terminal.wait_for("running");
        // Twenty frames' time, of which none may queue; a minute takes no other path.
        terminal.read(false);
        std::thread::sleep(Duration::from_secs(3));
        let before = terminal.bytes().len();
        terminal.read(true);
        let stale = terminal.settle() - before;
        assert!(
            stale <= 1 + 8 * usize::from(SIZE.0) * usize::from(SIZE.1),
            "{mode:?}: {stale} bytes"
        );
        terminal.press("qy");
        assert_eq!(terminal.wait().code(), Some(0));
        check_given_back(&terminal);
    }
}
