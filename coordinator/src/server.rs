//! The way into a farm.

use crate::farm::Farm;
use crate::listener::{self, Entrance};
use crate::security::HEALTH;
use crate::service::Service;
use axum::Router;
use axum::routing::get;
use beamfarm_proto::CHUNK_BYTES;
use beamfarm_proto::wire::farm_server::FarmServer;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{MissedTickBehavior, interval, sleep};
use tonic::service::Routes;

/// Bytes of a message: a chunk, with what is around it.
pub const MESSAGE_BYTES: usize = CHUNK_BYTES + (64 << 10);
/// Time for workers to hear that the job is over.
const FAREWELL: Duration = Duration::from_secs(2);

/// Serve the farm until `shutdown` resolves, then for as long as workers need to hear of it, at most two seconds.
///
/// To end well, end the job first: that is what workers wait to hear.
pub async fn run(
    entrance: impl Into<Entrance>,
    farm: Arc<Farm>,
    shutdown: impl Future<Output = ()>,
) {
    let (closing, mut closed) = tokio::sync::watch::channel(false);
    let entrance = entrance.into();
    let router = router(&farm, &entrance);
    let server = listener::serve(entrance, router, async move {
        // An error means that the sender is gone, with the same consequence.
        let _ = closed.wait_for(|closing| *closing).await;
    });
    let farewell = async {
        shutdown.await;
        closing.send_replace(true);
        sleep(FAREWELL).await;
    };
    tokio::select! {
        () = server => {}
        () = farewell => {}
        () = expire(&farm) => {}
    }
}

/// All that the port answers. Who may ask is decided before.
fn router(farm: &Arc<Farm>, entrance: &Entrance) -> Router {
    let service = Service::new(farm.clone(), entrance.limits);
    let calls = FarmServer::new(service).max_decoding_message_size(MESSAGE_BYTES);
    Routes::new(calls)
        .into_axum_router()
        .route(HEALTH, get(async || "ok\n"))
}

async fn expire(farm: &Farm) {
    let mut ticks = interval(farm.timing().heartbeat);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        ticks.tick().await;
        farm.expire();
    }
}
