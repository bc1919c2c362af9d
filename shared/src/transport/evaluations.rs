//! Counts of what light at surfaces is computed from. Only with the feature `evaluations`: without it nothing is counted.

use std::sync::atomic::{AtomicU64, Ordering};

/// Gather rays.
pub static GATHER_RAYS: AtomicU64 = AtomicU64::new(0);
/// Values of BSDFs, and directions drawn by them.
pub static BSDF: AtomicU64 = AtomicU64::new(0);
/// Densities of BSDFs.
pub static PDF: AtomicU64 = AtomicU64::new(0);
/// Photons whose kernels were found to cover a point.
pub static PHOTONS: AtomicU64 = AtomicU64::new(0);

#[inline(always)]
pub(super) fn count(what: &AtomicU64) {
    if cfg!(feature = "evaluations") {
        what.fetch_add(1, Ordering::Relaxed);
    }
}
