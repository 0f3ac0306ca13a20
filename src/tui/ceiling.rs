//! Ceilings on the rate of simulated time: the row 1, 2, 5, 10, ...

/// Whether a number can be a rate.
pub fn is_rate(rate: f64) -> bool {
    rate.is_normal() && rate > 0.0
}

/// Next lower number of the row 1, 2, 5, 10, ... ; a number of the row goes to the one before.
pub fn step_below(value: f64) -> f64 {
    let exponent = value.log10().floor() as i32;
    row(exponent)
        .rev()
        .find(|step| *step < value * (1.0 - 1e-9))
        .unwrap_or(value / 2.0)
}

/// Next higher number of that row.
pub fn step_above(value: f64) -> f64 {
    let exponent = value.log10().floor() as i32;
    row(exponent)
        .find(|step| *step > value * (1.0 + 1e-9))
        .unwrap_or(value * 2.0)
}

fn row(exponent: i32) -> impl DoubleEndedIterator<Item = f64> {
    (exponent - 1..=exponent + 1)
        .flat_map(|power| [1.0, 2.0, 5.0].map(|digit| decimal_power(digit, power)))
}

/// `digit * 10^power`, correctly rounded, which a product is not.
fn decimal_power(digit: f64, power: i32) -> f64 {
    format!("{digit}e{power}")
        .parse()
        .expect("a digit and a power of ten make a number")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ceilings_go_down_and_up_the_row_of_one_two_five() {
        assert_eq!(step_below(2.9e-10), 2e-10);
        assert_eq!(step_below(2e-10), 1e-10);
        assert_eq!(step_below(1e-10), 5e-11);
        assert_eq!(step_above(5e-11), 1e-10);
        assert_eq!(step_above(2.9e-10), 5e-10);
        assert_eq!(step_below(1.0), 0.5);
        assert_eq!(step_above(5.0), 10.0);
    }
}
