//! The past beside the run: which time the user wants to see, and whether it has been made again.

use ratatui::crossterm::event::KeyCode;

use crate::snapshot::{Phase, Snapshot, Units};
use crate::tui::format::quantity;

/// Snapshots after which a run that has nothing to show of the past has refused.
const PATIENCE: u64 = 5;

/// A past time that was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visit {
    /// Simulated time.
    pub time: f64,
    asked: u64,
}

impl Visit {
    /// A visit that was asked for when the run was at a snapshot.
    pub fn to(time: f64, sequence: u64) -> Self {
        Self {
            time,
            asked: sequence,
        }
    }

    /// Why there is nothing to see, if that is so.
    pub fn failure(&self, run: &Snapshot) -> Option<String> {
        match &run.past {
            Some(past) => match &past.phase {
                Phase::Failed(why) => Some(why.clone()),
                _ => None,
            },
            None if run.sequence > self.asked + PATIENCE => {
                let notice = run.notice.as_deref().unwrap_or("the run does not answer");
                Some(notice.trim_start_matches("no way back: ").to_owned())
            }
            None => None,
        }
    }
}

/// The question for a past time.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Prompt {
    /// What has been typed.
    pub typed: String,
    /// What is wrong with it.
    pub fault: Option<String>,
}

/// Longest answer.
const LONGEST: usize = 24;

impl Prompt {
    /// Obeys a key. `Some(None)` gives up, `Some(Some(time))` goes to a time.
    pub fn press(&mut self, code: KeyCode, run: &Snapshot) -> Option<Option<f64>> {
        self.fault = None;
        match code {
            KeyCode::Char(letter) if self.typed.len() < LONGEST => self.typed.push(letter),
            KeyCode::Backspace => drop(self.typed.pop()),
            KeyCode::Esc => return Some(None),
            KeyCode::Enter if self.typed.trim().is_empty() => return Some(None),
            KeyCode::Enter => match time(&self.typed, run) {
                Ok(time) => return Some(Some(time)),
                Err(fault) => self.fault = Some(fault),
            },
            _ => {}
        }
        None
    }
}

/// A simulated time as people write it: in the scene's units, with an SI prefix, or as a share of the run so far.
fn time(text: &str, run: &Snapshot) -> Result<f64, String> {
    let text = text.trim();
    let letters =
        |letter: char| letter.is_alphabetic() && !matches!(letter, 'e' | 'E') || letter == '%';
    let (number, unit) = text.split_at(text.find(letters).unwrap_or(text.len()));
    let si = run.scene.units == Units::Si;
    let factor = match unit.trim() {
        "" => 1.0,
        "%" => run.time / 100.0,
        "s" if si => 1.0,
        "ms" if si => 1e-3,
        "us" | "µs" if si => 1e-6,
        "ns" if si => 1e-9,
        "ps" if si => 1e-12,
        "fs" if si => 1e-15,
        other => return Err(format!("{other}: no unit of time here")),
    };
    let number: f64 = (number.trim().parse()).map_err(|_| format!("{text}: no time"))?;
    let time = number * factor;
    if (0.0..=run.time).contains(&time) {
        return Ok(time);
    }
    let now = quantity(Some(run.time), "s", run.scene.units, 4);
    Err(format!("the run has been at 0 to {now} only"))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::snapshot::SceneCard;

    fn run(units: Units) -> Snapshot {
        let scene = SceneCard {
            units,
            ..SceneCard::default()
        };
        Snapshot {
            time: 2e-8,
            ..Snapshot::starting(Arc::new(scene), "event", None)
        }
    }

    #[track_caller]
    fn check(text: &str, expected: Option<f64>) {
        assert_eq!(time(text, &run(Units::Si)).ok(), expected, "{text}");
    }

    #[test]
    fn times_are_read_as_people_write_them() {
        check("12.5 ns", Some(12.5 * 1e-9));
        check("12.5ns", Some(12.5 * 1e-9));
        check("1e-8", Some(1e-8));
        check("50%", Some(1e-8));
        check("0", Some(0.0));
        for wrong in ["", "banana", "3 m", "1", "-1 ns", "30 ns", "nan", "inf"] {
            check(wrong, None);
        }
        assert!(time("1e-9 ns", &run(Units::Reduced)).is_err());
    }

    #[test]
    fn a_prompt_takes_letters_and_says_what_is_wrong() {
        let run = run(Units::Si);
        let mut prompt = Prompt::default();
        for letter in "3 µs".chars() {
            assert_eq!(prompt.press(KeyCode::Char(letter), &run), None);
        }
        assert_eq!(prompt.press(KeyCode::Enter, &run), None);
        assert_eq!(
            prompt.fault.as_deref(),
            Some("the run has been at 0 to 20.00 ns only")
        );
        prompt.press(KeyCode::Backspace, &run);
        prompt.press(KeyCode::Backspace, &run);
        for letter in "ns".chars() {
            prompt.press(KeyCode::Char(letter), &run);
        }
        assert_eq!(prompt.press(KeyCode::Enter, &run), Some(Some(3.0 * 1e-9)));
        assert_eq!(prompt.press(KeyCode::Esc, &run), Some(None));
    }

    #[test]
    fn a_run_that_shows_no_past_has_refused() {
        let mut run = run(Units::Si);
        let visit = Visit::to(1e-9, 0);
        assert_eq!(visit.failure(&run), None);
        run.sequence = 10;
        run.notice = Some("no way back: the run has no directory for checkpoints".into());
        assert_eq!(
            visit.failure(&run).as_deref(),
            Some("the run has no directory for checkpoints")
        );
    }
}
