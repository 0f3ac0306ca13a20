//! `moltop experiment queue`: how many events wait, and what they cost in memory, calendar by calendar.
//!
//! Redoes the third experiment of the student paper that this program takes up, the seed: 15,625 balls, three simulated
//! minutes. Its program predicted every ball against every other after each collision and pushed all it found into a heap,
//! where what became untrue stayed until its time; then, with an indexed heap, one event per ball. All four ways are run here.

mod every_prediction;

use crate::error::Result;
use crate::experiment::gases::seed_scene;
use crate::experiment::page::{Options, Outputs, Page, Table};
use crate::experiment::plot::{Axis, Plot, Series};
use crate::experiment::progress::Progress;
use crate::experiment::trial::{Trial, processor_seconds, resident_memory};
use crate::state::State;
use crate::worker::engines::{CalendarName, Choice};
use every_prediction::EveryPrediction;

/// Points of a curve.
const SAMPLES: u32 = 30;

/// What the seed found with 15,625 balls in three minutes: most entries and megabytes.
const SEED: [(&str, u64, f64); 2] = [
    ("seed, lazy queue", 2_124_875, 200.0),
    ("seed, indexed queue", 15_625, 4.0),
];

/// One way to keep the events, run.
struct Course {
    name: &'static str,
    /// Simulated time and events waiting.
    samples: Vec<(f64, u64)>,
    longest: u64,
    collisions: u64,
    /// Bytes that the run added to the process.
    memory: Option<u64>,
    seconds: f64,
}

/// Runs the experiment; gives the exit code.
///
/// # Errors
/// When results cannot be written.
pub fn run(options: &Options) -> Result<u8> {
    let outputs = Outputs::new("queue", options, &["queues", "samples"], &["length"])?;
    // Looking at every pair takes half a minute for ten simulated seconds of the paper's 15,625 balls.
    let (edge, time, every_time) = if options.quick {
        (16, 20.0, 5.0)
    } else {
        (25, 180.0, 20.0)
    };
    let gas = seed_scene(edge, 1);
    let balls = gas.positions.len() as u64;
    let cost = balls as f64 * 2.5e-6 * time;
    let every_cost = (balls * balls) as f64 * 1.4e-8 * every_time;
    let mut progress = Progress::new(3.0 * cost + every_cost)?;
    let mut courses = Vec::new();
    // Kept to the end: memory that one run gave back would hide what the next one takes.
    let mut kept = Vec::new();
    for (name, calendar) in [
        ("indexed", CalendarName::Indexed),
        ("bounded", CalendarName::Bounded),
        ("lazy", CalendarName::Lazy),
    ] {
        let before = resident_memory();
        let began = processor_seconds();
        let mut trial = Trial::new(Choice::Event(calendar), &gas);
        let mut course = Course::new(name);
        for sample in 1..=SAMPLES {
            if progress.stopped() {
                break;
            }
            progress.tell(
                cost / f64::from(SAMPLES),
                &format!("calendar {name}, {balls} balls"),
            );
            let now = time * sample_share(sample);
            trial.run(now);
            course
                .samples
                .push((now, trial.engine.queue_length() as u64));
        }
        course.longest = trial.engine.counters().queue_length_max;
        course.collisions = trial.events();
        course.finish(before, began);
        courses.push(course);
        kept.push(trial);
    }
    let before = resident_memory();
    let began = processor_seconds();
    let mut twin = EveryPrediction::new(State::new(&gas));
    let mut course = Course::new("every prediction");
    for sample in 1..=SAMPLES {
        if progress.stopped() {
            break;
        }
        progress.tell(
            every_cost / f64::from(SAMPLES),
            &format!("every prediction, {balls} balls"),
        );
        let now = every_time * sample_share(sample);
        twin.run(now);
        course.samples.push((now, twin.len() as u64));
        course.longest = course.longest.max(twin.len() as u64);
    }
    course.collisions = twin.collisions();
    course.finish(before, began);
    courses.push(course);
    let mut page = page(&courses, balls, options);
    if progress.stopped() {
        page.paragraphs
            .push("Interrupted: this is what had been measured.".to_owned());
    }
    outputs.finish(&page)?;
    Ok(progress.code())
}

/// Share of the time at a sample: close together at first, when queues grow fastest.
fn sample_share(sample: u32) -> f64 {
    let share = f64::from(sample) / f64::from(SAMPLES);
    share * share
}

impl Course {
    fn new(name: &'static str) -> Self {
        Self {
            name,
            samples: Vec::new(),
            longest: 0,
            collisions: 0,
            memory: None,
            seconds: 0.0,
        }
    }

    /// Notes what the run has taken since `memory` was resident and the processor had spent `began` seconds.
    fn finish(&mut self, memory: Option<u64>, began: f64) {
        self.memory = memory
            .zip(resident_memory())
            .map(|(before, now)| now.saturating_sub(before));
        self.seconds = processor_seconds() - began;
    }
}

fn page(courses: &[Course], balls: u64, options: &Options) -> Page {
    let columns = [
        "calendar",
        "balls",
        "time [s]",
        "most events",
        "per ball",
        "memory [MB]",
        "collisions",
        "processor [s]",
    ];
    let mut queues = Table::new(
        "queues",
        "Events waiting, and memory of the whole run",
        &columns,
    );
    let mut samples = Table::only_in_files(
        "samples",
        "Events waiting over time",
        &["calendar", "time [s]", "events"],
    );
    for course in courses {
        let end = course.samples.last().map(|sample| sample.0);
        queues.push([
            course.name.into(),
            balls.into(),
            end.into(),
            course.longest.into(),
            (course.longest as f64 / balls as f64).into(),
            course.memory.map(|bytes| bytes as f64 / 1e6).into(),
            course.collisions.into(),
            course.seconds.into(),
        ]);
        for &(time, events) in &course.samples {
            samples.push([course.name.into(), time.into(), events.into()]);
        }
    }
    for (name, entries, megabytes) in SEED {
        let per_ball = entries as f64 / 15_625.0;
        let none = || None::<f64>.into();
        queues.push([
            name.into(),
            15_625.into(),
            180.0.into(),
            entries.into(),
            per_ball.into(),
            megabytes.into(),
            none(),
            none(),
        ]);
    }
    let curve = |(number, course): (usize, &Course)| {
        let points = course
            .samples
            .iter()
            .map(|&(time, events)| (time, events as f64 / balls as f64));
        let series = Series::numbered(number, course.name, points.collect());
        if course.name == "bounded" {
            series.hollow()
        } else {
            series
        } // the same as indexed, around it
    };
    Page {
        name: "queue",
        title: "Events that wait",
        command: format!("moltop experiment queue{}", if options.quick { " --quick" } else { "" }),
        tables: vec![queues, samples],
        paragraphs: vec![
            "The seed's lazy queue took every prediction of every pair; so does \"every prediction\", which looks at all pairs and \
             is run for a shorter time. Calendar lazy is handed one event per ball and change, so it settles."
                .to_owned(),
        ],
        plots: vec![Plot {
            name: "length",
            title: format!("Events waiting per ball, {balls} balls"),
            x: Axis::logarithmic("simulated time [s]"),
            y: Axis::logarithmic("events per ball"),
            series: courses.iter().enumerate().map(curve).collect(),
        }],
    }
}
