//! What happens how often: the mix of events, and the queue that holds them.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::chart::{self, Series};
use super::now;
use super::text::{framed, put, put_before, title};
use crate::snapshot::{Observable, Snapshot};
use crate::tui::app::App;
use crate::tui::format::{MISSING, count, percent_off, plain, quantity, si};
use crate::tui::theme;

/// Columns of names, counts and rates.
const NAMES: u16 = 28;
const COUNTS: u16 = 12;
const RATES: u16 = 14;

/// Draws the panel.
pub(super) fn panel(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let inner = framed(
        buffer,
        area,
        title("6 events", "since the start of the run"),
    );
    let mut row = mix(snapshot, inner, buffer);
    row += 1;
    for (label, value) in figures(snapshot) {
        put(buffer, inner, (0, row), label, theme::QUIET);
        put_before(
            buffer,
            inner,
            (NAMES + COUNTS + RATES, row),
            &value,
            theme::VALUE,
        );
        row += 1;
    }
    row += 1;
    let series = Series {
        history: &snapshot.history,
        observable: Observable::QueueLength,
        span: now::span(app, snapshot),
        expected: None,
    };
    let plot = Rect {
        y: inner.y + row.min(inner.height),
        height: inner.height.saturating_sub(row),
        ..inner
    };
    if plot.height >= 3 {
        put(buffer, plot, (0, 0), "events in the queue", theme::QUIET);
        let plot = Rect {
            y: plot.y + 1,
            height: (plot.height - 1).min(14),
            ..plot
        };
        chart::chart(
            &series,
            &app.marks(),
            &|value| si(value, "", 4),
            plot,
            buffer,
        );
    }
}

/// How often each kind of event came; gives back the row below.
fn mix(snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) -> u16 {
    let counts = &snapshot.counts;
    let kinds = [
        ("ball meets ball", counts.pair_collisions),
        ("ball meets wall", counts.wall_collisions),
        ("ball meets plane", counts.plane_collisions),
        ("ball enters a cell", counts.cell_crossings),
        ("outdated when due", counts.stale_events),
        ("at the same instant", counts.ties),
        ("twice at one instant", counts.zero_time_events),
        ("late", counts.late_events),
        ("remembered for the way back", counts.remembered_events),
        ("steps", counts.steps),
        ("missed in a step", counts.missed_collisions),
        ("bounced twice in a step", counts.double_bounces),
    ];
    let all: u64 = kinds[..5].iter().map(|(_, number)| number).sum();
    let per_pair = |number: u64| {
        let share = number as f64 / counts.pair_collisions as f64;
        let known = counts.pair_collisions > 0;
        if known {
            plain(share, 3)
        } else {
            MISSING.into()
        }
    };
    let (numbers, rates) = (NAMES + COUNTS, NAMES + COUNTS + RATES);
    put_before(buffer, area, (numbers, 0), "number", theme::QUIET);
    put_before(buffer, area, (rates, 0), "per collision", theme::QUIET);
    let mut row = 1;
    for (index, (name, number)) in kinds.into_iter().enumerate() {
        if number == 0 && index >= 3 {
            continue;
        }
        put(buffer, area, (0, row), name, theme::QUIET);
        put_before(buffer, area, (numbers, row), &count(number), theme::STRONG);
        put_before(buffer, area, (rates, row), &per_pair(number), theme::VALUE);
        if index < 5 && all > 0 {
            let bar = Rect {
                x: area.x + rates + 2,
                y: area.y + row,
                width: area.width.saturating_sub(rates + 2),
                height: 1,
            };
            share_bar(number as f64 / all as f64, bar.intersection(area), buffer);
        }
        row += 1;
    }
    row
}

/// Rates beside theory, and the queue.
fn figures(snapshot: &Snapshot) -> Vec<(&'static str, String)> {
    let units = snapshot.scene.units;
    let beside = |rate: Option<f64>, expected: Option<f64>| {
        let off = percent_off(rate, expected).map_or(String::new(), |off| format!("  {off}"));
        format!("{}{off}", now::rate(rate, units))
    };
    let expected = snapshot.expected;
    vec![
        ("collisions", beside(snapshot.pair_rate, expected.pair_rate)),
        ("wall hits", beside(snapshot.wall_rate, expected.wall_rate)),
        (
            "collisions per ball",
            now::rate(snapshot.collision_rate, units),
        ),
        (
            "mean free path",
            quantity(snapshot.mean_free_path, "m", units, 4),
        ),
        ("queue now", count(snapshot.queue_length)),
        ("longest queue", count(snapshot.queue_length_max)),
    ]
}

fn share_bar(share: f64, area: Rect, buffer: &mut Buffer) {
    let words = format!("{:.1} %", 100.0 * share);
    let room = area.width.saturating_sub(8);
    let filled = (share.clamp(0.0, 1.0) * f64::from(room)).round() as u16;
    for column in 0..filled {
        put(buffer, area, (column, 0), "█", theme::BAR);
    }
    put(buffer, area, (filled + 1, 0), &words, theme::VALUE);
}
