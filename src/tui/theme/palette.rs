//! What the inks of the dashboard look like: by theme, and by the colours that the terminal has.
//!
//! A panel names an ink by one of the sixteen palette colours. Always holds: with [`Colors::Sixteen`] only the select graphic
//! rendition codes 30 to 37, 39 and 90 to 97 are sent, which follow the user's own light or dark palette.

use clap::ValueEnum;
use ratatui::style::Color;
use serde::Deserialize;

/// How many colours are sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Colors {
    /// 16, or none where `NO_COLOR` is set
    #[default]
    Auto,
    /// None
    Never,
    /// The terminal's own palette
    #[value(name = "16")]
    #[serde(rename = "16")]
    Sixteen,
    /// The fixed palette of 256 colours
    #[value(name = "256")]
    #[serde(rename = "256")]
    TwoFiftySix,
    /// 24 bits
    True,
}

/// Which colours are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Theme {
    /// Can be read on a dark and on a light background
    #[default]
    Any,
    /// For a dark background
    Dark,
    /// For a light background
    Light,
    /// For all kinds of colour vision, after Okabe and Ito
    Safe,
    /// Bold and plain only
    Mono,
}

/// The inks, in the order of the tables below: frames, secondary text, bars, theory, good, bad, and two more for tags.
const INKS: [Color; 8] = [
    Color::DarkGray,
    Color::Gray,
    Color::Cyan,
    Color::Yellow,
    Color::Green,
    Color::Red,
    Color::Magenta,
    Color::Blue,
];

/// Codes of the sixteen-colour palette for each ink. "Bright black" (90) is as the background in some palettes, so only
/// frames are drawn with it. Source: ECMA-48, select graphic rendition, and aixterm's 90 to 97.
fn sixteen(theme: Theme) -> [&'static str; 8] {
    match theme {
        Theme::Any => ["90", "39", "36", "35", "32", "31", "35", "34"],
        Theme::Dark => ["90", "39", "36", "33", "32", "91", "95", "94"],
        Theme::Light => ["90", "39", "34", "35", "32", "31", "35", "34"],
        Theme::Safe => ["90", "39", "36", "33", "34", "33", "35", "34"],
        Theme::Mono => ["39"; 8],
    }
}

type Rgb = (u8, u8, u8);

/// Red, green and blue for each ink. Source of `Safe`: Okabe and Ito, Color Universal Design.
fn rgb(theme: Theme) -> [Rgb; 8] {
    match theme {
        Theme::Any => [
            (118, 118, 118),
            (128, 128, 128),
            (0, 150, 160),
            (180, 100, 190),
            (40, 150, 60),
            (220, 60, 50),
            (180, 100, 190),
            (70, 120, 220),
        ],
        Theme::Dark => [
            (98, 98, 98),
            (158, 158, 158),
            (95, 215, 215),
            (255, 200, 90),
            (120, 215, 120),
            (255, 110, 100),
            (220, 140, 230),
            (120, 170, 255),
        ],
        Theme::Light => [
            (150, 150, 150),
            (98, 98, 98),
            (0, 95, 175),
            (160, 60, 140),
            (0, 115, 40),
            (190, 20, 20),
            (130, 60, 170),
            (40, 80, 200),
        ],
        Theme::Safe => [
            (118, 118, 118),
            (128, 128, 128),
            (86, 180, 233),
            (230, 159, 0),
            (0, 158, 115),
            (213, 94, 0),
            (204, 121, 167),
            (0, 114, 178),
        ],
        Theme::Mono => [(128, 128, 128); 8],
    }
}

/// The codes of each ink for one terminal.
#[derive(Clone, Debug, PartialEq)]
pub struct Palette {
    codes: [Option<String>; 8],
}

impl Palette {
    /// The palette of a theme in so many colours.
    pub fn new(theme: Theme, colors: Colors) -> Self {
        let fixed = |write: fn(Rgb) -> String| match theme {
            Theme::Mono => Default::default(),
            _ => rgb(theme).map(|color| Some(write(color))),
        };
        let codes = match colors {
            Colors::Never => Default::default(),
            Colors::Auto | Colors::Sixteen => {
                sixteen(theme).map(|code| (code != "39").then(|| code.to_owned()))
            }
            Colors::TwoFiftySix => fixed(|color| format!("38;5;{}", nearest_of_256(color))),
            Colors::True => fixed(|(red, green, blue)| format!("38;2;{red};{green};{blue}")),
        };
        Self { codes }
    }

    /// The code that chooses an ink; `None` for the terminal's own foreground.
    pub fn code(&self, ink: Color) -> Option<&str> {
        self.codes[place(ink)?].as_deref()
    }
}

/// Background and foreground of a picture in the colours of a theme.
pub fn paper_and_ink(theme: Theme) -> (&'static str, &'static str) {
    match theme {
        Theme::Light => ("#ffffff", "#1c1c1c"),
        _ => ("#16181d", "#d8d8d8"),
    }
}

/// Colour of an ink in a picture; `None` for the foreground.
pub fn color(theme: Theme, ink: Color) -> Option<String> {
    let (red, green, blue) = rgb(theme)[place(ink)?];
    Some(format!("#{red:02x}{green:02x}{blue:02x}"))
}

/// Place of an ink in the tables.
fn place(ink: Color) -> Option<usize> {
    INKS.iter().position(|other| *other == ink)
}

/// Nearest colour of the cube of 6 x 6 x 6 or of the ramp of greys. Source: xterm's 256colres.
fn nearest_of_256((red, green, blue): Rgb) -> u8 {
    const LEVELS: [u8; 6] = [0, 95, 135, 175, 215, 255];
    if red == green && green == blue {
        return 232 + (red.saturating_sub(8).saturating_add(5) / 10).min(23);
    }
    let level = |value: u8| -> u8 {
        let distance = |level: &usize| LEVELS[*level].abs_diff(value);
        (0..6).min_by_key(distance).unwrap_or(0) as u8
    };
    16 + 36 * level(red) + 6 * level(green) + level(blue)
}

impl Colors {
    /// What is sent to a terminal: `Auto` follows `NO_COLOR` and `CLICOLOR_FORCE`.
    ///
    /// The choice is 16 also where more are possible: `COLORTERM` does not come through ssh, and the sixteen follow the
    /// user's palette. Source: no-color.org, bixense.com/clicolors.
    #[must_use]
    pub fn resolved(self, variable: impl Fn(&str) -> Option<String>) -> Self {
        let is_set = |name| variable(name).is_some_and(|value| !value.is_empty());
        match self {
            Self::Auto if is_set("NO_COLOR") && !is_set("CLICOLOR_FORCE") => Self::Never,
            Self::Auto => Self::Sixteen,
            chosen => chosen,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_colours_take_classic_codes_only() {
        for theme in Theme::value_variants() {
            let palette = Palette::new(*theme, Colors::Sixteen);
            for code in palette.codes.iter().flatten() {
                let code: u8 = code.parse().expect("a number");
                assert!((30..=37).contains(&code) || (90..=97).contains(&code));
            }
        }
    }

    #[test]
    fn the_cube_has_its_corners_and_the_ramp_its_greys() {
        assert_eq!(nearest_of_256((0, 0, 255)), 21);
        assert_eq!(nearest_of_256((255, 0, 10)), 196);
        assert_eq!(nearest_of_256((128, 128, 128)), 244);
        assert_eq!(nearest_of_256((255, 255, 255)), 255);
    }

    #[test]
    fn no_color_says_none_unless_told_otherwise() {
        let set = |names: &'static [&'static str]| {
            move |name: &str| names.contains(&name).then(|| "1".to_owned())
        };
        assert_eq!(Colors::Auto.resolved(set(&["NO_COLOR"])), Colors::Never);
        assert_eq!(Colors::Auto.resolved(set(&[])), Colors::Sixteen);
        assert_eq!(Colors::True.resolved(set(&["NO_COLOR"])), Colors::True);
        let both = set(&["NO_COLOR", "CLICOLOR_FORCE"]);
        assert_eq!(Colors::Auto.resolved(both), Colors::Sixteen);
    }
}
