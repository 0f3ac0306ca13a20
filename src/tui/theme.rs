//! How the dashboard looks: styles from the 16 palette colours, glyphs, and the 7-bit form of both.
//!
//! Always holds: foreground and background are the terminal's own unless something is marked, and every mark by colour is also
//! a mark by glyph or word. A panel names an ink by a palette colour; [`Palette`] says what that looks like.

mod palette;

pub use palette::{Colors, Palette, Theme, color, paper_and_ink};

use ratatui::buffer::Buffer;
use ratatui::style::{Color, Modifier, Style};

use crate::snapshot::Phase;

/// Frames and rules: what must not be read to be understood.
pub const FRAME: Style = Style::new().fg(Color::DarkGray);
/// Labels, keys, remarks: what the eye may skip.
pub const QUIET: Style = Style::new().fg(Color::Gray);
/// Values.
pub const VALUE: Style = Style::new();
/// Titles and what must be seen first.
pub const STRONG: Style = Style::new().add_modifier(Modifier::BOLD);
/// The chosen panel, the running search.
pub const CHOSEN: Style = Style::new().add_modifier(Modifier::REVERSED);
/// Histories and bars.
pub const BAR: Style = Style::new().fg(Color::Cyan);
/// What theory expects.
pub const THEORY: Style = Style::new().fg(Color::Yellow);
/// A verdict that is good.
pub const GOOD: Style = Style::new().fg(Color::Green);
/// A verdict that needs a look.
pub const BAD: Style = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);

/// Colours of the tagged molecules, in their order.
pub const TAG_COLORS: [Color; 5] = [
    Color::Yellow,
    Color::Magenta,
    Color::Green,
    Color::Red,
    Color::Blue,
];

/// Style of the word that says what the run is doing.
pub fn state_style(phase: &Phase, reversed: bool) -> Style {
    let color = match phase {
        Phase::Starting => Color::Cyan,
        Phase::Running if reversed => Color::Magenta,
        Phase::Running => Color::Green,
        Phase::Paused => Color::Yellow,
        Phase::Finished => Color::Blue,
        Phase::Failed(_) => Color::Red,
    };
    STRONG.fg(color)
}

/// The characters of the picture.
#[derive(Clone, Copy, Debug)]
pub struct Glyphs {
    /// A molecule far behind, in, and far before the middle of the slab.
    pub depth: [char; 3],
    /// A molecule larger than a cell, likewise.
    pub disc: [char; 3],
    /// Tagged molecules, in their order.
    pub tags: [char; 5],
    /// The trail of a tagged molecule.
    pub trail: char,
    /// A container edge that is level (high, middle and low in its cell), upright, rising, falling.
    pub edge: [char; 6],
    /// An edge of a periodic box, likewise.
    pub open_edge: [char; 6],
    /// The outline of a plane.
    pub plane: char,
}

/// Glyphs of a UTF-8 terminal.
pub const UNICODE: Glyphs = Glyphs {
    depth: ['·', '∙', '•'],
    disc: ['░', '▒', '▓'],
    tags: ['◉', '◎', '◆', '◇', '▲'],
    trail: '◦',
    edge: ['‾', '─', '_', '│', '╱', '╲'],
    open_edge: ['╌', '╌', '╌', '┆', '╱', '╲'],
    plane: '×',
};

/// Glyphs of a 7-bit terminal.
pub const ASCII: Glyphs = Glyphs {
    depth: ['.', ':', '*'],
    disc: [':', 'o', '8'],
    tags: ['O', '@', '#', '&', 'A'],
    trail: ',',
    edge: ['-', '-', '_', '|', '/', '\\'],
    open_edge: ['-', '-', '-', '|', '/', '\\'],
    plane: 'x',
};

/// Shades from empty to full, for density and for the light on a ball.
pub const SHADES: [char; 10] = [' ', '.', ':', '-', '=', '+', '*', '#', '%', '@'];

/// Whether the locale speaks UTF-8: the first of `LC_ALL`, `LC_CTYPE` and `LANG` that is not empty decides, as POSIX says.
pub fn locale_is_utf8(variable: impl Fn(&str) -> Option<String>) -> bool {
    ["LC_ALL", "LC_CTYPE", "LANG"]
        .into_iter()
        .filter_map(variable)
        .find(|value| !value.is_empty())
        .is_some_and(|value| {
            let value = value.to_ascii_lowercase();
            value.contains("utf-8") || value.contains("utf8")
        })
}

/// Characters of the dashboard and their 7-bit stand-ins.
const STAND_INS: &[(&str, &str)] = &[
    ("╭╮╰╯┌┐└┘├┤┬┴┼", "+"),
    ("─╌…–⎯", "-"),
    ("│┆▏▕", "|"),
    ("▎▍▌▋▊▉", "="),
    ("▁", "_"),
    ("▂", "."),
    ("▃", "-"),
    ("▄", "="),
    ("▅", "+"),
    ("▆", "*"),
    ("▇", "%"),
    ("█●", "#"),
    ("░", "."),
    ("·", "-"),
    ("•", "o"),
    ("←", "<"),
    ("↑", "^"),
    ("↓", "v"),
    ("→", ">"),
    ("µμ", "u"),
    ("σ", "s"),
    ("Δ", "d"),
    ("°", " "),
    ("×", "x"),
    ("²", "2"),
    ("³", "3"),
];

/// Rewrites a finished frame so that no byte above 127 is left, whatever titles and names contain.
pub fn to_ascii(buffer: &mut Buffer) {
    for index in 0..buffer.content.len() {
        let symbol = buffer.content[index].symbol();
        if symbol.is_ascii() {
            continue;
        }
        if symbol == "±" && index > 0 && buffer.content[index - 1].symbol() == " " {
            buffer.content[index - 1].set_symbol("+");
            buffer.content[index].set_symbol("-");
            continue;
        }
        let stand_in = STAND_INS
            .iter()
            .find(|(characters, _)| characters.contains(symbol))
            .map_or_else(|| braille_stand_in(symbol), |(_, stand_in)| stand_in);
        buffer.content[index].set_symbol(stand_in);
    }
}

/// The same for a line of text.
pub fn text_in_ascii(text: &str) -> String {
    let stand_in = |letter: char| {
        if letter == '±' {
            return "+-".to_owned();
        }
        let known = STAND_INS
            .iter()
            .find(|(letters, _)| letters.contains(letter));
        known.map_or_else(
            || braille_stand_in(letter.encode_utf8(&mut [0; 4])).to_owned(),
            |(_, stand_in)| (*stand_in).to_owned(),
        )
    };
    text.chars()
        .map(|letter| {
            if letter.is_ascii() {
                letter.to_string()
            } else {
                stand_in(letter)
            }
        })
        .collect()
}

fn braille_stand_in(symbol: &str) -> &'static str {
    match symbol.chars().next() {
        Some('\u{2800}') => " ",
        Some('\u{2801}'..='\u{28ff}') => "*",
        _ => "?",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::layout::Rect;

    #[track_caller]
    fn check(variables: [&str; 3], expected: bool) {
        let names = ["LC_ALL", "LC_CTYPE", "LANG"];
        let lookup = |name: &str| {
            let place = names.iter().position(|other| *other == name)?;
            Some(variables[place].to_string())
        };
        assert_eq!(locale_is_utf8(lookup), expected);
    }

    #[test]
    fn the_first_locale_variable_that_says_something_decides() {
        check(["", "", "en_GB.UTF-8"], true);
        check(["C", "", "en_GB.UTF-8"], false);
        check(["", "de_DE.utf8", "C"], true);
        check(["", "", ""], false);
    }

    #[test]
    fn any_text_becomes_seven_bit() {
        let area = Rect::new(0, 0, 12, 1);
        let mut buffer = Buffer::empty(area);
        buffer.set_string(0, 0, "1 ±2 µs 水é–", Style::new());
        to_ascii(&mut buffer);
        let text: String = buffer
            .content
            .iter()
            .map(ratatui::buffer::Cell::symbol)
            .collect();
        assert_eq!(text, "1+-2 us ? ?-");
        assert_eq!(text_in_ascii("1 ±2 µs 水é–"), "1 +-2 us ??-");
    }
}
