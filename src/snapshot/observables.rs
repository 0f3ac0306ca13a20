//! What an observable found, in one form for all: some figures, each with its error and what theory expects, and a table.

use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};

pub use crate::scene::observe::Name as ObservableName;

/// How an observable's table is drawn: columns by their names, or by what stands before the name of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Curve {
    /// Where the values stand.
    pub x: &'static str,
    /// What is drawn.
    pub y: &'static str,
    /// What theory expects of it, if the table has that.
    pub expected: &'static str,
    /// Whether both axes are logarithmic.
    pub logarithmic: bool,
    /// What it is, for people.
    pub title: &'static str,
    /// Unit of `x` in SI.
    pub x_unit: &'static str,
}

impl Curve {
    /// The curve of an observable.
    pub fn of(name: ObservableName) -> Self {
        let curve = |x, y, expected, title, x_unit| Self {
            x,
            y,
            expected,
            logarithmic: false,
            title,
            x_unit,
        };
        match name {
            ObservableName::RadialDistribution => curve(
                "distance",
                "radial_distribution",
                "",
                "radial distribution against distance",
                "m",
            ),
            ObservableName::DensityProfile => {
                curve("x", "density_x", "", "density over its mean along x", "m")
            }
            ObservableName::Motion => Self {
                logarithmic: true,
                ..curve(
                    "time",
                    "mean_square_displacement",
                    "expected",
                    "mean square displacement against time",
                    "s",
                )
            },
            ObservableName::Relaxation => curve(
                "time",
                "h",
                "h_of_maxwell",
                "Boltzmann's H against time",
                "s",
            ),
            ObservableName::Flights => curve(
                "free_path",
                "flights_by_path",
                "expected_by_path",
                "flights by their free path",
                "m",
            ),
            ObservableName::Transport => curve(
                "time",
                "viscosity_until_then",
                "",
                "viscosity by the time it is taken over",
                "s",
            ),
        }
    }
}

impl Observed {
    /// The points of a column over another, the first of its name, alone or with a group's after a point.
    pub fn points(&self, x: &str, y: &str) -> Vec<(f64, f64)> {
        let column = |name: &str| {
            let is_it = |column: &&Column| {
                (column.name.strip_prefix(name))
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
            };
            self.columns.iter().find(is_it)
        };
        let (Some(x), Some(y)) = (column(x), column(y)) else {
            return Vec::new();
        };
        let pairs = x.values.iter().zip(&y.values);
        pairs.filter_map(|(x, y)| Some(((*x)?, (*y)?))).collect()
    }
}

/// What one observable of a run has found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Observed {
    /// Its name, as a scene's `[observe]` has it.
    pub name: String,
    /// Its figures.
    pub figures: Vec<Figure>,
    /// Its table, column by column, all of one length; the first is what the others are plotted against.
    pub columns: Vec<Column>,
}

/// A quantity with its error.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// What it is.
    pub name: String,
    /// Its value.
    pub value: Option<f64>,
    /// Standard error from blocks of the run.
    pub standard_error: Option<f64>,
    /// What theory expects.
    pub expected: Option<f64>,
    /// Unit for people, empty for numbers and in reduced units.
    pub unit: String,
}

/// A column of a table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Column {
    /// What it holds.
    pub name: String,
    /// Its values.
    pub values: Vec<Option<f64>>,
}

/// Serializes observables as one object, by name; each has its figures and its columns by name.
///
/// # Errors
/// What the serializer answers.
pub fn by_name<S: Serializer>(observables: &[Observed], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(observables.iter().map(|one| (&one.name, Named(one))))
}

struct Named<'o>(&'o Observed);

impl Serialize for Named<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for figure in &self.0.figures {
            map.serialize_entry(&figure.name, &Bare::of(figure))?;
        }
        for column in &self.0.columns {
            map.serialize_entry(&column.name, &column.values)?;
        }
        map.end()
    }
}

/// A figure without its name.
#[derive(Serialize)]
struct Bare {
    value: Option<f64>,
    standard_error: Option<f64>,
    expected: Option<f64>,
}

impl Bare {
    fn of(figure: &Figure) -> Self {
        Self {
            value: figure.value,
            standard_error: figure.standard_error,
            expected: figure.expected,
        }
    }
}
