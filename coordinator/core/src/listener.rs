//! Connections from acceptance to end: who is admitted, and what each may use.

use crate::limits::{Limits, Pace, Steady};
use crate::rarely::Rarely;
use crate::security::{Security, is_for_all, is_grpc};
use axum::Router;
use axum::body::Body;
use http::{Request, Response};
use hyper::body::Incoming;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto;
use hyper_util::server::graceful::{GracefulShutdown, Watcher};
use std::collections::{BTreeMap, VecDeque};
use std::convert::Infallible;
use std::future::Future;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Notify, Semaphore, watch};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};
use tokio_io_timeout::TimeoutStream;
use tower::ServiceExt;
use tracing::{debug, warn};

/// The most calls that a peer may open and cancel before they are handled (HTTP/2 rapid reset).
const BROKEN_OFF: usize = 32;
/// Time for a connection to close that has to make room.
const FAREWELL: Duration = Duration::from_millis(50);
/// Pause after the system refused a connection, for example because file descriptors ran out.
const REFUSED_PAUSE: Duration = Duration::from_millis(100);
/// Calls whose bodies pause by design.
const ATTEND: [&str; 2] = ["/beamfarm.v1.Farm/Attend", "/beamfarm.v1.Revisions/Attend"];

/// A socket with its requirements and limits.
pub struct Entrance {
    /// The listening socket.
    pub listener: TcpListener,
    /// Who is admitted.
    pub security: Security,
    /// What each peer may use.
    pub limits: Limits,
}

impl From<TcpListener> for Entrance {
    /// An entrance for trusted peers, without requirements.
    fn from(listener: TcpListener) -> Self {
        Self {
            listener,
            security: Security::default(),
            limits: Limits::default(),
        }
    }
}

/// Shared by all connections of a listener.
struct Shared {
    router: Router,
    security: Security,
    limits: Limits,
    /// Whether the listener serves this machine only.
    local: bool,
    /// Limits log lines about wrong tokens.
    wrong_tokens: Rarely,
}

/// Serve `router` until `shutdown` resolves, then let open requests finish.
pub(crate) async fn serve(entrance: Entrance, router: Router, shutdown: impl Future<Output = ()>) {
    let Entrance {
        listener,
        security,
        limits,
    } = entrance;
    let limits = limits.within_files();
    let address = listener.local_addr();
    let shared = Arc::new(Shared {
        router,
        security,
        limits,
        local: address.is_ok_and(|address| address.ip().is_loopback()),
        wrong_tokens: Rarely::default(),
    });
    let places = Arc::new(Semaphore::new(limits.connections));
    let mut strangers = Strangers::default();
    let graceful = GracefulShutdown::new();
    // Dropping it closes what is still open.
    let mut connections = JoinSet::new();
    tokio::pin!(shutdown);
    let mut full = false;
    loop {
        let (stream, peer) = tokio::select! {
            accepted = listener.accept() => match accepted {
                Ok(accepted) => accepted,
                Err(error) => {
                    warn!("cannot accept a connection: {error}");
                    sleep(REFUSED_PAUSE).await;
                    continue;
                }
            },
            Some(_) = connections.join_next() => continue,
            () = &mut shutdown => break,
        };
        // Connections that were told to leave do so at once.
        let Ok(Ok(place)) = timeout(FAREWELL, places.clone().acquire_owned()).await else {
            if !std::mem::replace(&mut full, true) {
                warn!("{} connections: {peer} and more are turned away", limits.connections);
            }
            continue;
        };
        full = false;
        let (shared, watcher) = (shared.clone(), graceful.watcher());
        let newcomer = strangers.let_in(peer, limits.strangers);
        connections.spawn(async move {
            let _place = place;
            match connection(stream, shared, watcher, newcomer).await {
                Ok(()) => debug!("{peer}: the connection is over"),
                Err(error) => debug!("{peer}: {error}"),
            }
        });
    }
    drop(listener);
    graceful.shutdown().await;
}

type ConnectionError = Box<dyn std::error::Error + Send + Sync>;

/// Tells when a request's connection closes. An extension of every request.
#[derive(Clone)]
pub(crate) struct HangUp(watch::Receiver<()>);

impl HangUp {
    /// Resolves when the connection is closed.
    pub async fn happens(mut self) {
        // Nothing is ever sent: the sender is dropped with the connection.
        while self.0.changed().await.is_ok() {}
    }
}

/// A connection that is not authorised yet.
struct Newcomer {
    peer: SocketAddr,
    /// Whether it has been authorised.
    greeted: AtomicBool,
    /// Notified when it has to make room for others.
    leave: Notify,
}

/// Unauthorised connections by origin, oldest first. If there are too many, the origin with the most makes room. A
/// flood from one origin leaves the others the time that they need.
#[derive(Default)]
struct Strangers {
    by_origin: BTreeMap<Origin, VecDeque<Weak<Newcomer>>>,
    count: usize,
}

/// The origin of connections: an IPv4 address, or the part of an IPv6 address that one customer owns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Origin {
    V4(Ipv4Addr),
    /// The first 64 bits.
    V6(u64),
}

impl Origin {
    fn of(address: IpAddr) -> Self {
        match address.to_canonical() {
            IpAddr::V4(address) => Self::V4(address),
            IpAddr::V6(address) => Self::V6((address.to_bits() >> 64) as u64),
        }
    }
}

/// When there are too many strangers, a part of them makes room at once, so that they are not searched for each
/// connection.
const PART: usize = 16;

impl Strangers {
    fn let_in(&mut self, peer: SocketAddr, limit: usize) -> Arc<Newcomer> {
        let newcomer = Arc::new(Newcomer {
            peer,
            greeted: AtomicBool::new(false),
            leave: Notify::new(),
        });
        let those = self.by_origin.entry(Origin::of(peer.ip())).or_default();
        those.push_back(Arc::downgrade(&newcomer));
        self.count += 1;
        if self.count > limit {
            self.forget_others();
            if self.count > limit {
                self.make_room(limit - limit / PART);
            }
        }
        newcomer
    }

    /// Forget those that are authorised or gone.
    fn forget_others(&mut self) {
        let is_stranger = |newcomer: Arc<Newcomer>| !newcomer.greeted.load(Ordering::Relaxed);
        for those in self.by_origin.values_mut() {
            those.retain(|newcomer| newcomer.upgrade().is_some_and(is_stranger));
        }
        self.by_origin.retain(|_, those| !those.is_empty());
        self.count = self.by_origin.values().map(VecDeque::len).sum();
    }

    fn make_room(&mut self, most: usize) {
        while self.count > most.max(1)
            && let Some(those) = self.by_origin.values_mut().max_by_key(|those| those.len())
        {
            if let Some(oldest) = those.pop_front().and_then(|oldest| oldest.upgrade()) {
                oldest.leave.notify_one();
            }
            self.count -= 1;
        }
    }
}

async fn connection(
    stream: TcpStream,
    shared: Arc<Shared>,
    watcher: Watcher,
    newcomer: Arc<Newcomer>,
) -> Result<(), ConnectionError> {
    stream.set_nodelay(true)?;
    let mut stream = TimeoutStream::new(stream);
    // For peers that do not read what they requested.
    stream.set_write_timeout(Some(shared.limits.stall));
    let stream = Box::pin(stream);
    let Some(tls) = &shared.security.tls else {
        return requests(stream, shared, watcher, newcomer).await;
    };
    let acceptor = tokio_rustls::TlsAcceptor::from(tls.config.clone());
    let stream = tokio::select! {
        stream = timeout(shared.limits.greeting, acceptor.accept(stream)) => stream??,
        () = newcomer.leave.notified() => return Err("too many that have not greeted".into()),
    };
    requests(stream, shared, watcher, newcomer).await
}

async fn requests(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    shared: Arc<Shared>,
    watcher: Watcher,
    newcomer: Arc<Newcomer>,
) -> Result<(), ConnectionError> {
    let limits = shared.limits;
    let pace = Arc::new(Pace::new(limits.requests_per_second));
    let (_line, hang_up) = watch::channel(());
    let service = {
        let (shared, newcomer) = (shared.clone(), newcomer.clone());
        hyper::service::service_fn(move |mut request: Request<Incoming>| {
            let (shared, newcomer, pace) = (shared.clone(), newcomer.clone(), pace.clone());
            request.extensions_mut().insert(HangUp(hang_up.clone()));
            async move {
                pace.next().await;
                Ok::<_, Infallible>(shared.respond(request, &newcomer).await)
            }
        })
    };
    let mut builder = auto::Builder::new(TokioExecutor::new());
    builder
        .http1()
        .timer(TokioTimer::new())
        .header_read_timeout(limits.greeting)
        .max_buf_size((limits.header_bytes as usize).max(8192));
    builder
        .http2()
        .timer(TokioTimer::new())
        .keep_alive_interval(limits.probe_every)
        .keep_alive_timeout(limits.probe_timeout)
        // Buffer no more than is in flight on the network: across a thousand connections buffers add up.
        .adaptive_window(true)
        .max_concurrent_streams(limits.calls)
        .max_header_list_size(limits.header_bytes)
        .max_pending_accept_reset_streams(BROKEN_OFF);
    let connection = builder.serve_connection_with_upgrades(TokioIo::new(stream), service);
    let connection = watcher.watch(connection.into_owned());
    let stranger = async {
        loop {
            sleep(limits.greeting).await;
            if !newcomer.greeted.load(Ordering::Relaxed) {
                break;
            }
        }
    };
    let has_to_leave = async {
        newcomer.leave.notified().await;
        // It may have been authorised just now.
        if newcomer.greeted.load(Ordering::Relaxed) {
            std::future::pending::<()>().await;
        }
    };
    tokio::select! {
        served = connection => served,
        () = stranger => Err("nothing that may come in".into()),
        () = has_to_leave => Err("too many that have not greeted".into()),
    }
}

impl Shared {
    async fn respond(&self, request: Request<Incoming>, newcomer: &Newcomer) -> Response<Body> {
        if let Some(refusal) = self.security.refuse(&request, self.local) {
            if self.security.is_wrong(&request) {
                if let Some(count) = self.wrong_tokens.tell() {
                    warn!(
                        "{count} requests with a wrong token, the last from {}",
                        newcomer.peer.ip()
                    );
                }
                sleep(self.limits.wrong_token).await;
            }
            return refusal;
        }
        // Public requests do not authorise.
        if !is_for_all(&request) {
            newcomer.greeted.store(true, Ordering::Relaxed);
        }
        let room = (!is_grpc(request.headers())).then_some(self.limits.form_bytes);
        let attends = ATTEND.contains(&request.uri().path()) && room.is_none();
        let request = request.map(|body| {
            let body = Body::new(body);
            match attends {
                true => body,
                false => Body::new(Steady::new(body, self.limits, room)),
            }
        });
        match self.router.clone().oneshot(request).await {
            Ok(response) => response,
            Err(never) => match never {},
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peer(address: &str) -> SocketAddr {
        SocketAddr::new(address.parse().unwrap(), 7)
    }

    /// Whether it was told to make room.
    fn is_told(newcomer: &Newcomer) -> bool {
        let told = newcomer.leave.notified();
        tokio::pin!(told);
        told.enable()
    }

    #[test]
    fn who_comes_from_where_most_do_makes_room() {
        for flood in ["192.0.2.1", "2001:db8::1"] {
            let mut strangers = Strangers::default();
            let far: Vec<_> = (0..20)
                .map(|i| strangers.let_in(peer(&format!("198.51.100.{i}")), 100))
                .collect();
            let mut knocking = VecDeque::new();
            for i in 0..5000_u32 {
                let from = match flood.contains(':') {
                    // All owned by one customer.
                    true => format!("2001:db8::{i:x}"),
                    false => flood.into(),
                };
                knocking.push_back(strangers.let_in(peer(&from), 100));
                assert!(strangers.count <= 100);
            }
            assert!(far.iter().all(|newcomer| !is_told(newcomer)));
            let told = knocking.iter().filter(|newcomer| is_told(newcomer)).count();
            assert!((4900..=4930).contains(&told), "{told}");
            // The oldest of them.
            assert!(!is_told(knocking.back().unwrap()));
        }
    }

    #[test]
    fn who_has_greeted_or_is_gone_takes_no_room() {
        let mut strangers = Strangers::default();
        let greeted: Vec<_> = (0..100)
            .map(|_| strangers.let_in(peer("::ffff:192.0.2.1"), 100))
            .collect();
        for newcomer in &greeted {
            newcomer.greeted.store(true, Ordering::Relaxed);
        }
        drop(
            (0..100)
                .map(|_| strangers.let_in(peer("192.0.2.1"), 100))
                .collect::<Vec<_>>(),
        );
        let next = strangers.let_in(peer("192.0.2.1"), 100);
        assert_eq!((strangers.count, strangers.by_origin.len()), (1, 1));
        assert!(!is_told(&next) && greeted.iter().all(|newcomer| !is_told(newcomer)));
    }
}
