//! What a person sees while a job runs: a bar in a terminal, lines elsewhere.

use beamfarm_coordinator::{Farm, Progress};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::collections::VecDeque;
use std::io::{IsTerminal, Write};
use std::sync::{Arc, OnceLock};
use std::time::Duration;
use tokio::time::{Instant, MissedTickBehavior, interval};

/// Time between redraws of the bar, and between lines.
const REDRAW: Duration = Duration::from_millis(200);
pub const LINE: Duration = Duration::from_secs(5);
/// Time between lines as long as no pass is completed.
const WITHOUT_NEWS: Duration = Duration::from_secs(60);
/// Rates are means over this time.
const WINDOW: Duration = Duration::from_secs(20);
/// The error is estimated this often, or less often if that takes more than a twentieth of the time.
pub const ESTIMATE: Duration = Duration::from_secs(2);

/// Position of the bar when all is done.
pub const BAR_LENGTH: u64 = 1000;

static BAR: OnceLock<ProgressBar> = OnceLock::new();

/// Standard error, with the bar out of the way while a line of the log is written.
#[derive(Default)]
pub struct LogWriter;

impl Write for LogWriter {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let write = || std::io::stderr().write_all(bytes).map(|()| bytes.len());
        match BAR.get() {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }
    fn flush(&mut self) -> std::io::Result<()> {
        std::io::stderr().flush()
    }
}

/// Show the farm's progress, forever. `time`: when the job stops, if it does not by itself.
pub async fn show(farm: Arc<Farm>, time: Option<Duration>) {
    let started = Instant::now();
    let bar = bar();
    let mut ticks = interval(if bar.is_some() { REDRAW } else { LINE });
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut meter = Meter::default();
    let mut error = ErrorEstimate::default();
    let mut printed: Option<(Duration, u64)> = None;
    loop {
        ticks.tick().await;
        let progress = farm.progress();
        let elapsed = started.elapsed();
        let rates = meter.rates(elapsed, &progress);
        let fraction = fraction(&progress, elapsed, time);
        let remaining = remaining(&progress, elapsed, time, rates.passes);
        let relative_error = error.update(&farm).await;
        let line = line(&progress, fraction, rates, remaining, relative_error);
        match bar {
            Some(bar) => {
                bar.set_position((fraction * BAR_LENGTH as f64) as u64);
                bar.set_message(line);
            }
            None => {
                // A server may wait for workers for days.
                let news = printed.is_none_or(|(then, prefix)| {
                    prefix != progress.prefix || elapsed - then >= WITHOUT_NEWS
                });
                if elapsed >= LINE && news {
                    println!("{line}");
                    printed = Some((elapsed, progress.prefix));
                }
            }
        }
    }
}

/// The bar, when a person looks at a terminal.
pub fn bar() -> Option<&'static ProgressBar> {
    std::io::stdout().is_terminal().then(|| {
        BAR.get_or_init(|| {
            let bar = ProgressBar::with_draw_target(Some(BAR_LENGTH), ProgressDrawTarget::stdout());
            if let Ok(style) = ProgressStyle::with_template("{bar:24} {msg}") {
                bar.set_style(style);
            }
            bar
        })
    })
}

/// Take the bar away.
pub fn clear() {
    if let Some(bar) = BAR.get() {
        bar.finish_and_clear();
    }
}

/// Passes and beams per second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Rates {
    passes: f64,
    beams: f64,
}

/// Measures rates over the last seconds.
#[derive(Default)]
struct Meter {
    marks: VecDeque<(Duration, u64, u64)>,
}

impl Meter {
    fn rates(&mut self, now: Duration, progress: &Progress) -> Rates {
        let beams = progress.stats.beams;
        self.marks.push_back((now, progress.passes, beams));
        while self.marks.len() > 2 && now - self.marks[1].0 >= WINDOW {
            self.marks.pop_front();
        }
        let (then, passes_then, beams_then) = self.marks[0];
        let seconds = (now - then).as_secs_f64();
        if seconds == 0.0 {
            return Rates::default();
        }
        Rates {
            passes: progress.passes.saturating_sub(passes_then) as f64 / seconds,
            beams: beams.saturating_sub(beams_then) as f64 / seconds,
        }
    }
}

/// Share of the job that is done, by passes or by time, whichever is nearer to its end.
fn fraction(progress: &Progress, elapsed: Duration, time: Option<Duration>) -> f64 {
    let passes = progress.prefix as f64 / progress.limit.max(1) as f64;
    let time = time.map_or(0.0, |time| elapsed.as_secs_f64() / time.as_secs_f64());
    passes.max(time).min(1.0)
}

fn remaining(
    progress: &Progress,
    elapsed: Duration,
    time: Option<Duration>,
    rate: f64,
) -> Option<Duration> {
    let passes = progress.limit.saturating_sub(progress.passes) as f64 / rate;
    // Not a number of seconds as long as nothing is known.
    let by_passes = Duration::try_from_secs_f64(passes).ok();
    let by_time = time.map(|time| time.saturating_sub(elapsed));
    match (by_passes, by_time) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

fn line(
    progress: &Progress,
    fraction: f64,
    rates: Rates,
    remaining: Option<Duration>,
    error: Option<f64>,
) -> String {
    // Rounded down: 100 % is when it is done.
    let percent = (100.0 * fraction) as u32;
    let limit = match progress.limit {
        beamfarm_shared::job::MAX_PASSES => String::new(),
        limit => format!("/{limit}"),
    };
    format!(
        "{percent} %  {}{limit} passes  {:.2} passes/s  {}beams/s  {}",
        progress.prefix,
        rates.passes,
        si(rates.beams),
        expectation(remaining, error),
    )
}

/// The end of the line: what is expected, as far as it is known.
pub fn expectation(remaining: Option<Duration>, error: Option<f64>) -> String {
    let remaining = remaining.map_or_else(
        || "?".into(),
        |time| humantime::format_duration(Duration::from_secs(time.as_secs())).to_string(),
    );
    let error = error
        .filter(|error| error.is_finite())
        .map_or_else(|| "?".into(), |error| format!("{:.2} %", 100.0 * error));
    format!("ETA {remaining}  error {error}")
}

/// A number with three digits and a prefix of the unit that follows.
pub fn si(number: f64) -> String {
    let (number, prefix) = match number {
        n if n >= 1e9 => (n / 1e9, "G"),
        n if n >= 1e6 => (n / 1e6, "M"),
        n if n >= 1e3 => (n / 1e3, "k"),
        n => (n, ""),
    };
    let digits = match number {
        n if n >= 100.0 => 0,
        n if n >= 10.0 => 1,
        _ => 2,
    };
    format!("{number:.digits$} {prefix}")
}

/// The relative standard error, which takes a copy of the image to find.
#[derive(Default)]
struct ErrorEstimate {
    value: Option<f64>,
    next: Option<Instant>,
    passes: u64,
}

impl ErrorEstimate {
    async fn update(&mut self, farm: &Arc<Farm>) -> Option<f64> {
        let now = Instant::now();
        let prefix = farm.progress().prefix;
        // One pass tells nothing about the error.
        let due = self.next.is_none_or(|next| now >= next);
        if !due || prefix < 2 || prefix == self.passes {
            return self.value;
        }
        let farm = farm.clone();
        let estimate = move || farm.average().map(|a| a.relative_standard_error());
        if let Ok(value) = tokio::task::spawn_blocking(estimate).await {
            self.value = value;
        }
        self.passes = prefix;
        self.next = Some(now + ESTIMATE.max(20 * now.elapsed()));
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn progress(prefix: u64, limit: u64) -> Progress {
        Progress {
            prefix,
            passes: prefix,
            limit,
            ..Progress::default()
        }
    }

    #[test]
    fn percentages_are_rounded_down() {
        let progress = progress(999, 1000);
        let fraction = fraction(&progress, Duration::ZERO, None);
        let line = line(&progress, fraction, Rates::default(), None, None);
        assert!(line.starts_with("99 %  999/1000 passes"), "{line}");
    }

    #[test]
    fn the_nearer_end_counts() {
        let (minute, ten) = (Duration::from_secs(60), Duration::from_secs(10));
        let progress = progress(50, 100);
        assert_eq!(fraction(&progress, ten, Some(minute)), 0.5);
        assert_eq!(
            remaining(&progress, ten, Some(minute), 10.0),
            Some(Duration::from_secs(5))
        );
        assert_eq!(
            remaining(&progress, ten, Some(minute), 0.5),
            Some(Duration::from_secs(50))
        );
        assert_eq!(remaining(&progress, ten, None, 0.0), None);
    }

    #[test]
    fn rates_are_of_the_last_seconds() {
        let mut meter = Meter::default();
        for second in 0..100u64 {
            let passes = if second < 50 { 0 } else { 3 * (second - 50) };
            meter.rates(Duration::from_secs(second), &progress(passes, 1000));
        }
        let rates = meter.rates(Duration::from_secs(100), &progress(150, 1000));
        assert_eq!(
            rates,
            Rates {
                passes: 3.0,
                beams: 0.0
            }
        );
    }

    #[test]
    fn numbers_have_three_digits() {
        let cases = [
            (0.0, "0.00 "),
            (12.34, "12.3 "),
            (1234.0, "1.23 k"),
            (5.6e7, "56.0 M"),
        ];
        for (number, text) in cases {
            assert_eq!(si(number), text);
        }
    }
}
