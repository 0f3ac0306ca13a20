//! Observables on demand: from what a scene asks for to observers, and from what they found to figures and tables.

mod flights;

use serde::{Deserialize, Serialize};

use crate::domain::Boundary;
use crate::observe::block_sums::Estimate;
use crate::observe::correlator::Correlator;
use crate::observe::density_profile::{DensityProfile, SLICES};
use crate::observe::flights::Flights;
use crate::observe::motion::Motion;
use crate::observe::on_demand::OnDemand;
use crate::observe::radial_distribution::RadialDistribution;
use crate::observe::relaxation::Relaxation;
use crate::observe::transport::{HEAT, STRESS, Transport};
use crate::observe::velocities::Velocities;
use crate::scene::Scene;
use crate::scene::analysis::{self, Brownian, Enskog, Theory};
use crate::scene::observe::{self, Name, Observe};
use crate::snapshot::{Column, Figure, Observed, Units};
use crate::state::{Placement, State};

/// Looks per mean free time, unless the scene says otherwise.
const LOOKS_PER_FREE_TIME: f64 = 5.0;

/// Pair collisions of the gas between two looks, at least: a look reads every ball.
const FEWEST_COLLISIONS: f64 = 20.0;

/// Most balls of the species whose motion is followed, named ones apart.
const MOST_TRACKED: usize = 1024;

/// Mean free times after which a ball has forgotten its velocity, and twice that: diffusion is read off between them.
const DIFFUSIVE: [f64; 2] = [10.0, 20.0];

/// The same for stress and energy current, which the gas forgets sooner.
const HYDRODYNAMIC: [f64; 2] = [5.0, 10.0];

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
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Group {
    name: String,
    brownian: Option<Brownian>,
}

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
        let (groups, tracked) = groups(scene, placement);
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

    fn radial_distribution(&self, state: &State) -> RadialDistribution {
        const BINS_PER_DIAMETER: f64 = 100.0;
        let room = state.domain.half_size.min_element();
        let diameter = 2.0 * state.bodies.mean_radius();
        let distance = self.observe.distance.map_or_else(
            || {
                if diameter > 0.0 {
                    3.0 * diameter
                } else {
                    0.5 * room
                }
            },
            |distance| distance / state.units.length,
        );
        // In a container, centres need a shell's width to the walls.
        let most = if state.domain.boundary == Boundary::Periodic {
            room
        } else {
            0.8 * room
        };
        let distance = distance.min(most);
        let from = state
            .bodies
            .uniform()
            .map_or(0.0, |_| diameter)
            .min(0.5 * distance);
        let width = if diameter > 0.0 {
            diameter / BINS_PER_DIAMETER
        } else {
            distance / 200.0
        };
        let bins = ((distance - from) / width).clamp(1.0, 2000.0);
        RadialDistribution::new(from, (distance - from) / bins.floor(), bins as usize)
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
                Name::Relaxation => Some(relaxation_result(observers.relaxation.as_ref()?, state)),
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

    fn radial_result(
        &self,
        observer: &RadialDistribution,
        state: &State,
        known: Known,
    ) -> (Vec<Figure>, Vec<Column>) {
        let bins = observer.bins();
        let columns = vec![
            column(
                "distance",
                bins.iter()
                    .map(|(middle, _)| Some(middle * state.units.length)),
            ),
            column(
                "radial_distribution",
                bins.iter().map(|(_, value)| value.value),
            ),
            column("standard_error", bins.iter().map(|(_, value)| value.error)),
        ];
        let Some(enskog) = self.enskog else {
            return (Vec::new(), columns);
        };
        let expected = Some(enskog.contact_value());
        let alone = |value: Option<f64>| Estimate { value, error: None };
        let from_rate = known
            .collision_rate
            .zip(known.temperature)
            .map(|(rate, temperature)| enskog.contact_value_of_rate(rate, temperature));
        let from_pressure = known
            .compressibility_factor
            .map(|z| enskog.contact_value_of_pressure(z));
        let figures = vec![
            figure("contact_value", observer.contact(), expected, String::new()),
            figure(
                "contact_value_from_pressure",
                alone(from_pressure),
                expected,
                String::new(),
            ),
            figure(
                "contact_value_from_collision_rate",
                alone(from_rate),
                expected,
                String::new(),
            ),
        ];
        (figures, columns)
    }

    fn profile_result(
        &self,
        observer: &DensityProfile,
        state: &State,
    ) -> (Vec<Figure>, Vec<Column>) {
        let mean = self.ball_count as f64 / SLICES as f64;
        let center = (
            state.center.to_array(),
            (state.domain.half_size * state.units.length).to_array(),
        );
        let mut columns = Vec::new();
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let (middle, half) = (center.0[axis], center.1[axis]);
            let place =
                |slice: usize| middle + half * ((2 * slice + 1) as f64 / SLICES as f64 - 1.0);
            let slices = observer.slices(axis).into_iter();
            let slices: Vec<Estimate> = slices.map(|slice| slice.times(1.0 / mean)).collect();
            columns.push(column(name, (0..SLICES).map(|slice| Some(place(slice)))));
            columns.push(column(
                &format!("density_{name}"),
                slices.iter().map(|slice| slice.value),
            ));
            columns.push(column(
                &format!("standard_error_{name}"),
                slices.iter().map(|slice| slice.error),
            ));
        }
        (Vec::new(), columns)
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

    fn motion_result(
        &self,
        motion: &Motion,
        state: &State,
        known: Known,
    ) -> (Vec<Figure>, Vec<Column>) {
        let (length, every) = (state.units.length, self.every);
        let area = length * length;
        let squared_speed = state.units.velocity() * state.units.velocity();
        let lags = motion.displacement.lags();
        let free_time = known.collision_rate.map(|rate| 1.0 / rate);
        let plateau = free_time
            .and_then(|free_time| self.lags_at(&motion.displacement, DIFFUSIVE, free_time));
        let mut figures = Vec::new();
        let mut columns = vec![column(
            "time",
            lags.iter().map(|(_, lag)| Some(lag * every)),
        )];
        for (index, group) in self.groups.iter().enumerate() {
            let name = &group.name;
            let heavy = group.brownian.zip(known.temperature);
            if heavy.is_none()
                && let Some(plateau) = plateau
            {
                let expected = self
                    .enskog
                    .zip(known.temperature)
                    .map(|(enskog, temperature)| enskog.diffusion(temperature));
                let unit = || self.unit("m²/s");
                let slope = motion
                    .displacement
                    .slope(index, plateau)
                    .times(area / every / 6.0);
                figures.push(figure(
                    &format!("diffusion_coefficient.{name}"),
                    slope,
                    expected,
                    unit(),
                ));
                let integral = motion
                    .velocity
                    .integral(index, plateau[1])
                    .times(squared_speed * every / 3.0);
                figures.push(figure(
                    &format!("diffusion_coefficient_from_velocity.{name}"),
                    integral,
                    expected,
                    unit(),
                ));
            }
            if let Some((brownian, temperature)) = heavy {
                let tau = brownian.relaxation_time(temperature);
                let expected = Some(self.units.boltzmann() * temperature * tau / brownian.mass());
                let far = self.lags_at(&motion.displacement, [3.0, 6.0], tau);
                let slope = far.map_or_else(Estimate::default, |lags| {
                    motion
                        .displacement
                        .slope(index, lags)
                        .times(area / every / 6.0)
                });
                figures.push(figure(
                    &format!("diffusion_coefficient.{name}"),
                    slope,
                    expected,
                    self.unit("m²/s"),
                ));
            }
            let indices = || lags.iter().map(|(lag, _)| *lag);
            let squares = motion.displacement.means(index, indices()).into_iter();
            let squares: Vec<Estimate> = squares.map(|square| square.times(area)).collect();
            columns.push(column(
                &format!("mean_square_displacement.{name}"),
                squares.iter().map(|square| square.value),
            ));
            columns.push(column(
                &format!("standard_error.{name}"),
                squares.iter().map(|square| square.error),
            ));
            if let Some((brownian, temperature)) = heavy {
                let expected = lags.iter().map(|(_, lag)| {
                    Some(brownian.mean_square_displacement(temperature, lag * every))
                });
                columns.push(column(&format!("expected.{name}"), expected));
            }
            let products = motion.velocity.means(index, indices()).into_iter();
            let products = products.map(|product| product.times(squared_speed).value);
            columns.push(column(
                &format!("velocity_autocorrelation.{name}"),
                products,
            ));
        }
        (figures, columns)
    }

    fn transport_result(
        &self,
        transport: &Transport,
        state: &State,
        known: Known,
    ) -> (Vec<Figure>, Vec<Column>) {
        let units = state.units;
        let Some(temperature) = known.temperature else {
            return (Vec::new(), Vec::new());
        };
        let energy = self.units.boltzmann() * temperature;
        let volume = state.domain.volume() * units.length.powi(3);
        // Squares of both integrals in the scene's units, three components each.
        let stress = (units.energy() * units.time).powi(2) / 3.0 / (2.0 * volume * energy);
        let heat =
            (units.energy() * units.length).powi(2) / 3.0 / (2.0 * volume * energy * temperature);
        let moments = &transport.moments;
        let plateau = known
            .collision_rate
            .and_then(|rate| self.lags_at(moments, HYDRODYNAMIC, 1.0 / rate));
        let quantities = [
            (
                "viscosity",
                STRESS,
                stress,
                self.enskog.map(|enskog| enskog.viscosity(temperature)),
                "Pa s",
            ),
            (
                "thermal_conductivity",
                HEAT,
                heat,
                self.enskog.map(|enskog| enskog.conductivity(temperature)),
                "W/(m K)",
            ),
        ];
        let lags: Vec<_> = moments
            .lags()
            .into_iter()
            .filter(|(index, _)| *index > 0)
            .collect();
        let mut columns = vec![column(
            "time",
            lags.iter().map(|(_, lag)| Some(lag * self.every)),
        )];
        let mut figures = Vec::new();
        for (name, group, scale, expected, unit) in quantities {
            let slope = plateau.map_or_else(Estimate::default, |lags| {
                moments.slope(group, lags).times(scale / self.every)
            });
            figures.push(figure(name, slope, expected, self.unit(unit)));
            let means = moments.means(group, lags.iter().map(|(index, _)| *index));
            let running: Vec<Estimate> = (means.into_iter().zip(&lags))
                .map(|(mean, (_, lag))| mean.times(scale / (lag * self.every)))
                .collect();
            columns.push(column(
                &format!("{name}_until_then"),
                running.iter().map(|value| value.value),
            ));
            columns.push(column(
                &format!("standard_error.{name}"),
                running.iter().map(|value| value.error),
            ));
        }
        (figures, columns)
    }
}

fn relaxation_result(relaxation: &Relaxation, state: &State) -> (Vec<Figure>, Vec<Column>) {
    let points = relaxation.points();
    let of = |value: fn(&crate::observe::relaxation::Point) -> f64| {
        points.iter().map(value).map(Some).collect::<Vec<_>>()
    };
    let last = |value: fn(&crate::observe::relaxation::Point) -> f64| Estimate {
        value: points.last().map(value),
        error: None,
    };
    let figures = vec![
        figure(
            "h",
            last(|point| point.h),
            points.last().map(|point| point.maxwell),
            String::new(),
        ),
        figure(
            "fourth_moment",
            last(|point| point.fourth_moment),
            Some(5.0 / 3.0),
            String::new(),
        ),
    ];
    let columns = vec![
        column(
            "time",
            points
                .iter()
                .map(|point| Some(state.units.scene_time(point.time))),
        ),
        column(
            "collisions_per_ball",
            of(|point| point.collisions).into_iter(),
        ),
        column("h", of(|point| point.h).into_iter()),
        column("h_of_maxwell", of(|point| point.maxwell).into_iter()),
        column("fourth_moment", of(|point| point.fourth_moment).into_iter()),
    ];
    (figures, columns)
}

/// Species and named balls, and the balls whose motion stands for them.
fn groups(scene: &Scene, placement: &Placement) -> (Vec<Group>, Vec<(u32, u16)>) {
    let (mut groups, mut tracked) = (Vec::new(), Vec::new());
    let moving = |ball: usize| {
        let body = placement.body_of.get(ball).map_or(0, |&body| body as usize);
        placement.bodies[body].mass.is_finite()
    };
    let mut first = 0;
    let share = MOST_TRACKED / scene.species.len().clamp(1, MOST_TRACKED);
    for (index, species) in scene.species.iter().enumerate() {
        let balls = first..first + species.count;
        first += species.count;
        if species.count == 0 || !moving(balls.start) {
            continue;
        }
        let taken = species.count.min(share);
        let evenly = (0..taken).map(|ball| balls.start + ball * species.count / taken);
        tracked.extend(evenly.map(|ball| (ball as u32, groups.len() as u16)));
        let name = species
            .name
            .clone()
            .unwrap_or_else(|| format!("species_{}", index + 1));
        groups.push(Group {
            name,
            brownian: None,
        });
    }
    let named = scene.named_balls();
    let others = (first..placement.positions.len())
        .filter(|&ball| moving(ball) && named.iter().all(|(_, named)| *named != ball));
    let others: Vec<usize> = others.take(MOST_TRACKED).collect();
    if !others.is_empty() {
        tracked.extend(
            others
                .iter()
                .map(|&ball| (ball as u32, groups.len() as u16)),
        );
        groups.push(Group {
            name: "balls".to_owned(),
            brownian: None,
        });
    }
    for (name, ball) in named.into_iter().filter(|(_, ball)| moving(*ball)) {
        tracked.push((ball as u32, groups.len() as u16));
        groups.push(Group {
            name,
            brownian: Brownian::new(placement, scene.units, ball),
        });
    }
    (groups, tracked)
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
