//! The coordinator: hands passes out, checks what comes back, and adds it up.
//!
//! [`ledger`] decides who renders what and knows neither clock nor network; [`farm`] is the job as a whole, shared by
//! all calls, and a [`series`] is several of them one after the other; [`server`] is the way in, for workers and those
//! who [`watch`], as far as [`security`] lets them pass.
//! [`revisions`] are for scenes that change while they are looked at. The renderer is not needed here: a scene is bytes
//! and a hash.

mod arriving;
mod chunks;
mod control;
mod examine;
pub mod farm;
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
