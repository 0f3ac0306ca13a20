//! The gas that all settings start from: one that has forgotten how it was placed.
//!
//! A dilute gas forgets in a few mean free times, a dense one not before its lattice has melted, which takes many. So the run
//! itself is asked: whether balls collide as often as before, have Maxwell's speeds and have left their places, or, as in a
//! crystal, stay about them for good.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::engine::windowed::Windowed;
use crate::experiment::progress::Progress;
use crate::experiment::trial::{EVENT, Trial, processor_seconds};
use crate::observe::speeds::Speeds;
use crate::scene::Scene;
use crate::scene::analysis::{Theory, temperature};
use crate::state::{Placement, State};
use crate::worker::engines::{Choice, thermal_speed};

/// Fewest mean free times; without collisions, times to cross the box.
const FEWEST: f64 = 5.0;

/// Most mean free times, where there are balls enough: what has not settled by then is in no hurry.
const MOST: f64 = 3000.0;

/// Most collisions of a gas of few balls.
const MOST_COLLISIONS: f64 = 1e6;

/// Mean free times between two looks, as a multiple of those before.
const LATER: f64 = 1.5;

/// Budgets in which it must have settled.
const PATIENCE: f64 = 8.0;

/// Processor seconds in which it may settle, however small the budget: the oxygen needs some twenty.
const LEAST_PATIENCE: f64 = 30.0;

/// Fewest balls for which a thread is worth its while.
const BALLS_PER_THREAD: usize = 20_000;

/// Standard errors by which the collisions of two quarters of the run may differ.
const STEADY: f64 = 2.0;

/// How well their ratio must be known, two standard errors.
const KNOWN: f64 = 0.02;

/// Root mean square way, in mean distances between neighbours, of balls that have left their places.
const LEFT: f64 = 0.7;

/// By how much that way may grow from look to look if balls are to stay about their places; balls that leave them get 1.2
/// times as far.
const STAYED: f64 = 1.1;

/// Slices in a mean free time.
const SLICES: f64 = 40.0;

/// Something that must hold.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Criterion {
    /// What it is about.
    pub what: String,
    /// What was found.
    pub found: f64,
    /// What it must be.
    pub limit: String,
    /// Whether it is.
    pub met: bool,
}

/// The gas that all settings start from.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Start {
    /// The gas.
    pub gas: Placement,
    /// Mean time between two collisions of a ball, or to cross the box if there are none; in the scene's units.
    pub free_time: f64,
    /// Simulated time it has settled for, in the scene's units.
    pub time: f64,
    /// Whether balls meet at all.
    pub collides: bool,
    /// What the rule has found at its last look.
    pub criteria: Vec<Criterion>,
}

impl Start {
    /// Runs a scene until it has settled, or the time for that is spent.
    pub fn settle(
        scene: &Scene,
        placed: &Placement,
        threads: usize,
        budget: f64,
        progress: &mut Progress,
    ) -> Self {
        let expected = temperature(placed, scene.units)
            .and_then(|temperature| Theory::new(placed, scene.units).at(temperature).pair_rate);
        let count = placed.positions.len() as f64;
        let crossing = 2.0 * placed.domain.half_size.max_element() / thermal_speed(placed);
        let guess = expected.map_or(crossing, |rate| count / (2.0 * rate).max(f64::MIN_POSITIVE));
        let guess = guess.min(crossing * 1e3);
        let choice = if Windowed::pays(placed) {
            Choice::Windowed(
                threads
                    .min(placed.positions.len() / BALLS_PER_THREAD)
                    .max(1),
            )
        } else {
            EVENT
        };
        let mut trial = Trial::new(choice, placed);
        let mut rule = Rule::new(trial.state());
        let began = processor_seconds();
        let mut criteria = Vec::new();
        let (mut slice, mut look) = (0_u32, FEWEST);
        let most = MOST.max(2.0 * MOST_COLLISIONS / count);
        while look <= most {
            slice += 1;
            let until = f64::from(slice) / SLICES;
            let spent = processor_seconds() - began;
            if progress.stopped()
                || spent > (PATIENCE * budget).max(LEAST_PATIENCE)
                || trial.try_run(until * guess, &mut |_| {}).is_err()
            {
                break; // no room to move: every engine will say so
            }
            rule.mark(trial.time(), trial.engine.counters().pair_collisions);
            progress.tell(0.0, "settling");
            if until >= look {
                criteria = rule.look(trial.state());
                if criteria.iter().all(|criterion| criterion.met) {
                    break;
                }
                look *= LATER;
            }
        }
        if criteria.is_empty() {
            // It has not come as far as the first look.
            criteria = rule.look(trial.state());
            criteria[0].met = false;
        }
        Self {
            gas: trial.state().placement(),
            free_time: rule.free_time().unwrap_or(guess),
            time: trial.time(),
            collides: rule.pairs() > 0,
            criteria,
        }
    }

    /// Whether it has forgotten how it was placed, as far as the rule can tell.
    pub fn has_settled(&self) -> bool {
        self.criteria.iter().all(|criterion| criterion.met)
    }
}

/// What is kept of a run to judge whether it has settled.
struct Rule {
    /// Where the balls began.
    from: Vec<DVec3>,
    /// Mean distance between neighbours.
    spacing: f64,
    /// Times and pair collisions until then.
    marks: Vec<(f64, u64)>,
    /// Root mean square way at the look before, in spacings.
    way_before: f64,
}

impl Rule {
    fn new(state: &State) -> Self {
        let count = state.ball_count();
        Self {
            from: places(state),
            spacing: (state.domain.volume() / count.max(1) as f64).cbrt(),
            marks: vec![(0.0, 0)],
            way_before: 0.0,
        }
    }

    fn mark(&mut self, time: f64, pairs: u64) {
        self.marks.push((time, pairs));
    }

    /// Time and pair collisions at this share of the run.
    fn at(&self, share: f64) -> (f64, u64) {
        self.marks[((self.marks.len() - 1) as f64 * share).round() as usize]
    }

    fn pairs(&self) -> u64 {
        self.at(1.0).1
    }

    /// Of the second half, which knows least of the beginning.
    fn free_time(&self) -> Option<f64> {
        let ((begin, before), (end, pairs)) = (self.at(0.5), self.at(1.0));
        let flights = 2 * (pairs - before);
        (flights > 0).then(|| self.from.len() as f64 * (end - begin) / flights as f64)
    }

    /// Judges the gas as it is now.
    fn look(&mut self, state: &State) -> Vec<Criterion> {
        let mut criteria = Vec::new();
        let mut must = |what: &str, found: f64, limit: String, met: bool| {
            criteria.push(Criterion {
                what: what.to_owned(),
                found,
                limit,
                met,
            });
        };
        let flights = 2.0 * self.pairs() as f64 / self.from.len().max(1) as f64;
        if flights == 0.0 {
            must(
                "collisions of a ball",
                0.0,
                "none in this gas".to_owned(),
                true,
            );
            return criteria;
        }
        let least = 0.5 * FEWEST;
        must(
            "collisions of a ball",
            flights,
            format!("at least {least}"),
            flights >= least,
        );
        let [(t0, n0), (t1, n1), (t2, n2)] = [0.5, 0.75, 1.0].map(|share| self.at(share));
        let [early, late] = [(t1 - t0, n1 - n0), (t2 - t1, n2 - n1)];
        let rate = |(time, pairs): (f64, u64)| pairs as f64 / time;
        let change = rate(late) / rate(early) - 1.0;
        let chance = STEADY * (1.0 / early.1.max(1) as f64 + 1.0 / late.1.max(1) as f64).sqrt();
        must(
            "collision rate, last quarter over the one before [%]",
            100.0 * change,
            if chance > KNOWN {
                format!(
                    "within {:.2}, known to {:.0}",
                    100.0 * chance,
                    100.0 * KNOWN
                )
            } else {
                format!("within {:.2}", 100.0 * chance)
            },
            change.abs() <= chance && chance <= KNOWN,
        );
        if let Some(speeds) = Speeds::of(state) {
            let ks = speeds.ks / speeds.ks_critical;
            must(
                "speeds, KS over critical",
                ks,
                "at most 1".to_owned(),
                ks <= 1.0,
            );
        }
        let way = self.way(state);
        let grown = way / self.way_before;
        let stayed = self.way_before > 0.0 && grown <= STAYED;
        if stayed && way < LEFT {
            must(
                "growth of the way about fixed places",
                grown,
                format!("at most {STAYED}: a solid"),
                true,
            );
        } else {
            must(
                "way from the first place [spacings]",
                way,
                format!("at least {LEFT}"),
                way >= LEFT,
            );
        }
        self.way_before = way;
        criteria
    }

    /// Root mean square way since the beginning, in spacings, without the drift of the whole gas.
    fn way(&self, state: &State) -> f64 {
        let drifted = state.totals().drift() * state.now.since(crate::state::Time::default());
        let squares = self.from.iter().zip(places(state));
        let squares = squares.map(|(from, to)| (to - *from - drifted).length_squared());
        (squares.sum::<f64>() / self.from.len().max(1) as f64).sqrt() / self.spacing
    }
}

fn places(state: &State) -> Vec<DVec3> {
    (0..state.ball_count())
        .map(|ball| state.unwrapped_position(ball))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::gases::{face_centred, lattice};

    /// How the rule judges a gas after so many simulated time units: what is met, criterion by criterion.
    fn judged(gas: &Placement, time: f64) -> Vec<Criterion> {
        let mut trial = Trial::new(EVENT, gas);
        let mut rule = Rule::new(trial.state());
        let mut criteria = Vec::new();
        let slices = 300;
        for slice in 1..=slices {
            trial.run(time * f64::from(slice) / f64::from(slices));
            rule.mark(trial.time(), trial.engine.counters().pair_collisions);
            if slice * 3 == slices * 2 || slice == slices {
                criteria = rule.look(trial.state());
            }
        }
        criteria
    }

    fn unmet(gas: &Placement, time: f64) -> Vec<String> {
        let criteria = judged(gas, time).into_iter();
        criteria
            .filter(|criterion| !criterion.met)
            .map(|criterion| criterion.what)
            .collect()
    }

    /// A simple cubic lattice at a packing fraction of 0.45, where a fluid is stable.
    fn melting() -> Placement {
        let spacing = (std::f64::consts::PI / 6.0 / 0.45).cbrt();
        let mut gas = lattice(10, spacing, 10.0 * spacing, 3);
        gas.domain.boundary = crate::domain::Boundary::Periodic;
        crate::experiment::gases::stop_drift(&mut gas);
        gas
    }

    #[test]
    fn a_lattice_has_not_settled_before_it_has_melted() {
        assert!(!unmet(&melting(), 0.2).is_empty(), "7 collisions of a ball");
        assert_eq!(unmet(&melting(), 12.0), [""; 0], "350 collisions of a ball");
    }

    #[test]
    fn a_crystal_settles_though_its_balls_never_leave_their_places() {
        // Packing fraction 0.6, far above melting at 0.545.
        let crystal = face_centred(5, 1.146, 1);
        let criteria = judged(&crystal, 9.0);
        assert!(
            criteria.iter().all(|criterion| criterion.met),
            "{criteria:?}"
        );
        assert!(criteria[3].limit.contains("solid"), "{criteria:?}");
    }

    #[test]
    fn balls_of_one_speed_have_not_settled_before_they_have_maxwells() {
        let mut gas = lattice(12, 3.0, 36.0, 5);
        gas.velocities
            .iter_mut()
            .for_each(|velocity| *velocity = velocity.normalize() * 3.0_f64.sqrt());
        assert!(unmet(&gas, 3.0).contains(&"speeds, KS over critical".to_owned()));
        assert_eq!(unmet(&gas, 400.0), [""; 0]);
    }
}
