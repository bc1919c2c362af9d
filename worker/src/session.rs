//! The time between a registration and the end of the job.
//!
//! A restarted coordinator does not know its workers. They register again, claim the blocks that they hold or are
//! rendering, and go on. The session ends only if there is another job, or if the coordinator wants the worker
//! elsewhere, after it has delivered what it has.

use crate::client::{CallError, Client, Delivery, Introduction, Registration};
use crate::config::Config;
use crate::pulse::Pulse;
use crate::render::{Failed, NoBlock, Prepared, Renderer};
use crate::signals::drained;
use beamfarm_image::exr::{BlockMeta, encode_block};
use beamfarm_image::job::{Block, EngineKind, PassStats};
use beamfarm_image::merge::Node;
use beamfarm_image::radius::Schedule;
use beamfarm_proto::{Grant, Job, LeaseId, VERSION, WorkerId, WorkerKey, wire};
use futures_util::future::try_join_all;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::{interval, sleep};
use tracing::{debug, info, warn};

/// The next block is leased after this share of the current block's expected time: early enough that rendering need not
/// wait for it, and late enough that the worker does not hold a block that an idle worker could have begun.
const LEASE_AHEAD: f64 = 0.75;
/// Time between requests for work.
const ASK_AGAIN: Duration = Duration::from_millis(100);
/// Time for giving leases back and signing off.
const FAREWELL: Duration = Duration::from_secs(3);

/// What a worker did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Passes that the coordinator accepted.
    pub passes: u64,
}

/// Why a session ended.
pub(crate) enum SessionEnd {
    /// The job is over, or the worker was asked to finish.
    Over,
    /// The coordinator has another job.
    OtherJob(Box<Registration>),
    /// The coordinator wants the worker at another of its jobs, and knows it by this key.
    Elsewhere(WorkerKey),
    /// Rendering hangs.
    Stuck(String),
}

/// A block that the worker has leased.
#[derive(Clone, Copy)]
struct Held {
    lease: LeaseId,
    begun: bool,
    /// Number of rendered passes.
    rendered: u64,
}

/// What the coordinator knows of the worker.
struct State {
    worker: WorkerId,
    key: WorkerKey,
    /// Number of registrations of the worker.
    generation: u64,
    /// Blocks from lease to delivery, for the heartbeat.
    held: BTreeMap<Block, Held>,
    other_job: Option<Registration>,
    /// The coordinator wants the worker elsewhere.
    is_wanted_elsewhere: bool,
}

/// A block that is rendered and not yet delivered.
struct Finished {
    block: Block,
    result: Result<(Node, PassStats), Failed>,
}

pub(crate) struct Session<'a> {
    client: &'a Client,
    renderer: &'a Renderer,
    introduction: &'a Introduction,
    job: Job,
    heartbeat: Duration,
    prepared: Arc<Prepared>,
    grace: Duration,
    drain: watch::Receiver<bool>,
    state: Mutex<State>,
    /// Whether a delivery is under way.
    delivering: watch::Sender<bool>,
    /// Number of blocks rendered at the same time.
    at_once: usize,
    pulse: Pulse,
    /// Why this machine has stopped rendering.
    broken: watch::Sender<Option<String>>,
    /// Held while registering again.
    renewing: tokio::sync::Mutex<()>,
}

impl<'a> Session<'a> {
    pub fn new(
        client: &'a Client,
        renderer: &'a Renderer,
        introduction: &'a Introduction,
        registration: Registration,
        prepared: Arc<Prepared>,
        config: &Config,
        drain: watch::Receiver<bool>,
    ) -> Self {
        let at_once = config.at_once.unwrap_or(match registration.job.settings.engine {
            EngineKind::Cpu => 1,
            // Keeps a device busy while pictures are read back.
            EngineKind::Gpu => 2,
        });
        let at_once = at_once.max(1);
        Self {
            client,
            renderer,
            introduction,
            job: registration.job,
            heartbeat: registration.heartbeat,
            prepared,
            grace: config.grace,
            drain,
            state: Mutex::new(State {
                worker: registration.worker,
                key: registration.key,
                generation: 0,
                held: BTreeMap::new(),
                other_job: None,
                is_wanted_elsewhere: false,
            }),
            delivering: watch::Sender::new(false),
            at_once,
            pulse: Pulse::new(at_once),
            broken: watch::Sender::new(None),
            renewing: tokio::sync::Mutex::default(),
        }
    }

    pub async fn run(&self, summary: &mut Summary) -> Result<SessionEnd, CallError> {
        // One block per lane waits here, while the one before is uploaded and the one after is rendered.
        let (finished, deliveries) = mpsc::channel(self.at_once);
        let lanes = try_join_all((0..self.at_once).map(|lane| self.render(lane, finished.clone())));
        // Only the lanes hold senders: deliveries end with the last of them.
        drop(finished);
        let work = async { tokio::try_join!(lanes, self.deliver(deliveries, summary)) };
        let end = {
            tokio::pin!(work);
            tokio::select! {
                end = &mut work => end.map(|_| ()),
                end = self.send_heartbeats() => {
                    // The notice of the end may overtake the reply to the last delivery.
                    let mut delivering = self.delivering.subscribe();
                    let rest = async {
                        let _ = delivering.wait_for(|delivering| !delivering).await;
                        // A registration under way would compete with the one that follows.
                        drop(self.renewing.lock().await);
                    };
                    tokio::select! {
                        _ = &mut work => {}
                        () = rest => {}
                        () = sleep(FAREWELL) => {}
                    }
                    end
                }
                () = self.run_out_of_grace() => Ok(()),
                stuck = self.stops() => {
                    self.give_back(|_| true, true).await;
                    return Ok(SessionEnd::Stuck(stuck));
                }
            }
        };
        if let Err(CallError::Untested(_)) = end {
            // Another coordinator is there now, with a job for another engine.
            return Ok(SessionEnd::Elsewhere(self.identity().0));
        }
        let other_job = self.state().other_job.take();
        if let Some(registration) = other_job {
            return Ok(SessionEnd::OtherJob(Box::new(registration)));
        }
        if *self.drain.borrow() && !matches!(end, Err(CallError::Refused(_))) {
            info!(worker = self.number(), "signing off");
            self.give_back(|_| true, true).await;
            return Ok(SessionEnd::Over);
        }
        end.map(|()| {
            let state = self.state();
            match state.is_wanted_elsewhere {
                true => SessionEnd::Elsewhere(state.key),
                false => SessionEnd::Over,
            }
        })
    }

    /// Leases and renders, one block after the other, until there is no more work. `lane`: which of the concurrent
    /// blocks.
    async fn render(&self, lane: usize, finished: mpsc::Sender<Finished>) -> Result<(), CallError> {
        let mut pace: Option<Duration> = None;
        let mut next = self.lease().await?;
        while let Some(block) = next {
            if !self.begin(block) {
                // Given back, or not granted again by a restarted coordinator.
                next = self.lease().await?;
                continue;
            }
            let expected = pace.map(|pace| pace * block.len().try_into().unwrap_or(u32::MAX));
            let (over, rendered) = oneshot::channel::<()>();
            let finished = &finished;
            let render = async move {
                let begun = Instant::now();
                self.pulse.begin(lane);
                let render = self.renderer.block(&self.prepared, block, |rendered| {
                    self.pulse.end(lane);
                    if rendered < block.len() {
                        self.pulse.begin(lane);
                    }
                    if let Some(held) = self.state().held.get_mut(&block) {
                        held.rendered = rendered;
                    }
                });
                let result = tokio::select! {
                    result = render => match result {
                        Ok(done) => Ok(done),
                        Err(NoBlock::Failed(failed)) => Err(failed),
                        Err(NoBlock::Machine(why)) => {
                            // The session gives back what it holds, including this block, and ends.
                            self.broken.send_replace(Some(why));
                            std::future::pending().await
                        }
                    },
                    () = self.become_hopeless(begun, expected) => {
                        self.give_back(|held| *held == block, false).await;
                        return None;
                    }
                };
                // Also if it failed.
                self.pulse.end(lane);
                let took = begun.elapsed();
                let worker = self.number();
                debug!(worker, %block, seconds = took.as_secs_f64(), "rendered");
                drop(over);
                // Fails if delivering has failed, which ends the session.
                let _ = finished.send(Finished { block, result }).await;
                Some(took)
            };
            let lease_ahead = async {
                match expected {
                    Some(expected) => {
                        let _ = tokio::time::timeout(expected.mul_f64(LEASE_AHEAD), rendered).await;
                    }
                    None => {
                        let _ = rendered.await;
                    }
                }
                self.lease().await
            };
            let (took, ahead) = tokio::join!(render, lease_ahead);
            next = ahead?;
            pace = took.map(|took| took.div_f64(block.len() as f64));
        }
        Ok(())
    }

    /// Resolves when rendering hangs, with the reason.
    async fn stops(&self) -> String {
        let mut broken = self.broken.subscribe();
        let breaks = async {
            let why = broken.wait_for(Option::is_some).await.ok().and_then(|why| why.clone());
            match why {
                Some(why) => why,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            stuck = self.pulse.stops() => stuck,
            why = breaks => why,
        }
    }

    /// Resolves when the worker is to finish and the block cannot be done in time.
    async fn become_hopeless(&self, begun: Instant, expected: Option<Duration>) {
        drained(self.drain.clone()).await;
        let rest = expected.map(|expected| expected.saturating_sub(begun.elapsed()));
        if rest.is_none_or(|rest| rest <= self.grace) {
            std::future::pending::<()>().await;
        }
    }

    /// Gives back blocks not yet begun as soon as the worker is to finish; resolves when its time is over.
    async fn run_out_of_grace(&self) {
        drained(self.drain.clone()).await;
        let begun = |block: &Block| self.state().held.get(block).is_some_and(|held| held.begun);
        let waiting: Vec<Block> = {
            let held: Vec<Block> = self.state().held.keys().copied().collect();
            held.into_iter().filter(|block| !begun(block)).collect()
        };
        let give_back = async {
            if !waiting.is_empty() {
                self.give_back(|block| waiting.contains(block), false).await;
            }
            std::future::pending::<()>().await;
        };
        tokio::select! {
            () = give_back => {}
            () = sleep(self.grace) => {
                info!(worker = self.number(), "the time to finish is over");
            }
        }
    }

    /// Gives leases back, if the coordinator is reachable.
    async fn give_back(&self, which: impl Fn(&Block) -> bool, leaving: bool) {
        let (key, leases) = {
            let mut state = self.state();
            let blocks: Vec<Block> = state.held.keys().copied().filter(which).collect();
            let leases: Vec<LeaseId> = blocks
                .iter()
                .filter_map(|block| Some(state.held.remove(block)?.lease))
                .collect();
            (state.key, leases)
        };
        let client = self.client.hasty(FAREWELL);
        let call = client.give_back(key, leases, leaving);
        match tokio::time::timeout(FAREWELL, call).await {
            Ok(Ok(())) => {}
            // It will find out when the connection closes.
            failed => debug!(worker = self.number(), "cannot give leases back: {failed:?}"),
        }
    }

    /// The next block; `None` if there will be none, or if this worker is to finish.
    async fn lease(&self) -> Result<Option<Block>, CallError> {
        loop {
            let (key, generation) = self.identity();
            let asked = Instant::now();
            let grant = tokio::select! {
                biased;
                () = drained(self.drain.clone()) => return Ok(None),
                grant = self.client.lease(key, self.job.scene, self.prepared.together()) => grant,
            };
            match grant {
                Ok(Grant::Lease(lease, block)) => {
                    let held = Held {
                        lease,
                        begun: false,
                        rendered: 0,
                    };
                    let mut state = self.state();
                    if state.generation == generation {
                        state.held.insert(block, held);
                    }
                    return Ok(Some(block));
                }
                // A coordinator takes its time with this answer; one that does not must not be asked all the time.
                Ok(Grant::NotNow) => sleep(ASK_AGAIN.saturating_sub(asked.elapsed())).await,
                Ok(Grant::Done) => return Ok(None),
                Ok(Grant::Elsewhere) => {
                    self.state().is_wanted_elsewhere = true;
                    return Ok(None);
                }
                Err(CallError::Forgotten) => self.renew(generation).await?,
                Err(error) => return Err(error),
            }
        }
    }

    /// Marks the block as being rendered, if it is still held.
    fn begin(&self, block: Block) -> bool {
        let mut state = self.state();
        let held = state.held.get_mut(&block);
        held.map(|held| held.begun = true).is_some()
    }

    /// Encodes and uploads, one block at a time.
    async fn deliver(&self, mut finished: mpsc::Receiver<Finished>, summary: &mut Summary) -> Result<(), CallError> {
        while let Some(Finished { block, result }) = finished.recv().await {
            self.delivering.send_replace(true);
            let encoded = match result {
                Ok((node, stats)) => encode(&self.job, node).await.map(|bytes| (bytes, stats)),
                Err(failed) => Err(failed),
            };
            if let Err(Failed { pass_index, message }) = &encoded {
                let worker = self.number();
                warn!(worker, %block, pass = pass_index, "pass {pass_index}: {message}");
            }
            // Once more for each coordinator that has forgotten the worker, as long as it wants the block.
            while let Some((key, lease, generation)) = self.lease_of(block) {
                let sent = match &encoded {
                    Ok((bytes, stats)) => {
                        let delivery = Delivery {
                            lease,
                            block,
                            bytes: bytes.clone(),
                            stats: *stats,
                        };
                        self.client.submit(key, &delivery).await
                    }
                    Err(failed) => {
                        let (pass_index, message) = (failed.pass_index, &failed.message);
                        self.client.fail(key, lease, pass_index, message).await
                    }
                };
                match sent {
                    Ok(()) => {
                        summary.passes += if encoded.is_ok() { block.len() } else { 0 };
                        break;
                    }
                    Err(CallError::Forgotten) => self.renew(generation).await?,
                    Err(error) => return Err(error),
                }
            }
            self.state().held.remove(&block);
            self.delivering.send_replace(false);
        }
        Ok(())
    }

    fn lease_of(&self, block: Block) -> Option<(WorkerKey, LeaseId, u64)> {
        let state = self.state();
        let lease = state.held.get(&block)?.lease;
        Some((state.key, lease, state.generation))
    }

    fn identity(&self) -> (WorkerKey, u64) {
        let state = self.state();
        (state.key, state.generation)
    }

    /// The worker's number, for logs.
    fn number(&self) -> u64 {
        self.state().worker.0
    }

    /// Registers again, unless someone else has since `generation`. Keeps what is held and still wanted.
    async fn renew(&self, generation: u64) -> Result<(), CallError> {
        let _renewing = self.renewing.lock().await;
        {
            let state = self.state();
            if state.other_job.is_some() {
                // Someone else did, and was sent to another job.
                return Err(CallError::Forgotten);
            }
            if state.generation != generation {
                return Ok(());
            }
        }
        warn!(
            worker = self.number(),
            "the coordinator has forgotten this worker: registering again"
        );
        let held: Vec<Block> = self.state().held.keys().copied().collect();
        let scene = Some(self.job.scene);
        let before = Some(self.identity().0);
        let registration = self.client.register(self.introduction, scene, held, before).await?;
        let mut state = self.state();
        if registration.job != self.job {
            state.other_job = Some(registration);
            return Err(CallError::Forgotten);
        }
        state.worker = registration.worker;
        state.key = registration.key;
        state.generation += 1;
        let leases: BTreeMap<Block, LeaseId> = registration
            .leases
            .iter()
            .map(|(lease, block)| (*block, *lease))
            .collect();
        state.held.retain(|block, held| match leases.get(block) {
            Some(lease) => {
                held.lease = *lease;
                true
            }
            None => false,
        });
        Ok(())
    }

    /// Sends heartbeats until the coordinator says that the job is over.
    async fn send_heartbeats(&self) -> Result<(), CallError> {
        let mut ticks = interval(self.heartbeat);
        loop {
            let (_, generation) = self.identity();
            let (beats, mut notices) = match self.client.attend(self.beat()).await {
                Ok(streams) => streams,
                Err(CallError::Forgotten) => {
                    self.renew(generation).await?;
                    continue;
                }
                Err(error) => return Err(error),
            };
            loop {
                tokio::select! {
                    notice = notices.message() => match notice {
                        Ok(Some(notice)) if notice.done => return Ok(()),
                        Ok(Some(notice)) if notice.elsewhere => {
                            self.state().is_wanted_elsewhere = true;
                            return Ok(());
                        }
                        Ok(Some(_)) => {}
                        Err(status) if status.code() == tonic::Code::PermissionDenied => {
                            return Err(CallError::Refused(status.message().into()));
                        }
                        // Disconnected. The next attempt shows whether the coordinator is still there.
                        Ok(None) | Err(_) => break,
                    },
                    _ = ticks.tick() => {
                        if self.identity().1 != generation {
                            break;
                        }
                        // Room for several: a full channel means that the connection stalls and will break.
                        let _ = beats.try_send(self.beat());
                    }
                }
            }
            debug!(
                worker = self.number(),
                "the stream of heartbeats broke; opening it again"
            );
            sleep(self.heartbeat.min(Duration::from_millis(200))).await;
        }
    }

    fn beat(&self) -> wire::Heartbeat {
        let state = self.state();
        wire::Heartbeat {
            worker: state.key.0,
            leases: state.held.values().map(|held| held.lease.0).collect(),
            rendered: state.held.values().map(|held| held.rendered).collect(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

async fn encode(job: &Job, node: Node) -> Result<beamfarm_proto::bytes::Bytes, Failed> {
    let block = node.block;
    let meta = BlockMeta {
        scene: job.scene,
        block,
        seed: job.settings.seed,
        alpha: job.settings.alpha,
        radius_scale: Schedule::new(&job.settings).scale(block.start()),
        version: VERSION.into(),
        engine: job.settings.engine,
    };
    let layers = job.layers.clone();
    let encode = move || encode_block(&node, &meta, &layers).map_err(|error| error.to_string());
    let encoded = tokio::task::spawn_blocking(encode).await;
    let encoded = encoded.unwrap_or_else(|error| Err(error.to_string()));
    encoded.map(Into::into).map_err(|message| Failed {
        pass_index: block.start(),
        message,
    })
}
