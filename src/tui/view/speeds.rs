//! The speed histogram, Maxwell's curve over it, and the verdict.

use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};

use super::chart::BARS;
use super::text::{framed, put, put_before, title, width};
use crate::snapshot::{Snapshot, Speeds, Units};
use crate::tui::app::{App, Panel};
use crate::tui::format::{MISSING, plain, quantity};
use crate::tui::theme;

/// Share of the balls that the speed axis may leave out on the right.
const TAIL: f64 = 0.001;

/// Rows of the histogram of a component, at least.
const COMPONENT: u16 = 6;

/// Percentiles that are told, by the share of the balls that are slower.
const PERCENTILES: [(&str, f64); 7] = [
    ("1 %", 0.01),
    ("10 %", 0.1),
    ("50 %", 0.5),
    ("90 %", 0.9),
    ("99 %", 0.99),
    ("99.9 %", 0.999),
    ("99.99 %", 0.9999),
];

/// Draws the panel; one that fills the window has the percentiles and the components of the velocity too.
pub(super) fn panel(app: &App, snapshot: &Snapshot, area: Rect, buffer: &mut Buffer) {
    let units = snapshot.scene.units;
    let Some(speeds) = &snapshot.speeds else {
        framed(buffer, area, title("3 speeds", MISSING));
        return;
    };
    let temperature = quantity(snapshot.temperature, "K", units, 5);
    let verdict = verdict(speeds);
    let long = format!("Maxwell o at {temperature} · {verdict}");
    let remark = if width(&long) + 16 <= area.width {
        long
    } else {
        verdict
    };
    let inner = framed(buffer, area, title("3 speeds", &remark));
    let bins = [speeds.bin_width, speeds.component_bin_width];
    if inner.height < 2 || inner.width < 8 || bins.iter().any(|bin| !bin.is_normal()) {
        return;
    }
    let with_components = app.enlarged == Some(Panel::Speeds) && inner.height >= 3 * COMPONENT;
    let low = if with_components { inner.height / 2 } else { 0 };
    let table = if with_components { 4 } else { 0 };
    let parts = [
        Constraint::Fill(1),
        Constraint::Length(table),
        Constraint::Length(low),
    ];
    let [high, table, low] = Layout::vertical(parts).areas(inner);
    let plot = Rect {
        height: high.height - 1,
        ..high
    };
    let fastest = fastest(speeds);
    let columns = usize::from(plot.width);
    let measured: Vec<f64> = speeds.counts.iter().map(|count| *count as f64).collect();
    let measured = calmed(&measured, &speeds.maxwell);
    let measured = rebin(&measured, speeds.bin_width, fastest, columns);
    let maxwell = rebin(&speeds.maxwell, speeds.bin_width, fastest, columns);
    histogram(&measured, &maxwell, plot, buffer);
    let axis = Rect {
        y: plot.bottom(),
        height: 1,
        ..high
    };
    speed_axis((0.0, fastest), units, axis, buffer);
    if with_components {
        percentiles(speeds, units, table, buffer);
        components(speeds, units, low, buffer);
    }
}

/// Bars of what was measured, and over them the curve that theory expects.
fn histogram(measured: &[f64], expected: &[f64], plot: Rect, buffer: &mut Buffer) {
    let highest = measured.iter().chain(expected).copied().fold(0.0, f64::max) * 1.04;
    if !(highest > 0.0) || !highest.is_finite() {
        return;
    }
    for (column, value) in measured.iter().enumerate() {
        draw_bar(plot, column as u16, value / highest, buffer);
    }
    for (column, value) in expected.iter().enumerate() {
        let height = value / highest * f64::from(plot.height);
        if height < 0.1 {
            continue; // on the axis a curve is but clutter
        }
        let row = (height.max(0.0) as u16).min(plot.height - 1);
        let at = (column as u16, plot.height - 1 - row);
        put(buffer, plot, at, "o", theme::THEORY);
    }
}

/// The speeds that shares of the balls stay below, measured and expected, as many as fit.
fn percentiles(speeds: &Speeds, units: Units, area: Rect, buffer: &mut Buffer) {
    let counts: Vec<f64> = speeds.counts.iter().map(|count| *count as f64).collect();
    let balls: f64 = counts.iter().sum();
    let names = ["slower than", "measured", "Maxwell"];
    let mut column = 0;
    for (row, name) in (0..).zip(names) {
        column = put(buffer, area, (0, row), name, theme::QUIET).max(column);
    }
    for (name, share) in PERCENTILES {
        // Of what only a few balls exceed, a run tells nothing.
        if (1.0 - share).min(share) * balls < FEW {
            continue;
        }
        let at = |bins: &[f64]| {
            let speed = percentile(bins, share).map(|bins| bins * speeds.bin_width);
            quantity(speed, "m/s", units, 4)
        };
        let texts = [name.to_owned(), at(&counts), at(&speeds.maxwell)];
        let widest = texts.iter().map(|text| width(text)).max().unwrap_or(0);
        let end = column + 2 + widest;
        if end > area.width {
            return;
        }
        for (row, text) in (0..).zip(&texts) {
            put_before(buffer, area, (end, row), text, theme::VALUE);
        }
        column = end;
    }
}

/// Balls that a percentile must leave on its thinner side.
const FEW: f64 = 10.0;

/// Where a share of a histogram lies below, in bins; within a bin evenly. `None` where that is not known: in the last bin,
/// which has no upper end, and in an empty histogram.
fn percentile(bins: &[f64], share: f64) -> Option<f64> {
    let wanted = share * bins.iter().sum::<f64>();
    let (_, inner) = bins.split_last()?;
    let mut below = 0.0;
    for (bin, count) in inner.iter().enumerate() {
        if below + count >= wanted && *count > 0.0 {
            return Some(bin as f64 + (wanted - below) / count);
        }
        below += count;
    }
    None
}

/// The three components of the velocity side by side, each with the normal distribution.
fn components(speeds: &Speeds, units: Units, area: Rect, buffer: &mut Buffer) {
    let parts: [Rect; 3] = Layout::horizontal([Constraint::Fill(1); 3])
        .spacing(2)
        .areas(area);
    let half = speeds.normal.len() as f64 / 2.0 * speeds.component_bin_width;
    for (index, part) in parts.into_iter().enumerate() {
        let counts: Vec<f64> = speeds.components[index]
            .iter()
            .map(|count| *count as f64)
            .collect();
        let counts = calmed(&counts, &speeds.normal);
        let columns = usize::from(part.width);
        let shares = |bins: &[f64]| rebin(bins, speeds.component_bin_width, 2.0 * half, columns);
        let name = ["x", "y", "z"][index];
        let along = format!("along {name}");
        let free = put(buffer, part, (0, 0), &along, theme::STRONG) + 1;
        let (ks, critical) = (speeds.component_ks[index], speeds.ks_critical);
        if let Some(words) = [" of critical", ""]
            .map(|unit| agreement(ks, critical, unit))
            .iter()
            .find(|words| free + width(words) <= part.width)
        {
            put_before(buffer, part, (part.width, 0), words, theme::VALUE);
        }
        let plot = Rect {
            y: part.y + 1,
            height: part.height.saturating_sub(2),
            ..part
        };
        if plot.height > 0 {
            histogram(&shares(&counts), &shares(&speeds.normal), plot, buffer);
        }
        let axis = Rect {
            y: plot.bottom(),
            height: 1,
            ..part
        };
        speed_axis((-half, half), units, axis.intersection(part), buffer);
    }
}

/// Whether the speeds are Maxwell's, in words.
pub(super) fn verdict(speeds: &Speeds) -> String {
    agreement(speeds.ks, speeds.ks_critical, " of critical")
}

fn agreement(ks: f64, critical: f64, unit: &str) -> String {
    let ratio = ks / critical;
    if !ratio.is_finite() {
        return MISSING.into();
    }
    let agrees = if ratio <= 1.0 { "agrees" } else { "differs" };
    format!("KS {:.2}{unit}: {agrees}", ratio.min(9_999.0))
}

/// Right end of the speed axis: nearly all balls, measured and expected, are slower.
fn fastest(speeds: &Speeds) -> f64 {
    let counts: Vec<f64> = speeds.counts.iter().map(|count| *count as f64).collect();
    let bins = bins_below(&counts).max(bins_below(&speeds.maxwell)).max(1);
    bins as f64 * speeds.bin_width
}

fn bins_below(bins: &[f64]) -> usize {
    let total: f64 = bins.iter().sum();
    let mut sum = 0.0;
    bins.iter()
        .position(|bin| {
            sum += bin;
            sum >= (1.0 - TAIL) * total
        })
        .map_or(bins.len(), |place| place + 1)
}

/// Balls that the fullest bar should stand for.
const ENOUGH: f64 = 40.0;

/// Evens bins out in groups when the gas has too few balls for narrow ones.
fn calmed(bins: &[f64], maxwell: &[f64]) -> Vec<f64> {
    let fullest = maxwell.iter().copied().fold(1.0, f64::max);
    let group = ((ENOUGH / fullest).ceil() as usize).clamp(1, bins.len().max(10) / 10);
    bins.chunks(group)
        .flat_map(|bins| {
            let mean = bins.iter().sum::<f64>() / bins.len() as f64;
            vec![mean; bins.len()]
        })
        .collect()
}

/// Shares bins out to columns in proportion to the overlap.
fn rebin(bins: &[f64], bin_width: f64, fastest: f64, columns: usize) -> Vec<f64> {
    let step = fastest / columns as f64 / bin_width;
    let share = |bin: usize, from: f64, to: f64| {
        let overlap = to.min(bin as f64 + 1.0) - from.max(bin as f64);
        bins.get(bin).copied().unwrap_or(0.0) * overlap.max(0.0)
    };
    (0..columns)
        .map(|column| {
            let (from, to) = (column as f64 * step, (column + 1) as f64 * step);
            (from as usize..=to as usize)
                .map(|bin| share(bin, from, to))
                .sum()
        })
        .collect()
}

fn draw_bar(plot: Rect, column: u16, height: f64, buffer: &mut Buffer) {
    let eighths = (height * f64::from(plot.height) * 8.0).round().max(0.0) as u16;
    for row in 0..plot.height {
        let level = eighths.saturating_sub(8 * row).min(8);
        if level > 0 {
            let at = (column, plot.height - 1 - row);
            put(buffer, plot, at, BARS[usize::from(level - 1)], theme::BAR);
        }
    }
}

/// Round speeds along the bottom, and the unit at the end.
fn speed_axis((from, to): (f64, f64), units: Units, area: Rect, buffer: &mut Buffer) {
    let unit = if units == Units::Si { "m/s" } else { "" };
    let room = area.width.saturating_sub(width(unit) + 1);
    let rough = (to - from) / (f64::from(area.width) / 8.0).max(1.0);
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0]
        .map(|digit| digit * power)
        .into_iter()
        .find(|step| *step >= rough)
        .unwrap_or(10.0 * power);
    if !step.is_normal() || !to.is_finite() {
        return;
    }
    let mut free = 0;
    let ticks = (from / step).ceil() as i64..=(to / step).floor() as i64;
    for tick in ticks.map(|tick| tick as f64 * step) {
        let text = tick_text(tick, step);
        let column = ((tick - from) / (to - from) * f64::from(area.width)) as u16;
        let start = column.saturating_sub(width(&text) / 2);
        if start >= free && start + width(&text) <= room {
            free = put(buffer, area, (start, 0), &text, theme::QUIET) + 1;
        }
    }
    put_before(buffer, area, (area.width, 0), unit, theme::QUIET);
}

/// A round number with as many decimals as its step needs.
fn tick_text(tick: f64, step: f64) -> String {
    if tick == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&step) {
        return plain(tick, 2);
    }
    let decimals = (0..4)
        .find(|decimals| {
            let scaled = step * 10_f64.powi(*decimals);
            (scaled - scaled.round()).abs() < 1e-6
        })
        .unwrap_or(4) as usize;
    format!("{tick:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sharing_bins_out_keeps_the_balls() {
        let bins = [1.0, 4.0, 2.0, 1.0];
        for columns in [1, 3, 4, 7, 100] {
            let shared: f64 = rebin(&bins, 0.5, 2.0, columns).iter().sum();
            assert!((shared - 8.0).abs() < 1e-9, "{columns}");
        }
    }

    #[test]
    fn percentiles_lie_within_their_bins() {
        let bins = [0.0, 4.0, 4.0, 2.0];
        assert_eq!(percentile(&bins, 0.2), Some(1.5));
        assert_eq!(percentile(&bins, 0.5), Some(2.25));
        assert_eq!(
            percentile(&bins, 0.9),
            None,
            "the last bin has no upper end"
        );
        assert_eq!(percentile(&[0.0; 4], 0.5), None);
    }

    #[test]
    fn the_axis_leaves_out_a_lonely_tail() {
        let mut bins = vec![1000.0; 10];
        bins.extend([0.0; 20]);
        bins.push(1.0);
        assert_eq!(bins_below(&bins), 10);
    }
}
