//! The job that runs next to a live view.

use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::time::timeout;

/// Time for a job to write its image when the view ends.
const FAREWELL: Duration = Duration::from_secs(20);

/// A view runs at most one job at a time.
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

    /// A permit for a job, unless one is running.
    pub fn begin(&self) -> Option<OwnedSemaphorePermit> {
        self.place.clone().try_acquire_owned().ok()
    }

    /// Becomes true when the view ends.
    pub fn over(&self) -> watch::Receiver<bool> {
        self.over.subscribe()
    }

    /// End the running job as Ctrl-C does: it writes the complete passes.
    pub async fn end(&self) {
        self.over.send_replace(true);
        // The permit is returned when the job has ended.
        let _ = timeout(FAREWELL, self.place.acquire()).await;
    }
}
