//! moltop: *top for molecules*, a terminal monitor for long hard-sphere gas runs.
//!
//! # Layers
//!
//! Imports point downwards only; `tests/layers.rs` reads the sources and fails when one does not.
//!
//! * **Screen** (`tui`) sees [`feed`] and [`snapshot`], never an engine.
//! * **Edges** ([`scene`], [`worker`], [`headless`], [`summary`], ...) own files, threads, signals and the wall clock.
//! * **Physics** ([`collision`], [`state`], [`engine`], [`observe`], ...) is pure: it knows no clock, file, thread or screen.
//!
//! # Invariants
//!
//! * An engine is a function of its [`state::State`]: calendar and cells are derived and can be rebuilt at any time.
//! * Simulation time meets the wall clock only in [`worker`].
//! * One type, [`snapshot::Snapshot`], leaves the engine thread.
//! * Same scene, seed and engine give the same collisions in the same order, bit for bit.
//! * Randomness ends when placement ends; the statistical engine alone draws, as a pure function of seed, step and cell.
//! * A ball *is* a trajectory ([`state::Trajectory`]). A prediction is a pure function of two trajectories, or of one and a
//!   wall, never of the current time; cell crossings change no trajectory.
//! * Time is an epoch count plus a local time ([`state::Time`]), so precision does not fade in long runs.

pub mod error;

// Physics.
pub mod calendar;
pub mod cell_list;
pub mod collision;
pub mod domain;
pub mod engine;
pub mod event;
pub mod observe;
pub mod state;
pub mod sum;
pub mod time;
pub mod units;

// Edges.
pub mod check;
pub mod checkpoint;
pub mod cli;
pub mod convert;
pub mod experiment;
pub mod feed;
pub mod generate;
pub mod headless;
pub mod history;
pub mod normal;
pub mod output;
pub mod quantity;
pub mod report;
pub mod run;
pub mod run_directory;
pub mod run_process;
pub mod runs;
pub mod scene;
pub mod signals;
pub mod snapshot;
pub mod summary;
pub mod trajectory_file;
pub mod worker;

// Screen.
pub mod tui;
