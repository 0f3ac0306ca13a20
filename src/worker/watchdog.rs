//! Looks at each snapshot for what should not be: a figure of the accuracy card beyond its limit, a run that has become slow.
//! Each is logged once, and again only after it was well meanwhile.

use clap::ValueEnum;

use crate::snapshot::{Phase, Snapshot};

/// Share of its usual speed below which a run is slow.
const SLOW: f64 = 0.7;

/// Share of its usual speed above which it is so no more.
const WELL: f64 = 0.85;

/// What a run does once a figure of its accuracy card is beyond its limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum OnTrouble {
    /// Pause.
    Pause,
    /// Write a checkpoint, and go on.
    Checkpoint,
    /// End, as failed.
    Stop,
    /// Go on.
    #[default]
    Ignore,
}

/// What has been found so far.
#[derive(Debug, Default)]
pub struct Watchdog {
    unsound: Vec<&'static str>,
    slow: bool,
}

impl Watchdog {
    /// Looks at the run as it is now, with its usual collisions per wall second; gives back what has come to be wrong with its
    /// accuracy since the last look.
    pub fn look(&mut self, run: &Snapshot, usual: Option<f64>) -> Option<String> {
        self.look_at_speed(run, usual);
        if run.is_approximate() {
            return None; // its errors are the price of its steps
        }
        let card = run.accuracy();
        let before = std::mem::take(&mut self.unsound);
        let mut trouble = None;
        for check in card.iter().filter(|check| !check.sound) {
            self.unsound.push(check.name);
            if let Some(value) = check.value
                && !before.contains(&check.name)
            {
                let words = format!(
                    "{} {value:.2e}: the limit is {:.0e}",
                    check.name, check.limit
                );
                tracing::warn!("{words}");
                trouble.get_or_insert(words);
            }
        }
        trouble
    }

    fn look_at_speed(&mut self, run: &Snapshot, usual: Option<f64>) {
        let held_back = run.phase != Phase::Running || run.time_rate_limit.is_some();
        let Some((now, usual)) = run
            .collisions_per_wall_second
            .zip(usual)
            .filter(|_| !held_back)
        else {
            return;
        };
        let share = now / usual;
        if share < SLOW && !self.slow {
            tracing::warn!(
                "slow: {now:.3e} collisions per second, {:.0} % of what is usual in this run",
                100.0 * share
            );
        }
        self.slow = share < if self.slow { WELL } else { SLOW };
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::snapshot::SceneCard;

    fn running() -> Snapshot {
        Snapshot {
            phase: Phase::Running,
            collisions_per_wall_second: Some(1000.0),
            ..Snapshot::starting(Arc::new(SceneCard::default()), "event", None)
        }
    }

    #[test]
    fn each_trouble_is_told_once_and_by_its_name() {
        let mut watchdog = Watchdog::default();
        assert_eq!(watchdog.look(&running(), None), None);
        let mut drifted = running();
        drifted.energy_drift = Some(3e-9);
        let words = watchdog.look(&drifted, None);
        assert_eq!(
            words.as_deref(),
            Some("energy drift 3.00e-9: the limit is 1e-12")
        );
        assert_eq!(watchdog.look(&drifted, None), None);
        assert_eq!(watchdog.look(&running(), None), None);
        assert!(watchdog.look(&drifted, None).is_some());
        drifted.engine = "step".into();
        assert_eq!(Watchdog::default().look(&drifted, None), None);
    }

    #[test]
    fn a_run_is_slow_below_seven_tenths_of_its_usual_speed_unless_it_is_held_back() {
        let mut watchdog = Watchdog::default();
        for (usual, slow) in [
            (1400.0, false),
            (1500.0, true),
            (1300.0, true),
            (1100.0, false),
        ] {
            watchdog.look(&running(), Some(usual));
            assert_eq!(watchdog.slow, slow, "{usual}");
        }
        let mut limited = running();
        limited.time_rate_limit = Some(1.0);
        watchdog.look(&limited, Some(1e6));
        assert!(!watchdog.slow);
    }
}
