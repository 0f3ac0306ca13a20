//! Which settings are worth taking: nobody is both faster and as good. What is said here in words is read off the measurements.

use crate::experiment::trade::settings::Setting;
use crate::experiment::trade::statistics::{Difference, Estimate, Measured, threads};
use crate::experiment::trade::trajectories::Faith;
use crate::quantity::plain;
use crate::worker::engines::{Accuracy, Choice};

/// Shares of error that are recommended for.
const SHARES: [f64; 3] = [0.1, 0.01, 0.001];

/// A setting that is not faster by more than this share does not dominate.
const FASTER: f64 = 1.05;

/// Factor within which errors of trajectories are alike.
const ALIKE: f64 = 2.0;

/// A setting with all that was measured of it.
#[derive(Clone, Debug)]
pub struct Row {
    /// What was run.
    pub setting: Setting,
    /// What it has shown.
    pub measured: Measured,
    /// Errors against the reference: wall pressure, pressure by the virial, pair collisions, displacement.
    pub errors: [Option<Difference>; 4],
    /// Of its trajectories, if it has any and there was time.
    pub faith: Option<Faith>,
    /// The number of the row that is faster and as good.
    pub dominated_by: Option<usize>,
}

impl Row {
    /// A row with its errors against the reference.
    pub fn new(
        setting: Setting,
        measured: Measured,
        reference: &Measured,
        faith: Option<Faith>,
    ) -> Self {
        let against = |found: Option<_>, reference: Option<_>| {
            let found: Estimate = found?;
            Some(found.against(reference?))
                .filter(|found| found.error.is_finite() && found.noise.is_finite())
        };
        // The virial's part may be lost altogether; what counts is the share of the whole pressure.
        let errors = [
            against(measured.wall_pressure, reference.wall_pressure),
            against(measured.compressibility, reference.compressibility),
            against(measured.pair_rate, reference.pair_rate),
            against(measured.displacement, reference.displacement),
        ];
        Self {
            setting,
            measured,
            errors,
            faith,
            dominated_by: None,
        }
    }

    /// What must be taken for the error of pressure, collision rate, diffusion and viscosity: what was seen beyond noise, or the
    /// law if it says more.
    fn losses(&self) -> [f64; 4] {
        let [wall, virial, rate, diffusion] =
            self.errors.map(|error| error.map_or(0.0, Difference::seen));
        let law = self.setting.law;
        [
            wall.max(virial).max(law[0]),
            rate.max(law[1]),
            diffusion.max(law[2]),
            law[3],
        ]
    }

    /// Errors of the trajectories and of the way back; without any, no setting is worse.
    fn unfaithful(&self) -> [f64; 2] {
        self.faith.map_or([f64::INFINITY; 2], |faith| {
            [faith.distance[1], faith.echo[1]]
        })
    }

    /// Whether it is faster than another and no worse in anything.
    fn dominates(&self, other: &Self) -> bool {
        let no_worse = |a: &[f64], b: &[f64], slack: f64| {
            a.iter().zip(b).all(|(a, b)| *a <= slack * *b || a == b)
        };
        threads(self.setting.choice) <= threads(other.setting.choice)
            && self.measured.speed() >= FASTER * other.measured.speed()
            && no_worse(&self.losses(), &other.losses(), 1.0)
            && no_worse(&self.unfaithful(), &other.unfaithful(), ALIKE)
    }

    /// What an error is below: as measured, with twice its noise, and by law.
    fn bound(&self, quantity: Quantity) -> Option<f64> {
        let law = self.setting.law;
        let [wall, virial, rate, diffusion] = self.errors.map(|error| error.map(Difference::bound));
        let pressure = match (wall, virial) {
            (Some(wall), Some(virial)) => Some(wall.max(virial)),
            (wall, virial) => wall.or(virial),
        };
        if self.setting.is_exact() {
            return Some(0.0);
        }
        match quantity {
            Quantity::Pressure => Some(pressure?.max(law[0])),
            Quantity::All => Some(
                pressure?
                    .max(rate?)
                    .max(diffusion.unwrap_or(0.0))
                    .max(law.into_iter().fold(0.0, f64::max)),
            ),
        }
    }
}

/// What a user may want to be right.
#[derive(Clone, Copy, PartialEq)]
enum Quantity {
    Pressure,
    /// Pressure, collision rate, diffusion and viscosity.
    All,
}

/// Finds for every row another that is faster and as good; of several, the fastest.
pub fn mark(rows: &mut [Row]) {
    for row in 0..rows.len() {
        let better =
            (0..rows.len()).filter(|&other| other != row && rows[other].dominates(&rows[row]));
        rows[row].dominated_by = better.max_by(|&a, &b| {
            let speed = |row: usize| rows[row].measured.speed();
            speed(a).total_cmp(&speed(b))
        });
    }
}

fn percent(share: f64) -> String {
    format!(
        "{} %",
        plain(100.0 * share)
            .trim_end_matches('0')
            .trim_end_matches('.')
    )
}

/// What to take for what, in plain words, a paragraph each.
pub fn recommendations(rows: &[Row]) -> Vec<String> {
    let alone = || rows.iter().filter(|row| threads(row.setting.choice) == 1);
    // Of two that are about as fast, the first.
    let fastest = |rows: &mut dyn Iterator<Item = &Row>| {
        rows.fold(None::<&Row>, |best, row| match best {
            Some(best) if row.measured.speed() < FASTER * best.measured.speed() => Some(best),
            _ => Some(row),
        })
        .cloned()
    };
    let Some(exact) = fastest(&mut alone().filter(|row| row.setting.is_exact())) else {
        return Vec::new();
    };
    let mut words = Vec::new();
    for (quantity, name) in [
        (Quantity::Pressure, "pressure"),
        (
            Quantity::All,
            "pressure, collision rate, diffusion and viscosity",
        ),
    ] {
        let mut parts: Vec<(String, String)> = Vec::new();
        for share in SHARES {
            let good = |row: &&Row| row.bound(quantity).is_some_and(|bound| bound <= share);
            let best = fastest(&mut alone().filter(good)).unwrap_or_else(|| exact.clone());
            let ratio = best.measured.speed() / exact.measured.speed();
            let mut text = best.setting.name.clone();
            if best.setting.is_exact() {
                text.push_str(", which is exact");
            } else {
                text = format!(
                    "{text}: {} times as fast as {}",
                    plain_ratio(ratio),
                    exact.setting.name
                );
            }
            // Faster ones that keep to it by what was seen, but not beyond doubt.
            let undecided = alone().any(|row| {
                let losses = row.losses();
                let seen = match quantity {
                    Quantity::Pressure => losses[0],
                    Quantity::All => losses.into_iter().fold(0.0, f64::max),
                };
                !good(&row)
                    && seen <= share
                    && !row.setting.is_exact()
                    && row.measured.speed() > FASTER * best.measured.speed()
            });
            if undecided {
                text.push_str(
                    " (a faster setting may do, but the noise of this run is too large to tell)",
                );
            }
            match parts.last_mut().filter(|part| part.1 == text) {
                Some(part) => part.0 = format!("{} or {}", part.0, percent(share)),
                None => parts.push((percent(share), text)),
            }
        }
        let parts: Vec<String> = parts
            .into_iter()
            .map(|(share, text)| format!("within {share}, {text}"))
            .collect();
        words.push(format!("For {name}: {}.", parts.join("; ")));
    }
    words.push(faithful(rows, &exact));
    let dominated: Vec<&str> = rows
        .iter()
        .filter(|row| row.dominated_by.is_some())
        .map(|row| row.setting.name.as_str())
        .collect();
    if !dominated.is_empty() {
        words.push(format!(
            "Not worth taking, for another is faster and no worse: {}.",
            dominated.join("; ")
        ));
    }
    words
}

/// What to take for trajectories and for reversal.
fn faithful(rows: &[Row], exact: &Row) -> String {
    let mut text = format!(
        "For trajectories, the radial distribution function and single balls: {}",
        exact.setting.name
    );
    let reversible = rows
        .iter()
        .find(|row| row.setting.choice == Choice::Reversible);
    if let Some(reversible) = reversible {
        let slower = exact.measured.speed() / reversible.measured.speed();
        let pace = if slower >= 1.0 {
            format!("{} times slower", plain_ratio(slower))
        } else {
            format!("{} times faster", plain_ratio(1.0 / slower))
        };
        text = match reversible.faith.map(|faith| faith.echo[1]) {
            Some(0.0) => format!(
                "{text}; for a reversal that finds the way back, however late: reversible ({pace}, every bit came back)"
            ),
            _ => format!("{text}; for reversal: reversible ({pace})"),
        };
    }
    text + "."
}

fn plain_ratio(ratio: f64) -> String {
    if ratio >= 10.0 {
        format!("{ratio:.0}")
    } else {
        format!("{ratio:.1}")
    }
}

/// What `--accuracy` promises beside what was found.
pub struct Promise {
    /// As `--accuracy` takes it.
    pub accuracy: &'static str,
    /// The setting it chooses.
    pub setting: String,
    /// The largest error by the laws.
    pub law: f64,
    /// The largest error measured, and its noise.
    pub found: Option<Difference>,
    /// In a word.
    pub verdict: &'static str,
}

/// Holds a promise against the row of its choice.
pub fn promise(accuracy: Accuracy, name: &'static str, row: Option<&Row>) -> Promise {
    let Some(row) = row.filter(|row| !row.setting.is_exact()) else {
        return Promise {
            accuracy: name,
            setting: "an exact engine".to_owned(),
            law: 0.0,
            found: None,
            verdict: "kept: exact",
        };
    };
    let share = accuracy.share();
    let errors = || row.errors.iter().flatten();
    let found = errors()
        .copied()
        .max_by(|a, b| a.bound().total_cmp(&b.bound()));
    let broken = errors().any(|error| error.error.abs() - 2.0 * error.noise > share);
    let verdict = match found {
        _ if broken => "broken",
        Some(found) if found.bound() <= share => "kept",
        Some(_) => "not broken, within noise",
        None => "not measured",
    };
    Promise {
        accuracy: name,
        setting: row.setting.name.clone(),
        law: row.setting.law.into_iter().fold(0.0, f64::max),
        found,
        verdict,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row with its speed, its error of every average in percent with its noise, and what its law says.
    fn row(choice: Choice, speed: f64, (error, noise): (f64, f64), law: f64) -> Row {
        let exact = matches!(choice, Choice::Event(_));
        Row {
            setting: Setting {
                name: format!("{} at {speed}", choice.name()),
                choice,
                law: [law; 4],
            },
            measured: Measured {
                seconds: 1.0,
                time: speed,
                ..Measured::default()
            },
            errors: [Some(Difference {
                error: error / 100.0,
                noise: noise / 100.0,
            }); 4],
            faith: exact.then(Faith::default),
            dominated_by: None,
        }
    }

    fn statistical(step: f64) -> Choice {
        Choice::Statistical {
            resolution: crate::engine::statistical::Resolution { step, cell: 0.3 },
            seed: 1,
            threads: 1,
        }
    }

    /// An exact engine, a slower inexact one, and three faster by chance: good, rough, and not known well enough.
    fn rows() -> Vec<Row> {
        let mut rows = vec![
            row(Choice::default(), 1.0, (0.0, 0.01), 0.0),
            row(Choice::Step(0.1), 0.5, (-2.0, 0.1), 0.0),
            row(statistical(0.2), 10.0, (0.1, 0.1), 0.005),
            row(statistical(1.0), 20.0, (3.0, 0.1), 0.03),
            row(statistical(0.5), 15.0, (0.5, 1.0), 0.008),
        ];
        mark(&mut rows);
        rows
    }

    #[test]
    fn only_what_is_slower_and_no_better_is_dominated() {
        let dominated: Vec<_> = rows().iter().map(|row| row.dominated_by).collect();
        assert_eq!(dominated, [None, Some(0), None, None, None]);
    }

    #[test]
    fn only_what_is_known_beyond_noise_is_recommended() {
        let words = recommendations(&rows());
        assert_eq!(
            words[0],
            "For pressure: within 10 %, statistical at 20: 20 times as fast as event at 1; within 1 %, statistical at 10: 10 \
             times as fast as event at 1 (a faster setting may do, but the noise of this run is too large to tell); within \
             0.1 %, event at 1, which is exact."
        );
        assert!(words[3].ends_with("no worse: step at 0.5."), "{}", words[3]);
    }

    #[test]
    fn a_promise_is_kept_broken_or_undecided() {
        let rows = rows();
        let verdict = |accuracy, row| promise(accuracy, "", Some(row)).verdict;
        assert_eq!(verdict(Accuracy::One, &rows[2]), "kept");
        assert_eq!(verdict(Accuracy::One, &rows[3]), "broken");
        assert_eq!(verdict(Accuracy::One, &rows[4]), "not broken, within noise");
        assert_eq!(verdict(Accuracy::Tenth, &rows[0]), "kept: exact");
    }
}
