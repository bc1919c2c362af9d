//! The coordinator: which worker renders which passes, do the results count, and what is the image so far?
//!
//! ```text
//!  JobSpec ──► Farm ◄──► ledger                    who renders what: leases, checks, verdicts
//!               ▲
//!               │ service                          leases out, blocks in
//!               │ listener, security, limits
//!               ▼
//!            workers
//!
//!  block ──► intake ──► examine ──► sum of passes ─┬─► store   checkpoints, ledger.jsonl, report.json
//!                                                  └─► watch   page, /metrics, `beamfarm status`, tev
//! ```
//!
//! **Data.** A [`JobSpec`] has the scene as bytes, the settings of its passes, and their number. The crate never looks
//! into the scene and does not depend on the renderer. The result is one sum of all passes that count, from which
//! [`Farm::average`] makes the image. A [`store::Folder`] keeps what a job needs to resume after a crash.
//!
//! **Entrance.** Make a [`Farm`], wrap it in a [`Watch`], and call [`server::run`]. [`server::serve`] does the same for
//! a [`Series`] of jobs, such as the frames of an animation, and [`server::look`] for [`revisions`], a scene that
//! changes while it is rendered.
//!
//! **Where to look.** [`ledger`] is the state machine of leases, without clock or network; [`farm`] ties it to the sum.
//! [`watch`] serves those who look on. [`security`] decides who is admitted, and [`limits`] how much each peer may use.
//!
//! # Example
//!
//! The ledger of a job with three passes, and a worker that renders them:
//!
//! ```
//! use beamfarm_coordinator::ledger::{Ledger, Rules};
//! use beamfarm_proto::Grant;
//! use std::time::Duration;
//!
//! let now = Duration::ZERO;
//! let rules = Rules {
//!     first_pass: 0,
//!     passes: 3,
//!     lease: Duration::from_secs(30),
//!     failures_per_pass: 3,
//!     failures_per_worker: 5,
//!     refusals_per_worker: 2,
//!     back_off: Duration::ZERO,
//!     audit_every: 0,
//!     audit_salt: [0; 32],
//! };
//! let mut ledger = Ledger::new(rules, 0);
//! let worker = ledger.register("bench", 8, Some([0; 32]), None, now).expect("it is welcome");
//! while let Ok(Grant::Lease(lease, block)) = ledger.lease(worker, now) {
//!     let pixels = [block.start() as u8; 32];
//!     ledger.accept(worker, lease, block, pixels, now).expect("it counts");
//! }
//! assert_eq!((ledger.prefix(), ledger.is_complete()), (3, true));
//! ```

mod arriving;
mod chunks;
mod control;
pub mod downloads;
mod examine;
pub mod farm;
mod greeting;
pub mod html;
mod intake;
mod keys;
pub mod ledger;
pub mod limits;
pub mod listener;
mod plausible;
mod rarely;
pub mod revisions;
pub mod security;
pub mod series;
pub mod server;
mod service;
pub mod store;
pub mod tev;
pub mod watch;
mod web;

pub use farm::{
    DoneBlock, End, Entry, EntryState, Event, EventKind, ExtendError, Farm, JobSpec, Progress, Snapshot, Start, Target,
    Timing, Unable,
};
pub use ledger::{Who, WorkerState, WorkerView};
pub use listener::Entrance;
pub use series::{FrameState, FrameView, Series};
pub use watch::{Terms, Watch};
