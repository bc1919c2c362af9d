//! Progress for people: a bar on a terminal, lines elsewhere.

use beamfarm_coordinator::watch::Rates;
use beamfarm_coordinator::{Progress, Watch};
use beamfarm_worker::{complain, say};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, OnceLock};
use std::time::Duration;
use tokio::time::{Instant, MissedTickBehavior, interval};

/// Time between redraws of the bar, and between lines.
const REDRAW: Duration = Duration::from_millis(200);
pub const LINE: Duration = Duration::from_secs(5);
/// Time between lines while no pass is completed.
const WITHOUT_NEWS: Duration = Duration::from_secs(60);
/// Time between error estimates; longer if they would take more than a twentieth of the time.
pub const ESTIMATE: Duration = Duration::from_secs(2);

/// The bar's position at the end.
pub const BAR_LENGTH: u64 = 1000;

static BAR: OnceLock<ProgressBar> = OnceLock::new();

/// Standard error for the log, which hides the bar while a line is written.
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

/// Show the job's progress with the prefix `label`, forever.
pub async fn show(watch: Arc<Watch>, label: &str) {
    let bar = bar();
    let mut ticks = interval(if bar.is_some() { REDRAW } else { LINE });
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut error = ErrorEstimate::default();
    let mut printed: Option<(Duration, u64)> = None;
    loop {
        ticks.tick().await;
        let progress = watch.farm().progress();
        let elapsed = watch.worked();
        let fraction = watch.fraction(&progress);
        let remaining = watch.remaining(&progress);
        let relative_error = error.update(&watch).await;
        let line = line(&progress, fraction, watch.rates(), remaining, relative_error);
        let line = format!("{label}{line}");
        match bar {
            Some(bar) => {
                bar.set_position((fraction * BAR_LENGTH as f64) as u64);
                bar.set_message(line);
            }
            None => {
                // A server may wait days for workers.
                let news = printed.is_none_or(|(then, prefix)| {
                    prefix != progress.prefix || elapsed.saturating_sub(then) >= WITHOUT_NEWS
                });
                if elapsed >= LINE && news {
                    say!("{line}");
                    printed = Some((elapsed, progress.prefix));
                }
            }
        }
    }
}

/// The bar, if the output is a terminal.
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

/// Print a line on stdout without disturbing the bar.
pub fn print(line: &str) {
    match BAR.get() {
        Some(bar) => bar.suspend(|| say!("{line}")),
        None => say!("{line}"),
    }
}

/// The same on stderr.
pub fn complain(line: &str) {
    match BAR.get() {
        Some(bar) => bar.suspend(|| complain!("{line}")),
        None => complain!("{line}"),
    }
}

/// Run `work`, and report every few seconds on stderr what takes the time. Work of less than a second is not reported.
pub fn while_it_lasts<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let (done, waiting) = mpsc::channel::<()>();
    std::thread::scope(move |scope| {
        // Dropped when the work is done, also on panic.
        let _done = done;
        scope.spawn(move || {
            let begun = Instant::now();
            let mut patience = Duration::from_secs(1);
            while waiting.recv_timeout(patience) == Err(RecvTimeoutError::Timeout) {
                complain(&format!("{what}: {} s", begun.elapsed().as_secs()));
                patience = LINE;
            }
        });
        work()
    })
}

/// Remove the bar.
pub fn clear() {
    if let Some(bar) = BAR.get() {
        bar.finish_and_clear();
    }
}

fn line(progress: &Progress, fraction: f64, rates: Rates, remaining: Option<Duration>, error: Option<f64>) -> String {
    // Rounded down: 100 % means done.
    let percent = (100.0 * fraction) as u32;
    let limit = match progress.limit {
        beamfarm_image::job::MAX_PASSES => String::new(),
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

/// Expected time and error, as far as known.
pub fn expectation(remaining: Option<Duration>, error: Option<f64>) -> String {
    let remaining = remaining.map_or_else(
        || "time left unknown".into(),
        |time| {
            format!(
                "{} left",
                humantime::format_duration(Duration::from_secs(time.as_secs()))
            )
        },
    );
    let error = error
        .filter(|error| error.is_finite())
        .map_or_else(String::new, |error| format!("  standard error {:.2} %", 100.0 * error));
    format!("{remaining}{error}")
}

/// A number with three digits and an SI prefix for the unit that follows.
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

/// The relative standard error; estimating it takes a copy of the image.
#[derive(Default)]
pub struct ErrorEstimate {
    value: Option<f64>,
    next: Option<Instant>,
    passes: u64,
}

impl ErrorEstimate {
    pub async fn update(&mut self, watch: &Watch) -> Option<f64> {
        let now = Instant::now();
        let prefix = watch.farm().progress().prefix;
        // One pass gives no error estimate.
        let due = self.next.is_none_or(|next| now >= next);
        if !due || prefix < 2 || prefix == self.passes {
            return self.value;
        }
        let farm = watch.farm().clone();
        let estimate = move || {
            let average = farm.average()?;
            Some((average.passes, average.relative_standard_error()))
        };
        if let Ok(Some((passes, error))) = tokio::task::spawn_blocking(estimate).await {
            watch.note_error(passes, error);
            self.value = Some(error);
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
        let line = line(&progress, 0.999, Rates::default(), None, None);
        assert!(line.starts_with("99 %  999/1000 passes"), "{line}");
    }

    #[test]
    fn numbers_have_three_digits() {
        let cases = [(0.0, "0.00 "), (12.34, "12.3 "), (1234.0, "1.23 k"), (5.6e7, "56.0 M")];
        for (number, text) in cases {
            assert_eq!(si(number), text);
        }
    }
}
