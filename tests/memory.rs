//! What a watched run sends and keeps takes no more memory after a day than after an hour.

#[allow(dead_code, reason = "the screens need more of it")]
mod fake;

use std::sync::Arc;

use moltop::feed::message::{self, Frame};
use moltop::snapshot::{Observable, Snapshot, Stretch};

use fake::{oxygen, running};

/// Resident memory of this process [bytes].
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("this is Linux");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let words = line.expect("a line").trim().trim_end_matches(" kB");
    1024 * words.parse::<u64>().expect("a number")
}

/// Snapshots of a second, and of those that lengthen the history.
const PER_SECOND: u32 = 10;
const PER_STRETCH: u32 = 5;

/// Sends so many seconds of a run to a watcher, and says how much memory both ends have come to take meanwhile.
fn growth(seconds: u32, from: &mut (Snapshot, Snapshot)) -> i64 {
    let before = resident();
    let (sent, received) = from;
    for number in 0..seconds * PER_SECOND {
        let mut next = sent.clone();
        next.sequence += 1;
        next.time += 1e-11;
        if number.is_multiple_of(PER_STRETCH) {
            let end = next.history.bounds().map_or(0.0, |(_, end)| end);
            let stretch = Stretch::new(end, next.time, 0.0)
                .with(Observable::PressureWall, Some(next.time))
                .with(Observable::Temperature, Some(273.0));
            Arc::make_mut(&mut next.history).push(stretch);
        }
        let bytes = message::encode(&Frame::between(Some(sent), &next));
        let frame: Frame = message::read(&mut bytes.as_slice()).expect("a good message");
        *received = frame.after(Some(received));
        *sent = next;
    }
    assert_eq!(received.history, sent.history);
    resident().cast_signed() - before.cast_signed()
}

#[test]
fn a_day_takes_no_more_memory_than_an_hour() {
    // MOLTOP_DAY=1 cargo test --test memory -- --nocapture: two days, which take minutes. On the first one the levels of the
    // history fill, three megabytes for both ends.
    let day = std::env::var_os("MOLTOP_DAY").is_some();
    let seconds = if day { 86_400 } else { 2_000 };
    let first = running(oxygen(), 0);
    let mut ends = (first.clone(), first);
    let warm = growth(seconds, &mut ends);
    let grown = growth(seconds, &mut ends);
    let per_day = grown as f64 * 86_400.0 / f64::from(seconds);
    println!(
        "first {warm} bytes, then {grown} in {seconds} s of a run: {per_day:.0} bytes per day"
    );
    // A new level of the history may begin, a quarter of a megabyte at the most.
    assert!(grown < 1 << 20, "{grown} bytes");
}
