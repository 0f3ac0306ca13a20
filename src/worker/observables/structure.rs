//! Structure: neighbours at each distance, and balls along each axis.

use super::{Known, Plan, column, figure};
use crate::domain::Boundary;
use crate::observe::block_sums::Estimate;
use crate::observe::density_profile::{DensityProfile, SLICES};
use crate::observe::radial_distribution::RadialDistribution;
use crate::snapshot::{Column, Figure};
use crate::state::State;

impl Plan {
    /// The observer of the radial distribution, as far and as fine as the scene allows.
    pub(super) fn radial_distribution(&self, state: &State) -> RadialDistribution {
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

    pub(super) fn radial_result(
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

    pub(super) fn profile_result(
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
}
