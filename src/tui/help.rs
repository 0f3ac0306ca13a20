//! The help: what is searched in it and where it is scrolled to.

use ratatui::crossterm::event::KeyCode;

/// The state of the help.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Help {
    /// Shown are lines that contain this.
    pub search: String,
    /// Whether letters go to the search.
    pub typing: bool,
    /// Lines above the first one that is shown.
    pub scroll: u16,
}

impl Help {
    /// Obeys a key; says whether the help stays.
    pub(super) fn press(&mut self, code: KeyCode) -> bool {
        match code {
            KeyCode::Char(letter) if self.typing => self.search.push(letter),
            KeyCode::Backspace if self.typing => drop(self.search.pop()),
            KeyCode::Enter if self.typing => self.typing = false,
            KeyCode::Esc if self.typing => *self = Self::default(),
            KeyCode::Char('/') => (self.typing, self.scroll) = (true, 0),
            KeyCode::Down => self.scroll = self.scroll.saturating_add(1),
            KeyCode::Up => self.scroll = self.scroll.saturating_sub(1),
            KeyCode::PageDown => self.scroll = self.scroll.saturating_add(10),
            KeyCode::PageUp => self.scroll = self.scroll.saturating_sub(10),
            _ => return self.typing,
        }
        true
    }
}
