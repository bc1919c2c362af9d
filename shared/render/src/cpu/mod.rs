//! The engine on processors: photons are traced, stored and found, and camera paths traced, by what the plan says.

pub mod beam;
pub mod convergence;
mod flow;
mod kernel;
pub mod pass;
pub mod photon_map;
pub mod probe;
pub mod reference;
pub mod transport;
