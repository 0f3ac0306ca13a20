//! Numbers for people: four digits, SI prefixes, durations.

use crate::snapshot::Units;

/// What a number measures; it decides the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Simulated time.
    Time,
    /// Length.
    Length,
    /// Temperature.
    Temperature,
    /// Pressure.
    Pressure,
    /// Events per simulated time.
    Rate,
}

impl Quantity {
    fn symbol(self) -> &'static str {
        match self {
            Self::Time => "s",
            Self::Length => "m",
            Self::Temperature => "K",
            Self::Pressure => "Pa",
            Self::Rate => "/s",
        }
    }
}

/// A number with its unit: `98.80 kPa` in SI, `0.3755` in reduced units.
pub fn quantity(value: f64, kind: Quantity, units: Units) -> String {
    match (units, kind) {
        (Units::Reduced, _) => plain(value),
        (Units::Si, Quantity::Rate) => format!("{} /s", plain(value)),
        (Units::Si, Quantity::Temperature) => format!("{value:.2} K"),
        (Units::Si, _) => format!("{}{}", prefixed(value), kind.symbol()),
    }
}

/// Four digits, with an exponent only where they would not show.
pub fn plain(value: f64) -> String {
    // Rounded first, so that 0.99999 is shown with the digits of 1.
    let scientific = format!("{value:.3e}");
    let exponent: i32 = scientific
        .rsplit('e')
        .next()
        .and_then(|digits| digits.parse().ok())
        .unwrap_or(0);
    match exponent {
        _ if value == 0.0 => "0".to_owned(),
        -3..=4 => format!("{value:.*}", (3 - exponent).max(0) as usize),
        _ => scientific,
    }
}

/// Four digits and an SI prefix, ready for a unit's symbol.
fn prefixed(value: f64) -> String {
    const PREFIXES: [(&str, f64); 11] = [
        ("G", 1e9),
        ("M", 1e6),
        ("k", 1e3),
        ("", 1.0),
        ("m", 1e-3),
        ("µ", 1e-6),
        ("n", 1e-9),
        ("p", 1e-12),
        ("f", 1e-15),
        ("a", 1e-18),
        ("z", 1e-21),
    ];
    // A value that four digits round up to the next prefix belongs there: 1.000 ns, not 1000 ps.
    match PREFIXES
        .iter()
        .find(|(_, size)| value.abs() >= 0.999_95 * size)
    {
        Some((prefix, size)) if value.abs() < 1e13 => format!("{} {prefix}", plain(value / size)),
        _ => format!("{} ", plain(value)),
    }
}

/// A wall-clock duration: `0.42 s`, `3 min 20 s`, `18 h 50 min`, `24 d 3 h`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    let (minutes, hours, days) = (whole / 60, whole / 3600, whole / 86400);
    match whole {
        0..10 => format!("{seconds:.2} s"),
        10..60 => format!("{whole} s"),
        60..3600 => format!("{minutes} min {} s", whole % 60),
        3600..86400 => format!("{hours} h {} min", minutes % 60),
        _ if days < 10_000 => format!("{days} d {} h", hours % 24),
        _ => format!("{} years", plain(seconds / 31_557_600.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits_and_a_prefix() {
        let si = |value, kind| quantity(value, kind, Units::Si);
        assert_eq!(si(98_804.0, Quantity::Pressure), "98.80 kPa");
        assert_eq!(si(2e-5, Quantity::Time), "20.00 µs");
        assert_eq!(si(1e-9, Quantity::Time), "1.000 ns");
        assert_eq!(si(0.999_999e-9, Quantity::Time), "1.000 ns");
        assert_eq!(si(0.0, Quantity::Time), "0 s");
        assert_eq!(si(2.087e15, Quantity::Rate), "2.087e15 /s");
        assert_eq!(si(273.15, Quantity::Temperature), "273.15 K");
        assert_eq!(
            quantity(0.3755, Quantity::Pressure, Units::Reduced),
            "0.3755"
        );
    }

    #[test]
    fn durations_have_two_units() {
        let shown = [0.424, 59.4, 200.0, 67_800.0, 2_084_400.0, 1e12].map(duration);
        assert_eq!(
            shown,
            [
                "0.42 s",
                "59 s",
                "3 min 20 s",
                "18 h 50 min",
                "24 d 3 h",
                "31688 years"
            ]
        );
    }
}
