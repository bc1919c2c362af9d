//! Repeats writes that a disk refused, as checkpoints do.

use crate::failure::Failure;
use beamfarm_coordinator::Farm;
use beamfarm_coordinator::store::{Folder, RETRY, Report};
use std::time::Duration;
use tokio::task::block_in_place;
use tokio::time::{Instant, sleep};
use tracing::warn;

/// Time after which writing is given up.
const PATIENCE: Duration = Duration::from_secs(300);

/// Whether waiting should stop.
pub type IsOver<'a> = dyn Fn() -> bool + Sync + 'a;

/// Repeated attempts to write, all within one time limit.
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
    /// Write the farm's state to a job's folder until it succeeds or is given up. `kept`: the result of the keeper's
    /// own last attempt.
    pub async fn keep_end(
        &mut self,
        is_over: &IsOver<'_>,
        mut folder: Option<&mut Folder>,
        farm: &Farm,
        kept: Result<(), Failure>,
    ) -> Result<(), Failure> {
        let mut attempt = kept;
        loop {
            if let Some(kept) = self.settled(attempt, is_over()).await {
                return kept;
            }
            attempt = match &mut folder {
                Some(folder) => block_in_place(|| folder.save_end(farm)).map_err(Failure::from),
                None => Ok(()),
            };
        }
    }

    /// Write the report on how the job ended into its folder.
    pub async fn report(
        &mut self,
        is_over: &IsOver<'_>,
        folder: Option<&Folder>,
        report: &Report,
    ) -> Result<(), Failure> {
        let Some(folder) = folder else {
            return Ok(());
        };
        loop {
            let attempt = block_in_place(|| folder.write_report(report)).map_err(Failure::from);
            if let Some(reported) = self.settled(attempt, is_over()).await {
                return reported;
            }
        }
    }

    /// The final result of an attempt to write; `None` after a pause if another attempt should follow. `is_over`:
    /// waiting should stop.
    pub async fn settled<T>(&mut self, attempt: Result<T, Failure>, is_over: bool) -> Option<Result<T, Failure>> {
        let is_late = self.since.is_some_and(|since| since.elapsed() >= self.patience);
        match attempt {
            Err(failure) if failure.may_pass() && !is_over && !is_late => {
                self.since.get_or_insert_with(Instant::now);
                warn_of(&failure);
                sleep(self.retry).await;
                None
            }
            last => Some(last),
        }
    }
}

/// Warn that another attempt follows.
pub fn warn_of(failure: &Failure) {
    let message = failure.to_string();
    let plain = message.strip_prefix("error: ").unwrap_or(&message);
    warn!("{plain}; another attempt follows in {RETRY:?}, and more for {PATIENCE:?}");
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

    /// Attempts at a write that fails `failures` times. Returns the result and the number of attempts.
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
        // One time limit applies to everything that a frame writes.
        let (written, count) = attempts(&mut again, u32::MAX, ErrorKind::StorageFull, false).await;
        assert_eq!((written.is_err(), count), (true, 1));
        let (written, count) = attempts(&mut quick(), u32::MAX, ErrorKind::StorageFull, true).await;
        assert_eq!((written.is_err(), count), (true, 1));
    }
}
