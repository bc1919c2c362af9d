//! Detects stalled rendering: a thread that hangs, or a machine that swaps, would otherwise hold its lease and report
//! that all is well.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::time::{Instant, sleep};

/// A pass may take this many times as long as the longest before it. Before the first, nothing is known.
const TOO_LONG: u32 = 64;
/// A pass may always take this long.
const AT_LEAST: Duration = Duration::from_secs(60);
/// Time between checks.
const LOOK: Duration = Duration::from_secs(1);

/// When each lane's passes were rendered; a lane renders one pass at a time.
#[derive(Debug)]
pub(crate) struct Pulse(Mutex<Vec<Times>>);

#[derive(Clone, Debug, Default)]
struct Times {
    longest: Option<Duration>,
    /// Number of passes begun.
    passes: u64,
    /// Start of the pass that is being rendered.
    begun: Option<Instant>,
}

impl Pulse {
    /// With this many lanes.
    pub fn new(lanes: usize) -> Self {
        Self(Mutex::new(vec![Times::default(); lanes]))
    }

    /// Begins a pass.
    pub fn begin(&self, lane: usize) {
        let times = &mut self.lanes()[lane];
        times.passes += 1;
        times.begun = Some(Instant::now());
    }

    /// Ends a pass. The next may begin at once.
    pub fn end(&self, lane: usize) {
        let times = &mut self.lanes()[lane];
        if let Some(begun) = times.begun.take() {
            times.longest = times.longest.max(Some(begun.elapsed()));
        }
    }

    /// Resolves when a pass takes far longer than all before, with a message.
    pub async fn stops(&self) -> String {
        let mut patience = vec![Patience::default(); self.lanes().len()];
        loop {
            sleep(LOOK).await;
            let lanes = self.lanes();
            let mut looks = patience.iter_mut().zip(lanes.iter());
            if let Some(words) = looks.find_map(|(patience, times)| patience.look(times)) {
                return words;
            }
        }
    }

    fn lanes(&self) -> MutexGuard<'_, Vec<Times>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Time spent waiting for one pass. Time in which the process was stopped does not count.
#[derive(Clone, Debug, Default)]
struct Patience {
    pass: u64,
    took: Duration,
}

impl Patience {
    /// Call this every [`LOOK`]. Returns a message if rendering hangs.
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

    /// Seconds until a pass is reported, after one that took this long.
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
        let pulse = Pulse::new(2);
        pulse.begin(1);
        pulse.end(1);
        let mut patience = Patience::default();
        for _ in 0..100 {
            assert_eq!(patience.look(&pulse.lanes()[1]), None);
        }
        for _ in 0..10 {
            pulse.begin(1);
            for _ in 0..60 {
                assert_eq!(patience.look(&pulse.lanes()[1]), None);
            }
            pulse.end(1);
        }
        pulse.begin(1);
        let mut looks = (0..100).map(|_| patience.look(&pulse.lanes()[1]));
        assert!(looks.any(|said| said.is_some()));
    }
}
