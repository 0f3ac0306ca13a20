//! Reads a TOML tree key by key and collects every fault with its line, instead of stopping at the first one.
//!
//! A [`Table`] remembers which keys were asked for; [`Table::finish`] reports the others, so a misspelt key never passes.

use std::ops::Range;
use std::path::Path;

use glam::DVec3;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Most faults reported for one scene: more are noise.
const MOST_FAULTS: usize = 20;

/// The faults of one file, each with its line.
pub(super) struct Faults<'t> {
    path: &'t Path,
    text: &'t str,
    line_ends: Vec<usize>,
    found: Vec<(usize, String)>,
}

impl<'t> Faults<'t> {
    pub(super) fn new(path: &'t Path, text: &'t str) -> Self {
        let line_ends = text.match_indices('\n').map(|(offset, _)| offset).collect();
        Self {
            path,
            text,
            line_ends,
            found: Vec::new(),
        }
    }

    /// Line of a byte offset, counted from one.
    pub(super) fn line(&self, offset: usize) -> usize {
        1 + self.line_ends.partition_point(|&end| end < offset)
    }

    /// Adds a fault at a byte offset.
    pub(super) fn add(&mut self, offset: usize, words: &str) {
        let line = self.line(offset);
        self.found.push((
            line,
            format!("{}:{line}: {}", self.path.display(), one_line(words)),
        ));
    }

    /// Adds a fault of a value: `key = value: limit`, the value as the user typed it.
    pub(super) fn value(&mut self, key: &str, span: &Range<usize>, limit: &str) {
        let typed = self.text.get(span.clone()).unwrap_or_default();
        let shown: String = typed.chars().take(60).collect();
        let rest = if shown.len() < typed.len() { "..." } else { "" };
        self.add(span.start, &format!("{key} = {shown}{rest}: {limit}"));
    }

    /// Adds a fault of the syntax, with the line as it stands.
    pub(super) fn syntax(&mut self, offset: usize, words: &str) {
        let end = self.line_ends.partition_point(|&end| end < offset);
        let start = if end == 0 {
            0
        } else {
            self.line_ends[end - 1] + 1
        };
        let stop = self.line_ends.get(end).copied().unwrap_or(self.text.len());
        let line: String = self
            .text
            .get(start..stop)
            .unwrap_or_default()
            .trim()
            .chars()
            .take(60)
            .collect();
        // A comma between two digits of a bare number is a decimal comma.
        let value = line.split_once('=').map_or("", |(_, value)| value.trim());
        let comma = value.split_once(',').is_some_and(|(whole, rest)| {
            whole.parse::<f64>().is_ok() && rest.starts_with(|letter: char| letter.is_ascii_digit())
        });
        let hint = if comma {
            ": use a dot, not a comma"
        } else {
            ""
        };
        self.add(offset, &format!("{line}: {words}{hint}"));
    }

    /// Adds the lines of another file's faults.
    pub(super) fn add_lines(&mut self, offset: usize, lines: Vec<String>) {
        let line = self.line(offset);
        self.found
            .extend(lines.into_iter().map(|words| (line, words)));
    }

    /// Whether nothing is wrong so far.
    pub(super) fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// The faults in the order of their lines, bounded.
    pub(super) fn into_lines(mut self) -> Vec<String> {
        self.found.sort_by_key(|(line, _)| *line);
        let more = self.found.len().saturating_sub(MOST_FAULTS);
        let mut lines: Vec<String> = self
            .found
            .into_iter()
            .take(MOST_FAULTS)
            .map(|(_, words)| words)
            .collect();
        if more > 0 {
            lines.push(format!("{}: and {more} more", self.path.display()));
        }
        lines
    }
}

/// A fault is one line of text that can be read, whatever the value in it looked like.
pub(super) fn one_line(words: &str) -> String {
    const LONGEST_WORD: usize = 200;
    let words = words.split_whitespace().map(|word| {
        let mut letters = word.chars();
        let mut shown: String = letters.by_ref().take(LONGEST_WORD).collect();
        if letters.next().is_some() {
            shown += "...";
        }
        shown
    });
    words
        .collect::<Vec<_>>()
        .join(" ")
        .replace(char::is_control, "?")
}

/// A number for a message: four digits at most, so that it reads.
pub(super) fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    if rounded == 0.0 || (1e-3..1e6).contains(&rounded.abs()) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

/// A value and where it stands in the text.
#[derive(Clone, Debug)]
pub(super) struct At<T> {
    pub(super) value: T,
    pub(super) span: Range<usize>,
}

/// A TOML table that knows which of its keys were asked for.
pub(super) struct Table<'t> {
    /// How messages call it: `[domain]`, `placement`.
    pub(super) name: String,
    pub(super) span: Range<usize>,
    entries: &'t DeTable<'t>,
    asked: Vec<&'static str>,
}

impl<'t> Table<'t> {
    pub(super) fn new(name: &str, span: Range<usize>, entries: &'t DeTable<'t>) -> Self {
        Self {
            name: name.to_owned(),
            span,
            entries,
            asked: Vec::new(),
        }
    }

    fn get(&mut self, key: &'static str) -> Option<&'t Spanned<DeValue<'t>>> {
        self.asked.push(key);
        self.entries.get(key)
    }

    /// Whether the key stands in the table, with a good value or a bad one.
    fn has(&self, key: &str) -> bool {
        self.entries.contains_key(key)
    }

    /// Reports a key that has no default, unless it is there (and was refused).
    pub(super) fn missing(&self, key: &str, limit: &str, faults: &mut Faults) {
        if self.has(key) {
            return;
        }
        let place = if self.name.is_empty() {
            "the scene"
        } else {
            &self.name
        };
        faults.add(
            self.span.start,
            &format!("{key}: missing in {place}: {limit}"),
        );
    }

    /// A finite number.
    pub(super) fn number(&mut self, key: &'static str, faults: &mut Faults) -> Option<At<f64>> {
        let entry = self.get(key)?;
        number_of(key, entry, faults)
    }

    /// A finite number that `accept` likes; `limit` says in words what that is.
    pub(super) fn number_where(
        &mut self,
        key: &'static str,
        accept: fn(f64) -> bool,
        limit: &str,
        faults: &mut Faults,
    ) -> Option<At<f64>> {
        let number = self.number(key, faults)?;
        if accept(number.value) {
            return Some(number);
        }
        faults.value(key, &number.span, limit);
        None
    }

    /// A finite number greater than zero.
    pub(super) fn positive(&mut self, key: &'static str, faults: &mut Faults) -> Option<At<f64>> {
        self.number_where(key, |x| x > 0.0, "must be greater than 0", faults)
    }

    /// A whole number in `[0, 2^64)`.
    pub(super) fn count(&mut self, key: &'static str, faults: &mut Faults) -> Option<At<u64>> {
        let entry = self.get(key)?;
        let whole = match entry.get_ref() {
            DeValue::Integer(digits) => u64::from_str_radix(digits.as_str(), digits.radix()).ok(),
            _ => None,
        };
        if whole.is_none() {
            faults.value(
                key,
                &entry.span(),
                "must be a whole number from 0 to 18446744073709551615",
            );
        }
        whole.map(|value| At {
            value,
            span: entry.span(),
        })
    }

    /// Yes or no.
    pub(super) fn flag(&mut self, key: &'static str, faults: &mut Faults) -> Option<At<bool>> {
        let entry = self.get(key)?;
        let flag = entry.get_ref().as_bool();
        if flag.is_none() {
            faults.value(key, &entry.span(), "must be true or false");
        }
        flag.map(|value| At {
            value,
            span: entry.span(),
        })
    }

    /// Why a number that reads as zero is not what was typed: it has digits other than 0, and is too small.
    pub(super) fn underflow(&self, key: &str) -> Option<&'static str> {
        let DeValue::Float(digits) = self.entries.get(key)?.get_ref() else {
            return None;
        };
        let typed = digits.as_str();
        let mantissa = typed.split(['e', 'E']).next().unwrap_or(typed);
        let lost =
            typed.parse::<f64>() == Ok(0.0) && mantissa.contains(|x| ('1'..='9').contains(&x));
        lost.then_some("is smaller than the smallest number, 2.2e-308")
    }

    /// A piece of text.
    pub(super) fn text(&mut self, key: &'static str, faults: &mut Faults) -> Option<At<String>> {
        let entry = self.get(key)?;
        let text = entry.get_ref().as_str();
        if text.is_none() {
            faults.value(key, &entry.span(), "must be text in quotes");
        }
        text.map(|value| At {
            value: value.to_owned(),
            span: entry.span(),
        })
    }

    /// Three finite numbers.
    pub(super) fn vector(&mut self, key: &'static str, faults: &mut Faults) -> Option<At<DVec3>> {
        let entry = self.get(key)?;
        let parts = entry.get_ref().as_array().filter(|parts| parts.len() == 3);
        let Some(parts) = parts else {
            faults.value(key, &entry.span(), "must be three numbers, [x, y, z]");
            return None;
        };
        let mut vector = [0.0; 3];
        for (axis, part) in vector.iter_mut().zip(parts.iter()) {
            *axis = number_of(key, part, faults)?.value;
        }
        Some(At {
            value: DVec3::from_array(vector),
            span: entry.span(),
        })
    }

    /// A table below this one.
    pub(super) fn table(
        &mut self,
        key: &'static str,
        name: &str,
        faults: &mut Faults,
    ) -> Option<Table<'t>> {
        let entry = self.get(key)?;
        let table = entry.get_ref().as_table();
        if table.is_none() {
            faults.value(key, &entry.span(), "must be a table");
        }
        table.map(|entries| Table::new(name, entry.span(), entries))
    }

    /// The tables of an array of tables; none when it is absent.
    pub(super) fn tables(
        &mut self,
        key: &'static str,
        name: &str,
        faults: &mut Faults,
    ) -> Vec<Table<'t>> {
        let Some(entry) = self.get(key) else {
            return Vec::new();
        };
        let Some(array) = entry.get_ref().as_array() else {
            faults.value(
                key,
                &entry.span(),
                &format!("must be an array of tables, {name}"),
            );
            return Vec::new();
        };
        let mut tables = Vec::with_capacity(array.len());
        for item in array {
            match item.get_ref().as_table() {
                Some(entries) => tables.push(Table::new(name, item.span(), entries)),
                None => faults.value(key, &item.span(), &format!("must be a table, {name}")),
            }
        }
        tables
    }

    /// Reports every key that nobody asked for.
    pub(super) fn finish(self, faults: &mut Faults) {
        for (key, value) in self.entries {
            if !self.asked.contains(&key.get_ref().as_ref()) {
                let known = self.asked.join(", ");
                let place = if self.name.is_empty() {
                    String::new()
                } else {
                    format!(" in {}", self.name)
                };
                let start = key.span().start.min(value.span().start);
                faults.add(
                    start,
                    &format!("{}: unknown key{place}: known are {known}", key.get_ref()),
                );
            }
        }
    }
}

fn number_of(key: &str, entry: &Spanned<DeValue<'_>>, faults: &mut Faults) -> Option<At<f64>> {
    let value = match entry.get_ref() {
        DeValue::Float(digits) => digits.as_str().parse::<f64>().ok(),
        DeValue::Integer(digits) => i128::from_str_radix(digits.as_str(), digits.radix())
            .ok()
            .map(|whole| whole as f64),
        _ => None,
    };
    match value {
        Some(value) if value.is_finite() => Some(At {
            value,
            span: entry.span(),
        }),
        Some(_) => {
            faults.value(key, &entry.span(), "must be finite");
            None
        }
        None => {
            faults.value(key, &entry.span(), "must be a number");
            None
        }
    }
}
