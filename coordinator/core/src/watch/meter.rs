//! Rates over the last seconds.

use std::collections::VecDeque;
use std::time::Duration;

/// Rates are means over this time.
const WINDOW: Duration = Duration::from_secs(20);

/// Passes and beams per second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rates {
    /// Passes per second.
    pub passes: f64,
    /// Photon beams per second.
    pub beams: f64,
}

/// Measures rates over the last seconds.
#[derive(Clone, Debug, Default)]
pub struct Meter {
    marks: VecDeque<(Duration, u64, u64)>,
}

impl Meter {
    /// Add the current numbers of passes and beams and return the rates. Passes that were taken back count as zero.
    pub fn rates(&mut self, now: Duration, passes: u64, beams: u64) -> Rates {
        // Time stands still while the job is paused.
        if self.marks.back().is_some_and(|last| last.0 == now) {
            self.marks.pop_back();
        }
        self.marks.push_back((now, passes, beams));
        while self.marks.len() > 2 && now.saturating_sub(self.marks[1].0) >= WINDOW {
            self.marks.pop_front();
        }
        let (then, passes_then, beams_then) = self.marks[0];
        let seconds = now.saturating_sub(then).as_secs_f64();
        if seconds == 0.0 {
            return Rates::default();
        }
        Rates {
            passes: passes.saturating_sub(passes_then) as f64 / seconds,
            beams: beams.saturating_sub(beams_then) as f64 / seconds,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_of_the_last_seconds() {
        let mut meter = Meter::default();
        let at = Duration::from_secs;
        assert_eq!(meter.rates(at(0), 0, 0), Rates::default());
        let rates = meter.rates(at(10), 20, 1000);
        assert_eq!((rates.passes, rates.beams), (2.0, 100.0));
        for second in 11..=60 {
            meter.rates(at(second), 20, 1000);
        }
        assert_eq!(meter.rates(at(61), 20, 1000), Rates::default());
        // A pause during which passes under way still arrive.
        for _ in 0..100 {
            meter.rates(at(61), 30, 1000);
        }
        assert_eq!(meter.rates(at(61), 30, 1000).passes, 0.5);
        assert!(meter.marks.len() < 50);
        // Passes of a worker that was shut out were taken back.
        assert_eq!(meter.rates(at(62), 10, 1000), Rates::default());
    }
}
