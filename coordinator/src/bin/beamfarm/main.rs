//! The command `beamfarm`.
fn main() {}
