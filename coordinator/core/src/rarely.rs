//! Limits log lines about frequent events.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Least time between reports.
const TELL_EVERY: Duration = Duration::from_secs(10);

/// Counts unreported events until the next report is due.
#[derive(Debug, Default)]
pub(crate) struct Rarely(Mutex<(u64, Option<Instant>)>);

impl Rarely {
    /// Count an event. If a report is due, returns the number of events since the last one.
    pub fn tell(&self) -> Option<u64> {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let (count, told) = &mut *state;
        *count += 1;
        if told.is_some_and(|told| told.elapsed() < TELL_EVERY) {
            return None;
        }
        *told = Some(Instant::now());
        Some(std::mem::take(count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_is_told_and_the_next_are_counted() {
        let rarely = Rarely::default();
        assert_eq!(rarely.tell(), Some(1));
        assert_eq!([(); 1000].map(|()| rarely.tell()), [None; 1000]);
        rarely.0.lock().unwrap().1 = Instant::now().checked_sub(TELL_EVERY);
        assert_eq!(rarely.tell(), Some(1001));
    }
}
