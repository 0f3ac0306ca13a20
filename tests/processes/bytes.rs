//! The dashboard of the real program: how many bytes it sends, and which.

use std::time::{Duration, Instant};

use crate::SCENE;
use crate::terminal::{Runs, Terminal, wait_until};

/// A dashboard of the small scene with more arguments and variables.
fn dashboard(
    runs: &Runs,
    size: (u16, u16),
    arguments: &[&str],
    variables: &[(&str, &str)],
) -> Terminal {
    let all = [&[SCENE, "--in-process", "--until", "1e6"], arguments].concat();
    let mut command = runs.moltop(&all);
    command.envs(variables.iter().copied());
    let terminal = Terminal::start(&mut command, size.0, size.1);
    terminal.wait_for("running");
    terminal
}

/// Bytes that come in a time.
fn bytes_within(terminals: &[&Terminal], time: Duration) -> Vec<usize> {
    let count = |terminal: &&Terminal| terminal.bytes().len();
    let before: Vec<usize> = terminals.iter().map(count).collect();
    std::thread::sleep(time); // what is measured is a rate
    let after = terminals.iter().map(count);
    after
        .zip(before)
        .map(|(after, before)| after - before)
        .collect()
}

/// Waits for the next frame, and until it is whole.
#[track_caller]
fn next_frame(terminal: &Terminal) {
    let before = terminal.bytes().len();
    let came = || terminal.bytes().len() > before;
    wait_until("a frame", came, || terminal.screen());
    terminal.settle();
}

/// With the oxygen's picture on: the first paint and a second afterwards, in a common and in a large window; then frozen.
#[test]
fn a_common_window_takes_two_kilobytes_per_second_and_a_large_one_eight() {
    const SECONDS: u64 = 3;
    let runs = Runs::new();
    let small = Terminal::start(&mut runs.moltop(&[]), 80, 24);
    small.wait_for("running");
    let large = Terminal::start(&mut runs.moltop(&["attach"]), 200, 50);
    large.wait_for("running");
    let terminals = [&small, &large];
    let painted = terminals.map(Terminal::first_paint);
    assert!(painted[0] <= 6_000 && painted[1] <= 20_000, "{painted:?}");
    bytes_within(&terminals, Duration::from_secs(1));
    let sent = bytes_within(&terminals, Duration::from_secs(SECONDS));
    let rates: Vec<u64> = sent.iter().map(|&sent| sent as u64 / SECONDS).collect();
    assert!(
        (50..=2_000).contains(&rates[0]),
        "{rates:?} bytes per second"
    );
    assert!(
        (50..=8_000).contains(&rates[1]),
        "{rates:?} bytes per second"
    );
    for terminal in terminals {
        terminal.press("f");
        terminal.wait_for("frozen");
        terminal.settle();
    }
    assert_eq!(
        bytes_within(&terminals, Duration::from_millis(1_500)),
        [0, 0]
    );
    println!("first paint {painted:?} B, then {rates:?} B/s, frozen 0");
}

#[test]
fn a_named_budget_is_kept_and_a_paused_run_sends_nothing() {
    let runs = Runs::new();
    let wishes = ["--max-bytes-per-s", "300", "--pictures-per-s", "10"];
    let terminal = dashboard(&runs, (80, 24), &wishes, &[]);
    // A frame takes the budget of some seconds, so from frame to frame; the one after the first paint pays for none.
    next_frame(&terminal);
    next_frame(&terminal);
    let (start, before) = (Instant::now(), terminal.bytes().len());
    for _ in 0..4 {
        next_frame(&terminal);
    }
    let sent = (terminal.bytes().len() - before) as f64 / start.elapsed().as_secs_f64();
    println!("{sent:.0} B/s");
    assert!((50.0..=360.0).contains(&sent), "{sent} bytes per second");
    terminal.press(" ");
    terminal.wait_for("paused");
    // The last numbers come as the budget lets them; then nothing does.
    let second = Duration::from_secs(1);
    let silent = || bytes_within(&[&terminal], second) == [0];
    wait_until("silence", silent, || terminal.screen());
    assert_eq!(bytes_within(&[&terminal], 2 * second), [0]);
}

/// Far more pictures than a line carries.
const FLOOD: [&str; 4] = ["--pictures-per-s", "30", "--max-bytes-per-s", "1000000"];

#[test]
fn keys_are_acted_on_at_once_on_a_line_that_is_full() {
    let runs = Runs::new();
    let terminal = dashboard(&runs, (200, 50), &FLOOD, &[]);
    terminal.carry(3_000);
    bytes_within(&[&terminal], Duration::from_secs(2));
    let mut delays: Vec<Duration> = (1..=9)
        .map(|number| {
            let copy = runs.path().join(format!("moltop-screen-{number}.txt"));
            terminal.press("w");
            let pressed = Instant::now();
            wait_until("the copy", || copy.exists(), || terminal.screen());
            pressed.elapsed()
        })
        .collect();
    delays.sort();
    println!("nine keys were acted on after {delays:?}");
    // The median: the machine may be busy with other tests for a while.
    assert!(delays[4] < Duration::from_millis(100), "{delays:?}");
}

#[test]
fn a_slow_line_shows_the_answer_to_a_key_soon() {
    let runs = Runs::new();
    let terminal = dashboard(&runs, (80, 24), &FLOOD, &[]);
    terminal.carry(3_000);
    bytes_within(&[&terminal], Duration::from_secs(2));
    terminal.press(" ");
    let pressed = Instant::now();
    terminal.wait_for("paused");
    println!("the answer was there after {:?}", pressed.elapsed());
    // One frame of a kilobyte or two may be under way.
    assert!(pressed.elapsed() < Duration::from_secs(5));
}

#[test]
fn a_line_that_stands_still_gets_one_screen_afterwards() {
    let runs = Runs::new();
    let terminal = dashboard(&runs, (200, 50), &FLOOD, &[]);
    terminal.read(false);
    std::thread::sleep(Duration::from_secs(3)); // time for many frames, of which none may queue
    let before = terminal.bytes().len();
    terminal.answer(false); // or the next frames would come
    terminal.read(true);
    let late = terminal.settle() - before;
    println!("{late} bytes after the stall");
    assert!(late <= 200 * 50, "{late} bytes");
    terminal.answer(true);
    terminal.press("f");
    terminal.wait_for("frozen");
}

/// Numbers of every select-graphic-rendition sequence.
fn rendition_codes(bytes: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(bytes);
    let sequences = text.split("\x1b[").skip(1).filter_map(|part| {
        let end = part.find(|letter: char| letter.is_ascii_alphabetic())?;
        part[end..].starts_with('m').then(|| part[..end].to_owned())
    });
    let mut codes: Vec<String> = sequences
        .flat_map(|codes| codes.split(';').map(str::to_owned).collect::<Vec<_>>())
        .collect();
    codes.sort();
    codes.dedup();
    codes
}

/// Goes through the panels.
fn tour(arguments: &[&str], variables: &[(&str, &str)]) -> Vec<u8> {
    let runs = Runs::new();
    let terminal = dashboard(&runs, (120, 40), arguments, variables);
    for key in [
        "v", "?", "x", "\x1b[C", "r", "2", "3", "4", "5", "6", "7", "8", "\t", "\x1b", "\t", "f",
        "f", "m", "q", "n", "g", "\x1b", " ",
    ] {
        terminal.press(key);
        terminal.settle();
    }
    terminal.bytes()
}

#[test]
fn sixteen_colours_are_the_classic_ones() {
    let bytes = tour(&[], &[]);
    assert!(!bytes.is_ascii());
    let codes = rendition_codes(&bytes);
    assert!(codes.len() > 4, "{codes:?}");
    for code in codes {
        let classic = match code.parse().unwrap_or(0) {
            0 | 1 | 7 | 39 | 49 => true,
            number => (30..=37).contains(&number) || (90..=97).contains(&number),
        };
        assert!(classic, "{code}");
    }
    let bytes = tour(&["--ascii"], &[("NO_COLOR", "1")]);
    assert!(bytes.is_ascii());
    let none = rendition_codes(&bytes);
    assert!(
        none.iter()
            .all(|code| ["", "0", "1", "7"].contains(&code.as_str())),
        "{none:?}"
    );
}

#[test]
fn seven_bits_are_enough_for_a_terminal_without_utf_8() {
    assert!(tour(&["--theme", "dark"], &[("LC_ALL", "C")]).is_ascii());
}
