//! Images that this machine has no room for.

use super::Failure;
use sysinfo::{MemoryRefreshKind, RefreshKind, System};

/// Films of each layer that are held at the same time, at least: a pass, the sum, and the average.
const FILMS: u64 = 3;
/// Bytes of a pixel of a film.
const PIXEL: u64 = 12;

/// Fails where an image of this size, with so many layers, cannot be held beside what else is in memory: the system
/// would end whoever is in its way, this program among them.
pub fn check(width: u32, height: u32, layers: usize) -> Result<(), Failure> {
    let pixels = u64::from(width) * u64::from(height);
    // The beauty and the differences of passes.
    let needed = pixels * PIXEL * FILMS * (layers as u64 + 2);
    let ram = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(ram);
    let limited = system.cgroup_limits().map(|limits| limits.free_memory);
    let free = limited.map_or(system.available_memory(), |free| free.min(system.available_memory()));
    match free > 0 && needed > free {
        true => Err(Failure::memory(format!(
            "an image of {width} x {height} pixels with {layers} layers takes at least {} MB, and {} MB are free",
            needed >> 20,
            free >> 20
        ))),
        false => Ok(()),
    }
}
