//! What all frames share: the series, its server, and this machine's workers.

use super::Site;
use super::ahead::Order;
use crate::conduct::{broken_crew, broken_server};
use crate::failure::Failure;
use crate::local;
use crate::open_page::{open_page, tell_page};
use beamfarm_coordinator::{Entrance, Series, Watch, server};
use beamfarm_worker::cli::LogFormat;
use std::future::{Future, pending};
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;
use tracing::{Instrument, info, warn};

/// Tells a frame that something it needs has failed.
pub type Breaker = oneshot::Sender<String>;

/// Ends early only to report a failure.
type Crew = Pin<Box<dyn Future<Output = String> + Send>>;

/// What all frames share.
pub struct Stage {
    pub series: Arc<Series>,
    pub address: SocketAddr,
    close: oneshot::Sender<()>,
    server: JoinHandle<()>,
    /// How to start workers on this machine.
    plan: Option<local::Crew>,
    crew: Crew,
    hang_ups: mpsc::Receiver<()>,
    /// Open frames.
    open: Vec<(Arc<Watch>, Breaker)>,
}

impl Stage {
    /// Serve the first of several jobs, and start the workers.
    pub fn open(
        first: Arc<Watch>,
        listener: TcpListener,
        site: Site,
        hang_ups: mpsc::Receiver<()>,
        order: &Order,
    ) -> Result<Self, Failure> {
        let address = listener.local_addr().map_err(Failure::io)?;
        let engine = first.farm().job().settings.engine;
        let plan = site.crew.map(|crew| crew.at(format!("http://{address}"), engine));
        if let Some((plan, token)) = plan.as_ref().and_then(|plan| Some((plan, plan.token.as_ref()?))) {
            if !order.args.quiet && plan.log_format == LogFormat::Text {
                tell_page(&plan.url, token);
            }
            if site.open {
                open_page(&plan.url, token);
            }
        }
        let series = Series::beginning_with(first);
        let entrance = Entrance {
            security: site.security,
            ..Entrance::from(listener)
        };
        let (close, closed) = oneshot::channel::<()>();
        let closed = async {
            // Resolves with an error, as nothing is ever sent.
            let _ = closed.await;
        };
        let serve = server::serve(entrance, series.clone(), closed);
        Ok(Self {
            server: tokio::spawn(serve.in_current_span()),
            crew: crew(plan.as_ref(), &series),
            series,
            address,
            close,
            plan,
            hang_ups,
            open: Vec::new(),
        })
    }

    /// Report failures to this frame.
    pub fn watch_over(&mut self, watch: Arc<Watch>, breaker: Breaker) {
        self.open.push((watch, breaker));
    }

    /// Report no more failures to this frame.
    pub fn forget(&mut self, watch: &Arc<Watch>) {
        self.open.retain(|(open, _)| !Arc::ptr_eq(open, watch));
    }

    /// Keep workers and server running. Resolves when something happened; may be dropped and called again.
    pub async fn keep(&mut self) {
        tokio::select! {
            message = &mut self.crew => {
                // The first frame in line is most likely at fault. The others get new workers.
                let current = self.series.current();
                self.break_off(|watch| Arc::ptr_eq(watch, &current), &message);
                self.crew = crew(self.plan.as_ref(), &self.series);
            }
            served = &mut self.server, if !self.series.is_cancelled() => {
                self.break_off(|_| true, &broken_server(served));
                self.series.cancel();
            }
            Some(()) = self.hang_ups.recv() => {
                let watch = self.series.current();
                tokio::spawn(async move {
                    match watch.write_now().await {
                        Ok(message) => info!("{message}"),
                        Err(message) => warn!("{message}"),
                    }
                }.in_current_span());
            }
        }
    }

    fn break_off(&mut self, which: impl Fn(&Arc<Watch>) -> bool, message: &str) {
        let (broken, open) = self.open.drain(..).partition(|(watch, _)| which(watch));
        self.open = open;
        let broken: Vec<(Arc<Watch>, Breaker)> = broken;
        for (_, breaker) in broken {
            // Fails if the frame has just ended.
            let _ = breaker.send(message.to_owned());
        }
    }

    /// All frames are over: let workers and onlookers hear of it.
    pub async fn close(self) {
        drop(self.close);
        if !self.server.is_finished() {
            let _ = self.server.await;
        }
    }
}

fn crew(plan: Option<&local::Crew>, series: &Arc<Series>) -> Crew {
    let Some(plan) = plan.cloned() else {
        return Box::pin(pending());
    };
    let over = {
        let series = series.clone();
        move || {
            let series = series.clone();
            async move { series.over().await }
        }
    };
    let delivered = {
        let series = series.clone();
        move || series.passes()
    };
    Box::pin(broken_crew(local::run(plan, over, delivered)))
}
