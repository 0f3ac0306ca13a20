//! What a row found: figures, each beside its threshold, in words.

use std::fmt::{Debug, Display};

use serde::{Deserialize, Serialize};

/// What a row comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// Every threshold held.
    Pass,
    /// A threshold did not hold.
    Fail,
    /// Nothing could be measured; the verdict says why.
    NotRun,
}

impl Outcome {
    /// In a word or two.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "FAIL",
            Self::NotRun => "not run",
        }
    }
}

/// A figure and its threshold.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Check {
    /// What was measured.
    pub what: String,
    /// What came out.
    pub found: String,
    /// What had to.
    pub required: String,
    /// Whether it did.
    pub holds: bool,
}

impl Display for Check {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Self {
            what,
            found,
            required,
            holds,
        } = self;
        let mark = if *holds { "" } else { " NOT MET" };
        write!(formatter, "{what}: {found} (must be {required}){mark}")
    }
}

/// What a row found.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Verdict {
    /// Figures with thresholds.
    pub checks: Vec<Check>,
    /// Figures without.
    pub notes: Vec<String>,
    /// Parts that were not run, and why.
    pub not_run: Vec<String>,
}

impl Verdict {
    /// What it comes to.
    pub fn outcome(&self) -> Outcome {
        match self.checks.iter().all(|check| check.holds) {
            false => Outcome::Fail,
            true if self.checks.is_empty() => Outcome::NotRun,
            true => Outcome::Pass,
        }
    }

    /// Everything in it, in words: thresholds first.
    pub fn lines(&self) -> Vec<String> {
        let skipped = self.not_run.iter().map(|why| format!("not run: {why}"));
        let checks = self.checks.iter().map(ToString::to_string);
        checks
            .chain(self.notes.iter().cloned())
            .chain(skipped)
            .collect()
    }

    fn check(&mut self, what: impl Display, found: String, required: String, holds: bool) {
        self.checks.push(Check {
            what: what.to_string(),
            found,
            required,
            holds,
        });
    }

    /// A figure with an upper bound. NaN is above every bound.
    pub fn at_most(&mut self, what: impl Display, found: f64, bound: f64) {
        let holds = found <= bound;
        self.check(
            what,
            number(found),
            format!("at most {}", number(bound)),
            holds,
        );
    }

    /// A figure with a lower bound.
    pub fn at_least(&mut self, what: impl Display, found: f64, bound: f64) {
        let holds = found >= bound;
        self.check(
            what,
            number(found),
            format!("at least {}", number(bound)),
            holds,
        );
    }

    /// A figure in a band around what is expected.
    pub fn near(&mut self, what: impl Display, found: f64, expected: f64, band: f64) {
        let required = format!("{} ± {}", number(expected), number(band));
        self.check(
            what,
            number(found),
            required,
            (found - expected).abs() <= band,
        );
    }

    /// Two things that must be equal.
    pub fn equal<T: PartialEq + Debug>(&mut self, what: impl Display, found: &T, expected: &T) {
        let holds = found == expected;
        self.check(what, format!("{found:?}"), format!("{expected:?}"), holds);
    }

    /// Something that must hold, with the words for what was found.
    pub fn holds(&mut self, what: impl Display, holds: bool, required: &str) {
        let found = if holds { "yes" } else { "no" };
        self.check(what, found.to_owned(), required.to_owned(), holds);
    }

    /// A figure without a threshold.
    pub fn note(&mut self, note: impl Display) {
        self.notes.push(note.to_string());
    }

    /// A part that was not run.
    pub fn not_run(&mut self, why: impl Display) {
        self.not_run.push(why.to_string());
    }
}

impl Display for Verdict {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        formatter.write_str(&self.lines().join("; "))
    }
}

/// Four digits, with an exponent where they would not show.
pub fn number(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e7 {
        return format!("{value}");
    }
    crate::quantity::plain(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_threshold_that_does_not_hold_fails_the_row_and_no_threshold_is_no_verdict() {
        let mut verdict = Verdict::default();
        assert_eq!(verdict.outcome(), Outcome::NotRun);
        verdict.at_most("overlap", 1e-16, 1e-15);
        assert_eq!(verdict.outcome(), Outcome::Pass);
        verdict.at_most("energy", f64::NAN, 1.0);
        assert_eq!(verdict.outcome(), Outcome::Fail);
        assert_eq!(
            verdict.checks[0].to_string(),
            "overlap: 1.000e-16 (must be at most 1.000e-15)"
        );
    }
}
