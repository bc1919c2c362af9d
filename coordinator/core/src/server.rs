//! The network entrance to a farm.

use crate::control;
use crate::limits::Limits;
use crate::listener::{self, Entrance};
use crate::revisions::{self, Revisions};
use crate::series::Series;
use crate::service::Service;
use crate::watch::Watch;
use crate::web;
use axum::Router;
use axum::extract::Request;
use axum::middleware::{Next, from_fn};
use beamfarm_proto::CHUNK_BYTES;
use beamfarm_proto::wire::control_server::ControlServer;
use beamfarm_proto::wire::farm_server::FarmServer;
use beamfarm_proto::wire::revisions_server::RevisionsServer;
use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpSocket};
use tokio::time::{sleep, timeout};
use tonic::service::Routes;
use tracing::{Instrument, Span, error_span};

/// The most bytes in a message: a chunk and its envelope.
pub const MESSAGE_BYTES: usize = CHUNK_BYTES + (64 << 10);
/// The most connections that wait to be accepted; the system may set a lower limit.
const BACKLOG: u32 = 16384;
/// The most time for workers to hear that the job is over.
const FAREWELL: Duration = Duration::from_secs(2);
/// The most time for open pages to fetch the last picture.
const LAST_LOOK: Duration = Duration::from_secs(2);
/// Time for the workers of a live view to hear of its end.
const LAST_BREATH: Duration = Duration::from_millis(200);
/// The most time for replies under way.
const LAST_WORDS: Duration = Duration::from_secs(2);

/// Listen on this address. Connections that arrive faster than they are accepted wait, as many as the system allows:
/// all workers of a large farm may start at the same moment.
///
/// # Errors
/// The address is in use, or does not belong to this machine.
pub fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let socket = match address {
        SocketAddr::V4(_) => TcpSocket::new_v4()?,
        SocketAddr::V6(_) => TcpSocket::new_v6()?,
    };
    // Elsewhere it would let two programs share the port.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

/// Serve the farm and those who watch it until `shutdown` resolves. Then wait, for a few seconds at most, until every
/// worker has heard of the end and hung up, and every open page has the last picture.
///
/// For a clean end, end the job first: that is what workers wait to hear.
pub async fn run(entrance: impl Into<Entrance>, watch: Arc<Watch>, shutdown: impl Future<Output = ()>) {
    serve(entrance, Series::of(watch), shutdown).await;
}

/// Serve several jobs, one after another.
pub async fn serve(entrance: impl Into<Entrance>, series: Arc<Series>, shutdown: impl Future<Output = ()>) {
    let (closing, mut closed) = tokio::sync::watch::channel(false);
    let entrance = entrance.into();
    let router = router(&series, entrance.limits).await;
    let server = listener::serve(entrance, router, async move {
        // An error means that the sender is gone, which has the same effect.
        let _ = closed.wait_for(|closing| *closing).await;
    });
    let farewell = async {
        shutdown.await;
        // Calls are still answered, so that nobody's last request is refused.
        let watch = series.current();
        let _ = tokio::join!(watch.left_alone(LAST_LOOK), timeout(FAREWELL, series.deserted()));
        closing.send_replace(true);
        sleep(LAST_WORDS).await;
    };
    tokio::select! {
        () = server => {}
        () = farewell => {}
        never = series.run() => match never {},
    }
}

/// All routes of the port. Authorisation happens before.
pub async fn router(series: &Arc<Series>, limits: Limits) -> Router {
    let service = Service::new(series.clone(), limits);
    let calls = FarmServer::new(service).max_decoding_message_size(MESSAGE_BYTES);
    let steering = ControlServer::new(control::Service::new(series.clone()));
    let (health, health_service) = tonic_health::server::health_reporter();
    health.set_serving::<FarmServer<Service>>().await;
    health.set_serving::<ControlServer<control::Service>>().await;
    // Every log line names its job. If there are several, each call finds out which.
    let job: Option<Arc<str>> = (!series.is_of_several()).then(|| series.current().id().into());
    let name_job = from_fn(move |request: Request, next: Next| {
        let span = job
            .as_ref()
            .map_or(Span::none(), |job| error_span!("job", job = &**job));
        next.run(request).instrument(span)
    });
    Routes::from(web::routes(series.clone()))
        .add_service(calls)
        .add_service(steering.max_decoding_message_size(MESSAGE_BYTES))
        .add_service(health_service)
        .into_axum_router()
        .layer(name_job)
}

/// Serve a live view to its workers, and `page` to its viewers, until `shutdown` resolves.
pub async fn look(entrance: Entrance, page: Router, revisions: Arc<Revisions>, shutdown: impl Future<Output = ()>) {
    let service = RevisionsServer::new(revisions::Service::new(revisions.clone()));
    let routes = Routes::from(web::around(page)).add_service(service.max_decoding_message_size(MESSAGE_BYTES));
    let server = listener::serve(entrance, routes.into_axum_router(), std::future::pending());
    tokio::select! {
        () = server => {}
        () = shutdown => {
            revisions.finish();
            // Time for workers to hear of it.
            sleep(LAST_BREATH).await;
        }
    }
}
