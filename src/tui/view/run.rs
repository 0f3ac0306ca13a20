//! How the run fares: progress, speed, counts, and the numbers that say whether to trust it. The most wanted come first; a
//! taller panel shows more.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::text::{framed, put, put_before, row, title, width};
use crate::snapshot::{Phase, Snapshot, Units};
use crate::tui::app::App;
use crate::tui::format::{MISSING, bytes, count, percent_off, plain, quantity, relative, si};
use crate::tui::theme;
use crate::tui::view::now;

/// Columns from which on the rows stand in two columns.
const TWO_COLUMNS: u16 = 64;

/// Draws the panel.
pub(super) fn panel(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let inner = framed(buffer, area, title("run", ""));
    progress(snapshot, inner, buffer);
    let gap = 3;
    let columns = if inner.width >= TWO_COLUMNS { 2 } else { 1 };
    let room = inner.height.saturating_sub(1);
    let each = (inner.width.saturating_sub(gap * (columns - 1))) / columns;
    for (index, (label, value)) in rows(app, snapshot).iter().enumerate() {
        let index = index as u16;
        if room == 0 || index / room >= columns {
            break;
        }
        let part = Rect {
            x: inner.x + (index / room) * (each + gap),
            width: each,
            ..inner
        };
        row(buffer, part, 1 + index % room, label, value);
    }
}

/// A bar, the percentage, and at the end of the run what to do.
fn progress(snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let share = snapshot
        .until
        .map(|until| snapshot.time / until)
        .filter(|share| share.is_finite());
    let words = match (&snapshot.phase, share) {
        (Phase::Finished, _) => "done, q leaves".to_string(),
        (Phase::Failed(_), _) => "failed, q leaves".to_string(),
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
            0 => ("─", theme::QUIET),
            level @ 1..8 => (
                ["▏", "▎", "▍", "▌", "▋", "▊", "▉"][usize::from(level - 1)],
                theme::BAR,
            ),
            _ => ("█", theme::BAR),
        };
        put(buffer, area, (column, 0), glyph, style);
    }
}

/// Labels and values, the most wanted first.
fn rows(app: &App, snapshot: &Snapshot) -> Vec<(&'static str, String)> {
    let units = snapshot.scene.units;
    let counts = &snapshot.counts;
    let speed = snapshot
        .collisions_per_wall_second
        .map_or(MISSING.into(), |rate| si(rate, "", 3));
    let ceiling = app.limit().map_or("none".into(), |limit| {
        format!("{} per s", quantity(Some(limit), "s", units, 3))
    });
    let off = percent_off(snapshot.wall_rate, snapshot.expected.wall_rate);
    let walls = now::rate(snapshot.wall_rate, units);
    let per_ball = now::rate(snapshot.collision_rate, units);
    let factor = snapshot
        .compressibility_factor
        .map_or(MISSING.into(), |z| plain(z, 6));
    vec![
        ("speed", format!("{speed} collisions per s")),
        ("ceiling", ceiling),
        ("collisions", count(counts.pair_collisions)),
        ("largest overlap", relative(snapshot.max_overlap)),
        ("energy drift", relative(snapshot.energy_drift)),
        (
            "mean free path",
            quantity(snapshot.mean_free_path, "m", units, 4),
        ),
        ("wall hits", join(&walls, off)),
        ("p V / N k T", factor),
        (
            "virial pressure",
            quantity(snapshot.pressure.virial, "Pa", units, 5),
        ),
        ("momentum drift", relative(snapshot.momentum_drift)),
        ("virial residual", relative(snapshot.virial_residual)),
        ("late events", count(counts.late_events)),
        ("molecules", count(snapshot.scene.ball_count as u64)),
        (
            "packing fraction",
            plain(snapshot.scene.packing_fraction, 4),
        ),
        ("collisions per ball", per_ball),
        ("wall collisions", count(counts.wall_collisions)),
        ("plane collisions", count(counts.plane_collisions)),
        ("stale events", count(counts.stale_events)),
        ("ties", count(counts.ties)),
        ("zero-time events", count(counts.zero_time_events)),
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
                .map_or(MISSING.into(), |time| si(time, "s", 3)),
        ),
    ]
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
