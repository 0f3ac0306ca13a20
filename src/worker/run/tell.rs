//! What a run tells: snapshots, rows of the series, stretches of the history.

use std::sync::Arc;
use std::time::Instant;

use super::{CLOSER_LOOK_SHARE, Run, survey_pause};
use crate::history::{Observable, Stretch};
use crate::quantity::plain;
use crate::run_directory::log;
use crate::snapshot::{Expected, Phase, SeriesRow, Snapshot, Warning};
use crate::worker::echo::horizon;
use crate::worker::measure::{self, Settled, Survey};
use crate::worker::observables::Known;
use crate::worker::past::Past;
use crate::worker::saved::Totals;
use crate::worker::writer::Writer;

/// Most warnings that snapshots carry.
const MOST_WARNINGS: usize = 5;

impl Run<'_> {
    pub(super) fn publish(&mut self, state_hash: Option<u64>) {
        self.look_closer();
        self.tell_method();
        let running = self.phase == Phase::Running;
        let sample = self.watched.then(|| {
            let (engine, setting) = (&mut self.engine, self.setting);
            (self.pictures).sample(running, || {
                engine.settle();
                measure::sample(engine.state(), &setting.sampled, &setting.names)
            })
        });
        self.sequence += 1;
        self.published = Instant::now();
        let card = &self.setting.origin.card;
        let state = self.engine.state();
        let counters = self.engine.counters();
        let settled = Settled::of(state, &self.observer, &self.pressures);
        let balls = card.ball_count as f64;
        let time = self.time();
        let temperature = self.temperature();
        let rates = self.meter.rates().filter(|_| self.phase == Phase::Running);
        let pair_rate = settled.pair_rate.filter(|_| counters.pair_collisions > 0);
        let pressure_error = self.pressure_error();
        let pressure = settled.pressure.wall.or(settled.pressure.virial);
        self.take_warnings();
        // The mean since the last snapshot: what is due within a window of time swings with where in it the engine stands.
        let queue_length = self.queue[0].take().filter(|_| state_hash.is_none());
        let snapshot = Snapshot {
            engine: self.method.into(),
            sequence: self.sequence,
            phase: self.phase.clone(),
            reversed: self.reversed(),
            time,
            wall_time_s: self.meter.wall_time(),
            setup_time_s: Some(self.setup_time_s),
            time_rate: rates.map(|(rate, _)| rate),
            time_rate_limit: self.limit,
            collisions_per_wall_second: rates.map(|(_, rate)| rate),
            time_left_s: self
                .setting
                .options
                .until
                .and_then(|until| self.meter.time_for(until - time)),
            until_error: self.setting.options.until_error,
            pressure_error,
            error_left_s: self.time_to_error(pressure_error),
            counts: measure::counts(&counters),
            temperature,
            kinetic_energy: self.survey.kinetic_energy,
            pressure: settled.pressure,
            compressibility_factor: self.compressibility_factor(pressure),
            collision_rate: pair_rate.map(|rate| 2.0 * rate / balls),
            pair_rate,
            wall_rate: settled.wall_rate,
            mean_free_path: pair_rate
                .zip(self.survey.mean_speed)
                .map(|(rate, speed)| balls * speed / (2.0 * rate)),
            expected: temperature.map_or_else(Expected::default, |temperature| {
                self.setting.origin.theory.at(temperature)
            }),
            energy_drift: self.survey.energy_drift,
            momentum_drift: self.survey.momentum_drift,
            virial_residual: self.survey.virial_residual,
            max_overlap: self.observer.max_overlap,
            echo: self.echo.at(time),
            echo_horizon: horizon(
                card.packing_fraction,
                pair_rate.map_or(0.0, |rate| 2.0 * rate / balls),
            )
            .filter(|_| !matches!(self.engine.name(), "reversible" | "statistical")),
            speeds: self.survey.speeds.clone(),
            queue_length: queue_length.map_or(self.engine.queue_length() as u64, |mean| {
                mean.round() as u64
            }),
            queue_length_max: counters.queue_length_max,
            past: self.past.as_ref().map(Past::latest),
            last_checkpoint: self.writer.as_ref().and_then(Writer::written),
            checkpoints: self.writer.as_ref().map_or(0, Writer::count),
            warnings: self.warnings.0.clone(),
            marks: self.marks.clone(),
            notice: (self.writer.as_ref().and_then(Writer::trouble))
                .or_else(|| self.setting.options.trajectory.as_ref()?.trouble())
                .or_else(|| self.notice.clone()),
            peak_rss_bytes: measure::peak_memory(),
            state_hash,
            named: self.named.clone(),
            observables: Arc::clone(&self.observables),
            history: Arc::clone(&self.history),
            sample,
            ..self.setting.first_snapshot()
        };
        if self.setting.options.on_trouble.is_some() {
            let usual = self.meter.usual_collision_rate();
            let trouble = self.watchdog.look(&snapshot, usual);
            self.trouble = self.trouble.take().or(trouble);
        }
        self.slot.put(snapshot);
    }

    /// Tells when another method has got the gas.
    fn tell_method(&mut self) {
        let method = self.engine.name();
        let before = std::mem::replace(&mut self.method, method);
        if let Some(time) = self.engine.last_change().filter(|_| method != before) {
            let time = plain(self.engine.state().units.scene_time(time));
            let words = format!("engine {before} -> {method} at t = {time}");
            tracing::info!("{words}");
            self.notice = Some(words);
        }
    }

    /// Takes over what has come into the log.
    fn take_warnings(&mut self) {
        let wall_time_s = self.meter.wall_time();
        let (kept, seen) = &mut self.warnings;
        let new = log::newest_warnings(seen).into_iter();
        kept.extend(new.map(|words| Warning { wall_time_s, words }));
        kept.drain(..kept.len().saturating_sub(MOST_WARNINGS));
    }

    pub(super) fn totals(&self) -> Totals {
        let counters = self.engine.counters();
        Totals {
            time: self.time(),
            wall_impulse: self.observer.ledger.wall_impulse(),
            pair_virial: self.observer.ledger.pair_virial(),
            pair_collisions: counters.pair_collisions,
            wall_collisions: counters.wall_collisions,
        }
    }

    /// Wall and virial pressure between two moments, as far as the scene has them.
    pub(super) fn pressures_between(&self, from: Totals, to: Totals) -> (Option<f64>, Option<f64>) {
        let epochs = (to.time - from.time) / self.engine.state().units.time;
        if epochs <= 0.0 {
            return (None, None);
        }
        let wall = (to.wall_impulse - from.wall_impulse) / epochs;
        let virial = (to.pair_virial - from.pair_virial) / epochs;
        (self.pressures.wall(wall), self.pressures.virial(virial))
    }

    pub(super) fn write_row(&mut self) {
        let totals = self.totals();
        let pressures = self.pressures_between(self.last_row, totals);
        self.last_row = totals;
        let counters = self.engine.counters();
        let row = SeriesRow {
            time: totals.time,
            wall_time_s: self.meter.wall_time(),
            temperature: self.temperature(),
            pressure_wall: pressures.0,
            pressure_virial: pressures.1,
            pair_collisions: counters.pair_collisions,
            wall_collisions: counters.wall_collisions,
            queue_length: self.engine.queue_length() as u64,
            max_overlap: self.observer.max_overlap,
            energy_drift: self.survey.energy_drift,
        };
        if let Some(series) = &self.setting.options.series {
            // Whoever wrote the series has gone; the run goes on.
            let _ = series.send(row);
        }
    }

    pub(super) fn write_history(&mut self) {
        let (last, wall_before) = self.last_point;
        let totals = self.totals();
        let wall_time = self.meter.wall_time();
        self.last_point = (totals, wall_time);
        let span = totals.time - last.time;
        if !(span > 0.0) {
            return;
        }
        let counters = self.engine.counters();
        let survey = &self.survey;
        let (wall, virial) = self.pressures_between(last, totals);
        // Before the first ball has come to a wall, nothing is known of the pressure there.
        let wall = wall.filter(|_| totals.wall_collisions > 0);
        let pairs = (totals.pair_collisions - last.pair_collisions) as f64;
        let walls = (totals.wall_collisions - last.wall_collisions) as f64;
        let speeds = survey.speeds.as_deref();
        let stretch = Stretch::new(last.time, totals.time, wall_time)
            .with(Observable::Temperature, self.temperature())
            .with(Observable::PressureWall, wall)
            .with(Observable::PressureVirial, virial)
            .with(
                Observable::CompressibilityFactor,
                self.compressibility_factor(wall.or(virial)),
            )
            .with(Observable::PairRate, Some(pairs / span))
            .with(Observable::WallRate, Some(walls / span))
            .with(Observable::EnergyDrift, survey.energy_drift)
            .with(Observable::MomentumDrift, survey.momentum_drift)
            .with(Observable::VirialResidual, survey.virial_residual)
            .with(Observable::MaxOverlap, self.observer.max_overlap)
            .with(
                Observable::SpeedDeviation,
                speeds.map(|speeds| speeds.ks / speeds.ks_critical),
            )
            .with(
                Observable::QueueLength,
                self.queue[1]
                    .take()
                    .filter(|_| counters.queue_length_max > 0),
            )
            .with(Observable::Speed, Some(pairs / (wall_time - wall_before)))
            .with(
                Observable::Memory,
                measure::resident_memory().map(|bytes| bytes as f64),
            );
        Arc::make_mut(&mut self.history).push(stretch);
    }

    /// `P V / (N k T)`, for a pressure.
    pub(super) fn compressibility_factor(&self, pressure: Option<f64>) -> Option<f64> {
        let [x, y, z] = self.setting.origin.card.size;
        let balls = self.setting.origin.card.ball_count as f64;
        pressure
            .zip(self.survey.thermal_energy)
            .map(|(p, energy)| p * x * y * z / (balls * energy))
    }

    pub(super) fn temperature(&self) -> Option<f64> {
        self.survey
            .thermal_energy
            .map(|energy| energy / self.setting.origin.card.units.boltzmann())
    }

    /// Sees where the named balls are, unless that would cost too much wall time.
    pub(super) fn look_closer(&mut self) {
        let named = &self.setting.origin.named;
        if named.is_empty() || Instant::now() < self.closer_look_due {
            return;
        }
        let began = Instant::now();
        self.engine.settle();
        self.closer_look_due = began + began.elapsed().div_f64(CLOSER_LOOK_SHARE);
        let (state, time) = (self.engine.state(), self.time());
        let temperature = self.temperature().filter(|_| !self.reversed());
        self.named = named
            .iter()
            .map(|ball| ball.at(state, temperature, time))
            .collect();
    }

    /// Share of the pressure that its standard error is.
    pub(super) fn pressure_error(&self) -> Option<f64> {
        let pressure = Settled::of(self.engine.state(), &self.observer, &self.pressures).pressure;
        let value = pressure
            .wall
            .or(pressure.virial)
            .filter(|value| *value > 0.0);
        value
            .zip(pressure.standard_error)
            .map(|(value, error)| error / value)
    }

    /// Wall seconds until the standard error of the pressure, now `error`, is `wanted`: it falls with the root of the time.
    pub(super) fn time_to_error(&self, error: Option<f64>) -> Option<(f64, f64)> {
        let share = error? / self.setting.options.until_error?;
        let missing = (self.time() * (share * share - 1.0)).max(0.0);
        let (low, high) = self.meter.time_for(missing)?;
        // An error from some sixty blocks is itself known to a tenth, its square to a fifth.
        Some((0.8 * low, 1.25 * high))
    }

    /// Makes figures and tables of what the observers on demand have found.
    pub(super) fn evaluate_observables(&mut self) {
        let Some((plan, on_demand)) = self
            .setting
            .origin
            .plan
            .as_ref()
            .zip(self.on_demand.as_ref())
        else {
            self.observables = Arc::default();
            return;
        };
        let began = Instant::now();
        let state = self.engine.state();
        let settled = Settled::of(state, &self.observer, &self.pressures);
        let balls = self.setting.origin.card.ball_count as f64;
        let volume: f64 = self.setting.origin.card.size.iter().product();
        let energy = self.survey.thermal_energy.map(|energy| balls * energy);
        let bulk = settled
            .pressure
            .virial
            .filter(|_| settled.pressure.wall.is_none());
        let known = Known {
            temperature: self.temperature(),
            collision_rate: (settled.pair_rate)
                .map(|rate| 2.0 * rate / balls)
                .filter(|rate| *rate > 0.0),
            compressibility_factor: bulk
                .zip(energy)
                .map(|(pressure, energy)| pressure * volume / energy),
        };
        self.observables = Arc::new(plan.results(on_demand, state, known));
        self.observables_due = Instant::now() + survey_pause(began.elapsed());
    }

    pub(super) fn look_at_every_ball(&mut self) {
        let began = Instant::now();
        self.engine.settle();
        self.survey = Survey::of(self.engine.state(), &self.observer);
        self.survey_due = Instant::now() + survey_pause(began.elapsed());
    }
}
