//! The keys: one table that drives handling, help, footer, configuration file and manual page.

use std::fmt::Write;

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Pause or resume the run.
    Pause,
    /// Reverse time.
    Reverse,
    /// Run one sample, then pause.
    Step,
    /// Lower the ceiling on simulated time per wall second.
    Slower,
    /// Raise that ceiling, or lift it.
    Faster,
    /// Turn the view to the left.
    TurnLeft,
    /// Turn the view to the right.
    TurnRight,
    /// Look from higher up.
    TurnUp,
    /// Look from further down.
    TurnDown,
    /// Let the picture turn by itself.
    Rotate,
    /// Enlarge the picture.
    ZoomIn,
    /// Shrink the picture.
    ZoomOut,
    /// Switch between slab and whole depth.
    SwitchView,
    /// Make the slab thinner.
    Thinner,
    /// Make the slab thicker.
    Thicker,
    /// Move the slab towards the eye.
    Nearer,
    /// Move the slab away from the eye.
    Farther,
    /// Set camera and slab back.
    ResetCamera,
    /// Fill the window with a panel, by its number, or go back.
    Panel(u8),
    /// Choose the next observable.
    NextObservable,
    /// Observe the chosen observable, or no more.
    Observe,
    /// Choose the next panel.
    NextPanel,
    /// Choose the panel before.
    PreviousPanel,
    /// Fill the window with the chosen panel, or go back.
    Enlarge,
    /// Go back to all panels.
    Back,
    /// Show a longer part of the history.
    HistoryLonger,
    /// Show a shorter part of the history.
    HistoryShorter,
    /// Go back in the history.
    Earlier,
    /// Go forward in the history.
    Later,
    /// Go to the newest part of the history.
    Live,
    /// Mark this moment in the history.
    Mark,
    /// Freeze or thaw the screen.
    Freeze,
    /// Write a checkpoint.
    Checkpoint,
    /// Show the run as it was at a past time.
    Goto,
    /// Write the screen to files.
    Copy,
    /// Draw the whole screen again.
    Redraw,
    /// Show the help.
    Help,
    /// Leave; the run goes on.
    Detach,
    /// Leave, and ask what is to become of the run.
    Quit,
}

/// A key: its code, and whether Ctrl is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// The key.
    pub code: KeyCode,
    /// Whether Ctrl is held.
    pub control: bool,
}

/// An action with its name in the configuration file and its keys unless that file says otherwise; the first is shown.
pub struct Entry {
    /// What it does.
    pub action: Action,
    /// Its name in the configuration file.
    pub name: &'static str,
    /// Its keys.
    pub keys: &'static [Key],
}

/// One line of the help: keys that belong together.
pub struct Binding {
    /// The actions.
    pub entries: &'static [Entry],
    /// A word or two for the footer.
    pub short: &'static str,
    /// A sentence for the help.
    pub help: &'static str,
    /// Place in the queue for the footer's room: low numbers first; the last have none.
    pub rank: u8,
}

const fn key(letter: char) -> Key {
    Key {
        code: KeyCode::Char(letter),
        control: false,
    }
}

const fn named(code: KeyCode) -> Key {
    Key {
        code,
        control: false,
    }
}

const fn entry(action: Action, name: &'static str, keys: &'static [Key]) -> Entry {
    Entry { action, name, keys }
}

/// Rank of what the footer has no room for.
pub const NEVER: u8 = 99;

/// All keys, in the order of help and footer.
pub const KEYS: &[Binding] = &[
    Binding {
        entries: &[entry(Action::Pause, "pause", &[key(' ')])],
        short: "pause",
        help: "pause the run, or let it go on",
        rank: 2,
    },
    Binding {
        entries: &[entry(Action::Reverse, "reverse", &[key('r')])],
        short: "reverse",
        help: "reverse time: every molecule turns back",
        rank: 3,
    },
    Binding {
        entries: &[entry(Action::Step, "step", &[key('s')])],
        short: "step",
        help: "run one sample, then pause",
        rank: 9,
    },
    Binding {
        entries: &[
            entry(Action::Slower, "slower", &[key(',')]),
            entry(Action::Faster, "faster", &[key('.')]),
        ],
        short: "slower faster",
        help: "ceiling on simulated time per second: lower, higher",
        rank: 8,
    },
    Binding {
        entries: &[entry(Action::Freeze, "freeze", &[key('f')])],
        short: "freeze",
        help: "freeze the screen; the run goes on behind it",
        rank: 7,
    },
    Binding {
        entries: &[
            entry(Action::TurnLeft, "turn-left", &[named(KeyCode::Left)]),
            entry(Action::TurnUp, "turn-up", &[named(KeyCode::Up)]),
            entry(Action::TurnDown, "turn-down", &[named(KeyCode::Down)]),
            entry(Action::TurnRight, "turn-right", &[named(KeyCode::Right)]),
        ],
        short: "turn",
        help: "turn the picture: azimuth, elevation (or drag it)",
        rank: 4,
    },
    Binding {
        entries: &[entry(Action::Rotate, "rotate", &[key('a')])],
        short: "rotate",
        help: "let the picture turn by itself, or stop it",
        rank: 14,
    },
    Binding {
        entries: &[
            entry(Action::ZoomIn, "zoom-in", &[key('+'), key('=')]),
            entry(Action::ZoomOut, "zoom-out", &[key('-')]),
        ],
        short: "zoom",
        help: "enlarge or shrink the picture (or the wheel)",
        rank: 11,
    },
    Binding {
        entries: &[entry(Action::SwitchView, "view", &[key('v')])],
        short: "view",
        help: "slab of single molecules, or density over the whole depth",
        rank: 10,
    },
    Binding {
        entries: &[
            entry(Action::Thinner, "thinner", &[key('t')]),
            entry(Action::Thicker, "thicker", &[key('T')]),
        ],
        short: "slab",
        help: "thinner or thicker slab",
        rank: 12,
    },
    Binding {
        entries: &[
            entry(Action::Nearer, "nearer", &[named(KeyCode::PageDown)]),
            entry(Action::Farther, "farther", &[named(KeyCode::PageUp)]),
        ],
        short: "slice",
        help: "move the slab towards you or away from you",
        rank: 13,
    },
    Binding {
        entries: &[entry(
            Action::ResetCamera,
            "reset-view",
            &[named(KeyCode::Home)],
        )],
        short: "reset view",
        help: "set angle, zoom and slab back",
        rank: 18,
    },
    Binding {
        entries: &[
            entry(Action::Panel(1), "panel-1", &[key('1')]),
            entry(Action::Panel(2), "panel-2", &[key('2')]),
            entry(Action::Panel(3), "panel-3", &[key('3')]),
            entry(Action::Panel(4), "panel-4", &[key('4')]),
            entry(Action::Panel(5), "panel-5", &[key('5')]),
            entry(Action::Panel(6), "panel-6", &[key('6')]),
            entry(Action::Panel(7), "panel-7", &[key('7')]),
            entry(Action::Panel(8), "panel-8", &[key('8')]),
            entry(Action::Panel(9), "panel-9", &[key('9')]),
        ],
        short: "panels",
        help: "a panel in the whole window, and back: gas, now, speeds, run, history, events, trust, link, observables",
        rank: 5,
    },
    Binding {
        entries: &[
            entry(Action::NextObservable, "next-observable", &[key('o')]),
            entry(Action::Observe, "observe", &[key('O')]),
        ],
        short: "observables",
        help: "observables: show them, the next one, on or off",
        rank: 24,
    },
    Binding {
        entries: &[
            entry(Action::NextPanel, "next-panel", &[named(KeyCode::Tab)]),
            entry(
                Action::PreviousPanel,
                "previous-panel",
                &[named(KeyCode::BackTab)],
            ),
        ],
        short: "choose",
        help: "choose the next panel, or the one before",
        rank: 20,
    },
    Binding {
        entries: &[
            entry(Action::Enlarge, "enlarge", &[named(KeyCode::Enter)]),
            entry(Action::Back, "back", &[named(KeyCode::Esc)]),
        ],
        short: "enlarge back",
        help: "fill the window with the chosen panel; back to all",
        rank: 21,
    },
    Binding {
        entries: &[
            entry(Action::HistoryLonger, "history-longer", &[key('[')]),
            entry(Action::HistoryShorter, "history-shorter", &[key(']')]),
        ],
        short: "time span",
        help: "longer or shorter part of the history in the charts",
        rank: 15,
    },
    Binding {
        entries: &[
            entry(Action::Earlier, "earlier", &[key('<')]),
            entry(Action::Later, "later", &[key('>')]),
            entry(Action::Live, "live", &[key('0')]),
        ],
        short: "past",
        help: "earlier, later in the charts; back to now, also from g",
        rank: 16,
    },
    Binding {
        entries: &[entry(Action::Mark, "mark", &[key('m')])],
        short: "mark",
        help: "mark this moment in the charts, for all who watch",
        rank: 17,
    },
    Binding {
        entries: &[entry(Action::Goto, "goto", &[key('g')])],
        short: "go to",
        help: "the gas as it was at a past time, beside the run, which goes on",
        rank: 22,
    },
    Binding {
        entries: &[entry(Action::Checkpoint, "checkpoint", &[key('c')])],
        short: "checkpoint",
        help: "write a checkpoint now",
        rank: 23,
    },
    Binding {
        entries: &[entry(Action::Copy, "copy", &[key('w')])],
        short: "copy",
        help: "write this screen to two files, as text and as SVG",
        rank: 19,
    },
    Binding {
        entries: &[entry(
            Action::Redraw,
            "redraw",
            &[Key {
                code: KeyCode::Char('l'),
                control: true,
            }],
        )],
        short: "redraw",
        help: "draw the whole screen again",
        rank: NEVER,
    },
    Binding {
        entries: &[entry(Action::Help, "help", &[key('?'), key('h')])],
        short: "help",
        help: "this help; / searches in it",
        rank: 1,
    },
    Binding {
        entries: &[entry(Action::Detach, "detach", &[key('d')])],
        short: "detach",
        help: "leave, and let the run go on (also Ctrl-C)",
        rank: 6,
    },
    Binding {
        entries: &[entry(Action::Quit, "quit", &[key('q')])],
        short: "quit",
        help: "stop the run, or leave it running",
        rank: 0,
    },
];

/// All entries of the table.
pub fn entries() -> impl Iterator<Item = &'static Entry> {
    KEYS.iter().flat_map(|binding| binding.entries)
}

/// Which key does what.
#[derive(Clone, Debug, PartialEq)]
pub struct Keymap {
    keys: Vec<(Key, Action)>,
}

impl Default for Keymap {
    fn default() -> Self {
        let keys = entries().flat_map(|entry| entry.keys.iter().map(|key| (*key, entry.action)));
        Self {
            keys: keys.collect(),
        }
    }
}

impl Keymap {
    /// Gives an action other keys than it had. Whoever does so sees to it that no key does two things.
    pub fn rebind(&mut self, action: Action, keys: &[Key]) {
        self.keys.retain(|(_, other)| *other != action);
        self.keys.extend(keys.iter().map(|key| (*key, action)));
    }

    /// What a key does, if anything.
    pub fn action(&self, pressed: &KeyEvent) -> Option<Action> {
        if pressed.modifiers.contains(KeyModifiers::ALT) {
            return None;
        }
        let key = Key {
            code: pressed.code,
            control: pressed.modifiers.contains(KeyModifiers::CONTROL),
        };
        let found = self.keys.iter().find(|(other, _)| *other == key);
        found.map(|(_, action)| *action)
    }

    /// How many actions a key has.
    pub fn uses(&self, key: Key) -> usize {
        self.keys.iter().filter(|(other, _)| *other == key).count()
    }

    /// The key of an action that is shown; `None` if it has none.
    pub fn key(&self, action: Action) -> Option<Key> {
        let found = self.keys.iter().find(|(_, other)| *other == action);
        found.map(|(key, _)| *key)
    }

    /// The keys of a line of the help, as the screen names them: the first of each action.
    pub fn shown(&self, binding: &Binding) -> String {
        let keys = binding
            .entries
            .iter()
            .filter_map(|entry| self.key(entry.action));
        let names: Vec<String> = keys.map(symbol).collect();
        match (names.first(), names.last()) {
            // A row such as 1 to 8.
            (Some(first), Some(last)) if names.len() > 4 => format!("{first}-{last}"),
            _ if names.iter().all(|name| "←↑↓→".contains(name.as_str())) => names.concat(),
            _ => names.join(" "),
        }
    }
}

/// Codes with a name, and how the screen shows them.
const NAMES: [(KeyCode, &str, &str); 16] = [
    (KeyCode::Char(' '), "space", "space"),
    (KeyCode::Enter, "enter", "enter"),
    (KeyCode::Esc, "esc", "esc"),
    (KeyCode::Tab, "tab", "tab"),
    (KeyCode::BackTab, "backtab", "shift-tab"),
    (KeyCode::Backspace, "backspace", "backspace"),
    (KeyCode::Delete, "delete", "del"),
    (KeyCode::Insert, "insert", "ins"),
    (KeyCode::Left, "left", "←"),
    (KeyCode::Right, "right", "→"),
    (KeyCode::Up, "up", "↑"),
    (KeyCode::Down, "down", "↓"),
    (KeyCode::Home, "home", "home"),
    (KeyCode::End, "end", "end"),
    (KeyCode::PageUp, "pageup", "pgup"),
    (KeyCode::PageDown, "pagedown", "pgdn"),
];

/// A key as the screen shows it.
fn symbol(key: Key) -> String {
    let known = NAMES.iter().find(|(code, ..)| *code == key.code);
    let name = known.map_or_else(|| plain_name(key.code), |(.., shown)| (*shown).to_owned());
    if key.control {
        format!("ctrl-{name}")
    } else {
        name
    }
}

fn plain_name(code: KeyCode) -> String {
    match code {
        KeyCode::Char(letter) => letter.to_string(),
        KeyCode::F(number) => format!("f{number}"),
        other => format!("{other:?}").to_lowercase(),
    }
}

/// A key as the configuration file names it: `a`, `space`, `pageup`, `f5`, `ctrl-l`.
pub fn name(key: Key) -> String {
    let known = NAMES.iter().find(|(code, ..)| *code == key.code);
    let name = known.map_or_else(|| plain_name(key.code), |(_, name, _)| (*name).to_owned());
    if key.control {
        format!("ctrl-{name}")
    } else {
        name
    }
}

/// The key that a name of the configuration file means.
pub fn parse(text: &str) -> Option<Key> {
    let (control, rest) = match text.strip_prefix("ctrl-") {
        Some(rest) => (true, rest),
        None => (false, text),
    };
    let mut letters = rest.chars();
    let single = letters.next().filter(|_| letters.next().is_none());
    let named = NAMES.iter().find(|(_, name, _)| *name == rest);
    let function = || {
        let number = rest.strip_prefix('f')?.parse().ok()?;
        (1..=12).contains(&number).then_some(KeyCode::F(number))
    };
    let code = named
        .map(|(code, ..)| *code)
        .or(single.map(KeyCode::Char))
        .or_else(function)?;
    Some(Key { code, control })
}

/// The section of the manual page.
pub fn manual() -> String {
    let keymap = Keymap::default();
    let mut text =
        String::from(".SH KEYS\nOf the dashboard. `moltop config` says how to change them.\n");
    for binding in KEYS {
        let shown = keymap.shown(binding).replace("←↑↓→", "arrows");
        let escape = |text: &str| text.replace('\\', "\\e").replace('-', "\\-");
        let _ = write!(
            text,
            ".TP\n\\fB{}\\fR\n{}\n",
            escape(&shown),
            escape(binding.help)
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_and_no_name_stands_twice_in_the_table() {
        let keys: Vec<_> = entries().flat_map(|entry| entry.keys).collect();
        for (place, key) in keys.iter().enumerate() {
            assert!(!keys[..place].contains(key), "{key:?}");
        }
        let names: Vec<_> = entries().map(|entry| entry.name).collect();
        for (place, name) in names.iter().enumerate() {
            assert!(!names[..place].contains(name), "{name}");
        }
    }

    #[test]
    fn no_rank_stands_twice_in_the_table() {
        let ranks: Vec<u8> = KEYS.iter().map(|binding| binding.rank).collect();
        for (place, rank) in ranks.iter().enumerate() {
            assert!(*rank == NEVER || !ranks[..place].contains(rank), "{rank}");
        }
    }

    #[test]
    fn names_of_keys_read_back() {
        for key in entries().flat_map(|entry| entry.keys) {
            assert_eq!(parse(&name(*key)), Some(*key));
        }
        assert_eq!(parse("f12"), Some(named(KeyCode::F(12))));
        assert_eq!(parse("f13"), None);
        assert_eq!(parse("µ"), Some(named(KeyCode::Char('µ'))));
        assert_eq!(parse(""), None);
        assert_eq!(parse("banana"), None);
    }

    #[test]
    fn the_screen_names_keys_shortly() {
        let keymap = Keymap::default();
        let shown: Vec<String> = KEYS.iter().map(|binding| keymap.shown(binding)).collect();
        for name in ["space", ", .", "←↑↓→", "1-9", "pgdn pgup", "ctrl-l"] {
            assert!(shown.iter().any(|shown| shown == name), "{shown:?}");
        }
    }
}
