//! What an observable found, in one form for all: some figures, each with its error and what theory expects, and a table.

use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};

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
