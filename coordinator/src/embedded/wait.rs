//! Waiting for work in another thread.

use super::Failure;
use std::any::Any;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Time between two questions whether to go on.
pub const TICK: Duration = Duration::from_millis(100);

/// How far the work is.
#[derive(Clone, Copy, Debug)]
pub enum State {
    /// Files are decoded, and pilots choose what nobody said.
    Preparing,
    /// Passes or samples are rendered.
    Rendering {
        /// Those that are complete, from the first on.
        passes: u64,
        /// As many as there will be, if that is known.
        limit: Option<u64>,
        /// Share of the work that is done, 0 to 1.
        fraction: f64,
        /// Time that the rest will take, if that is known.
        remaining: Option<Duration>,
        /// Relative standard error, if it is known yet.
        error: Option<f64>,
    },
}

/// Do something in a thread of its own, which is left alone when `tell` says `false`. A panic is a failure.
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

/// So many threads to render by; `None`: one per core.
pub fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Failure> {
    let builder = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0));
    builder.build().map_err(Failure::io)
}
