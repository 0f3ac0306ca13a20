//! `--trajectory`: the balls frame by frame, in two formats that OVITO, ASE and others read.
//!
//! Extended XYZ (`.xyz`, `.extxyz`) has the time of each frame; a LAMMPS dump (`.lammpstrj`, `.dump`) numbers its frames, and
//! the time is the number times what lies between two. A name that ends in `.zst` is compressed, each frame by itself, so that
//! the file is whole after every frame. Positions are the scene's, and numbers have as many digits as read back bit for bit.
//!
//! Frames are written on a thread of their own, straight into the file. A checkpoint knows how long the file was: a run that
//! goes on from it cuts off what came later, which it writes once more.
//!
//! Sources: the extended XYZ specification (github.com/libAtoms/extxyz); LAMMPS manual, `dump` command.

mod recorder;

pub use recorder::{Mark, Recorder, Witness};

use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::Path;

use crate::domain::Boundary;
use crate::state::Placement;

/// The names that a trajectory may have.
pub const ENDINGS: &str = ".xyz, .extxyz, .lammpstrj or .dump, or one of these and .zst";

/// How a frame is laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Extended XYZ.
    ExtendedXyz,
    /// LAMMPS dump.
    LammpsDump,
}

/// What a file is, by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// How its frames are laid out.
    pub layout: Layout,
    /// Whether each frame is compressed (Zstandard).
    pub compressed: bool,
}

impl Format {
    /// The format that a name says; `None` if it is not that of a trajectory.
    pub fn of(path: &Path) -> Option<Self> {
        let compressed = path.extension() == Some(OsStr::new("zst"));
        let inner = if compressed {
            Path::new(path.file_stem()?)
        } else {
            path
        };
        let layout = match inner.extension()?.to_str()? {
            "xyz" | "extxyz" => Layout::ExtendedXyz,
            "lammpstrj" | "dump" => Layout::LammpsDump,
            _ => return None,
        };
        Some(Self { layout, compressed })
    }

    /// Writes one frame; the writer should be buffered.
    ///
    /// # Errors
    /// What the writer answers.
    pub fn write(self, frame: &Frame, writer: &mut dyn Write) -> io::Result<()> {
        if !self.compressed {
            return frame.write(self.layout, writer);
        }
        let mut encoder = zstd::Encoder::new(writer, zstd::DEFAULT_COMPRESSION_LEVEL)?;
        encoder.include_checksum(true)?;
        let mut buffer = io::BufWriter::with_capacity(1 << 16, encoder);
        frame.write(self.layout, &mut buffer)?;
        buffer.into_inner()?.finish()?;
        Ok(())
    }
}

/// All balls at one instant, in the scene's units.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Its number, which is its time over the time between two frames.
    pub number: u64,
    /// Simulated time.
    pub time: f64,
    /// The balls.
    pub balls: Placement,
}

impl Frame {
    fn write(&self, layout: Layout, writer: &mut dyn Write) -> io::Result<()> {
        let balls = &self.balls;
        let half = balls.domain.half_size;
        let (low, high) = (balls.center - half, balls.center + half);
        let boundary = balls.domain.boundary;
        let count = balls.positions.len();
        match layout {
            Layout::ExtendedXyz => {
                let size = 2.0 * half;
                let periodic = match boundary {
                    Boundary::Periodic => "T T T",
                    Boundary::Container | Boundary::Open => "F F F",
                };
                // ASE takes elements only, and X for what is none.
                writeln!(
                    writer,
                    "{count}\nLattice=\"{:?} 0.0 0.0 0.0 {:?} 0.0 0.0 0.0 {:?}\" Origin=\"{:?} {:?} {:?}\" pbc=\"{periodic}\" \
                     Properties=species:S:1:pos:R:3:velo:R:3:radius:R:1:mass:R:1:id:I:1:kind:I:1 Time={:?}",
                    size.x, size.y, size.z, low.x, low.y, low.z, self.time
                )?;
            }
            Layout::LammpsDump => {
                let sides = match boundary {
                    Boundary::Periodic => "pp pp pp",
                    Boundary::Container => "ff ff ff",
                    Boundary::Open => "ss ss ss",
                };
                writeln!(
                    writer,
                    "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n{count}\nITEM: BOX BOUNDS {sides}",
                    self.number
                )?;
                for (low, high) in low.to_array().into_iter().zip(high.to_array()) {
                    writeln!(writer, "{low:?} {high:?}")?;
                }
                writeln!(writer, "ITEM: ATOMS id type x y z vx vy vz radius mass")?;
            }
        }
        for (index, (p, v)) in balls.positions.iter().zip(&balls.velocities).enumerate() {
            let kind = balls.body_of.get(index).map_or(0, |&body| body as usize);
            let body = balls.bodies[kind];
            let (id, kind) = (index + 1, kind + 1);
            if layout == Layout::LammpsDump {
                write!(writer, "{id} {kind} ")?;
            } else {
                write!(writer, "X ")?;
            }
            write!(
                writer,
                "{:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?}",
                p.x, p.y, p.z, v.x, v.y, v.z, body.radius, body.mass
            )?;
            if layout == Layout::ExtendedXyz {
                write!(writer, " {id} {kind}")?;
            }
            writeln!(writer)?;
        }
        Ok(())
    }
}
