//! The recent paths of the tagged molecules, kept from one snapshot to the next.
//!
//! A trail grows with simulated time, never with frames: while the run is paused nothing is added.

use std::collections::VecDeque;

use crate::snapshot::Snapshot;

/// Most molecules that are tagged.
pub const MOST_TAGS: usize = 5;
/// Points of a trail that goes straight.
const MOST_POINTS: usize = 24;
/// Longest trail, and longest step taken as one flight, in mean edges of the container.
const LONGEST: f64 = 0.25;

/// Paths of the tagged molecules, newest point first.
#[derive(Clone, Debug, Default)]
pub struct Trails {
    paths: Vec<VecDeque<[f64; 3]>>,
    time: Option<f64>,
    scene: String,
}

impl Trails {
    /// Adds the positions of a snapshot.
    pub fn record(&mut self, snapshot: &Snapshot) {
        let Some(sample) = &snapshot.sample else {
            return;
        };
        let tags = tag_count(&sample.names, sample.positions.len());
        let went_back = self.time.is_some_and(|time| snapshot.time < time);
        if self.paths.len() != tags || self.scene != snapshot.scene.title || went_back {
            *self = Self {
                paths: vec![VecDeque::new(); tags],
                time: None,
                scene: snapshot.scene.title.clone(),
            };
        }
        if self.time == Some(snapshot.time) {
            return;
        }
        self.time = Some(snapshot.time);
        let longest = LONGEST * mean_edge(snapshot.scene.size);
        for (path, position) in self.paths.iter_mut().zip(&sample.positions) {
            extend(path, position.map(f64::from), longest);
        }
    }

    /// The path of a tagged molecule, newest point first.
    pub fn path(&self, tag: usize) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.paths.get(tag).into_iter().flatten().copied()
    }
}

/// How many molecules at the head of the sample are tagged: those with names, or else the first few.
pub fn tag_count(names: &[String], sample_length: usize) -> usize {
    let wanted = if names.is_empty() {
        MOST_TAGS
    } else {
        names.len().min(MOST_TAGS)
    };
    wanted.min(sample_length)
}

/// Edge of the cube of the same volume \[length\].
pub fn mean_edge(size: [f64; 3]) -> f64 {
    size.iter().product::<f64>().cbrt()
}

fn extend(path: &mut VecDeque<[f64; 3]>, position: [f64; 3], longest: f64) {
    // After a long step the molecule may have collided in between: a straight line would tell a tale.
    if path
        .front()
        .is_some_and(|last| distance(*last, position) > longest)
    {
        path.clear();
    }
    // The head moves with the molecule, and stays behind as a knot when it has come some way.
    let spacing = longest / MOST_POINTS as f64;
    if path.len() > 1 && distance(path[0], path[1]) < spacing {
        path.pop_front();
    }
    path.push_front(position);
    let mut length = 0.0;
    let mut keep = 1;
    while keep < path.len().min(2 * MOST_POINTS) {
        length += distance(path[keep - 1], path[keep]);
        if length > longest {
            break;
        }
        keep += 1;
    }
    path.truncate(keep);
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trail_keeps_to_its_length() {
        let mut path = VecDeque::new();
        for step in 0..100 {
            extend(&mut path, [f64::from(step) * 0.1, 0.0, 0.0], 1.05);
        }
        assert_eq!(path.len(), 11);
        assert!((path[0][0] - 9.9).abs() < 1e-12);
    }

    #[test]
    fn a_trail_is_as_long_when_the_run_is_slow() {
        let mut path = VecDeque::new();
        for step in 0..10_000 {
            extend(&mut path, [f64::from(step) * 0.001, 0.0, 0.0], 1.05);
        }
        let tail = path[path.len() - 1][0];
        assert!((0.9..=1.05).contains(&(9.999 - tail)), "{tail}");
    }

    #[test]
    fn a_leap_starts_a_new_trail() {
        let mut path = VecDeque::new();
        extend(&mut path, [0.0; 3], 1.0);
        extend(&mut path, [5.0, 0.0, 0.0], 1.0);
        assert_eq!(path.len(), 1);
    }
}
