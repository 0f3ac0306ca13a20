//! From one frame to the next in few bytes: for screens over slow lines.
//!
//! Most bytes of a usual terminal program move the cursor and name colours. Here short gaps are written over instead of
//! jumped, a style is named only when it changes, and colours are the sixteen classic ones that every terminal knows.

use std::io::Write;

use ratatui::buffer::{Buffer, Cell};
use ratatui::style::{Color, Modifier};

/// Longest run of unchanged cells that is cheaper to write than to jump, in columns: a jump takes some five bytes.
const BRIDGE: u16 = 4;

/// Colour and modifiers of a cell, as far as the dashboard uses them.
type Look = (Color, Modifier);

const PLAIN: Look = (Color::Reset, Modifier::empty());

/// Writes what turns the screen from one frame into the next; nothing if they are alike. Both have the same area.
///
/// The terminal's style is plain before and after.
pub fn encode(before: &Buffer, after: &Buffer, colors: bool, bytes: &mut Vec<u8>) {
    let mut pen = Pen {
        bytes,
        look: PLAIN,
        place: None,
        colors,
    };
    for (x, y, cell) in before.diff(after) {
        pen.go(after, x, y);
        pen.write(cell, x, y);
    }
    pen.dress(PLAIN);
}

struct Pen<'a> {
    bytes: &'a mut Vec<u8>,
    look: Look,
    place: Option<(u16, u16)>,
    colors: bool,
}

impl Pen<'_> {
    fn go(&mut self, frame: &Buffer, x: u16, y: u16) {
        match self.place {
            Some(place) if place == (x, y) => {}
            Some((from, row)) if row == y && from < x && self.can_bridge(frame, from, x, y) => {
                for column in from..x {
                    self.write(&frame[(column, y)], column, y);
                }
            }
            Some((from, row)) if row == y && from < x => {
                self.send(format_args!("\x1b[{}C", x - from));
            }
            _ => self.send(format_args!("\x1b[{};{}H", y + 1, x + 1)),
        }
    }

    fn can_bridge(&self, frame: &Buffer, from: u16, to: u16, y: u16) -> bool {
        let alike = |cell: &Cell| self.look_of(cell) == self.look && cell.symbol().is_ascii();
        to - from <= BRIDGE && (from..to).all(|column| alike(&frame[(column, y)]))
    }

    fn write(&mut self, cell: &Cell, x: u16, y: u16) {
        self.dress(self.look_of(cell));
        self.bytes.extend_from_slice(cell.symbol().as_bytes());
        // How far a terminal moves after an unusual character is its own affair.
        let sure = cell.symbol().is_ascii() || ratatui::text::Span::raw(cell.symbol()).width() == 1;
        self.place = sure.then_some((x + 1, y));
    }

    fn look_of(&self, cell: &Cell) -> Look {
        let color = if self.colors { cell.fg } else { Color::Reset };
        (color, cell.modifier & (Modifier::BOLD | Modifier::DIM))
    }

    fn dress(&mut self, look: Look) {
        if look == self.look {
            return;
        }
        let mut codes = Vec::new();
        // The one way back that all terminals share is to start afresh.
        if self.look != PLAIN && look != PLAIN {
            codes.push("0");
        }
        if look.1.contains(Modifier::BOLD) {
            codes.push("1");
        }
        if look.1.contains(Modifier::DIM) {
            codes.push("2");
        }
        codes.extend(color_code(look.0));
        self.send(format_args!("\x1b[{}m", codes.join(";")));
        self.look = look;
    }

    fn send(&mut self, text: std::fmt::Arguments) {
        self.bytes.write_fmt(text).expect("memory takes every byte");
    }
}

/// Source: ECMA-48, select graphic rendition.
fn color_code(color: Color) -> Option<&'static str> {
    match color {
        Color::Red => Some("31"),
        Color::Green => Some("32"),
        Color::Yellow => Some("33"),
        Color::Blue => Some("34"),
        Color::Magenta => Some("35"),
        Color::Cyan => Some("36"),
        _ => None, // the theme has no other
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::layout::Rect;
    use ratatui::style::Style;

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
            Style::reset().add_modifier(Modifier::DIM),
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
            buffer.set_stringn(x, y, text, usize::from(40 - x), looks[random(4) as usize]);
        }
        buffer
    }

    #[test]
    fn a_terminal_shows_what_was_meant() {
        let mut seed = 5;
        let mut terminal = vt100::Parser::new(nonzero(6), nonzero(40), 0);
        let mut before = Buffer::empty(Rect::new(0, 0, 40, 6));
        for _ in 0..200 {
            let after = frame(&mut seed);
            let mut bytes = Vec::new();
            encode(&before, &after, true, &mut bytes);
            terminal.process(&bytes);
            for (x, y) in (0..6).flat_map(|y| (0..40).map(move |x| (x, y))) {
                let shown = terminal.screen().cell(y, x).expect("inside the screen");
                if shown.is_wide_continuation() {
                    continue;
                }
                let meant = &after[(x, y)];
                assert_eq!(shown.contents().trim(), meant.symbol().trim(), "{x}, {y}");
                if meant.symbol() != " " {
                    assert_eq!(
                        shown.bold(),
                        meant.modifier.contains(Modifier::BOLD),
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
        encode(&frame, &frame, true, &mut bytes);
        assert!(bytes.is_empty());
    }

    #[test]
    fn without_colors_none_is_sent() {
        let after = frame(&mut 9);
        let mut bytes = Vec::new();
        encode(&Buffer::empty(after.area), &after, false, &mut bytes);
        let text = String::from_utf8(bytes).expect("text");
        assert!((31..=36).all(|color| !text.contains(&format!("{color}m"))));
    }
}
