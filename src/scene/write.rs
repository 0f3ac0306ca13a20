//! Writes a scene with all its balls one by one, as TOML or as the seed's text; what is written reads back bit for bit.
//!
//! Every number has the fewest digits that read back as the same number.

use std::fmt::Write as _;
use std::io::{self, Write};

use clap::ValueEnum;
use glam::DVec3;

use super::seed_text::SI_COMMENT;
use super::{LARGEST_FILE, Scene, region};
use crate::domain::Boundary;
use crate::error::{Error, Result};
use crate::snapshot::Units;
use crate::state::{Body, Placement};

impl Scene {
    /// The scene as TOML, each of its balls in a `[[ball]]`.
    ///
    /// # Errors
    /// [`Error::Usage`] when the file would be too long to be read again.
    pub fn to_toml(&self, balls: &Placement) -> Result<String> {
        let mut text = self.toml_head();
        let names = self.named_balls();
        let mut names = names.iter().peekable();
        for (index, (position, velocity)) in
            balls.positions.iter().zip(&balls.velocities).enumerate()
        {
            text += "\n[[ball]]\n";
            if let Some((name, _)) = names.next_if(|(_, ball)| *ball == index) {
                put(&mut text, format_args!("name = {}\n", quoted(name)));
            }
            let Body { radius, mass } = body(balls, index);
            put(
                &mut text,
                format_args!("position = {}\n", vector(*position)),
            );
            if mass.is_infinite() {
                text += "fixed = true\n";
            } else {
                put(
                    &mut text,
                    format_args!("velocity = {}\nmass = {mass:?}\n", vector(*velocity)),
                );
            }
            put(&mut text, format_args!("radius = {radius:?}\n"));
            if text.len() as u64 > LARGEST_FILE {
                return Err(Error::Usage(format!(
                    "{} balls are too many for a TOML file of {} MiB: write .txt or .csv",
                    balls.positions.len(),
                    LARGEST_FILE >> 20
                )));
            }
        }
        Ok(text)
    }

    /// All but the balls, as TOML.
    fn toml_head(&self) -> String {
        let units = match self.units {
            Units::Si => "si",
            Units::Reduced => "reduced",
        };
        let kind = region::KINDS
            .iter()
            .find(|(_, boundary)| *boundary == self.domain.boundary)
            .map(|(name, _)| *name)
            .expect("every boundary has a name");
        let mut text = format!(
            "title = {}\nunits = \"{units}\"\nseed = {}\n\n[domain]\nkind = \"{kind}\"\ncenter = {}\nsize = {}\n",
            quoted(&self.title),
            self.seed,
            vector(self.center),
            vector(2.0 * self.domain.half_size),
        );
        text += "\n[run]\n";
        if let Some(engine) = self.engine.to_possible_value() {
            put(
                &mut text,
                format_args!("engine = \"{}\"\n", engine.get_name()),
            );
        }
        if let Some(until) = self.until {
            put(&mut text, format_args!("until = {until:?}\n"));
        }
        put(&mut text, format_args!("sample = {:?}\n", self.sample));
        self.observe.put(&mut text);
        for plane in &self.planes {
            let (point, normal) = (vector(plane.point), vector(plane.normal));
            put(
                &mut text,
                format_args!("\n[[plane]]\npoint = {point}\nnormal = {normal}\n"),
            );
        }
        text
    }

    /// Writes the scene as the seed's text, without a header: names, title, and times are lost.
    ///
    /// # Errors
    /// What the writer answers. A periodic box is invalid input: the seed's text has none.
    pub fn write_seed_text(&self, balls: &Placement, writer: &mut dyn Write) -> io::Result<()> {
        if self.units == Units::Si {
            writeln!(writer, "{SI_COMMENT}")?;
        }
        match self.domain.boundary {
            Boundary::Container => {
                let size = 2.0 * self.domain.half_size;
                writeln!(writer, "C 1\n{} {}", row(self.center), row(size))?;
            }
            Boundary::Open => writeln!(writer, "C 0")?,
            Boundary::Periodic => {
                let why = "the seed's text has no periodic boxes";
                return Err(io::Error::new(io::ErrorKind::InvalidInput, why));
            }
        }
        writeln!(writer, "W {}", self.planes.len())?;
        for plane in &self.planes {
            writeln!(writer, "{} {}", row(plane.point), row(plane.normal))?;
        }
        writeln!(writer, "B {}", balls.positions.len())?;
        for (index, (position, velocity)) in
            balls.positions.iter().zip(&balls.velocities).enumerate()
        {
            let Body { radius, mass } = body(balls, index);
            writeln!(
                writer,
                "{} {} {mass:?} {radius:?}",
                row(*position),
                row(*velocity)
            )?;
        }
        Ok(())
    }
}

fn put(text: &mut String, words: std::fmt::Arguments) {
    text.write_fmt(words).expect("memory takes all");
}

fn body(balls: &Placement, index: usize) -> Body {
    balls.bodies[balls.body_of.get(index).map_or(0, |&body| body as usize)]
}

fn vector(vector: DVec3) -> String {
    format!("[{:?}, {:?}, {:?}]", vector.x, vector.y, vector.z)
}

fn row(vector: DVec3) -> String {
    format!("{:?} {:?} {:?}", vector.x, vector.y, vector.z)
}

/// A TOML string.
fn quoted(words: &str) -> String {
    let mut text = String::from("\"");
    for letter in words.chars() {
        match letter {
            '"' | '\\' => text.extend(['\\', letter]),
            letter if letter.is_control() => {
                put(&mut text, format_args!("\\u{:04X}", letter as u32))
            }
            letter => text.push(letter),
        }
    }
    text + "\""
}
