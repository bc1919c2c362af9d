//! The job that a live view has beside itself.

use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::time::timeout;

/// Time for a job to write what it has when the view ends.
const FAREWELL: Duration = Duration::from_secs(20);

/// The one job that a view has at a time.
pub struct Jobs {
    place: Arc<Semaphore>,
    over: watch::Sender<bool>,
}

impl Jobs {
    pub fn new() -> Self {
        Self {
            place: Arc::new(Semaphore::new(1)),
            over: watch::Sender::new(false),
        }
    }

    /// The place of a job, unless there is one.
    pub fn begin(&self) -> Option<OwnedSemaphorePermit> {
        self.place.clone().try_acquire_owned().ok()
    }

    /// True once the view ends.
    pub fn over(&self) -> watch::Receiver<bool> {
        self.over.subscribe()
    }

    /// End the job that is under way, as Ctrl-C does: it writes the passes that are complete.
    pub async fn end(&self) {
        self.over.send_replace(true);
        // Who has the place gives it back when its job has ended.
        let _ = timeout(FAREWELL, self.place.acquire()).await;
    }
}
