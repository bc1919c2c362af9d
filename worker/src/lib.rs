//! How does a machine take part in a render farm? A worker leases blocks of passes from a coordinator, renders them
//! on its own threads, and uploads their sums. It holds no state that matters.
//!
//! Enter with [`run()`]. It takes a [`Config`] (the coordinator's address, credentials, threads), an
//! [`Offered`](offer::Offered) (the engines of this machine) and a signal to finish, and returns a [`Summary`].
//! [`cli::main`] calls it from a command line.
//!
//! ```text
//! coordinator             worker
//! job, files ───────────► run: register, load the scene ── Prepared (scene, plan, engine)
//! leases of blocks ─────► session ─┬─ lease ─ render ─ lease ─ render ─ …
//! sums of passes ◄─────────────────┼─ upload the previous block
//! heartbeats ◄─────────────────────┴─ heartbeat
//! revisions, tasks ─────► live: sketches and passes of a changing scene, for a coordinator without a farm
//! ```
//!
//! Rendering has its own threads, so that it cannot starve the heartbeat, and waits neither for leases nor for uploads.

mod cache;
mod canary;
pub mod cli;
mod client;
/// The build script's module, included for its tests.
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
