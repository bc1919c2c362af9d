//! The way into a farm.

use crate::farm::Farm;
use crate::service::Service;
use beamfarm_proto::wire::farm_server::FarmServer;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::time::{MissedTickBehavior, interval, sleep};
use tokio_stream::wrappers::TcpListenerStream;
use tonic::transport::Server;

/// How often an idle connection is probed, and how long the answer may take: machines that lose their network or their
/// power do not close connections.
const PROBE_EVERY: Duration = Duration::from_secs(10);
const PROBE_TIMEOUT: Duration = Duration::from_secs(20);
/// Calls that one connection may have open. A worker needs about four.
const CALLS_PER_CONNECTION: u32 = 64;
/// Bytes that may be on their way to the coordinator, in one delivery and in one connection: at 100 ms of latency these
/// let 40 MB/s and 160 MB/s through.
const DELIVERY_WINDOW: u32 = 4 << 20;
const CONNECTION_WINDOW: u32 = 16 << 20;
/// Time for workers to hear that the job is over.
const FAREWELL: Duration = Duration::from_secs(2);

/// Serve the farm until `shutdown` resolves, then for as long as workers need to hear of it, at most two seconds.
///
/// To end well, end the job first: that is what workers wait to hear.
pub async fn run(
    listener: TcpListener,
    farm: Arc<Farm>,
    shutdown: impl Future<Output = ()>,
) -> Result<(), tonic::transport::Error> {
    let (closing, mut closed) = tokio::sync::watch::channel(false);
    let service = FarmServer::new(Service::new(farm.clone()));
    let server = Server::builder()
        .tcp_nodelay(true)
        .http2_keepalive_interval(Some(PROBE_EVERY))
        .http2_keepalive_timeout(Some(PROBE_TIMEOUT))
        .initial_stream_window_size(DELIVERY_WINDOW)
        .initial_connection_window_size(CONNECTION_WINDOW)
        .max_concurrent_streams(CALLS_PER_CONNECTION)
        .add_service(service)
        .serve_with_incoming_shutdown(TcpListenerStream::new(listener), async move {
            // An error means that the sender is gone, with the same consequence.
            let _ = closed.wait_for(|closing| *closing).await;
        });
    let farewell = async {
        shutdown.await;
        closing.send_replace(true);
        sleep(FAREWELL).await;
    };
    tokio::select! {
        served = server => served,
        () = farewell => Ok(()),
        () = expire(&farm) => Ok(()),
    }
}

async fn expire(farm: &Farm) {
    let mut ticks = interval(farm.timing().heartbeat);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        ticks.tick().await;
        farm.expire();
    }
}
