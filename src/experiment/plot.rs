//! Plots as SVG: points and lines over linear or logarithmic axes, told apart by shape and dashes, not by colour alone.
//!
//! The legend stands beside the picture, so that it never covers a point.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Width and height of a plot \[pixel\].
const SIZE: (u32, u32) = (960, 540);

/// Width of the picture without its legend \[pixel\].
const PICTURE: i32 = 700;

const FONT: &str = "sans-serif";

/// Colours that people with any kind of colour blindness can tell apart, on white.
///
/// Source: Okabe & Ito, Color Universal Design (2008), without the yellow, which is hard to see on white.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 0, 0),
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

/// How an axis maps numbers to places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal differences are equally far apart.
    Linear,
    /// Equal ratios are equally far apart; what is not positive is left out.
    Logarithmic,
}

/// An axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What it measures, with its unit.
    pub label: String,
    /// How it maps.
    pub scale: Scale,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            scale: Scale::Linear,
        }
    }

    /// A logarithmic axis.
    pub fn logarithmic(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            scale: Scale::Logarithmic,
        }
    }

    /// Where a number is along the axis, in the axis's own measure.
    fn place(&self, value: f64) -> Option<f64> {
        let place = match self.scale {
            Scale::Linear => value,
            Scale::Logarithmic => value.log10(),
        };
        place.is_finite().then_some(place)
    }

    /// The axis with its ends and ticks, so that the given places have room.
    fn ruler(&self, places: impl Iterator<Item = f64>) -> Ruler {
        let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| {
            (low.min(place), high.max(place))
        });
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let width = if high > low { high - low } else { 1.0 };
        let (low, high) = (low - 0.04 * width, high + 0.04 * width);
        let ticks = match self.scale {
            Scale::Linear => even_ticks(low, high),
            Scale::Logarithmic => decade_ticks(low, high),
        };
        Ruler {
            axis: self.clone(),
            ends: low..high,
            ticks,
        }
    }

    /// The words at a tick.
    fn tick(&self, place: f64) -> String {
        let value = match self.scale {
            Scale::Linear => place,
            Scale::Logarithmic => 10.0_f64.powf(place),
        };
        let text = format!("{value:.2e}");
        let (digits, exponent) = text.split_once('e').expect("an exponent");
        let digits = digits.trim_end_matches('0').trim_end_matches('.');
        match exponent.parse::<i32>().expect("an exponent") {
            _ if value == 0.0 => "0".to_owned(),
            exponent @ -3..=5 => {
                let text = format!("{value:.*}", (2 - exponent).max(0) as usize);
                if text.contains('.') {
                    text.trim_end_matches('0').trim_end_matches('.').to_owned()
                } else {
                    text
                }
            }
            exponent => format!("{digits}e{exponent}"),
        }
    }
}

/// An axis as it is drawn: its places are what it measures, or the logarithms.
struct Ruler {
    axis: Axis,
    ends: Range<f64>,
    ticks: Vec<f64>,
}

impl Ranged for Ruler {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, (first, last): (i32, i32)) -> i32 {
        let share = (place - self.ends.start) / (self.ends.end - self.ends.start);
        first + (share * f64::from(last - first)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.ends.clone()
    }
}

impl ValueFormatter<f64> for Ruler {
    fn format_ext(&self, place: &f64) -> String {
        self.axis.tick(*place)
    }
}

/// Some six round numbers.
fn even_ticks(low: f64, high: f64) -> Vec<f64> {
    let rough = (high - low) / 6.0;
    let power = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * power)
        .into_iter()
        .find(|step| *step >= rough);
    let step = step.unwrap_or(rough);
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    (first..=last).map(|tick| tick as f64 * step).collect()
}

/// Powers of ten, or some of them; where there are few, twice and five times them too.
fn decade_ticks(low: f64, high: f64) -> Vec<f64> {
    let every = ((high - low) / 10.0).ceil().max(1.0) as i64;
    let factors: &[f64] = if high - low < 2.5 {
        &[1.0, 2.0, 5.0]
    } else {
        &[1.0]
    };
    let decades =
        (low.floor() as i64..=high.ceil() as i64).filter(|decade| decade.rem_euclid(every) == 0);
    decades
        .flat_map(|decade| {
            factors
                .iter()
                .map(move |factor| decade as f64 + factor.log10())
        })
        .filter(|tick| (low..=high).contains(tick))
        .collect()
}

/// The shape of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Glyph {
    /// ●
    Circle,
    /// ■
    Square,
    /// ▲
    Triangle,
    /// ◆
    Diamond,
    /// ×
    Cross,
    /// +
    Plus,
    /// A small dot, for clouds of points.
    Dot,
}

const GLYPHS: [Glyph; 6] = [
    Glyph::Circle,
    Glyph::Square,
    Glyph::Triangle,
    Glyph::Diamond,
    Glyph::Cross,
    Glyph::Plus,
];

/// How points are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// ─────
    Solid,
    /// ── ──
    Dashed,
    /// · · ·
    Dotted,
}

/// Points that belong together.
#[derive(Clone, Debug)]
pub struct Series {
    name: String,
    points: Vec<(f64, f64)>,
    errors: Vec<f64>,
    glyph: Option<Glyph>,
    hollow: bool,
    line: Option<Line>,
    /// Which of the colours; by its place among the series if none was chosen.
    colour: Option<usize>,
}

impl Series {
    /// Points of one shape.
    pub fn points(name: &str, glyph: Glyph, points: Vec<(f64, f64)>) -> Self {
        Self {
            name: name.to_owned(),
            points,
            errors: Vec::new(),
            glyph: Some(glyph),
            hollow: false,
            line: None,
            colour: None,
        }
    }

    /// A line without points.
    pub fn line(name: &str, line: Line, points: Vec<(f64, f64)>) -> Self {
        Self {
            line: Some(line),
            glyph: None,
            ..Self::points(name, Glyph::Dot, points)
        }
    }

    /// Points of the shape that the series' number gives, joined by a line; hollow when the shapes come round again.
    pub fn numbered(number: usize, name: &str, points: Vec<(f64, f64)>) -> Self {
        let series = Self::points(name, GLYPHS[number % GLYPHS.len()], points);
        let again = number >= GLYPHS.len();
        Self {
            hollow: again,
            ..series
        }
        .joined(Line::Solid)
    }

    /// The points, joined.
    #[must_use]
    pub fn joined(self, line: Line) -> Self {
        Self {
            line: Some(line),
            ..self
        }
    }

    /// The points, hollow.
    #[must_use]
    pub fn hollow(self) -> Self {
        Self {
            hollow: true,
            ..self
        }
    }

    /// In the colour of this number, which series that belong together can share.
    #[must_use]
    pub fn coloured(self, number: usize) -> Self {
        Self {
            colour: Some(number),
            ..self
        }
    }

    fn colour(&self, place: usize) -> RGBColor {
        COLOURS[self.colour.unwrap_or(place) % COLOURS.len()]
    }

    /// The points, each with a bar from `y - error` to `y + error`.
    #[must_use]
    pub fn with_errors(self, errors: Vec<f64>) -> Self {
        Self { errors, ..self }
    }

    fn errors(&self) -> impl Iterator<Item = f64> {
        self.errors.iter().copied().chain(std::iter::repeat(0.0))
    }
}

/// A picture.
#[derive(Clone, Debug)]
pub struct Plot {
    /// A word for file names.
    pub name: &'static str,
    /// What it shows.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// What is in it.
    pub series: Vec<Series>,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<'a> = Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;

impl Plot {
    /// The picture as SVG.
    ///
    /// # Panics
    /// Never: a picture in memory takes all.
    pub fn svg(&self) -> String {
        let mut text = String::new();
        {
            let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
            self.draw(&root).expect("memory takes all");
        }
        text
    }

    fn draw<'a>(&self, root: &Area<'a>) -> Drawn<'a> {
        root.fill(&WHITE)?;
        let (picture, _) = root.split_horizontally(PICTURE);
        let bars = |series: &Series| -> Vec<(f64, f64)> {
            let ends = series.points.iter().zip(series.errors());
            ends.flat_map(|(&(x, y), error)| [(x, y - error), (x, y + error)])
                .collect()
        };
        let all: Vec<_> = self
            .series
            .iter()
            .flat_map(|series| {
                let mut points = series.points.clone();
                points.extend(bars(series));
                points
            })
            .filter_map(|point| self.place(point))
            .collect();
        let x = self.x.ruler(all.iter().map(|point| point.0));
        let y = self.y.ruler(all.iter().map(|point| point.1));
        let mut chart = ChartBuilder::on(&picture)
            .caption(&self.title, (FONT, 19))
            .margin(14)
            .x_label_area_size(48)
            .y_label_area_size(78)
            .build_cartesian_2d(x, y)?;
        chart
            .configure_mesh()
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .axis_desc_style((FONT, 16))
            .label_style((FONT, 14))
            .bold_line_style(BLACK.mix(0.15))
            .light_line_style(TRANSPARENT)
            .draw()?;
        for (number, series) in self.series.iter().enumerate() {
            let colour = series.colour(number);
            let points: Vec<_> = series
                .points
                .iter()
                .filter_map(|&point| self.place(point))
                .collect();
            match series.line {
                Some(Line::Solid) => chart
                    .draw_series(LineSeries::new(points.clone(), colour.stroke_width(2)))
                    .map(drop)?,
                Some(line) => {
                    let (dash, space) = dashes(line);
                    chart
                        .draw_series(DashedLineSeries::new(
                            points.clone(),
                            dash,
                            space,
                            colour.stroke_width(2),
                        ))
                        .map(drop)?;
                }
                None => {}
            }
            let ends = bars(series);
            let bars = ends
                .chunks(2)
                .filter(|ends| ends[0] != ends[1])
                .filter_map(|ends| {
                    Some(PathElement::new(
                        [self.place(ends[0])?, self.place(ends[1])?],
                        colour.stroke_width(1),
                    ))
                });
            chart.draw_series(bars)?;
            if let Some(glyph) = series.glyph {
                for point in points {
                    let at = chart.backend_coord(&point);
                    draw_glyph(root, at, (glyph, series.hollow, colour))?;
                }
            }
        }
        self.draw_legend(root)
    }

    fn draw_legend<'a>(&self, root: &Area<'a>) -> Drawn<'a> {
        let text = (FONT, 14)
            .into_text_style(root)
            .pos(Pos::new(HPos::Left, VPos::Center));
        for ((number, series), y) in self.series.iter().enumerate().zip((60..).step_by(24)) {
            let colour = series.colour(number);
            let ends = [(PICTURE + 4, y), (PICTURE + 40, y)];
            match series.line {
                Some(Line::Solid) => root.draw(&PathElement::new(ends, colour.stroke_width(2)))?,
                Some(line) => {
                    let (dash, space) = dashes(line);
                    root.draw(&DashedPathElement::new(
                        ends,
                        dash,
                        space,
                        colour.stroke_width(2),
                    ))?;
                }
                None => {}
            }
            if let Some(glyph) = series.glyph {
                draw_glyph(root, (PICTURE + 22, y), (glyph, series.hollow, colour))?;
            }
            root.draw(&Text::new(series.name.as_str(), (PICTURE + 48, y), &text))?;
        }
        Ok(())
    }

    fn place(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        Some((self.x.place(x)?, self.y.place(y)?))
    }
}

fn dashes(line: Line) -> (u32, u32) {
    if line == Line::Dotted { (2, 4) } else { (8, 5) }
}

fn draw_glyph<'a>(
    root: &Area<'a>,
    (x, y): (i32, i32),
    (glyph, hollow, colour): (Glyph, bool, RGBColor),
) -> Drawn<'a> {
    // One can look through a hollow glyph at another that has the same place.
    let fill = if hollow {
        TRANSPARENT
    } else {
        colour.to_rgba()
    }
    .filled();
    let outline = colour.stroke_width(2);
    let path = |corners: &[(i32, i32)]| -> Vec<_> {
        corners
            .iter()
            .map(|corner| (x + corner.0, y + corner.1))
            .collect()
    };
    let stroke = |corners: &[(i32, i32)]| root.draw(&PathElement::new(path(corners), outline));
    // A cross has nothing to fill: it is thin instead of hollow.
    let weight = colour.stroke_width(if hollow { 1 } else { 4 });
    let bar = |ends: &[(i32, i32)]| root.draw(&PathElement::new(path(ends), weight));
    let polygon = |corners: &[(i32, i32)]| {
        root.draw(&Polygon::new(path(corners), fill))?;
        stroke(&[corners, &corners[..1]].concat())
    };
    match glyph {
        Glyph::Circle => {
            root.draw(&Circle::new((x, y), 5, fill))?;
            root.draw(&Circle::new((x, y), 5, outline))
        }
        Glyph::Square => polygon(&[(-5, -5), (5, -5), (5, 5), (-5, 5)]),
        Glyph::Triangle => polygon(&[(0, -7), (6, 5), (-6, 5)]),
        Glyph::Diamond => polygon(&[(0, -7), (7, 0), (0, 7), (-7, 0)]),
        Glyph::Cross => {
            bar(&[(-5, -5), (5, 5)])?;
            bar(&[(-5, 5), (5, -5)])
        }
        Glyph::Plus => {
            bar(&[(-6, 0), (6, 0)])?;
            bar(&[(0, -6), (0, 6)])
        }
        Glyph::Dot => root.draw(&Circle::new((x, y), 2, colour.filled())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_axis() {
        assert_eq!(even_ticks(-0.1, 10.2), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        let axis = Axis::logarithmic("time");
        let words = |low: f64, high: f64| -> Vec<String> {
            decade_ticks(low.log10(), high.log10())
                .into_iter()
                .map(|tick| axis.tick(tick))
                .collect()
        };
        assert_eq!(words(0.9, 60.0), ["1", "2", "5", "10", "20", "50"]);
        assert_eq!(
            words(5e-4, 2e6),
            [
                "0.001", "0.01", "0.1", "1", "10", "100", "1000", "10000", "100000", "1e6"
            ]
        );
        assert_eq!(
            words(1e-16, 10.0),
            [
                "1e-16", "1e-14", "1e-12", "1e-10", "1e-8", "1e-6", "1e-4", "0.01", "1"
            ]
        );
    }

    #[test]
    fn a_picture_has_its_words_and_leaves_out_what_a_logarithm_cannot_show() {
        let plot = Plot {
            name: "test",
            title: "A < B".to_owned(),
            x: Axis::linear("time [s]"),
            y: Axis::logarithmic("error"),
            series: vec![
                Series::numbered(0, "event", vec![(0.0, 0.0), (1.0, 1e-3), (2.0, 1.0)])
                    .with_errors(vec![0.0, 1e-4, 0.5]),
                Series::line("law", Line::Dashed, vec![(0.0, 1e-3), (2.0, 1e-1)]),
                Series::points("other", Glyph::Cross, vec![(f64::NAN, 1.0)]).hollow(),
            ],
        };
        let svg = plot.svg();
        for words in ["A &lt; B", "time [s]", "error", "event", "law", "other"] {
            assert!(svg.contains(words), "{words}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}
