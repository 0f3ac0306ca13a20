//! Flights and walls: figures, and histograms beside what kinetic theory makes of them.

use super::{Known, Plan, column, figure};
use crate::domain::Boundary;
use crate::observe::block_sums::Estimate;
use crate::observe::flights::{BIN_COUNT, Flights};
use crate::scene::analysis::free_flights;
use crate::snapshot::{Column, Figure};
use crate::state::State;

impl Plan {
    pub(super) fn flights_result(
        &self,
        flights: &Flights,
        state: &State,
        known: Known,
    ) -> (Vec<Figure>, Vec<Column>) {
        let units = state.units;
        let path = flights.mean_path().times(units.length);
        let time = flights.mean_time().times(units.time);
        let expected_rate = known
            .temperature
            .and_then(|temperature| self.theory.at(temperature).pair_rate);
        let expected_time = expected_rate
            .filter(|rate| *rate > 0.0)
            .map(|rate| self.ball_count as f64 / (2.0 * rate));
        let mean_speed = self.mass.zip(known.temperature).map(|(mass, temperature)| {
            (8.0 * self.units.boltzmann() * temperature / (std::f64::consts::PI * mass)).sqrt()
        });
        let expected_path = expected_time
            .zip(mean_speed)
            .map(|(time, speed)| time * speed);
        let mut figures = vec![
            figure("mean_free_path", path, expected_path, self.unit("m")),
            figure("mean_free_time", time, expected_time, self.unit("s")),
        ];
        let counts = state.collisions.iter().map(|&count| count as f64);
        let mean = counts.clone().sum::<f64>() / self.ball_count as f64;
        let deviation = (counts
            .clone()
            .map(|count| (count - mean).powi(2))
            .sum::<f64>()
            / self.ball_count as f64)
            .sqrt();
        let (least, most) = counts.fold((f64::INFINITY, 0.0_f64), |(least, most), count| {
            (least.min(count), most.max(count))
        });
        for (name, value) in [
            ("mean", mean),
            ("deviation", deviation),
            ("least", least),
            ("most", most),
        ] {
            let value = Estimate {
                value: Some(value),
                error: None,
            };
            figures.push(figure(
                &format!("collisions_per_ball.{name}"),
                value,
                None,
                String::new(),
            ));
        }
        if state.domain.boundary == Boundary::Container {
            let half = state.domain.half_size;
            let expected = known
                .temperature
                .and_then(|temperature| self.theory.at(temperature).pressure);
            for (wall, name) in [
                "x_lower", "x_upper", "y_lower", "y_upper", "z_lower", "z_upper",
            ]
            .into_iter()
            .enumerate()
            {
                let area = 4.0 * half.element_product() / half[wall / 2];
                let pressure = flights.wall_force(wall).times(units.pressure() / area);
                figures.push(figure(
                    &format!("pressure.{name}"),
                    pressure,
                    expected,
                    self.unit("Pa"),
                ));
            }
        }
        (
            figures,
            self.flights_table(flights, state, path.value.zip(time.value)),
        )
    }

    /// Flights per bin; expected ones have the means that were measured.
    fn flights_table(
        &self,
        flights: &Flights,
        state: &State,
        means: Option<(f64, f64)>,
    ) -> Vec<Column> {
        let units = state.units;
        let ((path_bin, paths), (time_bin, times)) = (flights.lengths(), flights.times());
        let total = paths.iter().sum::<u64>() as f64;
        let shares = self.enskog.zip(means).map(|(_, (path, time))| {
            let widths = [path_bin * units.length / path, time_bin * units.time / time];
            widths.map(|width| free_flights(BIN_COUNT, width))
        });
        let share = |bin: usize, which: usize| Some(total * shares.as_ref()?[which][bin][which]);
        let edge = |bin: usize, width: f64| Some(bin as f64 * width);
        let bins = || 0..BIN_COUNT;
        vec![
            column(
                "free_path",
                bins().map(|bin| edge(bin, path_bin * units.length)),
            ),
            column(
                "flights_by_path",
                paths.iter().map(|&count| Some(count as f64)),
            ),
            column("expected_by_path", bins().map(|bin| share(bin, 0))),
            column(
                "free_time",
                bins().map(|bin| edge(bin, time_bin * units.time)),
            ),
            column(
                "flights_by_time",
                times.iter().map(|&count| Some(count as f64)),
            ),
            column("expected_by_time", bins().map(|bin| share(bin, 1))),
        ]
    }
}
