//! Straight lines through points, and the middle of several measurements.

/// Slope of a straight line through points, by least squares.
pub fn slope(points: &[(f64, f64)]) -> f64 {
    slope_and_error(points).0
}

/// Slope of a straight line through points, by least squares, and its standard error from how they scatter about the line; that is
/// no number for fewer than three.
///
/// Source: derived here.
pub fn slope_and_error(points: &[(f64, f64)]) -> (f64, f64) {
    let count = points.len() as f64;
    let (x, y) = points
        .iter()
        .fold((0.0, 0.0), |(x, y), point| (x + point.0, y + point.1));
    let (x, y) = (x / count, y / count);
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        points
            .iter()
            .map(|point| of(point.0 - x, point.1 - y))
            .sum()
    };
    let squares = sum(&|x, _| x * x);
    let slope = sum(&|x, y| x * y) / squares;
    let residues = sum(&|x, y| (y - slope * x) * (y - slope * x));
    (slope, (residues / ((count - 2.0) * squares)).sqrt())
}

/// Exponent of a power law through points, by least squares of the logarithms; `None` for fewer than two.
pub fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let logarithms: Vec<_> = points
        .iter()
        .map(|&(x, y)| (libm::log(x), libm::log(y)))
        .collect();
    (points.len() > 1).then(|| slope(&logarithms))
}

/// The middle value; of an even number, the mean of the two in the middle.
///
/// # Panics
/// If there is none.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    if sorted.len() % 2 == 1 {
        sorted[middle]
    } else {
        f64::midpoint(sorted[middle - 1], sorted[middle])
    }
}

/// The least and the greatest value.
pub fn extent(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| {
            (low.min(value), high.max(value))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_slope_comes_from_the_scatter_about_the_line() {
        let line = [0.0, 1.0, 2.0].map(|x: f64| (x, 1.0 + 2.0 * x));
        assert_eq!(slope_and_error(&line), (2.0, 0.0));
        // Residues 1/6, -1/3, 1/6; sum of squares 1/6, over one degree of freedom and a sum of squares of x of 2.
        let (slope, error) = slope_and_error(&[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)]);
        assert!((slope - 0.5).abs() < 1e-15);
        assert!((error - (1.0_f64 / 12.0).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_power_law_has_its_exponent_and_the_middle_is_in_the_middle() {
        let points = [1.0, 2.0, 5.0, 7.0].map(|x: f64| (x, 3.0 * x * x));
        assert!((exponent(&points).expect("points") - 2.0).abs() < 1e-12);
        assert_eq!(exponent(&points[..1]), None);
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(extent(&[3.0, 1.0, 2.0]), (1.0, 3.0));
    }
}
