//! The engine for processors: it traces, stores and finds photons and traces camera paths, as the plan says.

pub mod beam;
pub mod convergence;
mod flow;
mod kernel;
pub mod pass;
pub mod photon_map;
pub mod probe;
pub mod reference;
pub mod transport;
