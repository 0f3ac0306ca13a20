//! The settings that are compared, and those that a scene does not allow, with the reason.

use clap::ValueEnum;

use crate::engine::statistical::{CAREFUL, Plan, QUICK, Resolution, USUAL};
use crate::quantity::plain;
use crate::scene::analysis::packing_fraction;
use crate::state::{Placement, State};
use crate::worker::engines::{
    CalendarName, Choice, EngineName, Wishes, mean_diameter, pressure_error, thermal_speed,
};

/// Steps, as shares of the time in which a thermal ball flies its own diameter.
const STEPS: [f64; 6] = [
    1.0 / 15.0,
    1.0 / 60.0,
    1.0 / 240.0,
    1.0 / 960.0,
    1.0 / 3600.0,
    1.0 / 14400.0,
];

/// Steps in mean free times and cells in mean free paths, beside the presets.
const RESOLUTIONS: [Resolution; 3] = [
    Resolution {
        step: 0.05,
        cell: 1.0 / 9.3,
    },
    Resolution {
        step: 0.2,
        cell: 1.0 / 3.0,
    },
    Resolution {
        step: 1.0,
        cell: 1.0 / 3.0,
    },
];

/// A way to run the scene.
#[derive(Clone, Debug)]
pub struct Setting {
    /// Engine and knobs in words.
    pub name: String,
    /// The same for the program.
    pub choice: Choice,
    /// What the method gets wrong by its law: pressure, collision rate, diffusion, viscosity; nothing for an exact engine.
    pub law: [f64; 4],
}

impl Setting {
    /// Whether it follows every ball from collision to collision.
    pub fn is_exact(&self) -> bool {
        !matches!(self.choice, Choice::Step(_) | Choice::Statistical { .. })
    }
}

/// What the scene allows, and what it does not, with the reason.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// To be measured, the fastest exact engine first.
    pub allowed: Vec<Setting>,
    /// Engine and reason.
    pub refused: Vec<(String, String)>,
}

impl Settings {
    /// All settings for a gas, with one thread and, if there are more, with `threads`; `wish` is the scene's or the user's
    /// own, for its seed.
    pub fn of(gas: &Placement, threads: usize, seed: u64) -> Self {
        let mut settings = Self::default();
        let wishes = |engine, threads| Wishes {
            engine,
            threads: Some(threads),
            seed,
            ..Wishes::default()
        };
        let exact = [EngineName::Windowed, EngineName::Event];
        let usual = Choice::new(&wishes(EngineName::Auto, 1), gas).unwrap_or_default();
        let order = if usual.name() == "event" {
            [1, 0]
        } else {
            [0, 1]
        };
        for engine in order.map(|place| exact[place]) {
            if engine == EngineName::Event {
                settings.add("event", &wishes(engine, 1), gas);
                for (name, calendar) in [
                    ("event, lazy calendar", CalendarName::Lazy),
                    ("event, bounded calendar", CalendarName::Bounded),
                ] {
                    let wishes = Wishes {
                        calendar: Some(calendar),
                        ..wishes(engine, 1)
                    };
                    settings.add(name, &wishes, gas);
                }
            } else if settings.add("windowed", &wishes(engine, 1), gas) && threads > 1 {
                let name = format!("windowed, {threads} threads");
                settings.add(&name, &wishes(engine, threads), gas);
            }
        }
        settings.add("reversible", &wishes(EngineName::Reversible, 1), gas);
        let diameter_time = mean_diameter(gas) / thermal_speed(gas);
        for share in STEPS {
            let wishes = Wishes {
                step: Some(share * diameter_time).filter(|step| *step > 0.0 && step.is_finite()),
                ..wishes(EngineName::Step, 1)
            };
            let name = format!("step, 1/{:.0} d/sigma", 1.0 / share);
            if !settings.add(&name, &wishes, gas) {
                break; // the reason is the same for all
            }
        }
        let mut resolutions = [[CAREFUL, USUAL, QUICK], RESOLUTIONS].concat();
        resolutions.sort_by(|a, b| {
            (a.step, a.cell)
                .partial_cmp(&(b.step, b.cell))
                .expect("numbers")
        });
        for resolution in resolutions {
            let several = (resolution == USUAL && threads > 1).then_some(threads);
            for threads in std::iter::once(1).chain(several) {
                let wishes = Wishes {
                    step_fraction: Some(resolution.step),
                    cells_per_path: Some(resolution.cell.recip()),
                    ..wishes(EngineName::Statistical, threads)
                };
                let name = statistical(resolution, threads, gas);
                if settings.allowed.iter().any(|setting| setting.name == name) {
                    continue; // the balls are too few for finer cells
                }
                if !settings.add(&name, &wishes, gas) {
                    return settings;
                }
            }
        }
        settings
    }

    /// Adds a setting, or the reason why there is none.
    fn add(&mut self, name: &str, wishes: &Wishes, gas: &Placement) -> bool {
        match Choice::new(wishes, gas) {
            Ok(choice) => {
                self.push(name.to_owned(), choice, gas);
                true
            }
            Err(reason) => {
                let engine = name.split(',').next().unwrap_or(name);
                let reason = reason.split(": give --engine").next().unwrap_or(&reason);
                let reason = reason
                    .strip_prefix("engine ")
                    .and_then(|rest| rest.strip_prefix(engine))
                    .unwrap_or(reason)
                    .trim_start_matches([':', ' ']);
                self.refused.push((engine.to_owned(), reason.to_owned()));
                false
            }
        }
    }

    /// The same with these choices, as far as they are not there.
    pub fn with(mut self, choices: impl Iterator<Item = Choice>, gas: &Placement) -> Self {
        for choice in choices {
            if let Choice::Statistical {
                resolution,
                threads,
                ..
            } = choice
                && !self.allowed.iter().any(|setting| setting.choice == choice)
            {
                self.push(statistical(resolution, threads, gas), choice, gas);
            }
        }
        self
    }

    /// The first, which others are held against, and those of these engines; all if there are none.
    pub fn only(mut self, engines: &[EngineName]) -> Self {
        let names: Vec<String> = engines
            .iter()
            .filter_map(ValueEnum::to_possible_value)
            .map(|name| name.get_name().to_owned())
            .collect();
        if names.is_empty() {
            return self;
        }
        let wanted = |name: &str| names.iter().any(|wanted| wanted == name);
        let first = self.allowed.first().map(|setting| setting.choice);
        self.allowed
            .retain(|setting| Some(setting.choice) == first || wanted(setting.choice.name()));
        self.refused.retain(|(engine, _)| wanted(engine));
        self
    }

    fn push(&mut self, name: String, choice: Choice, gas: &Placement) {
        let law = match choice {
            Choice::Statistical { resolution, .. } => Plan::new(&State::new(gas), resolution, true)
                .map_or([0.0; 4], |plan| {
                    let errors = plan.errors();
                    [
                        errors.pressure,
                        errors.collision_rate,
                        errors.diffusion,
                        errors.viscosity,
                    ]
                }),
            Choice::Step(step) => {
                let way = step * thermal_speed(gas) / mean_diameter(gas);
                [
                    pressure_error(way, packing_fraction(gas)),
                    2.0 / 3.0 * way * way,
                    0.0,
                    0.0,
                ]
                .map(|law| if law.is_finite() { law.min(1.0) } else { 0.0 })
            }
            _ => [0.0; 4],
        };
        self.allowed.push(Setting { name, choice, law });
    }
}

fn statistical(resolution: Resolution, threads: usize, gas: &Placement) -> String {
    let cells = Plan::new(&State::new(gas), resolution, true).map_or_else(
        |_| String::new(),
        |plan| {
            format!(
                ", cells of {} paths, {:.0} balls",
                short(plan.resolution.cell),
                plan.balls_per_cell
            )
        },
    );
    let threads = if threads > 1 {
        format!(", {threads} threads")
    } else {
        String::new()
    };
    format!(
        "statistical, f = {}{cells}{threads}",
        short(resolution.step)
    )
}

/// Two decimals, without the zeros that say nothing.
fn short(number: f64) -> String {
    if number < 0.005 {
        return plain(number);
    }
    let text = format!("{number:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
