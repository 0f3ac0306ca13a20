//! Numbers as text: SI prefixes, fixed numbers of digits, durations.
//!
//! Always holds: a missing or non-finite value is [`MISSING`], and a value keeps its width while its digits change.

use crate::snapshot::Units;

/// Stands where a value does not exist yet.
pub const MISSING: &str = "–";

/// Prefixes of powers of a thousand, from 1e-30 to 1e30. Source: the SI brochure, 9th edition, update of 2022.
const PREFIXES: [&str; 21] = [
    "q", "r", "y", "z", "a", "f", "p", "n", "µ", "m", "", "k", "M", "G", "T", "P", "E", "Z", "Y",
    "R", "Q",
];

/// A number with `digits` significant digits, an SI prefix and its unit: `98.83 kPa`.
pub fn si(value: f64, unit: &str, digits: usize) -> String {
    let Some((digits_shown, exponent)) = decimal(value, digits) else {
        return MISSING.into();
    };
    let group = exponent.div_euclid(3);
    let Some(prefix) = usize::try_from(group + 10)
        .ok()
        .and_then(|i| PREFIXES.get(i))
    else {
        return format!("{} {unit}", scientific(value, digits));
    };
    let mantissa = with_point(&digits_shown, exponent.rem_euclid(3) as usize + 1);
    let sign = if value < 0.0 { "-" } else { "" };
    let gap = if prefix.is_empty() && unit.is_empty() {
        ""
    } else {
        " "
    };
    format!("{sign}{mantissa}{gap}{prefix}{unit}")
}

/// A number without prefix: as it is between 0.001 and a million, else with a power of ten.
pub fn plain(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".into();
    }
    match decimal(value, digits) {
        None => MISSING.into(),
        Some((_, exponent)) if (-3..6).contains(&exponent) => {
            let decimals = digits
                .saturating_sub(1)
                .saturating_add_signed(-exponent as isize);
            format!("{value:.decimals$}")
        }
        Some(_) => scientific(value, digits),
    }
}

/// A number with a power of ten: `2.088e15`.
pub fn scientific(value: f64, digits: usize) -> String {
    if value.is_finite() {
        format!("{value:.*e}", digits.max(1) - 1)
    } else {
        MISSING.into()
    }
}

/// A quantity in the scene's units: with prefix and unit in SI, bare in reduced units.
pub fn quantity(value: Option<f64>, unit: &str, units: Units, digits: usize) -> String {
    match (value, units) {
        (None, _) => MISSING.into(),
        (Some(value), Units::Si) => si(value, unit, digits),
        (Some(value), Units::Reduced) => plain(value, digits),
    }
}

/// A value with its standard error, both with as many decimals as the error deserves: `98.831 ±0.034 kPa`.
pub fn with_error(value: Option<f64>, error: Option<f64>, unit: &str, units: Units) -> String {
    let (Some(value), Some(error)) = (value, error) else {
        return quantity(value, unit, units, 4);
    };
    let group = match (decimal(value, 4), units) {
        (Some((_, exponent)), Units::Si) => exponent.div_euclid(3).clamp(-10, 10),
        _ => 0,
    };
    let scale = 10_f64.powi(3 * group);
    let (value, error) = (value / scale, error / scale);
    if !value.is_finite() || !error.is_finite() || !(1e-9..1e9).contains(&value.abs()) {
        return quantity(Some(value * scale), unit, units, 4);
    }
    // Two digits of the error; never fewer than three decimals of a small number, so that the field rests.
    let decimals = decimal(error, 2).map_or(3, |(_, exponent)| (1 - exponent).clamp(0, 7)) as usize;
    let prefix = PREFIXES[(group + 10) as usize];
    match units {
        Units::Si => format!("{value:.decimals$} ±{error:.decimals$} {prefix}{unit}"),
        Units::Reduced => format!("{value:.decimals$} ±{error:.decimals$}"),
    }
}

/// A count: grouped by thousands up to ten million, with a prefix above.
pub fn count(value: u64) -> String {
    if value >= 10_000_000 {
        return si(value as f64, "", 4);
    }
    let digits = value.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

/// A small relative number such as a drift: two digits and a power of ten, or `0`.
pub fn relative(value: Option<f64>) -> String {
    match value {
        Some(0.0) => "0".into(),
        Some(value) => scientific(value, 2),
        None => MISSING.into(),
    }
}

/// Measured against expected, in standard errors: `+1.0σ`.
pub fn sigmas(measured: Option<f64>, expected: Option<f64>, error: Option<f64>) -> Option<String> {
    let deviation = (measured? - expected?) / error?;
    let shown = deviation.clamp(-99.9, 99.9);
    deviation.is_finite().then(|| format!("{shown:+.1}σ"))
}

/// Measured against expected, in per cent of the expected: `+0.05 %`.
pub fn percent_off(measured: Option<f64>, expected: Option<f64>) -> Option<String> {
    let percent = 100.0 * (measured? / expected? - 1.0);
    let decimals = if percent.abs() < 10.0 { 2 } else { 0 };
    let shown = percent.clamp(-999.0, 999.0);
    percent
        .is_finite()
        .then(|| format!("{shown:+.decimals$} %"))
}

/// Wall time as a clock: `00:00:43`, after a day `3d 04:05`; in the first ten seconds `   0.3 s`.
pub fn clock(seconds: f64) -> String {
    if !seconds.is_finite() || seconds < 0.0 {
        return MISSING.into();
    }
    if seconds < 9.95 {
        return format!("{seconds:>6.1} s");
    }
    let seconds = seconds as u64;
    let (days, hours, minutes) = (seconds / 86_400, seconds / 3_600 % 24, seconds / 60 % 60);
    if days > 0 {
        format!("{days}d {hours:02}:{minutes:02}")
    } else {
        format!("{hours:02}:{minutes:02}:{:02}", seconds % 60)
    }
}

/// A duration as coarse as an estimate deserves, and its unit: `43 s`, `12 min`, `18 h 50`, `3.2 d`.
fn rough(seconds: f64) -> (String, &'static str) {
    let whole = seconds.round() as u64;
    let days = seconds / 86_400.0;
    match whole {
        0..100 => (whole.to_string(), " s"),
        100..6_000 => ((whole / 60).to_string(), " min"),
        6_000..172_800 => (format!("{} h {:02}", whole / 3_600, whole / 60 % 60), ""),
        172_800..864_000 => (format!("{days:.1}"), " d"),
        864_000..86_400_000 => (format!("{days:.0}"), " d"),
        86_400_000..31_557_600_000 => (format!("{:.0}", days / 365.25), " y"),
        _ => ("1000".into(), " y or more"),
    }
}

/// A range of durations in at most 18 characters: `18 h 50 to 19 h 40`, `26 to 33 d`; one duration when both read alike.
pub fn duration_range((low, high): (f64, f64)) -> String {
    let good = |seconds: f64| seconds.is_finite() && seconds >= 0.0;
    if !good(low) || !good(high) {
        return MISSING.into();
    }
    let ((low, low_unit), (high, high_unit)) = (rough(low), rough(high));
    if low_unit != high_unit {
        format!("{low}{low_unit} to {high}{high_unit}")
    } else if low == high {
        format!("{low}{low_unit}")
    } else {
        format!("{low} to {high}{high_unit}")
    }
}

/// A number of bytes with a prefix.
pub fn bytes(value: Option<u64>) -> String {
    value.map_or(MISSING.into(), |value| si(value as f64, "B", 3))
}

/// Significant digits without point, and the exponent of the first; `None` unless finite. Rounding comes first, so that
/// 999.96 carries over to 1.000 k.
fn decimal(value: f64, digits: usize) -> Option<(String, i32)> {
    if !value.is_finite() {
        return None;
    }
    let text = format!("{:.*e}", digits.max(1) - 1, value.abs());
    let (mantissa, exponent) = text.split_once('e')?;
    Some((mantissa.replace('.', ""), exponent.parse().ok()?))
}

fn with_point(digits: &str, whole: usize) -> String {
    if digits.len() > whole {
        format!("{}.{}", &digits[..whole], &digits[whole..])
    } else {
        format!("{digits:0<whole$}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_keep_the_number_of_digits() {
        assert_eq!(si(1.248e-8, "s", 4), "12.48 ns");
        assert_eq!(si(2.0e-5, "s", 4), "20.00 µs");
        assert_eq!(si(98_830.0, "Pa", 4), "98.83 kPa");
        assert_eq!(si(273.15, "K", 5), "273.15 K");
        assert_eq!(si(-0.5, "m", 2), "-500 mm");
        assert_eq!(si(0.0, "s", 4), "0.000 s");
    }

    #[test]
    fn rounding_carries_into_the_next_prefix() {
        assert_eq!(si(999.96, "s", 4), "1.000 ks");
        assert_eq!(si(999.94, "s", 4), "999.9 s");
    }

    #[test]
    fn beyond_the_prefixes_a_power_of_ten_stands() {
        assert_eq!(si(1e40, "s", 3), "1.00e40 s");
        assert_eq!(si(1e-40, "s", 3), "1.00e-40 s");
    }

    #[test]
    fn what_is_not_a_number_is_a_dash() {
        assert_eq!(si(f64::NAN, "s", 4), MISSING);
        assert_eq!(plain(f64::INFINITY, 4), MISSING);
        assert_eq!(quantity(None, "s", Units::Si, 4), MISSING);
        assert_eq!(sigmas(Some(1.0), Some(1.0), Some(0.0)), None);
    }

    #[test]
    fn reduced_units_are_bare() {
        assert_eq!(quantity(Some(1.5), "s", Units::Reduced, 4), "1.500");
        assert_eq!(quantity(Some(0.0), "s", Units::Reduced, 4), "0");
        assert_eq!(quantity(Some(1.5e7), "s", Units::Reduced, 4), "1.500e7");
    }

    #[test]
    fn value_and_error_share_prefix_and_decimals() {
        let shown = with_error(Some(98_831.2), Some(34.0), "Pa", Units::Si);
        assert_eq!(shown, "98.831 ±0.034 kPa");
        let shown = with_error(Some(1.234_5), Some(0.012), "", Units::Reduced);
        assert_eq!(shown, "1.234 ±0.012");
        let shown = with_error(Some(98_831.2), None, "Pa", Units::Si);
        assert_eq!(shown, "98.83 kPa");
    }

    #[test]
    fn counts_are_grouped() {
        assert_eq!(count(7), "7");
        assert_eq!(count(47_312), "47 312");
        assert_eq!(count(9_999_999), "9 999 999");
        assert_eq!(count(26_060_000_000), "26.06 G");
    }

    #[test]
    fn durations_are_as_coarse_as_estimates() {
        assert_eq!(duration_range((40.0, 40.2)), "40 s");
        assert_eq!(duration_range((50.0, 720.0)), "50 s to 12 min");
        assert_eq!(duration_range((67_800.0, 70_800.0)), "18 h 50 to 19 h 40");
        assert_eq!(duration_range((2_217_600.0, 2_869_200.0)), "26 to 33 d");
        assert_eq!(duration_range((273_600.0, 1e15)), "3.2 d to 1000 y or more");
        assert_eq!(duration_range((f64::NAN, 1.0)), MISSING);
    }

    #[test]
    fn the_clock_keeps_its_width() {
        assert_eq!(clock(0.32), "   0.3 s");
        assert_eq!(clock(9.96), "00:00:09");
        assert_eq!(clock(43.9), "00:00:43");
        assert_eq!(clock(273_906.0), "3d 04:05");
    }

    #[test]
    fn deviations_carry_their_sign() {
        assert_eq!(
            sigmas(Some(2.0), Some(1.0), Some(0.5)).as_deref(),
            Some("+2.0σ")
        );
        assert_eq!(
            percent_off(Some(0.99), Some(1.0)).as_deref(),
            Some("-1.00 %")
        );
    }
}
