//! The wire of beamfarm: the generated code of `farm.proto` and its kin, the domain types that the farm exchanges, and
//! the conversions between the two.

mod convert;
mod domain;
mod identity;
mod revision;
mod token;
mod visible;

pub use convert::{WireError, WireHash};
pub use domain::{Device, FileEntry, FileHash, Grant, Job, Lack, LeaseId, Manifest, Offer, WorkerId, WorkerKey};
pub use identity::{Fingerprint, Identity};
pub use prost::bytes;
pub use revision::{Revision, RevisionNumber, Task, TaskNumber, Work};
pub use token::{TOKEN_VARIABLE, Token};
pub use visible::{misleads, visible};

/// The generated code. Its comments are farm.proto's; `tests/generated.rs` makes it.
#[allow(missing_docs, clippy::all)]
pub mod wire {
    include!("generated/beamfarm.v1.rs");
}

/// Version of the program, which coordinator and workers must share: another one might render other bits.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Version of the protocol: it grows when a message changes so that programs of before would misunderstand it. Those of
/// before it was counted say 0.
pub const PROTOCOL: u32 = 1;

/// Bytes in a chunk of a file or of a submission; well below the 4 MiB that tonic takes in a message.
pub const CHUNK_BYTES: usize = 1 << 20;
