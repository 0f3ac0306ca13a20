//! A run's history in constant memory: when it is full, neighbouring points merge and each new one covers twice as long.

use std::sync::Arc;

use crate::snapshot::HistoryPoint;

/// Most points kept.
pub const MOST_POINTS: usize = 512;

/// The history of a run, oldest first.
#[derive(Clone, Debug, Default)]
pub struct History {
    points: Arc<Vec<HistoryPoint>>,
    /// Intervals that a complete point covers, as a power of two.
    doublings: u32,
    /// Intervals that the last point covers so far.
    last_covers: u32,
}

impl History {
    /// The points so far.
    pub fn points(&self) -> Arc<Vec<HistoryPoint>> {
        Arc::clone(&self.points)
    }

    /// Adds what was measured over one more interval.
    pub fn push(&mut self, point: HistoryPoint) {
        let points = Arc::make_mut(&mut self.points);
        if let Some(last) = points.last_mut()
            && self.last_covers < 1 << self.doublings
        {
            *last = mean(*last, f64::from(self.last_covers), point);
            self.last_covers += 1;
            return;
        }
        if points.len() == MOST_POINTS {
            *points = points
                .chunks(2)
                .map(|pair| mean(pair[0], 1.0, pair[1]))
                .collect();
            self.doublings += 1;
        }
        points.push(point);
        self.last_covers = 1;
    }
}

/// The mean of `older`, which counts `weight` times, and `newer`, at the time of the newer.
fn mean(older: HistoryPoint, weight: f64, newer: HistoryPoint) -> HistoryPoint {
    let mean = |older: f64, newer: f64| (weight * older + newer) / (weight + 1.0);
    HistoryPoint {
        time: newer.time,
        temperature: mean(older.temperature, newer.temperature),
        pressure: mean(older.pressure, newer.pressure),
        pair_rate: mean(older.pair_rate, newer.pair_rate),
        queue_length: mean(older.queue_length, newer.queue_length),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_history_stays_bounded_and_keeps_its_mean() {
        let mut history = History::default();
        for interval in 0..MOST_POINTS * 8 {
            let value = interval as f64;
            history.push(HistoryPoint {
                time: value,
                temperature: value,
                pressure: 1.0,
                pair_rate: 2.0,
                queue_length: 3.0,
            });
        }
        let points = history.points();
        assert!(points.len() <= MOST_POINTS && points.len() > MOST_POINTS / 2);
        assert!(points.windows(2).all(|pair| pair[0].time < pair[1].time));
        let mean = points.iter().map(|point| point.temperature).sum::<f64>() / points.len() as f64;
        assert_eq!(mean, (MOST_POINTS * 8 - 1) as f64 / 2.0);
    }
}
