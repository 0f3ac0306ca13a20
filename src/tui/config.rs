//! The user's settings of the dashboard: a TOML file.
//!
//! Always holds: a file with a fault is refused as a whole, and every fault is named with its line. What the command line or
//! the environment says counts more.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use etcetera::BaseStrategy;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{Error, Result};
use crate::tui::keys::{self, Keymap};
use crate::tui::theme::{Colors, Theme};

/// What the file says; `None` where it is silent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// 7-bit characters only.
    pub ascii: Option<bool>,
    /// Colours that are sent.
    pub colors: Option<Colors>,
    /// Colours that are chosen.
    pub theme: Option<Theme>,
    /// Most bytes per second.
    pub max_bytes_per_s: Option<u32>,
    /// Most pictures per second.
    pub pictures_per_s: Option<f64>,
    /// Whether the mouse is listened to.
    pub mouse: Option<bool>,
    /// Whether the last screen is left on the terminal.
    pub keep_screen: Option<bool>,
    /// Which key does what.
    pub keymap: Keymap,
}

/// Where the settings are: `$XDG_CONFIG_HOME/moltop/config.toml`.
pub fn path() -> Option<PathBuf> {
    let base = etcetera::choose_base_strategy().ok()?;
    Some(base.config_dir().join("moltop").join("config.toml"))
}

/// A file with every setting at its default, each with what it means.
pub fn template() -> String {
    let place = path().map_or("moltop/config.toml".into(), |path| {
        path.display().to_string()
    });
    let mut text = format!(
        "# Settings of moltop's dashboard: {place}\n\
         # What is left out, or begins with #, has the value that stands here. The command line counts more.\n\
         # `moltop config --check` looks for faults.\n\
         \n\
         [screen]\n\
         # ascii = false            # 7-bit characters only; where the locale is not UTF-8 always\n\
         # colors = \"auto\"          # {}\n\
         # theme = \"any\"            # {}\n\
         # max_bytes_per_s = 8000   # on a slow line the picture waits first, the numbers last\n\
         # pictures_per_s = 1.0     # pictures of the gas per second at the most\n\
         # mouse = true             # with the mouse on, most terminals select text while shift is held\n\
         # keep_screen = false      # leave the last screen on the terminal when the dashboard closes\n\
         \n\
         [keys]                     # a letter, f1 to f12, ctrl- and a letter, or one of\n\
         # space enter esc tab backtab backspace delete insert left right up down home end pageup pagedown\n",
        choices::<Colors>(),
        choices::<Theme>(),
    );
    for entry in keys::entries() {
        let names: Vec<String> = entry
            .keys
            .iter()
            .map(|key| quoted(&keys::name(*key)))
            .collect();
        let line = format!("# {} = [{}]", entry.name, names.join(", "));
        let help = keys::KEYS
            .iter()
            .find(|binding| std::ptr::eq(&raw const binding.entries[0], entry))
            .map_or(String::new(), |binding| format!("  # {}", binding.help));
        let _ = writeln!(text, "{line:<32}{help}");
    }
    text
}

fn quoted(text: &str) -> String {
    format!("{text:?}")
}

fn choices<T: ValueEnum>() -> String {
    let names: Vec<String> = T::value_variants()
        .iter()
        .filter_map(ValueEnum::to_possible_value)
        .map(|choice| choice.get_name().to_owned())
        .collect();
    names.join(", ")
}

/// The user's settings; the defaults where there is no file.
///
/// # Errors
/// [`Error::Usage`] with every fault of the file.
pub fn load() -> Result<Config> {
    let Some(path) = path() else {
        return Ok(Config::default());
    };
    match std::fs::read_to_string(&path) {
        Ok(text) => parse(&path, &text),
        Err(_) if !path.exists() => Ok(Config::default()),
        Err(source) => Err(Error::File {
            path,
            action: "read",
            source,
        }),
    }
}

/// Reads settings.
///
/// # Errors
/// [`Error::Usage`] with every fault, each with file and line.
pub fn parse(path: &Path, text: &str) -> Result<Config> {
    let mut reader = Reader {
        path,
        text,
        faults: Vec::new(),
    };
    let mut config = Config::default();
    match DeTable::parse(text) {
        Ok(table) => reader.file(table.get_ref(), &mut config),
        Err(error) => {
            let at = error.span().map_or(0, |span| span.start);
            reader.fault(at, error.message());
        }
    }
    if reader.faults.is_empty() {
        Ok(config)
    } else {
        Err(Error::Usage(reader.faults.join("\n")))
    }
}

struct Reader<'a> {
    path: &'a Path,
    text: &'a str,
    faults: Vec<String>,
}

impl Reader<'_> {
    fn fault(&mut self, at: usize, words: &str) {
        let line = self.text[..at.min(self.text.len())].matches('\n').count() + 1;
        let words = words.lines().collect::<Vec<_>>().join(", ");
        self.faults
            .push(format!("{}:{line}: {words}", self.path.display()));
    }

    fn file(&mut self, table: &DeTable, config: &mut Config) {
        for (name, value) in table {
            let known = ["screen", "keys"].contains(&name.get_ref().as_ref());
            match (name.get_ref().as_ref(), value.get_ref()) {
                ("screen", DeValue::Table(table)) => self.screen(table, config),
                ("keys", DeValue::Table(table)) => self.keys(table, config),
                _ if known => self.fault(name.span().start, "must be a table"),
                (other, _) => self.fault(
                    name.span().start,
                    &format!("{other}: unknown: there are [screen] and [keys]"),
                ),
            }
        }
    }

    fn screen(&mut self, table: &DeTable, config: &mut Config) {
        for (name, value) in table {
            let key = name.get_ref().as_ref();
            let fault = match key {
                "ascii" => set(
                    &mut config.ascii,
                    value.get_ref().as_bool(),
                    "true or false",
                ),
                "mouse" => set(
                    &mut config.mouse,
                    value.get_ref().as_bool(),
                    "true or false",
                ),
                "keep_screen" => set(
                    &mut config.keep_screen,
                    value.get_ref().as_bool(),
                    "true or false",
                ),
                "colors" => set(&mut config.colors, chosen(value), &choices::<Colors>()),
                "theme" => set(&mut config.theme, chosen(value), &choices::<Theme>()),
                "max_bytes_per_s" => {
                    let bytes = number(value).filter(|bytes| (50.0..=1e9).contains(bytes));
                    set(
                        &mut config.max_bytes_per_s,
                        bytes.map(|bytes| bytes as u32),
                        "a number from 50",
                    )
                }
                "pictures_per_s" => {
                    let rate = number(value).filter(|rate| (0.01..=30.0).contains(rate));
                    set(&mut config.pictures_per_s, rate, "a number from 0.01 to 30")
                }
                _ => Some("unknown: `moltop config` prints every setting".to_owned()),
            };
            if let Some(words) = fault {
                self.fault(name.span().start, &format!("screen.{key}: {words}"));
            }
        }
    }

    fn keys(&mut self, table: &DeTable, config: &mut Config) {
        let mut places = Vec::new();
        for (name, value) in table {
            let text = name.get_ref().as_ref();
            let at = name.span().start;
            let Some(entry) = keys::entries().find(|entry| entry.name == text) else {
                self.fault(
                    at,
                    &format!("keys.{text}: unknown: `moltop config` prints every action"),
                );
                continue;
            };
            let single = [value.clone()];
            let list: &[Spanned<DeValue>] = match value.get_ref() {
                DeValue::Array(list) => list,
                _ => &single,
            };
            let mut keys = Vec::new();
            for key in list {
                let parsed = key.get_ref().as_str().and_then(keys::parse);
                match parsed {
                    Some(parsed) => keys.push(parsed),
                    None => self.fault(
                        key.span().start,
                        &format!("keys.{text}: no key: a letter, a name such as \"space\" or \"pageup\", f1 to f12, or ctrl- and a letter"),
                    ),
                }
            }
            config.keymap.rebind(entry.action, &keys);
            places.push((at, text.to_owned(), keys));
        }
        for (at, text, keys) in places {
            for key in keys {
                if config.keymap.uses(key) > 1 {
                    let name = keys::name(key);
                    self.fault(
                        at,
                        &format!("keys.{text}: {name:?} does something else too"),
                    );
                }
            }
        }
        let quit = config.keymap.key(keys::Action::Quit);
        if quit.is_none() {
            self.fault(0, "keys.quit: needs a key");
        }
    }
}

/// Takes a value over; words for what was expected where there is none.
fn set<T>(place: &mut Option<T>, value: Option<T>, expected: &str) -> Option<String> {
    *place = value;
    place.is_none().then(|| format!("must be {expected}"))
}

fn chosen<T: ValueEnum>(value: &Spanned<DeValue>) -> Option<T> {
    let number = number(value).map(|number| number.to_string());
    let text = value.get_ref().as_str().or(number.as_deref())?;
    T::from_str(text, false).ok()
}

fn number(value: &Spanned<DeValue>) -> Option<f64> {
    match value.get_ref() {
        DeValue::Integer(number) => number.as_str().replace('_', "").parse().ok(),
        DeValue::Float(number) => number.as_str().replace('_', "").parse().ok(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

    use super::*;
    use crate::tui::keys::Action;

    fn read(text: &str) -> Result<Config> {
        parse(Path::new("config.toml"), text)
    }

    #[test]
    fn the_template_says_the_defaults_also_with_its_comments_taken_away() {
        let template = template();
        assert_eq!(read(&template).expect("good"), Config::default());
        let bare: Vec<&str> = template
            .lines()
            .map(|line| match line.strip_prefix("# ") {
                Some(setting) if setting.contains(" = ") => setting,
                _ => line,
            })
            .collect();
        let config = read(&bare.join("\n")).expect("good");
        let press = |code| {
            let key = KeyEvent::new(code, KeyModifiers::NONE);
            (config.keymap.action(&key), Keymap::default().action(&key))
        };
        for entry in keys::entries().flat_map(|entry| entry.keys) {
            let (read, default) = press(entry.code);
            assert_eq!(read, default, "{entry:?}");
        }
        assert_eq!(config.max_bytes_per_s, Some(8000));
        assert_eq!(config.theme, Some(Theme::Any));
    }

    #[track_caller]
    fn check_fault(text: &str, expected: &str) {
        let words = read(text).expect_err("a fault").to_string();
        assert!(words.contains(expected), "{words}");
    }

    #[test]
    fn faults_are_named_with_their_line() {
        check_fault(
            "\n[screen]\nascci = true",
            "config.toml:3: screen.ascci: unknown",
        );
        check_fault(
            "[screen]\ntheme = \"pink\"",
            "config.toml:2: screen.theme: must be any, dark",
        );
        check_fault(
            "[screen]\nmax_bytes_per_s = 3",
            "screen.max_bytes_per_s: must be a number from 50",
        );
        check_fault(
            "[keys]\n\npause = [\"banana\"]",
            "config.toml:3: keys.pause: no key",
        );
        check_fault("[keys]\njump = \"x\"", "config.toml:2: keys.jump: unknown");
        check_fault(
            "[keys]\npause = \"r\"",
            "config.toml:2: keys.pause: \"r\" does something else too",
        );
        check_fault("[keys]\nquit = []", "keys.quit: needs a key");
        check_fault("[screen\n", "config.toml:1:");
        check_fault("colour = 1", "config.toml:1: colour: unknown");
    }

    #[test]
    fn keys_can_be_exchanged() {
        let config = read("[keys]\npause = \"r\"\nreverse = [\"space\", \"f2\"]").expect("good");
        let press = |code| {
            config
                .keymap
                .action(&KeyEvent::new(code, KeyModifiers::NONE))
        };
        assert_eq!(press(KeyCode::Char('r')), Some(Action::Pause));
        assert_eq!(press(KeyCode::Char(' ')), Some(Action::Reverse));
        assert_eq!(press(KeyCode::F(2)), Some(Action::Reverse));
    }
}
