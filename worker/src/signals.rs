//! SIGINT and SIGTERM: the first asks to finish; another one, a second or more later, kills. Earlier ones count as the
//! same signal, sent to a process and to its group, as `timeout` and shells do.

use std::time::Duration;
use tokio::sync::watch;
use tokio::time::Instant;

/// Signals within this time count as one.
const ONE: Duration = Duration::from_secs(1);

/// A value that becomes true at the first signal. Another signal, a second or more later, ends the process at once with
/// 128 plus its number. Call this once, inside a tokio runtime.
pub fn drain() -> std::io::Result<watch::Receiver<bool>> {
    let (sender, receiver) = watch::channel(false);
    let mut signals = Signals::new()?;
    tokio::spawn(async move {
        let number = signals.next().await;
        let first = Instant::now();
        sender.send_replace(true);
        tracing::info!("signal {number}: finishing; another one after a second kills");
        loop {
            let number = signals.next().await;
            if first.elapsed() >= ONE {
                std::process::exit(128 + number);
            }
        }
    });
    Ok(receiver)
}

/// Resolves when the value of [`drain`] becomes true.
pub(crate) async fn drained(mut drain: watch::Receiver<bool>) {
    if drain.wait_for(|drain| *drain).await.is_err() {
        // Nobody is left to request it.
        std::future::pending::<()>().await;
    }
}

/// Ignores SIGINT: in a terminal Ctrl-C also reaches a process's children, and the parent decides what happens. Call
/// this inside a tokio runtime.
pub fn ignore_interrupt() -> std::io::Result<()> {
    // The handler stays for the life of the process, even without listeners.
    #[cfg(unix)]
    drop(tokio::signal::unix::signal(
        tokio::signal::unix::SignalKind::interrupt(),
    )?);
    // Somebody has to listen.
    #[cfg(not(unix))]
    tokio::spawn(async { while tokio::signal::ctrl_c().await.is_ok() {} });
    Ok(())
}

#[cfg(unix)]
struct Signals {
    interrupt: tokio::signal::unix::Signal,
    terminate: tokio::signal::unix::Signal,
}

#[cfg(unix)]
impl Signals {
    fn new() -> std::io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
        })
    }
    async fn next(&mut self) -> i32 {
        tokio::select! {
            _ = self.interrupt.recv() => 2,
            _ = self.terminate.recv() => 15,
        }
    }
}

#[cfg(not(unix))]
struct Signals;

#[cfg(not(unix))]
impl Signals {
    fn new() -> std::io::Result<Self> {
        Ok(Self)
    }
    async fn next(&mut self) -> i32 {
        let _ = tokio::signal::ctrl_c().await;
        2
    }
}
