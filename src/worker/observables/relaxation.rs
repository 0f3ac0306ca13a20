//! Relaxation: Boltzmann's H and the fourth moment against time.

use super::{column, figure};
use crate::observe::block_sums::Estimate;
use crate::observe::relaxation::{Point, Relaxation};
use crate::snapshot::{Column, Figure};
use crate::state::State;

pub(super) fn result(relaxation: &Relaxation, state: &State) -> (Vec<Figure>, Vec<Column>) {
    let points = relaxation.points();
    let of = |value: fn(&Point) -> f64| points.iter().map(value).map(Some).collect::<Vec<_>>();
    let last = |value: fn(&Point) -> f64| Estimate {
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
