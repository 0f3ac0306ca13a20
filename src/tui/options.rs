//! How the dashboard is to look and how much it may send: options of the watcher, not of the run.

use std::time::Duration;

use clap::Args;
use clap::builder::FalseyValueParser;

use crate::error::Result;
use crate::tui::config::{self, Config};
use crate::tui::pace;
use crate::tui::theme::{Colors, Palette, Theme, locale_is_utf8};

/// What the command line says of the screen.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Screen")]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a flag of the command line, and any may be on with any other"
)]
pub struct Options {
    /// 7-bit characters only [default: where the locale is not UTF-8]
    #[arg(long, env = "MOLTOP_ASCII", value_parser = FalseyValueParser::new())]
    pub ascii: bool,
    /// Colours that are sent [default: auto, 16 of the terminal's own palette, none if the environment says so]
    #[arg(
        long,
        value_name = "WHICH",
        env = "MOLTOP_COLORS",
        hide_possible_values = false
    )]
    pub colors: Option<Colors>,
    /// Colours that are chosen [default: any]
    #[arg(long, value_name = "NAME", env = "MOLTOP_THEME")]
    pub theme: Option<Theme>,
    /// Bytes per second at the most: on a slow line the picture waits first, the numbers last [default: 8000]
    #[arg(long, value_name = "N", env = "MOLTOP_MAX_BYTES_PER_S", value_parser = clap::value_parser!(u32).range(50..))]
    pub max_bytes_per_s: Option<u32>,
    /// Pictures of the gas per second at the most [default: 1]
    #[arg(long, value_name = "N", env = "MOLTOP_PICTURES_PER_S", value_parser = pictures)]
    pub pictures_per_s: Option<f64>,
    /// Plain lines instead of a dashboard; the default where there is no terminal, or a dumb one
    #[arg(long, env = "MOLTOP_PLAIN", value_parser = FalseyValueParser::new())]
    pub plain: bool,
    /// Seconds between two plain lines [default: 10]
    #[arg(long, value_name = "S", env = "MOLTOP_PLAIN_EVERY", value_parser = seconds)]
    pub plain_every: Option<f64>,
    /// Leave the last screen on the terminal when the dashboard closes
    #[arg(long, env = "MOLTOP_KEEP_SCREEN", value_parser = FalseyValueParser::new())]
    pub keep_screen: bool,
    /// Leave the mouse to the terminal
    #[arg(long, env = "MOLTOP_NO_MOUSE", value_parser = FalseyValueParser::new())]
    pub no_mouse: bool,
    /// What the user's settings say where the command line is silent.
    #[arg(skip)]
    pub config: Config,
}

fn pictures(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (0.01..=30.0).contains(&rate) => Ok(rate),
        _ => Err("must be a number from 0.01 to 30".to_owned()),
    }
}

fn seconds(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.05..=86_400.0).contains(&seconds) => Ok(seconds),
        _ => Err("must be a number of seconds from 0.05 to 86400".to_owned()),
    }
}

impl Options {
    /// Time between two plain lines.
    pub fn line_every(&self) -> Duration {
        Duration::from_secs_f64(self.plain_every.unwrap_or(10.0))
    }

    /// Takes in the user's settings.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::error::Error::Usage) when these have a fault.
    pub fn with_settings(mut self) -> Result<Self> {
        self.config = config::load()?;
        Ok(self)
    }

    /// Whether the screen keeps to 7-bit characters.
    pub fn is_ascii(&self) -> bool {
        let wanted = self.ascii || self.config.ascii == Some(true);
        wanted || !locale_is_utf8(|name| std::env::var(name).ok())
    }

    /// The theme.
    pub fn theme(&self) -> Theme {
        self.theme.or(self.config.theme).unwrap_or_default()
    }

    /// The colours that are sent.
    pub fn palette(&self) -> Palette {
        let colors = self.colors.or(self.config.colors).unwrap_or_default();
        let resolved = colors.resolved(|name| std::env::var(name).ok());
        Palette::new(self.theme(), resolved)
    }

    /// Pictures per second at the most.
    pub fn picture_rate(&self) -> f64 {
        let wanted = self.pictures_per_s.or(self.config.pictures_per_s);
        wanted.unwrap_or(1.0)
    }

    /// Bytes per second at the most; who wishes for more pictures gets more bytes unless these are named.
    pub fn budget(&self) -> f64 {
        let wanted = self.max_bytes_per_s.or(self.config.max_bytes_per_s);
        wanted.map_or(pace::BUDGET * self.picture_rate().max(1.0), f64::from)
    }

    /// Whether the last screen is left on the terminal.
    pub fn keeps_screen(&self) -> bool {
        self.keep_screen || self.config.keep_screen == Some(true)
    }

    /// Whether the mouse is listened to.
    pub fn mouse(&self) -> bool {
        !self.no_mouse && self.config.mouse != Some(false)
    }
}
