//! When the screen is drawn: numbers and picture at sober rates, and within a budget of bytes per second.
//!
//! Always holds: over some seconds no more bytes are sent than the budget allows; where it is tight, the picture waits first
//! and the numbers last; and what the user asked for with a key comes before both.

use std::time::{Duration, Instant};

/// Time between two frames with new numbers, at least.
pub const NUMBERS: Duration = Duration::from_secs(1);
/// Time between two frames that keys ask for, at least: a held key must not flood the line.
const KEYS: Duration = Duration::from_millis(40);
/// Budget without a wish of the user's \[bytes per second\].
pub const BUDGET: f64 = 8_000.0;
/// After so long a picture is due even if the numbers then have to wait.
const LONGEST: Duration = Duration::from_secs(120);
/// Share of a new cost in the mean of the recent ones.
const NEWS: f64 = 0.3;
/// How far ahead of the budget the frames that keys ask for may run \[s\].
const CREDIT: f64 = 1.0;

/// What there is to show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct News {
    /// A key or the run's state changed the screen.
    pub response: bool,
    /// There are new numbers.
    pub numbers: bool,
    /// There is a new picture.
    pub picture: bool,
}

/// What of the screen is to be drawn anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Due {
    /// Nothing yet.
    Nothing,
    /// What a key or the run's state changed.
    Response,
    /// The numbers too.
    Numbers,
    /// Numbers and picture.
    Everything,
}

/// The clock of the frames.
#[derive(Clone, Debug)]
pub struct Pace {
    budget: f64,
    /// Time between two pictures, at least.
    picture_rest: Duration,
    /// Bytes saved up, or if negative, sent beyond the budget, as of `settled`.
    saved: f64,
    settled: Instant,
    drawn: Option<Instant>,
    numbers: Option<Instant>,
    picture: Option<Instant>,
    /// Mean bytes of a frame with new numbers, and of one with a picture too.
    cost: [Option<f64>; 2],
}

impl Pace {
    /// A clock for a budget in bytes per second, and so many pictures per second where the budget allows them.
    pub fn new(budget: f64, pictures: f64, now: Instant) -> Self {
        Self {
            budget,
            picture_rest: Duration::from_secs_f64(1.0 / pictures),
            saved: 0.0,
            settled: now,
            drawn: None,
            numbers: None,
            picture: None,
            cost: [None; 2],
        }
    }

    /// What is due of the news.
    pub fn due(&self, news: News, now: Instant) -> Due {
        let saved = self.saved_at(now);
        let rested = |since: Option<Instant>, rest: Duration| {
            since.is_none_or(|since| now.saturating_duration_since(since) >= rest)
        };
        // A picture must be saved up for, so that the numbers after it need not wait.
        let enough =
            saved >= self.price_of_picture() || saved >= 0.0 && rested(self.picture, LONGEST);
        // The answer to a key comes first, and alone: it is short.
        if news.response && saved >= -CREDIT * self.budget && rested(self.drawn, KEYS) {
            Due::Response
        } else if news.picture && enough && rested(self.picture, self.picture_rest) {
            Due::Everything
        } else if news.numbers && saved >= 0.0 && rested(self.numbers, NUMBERS) {
            Due::Numbers
        } else {
            Due::Nothing
        }
    }

    /// Lets what comes next out at once and for nothing: the run's state changed, or the window.
    pub fn hurry(&mut self) {
        self.drawn = None;
        self.numbers = None;
        self.picture = None;
    }

    /// Notes what a frame took.
    pub fn drew(&mut self, due: Due, bytes: usize, now: Instant) {
        // What is painted on an empty screen says nothing of the next frame.
        let first = self.numbers.is_none() || self.picture.is_none();
        self.saved = if first {
            self.saved_at(now).max(0.0)
        } else {
            self.saved_at(now) - bytes as f64
        };
        self.settled = now;
        self.drawn = Some(now);
        if matches!(due, Due::Numbers | Due::Everything) {
            self.numbers = Some(now);
        }
        if due == Due::Everything {
            self.picture = Some(now);
        }
        let index = match due {
            Due::Numbers => 0,
            Due::Everything => 1,
            Due::Nothing | Due::Response => return,
        };
        if !first {
            let cost = self.cost[index].unwrap_or(bytes as f64);
            self.cost[index] = Some(cost + NEWS * (bytes as f64 - cost));
        }
    }

    /// What a picture takes beyond the numbers that would come anyway.
    fn price_of_picture(&self) -> f64 {
        let numbers = self.cost[0].unwrap_or(0.0);
        self.cost[1].map_or(0.0, |picture| (picture - numbers).max(0.0))
    }

    fn saved_at(&self, now: Instant) -> f64 {
        let passed = now.saturating_duration_since(self.settled).as_secs_f64();
        // More than a second's budget, or a picture, is not saved.
        let most = self.budget.max(self.price_of_picture());
        (self.saved + passed * self.budget).min(most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DATA: News = News {
        response: false,
        numbers: true,
        picture: true,
    };
    const KEY: News = News {
        response: true,
        numbers: false,
        picture: false,
    };

    /// Drives a clock for some minutes; returns bytes, frames with numbers and pictures, each per second.
    fn drive(budget: f64, numbers: usize, picture: usize) -> [f64; 3] {
        const SECONDS: u64 = 600;
        let start = Instant::now();
        let mut pace = Pace::new(budget, 1.0, start);
        let mut sums = [0.0; 3];
        for tick in 0..SECONDS * 20 {
            let now = start + Duration::from_millis(50 * tick);
            let due = pace.due(DATA, now);
            let bytes = match due {
                Due::Nothing | Due::Response => continue,
                Due::Numbers => numbers,
                Due::Everything => picture,
            };
            pace.drew(due, bytes, now);
            sums[0] += bytes as f64;
            sums[1] += 1.0;
            sums[2] += f64::from(u8::from(due == Due::Everything));
        }
        sums.map(|sum| sum / SECONDS as f64)
    }

    #[test]
    fn with_room_numbers_and_picture_come_every_second() {
        let [bytes, numbers, pictures] = drive(8_000.0, 300, 1_500);
        assert!((1_400.0..1_600.0).contains(&bytes), "{bytes}");
        assert!(numbers > 0.98 && pictures > 0.98, "{numbers} {pictures}");
    }

    #[test]
    fn a_tight_budget_takes_from_the_picture_first() {
        let [bytes, numbers, pictures] = drive(600.0, 300, 1_500);
        assert!(bytes <= 620.0, "{bytes}");
        assert!(numbers > 0.8, "{numbers}");
        assert!((0.1..0.4).contains(&pictures), "{pictures}");
    }

    #[test]
    fn a_budget_below_the_numbers_slows_them_too() {
        let [bytes, numbers, pictures] = drive(100.0, 300, 1_500);
        assert!(bytes <= 110.0, "{bytes}");
        assert!(numbers > 0.2, "{numbers}");
        assert!(pictures < 0.03, "{pictures}");
    }

    #[test]
    fn keys_are_answered_at_once_but_do_not_flood_the_line() {
        let start = Instant::now();
        let mut pace = Pace::new(1_000.0, 1.0, start);
        pace.drew(Due::Everything, 5_000, start);
        let at = |milliseconds| start + Duration::from_millis(milliseconds);
        assert_eq!(pace.due(KEY, at(10)), Due::Nothing);
        assert_eq!(pace.due(KEY, at(50)), Due::Response);
        let sent: usize = (50..5_000)
            .step_by(10)
            .filter(|time| {
                let due = pace.due(KEY, at(*time));
                if due != Due::Nothing {
                    pace.drew(due, 400, at(*time));
                }
                due != Due::Nothing
            })
            .count()
            * 400;
        assert!(sent <= 6_500, "{sent}");
    }
}
