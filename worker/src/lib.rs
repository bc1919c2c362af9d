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
//!
//! # Example
//!
//! ```no_run
//! use beamfarm_worker::offer::Offered;
//! use beamfarm_worker::security::Credentials;
//! use beamfarm_worker::{Config, Summary, WorkerError, run};
//! use std::time::Duration;
//!
//! async fn work() -> Result<Summary, WorkerError> {
//!     let config = Config {
//!         url: "http://127.0.0.1:7325".into(),
//!         credentials: Credentials::default(),
//!         threads: 4,
//!         at_once: None,
//!         name: "bench".into(),
//!         state: None,
//!         cache: None,
//!         patience: Duration::from_secs(60),
//!         grace: Duration::from_secs(10),
//!     };
//!     // Sending true asks it to finish.
//!     let (_finish, drain) = tokio::sync::watch::channel(false);
//!     run(config, Offered::processors(), drain).await
//! }
//! ```

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
