//! Whether to trust the run, and how far it could be run backwards, in words.

use ratatui::style::Style;

use crate::snapshot::{Echo, Phase, Snapshot, Units};
use crate::tui::format::{MISSING, count, plain, relative, si};
use crate::tui::theme;

/// Distance from the start, in largest diameters, from which on the way back was lost.
const FOUND: f64 = 0.1;

/// How well time can be reversed: before a reversal how long that works, after it how far the way back has come.
pub(super) fn echo(snapshot: &Snapshot) -> String {
    match snapshot.echo {
        _ if snapshot.engine == "statistical" => "none: collisions by chance".into(),
        Some(Echo {
            error: Some(error), ..
        }) if error < FOUND => format!("came back to {} d", relative(Some(error))),
        Some(Echo {
            error: Some(error), ..
        }) => format!("lost, {} d off", plain(error, 2)),
        Some(Echo { retraced, .. }) if retraced >= 1.0 => "back, not compared".into(),
        Some(Echo { retraced, .. }) => format!("{:.0} % of the way back", 100.0 * retraced),
        None => horizon(snapshot),
    }
}

fn horizon(snapshot: &Snapshot) -> String {
    let starts = snapshot.counts.irreversible_starts;
    match snapshot.echo_horizon {
        _ if snapshot.engine == "reversible" && starts > 0 => {
            format!("exact but for {} starts", count(starts))
        }
        _ if snapshot.engine == "reversible" => "exact".into(),
        None => MISSING.into(),
        Some(time) => match snapshot.scene.units {
            Units::Si => format!("lost after {}", si(time, "s", 2)),
            Units::Reduced => format!("lost after time {}", plain(time, 2)),
        },
    }
}

/// What the accuracy card comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    /// There is nothing to judge yet.
    Open,
    /// Engines `step` and `statistical`: their errors are the price of their steps.
    ByDesign(&'static str),
    /// All figures are within their limits.
    Sound,
    /// Some are not: the first of them, and how many more.
    Look(&'static str, usize),
}

fn verdict(snapshot: &Snapshot) -> Verdict {
    let checks = snapshot.accuracy();
    let mut unsound = checks.iter().filter(|check| !check.sound);
    if snapshot.phase == Phase::Starting {
        Verdict::Open
    } else if snapshot.engine == "step" {
        Verdict::ByDesign("step: errors by design")
    } else if snapshot.engine == "statistical" {
        Verdict::ByDesign("approximate by design")
    } else if let Some(first) = unsound.next() {
        Verdict::Look(first.name, unsound.count())
    } else {
        Verdict::Sound
    }
}

/// The verdict: `sound`, or what to look at.
pub(super) fn words(snapshot: &Snapshot) -> String {
    match verdict(snapshot) {
        Verdict::Open => MISSING.into(),
        Verdict::ByDesign(words) => words.into(),
        Verdict::Sound => "sound".into(),
        Verdict::Look(name, 0) => format!("LOOK: {name}"),
        Verdict::Look(name, more) => format!("LOOK: {name}, +{more}"),
    }
}

/// The verdict in one word, for a small window.
pub(super) fn word(snapshot: &Snapshot) -> &'static str {
    match verdict(snapshot) {
        Verdict::Open => MISSING,
        Verdict::ByDesign(_) => "approx.",
        Verdict::Sound => "sound",
        Verdict::Look(..) => "LOOK",
    }
}

/// Colour of the verdict, beside its words.
pub(super) fn style(snapshot: &Snapshot) -> Style {
    match verdict(snapshot) {
        Verdict::Open | Verdict::ByDesign(_) => theme::VALUE,
        Verdict::Sound => theme::GOOD,
        Verdict::Look(..) => theme::BAD,
    }
}
