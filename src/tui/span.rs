//! Which part of the history the charts show.

/// Part of the run's history.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Span {
    /// Halvings of the whole run.
    pub halvings: u32,
    /// Simulated time at which it ends; `None` follows the run.
    pub end: Option<f64>,
}

/// Most halvings.
const MOST: u32 = 24;

impl Span {
    /// Beginning and end within the bounds of a history.
    pub fn of(&self, (begin, now): (f64, f64)) -> (f64, f64) {
        let length = self.length((begin, now));
        let end = self.end.unwrap_or(now).clamp(begin, now.max(begin));
        let end = end.max((begin + length).min(now));
        ((end - length).max(begin), end)
    }

    fn length(&self, (begin, now): (f64, f64)) -> f64 {
        (now - begin) / 2_f64.powi(self.halvings.cast_signed())
    }

    /// Shows half or twice as much.
    pub fn halve(&mut self, shorter: bool) {
        self.halvings = if shorter {
            (self.halvings + 1).min(MOST)
        } else {
            self.halvings.saturating_sub(1)
        };
        if self.halvings == 0 {
            self.end = None; // all of it is shown
        }
    }

    /// Goes back or forward by half of what is shown.
    pub fn go(&mut self, earlier: bool, bounds: (f64, f64)) {
        let (begin, end) = self.of(bounds);
        let half = (end - begin) / 2.0;
        let goal = if earlier { end - half } else { end + half };
        let first = bounds.0 + (end - begin);
        self.end = (goal < bounds.1).then_some(goal.max(first));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_run_is_shown_at_first_and_halves_from_its_end() {
        let mut span = Span::default();
        assert_eq!(span.of((0.0, 8.0)), (0.0, 8.0));
        span.halve(true);
        assert_eq!(span.of((0.0, 8.0)), (4.0, 8.0));
        assert_eq!(span.of((0.0, 16.0)), (8.0, 16.0));
        span.halve(false);
        assert_eq!(span, Span::default());
    }

    #[test]
    fn going_back_stops_at_the_beginning_and_forward_at_now() {
        let mut span = Span {
            halvings: 2,
            end: None,
        };
        let bounds = (0.0, 8.0);
        span.go(true, bounds);
        assert_eq!(span.of(bounds), (5.0, 7.0));
        assert_eq!(span.of((0.0, 8.5)), (4.875, 7.0)); // it stays where it is while the run goes on
        for _ in 0..20 {
            span.go(true, bounds);
        }
        assert_eq!(span.of(bounds), (0.0, 2.0));
        for _ in 0..20 {
            span.go(false, bounds);
        }
        assert_eq!(span.end, None);
    }

    #[test]
    fn bounds_that_are_no_numbers_do_no_harm() {
        let mut span = Span {
            halvings: 3,
            end: Some(1.0),
        };
        for bounds in [(0.0, 0.0), (2.0, 1.0), (0.0, f64::INFINITY)] {
            let _ = span.of(bounds);
            span.go(true, bounds);
            span.go(false, bounds);
        }
    }
}
