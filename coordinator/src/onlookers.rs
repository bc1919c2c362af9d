//! Reports of a running job to tev, to OpenJD and to the log, and images written on request.

use crate::failure::Failure;
use beamfarm_coordinator::{Watch, tev};
use beamfarm_proto::VERSION;
use beamfarm_worker::say;
use clap::Args;
use std::convert::Infallible;
use std::fmt::Display;
use std::net::Ipv6Addr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::{MissedTickBehavior, interval, timeout};
use tracing::{Instrument, info, warn};

/// Time between progress reports for OpenJD.
const LOOK: Duration = Duration::from_secs(1);
/// Time for tev to take the last image.
const LAST_IMAGE: Duration = Duration::from_secs(5);

/// Who is told.
#[derive(Args, Clone, Debug)]
pub struct OnlookerArgs {
    /// Show the image in tev while it converges: HOST or HOST:PORT
    ///
    /// Without a port it is tev's own, 14158.
    #[arg(long, value_name = "HOST:PORT", value_parser = tev_address, help_heading = "Output")]
    pub display_server: Option<String>,

    /// Print progress for runners of Open Job Description
    ///
    /// These are lines of openjd_progress, openjd_status and openjd_fail on standard output.
    #[arg(long, help_heading = "Output")]
    pub openjd: bool,
}

/// tev's default port.
const TEV_PORT: u16 = 14158;

fn tev_address(text: &str) -> Result<String, String> {
    const EXPECTED: &str = "expected HOST or HOST:PORT, with brackets around an IPv6 address as in [::1]:14158";
    let with_port = match text.rsplit_once(':') {
        None => format!("{text}:{TEV_PORT}"),
        Some(_) if text.starts_with('[') && text.ends_with(']') => format!("{text}:{TEV_PORT}"),
        Some(_) => text.to_owned(),
    };
    let is_host = |host: &str| match host.strip_prefix('[').and_then(|host| host.strip_suffix(']')) {
        Some(address) => address.parse::<Ipv6Addr>().is_ok(),
        None => !host.is_empty() && !host.contains([':', '[', ']']),
    };
    match with_port.rsplit_once(':') {
        Some((host, port)) if is_host(host) && port.parse::<u16>().is_ok() => Ok(with_port),
        _ => Err(EXPECTED.to_owned()),
    }
}

impl OnlookerArgs {
    /// Report on the job until it ends. Await the result at the end.
    pub fn tell(&self, watch: &Arc<Watch>, share: Share) -> Told {
        let tev = self
            .display_server
            .clone()
            .map(|address| tokio::spawn(tev::show(watch.clone(), address).in_current_span()));
        let openjd = self.openjd.then(|| tokio::spawn(print_progress(watch.clone(), share)));
        Told { tev, openjd }
    }

    /// Report to OpenJD how the job ended.
    pub fn tell_end<T>(&self, end: &Result<T, Failure>) {
        if let (true, Err(failure)) = (self.openjd, end) {
            openjd("fail", &failure.to_string());
        }
    }
}

/// A job's position among all jobs.
#[derive(Clone, Copy, Debug)]
pub struct Share {
    /// Jobs before it.
    pub before: usize,
    /// Total number of jobs.
    pub of: usize,
}

impl Default for Share {
    fn default() -> Self {
        Self { before: 0, of: 1 }
    }
}

impl Share {
    /// `frame 12 (3/48)`.
    pub fn label(self, frame: i64) -> String {
        format!("frame {frame} ({}/{})", self.before + 1, self.of)
    }

    fn of_all(self, fraction: f64) -> f64 {
        (self.before as f64 + fraction) / self.of.max(1) as f64
    }
}

/// The running reports.
pub struct Told {
    tev: Option<tokio::task::JoinHandle<()>>,
    openjd: Option<tokio::task::JoinHandle<()>>,
}

impl Told {
    /// The job is over: finish the reports.
    pub async fn last_words(self) {
        if let Some(openjd) = self.openjd {
            let _ = openjd.await;
        }
        if let Some(tev) = self.tev {
            let _ = timeout(LAST_IMAGE, tev).await;
        }
    }
}

async fn print_progress(watch: Arc<Watch>, share: Share) {
    let mut ticks = interval(LOOK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut printed = None;
    loop {
        let over = tokio::select! {
            _ = ticks.tick() => false,
            _ = watch.farm().ended() => true,
        };
        let progress = watch.farm().progress();
        // Rounded down, so that nothing looks finished before it is.
        let permille = (1000.0 * share.of_all(watch.fraction(&progress))) as u64;
        if printed != Some((permille, progress.prefix)) {
            printed = Some((permille, progress.prefix));
            openjd("progress", &format!("{}.{}", permille / 10, permille % 10));
            let (prefix, limit) = (progress.prefix, progress.limit);
            openjd(
                "status",
                &format!("{prefix} of {limit} passes, {} workers", progress.workers),
            );
        }
        if over {
            return;
        }
    }
}

/// Print an OpenJD line, with line breaks in the text replaced.
fn openjd(what: &str, text: &str) {
    say!("openjd_{what}: {}", text.replace(['\n', '\r'], " "));
}

/// Write the image on every request: by a call, by the page's button, or by SIGHUP. Runs forever.
pub async fn write_on_request<F>(watch: &Watch, signals: &mut mpsc::Receiver<()>, write: impl Fn() -> F) -> Infallible
where
    F: Future<Output = Result<String, Failure>>,
{
    let mut requests = watch.write_requests();
    let mut ticks = interval(LOOK);
    // A signal gets no reply. It is remembered until the image can be written.
    let mut owed = false;
    loop {
        let reply = tokio::select! {
            Some(reply) = requests.recv() => Some(reply),
            Some(()) = signals.recv() => {
                owed = true;
                None
            }
            _ = ticks.tick(), if owed => None,
        };
        if reply.is_none() && watch.farm().progress().prefix == 0 {
            continue;
        }
        owed &= reply.is_some();
        let written = write().await.map_err(|failure| failure.to_string());
        match &written {
            Ok(message) => info!("{message}"),
            Err(message) => warn!("{message}"),
        }
        if let Some(reply) = reply {
            // The requester may be gone.
            let _ = reply.send(written);
        }
    }
}

/// Receives a message for each SIGHUP from now on.
pub fn hang_ups() -> Result<mpsc::Receiver<()>, std::io::Error> {
    let (sender, receiver) = mpsc::channel(1);
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        let mut signals = signal(SignalKind::hangup())?;
        tokio::spawn(async move {
            while signals.recv().await.is_some() {
                if let Err(mpsc::error::TrySendError::Closed(())) = sender.try_send(()) {
                    return;
                }
            }
        });
    }
    #[cfg(not(unix))]
    tokio::spawn(async move {
        std::future::pending::<()>().await;
        drop(sender);
    });
    Ok(receiver)
}

/// Log the settings in force, from all sources.
pub fn log_configuration(watch: &Watch, listen: impl Display, output: &Path, passes: u64) {
    let job = watch.farm().job();
    let timing = watch.farm().timing();
    let settings = job.settings;
    let time = watch.terms().time.map(humantime::format_duration);
    let layers: Vec<String> = job.layers.iter().map(ToString::to_string).collect();
    info!(
        version = VERSION,
        scene = %job.scene,
        width = job.width,
        height = job.height,
        layers = layers.join(","),
        passes,
        time = time.map_or("no limit".into(), |time| time.to_string()),
        seed = settings.seed,
        alpha = settings.alpha,
        schedule = ?settings.schedule,
        paths_per_pass = settings.paths_per_pass,
        engine = settings.engine.identity(),
        heartbeat = ?timing.heartbeat,
        lease = ?timing.lease,
        %listen,
        output = %output.display(),
        "configuration"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tev_has_a_usual_port() {
        assert_eq!(tev_address("host").unwrap(), "host:14158");
        assert_eq!(tev_address("host:1").unwrap(), "host:1");
        assert_eq!(tev_address("[::1]:14158").unwrap(), "[::1]:14158");
        assert_eq!(tev_address("[::1]").unwrap(), "[::1]:14158");
        for wrong in ["host:tev", "::1", "::1:14158", "[::1", "[host]:1", ":1", ""] {
            let said = tev_address(wrong).unwrap_err();
            assert!(said.contains("expected HOST or HOST:PORT"), "{wrong}: {said}");
        }
    }
}
