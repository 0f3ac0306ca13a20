//! `moltop experiment observables`: what each observable costs, on the oxygen, in a dense fluid, or in a scene of the user's.
//!
//! One gas runs on one thread from look to look. Stretches with nothing observed and with one observable take turns, so that what
//! else the machine does, and how the gas ages, falls on both alike. The cost is how much longer the processor takes for a
//! collision.

use std::path::{Path, PathBuf};

use clap::Args;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

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
use crate::worker::observables::{Plan, fly};

/// The dense fluid.
const DENSE: &str = include_str!("../../configs/dense-fluid.toml");

/// Processor time for one observable in one scene \[s\], and with `--quick`.
const BUDGET_S: [f64; 2] = [60.0, 5.0];

/// Processor time of a pair, at least \[s\].
const PAIR_S: f64 = 0.2;

/// Pairs, at least, whatever they cost.
const FEWEST_PAIRS: f64 = 3.0;

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
    let mut expected = scenes.len() as f64 * (kinds * budget + SETTLE_S);
    let mut progress = Progress::new(expected)?;
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
        expected += kinds * (bench.seconds() - budget);
        progress.expect(expected);
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
            "One thread, processor time; from look to look, with nothing observed or with one observable, in turn. Looks at all \
             balls are as far apart as the scene says, or a fifth of a mean free time. The cost is how much longer a collision \
             takes: the median over pairs of tens of such stretches."
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

/// A settled gas, and how much of its course is a pair.
struct Bench {
    trial: Trial,
    every: f64,
    /// Looks in a pair.
    looks: u64,
    /// Processor time of a pair \[s\], roughly.
    pair_seconds: f64,
    /// Pairs for each observable.
    pairs: usize,
    /// Which of two stretches comes first.
    random: Xoshiro256PlusPlus,
}

/// What stretches of the gas's course took.
#[derive(Clone, Copy, Default)]
struct Spent {
    seconds: f64,
    collisions: u64,
}

impl Spent {
    /// Processor time per pair collision \[s\].
    fn each(self) -> f64 {
        self.seconds / self.collisions as f64
    }
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
        // Structure is counted at every tenth look: pairs have whole counts.
        let pair = 2.0 * LOOKS_PER_COUNT as f64 * spent / looks.max(1) as f64;
        let counts = (PAIR_S / pair).ceil().max(1.0);
        Ok(Self {
            trial,
            every,
            looks: counts as u64 * LOOKS_PER_COUNT,
            pair_seconds: counts * pair,
            pairs: (budget / (counts * pair)).max(FEWEST_PAIRS) as usize,
            random: Xoshiro256PlusPlus::seed_from_u64(scene.seed),
        })
    }

    /// Processor time for an observable \[s\], roughly.
    fn seconds(&self) -> f64 {
        (self.pairs + 1) as f64 * self.pair_seconds
    }

    /// Runs the gas for the time between two looks, and then looks if there are observers.
    fn stretch(&mut self, observers: Option<&mut OnDemand>, spent: &mut Spent) {
        let next = (self.trial.time() / self.every).round() + 1.0;
        let until = self.trial.state().units.instant(next * self.every);
        let Trial { engine, observer } = &mut self.trial;
        let before = engine.counters().pair_collisions;
        let start = processor_seconds();
        if let Some(observers) = observers {
            fly(&mut **engine, observer, observers, until).expect("room to move");
            engine.settle();
            observers.look(engine.state());
        } else {
            let flown = engine.advance_in_sums(until, &mut |report| observer.take(report));
            flown.expect("room to move");
        }
        spent.seconds += processor_seconds() - start;
        spent.collisions += engine.counters().pair_collisions - before;
    }

    /// What as many stretches took without observers and with them: next to each other, in either order by chance, so that what
    /// engines and machines do now and then falls on both alike.
    fn pair(&mut self, observers: &mut OnDemand) -> [Spent; 2] {
        let [mut off, mut on] = [Spent::default(); 2];
        for _ in 0..self.looks {
            let off_first = self.random.random_bool(0.5);
            if off_first {
                self.stretch(None, &mut off);
            }
            self.stretch(Some(observers), &mut on);
            if !off_first {
                self.stretch(None, &mut off);
            }
        }
        [off, on]
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
        self.pair(&mut observers); // fills what it remembers
        let (mut alone, mut shares) = (Vec::new(), Vec::new());
        for _ in 0..self.pairs {
            let [off, on] = self.pair(&mut observers);
            alone.push(off.each());
            shares.push(on.each() / off.each() - 1.0);
            progress.tell(off.seconds + on.seconds, &words);
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
