//! Observables on demand: from what a scene asks for to observers, through a run, and from what they found to figures and tables.

mod flights;
mod motion;
mod relaxation;
mod structure;
mod transport;

use serde::{Deserialize, Serialize};

use self::motion::Group;
use crate::engine::{Engine, Stuck};
use crate::observe::Observer;
use crate::observe::block_sums::Estimate;
use crate::observe::correlator::Correlator;
use crate::observe::density_profile::DensityProfile;
use crate::observe::flights::Flights;
use crate::observe::motion::Motion;
use crate::observe::on_demand::OnDemand;
use crate::observe::relaxation::Relaxation;
use crate::observe::transport::Transport;
use crate::observe::velocities::Velocities;
use crate::scene::Scene;
use crate::scene::analysis::{self, Enskog, Theory};
use crate::scene::observe::{self, Name, Observe};
use crate::snapshot::{Column, Figure, Observed, Units};
use crate::state::{Placement, State, Time};

/// Looks per mean free time, unless the scene says otherwise.
const LOOKS_PER_FREE_TIME: f64 = 5.0;

/// Pair collisions of the gas between two looks, at least: a look reads every ball.
const FEWEST_COLLISIONS: f64 = 20.0;

/// What a scene wants measured, and what theory knows of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Plan {
    observe: Observe,
    /// What cannot be observed here, and why.
    refused: Vec<(Name, String)>,
    units: Units,
    /// Simulated time between two looks.
    every: f64,
    theory: Theory,
    enskog: Option<Enskog>,
    groups: Vec<Group>,
    tracked: Vec<(u32, u16)>,
    ball_count: usize,
    /// Mean mass of the balls, if they are alike.
    mass: Option<f64>,
    /// Mean free path and time that histograms are made for.
    flight: [f64; 2],
}

/// Balls whose motion is averaged together.
/// What a run knows at a moment beside the balls.
#[derive(Clone, Copy)]
pub struct Known {
    /// Temperature.
    pub temperature: Option<f64>,
    /// Pair collisions of a ball per time.
    pub collision_rate: Option<f64>,
    /// Compressibility factor.
    pub compressibility_factor: Option<f64>,
}

impl Plan {
    /// The plan of a placed scene; `None` without balls.
    pub fn new(scene: &Scene, placement: &Placement) -> Option<Self> {
        let observe = scene.observe.clone();
        let ball_count = placement.positions.len();
        if ball_count == 0 {
            return None;
        }
        let theory = Theory::new(placement, scene.units);
        let temperature = analysis::temperature(placement, scene.units).unwrap_or(0.0);
        let pair_rate = theory.at(temperature).pair_rate.filter(|rate| *rate > 0.0);
        let every = observe.every.unwrap_or_else(|| {
            pair_rate.map_or(scene.sample / 10.0, |rate| {
                let free_time = ball_count as f64 / (2.0 * rate);
                (free_time / LOOKS_PER_FREE_TIME).max(FEWEST_COLLISIONS / rate)
            })
        });
        let squares: f64 = placement
            .velocities
            .iter()
            .map(|velocity| velocity.length_squared())
            .sum();
        let speed = 0.921 * (squares / ball_count as f64).sqrt(); // the mean is sqrt(8 / 3 pi) of the root mean square
        let free_time = pair_rate.map_or(LOOKS_PER_FREE_TIME * every, |rate| {
            ball_count as f64 / (2.0 * rate)
        });
        let (groups, tracked) = motion::groups(scene, placement);
        let refused = |name: Name| {
            let alone = Observe {
                chosen: vec![name],
                ..observe.clone()
            };
            Some((name, observe::refusal_of(scene, &alone)?))
        };
        Some(Self {
            refused: Name::ALL.into_iter().filter_map(refused).collect(),
            units: scene.units,
            every,
            enskog: Enskog::new(placement, scene.units),
            theory,
            groups,
            tracked,
            ball_count,
            mass: match placement.bodies.as_slice() {
                [body] => Some(body.mass),
                _ => None,
            },
            flight: [(speed * free_time).max(f64::MIN_POSITIVE), free_time],
            observe,
        })
    }

    /// Simulated time between two looks.
    pub fn every(&self) -> f64 {
        self.every
    }

    /// The observers of what the scene asks for, before the run; `None` if that is nothing.
    ///
    /// # Panics
    /// If the scene asks for what cannot be observed: such a scene is refused where it is read.
    pub fn observers(&self, state: &State) -> Option<OnDemand> {
        let mut observers = None;
        for &name in &self.observe.chosen {
            self.switch(&mut observers, name, true, state)
                .expect("a scene that asks for what cannot be observed is refused");
        }
        observers
    }

    /// Observes something from the state's present on, or no more.
    ///
    /// # Errors
    /// Why it cannot be observed.
    pub fn switch(
        &self,
        observers: &mut Option<OnDemand>,
        name: Name,
        on: bool,
        state: &State,
    ) -> Result<(), String> {
        let refused = self.refused.iter().find(|(refused, _)| *refused == name);
        if let Some((_, why)) = refused.filter(|_| on) {
            return Err(why.clone());
        }
        let now = state.units.scene_time(state.now);
        let all = observers.get_or_insert_with(|| OnDemand {
            looks: if now > 0.0 {
                (now / self.every) as u64 + 1
            } else {
                0
            },
            ..OnDemand::default()
        });
        let units = state.units;
        match name {
            Name::RadialDistribution => {
                all.radial_distribution = on.then(|| self.radial_distribution(state));
            }
            Name::DensityProfile => all.density_profile = on.then(DensityProfile::default),
            Name::Motion => {
                all.motion = on.then(|| Motion::new(state, &self.tracked, self.groups.len()));
            }
            Name::Relaxation => all.relaxation = on.then(Relaxation::default),
            Name::Flights => {
                let [path, time] = [self.flight[0] / units.length, self.flight[1] / units.time];
                all.flights = on.then(|| Flights::new(state, path, time));
            }
            Name::Transport => {
                all.transport = on.then(|| Transport::new(state, &Velocities::of(state)));
            }
        }
        if all.flights.is_none() && all.transport.is_none() {
            all.velocities = None;
        } else if all.velocities.is_none() {
            all.velocities = Some(Velocities::of(state));
        }
        observers.take_if(|all| all.is_idle());
        Ok(())
    }

    /// What the observers have found by now, in the scene's units.
    pub fn results(&self, observers: &OnDemand, state: &State, known: Known) -> Vec<Observed> {
        let found = |name: Name| -> Option<(Vec<Figure>, Vec<Column>)> {
            match name {
                Name::RadialDistribution => {
                    Some(self.radial_result(observers.radial_distribution.as_ref()?, state, known))
                }
                Name::DensityProfile => {
                    Some(self.profile_result(observers.density_profile.as_ref()?, state))
                }
                Name::Motion => Some(self.motion_result(observers.motion.as_ref()?, state, known)),
                Name::Relaxation => Some(relaxation::result(observers.relaxation.as_ref()?, state)),
                Name::Flights => {
                    Some(self.flights_result(observers.flights.as_ref()?, state, known))
                }
                Name::Transport => {
                    Some(self.transport_result(observers.transport.as_ref()?, state, known))
                }
            }
        };
        let named = |&name: &Name| {
            let (figures, columns) = found(name)?;
            let name = name.key().to_owned();
            Some(Observed {
                name,
                figures,
                columns,
            })
        };
        Name::ALL.iter().filter_map(named).collect()
    }

    fn unit(&self, si: &str) -> String {
        if self.units == Units::Si {
            si.to_owned()
        } else {
            String::new()
        }
    }

    /// Two lags at which a correlator stands about so many mean free times apart, if it has got there.
    fn lags_at(
        &self,
        correlator: &Correlator,
        free_times: [f64; 2],
        free_time: f64,
    ) -> Option<[usize; 2]> {
        let lags = correlator.lags();
        let at = |times: f64| {
            let wanted = times * free_time / self.every;
            lags.iter()
                .find(|(_, lag)| *lag >= wanted * (1.0 - 1e-9))
                .map(|(index, _)| *index)
        };
        let [from, to] = [at(free_times[0])?, at(free_times[1])?];
        (from < to).then_some([from, to])
    }
}

/// Advances a gas to a simulated time, and shows it to the observers on demand at their instants, that far apart.
///
/// # Errors
/// [`Stuck`] when the gas has no room.
pub fn advance(
    engine: &mut dyn Engine,
    observer: &mut Observer,
    on_demand: Option<(&mut OnDemand, f64)>,
    target: f64,
) -> Result<(), Stuck> {
    let units = engine.state().units;
    let Some((on_demand, every)) = on_demand else {
        let until = units.instant(target);
        return engine.advance_in_sums(until, &mut |report| observer.take(report));
    };
    loop {
        let due = on_demand.looks as f64 * every;
        fly(engine, observer, on_demand, units.instant(due.min(target)))?;
        if due > target {
            return Ok(());
        }
        engine.settle();
        on_demand.look(engine.state());
    }
}

/// Advances a gas to an instant between two looks at it.
///
/// # Errors
/// [`Stuck`] when the gas has no room.
pub fn fly(
    engine: &mut dyn Engine,
    observer: &mut Observer,
    on_demand: &mut OnDemand,
    until: Time,
) -> Result<(), Stuck> {
    if on_demand.wants_collisions() {
        engine.advance(until, &mut |collision| {
            observer.record(collision);
            on_demand.record(collision);
        })
    } else {
        engine.advance_in_sums(until, &mut |report| observer.take(report))
    }
}

fn figure(name: &str, estimate: Estimate, expected: Option<f64>, unit: String) -> Figure {
    Figure {
        name: name.to_owned(),
        value: estimate.value,
        standard_error: estimate.error,
        expected,
        unit,
    }
}

fn column(name: &str, values: impl Iterator<Item = Option<f64>>) -> Column {
    Column {
        name: name.to_owned(),
        values: values
            .map(|value| value.filter(|value| value.is_finite()))
            .collect(),
    }
}
