//! Experiments: what the program says about itself, measured by itself.
//!
//! Each is a command of its own, `moltop experiment NAME`. Gases are made directly, without scene files, and run on the
//! calling thread: an experiment is the place where simulated time and wall time are compared on purpose.

pub mod all_pairs;
pub mod double_double;
pub mod echo;
pub mod extremes;
pub mod fit;
pub mod fluid;
pub mod gas;
pub mod gases;
pub mod growth;
pub mod kept;
pub mod observables;
pub mod page;
pub mod plot;
pub mod precise;
pub mod progress;
pub mod queue;
pub mod reversal;
pub mod theory;
pub mod trade;
pub mod trial;
