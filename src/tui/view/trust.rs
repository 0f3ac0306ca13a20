//! Whether to trust the run, and how far it could be run backwards, in words.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;

use super::text::{framed, put, put_before, title, wrap};

use crate::snapshot::{Echo, Phase, Snapshot, Units};
use crate::tui::format::{MISSING, count, plain, quantity, relative, scientific, si};
use crate::tui::theme;

/// Columns of names and of figures.
const NAMES: u16 = 22;
const FIGURES: u16 = 26;

/// What each figure of the card means, in the order of the card.
const MEANINGS: [&str; 6] = [
    "how deep two balls were in each other at a collision, in contact distances",
    "change of the kinetic energy since the start, relative",
    "change of the momentum that the walls do not explain, relative",
    "how far the pressures by walls and by collisions are from one ledger",
    "collisions that came out of their order",
    "share of collisions at the instant of the same ball's collision before",
];

/// Draws the accuracy card with what its figures mean.
pub(super) fn panel(snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let inner = framed(buffer, area, title("7 trust", &words(snapshot)));
    let mut row = 0;
    for (check, meaning) in snapshot.accuracy().iter().zip(MEANINGS) {
        put(buffer, inner, (0, row), check.name, theme::VALUE);
        let limit = if check.limit == 0.0 {
            "0".into()
        } else {
            scientific(check.limit, 1)
        };
        let figure = format!("{}, limit {limit}", relative(check.value));
        put_before(
            buffer,
            inner,
            (NAMES + FIGURES, row),
            &figure,
            theme::STRONG,
        );
        let (word, style) = match (check.value, check.sound) {
            (None, _) => (MISSING, theme::QUIET),
            (_, true) => ("sound", theme::GOOD),
            (_, false) if snapshot.engine == "step" => ("by design", theme::VALUE),
            (_, false) => ("LOOK", theme::BAD),
        };
        put(buffer, inner, (NAMES + FIGURES + 2, row), word, style);
        row += 1;
        if inner.height >= 20 {
            put(buffer, inner, (2, row), meaning, theme::QUIET);
            row += 1;
        }
    }
    row += 1;
    let pressure = snapshot.pressure;
    let units = snapshot.scene.units;
    let rows = [
        ("pressure by walls", quantity(pressure.wall, "Pa", units, 6)),
        (
            "pressure by collisions",
            quantity(pressure.virial, "Pa", units, 6),
        ),
        (
            "standard error",
            quantity(pressure.standard_error, "Pa", units, 2),
        ),
        (
            "theory",
            quantity(snapshot.expected.pressure, "Pa", units, 6),
        ),
        ("echo", echo(snapshot)),
    ];
    for (label, value) in rows {
        put(buffer, inner, (0, row), label, theme::QUIET);
        put_before(buffer, inner, (NAMES + FIGURES, row), &value, theme::VALUE);
        row += 1;
    }
    let words = "echo: for how long a reversal of time would find back to where the balls were, before rounding is louder than they are";
    for line in wrap(words, inner.width) {
        put(buffer, inner, (0, row), &line, theme::QUIET);
        row += 1;
    }
}

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
