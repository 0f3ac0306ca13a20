//! From one frame to the next in few bytes: for screens over slow lines.
//!
//! Most bytes of a usual terminal program move the cursor and name colours. Here a gap is written over wherever that is
//! shorter than a jump, a style is named only when it changes something that can be seen, and colours are the theme's.

use std::io::Write;

use ratatui::buffer::{Buffer, Cell};
use ratatui::style::{Color, Modifier};

use crate::tui::theme::Palette;

/// Colour and modifiers of a cell, as far as the dashboard uses them.
type Look = (Color, Modifier);

const PLAIN: Look = (Color::Reset, Modifier::empty());

/// Modifiers that are sent: bold (SGR 1) and reverse (SGR 7).
const SENT: Modifier = Modifier::BOLD.union(Modifier::REVERSED);

/// Writes what turns the screen from one frame into the next; nothing if they are alike. Both have the same area.
///
/// The terminal's style is plain before and after.
pub fn encode(before: &Buffer, after: &Buffer, palette: &Palette, bytes: &mut Vec<u8>) {
    let mut pen = Pen {
        bytes,
        look: PLAIN,
        place: None,
        palette,
    };
    for (x, y, cell) in before.diff(after) {
        if pen.unseen(&before[(x, y)], cell) {
            continue;
        }
        pen.go(after, x, y);
        pen.write(cell, x, y, after.area.width);
    }
    pen.dress(PLAIN);
}

struct Pen<'a> {
    bytes: &'a mut Vec<u8>,
    look: Look,
    /// Where the terminal's cursor is, if that is sure.
    place: Option<(u16, u16)>,
    palette: &'a Palette,
}

impl Pen<'_> {
    /// Whether two cells that differ look alike, such as blanks in two colours.
    fn unseen(&self, before: &Cell, after: &Cell) -> bool {
        before.symbol() == after.symbol()
            && (self.look_of(before) == self.look_of(after) || is_blank(before) && is_blank(after))
    }

    fn go(&mut self, frame: &Buffer, x: u16, y: u16) {
        match self.place {
            Some(place) if place == (x, y) => {}
            Some((from, row)) if row == y && from < x => {
                let jump = match x - from {
                    1 => "\x1b[C".to_string(),
                    columns => format!("\x1b[{columns}C"),
                };
                if self.can_bridge(frame, from, x, y, jump.len()) {
                    for column in from..x {
                        self.write(&frame[(column, y)], column, y, frame.area.width);
                    }
                } else {
                    self.send(format_args!("{jump}"));
                }
            }
            _ if x == 0 => self.send(format_args!("\x1b[{}H", y + 1)),
            _ => self.send(format_args!("\x1b[{};{}H", y + 1, x + 1)),
        }
    }

    /// Whether the cells of a gap can be written in the present style, in no more bytes than a jump takes.
    fn can_bridge(&self, frame: &Buffer, from: u16, to: u16, y: u16, jump: usize) -> bool {
        let mut length = 0;
        (from..to).all(|column| {
            let cell = &frame[(column, y)];
            length += cell.symbol().len();
            length <= jump && self.suits(cell) && is_narrow(cell)
        })
    }

    /// Whether a cell needs no change of style.
    fn suits(&self, cell: &Cell) -> bool {
        let blank = is_blank(cell) && !self.look.1.contains(Modifier::REVERSED);
        blank || self.look_of(cell) == self.look
    }

    fn write(&mut self, cell: &Cell, x: u16, y: u16, width: u16) {
        if !self.suits(cell) {
            self.dress(self.look_of(cell));
        }
        self.bytes.extend_from_slice(cell.symbol().as_bytes());
        // How far a terminal moves after an unusual character, or at its right edge, is its own affair.
        self.place = (is_narrow(cell) && x + 1 < width).then_some((x + 1, y));
    }

    fn look_of(&self, cell: &Cell) -> Look {
        let color = match self.palette.code(cell.fg) {
            Some(_) => cell.fg,
            None => Color::Reset,
        };
        (color, cell.modifier & SENT)
    }

    fn dress(&mut self, look: Look) {
        if look == self.look {
            return;
        }
        if look == PLAIN {
            self.send(format_args!("\x1b[m"));
            self.look = look;
            return;
        }
        let mut codes = Vec::new();
        // The one way back from a modifier that all terminals share is to start afresh.
        if !look.1.contains(self.look.1) {
            codes.push("0");
            self.look = PLAIN;
        }
        let added = look.1 - self.look.1;
        if added.contains(Modifier::BOLD) {
            codes.push("1");
        }
        if added.contains(Modifier::REVERSED) {
            codes.push("7");
        }
        if look.0 != self.look.0 {
            codes.push(self.palette.code(look.0).unwrap_or("39"));
        }
        self.send(format_args!("\x1b[{}m", codes.join(";")));
        self.look = look;
    }

    fn send(&mut self, text: std::fmt::Arguments) {
        self.bytes.write_fmt(text).expect("memory takes every byte");
    }
}

/// Whether a cell shows nothing, whatever its colour.
fn is_blank(cell: &Cell) -> bool {
    cell.symbol() == " " && !cell.modifier.contains(Modifier::REVERSED)
}

/// Whether a cell takes one column on every terminal.
fn is_narrow(cell: &Cell) -> bool {
    cell.symbol().is_ascii() || ratatui::text::Span::raw(cell.symbol()).width() == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::layout::Rect;
    use ratatui::style::Style;

    use crate::tui::theme::{Colors, Theme};

    fn nonzero(value: u16) -> std::num::NonZero<u16> {
        value.try_into().expect("not zero")
    }

    /// A frame with random words in random styles.
    fn frame(seed: &mut u64) -> Buffer {
        let mut buffer = Buffer::empty(Rect::new(0, 0, 40, 6));
        let mut random = |below: u64| {
            *seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (*seed >> 33) % below
        };
        let looks = [
            Style::reset(),
            Style::reset().fg(Color::Cyan),
            Style::reset().add_modifier(Modifier::REVERSED),
            Style::reset().add_modifier(Modifier::BOLD),
            Style::reset().fg(Color::Red).add_modifier(Modifier::BOLD),
        ];
        for _ in 0..60 {
            let text = ["a", "µ•", "水", "12 3", "▅▅"][random(5) as usize];
            // Wide characters keep to a row of their own, lest one covers half of another.
            let (x, y) = if text == "水" {
                (2 * random(20) as u16, 0)
            } else {
                (random(40) as u16, 1 + random(5) as u16)
            };
            buffer.set_stringn(x, y, text, usize::from(40 - x), looks[random(5) as usize]);
        }
        buffer
    }

    #[test]
    fn a_terminal_shows_what_was_meant() {
        let mut seed = 5;
        let palette = Palette::new(Theme::Dark, Colors::Sixteen);
        let mut terminal = vt100::Parser::new(nonzero(6), nonzero(40), 0);
        let mut before = Buffer::empty(Rect::new(0, 0, 40, 6));
        for _ in 0..200 {
            let after = frame(&mut seed);
            let mut bytes = Vec::new();
            encode(&before, &after, &palette, &mut bytes);
            terminal.process(&bytes);
            for (x, y) in (0..6).flat_map(|y| (0..40).map(move |x| (x, y))) {
                let shown = terminal.screen().cell(y, x).expect("inside the screen");
                let meant = &after[(x, y)];
                if shown.is_wide_continuation() {
                    continue;
                }
                assert_eq!(shown.contents().trim(), meant.symbol().trim(), "{x}, {y}");
                if meant.symbol() != " " {
                    assert_eq!(
                        shown.bold(),
                        meant.modifier.contains(Modifier::BOLD),
                        "{x}, {y}"
                    );
                    assert_eq!(
                        shown.inverse(),
                        meant.modifier.contains(Modifier::REVERSED),
                        "{x}, {y}"
                    );
                    let colored = shown.fgcolor() != vt100::Color::Default;
                    assert_eq!(colored, meant.fg != Color::Reset, "{x}, {y}");
                }
            }
            before = after;
        }
    }

    #[test]
    fn an_unchanged_frame_takes_no_byte() {
        let frame = frame(&mut 9);
        let mut bytes = Vec::new();
        encode(
            &frame,
            &frame,
            &Palette::new(Theme::Dark, Colors::Sixteen),
            &mut bytes,
        );
        assert!(bytes.is_empty());
    }

    #[test]
    fn without_colors_none_is_sent() {
        let after = frame(&mut 9);
        let mut bytes = Vec::new();
        let none = Palette::new(Theme::Dark, Colors::Never);
        encode(&Buffer::empty(after.area), &after, &none, &mut bytes);
        let text = String::from_utf8(bytes).expect("text");
        assert!((31..=36).all(|color| !text.contains(&format!("{color}m"))));
    }
}
