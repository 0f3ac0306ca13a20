//! Transport: viscosity and thermal conductivity from the integrals of stress and energy current.

use super::{Known, Plan, column, figure};
use crate::observe::block_sums::Estimate;
use crate::observe::transport::{HEAT, STRESS, Transport};
use crate::snapshot::{Column, Figure};
use crate::state::State;

/// Mean free times between which the slopes are read off.
///
/// In a dilute gas stress dies away in 1.3 of them and energy current in 1.9, so that a window from 5 to 10 lacks half a percent
/// of the viscosity and 2.5 % of the conductivity; later ones only make the error larger.
const HYDRODYNAMIC: [f64; 2] = [10.0, 20.0];

impl Plan {
    pub(super) fn transport_result(
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
