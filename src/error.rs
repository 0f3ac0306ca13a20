//! The one error type: the user's mistake or the world's, in words that name the file, the key, the value and the limit.
//!
//! Our own mistakes are panics, never an [`Error`].

use std::path::PathBuf;

/// What can go wrong between the user, the machine and a run.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A scene that cannot be run: one line per fault, each `file: key = value: limit`.
    #[error("{}", .0.join("\n"))]
    Scene(Vec<String>),
    /// Arguments that contradict each other or the scene.
    #[error("{0}")]
    Usage(String),
    /// A file or directory that could not be read or written.
    #[error("{}: cannot {action}: {source}", .path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// What was tried, as a verb: `read`, `write`, `create`.
        action: &'static str,
        /// What the system answered.
        source: std::io::Error,
    },
    /// The terminal could not be used.
    #[error("terminal: {0}")]
    Terminal(std::io::Error),
    /// The engine stopped before its time; the text says why.
    #[error("{0}")]
    Engine(String),
}

impl Error {
    /// Exit code of the process: 2 for usage and invalid input, 1 for the rest.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(_) | Self::Usage(_) => 2,
            Self::File { .. } | Self::Terminal(_) | Self::Engine(_) => 1,
        }
    }
}

/// A result with moltop's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;
