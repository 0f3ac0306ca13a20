//! The dashboard of the real program in a pseudo-terminal: how many bytes it sends, and which.

mod pseudo_terminal;

use std::time::{Duration, Instant};

use pseudo_terminal::Terminal;

const SMALL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/seed-512.toml");

/// Bytes of the first paint and per second afterwards, with the oxygen's picture on; then of a frozen screen.
#[track_caller]
fn check_budget(size: (u16, u16), first: usize, per_second: f64) {
    const SECONDS: u64 = 4;
    let mut terminal = Terminal::start(size, &["--in-process"], &[]);
    terminal.wait_for("running");
    let painted = terminal.bytes.len();
    assert!(painted <= first, "{painted} bytes of first paint");
    terminal.read_for(Duration::from_secs(1));
    let sent = terminal.read_for(Duration::from_secs(SECONDS)) as f64 / SECONDS as f64;
    assert!(sent > 50.0 && sent <= per_second, "{sent} bytes per second");
    terminal.press("f");
    terminal.wait_for("frozen");
    assert_eq!(terminal.read_for(Duration::from_millis(1_500)), 0);
    println!("{size:?}: first paint {painted} B, then {sent:.0} B/s, frozen 0");
}

#[test]
fn a_common_window_takes_two_kilobytes_per_second() {
    check_budget((80, 24), 6_000, 2_000.0);
}

#[test]
fn a_large_window_takes_eight_kilobytes_per_second() {
    check_budget((200, 50), 20_000, 8_000.0);
}

const ENDLESS: [&str; 4] = [SMALL, "--in-process", "--until", "1e6"];

#[test]
fn a_named_budget_is_kept_and_a_paused_run_sends_nothing() {
    let wishes = ["--max-bytes-per-s", "300", "--pictures-per-s", "10"];
    let mut terminal = Terminal::start((80, 24), &[&ENDLESS, &wishes[..]].concat(), &[]);
    terminal.wait_for("running");
    terminal.read_for(Duration::from_secs(2));
    let sent = terminal.read_for(Duration::from_secs(4)) / 4;
    assert!((50..=450).contains(&sent), "{sent} bytes per second");
    terminal.press(" ");
    terminal.wait_for("paused");
    terminal.read_for(Duration::from_secs(2)); // the last numbers
    assert_eq!(terminal.read_for(Duration::from_secs(1)), 0);
}

/// Far more pictures than a line carries.
const FLOOD: [&str; 4] = ["--pictures-per-s", "30", "--max-bytes-per-s", "1000000"];

#[test]
fn keys_are_acted_on_at_once_on_a_line_that_is_full() {
    let mut terminal = Terminal::start((200, 50), &[&ENDLESS, &FLOOD[..]].concat(), &[]);
    terminal.wait_for("running");
    terminal.line = Some(3_000);
    terminal.read_for(Duration::from_secs(2));
    let copy = terminal.home.path().join("moltop-screen-1.txt");
    terminal.press("w");
    let pressed = Instant::now();
    while !copy.exists() {
        assert!(pressed.elapsed() < Duration::from_secs(2), "no copy");
        terminal.read_for(Duration::from_millis(5));
    }
    println!("the key was acted on after {:?}", pressed.elapsed());
}

#[test]
fn a_slow_line_shows_the_answer_to_a_key_soon() {
    let mut terminal = Terminal::start((80, 24), &[&ENDLESS, &FLOOD[..]].concat(), &[]);
    terminal.answers = true;
    terminal.wait_for("running");
    terminal.line = Some(3_000);
    terminal.read_for(Duration::from_secs(3));
    terminal.press(" ");
    let pressed = Instant::now();
    terminal.wait_for("paused");
    println!("the answer was there after {:?}", pressed.elapsed());
    // One frame of a kilobyte or two may be under way.
    assert!(pressed.elapsed() < Duration::from_secs(5));
}

#[test]
fn a_line_that_stands_still_gets_one_screen_afterwards() {
    let mut terminal = Terminal::start((200, 50), &[&ENDLESS, &FLOOD[..]].concat(), &[]);
    terminal.answers = true;
    terminal.wait_for("running");
    terminal.read_for(Duration::from_secs(1));
    std::thread::sleep(Duration::from_secs(4)); // nobody reads
    let late = terminal.read_for(Duration::from_millis(1));
    println!("{late} bytes after the stall");
    assert!(late <= 200 * 50, "{late} bytes");
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
    let mut terminal = Terminal::start((120, 40), &[&ENDLESS, arguments].concat(), variables);
    terminal.wait_for("running");
    for key in [
        "v", "?", "x", "\x1b[C", "r", "2", "3", "4", "5", "6", "7", "8", "\t", "\x1b", "\t", "f",
        "f", "m", "q", "n", " ",
    ] {
        terminal.press(key);
        terminal.read_for(Duration::from_millis(120));
    }
    std::mem::take(&mut terminal.bytes)
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
fn a_dumb_terminal_gets_plain_lines() {
    let arguments = [
        SMALL,
        "--in-process",
        "--until",
        "3",
        "--plain-every",
        "0.1",
    ];
    let mut terminal = Terminal::start((80, 24), &arguments, &[("TERM", "dumb")]);
    assert!(terminal.wait_for_end().success());
    let words = String::from_utf8_lossy(&terminal.bytes).into_owned();
    assert!(
        !words.contains('\x1b') && words.contains("trust sound"),
        "{words}"
    );
}

#[test]
fn seven_bits_are_enough_for_a_terminal_without_utf_8() {
    assert!(tour(&["--theme", "dark"], &[("LANG", "C")]).is_ascii());
}
