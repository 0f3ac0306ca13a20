//! The keys, as many as fit; help and quit come first.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::text::{put, width};
use crate::feed::Access;
use crate::tui::app::{App, Panel};
use crate::tui::keys::{Action, Binding, KEYS, NEVER};
use crate::tui::theme;

/// Draws the footer row.
pub(super) fn panel(app: &App, area: Rect, buffer: &mut Buffer) {
    if let Some(words) = &app.message {
        put(buffer, area, (1, 0), words, theme::STRONG);
        return;
    }
    if app.visit.is_some() {
        let words = if app.access == Access::Replay {
            "0 comes back to the end of the run, g goes to another time"
        } else {
            "beside the run, which goes on: 0 comes back to it, g goes to another time"
        };
        put(buffer, area, (1, 0), words, theme::STRONG);
        return;
    }
    let mut by_rank: Vec<&Binding> = KEYS
        .iter()
        .filter(|binding| is_shown(app, binding))
        .collect();
    by_rank.sort_by_key(|binding| rank(app, binding));
    let mut room = area.width.saturating_sub(1);
    let mut lowest = None;
    for binding in by_rank {
        let wanted = width(&app.keymap.shown(binding)) + width(binding.short) + 3;
        if wanted > room {
            break;
        }
        room -= wanted;
        lowest = Some(rank(app, binding));
    }
    let mut column = 1;
    let fits = |binding: &&Binding| is_shown(app, binding) && Some(rank(app, binding)) <= lowest;
    for binding in KEYS.iter().filter(fits) {
        let keys = app.keymap.shown(binding);
        column = put(buffer, area, (column, 0), &keys, theme::STRONG) + 1;
        column = put(buffer, area, (column, 0), binding.short, theme::QUIET) + 2;
    }
}

/// Whether a key is worth its room: it does something, and nothing that another does as well.
fn is_shown(app: &App, binding: &Binding) -> bool {
    let action = binding.entries[0].action;
    let alone = matches!(app.access, Access::ReadOnly | Access::Replay);
    binding.rank != NEVER && app.reaches(action) && !(alone && action == Action::Detach)
}

/// Place of a binding in the queue for the room: help and quit, then what goes with the panel that fills the window.
fn rank(app: &App, binding: &Binding) -> (usize, u8) {
    let own: &[Action] = match app.enlarged {
        None if app.access == Access::Replay => &[Action::Goto, Action::Earlier],
        None => &[],
        Some(Panel::Gas) => &[
            Action::Enlarge,
            Action::ZoomIn,
            Action::SwitchView,
            Action::Rotate,
        ],
        Some(Panel::Now | Panel::History | Panel::Events) => &[
            Action::Enlarge,
            Action::HistoryLonger,
            Action::Earlier,
            Action::Mark,
        ],
        Some(_) => &[Action::Enlarge],
    };
    let first = binding.entries[0].action;
    let place = own.iter().position(|action| *action == first);
    match (binding.rank, place) {
        (0 | 1, _) => (0, binding.rank),
        (rank, Some(place)) => (1 + place, rank),
        (rank, None) => (1 + own.len(), rank),
    }
}
