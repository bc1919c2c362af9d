//! A worker: leases passes, renders them on its own threads, uploads them. It holds no state that matters.
//!
//! ```text
//! run ── register, load the scene ── session ─┬─ lease ─ render ─ lease ─ render ─ …
//!                                             ├─ upload the pass before
//!                                             └─ heartbeat
//! ```
//! A coordinator that has no farm but a scene that changes is attended to in `live`, for sketches and passes of its
//! revisions.
//!
//! Rendering has threads of its own, so that it cannot starve the heartbeat, and neither leasing nor uploading makes it
//! wait.

mod cache;
mod canary;
pub mod cli;
mod client;
/// Of the build script, for its tests.
#[cfg(test)]
#[path = "../commit.rs"]
mod commit;
mod config;
pub mod engine;
mod error;
pub mod exit;
pub mod identity;
mod live;
pub mod offer;
mod pulse;
mod render;
mod run;
mod say;
pub mod security;
mod session;
pub mod signals;

pub use beamfarm_proto::visible;
pub use canary::{canary, canary_by};
pub use config::Config;
pub use error::WorkerError;
pub use run::run;
pub use session::Summary;
