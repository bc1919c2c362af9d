//! Images that do not fit into this machine's memory.

use super::Failure;
use sysinfo::{MemoryRefreshKind, RefreshKind, System};

/// The least number of films per layer held at a time: a pass, the sum, and the average.
const FILMS: u64 = 3;
/// Bytes per pixel of a film.
const PIXEL: u64 = 12;

/// Fails if an image of this size with this many layers does not fit into free memory. Otherwise the system would kill
/// some process, perhaps this one.
pub fn check(width: u32, height: u32, layers: usize) -> Result<(), Failure> {
    let pixels = u64::from(width) * u64::from(height);
    // Two more for the beauty and the differences between passes.
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
