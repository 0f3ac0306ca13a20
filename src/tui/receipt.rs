//! What the terminal has taken in, as far as it says so: each frame ends with a question that terminals answer.
//!
//! Buffers on the way (the kernel's, those of ssh and of the network) hold many frames, so that a line which stands still or
//! crawls would show the past for a long time. With a receipt for each frame at most one is under way. A terminal that
//! answers nothing is asked a few times and then left alone.

use std::time::{Duration, Instant};

/// Where is the cursor? A terminal answers when it comes to the question. Source: ECMA-48, device status report.
pub const QUESTION: &[u8] = b"\x1b[6n";

/// Questions after which a terminal that has not answered any counts as silent.
const ENOUGH: u32 = 5;
/// First wait for an answer that does not come; each further one is twice as long.
const FIRST_WAIT: Duration = Duration::from_secs(15);
/// Longest that a key's answer waits for the receipt of the frame before.
const KEY_WAIT: Duration = Duration::from_secs(1);

/// The receipts of one terminal.
#[derive(Clone, Debug, Default)]
pub struct Receipts {
    /// When the last question went out, until it is answered.
    asked: Option<Instant>,
    /// Questions in a row that nobody answered.
    missed: u32,
    /// Time from the last answered question to its answer.
    pub round_trip: Option<Duration>,
}

impl Receipts {
    /// Whether to ask with the next frame.
    pub fn are_wanted(&self) -> bool {
        self.round_trip.is_some() || self.missed < ENOUGH
    }

    /// Notes that a question goes out.
    pub fn ask(&mut self, now: Instant) {
        self.missed += u32::from(self.asked.is_some());
        self.asked = Some(now);
    }

    /// Notes an answer.
    pub fn answer(&mut self, now: Instant) {
        if let Some(asked) = self.asked.take() {
            self.round_trip = Some(now.saturating_duration_since(asked));
            self.missed = 0;
        }
    }

    /// Whether an answer is on its way, or will never come.
    pub fn is_awaited(&self) -> bool {
        self.asked.is_some()
    }

    /// Whether the next frame may go out; `response` says that a key waits for it, which shows that the line is alive.
    pub fn allow(&self, response: bool, now: Instant) -> bool {
        let (Some(asked), Some(_)) = (self.asked, self.round_trip) else {
            return true; // answered, or nothing is known of this terminal
        };
        let waited = now.saturating_duration_since(asked);
        let wait = FIRST_WAIT * 2_u32.pow(self.missed.min(5));
        waited >= wait || response && waited >= KEY_WAIT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: u64) -> Instant {
        static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
        *START.get_or_init(Instant::now) + Duration::from_secs(seconds)
    }

    #[test]
    fn a_terminal_that_answers_gets_one_frame_at_a_time() {
        let mut receipts = Receipts::default();
        receipts.ask(at(0));
        assert!(receipts.allow(false, at(0))); // not known to answer yet
        receipts.answer(at(1));
        receipts.ask(at(2));
        assert!(!receipts.allow(false, at(3)));
        assert!(receipts.allow(true, at(3)));
        receipts.answer(at(3));
        assert!(receipts.allow(false, at(3)));
    }

    #[test]
    fn a_line_that_stands_still_for_a_minute_gets_three_frames() {
        let mut receipts = Receipts::default();
        receipts.ask(at(0));
        receipts.answer(at(0));
        let mut frames = 0;
        for second in 1..60 {
            if receipts.allow(false, at(second)) {
                receipts.ask(at(second));
                frames += 1;
            }
        }
        assert_eq!(frames, 3);
    }

    #[test]
    fn a_silent_terminal_is_left_alone() {
        let mut receipts = Receipts::default();
        for second in 0..9 {
            assert!(receipts.allow(false, at(second)));
            if receipts.are_wanted() {
                receipts.ask(at(second));
            }
        }
        assert!(!receipts.are_wanted() && receipts.allow(false, at(10)));
    }
}
