//! A worker of a live view: receives the revisions of a scene, renders what is requested, and abandons work that nobody
//! wants any more. [`studio`] keeps scenes and renders them.

mod studio;

use crate::cache::Cache;
use crate::client::{CallError, Client, Introduction};
use crate::offer::Offered;
use crate::render::Renderer;
use crate::signals::drained;
use beamfarm_image::film::Film;
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::wire::order::Order as Kind;
use beamfarm_proto::wire::report::Part;
use beamfarm_proto::{
    CHUNK_BYTES, FileEntry, FileHash, PROTOCOL, Revision, RevisionNumber, Task, TaskNumber, VERSION, WireHash, Work,
    wire,
};
use beamfarm_render::world::interrupt::Interrupt;
use beamfarm_scene::{ContentHash, File, Files};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use studio::{NotRendered, Rendered, Studio, Subject};
use tokio::sync::{mpsc, watch};
use tracing::{debug, warn};

/// The tools of a worker.
pub(crate) struct Tools<'a> {
    pub client: &'a Client,
    pub renderer: Arc<Renderer>,
    pub cache: Cache,
    pub introduction: &'a Introduction,
    pub offered: &'a Offered,
}

/// Why attendance at a live view ended.
enum AttendanceEnd {
    /// There is nothing more to do.
    Over,
    /// The connection broke.
    Cut,
}

/// Attends a live view until it ends or the worker is to finish. Returns the number of delivered pictures.
pub(crate) async fn attend(tools: Tools<'_>, drain: watch::Receiver<bool>) -> Result<u64, CallError> {
    let hands = Arc::new(Hands {
        renderer: tools.renderer.clone(),
        studio: Arc::new(Mutex::new(Studio::new(tools.renderer.engines()))),
        client: tools.client.clone(),
        cache: tools.cache.clone(),
        files: tokio::sync::Mutex::default(),
        rendering: tokio::sync::Mutex::default(),
        upload: tokio::sync::Mutex::default(),
        delivered: Mutex::new(0),
    });
    let greeting = wire::Greeting {
        version: VERSION.into(),
        protocol: PROTOCOL,
        identity: tools.introduction.identity.reveal().to_vec().into(),
        name: tools.introduction.name.clone(),
        threads: tools.introduction.threads,
        canary: FileHash(tools.introduction.canary).to_wire(),
    };
    let work = async {
        loop {
            let (reports, orders) = tools.client.attend_revisions(greeting.clone()).await?;
            match hands.clone().follow(tools.offered, reports, orders).await? {
                AttendanceEnd::Over => return Ok(()),
                AttendanceEnd::Cut => debug!("the stream of orders broke; opening it again"),
            }
            tokio::time::sleep(Duration::from_millis(200)).await;
        }
    };
    tokio::select! {
        ended = work => ended?,
        () = drained(drain) => {}
    }
    let delivered = *hands.delivered.lock().unwrap_or_else(PoisonError::into_inner);
    Ok(delivered)
}

type Reports = mpsc::Sender<wire::Report>;

/// Renders and delivers.
struct Hands {
    renderer: Arc<Renderer>,
    studio: Arc<Mutex<Studio>>,
    client: Client,
    cache: Cache,
    /// Files of the latest revision.
    files: tokio::sync::Mutex<Option<(RevisionNumber, Arc<Files>)>>,
    /// Held while the studio renders.
    rendering: tokio::sync::Mutex<()>,
    /// Held during an upload: nothing may come between its parts.
    upload: tokio::sync::Mutex<()>,
    delivered: Mutex<u64>,
}

impl Hands {
    async fn follow(
        self: Arc<Self>,
        offered: &Offered,
        reports: Reports,
        mut orders: tonic::Streaming<wire::Order>,
    ) -> Result<AttendanceEnd, CallError> {
        let refused = |message: String| CallError::Refused(message);
        let mut revision: Option<(Arc<Revision>, Interrupt)> = None;
        let mut current: Option<(TaskNumber, Interrupt)> = None;
        // Work under way when the stream ends is worthless.
        let mut under_way = tokio::task::JoinSet::new();
        let end = loop {
            let order = match orders.message().await {
                Ok(Some(order)) => order,
                Ok(None) => break Ok(AttendanceEnd::Over),
                Err(status) => match status.code() {
                    tonic::Code::Unavailable
                    | tonic::Code::Unknown
                    | tonic::Code::Internal
                    | tonic::Code::Cancelled => {
                        break Ok(AttendanceEnd::Cut);
                    }
                    _ => break Err(refused(status.message().into())),
                },
            };
            while under_way.try_join_next().is_some() {}
            match order.order {
                Some(Kind::Revision(message)) => {
                    let next = Revision::try_from(message).map_err(|error| refused(error.to_string()))?;
                    revision = Some((Arc::new(next), Interrupt::default()));
                }
                Some(Kind::Task(message)) => {
                    let task = Task::try_from(message).map_err(|error| refused(error.to_string()))?;
                    let Some((revision, interrupt)) = revision.clone().filter(|(it, _)| it.number == task.revision)
                    else {
                        break Err(refused("a task of a revision that was not told".into()));
                    };
                    let (Work::Sketch { settings, .. } | Work::Pass { settings, .. }) = task.work;
                    if !offered.has(settings.engine) {
                        let engine = settings.engine;
                        break Err(refused(format!(
                            "the view is rendered by {engine}, which this worker does not offer"
                        )));
                    }
                    current = Some((task.number, interrupt.clone()));
                    let (hands, reports) = (self.clone(), reports.clone());
                    under_way.spawn(async move { hands.do_task(revision, interrupt, task, reports).await });
                }
                Some(Kind::Drop(number)) => {
                    if let Some((_, interrupt)) = current.take_if(|(current, _)| *current == TaskNumber(number)) {
                        interrupt.raise();
                        // Other tasks of the revision may follow.
                        revision = revision.map(|(revision, _)| (revision, Interrupt::default()));
                    }
                }
                None => {}
            }
        };
        if let Some((_, interrupt)) = current {
            interrupt.raise();
        }
        end
    }

    async fn do_task(&self, revision: Arc<Revision>, interrupt: Interrupt, task: Task, reports: Reports) {
        let number = task.number.0;
        let rendered = match self.render(revision, interrupt.clone(), task).await {
            Ok(rendered) => self.deliver(rendered, &interrupt, task, &reports).await,
            Err(nothing) => Err(nothing),
        };
        let part = match rendered {
            Ok(()) => return,
            Err(NotRendered::Dropped) => Part::Dropped(number),
            Err(NotRendered::Failed(message)) => {
                warn!("{message}");
                Part::Misfortune(wire::Misfortune { task: number, message })
            }
        };
        let _uploading = self.upload.lock().await;
        // Fails if the stream is gone; then nobody waits for it.
        let _ = reports.send(wire::Report { part: Some(part) }).await;
    }

    async fn render(&self, revision: Arc<Revision>, interrupt: Interrupt, task: Task) -> Result<Rendered, NotRendered> {
        let subject = Subject {
            number: revision.number,
            files: self.files(&revision).await?,
            interrupt,
        };
        // One at a time: a rendering thread that waits for others may start the next task, and would then wait for
        // itself.
        let _rendering = self.rendering.lock().await;
        if subject.interrupt.is_raised() {
            return Err(NotRendered::Dropped);
        }
        let studio = self.studio.clone();
        let render = move || {
            let mut studio = studio.lock().unwrap_or_else(PoisonError::into_inner);
            studio.render(&subject, &task)
        };
        match self.renderer.run(render).await {
            Ok(rendered) => rendered,
            Err(panic) => {
                let anew = Studio::new(self.renderer.engines());
                *self.studio.lock().unwrap_or_else(PoisonError::into_inner) = anew;
                Err(NotRendered::Failed(panic))
            }
        }
    }

    /// The files of a revision: those that are here, and those that have to be fetched.
    async fn files(&self, revision: &Revision) -> Result<Arc<Files>, NotRendered> {
        let mut known = self.files.lock().await;
        if let Some((_, files)) = known.as_ref().filter(|(number, _)| *number == revision.number) {
            return Ok(files.clone());
        }
        let before: BTreeMap<ContentHash, &File> = known
            .iter()
            .flat_map(|(_, files)| files.files.values().map(|file| (file.hash(), file)))
            .collect();
        let mut files = Files {
            scene: revision.manifest.scene.clone(),
            files: BTreeMap::new(),
        };
        for entry in &revision.manifest.files {
            let file = if entry.path == files.scene {
                File::known(entry.hash.0, revision.text.as_ref().into())
            } else if let Some(file) = before.get(&entry.hash.0) {
                (*file).clone()
            } else {
                let bytes = match self.cache.get(entry.hash) {
                    Some(bytes) => bytes,
                    None => self.fetch(entry).await?,
                };
                File::known(entry.hash.0, bytes.into())
            };
            files.files.insert(entry.path.clone(), file);
        }
        let files = Arc::new(files);
        *known = Some((revision.number, files.clone()));
        Ok(files)
    }

    async fn fetch(&self, entry: &FileEntry) -> Result<Vec<u8>, NotRendered> {
        debug!("fetching {} ({} bytes)", entry.path, entry.size);
        let fetched = self.client.fetch_of_revision(entry).await;
        let bytes = fetched.map_err(|error| {
            // The next revision may name other files; otherwise the stream breaks as well.
            debug!("{} cannot be had: {error:?}", entry.path);
            NotRendered::Dropped
        })?;
        if let Err(error) = self.cache.put(entry.hash, &bytes) {
            warn!("cannot cache {}: {error}", entry.path);
        }
        Ok(bytes)
    }

    async fn deliver(
        &self,
        rendered: Rendered,
        interrupt: &Interrupt,
        task: Task,
        reports: &Reports,
    ) -> Result<(), NotRendered> {
        let milliseconds = |time: Duration| 1000.0 * time.as_secs_f32();
        let outcome = wire::Outcome {
            task: task.number.0,
            preparing_ms: milliseconds(rendered.preparing),
            rendering_ms: milliseconds(rendered.rendering),
            stats: Some(rendered.stats.into()),
        };
        let mut bytes = to_bytes(&rendered.film);
        let _uploading = self.upload.lock().await;
        let send = async |part| {
            let sent = reports.send(wire::Report { part: Some(part) }).await;
            sent.map_err(|_| NotRendered::Dropped)
        };
        send(Part::Outcome(outcome)).await?;
        while !bytes.is_empty() {
            if interrupt.is_raised() {
                return Err(NotRendered::Dropped);
            }
            send(Part::Data(bytes.split_to(bytes.len().min(CHUNK_BYTES)))).await?;
        }
        *self.delivered.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        Ok(())
    }
}

fn to_bytes(film: &Film) -> Bytes {
    let values = film.pixels.as_flattened().iter();
    values.flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>().into()
}
