//! Writing into a panel: nothing ever leaves its area.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Widget};

use crate::tui::theme;

/// Columns a text takes.
pub(super) fn width(text: &str) -> u16 {
    Span::raw(text).width() as u16
}

/// Writes a text at a column and row of a panel; what does not fit is cut. Returns the column after it.
pub(super) fn put(
    buffer: &mut Buffer,
    area: Rect,
    at: (u16, u16),
    text: &str,
    style: Style,
) -> u16 {
    if at.0 >= area.width || at.1 >= area.height {
        return at.0;
    }
    let room = usize::from(area.width - at.0);
    let (end, _) = buffer.set_stringn(area.x + at.0, area.y + at.1, text, room, style);
    end - area.x
}

/// Writes a text so that it ends before a column.
pub(super) fn put_before(
    buffer: &mut Buffer,
    area: Rect,
    end: (u16, u16),
    text: &str,
    style: Style,
) {
    let start = end.0.saturating_sub(width(text));
    put(buffer, area, (start, end.1), text, style);
}

/// Marks the title of a frame as the chosen one.
pub(super) fn mark_chosen(buffer: &mut Buffer, area: Rect) {
    for column in area.x + 1..area.right().saturating_sub(1) {
        let cell = &mut buffer[(column, area.y)];
        if cell.fg == Color::DarkGray {
            break; // behind the title
        }
        cell.set_style(theme::CHOSEN);
    }
}

/// Draws a frame with a title and returns the area inside.
pub(super) fn framed(buffer: &mut Buffer, area: Rect, title: Line) -> Rect {
    framed_with_foot(buffer, area, title, "")
}

/// Draws a frame with a title above and a remark below, and returns the area inside.
pub(super) fn framed_with_foot(buffer: &mut Buffer, area: Rect, title: Line, foot: &str) -> Rect {
    let block = Block::bordered()
        .border_type(BorderType::Rounded)
        .border_style(theme::FRAME)
        .title(title)
        .title_bottom(Line::styled(foot, theme::QUIET));
    let inner = block.inner(area);
    block.render(area, buffer);
    inner
}

/// A title with a bold name and a quiet remark.
pub(super) fn title<'a>(name: &'a str, remark: &str) -> Line<'a> {
    let mut spans = vec![Span::styled(
        format!(" {name} "),
        theme::STRONG.fg(Color::Reset), // the border has its own
    )];
    if !remark.is_empty() {
        spans.push(Span::styled(format!("· {remark} "), theme::QUIET));
    }
    Line::from(spans)
}

/// Breaks a text into lines of at most `columns` characters, at blanks where there are some.
pub(super) fn wrap(text: &str, columns: u16) -> Vec<String> {
    let columns = usize::from(columns).max(1);
    let mut lines = Vec::new();
    for paragraph in text.lines() {
        let mut line = String::new();
        for word in paragraph.split_whitespace() {
            let mut word: Vec<char> = word.chars().collect();
            if !line.is_empty() && line.chars().count() + 1 + word.len() > columns {
                lines.push(std::mem::take(&mut line));
            }
            if !line.is_empty() {
                line.push(' ');
            }
            while word.len() > columns {
                lines.push(word.drain(..columns).collect());
            }
            line.extend(word);
        }
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_words_are_broken_and_short_ones_kept() {
        assert_eq!(wrap("ab cd efghij", 5), ["ab cd", "efghi", "j"]);
        assert_eq!(wrap("one\ntwo", 10), ["one", "two"]);
    }
}
