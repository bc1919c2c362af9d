//! A live view without a page, and one of its workers under a test's control.

use crate::farm::harness::{Machine, SCENE, canary, free_port, identity_of, settings, within};
use axum::Router;
use beamfarm_coordinator::revisions::{Job, Picture, Revisions, Style};
use beamfarm_coordinator::{Entrance, server};
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::wire::order::Order as Kind;
use beamfarm_proto::wire::report::Part;
use beamfarm_proto::wire::revisions_client::RevisionsClient;
use beamfarm_proto::{FileEntry, FileHash, Manifest, Revision, RevisionNumber, Task, VERSION, Work, wire};
use std::collections::BTreeMap;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio::sync::{mpsc, oneshot};
use tokio_stream::wrappers::ReceiverStream;
use tonic::Status;
use tonic::transport::Channel;

/// A live view without a page.
pub struct View {
    pub revisions: Arc<Revisions>,
    pub url: String,
    pub full: [u32; 2],
    pub number: u64,
    pub machine: Machine,
    _close: oneshot::Sender<()>,
}

fn style() -> Style {
    Style {
        settings: settings(),
        origin: [0.0, 0.0, 0.0],
    }
}

impl View {
    pub async fn start() -> Self {
        let listener = free_port();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let description = description(SCENE);
        let full = [description.camera.width, description.camera.height];
        let canary: [u8; 32] = canary().as_ref().try_into().unwrap();
        let revisions = Revisions::new(full, style(), canary);
        let (close, closed) = oneshot::channel();
        let machine = Machine::new();
        let looked_at = revisions.clone();
        machine.spawn(async move {
            let entrance = Entrance::from(TcpListener::from_std(listener).unwrap());
            let closed = async {
                let _ = closed.await;
            };
            server::look(entrance, Router::new(), looked_at, closed).await;
        });
        Self {
            revisions,
            url,
            full,
            number: 0,
            machine,
            _close: close,
        }
    }

    pub fn revise(&mut self, text: &str) -> RevisionNumber {
        self.number += 1;
        let file = FileEntry {
            path: "scene.toml".into(),
            hash: FileHash::of(text.as_bytes()),
            size: text.len() as u64,
        };
        let number = RevisionNumber(self.number);
        let revision = Revision {
            number,
            manifest: Manifest {
                scene: "scene.toml".into(),
                files: vec![file],
            },
            text: text.as_bytes().to_vec().into(),
        };
        self.revisions.revise(revision, BTreeMap::new(), self.full, style());
        number
    }

    pub fn settle(&self, number: RevisionNumber, limit: u64) {
        let [width, height] = self.full;
        let job = Job {
            settings: settings(),
            width,
            height,
            limit,
        };
        self.revisions.settle(number, job);
    }

    /// The first picture for which this holds.
    pub async fn shows(&self, what: &str, is_it: impl Fn(&Picture) -> bool) -> Arc<Picture> {
        let mut pictures = self.revisions.pictures();
        let seen = pictures.wait_for(|picture| picture.as_deref().is_some_and(&is_it));
        within(what, seen).await.unwrap().clone().unwrap()
    }

    pub async fn worker(&self) -> RawWorker {
        RawWorker::attend(&self.url, VERSION).await.unwrap()
    }
}

pub fn description(text: &str) -> beamfarm_render::world::SceneDescription {
    let bundle = beamfarm_image::bundle::Bundle {
        scene: "scene.toml".into(),
        files: [("scene.toml".into(), text.into())].into(),
    };
    beamfarm_scene::load(&bundle).unwrap()
}

/// The scene with another lamp.
pub fn changed(power: &str) -> String {
    let line = SCENE.lines().find(|line| line.starts_with("power")).unwrap();
    SCENE.replace(line, &format!("power = {power}"))
}

/// A worker that the test controls.
pub struct RawWorker {
    pub reports: mpsc::Sender<wire::Report>,
    pub orders: tonic::Streaming<wire::Order>,
}

impl RawWorker {
    pub async fn attend(url: &str, version: &str) -> Result<Self, Status> {
        Self::greet(url, version, identity_of("raw")).await
    }

    pub async fn greet(url: &str, version: &str, identity: Bytes) -> Result<Self, Status> {
        let channel = Channel::from_shared(url.to_owned()).unwrap().connect().await;
        let channel = channel.map_err(|error| Status::unavailable(error.to_string()))?;
        let (reports, stream) = mpsc::channel(16);
        let greeting = wire::Greeting {
            protocol: beamfarm_proto::PROTOCOL,
            version: version.into(),
            identity,
            name: "raw".into(),
            threads: 1,
            canary: canary(),
        };
        let first = wire::Report {
            part: Some(Part::Greeting(greeting)),
        };
        reports.send(first).await.unwrap();
        let orders = RevisionsClient::new(channel)
            .attend(ReceiverStream::new(stream))
            .await?;
        Ok(Self {
            reports,
            orders: orders.into_inner(),
        })
    }

    pub async fn order(&mut self) -> Kind {
        let order = within("an order", self.orders.message()).await;
        order.unwrap().expect("the stream goes on").order.unwrap()
    }

    /// The next task, skipping everything before it.
    pub async fn task(&mut self) -> Task {
        loop {
            if let Kind::Task(task) = self.order().await {
                return Task::try_from(task).unwrap();
            }
        }
    }

    pub async fn say(&self, part: Part) {
        self.reports.send(wire::Report { part: Some(part) }).await.unwrap();
    }

    pub async fn begin(&self, task: &Task) {
        let outcome = wire::Outcome {
            task: task.number.0,
            ..wire::Outcome::default()
        };
        self.say(Part::Outcome(outcome)).await;
    }

    /// Delivers a picture with this value everywhere.
    pub async fn deliver(&self, task: &Task, value: f32) {
        self.begin(task).await;
        self.say(Part::Data(pixels(task, value, 1.0).into())).await;
    }

    /// Delivers sketches until there is a pass to render.
    pub async fn pass(&mut self) -> Task {
        loop {
            let task = self.task().await;
            if matches!(task.work, Work::Pass { .. }) {
                return task;
            }
            self.deliver(&task, 0.5).await;
        }
    }
}

/// The bytes of this many pixels.
pub fn pixels(task: &Task, value: f32, share: f64) -> Vec<u8> {
    let values = 3 * task.width as usize * task.height as usize;
    value.to_le_bytes().repeat((share * values as f64) as usize)
}
