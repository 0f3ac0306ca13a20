//! The `moltop` program.
fn main() {}
