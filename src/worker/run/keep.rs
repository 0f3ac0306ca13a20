//! What a run keeps on the disk, and the way back to what it kept.

use std::sync::Arc;
use std::time::Instant;

use super::{Run, SNAPSHOT_EVERY};
use crate::snapshot::Phase;
use crate::worker::SavedRun;
use crate::worker::past::Past;
use crate::worker::writer::Writer;

/// Most marks that are kept.
const MOST_MARKS: usize = 99;

impl Run<'_> {
    /// Starts on the way to a past moment, if there is one and a checkpoint before it.
    pub(super) fn go_back(&mut self, time: f64) -> Option<Past> {
        let refuse = |run: &mut Self, why: &str| {
            run.notice = Some(format!("no way back: {why}"));
            None
        };
        if !(0.0..=self.time()).contains(&time) {
            return refuse(self, "the run has not been there");
        }
        let Some(directory) = self.setting.options.directory.clone() else {
            return refuse(self, "the run has no directory for checkpoints");
        };
        self.notice = None;
        Some(Past::start(
            directory,
            time,
            &self.slot.get(),
            self.reversals.clone(),
        ))
    }

    /// Publishes what has become of the past and of the checkpoints, while the run itself has no news.
    pub(super) fn show_news(&mut self) {
        if self.published.elapsed() < SNAPSHOT_EVERY {
            return;
        }
        let shown = self.slot.get();
        let past = self.past.as_ref().map(Past::latest);
        let new_past = past.is_some_and(|past| {
            (shown.past.as_ref()).is_none_or(|shown| shown.sequence != past.sequence)
        });
        let new_checkpoint = self.writer.as_ref().is_some_and(|writer| {
            writer.count() != shown.checkpoints
                || writer
                    .trouble()
                    .is_some_and(|trouble| shown.notice != Some(trouble))
        });
        if new_past || new_checkpoint {
            self.publish(None);
        }
    }

    /// Whether there may be news soon although the run rests.
    pub(super) fn expects_news(&self) -> bool {
        self.past.as_ref().is_some_and(Past::is_on_its_way)
            || self.writer.as_ref().is_some_and(Writer::is_busy)
    }

    /// Marks a moment that the run has seen, once.
    pub(super) fn mark(&mut self, time: f64) {
        if (0.0..=self.time()).contains(&time)
            && self.marks.len() < MOST_MARKS
            && !self.marks.contains(&time)
        {
            self.marks.push(time);
        }
    }

    /// Writes a checkpoint, if one is due and the one before is on the disk.
    pub(super) fn save_if_due(&mut self) {
        let time = self.time();
        if Instant::now() < self.checkpoint_due || self.writer.as_ref().is_none_or(Writer::is_busy)
        {
            return;
        }
        self.checkpoint_due = self.setting.next_checkpoint();
        if self.saved_at == Some(time) {
            return; // nothing has happened since
        }
        self.saved_at = Some(time);
        self.engine.settle();
        let run = self.save();
        if let Some(writer) = &mut self.writer {
            writer.write(run);
        }
    }

    /// The last checkpoint; waits until it is on the disk.
    pub(super) fn save_at_the_end(&mut self) {
        let Some(mut writer) = self.writer.take() else {
            return;
        };
        // A gas that got stuck is of no use, and one of another time is safe.
        if self.saved_at != Some(self.time()) && !matches!(self.phase, Phase::Failed(_)) {
            self.engine.settle();
            writer.write(self.save());
        }
        writer.finish();
        self.writer = Some(writer);
    }

    pub(super) fn save(&self) -> SavedRun {
        let state = self.engine.state().clone();
        SavedRun {
            origin: Arc::clone(&self.setting.origin),
            engine: self.setting.options.engine,
            until: self.setting.options.until,
            time: self.time(),
            wall_time_s: self.meter.wall_time(),
            time_rate: self.meter.rates().map(|(rate, _)| rate),
            kinetic_energy: state.totals().kinetic_energy,
            state,
            saved: self.engine.save(),
            observer: self.observer.clone(),
            on_demand: self.on_demand.clone(),
            pressures: self.pressures,
            echo: self.echo.clone(),
            meter: self.meter.clone(),
            history: Arc::clone(&self.history),
            last_point: self.last_point,
            last_row: self.last_row,
            rows: self.rows,
            trajectory: (self.setting.options.trajectory.as_ref())
                .and_then(|trajectory| trajectory.mark(self.next_frame)),
            reversals: self.reversals.clone(),
            marks: self.marks.clone(),
        }
    }
}
