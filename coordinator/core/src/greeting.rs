//! What workers say of themselves when they come, and what they may be refused for. Both services that workers call ask
//! the same.

use beamfarm_proto::{Fingerprint, Identity, PROTOCOL, VERSION};
use tonic::Status;

/// Longest version that a message repeats, in bytes.
const VERSION_BYTES: usize = 200;

/// Why a worker's program does not match this one.
pub(crate) fn same_program(version: &str, protocol: u32) -> Result<(), String> {
    if version == VERSION && protocol == PROTOCOL {
        return Ok(());
    }
    let version = shortened(version, VERSION_BYTES);
    Err(format!(
        "version {version} with protocol {protocol}; this coordinator is version {VERSION} with protocol {PROTOCOL}: install \
         that on the worker's machine"
    ))
}

/// The fingerprint that the worker with this identity is known by.
pub(crate) fn fingerprint(identity: &[u8]) -> Result<Fingerprint, Status> {
    let identity = Identity::from_bytes(identity);
    let identity = identity.ok_or_else(|| Status::invalid_argument("identity: expected 32 bytes"))?;
    Ok(identity.fingerprint())
}

/// The first `bytes` bytes of a text, without half a character.
pub(crate) fn shortened(text: &str, bytes: usize) -> &str {
    &text[..text.floor_char_boundary(bytes)]
}
