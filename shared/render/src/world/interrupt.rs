//! Stops work in progress, such as a picture that nobody waits for any more.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Stops the rendering of its scene, and all preparation for it, within milliseconds. All clones share one state.
/// Interrupted work returns meaningless results; for a pass, NaN pixels.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Stops now and permanently.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it was raised.
    #[inline]
    pub fn is_raised(&self) -> bool {
        // The flag is never lowered, and guards no other data.
        self.0.load(Ordering::Relaxed)
    }
}
