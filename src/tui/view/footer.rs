//! The keys, as many as fit; help and quit come first.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::text::{put, width};
use crate::tui::app::App;
use crate::tui::keys::{Binding, KEYS, NEVER};
use crate::tui::theme;

/// Draws the footer row.
pub(super) fn panel(app: &App, area: Rect, buffer: &mut Buffer) {
    if let Some(words) = &app.message {
        put(buffer, area, (1, 0), words, theme::STRONG);
        return;
    }
    let mut by_rank: Vec<&Binding> = KEYS.iter().collect();
    by_rank.sort_by_key(|binding| binding.rank);
    let mut room = area.width.saturating_sub(1);
    let mut lowest = 0;
    for binding in by_rank {
        let wanted = width(&app.keymap.shown(binding)) + width(binding.short) + 3;
        if wanted > room || binding.rank == NEVER {
            break;
        }
        room -= wanted;
        lowest = binding.rank;
    }
    let mut column = 1;
    for binding in KEYS.iter().filter(|binding| binding.rank <= lowest) {
        column = put(
            buffer,
            area,
            (column, 0),
            &app.keymap.shown(binding),
            theme::STRONG,
        ) + 1;
        column = put(buffer, area, (column, 0), binding.short, theme::QUIET) + 2;
    }
}
