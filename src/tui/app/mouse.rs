//! What the mouse does.

use ratatui::crossterm::event::{MouseEvent, MouseEventKind};

use super::{App, Overlay, Panel};

impl App {
    /// Obeys the mouse: `panel` is what lies under the pointer, `on_title` whether that is its title.
    pub fn point(&mut self, mouse: &MouseEvent, panel: Option<Panel>, on_title: bool) {
        if let Some(Overlay::Help(help)) = &mut self.overlay {
            match mouse.kind {
                MouseEventKind::ScrollUp => help.scroll = help.scroll.saturating_sub(1),
                MouseEventKind::ScrollDown => help.scroll = help.scroll.saturating_add(1),
                _ => {}
            }
            return;
        }
        if self.overlay.is_some() {
            return;
        }
        match (mouse.kind, panel) {
            (MouseEventKind::Down(_), Some(panel)) if on_title || panel != Panel::Gas => {
                self.enlarge(Some(panel));
            }
            (MouseEventKind::Down(_), _) => self.dragged = Some((mouse.column, mouse.row)),
            (MouseEventKind::Drag(_), _) => {
                if let Some((column, row)) = self.dragged.replace((mouse.column, mouse.row)) {
                    let (across, down) = (
                        i32::from(mouse.column) - i32::from(column),
                        i32::from(mouse.row) - i32::from(row),
                    );
                    self.camera.turn(-3 * across, 6 * down);
                }
            }
            (MouseEventKind::ScrollUp, Some(Panel::Gas)) => self.camera.zoom_by(1),
            (MouseEventKind::ScrollDown, Some(Panel::Gas)) => self.camera.zoom_by(-1),
            (MouseEventKind::ScrollUp, _) => self.span.halve(true),
            (MouseEventKind::ScrollDown, _) => self.span.halve(false),
            _ => {}
        }
    }
}
