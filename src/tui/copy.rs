//! The screen as text and as SVG.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Write as _};

use ratatui::buffer::{Buffer, Cell};
use ratatui::style::{Color, Modifier};

use crate::tui::theme::{self, Theme};

/// Writes a screen to two new files in the working directory; returns their name without its ending.
///
/// # Errors
/// What the file system answers.
pub fn write(screen: &Buffer, theme: Theme) -> io::Result<String> {
    for number in 1..=9_999 {
        let name = format!("moltop-screen-{number}");
        let create = |ending: &str| File::create_new(format!("{name}.{ending}"));
        match create("txt") {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
            Ok(mut file) => {
                file.write_all(text(screen).as_bytes())?;
                create("svg")?.write_all(svg(screen, theme).as_bytes())?;
                return Ok(name);
            }
        }
    }
    Err(io::Error::other("there are too many copies here"))
}

/// The screen as lines of text, without blanks at their ends.
pub fn text(screen: &Buffer) -> String {
    let mut text = String::new();
    for row in rows(screen) {
        let line: String = row.iter().map(Cell::symbol).collect();
        let _ = writeln!(text, "{}", line.trim_end());
    }
    text
}

/// Width and height of a cell in the picture, and the height of the letters.
const CELL: (f64, f64) = (8.4, 17.0);
const LETTERS: f64 = 14.0;

/// The screen as a picture in the colours of a theme.
pub fn svg(screen: &Buffer, theme: Theme) -> String {
    let (width, height) = (
        f64::from(screen.area.width) * CELL.0 + 16.0,
        f64::from(screen.area.height) * CELL.1 + 16.0,
    );
    let (paper, ink) = theme::paper_and_ink(theme);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
         viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"DejaVu Sans Mono, Menlo, Consolas, monospace\" \
         font-size=\"{LETTERS}\" fill=\"{ink}\">\n\
         <rect width=\"100%\" height=\"100%\" rx=\"6\" fill=\"{paper}\"/>\n"
    );
    for (index, row) in rows(screen).enumerate() {
        let y = 8.0 + CELL.1 * index as f64;
        for (column, run) in runs(row) {
            let symbols: String = run.iter().map(Cell::symbol).collect();
            if symbols.trim().is_empty() && !run[0].modifier.contains(Modifier::REVERSED) {
                continue;
            }
            let x = 8.0 + CELL.0 * column as f64;
            let length = CELL.0 * run.len() as f64;
            let color = theme::color(theme, run[0].fg).unwrap_or(ink.to_owned());
            let reversed = run[0].modifier.contains(Modifier::REVERSED);
            if reversed {
                let _ = writeln!(
                    text,
                    "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{length:.1}\" height=\"{}\" fill=\"{color}\"/>",
                    CELL.1
                );
            }
            let fill = if reversed { paper } else { &color };
            let weight = if run[0].modifier.contains(Modifier::BOLD) {
                " font-weight=\"bold\""
            } else {
                ""
            };
            // Each letter has its place, whatever font it comes from.
            let places: Vec<String> = (0..run.len())
                .map(|index| format!("{:.1}", x + CELL.0 * index as f64))
                .collect();
            let _ = writeln!(
                text,
                "<text x=\"{}\" y=\"{:.1}\" fill=\"{fill}\"{weight} xml:space=\"preserve\">{}</text>",
                places.join(" "),
                y + 13.0,
                escaped(&symbols)
            );
        }
    }
    text.push_str("</svg>\n");
    text
}

fn rows(screen: &Buffer) -> impl Iterator<Item = &[Cell]> {
    screen.content.chunks(usize::from(screen.area.width).max(1))
}

/// Neighbours of one look, and the column where they begin; blanks belong to any look that is not reversed.
fn runs(row: &[Cell]) -> Vec<(usize, &[Cell])> {
    let look = |cell: &Cell| -> (Color, Modifier) { (cell.fg, cell.modifier) };
    let mut runs = Vec::new();
    let mut start = 0;
    for column in 1..=row.len() {
        if column == row.len() || look(&row[column]) != look(&row[start]) {
            runs.push((start, &row[start..column]));
            start = column;
        }
    }
    runs
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::layout::Rect;
    use ratatui::style::Style;

    fn screen() -> Buffer {
        let mut screen = Buffer::empty(Rect::new(0, 0, 8, 2));
        screen.set_string(0, 0, "a<b & µ", Style::new());
        screen.set_string(1, 1, "red", Style::new().fg(Color::Red));
        screen
    }

    #[test]
    fn text_has_no_blanks_at_the_ends_of_lines() {
        assert_eq!(text(&screen()), "a<b & µ\n red\n");
    }

    #[test]
    fn a_picture_is_well_formed_and_has_its_colours() {
        let svg = svg(&screen(), Theme::Dark);
        assert!(svg.contains("a&lt;b &amp; µ") && svg.ends_with("</svg>\n"));
        assert!(svg.contains("fill=\"#ff6e64\""));
        assert_eq!(svg.matches("<text").count(), svg.matches("</text>").count());
    }
}
