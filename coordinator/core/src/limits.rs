//! How much of the coordinator's time and memory one peer may use.

use axum::body::Body;
use http_body::{Body as HttpBody, Frame, SizeHint};
use std::pin::Pin;
use std::sync::{Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::time::{Instant, Sleep, sleep_until};

/// Limits of a listener.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// The most connections, or fewer if the process may not open so many files. Further ones are closed at once.
    pub connections: usize,
    /// The most connections that are not authorised yet. Beyond it the oldest are closed.
    pub strangers: usize,
    /// Time for TLS and the first authorised request.
    pub greeting: Duration,
    /// Delay of the answer to a wrong token.
    pub wrong_token: Duration,
    /// The most open calls on a connection. A worker needs about four.
    pub calls: u32,
    /// Requests per second on one connection, averaged; further ones wait.
    pub requests_per_second: f64,
    /// Bytes of all headers of a request.
    pub header_bytes: u32,
    /// Largest body of a request that is not a gRPC call, in bytes; calls are limited to
    /// [`crate::server::MESSAGE_BYTES`] per message.
    pub form_bytes: usize,
    /// How long a request's body may pause, also before its first byte, and how long a peer may take to read.
    pub stall: Duration,
    /// Least bytes per second of a body, averaged.
    pub slowest: f64,
    /// Heartbeat messages per second of one worker; further ones wait.
    pub beats_per_second: f64,
    /// How often an idle connection is probed. Machines that lose network or power do not close connections.
    pub probe_every: Duration,
    /// How long the answer to a probe may take.
    pub probe_timeout: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections: 16384,
            strangers: 2048,
            greeting: Duration::from_secs(10),
            wrong_token: Duration::from_millis(300),
            calls: 64,
            requests_per_second: 1000.0,
            header_bytes: 16 << 10,
            form_bytes: 64 << 10,
            stall: Duration::from_secs(20),
            slowest: 16384.0,
            beats_per_second: 100.0,
            probe_every: Duration::from_secs(10),
            probe_timeout: Duration::from_secs(20),
        }
    }
}

/// Open files besides connections: checkpoints, logs, pipes of workers, and some spare.
#[cfg(unix)]
const FILES: u64 = 96;

impl Limits {
    /// Limit the connections to the files that this process may open.
    pub(crate) fn within_files(self) -> Self {
        #[cfg(unix)]
        if let Some(files) = rustix::process::getrlimit(rustix::process::Resource::Nofile).current {
            let rest = usize::try_from(files.saturating_sub(FILES)).unwrap_or(usize::MAX);
            let connections = self.connections.min(rest.max(8));
            return Self {
                connections,
                strangers: self.strangers.min(connections.div_ceil(2)),
                ..self
            };
        }
        self
    }
}

/// A token bucket that holds one second's worth; excess has to wait.
#[derive(Debug)]
pub(crate) struct Pace {
    rate: f64,
    /// Tokens at the given time; negative if owed.
    state: Mutex<(f64, Instant)>,
}

impl Pace {
    pub fn new(rate: f64) -> Self {
        Self {
            rate,
            state: Mutex::new((rate.max(1.0), Instant::now())),
        }
    }

    /// Returns when the next one may happen.
    pub async fn next(&self) {
        let wait = {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            let now = Instant::now();
            let earned = now.duration_since(state.1).as_secs_f64() * self.rate;
            *state = ((state.0 + earned).min(self.rate.max(1.0)) - 1.0, now);
            -state.0 / self.rate
        };
        if wait > 0.0 {
            tokio::time::sleep(Duration::from_secs_f64(wait)).await;
        }
    }
}

/// A request's body that must keep coming: it may pause for a while, and its mean rate must reach `slowest`.
pub(crate) struct Steady {
    body: Body,
    limits: Limits,
    begun: Instant,
    bytes: f64,
    /// Bytes that may still come, if limited.
    room: Option<usize>,
    deadline: Pin<Box<Sleep>>,
}

impl Steady {
    pub fn new(body: Body, limits: Limits, room: Option<usize>) -> Self {
        let begun = Instant::now();
        Self {
            body,
            limits,
            begun,
            bytes: 0.0,
            room,
            deadline: Box::pin(sleep_until(begun + limits.stall)),
        }
    }
}

impl HttpBody for Steady {
    type Data = axum::body::Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Self::Data>, Self::Error>>> {
        let late = |what: String| Poll::Ready(Some(Err(axum::Error::new(Late(what)))));
        match Pin::new(&mut self.body).poll_frame(context) {
            Poll::Pending => {}
            Poll::Ready(Some(Ok(frame))) => {
                let length = frame.data_ref().map_or(0, |data| data.len());
                if let Some(room) = &mut self.room {
                    match room.checked_sub(length) {
                        Some(rest) => *room = rest,
                        None => return late("the body is too long".into()),
                    }
                }
                self.bytes += length as f64;
                let stall = self.limits.stall;
                let earned = Duration::from_secs_f64(self.bytes / self.limits.slowest);
                let deadline = (Instant::now() + stall).min(self.begun + stall + earned);
                self.deadline.as_mut().reset(deadline);
                return Poll::Ready(Some(Ok(frame)));
            }
            other => return other,
        }
        match self.deadline.as_mut().poll(context) {
            Poll::Pending => Poll::Pending,
            Poll::Ready(()) => late("the body comes too slowly".into()),
        }
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// Why a body was cut off.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Late(String);

#[cfg(test)]
mod tests {
    use super::*;
    use http_body_util::BodyExt;
    use tokio_stream::StreamExt;

    #[tokio::test]
    async fn what_is_too_frequent_waits() {
        let pace = Pace::new(50.0);
        let begun = Instant::now();
        for _ in 0..75 {
            pace.next().await;
        }
        // The first second's worth comes at once. No upper bound, as the machine may be busy.
        let taken = begun.elapsed().as_secs_f64();
        assert!(taken >= 0.45, "{taken}");
    }

    const STALL: f64 = 0.4;

    /// Receive `chunks` pieces of `size` bytes, `pause` seconds apart. Returns the seconds until the end, and whether
    /// all arrived.
    async fn receive(chunks: usize, size: usize, pause: f64, room: Option<usize>) -> (f64, bool) {
        let pieces = tokio_stream::iter(0..chunks).then(move |_| async move {
            tokio::time::sleep(Duration::from_secs_f64(pause)).await;
            Ok::<_, std::convert::Infallible>(vec![0u8; size])
        });
        let limits = Limits {
            stall: Duration::from_secs_f64(STALL),
            ..Limits::default()
        };
        let body = Body::from_stream(pieces);
        let begun = Instant::now();
        let whole = Steady::new(body, limits, room).collect();
        let whole = tokio::time::timeout(Duration::from_secs(60), whole).await;
        let whole = whole.expect("a body that stands still is dropped");
        (begun.elapsed().as_secs_f64(), whole.is_ok())
    }

    #[tokio::test]
    async fn bodies_have_to_keep_coming() {
        // Longer than a body may pause, at ten times the slowest rate.
        assert!(receive(80, 1638, 0.01, None).await.1);
        // Drops: each in time, but too slow in all.
        let (seconds, whole) = receive(1000, 1, 0.01, None).await;
        assert!(!whole && seconds >= STALL, "{seconds}");
        // A large piece earns time, but not to pause.
        let (seconds, whole) = receive(2, 10 << 20, 3600.0, None).await;
        assert!(!whole && seconds >= STALL, "{seconds}");
        assert!(receive(2, 10, 0.0, Some(20)).await.1);
        assert!(!receive(2, 10, 0.0, Some(19)).await.1);
    }
}
