//! What do coordinators and workers say to each other? This crate holds the protocol: three gRPC services, the code
//! generated from them, the domain types of the farm, and checked conversions between wire and domain.
//!
//! ```text
//! farm.proto      workers: register, fetch files, lease passes, submit --+
//! control.proto   people and scripts: status, steering                   +--> wire (generated)
//! live.proto      live view: revisions, tasks, sketches -----------------+        ^  |
//!                                                            From, cannot fail    |  |  TryFrom, checks
//!                                                                                 |  v
//!                                                           Job, Manifest, Grant, Offer, Revision, Task, ...
//! ```
//!
//! Programs work with the domain types. A message that arrives is converted with `try_from`, whose [`WireError`] names
//! the field at fault; everything behind that can rely on valid values. [`Token`] and [`Identity`] are the secrets that
//! peers show, and [`visible()`] makes a peer's text safe to display.
//!
//! # Example
//!
//! ```
//! use beamfarm_proto::{FileEntry, FileHash, Manifest, wire};
//!
//! let path = String::from("ball.toml");
//! let file = FileEntry { path: path.clone(), hash: FileHash::of(b""), size: 0 };
//! let manifest = Manifest { scene: path, files: vec![file] };
//!
//! let mut message = wire::Manifest::from(&manifest);
//! assert_eq!(Manifest::try_from(message.clone())?, manifest);
//!
//! message.scene = "other.toml".into();
//! assert_eq!(Manifest::try_from(message).unwrap_err().field, "manifest.scene");
//! # Ok::<(), beamfarm_proto::WireError>(())
//! ```

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

/// The generated code. Its comments come from the .proto files; `tests/generated.rs` generates it.
#[allow(missing_docs, clippy::all)]
pub mod wire {
    include!("generated/beamfarm.v1.rs");
}

/// Version of the program, which coordinator and workers must share, since another version might render different bits.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Version of the protocol. It grows when a message changes so that older programs would misunderstand it. Programs
/// from before it existed say 0.
pub const PROTOCOL: u32 = 1;

/// Bytes per chunk of a file or submission, well below the 4 MiB that tonic accepts in a message.
pub const CHUNK_BYTES: usize = 1 << 20;
