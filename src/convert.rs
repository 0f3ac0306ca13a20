//! `moltop convert`: the same balls as TOML, as the seed's text or as a CSV state, bit for bit.
//!
//! What goes in is recognised by its content, what comes out by its name. A CSV state or a trajectory holds balls only: the rest comes from
//! a scene that is named beside it, or is open space in reduced units.

use std::ffi::OsStr;
use std::path::Path;

use crate::error::{Error, Result};
use crate::output::{Target, write_state};
use crate::scene::Scene;
use crate::trajectory_file;

/// What a file can be written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Toml,
    SeedText,
    State,
}

impl Format {
    fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default();
        match extension {
            "toml" => Ok(Self::Toml),
            "txt" | "seed" => Ok(Self::SeedText),
            "csv" => Ok(Self::State),
            _ => Err(Error::Usage(format!(
                "{}: must end in .toml, .txt, .seed or .csv",
                path.display()
            ))),
        }
    }
}

/// Reads `input`, places its balls, and writes them to `output`.
///
/// # Errors
/// [`Error::Scene`] for the input, [`Error::Usage`] for the output's name, [`Error::File`] when it cannot be written.
pub fn convert(input: &Path, output: &Path, domain_of: Option<&Path>, force: bool) -> Result<()> {
    let format = Format::of(output)?;
    let target = Target::new(output, force)?;
    let scene = read(input, domain_of)?;
    let balls = scene.place()?;
    match format {
        Format::Toml => {
            let text = scene.to_toml(&balls)?;
            target.write(|writer| writer.write_all(text.as_bytes()))
        }
        Format::SeedText => {
            if scene.has_images() {
                return Err(Error::Usage(
                    "the seed's text has no periodic boxes: write .toml or .csv".to_owned(),
                ));
            }
            target.write(|writer| scene.write_seed_text(&balls, writer))
        }
        Format::State => {
            let collisions = vec![0; balls.positions.len()];
            target.write(|writer| write_state(writer, &balls, &collisions))
        }
    }
}

fn read(input: &Path, domain_of: Option<&Path>) -> Result<Scene> {
    let is_state = input.extension() == Some(OsStr::new("csv"))
        || trajectory_file::Format::of(input).is_some();
    match domain_of {
        _ if is_state => Scene::from_state(input, domain_of.map(Scene::load).transpose()?),
        Some(_) => Err(Error::Usage(
            "--domain-of goes with a CSV state or a trajectory: other files have a domain of their own".to_owned(),
        )),
        None => Scene::load(input),
    }
}
