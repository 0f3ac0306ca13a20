//! The picture of the gas, with a scale bar and words that say what is shown.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};

use super::text::{framed_with_foot, put, title, width};
use crate::snapshot::{Boundary, Phase, SceneCard, Snapshot, Units};
use crate::tui::app::App;
use crate::tui::camera::{Camera, Projection};
use crate::tui::format::{count, plain, si};
use crate::tui::picture::{Layer, Mode, Picture, Portion};
use crate::tui::theme::{self, Glyphs};
use crate::tui::trails::mean_edge;

/// Draws the panel.
pub(super) fn panel(app: &App, area: Rect, buffer: &mut Buffer) {
    let snapshot = &*app.pictured;
    let camera = &app.camera;
    let zoom = if camera.zoom_steps == 0 {
        String::new()
    } else {
        format!(" · zoom {:.2}", camera.zoom())
    };
    let turning = if app.turning { ", turning" } else { "" };
    let angles = format!(
        " az {} el {}{turning}{zoom}",
        camera.azimuth, camera.elevation
    );
    let room = area.width.saturating_sub(width(&angles) + 6);
    let foot = format!("{angles} · {} ", place(&snapshot.scene, room));
    let Some(sample) = &snapshot.sample else {
        let inner = framed_with_foot(buffer, area, title("1 gas", ""), &foot);
        let words = match snapshot.phase {
            Phase::Starting if app.visit.is_some() => "reading the checkpoint before that time",
            Phase::Starting => "placing the molecules",
            _ => "waiting for a picture",
        };
        let middle = (
            inner.width.saturating_sub(width(words)) / 2,
            inner.height / 2,
        );
        put(buffer, inner, middle, words, theme::QUIET);
        return;
    };
    let glyphs: &Glyphs = if app.ascii {
        &theme::ASCII
    } else {
        &theme::UNICODE
    };
    let pane = (area.width.saturating_sub(2), area.height.saturating_sub(2));
    let picture = Picture::draw(
        &snapshot.scene,
        sample,
        &app.trails,
        (camera, app.mode),
        pane,
        glyphs,
    );
    let remark = words(
        &picture.portion,
        app.mode,
        snapshot,
        area.width.saturating_sub(10),
    );
    let inner = framed_with_foot(buffer, area, title("1 gas", &remark), &foot);
    for (index, (glyph, layer)) in picture.cells.iter().enumerate() {
        let at = (
            (index % picture.width) as u16,
            (index / picture.width) as u16,
        );
        if let Some(style) = style(*layer) {
            let mut bytes = [0; 4];
            put(buffer, inner, at, glyph.encode_utf8(&mut bytes), style);
        }
    }
    names(glyphs, &sample.names, inner, buffer);
    axes(camera, inner, buffer);
    scale_bar(picture.scale, snapshot.scene.units, inner, buffer);
}

/// Where the gas is, in as many words as there is room for.
fn place(scene: &SceneCard, room: u16) -> String {
    let faces = match scene.boundary {
        Boundary::Container => "container",
        Boundary::Periodic => "periodic",
        Boundary::Open => "open space",
    };
    let planes = match scene.planes.len() {
        0 => return faces.into(),
        1 => "1 plane".into(),
        many => format!("{} planes", count(many as u64)),
    };
    let both = format!("{faces}, {planes} × × ×");
    if width(&both) <= room { both } else { planes }
}

/// What of the gas is shown, in as many words as there is room for.
fn words(portion: &Portion, mode: Mode, snapshot: &Snapshot, room: u16) -> String {
    let units = snapshot.scene.units;
    let share = match portion.one_in {
        ..1.005 => "all".to_string(),
        ..10.0 => format!("1 in {:.1}", portion.one_in),
        many => {
            let power = 10_f64.powf(many.log10().floor() - 1.0);
            let rounded = ((many / power).round() * power) as u64;
            if rounded < 10_000 {
                format!("1 in {rounded}")
            } else {
                format!("1 in {}", count(rounded))
            }
        }
    };
    let whole = match mode {
        Mode::Slab => "whole depth",
        Mode::Depth => "density over the whole depth",
    };
    let mut depth = portion.slab.map_or(whole.into(), |slab| {
        let edge = mean_edge(snapshot.scene.size);
        let digits = if slab < 0.9 * edge { 2 } else { 3 };
        let slab = length(slab, units, digits);
        format!("slab {slab} of {}", length(edge, units, 3))
    });
    if portion.depth != 0.0 {
        let side = if portion.depth > 0.0 {
            "behind"
        } else {
            "before"
        };
        depth = format!(
            "{depth}, {} {side} the middle",
            length(portion.depth.abs(), units, 2)
        );
    }
    [
        format!("{depth} · {share} of the molecules"),
        format!("{depth} · {share}"),
    ]
    .into_iter()
    .find(|words| width(words) <= room)
    .unwrap_or(depth)
}

fn length(value: f64, units: Units, digits: usize) -> String {
    match units {
        Units::Si => si(value, "m", digits),
        Units::Reduced => plain(value, digits),
    }
}

fn style(layer: Layer) -> Option<Style> {
    let tag =
        |tag: u8| Style::new().fg(theme::TAG_COLORS[usize::from(tag) % theme::TAG_COLORS.len()]);
    match layer {
        Layer::Empty => None,
        Layer::Edge => Some(theme::FRAME),
        // One look for all of them: on a slow line a change of style costs more than a molecule.
        Layer::Plane | Layer::Molecule(_) | Layer::Shade => Some(theme::VALUE),
        Layer::Trail(index) => Some(tag(index)),
        Layer::Tag(index) => Some(tag(index).add_modifier(Modifier::BOLD)),
    }
}

/// Which glyph is which named ball.
fn names(glyphs: &Glyphs, names: &[String], area: Rect, buffer: &mut Buffer) {
    let mut column = 0;
    for (index, (name, glyph)) in names.iter().zip(glyphs.tags).enumerate() {
        let text = format!("{glyph} {name}");
        if column + width(&text) > area.width {
            break;
        }
        let style = style(Layer::Tag(index as u8)).unwrap_or_default();
        column = put(buffer, area, (column, 0), &text, style) + 2;
    }
}

/// Least columns and rows of a pane with a marker of the axes.
const AXES: (u16, u16) = (36, 11);

/// Where the axes of the scene point: letters about a corner, in the lower left. One that points at the eye is bold.
fn axes(camera: &Camera, area: Rect, buffer: &mut Buffer) {
    if area.width < AXES.0 || area.height < AXES.1 {
        return;
    }
    let projection = Projection::new(camera, [1.0; 3], 7, 5);
    let reach = 2.8 / projection.scale;
    let left = Rect {
        y: area.bottom() - 4,
        width: 7,
        height: 4,
        ..area
    };
    put(buffer, left, (3, 2), "+", theme::FRAME);
    let axes = [(0, "x"), (1, "y"), (2, "z")].map(|(axis, letter)| {
        let mut tip = [0.0; 3];
        tip[axis] = reach;
        (projection.project(tip), letter)
    });
    for (spot, letter) in axes {
        let (column, row) = (spot.column.round() - 0.5, spot.row.round() - 0.5);
        let at = (column.clamp(0.0, 6.0) as u16, row.clamp(0.0, 3.0) as u16);
        let style = if spot.depth < 0.0 {
            theme::STRONG
        } else {
            theme::VALUE
        };
        if at != (3, 2) {
            put(buffer, left, at, letter, style);
        }
    }
}

/// A bar in the lower right corner, exactly as long as it says.
fn scale_bar(scale: f64, units: Units, area: Rect, buffer: &mut Buffer) {
    if !scale.is_normal() || area.height < 3 {
        return;
    }
    let longest = f64::from(area.width) * 0.4 / scale;
    let power = 10_f64.powf(longest.log10().floor());
    let fitting = [5.0, 2.0, 1.0, 0.5]
        .map(|digit| digit * power)
        .into_iter()
        .filter(|bar| *bar <= longest)
        .map(|bar| {
            (
                bar,
                (bar * scale).round() as u16,
                format!(" {} ", round_length(bar, units)),
            )
        })
        .rfind(|(_, columns, text)| *columns >= width(text) + 2);
    let Some((_, columns, text)) = fitting else {
        return;
    };
    let row = area.height - 1;
    let start = area.width - columns;
    for column in start + 1..area.width - 1 {
        put(buffer, area, (column, row), "─", theme::VALUE);
    }
    put(buffer, area, (start, row), "├", theme::VALUE);
    put(buffer, area, (area.width - 1, row), "┤", theme::VALUE);
    let middle = start + (columns - width(&text)) / 2;
    put(buffer, area, (middle, row), &text, theme::VALUE);
}

/// A length with one significant digit, without trailing zeros.
fn round_length(value: f64, units: Units) -> String {
    match units {
        Units::Si => si(value, "m", 1),
        Units::Reduced => plain(value, 1),
    }
}
