//! What a disk did not take is written again, as checkpoints are, while the frames that follow render.

use crate::failure::Failure;
use beamfarm_coordinator::store::RETRY;
use std::time::Duration;
use tokio::time::{Instant, sleep};
use tracing::warn;

/// Time until a frame that cannot be written is given up. A later command renders it anew.
const PATIENCE: Duration = Duration::from_secs(300);

/// Attempts to write, all of them within one patience.
pub struct Again {
    /// When the first attempt failed.
    since: Option<Instant>,
    retry: Duration,
    patience: Duration,
}

impl Default for Again {
    fn default() -> Self {
        Self {
            since: None,
            retry: RETRY,
            patience: PATIENCE,
        }
    }
}

impl Again {
    /// What an attempt to write came to, when there is to be no other; nothing when it is time for the next. `is_over`:
    /// nobody wants to wait any more.
    pub async fn settled<T>(&mut self, attempt: Result<T, Failure>, is_over: bool) -> Option<Result<T, Failure>> {
        let is_late = self.since.is_some_and(|since| since.elapsed() >= self.patience);
        match attempt {
            Err(failure) if failure.may_pass() && !is_over && !is_late => {
                self.since.get_or_insert_with(Instant::now);
                warn_of(&failure, self.retry);
                sleep(self.retry).await;
                None
            }
            last => Some(last),
        }
    }
}

/// Say that it is not the end.
pub fn warn_of(failure: &Failure, retry: Duration) {
    let message = failure.to_string();
    let plain = message.strip_prefix("error: ").unwrap_or(&message);
    warn!("{plain}; the frames go on, and it is written again in {retry:?}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Error, ErrorKind};

    fn failure(kind: ErrorKind) -> Failure {
        Failure::because_of(&Error::from(kind), "a.exr")
    }

    fn quick() -> Again {
        Again {
            retry: Duration::from_millis(1),
            patience: Duration::from_millis(50),
            ..Again::default()
        }
    }

    /// Attempts at what fails so often; the result, and how many there were.
    async fn attempts(again: &mut Again, failures: u32, kind: ErrorKind, is_over: bool) -> (Result<u32, Failure>, u32) {
        for count in 1.. {
            let attempt = match count <= failures {
                true => Err(failure(kind)),
                false => Ok(count),
            };
            if let Some(settled) = again.settled(attempt, is_over).await {
                return (settled, count);
            }
        }
        unreachable!("attempts without end")
    }

    #[tokio::test]
    async fn a_full_disk_is_waited_for_and_nothing_else() {
        let (written, _) = attempts(&mut quick(), 3, ErrorKind::StorageFull, false).await;
        assert_eq!(written.unwrap(), 4);
        let (missing, count) = attempts(&mut quick(), 3, ErrorKind::NotFound, false).await;
        assert_eq!((missing.is_err(), count), (true, 1));
    }

    #[tokio::test]
    async fn patience_ends_with_its_time_or_with_the_series() {
        let mut again = quick();
        let (written, count) = attempts(&mut again, u32::MAX, ErrorKind::StorageFull, false).await;
        assert!(written.is_err() && count > 1, "{count}");
        // One patience is for all that a frame writes.
        let (written, count) = attempts(&mut again, u32::MAX, ErrorKind::StorageFull, false).await;
        assert_eq!((written.is_err(), count), (true, 1));
        let (written, count) = attempts(&mut quick(), u32::MAX, ErrorKind::StorageFull, true).await;
        assert_eq!((written.is_err(), count), (true, 1));
    }
}
