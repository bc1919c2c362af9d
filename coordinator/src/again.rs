//! What a disk did not take is written again, as checkpoints are.

use crate::failure::Failure;
use beamfarm_coordinator::Farm;
use beamfarm_coordinator::store::{Folder, RETRY, Report};
use std::time::Duration;
use tokio::task::block_in_place;
use tokio::time::{Instant, sleep};
use tracing::warn;

/// Time until what cannot be written is given up.
const PATIENCE: Duration = Duration::from_secs(300);

/// Whether nobody wants to wait any more.
pub type IsOver<'a> = dyn Fn() -> bool + Sync + 'a;

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
    /// What became of a job's folder, whose keeper left it like this: it gets what the farm holds.
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

    /// Have the folder say how the job ended.
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

    /// What an attempt to write came to, when there is to be no other; nothing when it is time for the next. `is_over`:
    /// nobody wants to wait any more.
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

/// Say that it is not the end.
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
