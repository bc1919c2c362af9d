//! To stop what has begun: a picture that nobody waits for any more.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Stops the rendering of a scene that has it, and everything that is made ready for it, within milliseconds. All
/// clones are one. What was stopped returns something that means nothing; of a pass, pixels that are not numbers.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Stop, now and from now on.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether somebody said so.
    #[inline]
    pub fn is_raised(&self) -> bool {
        // Once it is raised it stays: whoever sees so has nothing else to wait for.
        self.0.load(Ordering::Relaxed)
    }
}
