//! `moltop experiment observables`: what each observable costs, on the oxygen, in a dense fluid, or in a scene of the user's.
//!
//! One gas runs on one thread in slices of equally many looks. Slices with nothing observed and slices with one observable take
//! turns, so that what else the machine does, and how the gas ages, falls on both alike. The cost is how much longer the
//! processor takes for a collision.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::error::{Error, Result};
use crate::experiment::fit::median;
use crate::experiment::page::{Options as Common, Outputs, Page, Table, Value};
use crate::experiment::progress::Progress;
use crate::experiment::trial::{Trial, processor_seconds};
use crate::observe::on_demand::{LOOKS_PER_COUNT, OnDemand};
use crate::run::load;
use crate::scene::Scene;
use crate::scene::observe::{Name, Observe};
use crate::worker::engines::{Choice, Wishes};
use crate::worker::observables::{Plan, advance};

/// The dense fluid.
const DENSE: &str = include_str!("../../configs/dense-fluid.toml");

/// Processor time for one observable in one scene \[s\], and with `--quick`.
const BUDGET_S: [f64; 2] = [8.0, 2.0];

/// Processor time of a slice, at least \[s\].
const SLICE_S: f64 = 0.1;

/// Pairs of slices, at least, whatever they cost.
const FEWEST_PAIRS: f64 = 5.0;

/// Mean free times that a gas is given to settle.
const SETTLE: f64 = 60.0;

/// Processor time for that, at the most \[s\].
const SETTLE_S: f64 = 10.0;

/// What the user asks for.
#[derive(Clone, Debug, Default, Args)]
#[group(skip)]
pub struct Options {
    /// What every experiment is asked.
    #[command(flatten)]
    pub common: Common,
    /// Scene to measure on [default: the oxygen and a dense fluid]
    pub scene: Option<PathBuf>,
}

/// What one observable was found to cost.
struct Cost {
    /// Nanoseconds of processor per pair collision.
    each_ns: f64,
    /// How much longer a collision takes, over what it takes alone.
    share: f64,
    /// Standard error of that.
    error: f64,
}

/// Runs the experiment; gives the exit code.
///
/// # Errors
/// When the scene is no good or results cannot be written.
pub fn run(options: &Options) -> Result<u8> {
    let outputs = Outputs::new("observables", &options.common, &["cost"], &[])?;
    let scenes = match &options.scene {
        Some(path) => vec![load(Some(path))?],
        None => vec![
            Scene::oxygen(),
            Scene::parse(Path::new("configs/dense-fluid.toml"), DENSE)?,
        ],
    };
    let budget = BUDGET_S[usize::from(options.common.quick)];
    let kinds = Name::ALL.len() as f64;
    let mut progress = Progress::new(scenes.len() as f64 * (kinds * budget + SETTLE_S))?;
    let columns = [
        "scene",
        "observable",
        "collisions per s, off",
        "ns per collision",
        "cost [%]",
        "error [%]",
    ];
    let mut table = Table::new("cost", "What observing costs", &columns);
    for scene in &scenes {
        let mut bench = Bench::new(scene, budget, &mut progress)?;
        for name in Name::ALL {
            if progress.stopped() {
                break;
            }
            let Some(cost) = bench.cost(scene, name, &mut progress) else {
                continue; // it cannot be measured here
            };
            table.push([
                scene.title.clone().into(),
                name.key().into(),
                Value::Fixed(1e9 * cost.share / cost.each_ns, 0),
                Value::Fixed(cost.each_ns, 1),
                Value::Fixed(100.0 * cost.share, 2),
                Value::Fixed(100.0 * cost.error, 2),
            ]);
        }
    }
    let mut command = "moltop experiment observables".to_owned();
    if let Some(scene) = &options.scene {
        command = format!("{command} {}", scene.display());
    }
    if options.common.quick {
        command.push_str(" --quick");
    }
    let mut page = Page {
        name: "observables",
        title: "What observing costs",
        command,
        tables: vec![table],
        paragraphs: vec![
            "One thread, processor time; pairs of slices, with nothing observed and with one observable, in turn. Looks at all \
             balls are as far apart as the scene says, or a fifth of a mean free time. The cost is how much longer a collision \
             takes: the median of the pairs."
                .to_owned(),
        ],
        plots: Vec::new(),
    };
    if progress.stopped() {
        page.paragraphs
            .push("Interrupted: this is what had been measured.".to_owned());
    }
    outputs.finish(&page)?;
    Ok(progress.code())
}

/// A settled gas, and how long a slice of its course is.
struct Bench {
    trial: Trial,
    every: f64,
    /// Looks in a slice.
    looks: u64,
    /// Pairs of slices for each observable.
    pairs: usize,
}

impl Bench {
    fn new(scene: &Scene, budget: f64, progress: &mut Progress) -> Result<Self> {
        let words = format!("{}: settling", scene.title);
        progress.tell(0.0, &words);
        let placement = scene.place()?;
        let wishes = Wishes {
            engine: scene.engine,
            threads: Some(1),
            ..Wishes::default()
        };
        let choice = Choice::new(&wishes, &placement).map_err(Error::Usage)?;
        let plan = Plan::new(scene, &placement).ok_or_else(|| {
            Error::Usage("a scene without balls has nothing to observe".to_owned())
        })?;
        let every = plan.every();
        let mut trial = Trial::new(choice, &placement);
        let balls = placement.positions.len() as f64;
        drop(placement);
        let begin = processor_seconds();
        let (mut spent, mut looks) = (0.0, 0_u64);
        while spent < SETTLE_S
            && (trial.engine.counters().pair_collisions as f64) < 0.5 * SETTLE * balls
            && !progress.stopped()
        {
            looks += 1;
            trial.run(looks as f64 * every);
            let now = processor_seconds() - begin;
            progress.tell(now - spent, &words);
            spent = now;
        }
        let per_look = spent / looks.max(1) as f64;
        // Structure is counted at every tenth look: slices have whole counts.
        let per_count = per_look * LOOKS_PER_COUNT as f64;
        let counts = (SLICE_S / per_count).ceil().max(1.0);
        Ok(Self {
            trial,
            every,
            looks: counts as u64 * LOOKS_PER_COUNT,
            pairs: (0.5 * budget / (counts * per_count)).max(FEWEST_PAIRS) as usize,
        })
    }

    /// Processor time per pair collision of a slice \[s\].
    fn slice(&mut self, observers: Option<&mut OnDemand>) -> f64 {
        let first = (self.trial.time() / self.every).round();
        let end = (first + self.looks as f64) * self.every;
        let before = self.trial.engine.counters().pair_collisions;
        let Trial { engine, observer } = &mut self.trial;
        let start = processor_seconds();
        let observed = observers.map(|observers| {
            observers.looks = first as u64 + 1;
            (observers, self.every)
        });
        advance(&mut **engine, observer, observed, end).expect("room to move");
        let spent = processor_seconds() - start;
        let collisions = self.trial.engine.counters().pair_collisions - before;
        spent / collisions as f64
    }

    /// What an observable costs; `None` if it cannot be measured in this scene.
    fn cost(&mut self, scene: &Scene, name: Name, progress: &mut Progress) -> Option<Cost> {
        let wish = Scene {
            observe: Observe {
                chosen: vec![name],
                ..scene.observe.clone()
            },
            ..scene.clone()
        };
        crate::scene::observe::refusal(&wish)
            .is_none()
            .then_some(())?;
        self.trial.engine.settle();
        let plan = Plan::new(&wish, &self.trial.state().placement())?;
        let mut observers = plan.observers(self.trial.state())?;
        let words = format!("{}: {}", scene.title, name.key());
        self.slice(Some(&mut observers)); // fills what it remembers
        let (mut alone, mut shares) = (Vec::new(), Vec::new());
        for pair in 0..self.pairs {
            let start = processor_seconds();
            let [off, on] = if pair % 2 == 0 {
                let off = self.slice(None);
                [off, self.slice(Some(&mut observers))]
            } else {
                let on = self.slice(Some(&mut observers));
                [self.slice(None), on]
            };
            alone.push(off);
            shares.push(on / off - 1.0);
            progress.tell(processor_seconds() - start, &words);
            if progress.stopped() {
                return None;
            }
        }
        let share = median(&shares);
        let apart: Vec<f64> = shares.iter().map(|one| (one - share).abs()).collect();
        // The median's error is 1.25 times the mean's, and a normal deviation 1.48 times the median one.
        let deviation = 1.25 * 1.48 * median(&apart);
        Some(Cost {
            each_ns: 1e9 * share * median(&alone),
            share,
            error: deviation / (self.pairs as f64).sqrt(),
        })
    }
}
