//! Waiting for work in another thread.

use super::Failure;
use std::any::Any;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Time between questions whether to continue.
pub const TICK: Duration = Duration::from_millis(100);

/// Progress of the work.
#[derive(Clone, Copy, Debug)]
pub enum State {
    /// Decoding files and running pilots.
    Preparing,
    /// Rendering passes or samples.
    Rendering {
        /// Complete ones, from the first on.
        passes: u64,
        /// Their total, if known.
        limit: Option<u64>,
        /// Completed fraction of the work, 0 to 1.
        fraction: f64,
        /// Estimated remaining time, if known.
        remaining: Option<Duration>,
        /// Relative standard error, if known.
        error: Option<f64>,
    },
}

/// Run `work` in its own thread, and abandon it when `tell` returns `false`. A panic becomes a failure.
pub fn wait_for<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Failure> + Send + 'static,
    tell: &mut dyn FnMut() -> bool,
) -> Result<T, Failure> {
    let (done, waiting) = mpsc::channel();
    let thread = std::thread::spawn(move || {
        // Fails when nobody waits any more.
        let _ = done.send(work());
    });
    loop {
        match waiting.recv_timeout(TICK) {
            Ok(done) => return done,
            Err(RecvTimeoutError::Timeout) if tell() => {}
            Err(RecvTimeoutError::Timeout) => return Err(Failure::nothing("stopped before the first pass")),
            Err(RecvTimeoutError::Disconnected) => {
                let panic = thread.join().err();
                return Err(panicked(&panic));
            }
        }
    }
}

fn panicked(panic: &Option<Box<dyn Any + Send>>) -> Failure {
    let text = panic.as_deref().and_then(|panic| {
        let text = panic.downcast_ref::<&str>().copied();
        text.or_else(|| panic.downcast_ref::<String>().map(String::as_str))
    });
    Failure::job(format!("the renderer panicked: {}", text.unwrap_or("no message")))
}

/// A pool of this many threads; `None`: one per core.
pub fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Failure> {
    let builder = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0));
    builder.build().map_err(Failure::io)
}
