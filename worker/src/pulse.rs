//! Whether rendering gets on: a thread that hangs, or a machine that swaps, would hold its lease and say that all is
//! well.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::time::{Instant, sleep};

/// A pass may take so many times as long as the longest before it. What is usual is not known before the first.
const TOO_LONG: u32 = 64;
/// And it may take this long, however short others are.
const AT_LEAST: Duration = Duration::from_secs(60);
/// Time between looks.
const LOOK: Duration = Duration::from_secs(1);

/// When passes were rendered.
#[derive(Debug, Default)]
pub(crate) struct Pulse(Mutex<Times>);

#[derive(Debug, Default)]
struct Times {
    longest: Option<Duration>,
    /// Passes that were begun.
    passes: u64,
    /// When the one that is being rendered was.
    begun: Option<Instant>,
}

impl Pulse {
    /// A pass is begun.
    pub fn begin(&self) {
        let mut times = self.times();
        times.passes += 1;
        times.begun = Some(Instant::now());
    }

    /// It is there. The next may be begun at once.
    pub fn end(&self) {
        let mut times = self.times();
        if let Some(begun) = times.begun.take() {
            times.longest = times.longest.max(Some(begun.elapsed()));
        }
    }

    /// Resolves when a pass takes far longer than all before, and says how long.
    pub async fn stops(&self) -> String {
        let mut patience = Patience::default();
        loop {
            sleep(LOOK).await;
            if let Some(words) = patience.look(&self.times()) {
                return words;
            }
        }
    }

    fn times(&self) -> MutexGuard<'_, Times> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// How long one pass has been waited for. Time in which the process was stopped is none.
#[derive(Debug, Default)]
struct Patience {
    pass: u64,
    took: Duration,
}

impl Patience {
    /// To be called every [`LOOK`]. Says what is wrong when it is.
    fn look(&mut self, times: &Times) -> Option<String> {
        if times.begun.is_none() || times.passes != self.pass {
            (self.pass, self.took) = (times.passes, Duration::ZERO);
            return None;
        }
        self.took += LOOK;
        let longest = times.longest?;
        if self.took <= (longest * TOO_LONG).max(AT_LEAST) {
            return None;
        }
        let whole = |time: Duration| humantime::format_duration(Duration::from_millis(time.as_millis() as u64));
        let (took, longest) = (whole(self.took), whole(longest));
        Some(format!(
            "rendering hangs: a pass takes {took}, and none before took more than {longest}"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seconds until something is said of a pass, after one that took so long.
    fn patience(before: Option<f64>) -> Option<(u64, String)> {
        let times = Times {
            longest: before.map(Duration::from_secs_f64),
            passes: 2,
            begun: Some(Instant::now()),
        };
        let mut patience = Patience::default();
        let mut looks = (0..100_000).map(|second| (second, patience.look(&times)));
        looks.find_map(|(second, said)| Some((second, said?)))
    }

    #[test]
    fn one_that_hangs_is_noticed_and_one_that_is_slow_is_not() {
        let (seconds, said) = patience(Some(50.0)).unwrap();
        assert_eq!(seconds, 3201);
        assert!(said.contains("53m 21s") && said.contains("50s"), "{said}");
        // However short passes are.
        assert_eq!(patience(Some(0.005)).map(|(seconds, _)| seconds), Some(61));
        // The first may take a day.
        assert_eq!(patience(None), None);
    }

    #[test]
    fn each_pass_has_its_time_and_nothing_to_do_is_no_fault() {
        let pulse = Pulse::default();
        pulse.begin();
        pulse.end();
        let mut patience = Patience::default();
        for _ in 0..100 {
            assert_eq!(patience.look(&pulse.times()), None);
        }
        for _ in 0..10 {
            pulse.begin();
            for _ in 0..60 {
                assert_eq!(patience.look(&pulse.times()), None);
            }
            pulse.end();
        }
        pulse.begin();
        let mut looks = (0..100).map(|_| patience.look(&pulse.times()));
        assert!(looks.any(|said| said.is_some()));
    }
}
