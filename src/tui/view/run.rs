//! How the run fares: progress, speed, counts, and the numbers that say whether to trust it. The most wanted come first; a
//! taller panel shows more.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;

use super::text::{framed, put, put_before, title, width, wrap};
use super::trust;
use crate::snapshot::{Phase, Snapshot, Units};
use crate::tui::app::App;
use crate::tui::format::{
    MISSING, bytes, clock, count, percent_off, plain, quantity, relative, scientific, si,
};
use crate::tui::theme;
use crate::tui::view::now;

/// Columns from which on the rows stand in two columns.
const TWO_COLUMNS: u16 = 84;

/// Rows from which on the accuracy card stands in full.
const CARD: u16 = 11;

/// Rows from which on the warnings stand in the panel.
const WARNINGS: u16 = 16;

/// A row of the panel.
struct Row {
    label: &'static str,
    value: String,
    style: Style,
}

/// Draws the panel.
pub(super) fn panel(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let remark = match app.latest.warnings.len() {
        0 => String::new(),
        1 => "1 warning".into(),
        many => format!("{many} warnings"),
    };
    let mut inner = framed(buffer, area, title("4 run", &remark));
    // The warnings have the foot where every row above it is there too.
    if area.height >= WARNINGS {
        inner.height -= warnings(app, inner, buffer);
    }
    progress(app, snapshot, inner, buffer);
    let gap = 3;
    let columns = if inner.width >= TWO_COLUMNS { 2 } else { 1 };
    let room = inner.height.saturating_sub(1);
    let each = (inner.width.saturating_sub(gap * (columns - 1))) / columns;
    for (index, row) in rows(app, snapshot, room >= CARD).iter().enumerate() {
        let index = index as u16;
        if room == 0 || index / room >= columns {
            break;
        }
        let part = Rect {
            x: inner.x + (index / room) * (each + gap),
            width: each,
            ..inner
        };
        let at = 1 + index % room;
        put(buffer, part, (0, at), row.label, theme::QUIET);
        put_before(buffer, part, (each, at), &row.value, row.style);
    }
}

/// Writes the newest warnings at the foot; gives back the rows that they take.
fn warnings(app: &App, area: Rect, buffer: &mut Buffer) -> u16 {
    let lines = app.latest.warnings.iter().flat_map(|warning| {
        let time = clock(warning.wall_time_s);
        wrap(
            &format!("{} {}", time.trim_start(), warning.words),
            area.width,
        )
    });
    let lines: Vec<String> = lines.collect();
    let rows = (lines.len() as u16).min(area.height / 3);
    let first = lines.len() - usize::from(rows);
    for (row, line) in lines[first..].iter().enumerate() {
        let at = area.height - rows + row as u16;
        put(buffer, area, (0, at), line, theme::BAD);
    }
    rows
}

/// A bar, the percentage, and at the end of the run what to do.
fn progress(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let share = snapshot
        .until
        .map(|until| snapshot.time / until)
        .filter(|share| share.is_finite());
    let words = match (&snapshot.phase, share) {
        (Phase::Finished, _) if app.visit.is_some() => "the past, 0 leaves".to_string(),
        (Phase::Finished, _) => "done, q leaves".to_string(),
        (Phase::Failed(_), _) => "failed, q leaves".to_string(),
        (Phase::Starting, _) if app.visit.is_some() => "reading a checkpoint".to_string(),
        (Phase::Starting, _) => "placing molecules".to_string(),
        (_, Some(share)) => format!("{:.2} %", 100.0 * share),
        (_, None) => "no end set".to_string(),
    };
    put_before(buffer, area, (area.width, 0), &words, theme::VALUE);
    let room = area.width.saturating_sub(width(&words).max(8) + 1);
    let Some(share) = share else { return };
    let eighths = (share.clamp(0.0, 1.0) * f64::from(room) * 8.0) as u16;
    for column in 0..room {
        let (glyph, style) = match eighths.saturating_sub(8 * column) {
            0 => ("─", theme::FRAME),
            level @ 1..8 => (
                ["▏", "▎", "▍", "▌", "▋", "▊", "▉"][usize::from(level - 1)],
                theme::BAR,
            ),
            _ => ("█", theme::BAR),
        };
        put(buffer, area, (column, 0), glyph, style);
    }
}

/// The rows, the most wanted first; `card` asks for every figure of the accuracy card.
fn rows(app: &App, snapshot: &Snapshot, card: bool) -> Vec<Row> {
    let units = snapshot.scene.units;
    let counts = &snapshot.counts;
    let speed = snapshot
        .collisions_per_wall_second
        .map_or(MISSING.into(), |rate| si(rate, "", 3));
    let ceiling = app.limit().map_or("none".into(), |limit| {
        format!("{} per s", quantity(Some(limit), "s", units, 3))
    });
    let mut rows = vec![
        plain_row("speed", format!("{speed} collisions per s")),
        plain_row("ceiling", ceiling),
        plain_row("collisions", count(counts.pair_collisions)),
        plain_row("echo", trust::echo(snapshot)),
        Row {
            label: "trust",
            value: trust::words(snapshot),
            style: trust::style(snapshot),
        },
    ];
    rows.extend(if card {
        figures(snapshot)
    } else {
        short_figures(snapshot)
    });
    rows.extend(details(snapshot));
    rows
}

fn plain_row(label: &'static str, value: String) -> Row {
    Row {
        label,
        value,
        style: theme::VALUE,
    }
}

/// What tells most of this engine, in one row.
fn short_figures(snapshot: &Snapshot) -> Vec<Row> {
    let own = own_figure(snapshot);
    let overlap = relative(snapshot.max_overlap);
    let drift = relative(snapshot.energy_drift);
    vec![own.unwrap_or_else(|| plain_row("overlap, ΔE/E", format!("{overlap}, {drift}")))]
}

/// A figure that only this engine has.
fn own_figure(snapshot: &Snapshot) -> Option<Row> {
    match snapshot.engine.as_ref() {
        "step" => Some(plain_row("missed, doubled", missed(snapshot))),
        "reversible" => Some(plain_row(
            "remembered events",
            count(snapshot.counts.remembered_events),
        )),
        _ => None,
    }
}

/// Every figure of the accuracy card with its limit, and what else counts with this engine.
fn figures(snapshot: &Snapshot) -> Vec<Row> {
    let by_design = snapshot.is_approximate();
    let mut rows: Vec<Row> = snapshot
        .accuracy()
        .iter()
        .map(|check| {
            let figure = format!("{}, limit {}", relative(check.value), limit(check.limit));
            if check.sound || by_design {
                plain_row(check.name, figure)
            } else {
                Row {
                    label: check.name,
                    value: format!("LOOK {figure}"),
                    style: theme::BAD,
                }
            }
        })
        .collect();
    rows.extend(own_figure(snapshot));
    rows
}

/// Collisions that fixed steps passed over (as far as they were looked for), and bounces that happened twice.
fn missed(snapshot: &Snapshot) -> String {
    let counts = &snapshot.counts;
    let missed = if counts.audited_steps > 0 {
        count(counts.missed_collisions)
    } else {
        MISSING.into()
    };
    format!("{missed}, {}", count(counts.double_bounces))
}

fn limit(value: f64) -> String {
    if value == 0.0 {
        "0".into()
    } else {
        scientific(value, 1)
    }
}

/// What a large window has room for.
fn details(snapshot: &Snapshot) -> Vec<Row> {
    let units = snapshot.scene.units;
    let counts = &snapshot.counts;
    let off = percent_off(snapshot.wall_rate, snapshot.expected.wall_rate);
    let walls = now::rate(snapshot.wall_rate, units);
    let checkpoint = quantity(snapshot.last_checkpoint, "s", units, 4);
    let details = vec![
        ("last checkpoint", checkpoint),
        ("wall hits", join(&walls, off)),
        (
            "mean free path",
            quantity(snapshot.mean_free_path, "m", units, 4),
        ),
        (
            "virial pressure",
            quantity(snapshot.pressure.virial, "Pa", units, 5),
        ),
        ("Z = p V / N k T", now::factor(snapshot, 6)),
        ("molecules", count(snapshot.scene.ball_count as u64)),
        (
            "packing fraction",
            plain(snapshot.scene.packing_fraction, 4),
        ),
        (
            "collisions per ball",
            now::rate(snapshot.collision_rate, units),
        ),
        ("wall collisions", count(counts.wall_collisions)),
        ("plane collisions", count(counts.plane_collisions)),
        ("stale events", count(counts.stale_events)),
        ("ties", count(counts.ties)),
        ("cell crossings", count(counts.cell_crossings)),
        ("longest queue", count(snapshot.queue_length_max)),
        (
            "kinetic energy",
            quantity(Some(snapshot.kinetic_energy), joule(units), units, 5),
        ),
        ("peak memory", bytes(snapshot.peak_rss_bytes)),
        (
            "setup",
            snapshot
                .setup_time_s
                .map_or(MISSING.into(), |time| format!("{time:.2} s")),
        ),
    ];
    details
        .into_iter()
        .map(|(label, value)| plain_row(label, value))
        .collect()
}

fn joule(units: Units) -> &'static str {
    match units {
        Units::Si => "J",
        Units::Reduced => "",
    }
}

fn join(value: &str, remark: Option<String>) -> String {
    remark.map_or(value.to_string(), |remark| format!("{value} {remark}"))
}
