//! The keys: one table that drives handling, the help overlay and the footer.

use ratatui::crossterm::event::KeyCode;

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
    /// Enlarge the picture.
    ZoomIn,
    /// Shrink the picture.
    ZoomOut,
    /// Make the slab thinner.
    Thinner,
    /// Make the slab thicker.
    Thicker,
    /// Switch between slab and whole depth.
    SwitchView,
    /// Set camera and slab back.
    ResetCamera,
    /// Freeze or thaw the screen.
    Freeze,
    /// Show the help.
    Help,
    /// Leave; the run goes on.
    Detach,
    /// Leave, and ask what is to become of the run.
    Quit,
}

/// One line of the help: keys that belong together.
pub struct Binding {
    /// The keys and what each does.
    pub keys: &'static [(KeyCode, Action)],
    /// The keys as the screen names them.
    pub shown: &'static str,
    /// A word or two for the footer.
    pub short: &'static str,
    /// A sentence for the help.
    pub help: &'static str,
    /// Place in the queue for the footer's room: low numbers first.
    pub rank: u8,
}

/// All keys, in the order of help and footer.
pub const KEYS: &[Binding] = &[
    Binding {
        keys: &[(KeyCode::Char(' '), Action::Pause)],
        shown: "space",
        short: "pause",
        help: "pause the run, or let it go on",
        rank: 2,
    },
    Binding {
        keys: &[(KeyCode::Char('r'), Action::Reverse)],
        shown: "r",
        short: "reverse",
        help: "reverse time: every molecule turns back",
        rank: 3,
    },
    Binding {
        keys: &[(KeyCode::Char('s'), Action::Step)],
        shown: "s",
        short: "step",
        help: "run one sample, then pause",
        rank: 8,
    },
    Binding {
        keys: &[
            (KeyCode::Char(','), Action::Slower),
            (KeyCode::Char('.'), Action::Faster),
        ],
        shown: ", .",
        short: "slower faster",
        help: "ceiling on simulated time per second: lower, higher",
        rank: 5,
    },
    Binding {
        keys: &[
            (KeyCode::Left, Action::TurnLeft),
            (KeyCode::Up, Action::TurnUp),
            (KeyCode::Down, Action::TurnDown),
            (KeyCode::Right, Action::TurnRight),
        ],
        shown: "←↑↓→",
        short: "turn",
        help: "turn the picture: azimuth, elevation",
        rank: 4,
    },
    Binding {
        keys: &[
            (KeyCode::Char('+'), Action::ZoomIn),
            (KeyCode::Char('='), Action::ZoomIn),
            (KeyCode::Char('-'), Action::ZoomOut),
        ],
        shown: "+ -",
        short: "zoom",
        help: "enlarge or shrink the picture",
        rank: 6,
    },
    Binding {
        keys: &[(KeyCode::Char('v'), Action::SwitchView)],
        shown: "v",
        short: "view",
        help: "slab through the middle, or density over the whole depth",
        rank: 7,
    },
    Binding {
        keys: &[
            (KeyCode::Char('['), Action::Thinner),
            (KeyCode::Char(']'), Action::Thicker),
        ],
        shown: "[ ]",
        short: "slab",
        help: "thinner or thicker slab",
        rank: 10,
    },
    Binding {
        keys: &[
            (KeyCode::Char('0'), Action::ResetCamera),
            (KeyCode::Home, Action::ResetCamera),
        ],
        shown: "0",
        short: "reset view",
        help: "set angle, zoom and slab back (also Home)",
        rank: 11,
    },
    Binding {
        keys: &[(KeyCode::Char('f'), Action::Freeze)],
        shown: "f",
        short: "freeze",
        help: "freeze the screen; the run goes on behind it",
        rank: 9,
    },
    Binding {
        keys: &[(KeyCode::Char('?'), Action::Help)],
        shown: "?",
        short: "help",
        help: "this help",
        rank: 1,
    },
    Binding {
        keys: &[(KeyCode::Char('d'), Action::Detach)],
        shown: "d",
        short: "detach",
        help: "leave, and let the run go on (also Ctrl-C)",
        rank: 12,
    },
    Binding {
        keys: &[(KeyCode::Char('q'), Action::Quit)],
        shown: "q",
        short: "quit",
        help: "stop the run, or leave it running",
        rank: 0,
    },
];

/// What a key does, if anything.
pub fn action(code: KeyCode) -> Option<Action> {
    KEYS.iter()
        .flat_map(|binding| binding.keys)
        .find(|(key, _)| *key == code)
        .map(|(_, action)| *action)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_stands_twice_in_the_table() {
        let keys: Vec<_> = KEYS.iter().flat_map(|binding| binding.keys).collect();
        for (place, (key, _)) in keys.iter().enumerate() {
            assert!(
                keys[..place].iter().all(|(other, _)| other != key),
                "{key:?}"
            );
        }
    }

    #[test]
    fn no_rank_stands_twice_in_the_table() {
        for (place, binding) in KEYS.iter().enumerate() {
            assert!(KEYS[..place].iter().all(|other| other.rank != binding.rank));
        }
    }
}
