//! The report of a run: its summary as a page of Markdown, with its course and its speeds as SVG plots beside it.
//!
//! It is made from the files that every run leaves, so it can be made again at any time.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::error::{Error, Result};
use crate::experiment::plot::{Axis, Glyph, Line, Plot, Series};
use crate::output::Target;
use crate::quantity::{Quantity, duration, plain, quantity};
use crate::run_directory::{HISTORY, REPORT, SUMMARY};
use crate::snapshot::{Curve, ObservableName, Units};

/// A report of a run.
pub struct Report {
    /// The page.
    pub markdown: String,
    plots: Vec<Plot>,
}

impl Report {
    /// Reads what a run has left in its directory.
    ///
    /// # Errors
    /// [`Error::File`] when there is no summary; a run without a history gets a page without its course.
    pub fn of(directory: &Path) -> Result<Self> {
        let read = |file: &str| {
            let path = directory.join(file);
            fs::read(&path).map_err(|source| Error::File {
                path,
                action: "read",
                source,
            })
        };
        let summary = read(SUMMARY)?;
        let summary: Value = serde_json::from_slice(&summary).map_err(|error| Error::File {
            path: directory.join(SUMMARY),
            action: "read",
            source: error.into(),
        })?;
        let course = read(HISTORY)
            .map(|bytes| Course::parse(&bytes))
            .unwrap_or_default();
        Ok(Self::new(&summary, &course))
    }

    fn new(summary: &Value, course: &Course) -> Self {
        let page = Page::new(summary);
        let plots = plots(&page, course);
        Self {
            markdown: page.markdown(&plots),
            plots,
        }
    }

    /// Writes page and plots into a directory, over those of the same names.
    ///
    /// # Errors
    /// [`Error::File`] when one cannot be written.
    pub fn write(&self, directory: &Path) -> Result<()> {
        for plot in &self.plots {
            let target = Target::replacing(directory.join(format!("{}.svg", plot.name)));
            target.write(|writer| writer.write_all(plot.svg().as_bytes()))?;
        }
        Target::replacing(directory.join(REPORT))
            .write(|writer| writer.write_all(self.markdown.as_bytes()))
    }
}

/// The columns of a history file.
#[derive(Default)]
struct Course {
    columns: Vec<(String, Vec<Option<f64>>)>,
}

impl Course {
    /// Reads the file; what is no number is a gap.
    fn parse(bytes: &[u8]) -> Self {
        let mut table = csv::Reader::from_reader(bytes);
        let mut columns: Vec<(String, Vec<Option<f64>>)> = table
            .headers()
            .map(|names| {
                names
                    .iter()
                    .map(|name| (name.to_owned(), Vec::new()))
                    .collect()
            })
            .unwrap_or_default();
        for row in table.records().map_while(std::result::Result::ok) {
            for ((_, column), cell) in columns.iter_mut().zip(&row) {
                column.push(cell.parse().ok());
            }
        }
        Self { columns }
    }

    fn column(&self, name: &str) -> &[Option<f64>] {
        let found = self.columns.iter().find(|(column, _)| column == name);
        found.map_or(&[], |(_, values)| values)
    }

    /// A quantity over time, at the ends of the stretches.
    fn points(&self, name: &str) -> Vec<(f64, f64)> {
        let times = self.column("end").iter();
        times
            .zip(self.column(name))
            .filter_map(|(time, value)| Some(((*time)?, (*value)?)))
            .collect()
    }
}

/// A plot of a run's course: file name, title, and the quantities in it with their names there.
type Drawn = (
    &'static str,
    &'static str,
    &'static [(&'static str, &'static str)],
);

const COURSES: [Drawn; 5] = [
    (
        "temperature",
        "Temperature",
        &[("temperature", "temperature")],
    ),
    (
        "pressure",
        "Pressure",
        &[
            ("pressure_wall", "on the walls"),
            ("pressure_virial", "from collisions"),
        ],
    ),
    (
        "rates",
        "Collisions per simulated time",
        &[("pair_rate", "between balls"), ("wall_rate", "with walls")],
    ),
    (
        "drift",
        "Relative energy drift",
        &[("energy_drift", "energy drift")],
    ),
    (
        "speed",
        "Pair collisions per wall second",
        &[("collisions_per_wall_second", "collisions")],
    ),
];

fn plots(page: &Page, course: &Course) -> Vec<Plot> {
    let unit = |si: &str| {
        if page.units == Units::Si {
            format!(" in {si}")
        } else {
            String::new()
        }
    };
    let time = Axis::linear(&format!("simulated time{}", unit("s")));
    let labels = [
        unit("K"),
        unit("Pa"),
        unit("1/s"),
        String::new(),
        String::new(),
    ];
    let mut plots = Vec::new();
    for ((name, title, quantities), unit) in COURSES.into_iter().zip(labels) {
        let mut series = Vec::new();
        for &(column, words) in quantities {
            let mean = course.points(column);
            if mean.len() > 1 {
                series.push(Series::line(words, Line::Solid, mean));
                for (edge, words) in [("low", "lowest"), ("high", "highest")] {
                    let points = course.points(&format!("{column}_{edge}"));
                    series.push(Series::line(words, Line::Dotted, points));
                }
            }
        }
        if !series.is_empty() {
            plots.push(Plot {
                name,
                title: format!("{title}: {}", page.title),
                x: time.clone(),
                y: Axis::linear(&format!("{}{unit}", title.to_lowercase())),
                series,
            });
        }
    }
    plots.extend(speeds(page, &unit("m/s")));
    let observed = ObservableName::ALL.into_iter();
    plots.extend(observed.filter_map(|name| curve(page, name)));
    plots
}

/// The curve of an observable, group by group, beside what theory expects.
fn curve(page: &Page, name: ObservableName) -> Option<Plot> {
    let curve = Curve::of(name);
    let table = page.summary["observables"][name.key()].as_object()?;
    let column = |key: &str| Some(table.get(key)?.as_array()?.iter().map(Value::as_f64));
    let series = |wanted: &str, line: Line| -> Vec<Series> {
        let groups = table.keys().filter_map(|key| {
            let rest = key.strip_prefix(wanted).filter(|_| !wanted.is_empty())?;
            (rest.is_empty() || rest.starts_with('.')).then_some(key)
        });
        let drawn = groups.filter_map(|key| {
            let pairs = column(curve.x)?.zip(column(key)?);
            let points: Vec<_> = pairs.filter_map(|(x, y)| Some((x?, y?))).collect();
            let words = key.replace(['_', '.'], " ");
            (points.len() > 1).then(|| Series::line(&words, line, points))
        });
        drawn.collect()
    };
    let series = [
        series(curve.y, Line::Solid),
        series(curve.expected, Line::Dotted),
    ]
    .concat();
    let (what, against) = (curve.y.replace('_', " "), curve.x.replace('_', " "));
    let unit = match page.units {
        Units::Si => format!(" in {}", curve.x_unit),
        Units::Reduced => String::new(),
    };
    let axis = |label: &str| {
        if curve.logarithmic {
            Axis::logarithmic(label)
        } else {
            Axis::linear(label)
        }
    };
    (!series.is_empty()).then(|| Plot {
        name: name.key(),
        title: format!("{}: {}", capitalised(curve.title), page.title),
        x: axis(&format!("{against}{unit}")),
        y: axis(&what),
        series,
    })
}

fn capitalised(words: &str) -> String {
    let mut letters = words.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

/// The speeds beside Maxwell's distribution.
fn speeds(page: &Page, unit: &str) -> Option<Plot> {
    let histogram = &page.summary["speeds"]["histogram"];
    let width = histogram["bin_width"].as_f64()?;
    let points = |key: &str| -> Option<Vec<(f64, f64)>> {
        let bins = histogram[key].as_array()?.iter().enumerate();
        bins.map(|(bin, count)| Some(((bin as f64 + 0.5) * width, count.as_f64()?)))
            .collect()
    };
    Some(Plot {
        name: "speeds",
        title: format!("Speeds: {}", page.title),
        x: Axis::linear(&format!("speed{unit}")),
        y: Axis::linear("balls per bin"),
        series: vec![
            Series::points("measured", Glyph::Circle, points("counts")?),
            Series::line("Maxwell", Line::Solid, points("maxwell")?),
        ],
    })
}

/// The summary, read for people.
struct Page<'s> {
    summary: &'s Value,
    title: &'s str,
    units: Units,
}

impl<'s> Page<'s> {
    fn new(summary: &'s Value) -> Self {
        Self {
            summary,
            title: summary["scene"]["title"].as_str().unwrap_or("a run"),
            units: serde_json::from_value(summary["scene"]["units"].clone()).unwrap_or_default(),
        }
    }

    fn number(&self, path: &str) -> Option<f64> {
        self.summary.pointer(path)?.as_f64()
    }

    fn show(&self, path: &str, kind: Quantity) -> String {
        self.number(path)
            .map_or_else(|| "–".to_owned(), |value| quantity(value, kind, self.units))
    }

    fn count(&self, path: &str) -> String {
        let count = self.summary.pointer(path).and_then(Value::as_u64);
        count.map_or_else(|| "–".to_owned(), |count| count.to_string())
    }

    fn plain(&self, path: &str) -> String {
        self.number(path)
            .map_or_else(|| "–".to_owned(), |value| format!("{value:.4e}"))
    }

    fn markdown(&self, plots: &[Plot]) -> String {
        let exit = self.summary["exit"].as_str().unwrap_or("–");
        let engine = self.summary["engine"].as_str().unwrap_or("–");
        let wall = |path: &str| self.number(path).map_or_else(|| "–".to_owned(), duration);
        let rate = self.number("/collisions_per_wall_second");
        let rows = [
            ("ended", exit.to_owned()),
            ("engine", engine.to_owned()),
            ("balls", self.count("/scene/ball_count")),
            ("packing fraction", self.plain("/scene/packing_fraction")),
            ("simulated time", self.show("/time", Quantity::Time)),
            ("wall time", wall("/wall_time_s")),
            (
                "collisions per wall second",
                rate.map_or_else(|| "–".to_owned(), plain),
            ),
            ("pair collisions", self.count("/pair_collisions")),
            ("wall collisions", self.count("/wall_collisions")),
            ("plane collisions", self.count("/plane_collisions")),
            (
                "temperature",
                self.show("/temperature", Quantity::Temperature),
            ),
            (
                "pressure on the walls",
                self.show("/pressure/wall", Quantity::Pressure),
            ),
            (
                "pressure from collisions",
                self.show("/pressure/virial", Quantity::Pressure),
            ),
            (
                "its standard error",
                self.show("/pressure/standard_error", Quantity::Pressure),
            ),
            (
                "compressibility factor",
                self.plain("/compressibility_factor"),
            ),
            (
                "mean free path",
                self.show("/mean_free_path", Quantity::Length),
            ),
            (
                "state hash",
                self.summary["state_hash"]
                    .as_str()
                    .unwrap_or("–")
                    .to_owned(),
            ),
        ];
        let mut text = format!("# {}\n\n| | |\n|---|---|\n", self.title);
        for (name, value) in rows {
            let _ = writeln!(text, "| {name} | {value} |");
        }
        text.push_str("\n## Accuracy\n\n| figure | value | limit | sound |\n|---|---|---|---|\n");
        for check in self.summary["accuracy"].as_array().into_iter().flatten() {
            let number = |key: &str| {
                check[key]
                    .as_f64()
                    .map_or_else(|| "–".to_owned(), |value| format!("{value:.1e}"))
            };
            let sound = if check["sound"] == true { "yes" } else { "no" };
            let name = check["name"].as_str().unwrap_or("–");
            let _ = writeln!(
                text,
                "| {name} | {} | {} | {sound} |",
                number("value"),
                number("limit")
            );
        }
        for plot in plots {
            let _ = write!(text, "\n![{}]({}.svg)\n", plot.title, plot.name);
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn summary() -> Value {
        json!({
            "scene": { "title": "512 balls", "units": "reduced", "ball_count": 512, "packing_fraction": 0.1 },
            "exit": "signal 15",
            "temperature": 0.5,
            "pressure": { "wall": null },
            "accuracy": [{ "name": "energy drift", "value": 1e-9, "limit": 1e-12, "sound": false }],
            "observables": { "motion": {
                "time": [1, 2, 3],
                "mean_square_displacement.a": [1, 4, 9],
                "mean_square_displacement.b": [null, 2, 4],
            }, "relaxation": { "time": [0], "h": [1] } },
            "speeds": { "histogram": { "bin_width": 0.5, "counts": [1, 2], "maxwell": [0.5, 2.5] } },
        })
    }

    #[test]
    fn a_page_says_what_is_known_and_has_a_dash_for_the_rest() {
        let page = Report::new(&summary(), &Course::default()).markdown;
        for line in [
            "# 512 balls",
            "| ended | signal 15 |",
            "| temperature | 0.5000 |",
            "| pressure on the walls | – |",
            "| energy drift | 1.0e-9 | 1.0e-12 | no |",
            "![Speeds: 512 balls](speeds.svg)",
        ] {
            assert!(page.lines().any(|found| found == line), "{line}\n{page}");
        }
        assert!(!page.contains("temperature.svg"));
    }

    #[test]
    fn a_course_is_drawn_as_far_as_it_is_known() {
        let table = b"begin,end,temperature,temperature_low,temperature_high,pressure_wall\n\
                      0,1,300,299,301,\n1,2,310,305,311,\n";
        let report = Report::new(&summary(), &Course::parse(table));
        let names: Vec<&str> = report.plots.iter().map(|plot| plot.name).collect();
        assert_eq!(names, ["temperature", "speeds", "motion"]);
        let place = tempfile::tempdir().expect("a temporary directory");
        report.write(place.path()).expect("room");
        let svg = fs::read_to_string(place.path().join("temperature.svg")).expect("a plot");
        assert!(svg.starts_with("<svg") && svg.contains("lowest"));
        let svg = fs::read_to_string(place.path().join("motion.svg")).expect("a plot");
        assert!(svg.contains("mean square displacement b"));
    }
}
