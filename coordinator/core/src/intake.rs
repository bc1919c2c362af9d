//! Arriving deliveries: how many bytes they may hold, and how long each takes.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tonic::Status;

/// The most bytes of deliveries held at a time, unless `AT_LEAST` blocks need more.
const BYTES: u64 = 256 << 20;
/// The number of blocks that always fit.
const AT_LEAST: u64 = 4;
/// The most deliveries that wait for room, each with what its connection buffers. Others are asked to retry.
const WAITING: usize = 64;
/// Bytes are counted in units of this size.
const UNIT: u64 = 4096;
/// Weight of the last block in the time per block.
const RECENT: f64 = 0.1;

/// The gate for deliveries.
pub(crate) struct Intake {
    bytes: Arc<Semaphore>,
    waiting: Semaphore,
    /// For the one delivery that may exceed the room when all wait.
    beyond: Arc<Semaphore>,
    meter: Mutex<Meter>,
}

impl Intake {
    /// A gate for deliveries of at most `largest` bytes.
    pub fn new(largest: u64) -> Self {
        let units = (BYTES.max(AT_LEAST * largest) / UNIT).min(Semaphore::MAX_PERMITS as u64);
        Self {
            bytes: Arc::new(Semaphore::new(units as usize)),
            waiting: Semaphore::new(WAITING),
            beyond: Arc::new(Semaphore::new(1)),
            meter: Mutex::default(),
        }
    }

    /// Start a delivery of which nothing has arrived yet.
    pub fn begin(self: &Arc<Self>) -> Delivery {
        self.meter().begin(Instant::now());
        Delivery {
            intake: self.clone(),
            room: None,
            beyond: None,
        }
    }

    /// The time to take in one block while deliveries are under way; simultaneous deliveries share the time.
    pub fn seconds_per_block(&self) -> f64 {
        self.meter().seconds
    }

    fn meter(&self) -> MutexGuard<'_, Meter> {
        self.meter.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A delivery under way. Bytes that have arrived count until it is dropped; those that its header claims do not.
pub(crate) struct Delivery {
    intake: Arc<Intake>,
    room: Option<OwnedSemaphorePermit>,
    /// Held if it may exceed the room.
    beyond: Option<OwnedSemaphorePermit>,
}

impl Delivery {
    /// Wait until there is room for `bytes` bytes in all. If waiting deliveries hold all the room, one of them
    /// continues without, and frees its room when it ends.
    pub async fn grow(&mut self, bytes: u64) -> Result<(), Status> {
        let busy = || Status::resource_exhausted("too much arrives at the same time");
        let held = self.room.as_ref().map_or(0, OwnedSemaphorePermit::num_permits) as u64;
        let units = bytes.div_ceil(UNIT).saturating_sub(held);
        let units = u32::try_from(units).unwrap_or(u32::MAX);
        if units == 0 || self.beyond.is_some() {
            return Ok(());
        }
        let Intake {
            bytes: room,
            waiting,
            beyond,
            ..
        } = &*self.intake;
        let room = match room.clone().try_acquire_many_owned(units) {
            Ok(room) => room,
            Err(_) => {
                let _place = waiting.try_acquire().map_err(|_| busy())?;
                tokio::select! {
                    biased;
                    room = room.clone().acquire_many_owned(units) => room.map_err(|_| busy())?,
                    beyond = beyond.clone().acquire_owned() => {
                        self.beyond = Some(beyond.map_err(|_| busy())?);
                        return Ok(());
                    }
                }
            }
        };
        match &mut self.room {
            Some(held) => held.merge(room),
            None => self.room = Some(room),
        }
        Ok(())
    }
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
        // One every 10 ms, each taking 100 ms.
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
            let mut delivery = intake.begin();
            delivery.grow(largest).await.unwrap();
            inside.push(delivery);
        }
        // One continues regardless.
        let mut beyond = intake.begin();
        beyond.grow(largest).await.unwrap();
        assert!(beyond.beyond.is_some());
        let mut spare = intake.begin();
        let wait = Duration::from_millis(5);
        assert!(tokio::time::timeout(wait, spare.grow(1)).await.is_err());
        let crowd: Vec<_> = (0..WAITING)
            .map(|_| {
                let mut delivery = intake.begin();
                tokio::spawn(async move { delivery.grow(largest).await })
            })
            .collect();
        let all_wait = async {
            while intake.waiting.available_permits() > 0 {
                tokio::task::yield_now().await;
            }
        };
        let long = Duration::from_secs(60);
        tokio::time::timeout(long, all_wait).await.unwrap();
        let refused = spare.grow(1).await.err().map(|status| status.code());
        assert_eq!(refused, Some(tonic::Code::ResourceExhausted));
        drop((inside, beyond));
        for waiting in crowd {
            waiting.await.unwrap().unwrap();
        }
    }

    #[tokio::test]
    async fn what_only_claims_to_come_takes_no_room_and_those_that_wait_for_each_other_end() {
        let largest = BYTES / 4;
        let intake = Arc::new(Intake::new(largest));
        // Half of each of eight fills all the room.
        let mut halves = Vec::new();
        for _ in 0..8 {
            let mut delivery = intake.begin();
            delivery.grow(largest / 2).await.unwrap();
            halves.push(delivery);
        }
        let all = halves.into_iter().map(|mut delivery| {
            tokio::spawn(async move {
                delivery.grow(largest / 4 * 3).await.unwrap();
                tokio::task::yield_now().await;
                delivery.grow(largest).await.unwrap();
            })
        });
        for delivery in all.collect::<Vec<_>>() {
            let long = Duration::from_secs(60);
            tokio::time::timeout(long, delivery).await.unwrap().unwrap();
        }
        assert_eq!(intake.bytes.available_permits() as u64, BYTES / UNIT);
    }
}
