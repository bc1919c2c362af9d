//! Deliveries on their way in: how many bytes of them there may be, and how long each takes.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tonic::Status;

/// Bytes of deliveries that are held at the same time, unless a few blocks are more.
const BYTES: u64 = 256 << 20;
/// Blocks that are always let in together.
const AT_LEAST: u64 = 4;
/// Deliveries that wait to be let in, each with what its connection buffers. Others are told to come back.
const WAITING: usize = 64;
/// Bytes are counted in units of so many.
const UNIT: u64 = 4096;
/// Part that the last blocks have in the time that a block takes.
const RECENT: f64 = 0.1;

/// The gate for deliveries.
pub(crate) struct Intake {
    bytes: Arc<Semaphore>,
    units: u64,
    waiting: Semaphore,
    meter: Mutex<Meter>,
}

impl Intake {
    /// A gate for deliveries of at most so many bytes.
    pub fn new(largest: u64) -> Self {
        let units = (BYTES.max(AT_LEAST * largest) / UNIT).min(Semaphore::MAX_PERMITS as u64);
        Self {
            bytes: Arc::new(Semaphore::new(units as usize)),
            units,
            waiting: Semaphore::new(WAITING),
            meter: Mutex::default(),
        }
    }

    /// Wait until there is room for so many bytes. They count until the value is dropped.
    pub async fn admit(self: &Arc<Self>, size: u64) -> Result<Delivery, Status> {
        let busy = || Status::resource_exhausted("too much arrives at the same time");
        // Never none; and never more than there are.
        let units = size.div_ceil(UNIT).clamp(1, self.units.min(u32::MAX.into())) as u32;
        let room = match self.bytes.clone().try_acquire_many_owned(units) {
            Ok(room) => room,
            Err(_) => {
                let _place = self.waiting.try_acquire().map_err(|_| busy())?;
                let room = self.bytes.clone().acquire_many_owned(units).await;
                room.map_err(|_| busy())?
            }
        };
        self.meter().begin(Instant::now());
        Ok(Delivery {
            intake: self.clone(),
            _room: room,
        })
    }

    /// Time in which one block is taken in, while any is: of several at the same time, each takes its share.
    pub fn seconds_per_block(&self) -> f64 {
        self.meter().seconds
    }

    fn meter(&self) -> MutexGuard<'_, Meter> {
        self.meter.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A delivery on its way in.
pub(crate) struct Delivery {
    intake: Arc<Intake>,
    _room: OwnedSemaphorePermit,
}

impl Drop for Delivery {
    fn drop(&mut self) {
        self.intake.meter().end(Instant::now());
    }
}

/// Measures busy time.
#[derive(Debug, Default)]
struct Meter {
    under_way: u32,
    since: Option<Instant>,
    seconds: f64,
    known: bool,
}

impl Meter {
    fn begin(&mut self, now: Instant) {
        self.under_way += 1;
        self.since.get_or_insert(now);
    }

    fn end(&mut self, now: Instant) {
        self.under_way = self.under_way.saturating_sub(1);
        let since = match self.under_way {
            0 => self.since.take(),
            _ => self.since.replace(now),
        };
        let took = since.map_or(0.0, |since| now.saturating_duration_since(since).as_secs_f64());
        match self.known {
            true => self.seconds += RECENT * (took - self.seconds),
            false => self.seconds = took,
        }
        self.known = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn blocks_that_overlap_share_the_time() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut meter = Meter::default();
        // One every 10 ms, each of which takes 100 ms.
        for i in 0..500 {
            meter.begin(at(10 * i));
            if i >= 10 {
                meter.end(at(10 * i));
            }
        }
        assert!((meter.seconds - 0.01).abs() < 0.001, "{}", meter.seconds);
        // One after the other, 50 ms each, with long pauses.
        let mut meter = Meter::default();
        for i in 0..500 {
            meter.begin(at(1000 * i));
            meter.end(at(1000 * i + 50));
        }
        assert!((meter.seconds - 0.05).abs() < 0.001, "{}", meter.seconds);
    }

    #[tokio::test]
    async fn bytes_are_bounded_and_so_are_those_that_wait() {
        let largest = BYTES;
        let intake = Arc::new(Intake::new(largest));
        let mut inside = Vec::new();
        for _ in 0..AT_LEAST {
            inside.push(intake.admit(largest).await.unwrap());
        }
        let (wait, spare) = (Duration::from_millis(5), intake.clone());
        assert!(tokio::time::timeout(wait, spare.admit(1)).await.is_err());
        let crowd: Vec<_> = (0..WAITING)
            .map(|_| {
                let intake = intake.clone();
                tokio::spawn(async move { intake.admit(largest).await.map(drop) })
            })
            .collect();
        let all_wait = async {
            while intake.waiting.available_permits() > 0 {
                tokio::task::yield_now().await;
            }
        };
        let long = Duration::from_secs(60);
        tokio::time::timeout(long, all_wait).await.unwrap();
        let refused = intake.admit(1).await.err().map(|status| status.code());
        assert_eq!(refused, Some(tonic::Code::ResourceExhausted));
        drop(inside);
        for waiting in crowd {
            waiting.await.unwrap().unwrap();
        }
    }
}
