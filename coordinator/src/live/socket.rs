//! A page's WebSocket: receives changes, and sends the scene and its pictures as fast as the page takes them.

use super::launch;
use super::messages::{FrameHeader, FromPage, ToPage};
use super::view::{LiveView, error};
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Query, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use beamfarm_coordinator::revisions::{Content, Picture, Quality};
use beamfarm_image::film::Film;
use beamfarm_image::jpeg::encode_jpeg;
use beamfarm_image::view::View as Look;
use beamfarm_proto::{RevisionNumber, misleads};
use serde::Deserialize;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::broadcast::error::RecvError;
use tokio::time::{MissedTickBehavior, interval};
use tracing::debug;

/// The most pages at a time.
const PAGES: usize = 32;
static OPEN: AtomicUsize = AtomicUsize::new(0);
/// Largest message of a page, in bytes.
const MESSAGE_BYTES: usize = 1 << 20;
/// The most changes of one page that may wait.
const WAITING: usize = 256;
/// Least time between scene messages during continuous changes.
const SCENE_PAUSE: Duration = Duration::from_millis(150);
/// Time between checks of the activity.
const LOOK: Duration = Duration::from_millis(250);
/// After this time without confirmation of a picture, the page is sent the next one anyway.
const PATIENCE: Duration = Duration::from_secs(3);

/// Counts an open page; dropping it makes room for another.
struct OpenPage;

impl OpenPage {
    fn take() -> Option<Self> {
        let taken = OPEN.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |open| {
            (open < PAGES).then_some(open + 1)
        });
        taken.is_ok().then_some(Self)
    }
}

impl Drop for OpenPage {
    fn drop(&mut self) {
        OPEN.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The format of pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pixels {
    /// For display, in the scene's view.
    #[default]
    Jpeg,
    /// As radiance.
    Linear,
}

/// Query parameters.
#[derive(Debug, Deserialize)]
pub struct Asked {
    #[serde(default)]
    pixels: Pixels,
}

pub async fn open(
    State(view): State<Arc<LiveView>>,
    Query(asked): Query<Asked>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let Some(place) = OpenPage::take() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many pages are open\n").into_response();
    };
    let upgrade = upgrade.max_message_size(MESSAGE_BYTES);
    upgrade.on_upgrade(move |socket| async move {
        // Fails if the page is gone.
        let _ = Page::new(view, asked.pixels).attend(socket).await;
        drop(place);
    })
}

/// The page must be disconnected.
struct Gone;

impl From<axum::Error> for Gone {
    fn from(_: axum::Error) -> Self {
        Self
    }
}

/// The state of one page.
struct Page {
    view: Arc<LiveView>,
    pixels: Pixels,
    /// Its latest changes, each with the revision that includes it.
    changes: Vec<(u64, RevisionNumber)>,
    /// Its last change.
    seq: u64,
    frames: u64,
    /// The picture being sent, and since when.
    under_way: Option<(u64, Instant)>,
    /// The last picture sent: revision, quality, view and last change.
    sent: Option<(RevisionNumber, Quality, Look, u64)>,
    told_scene: Option<Instant>,
    last_state: String,
    /// Whether its last change was refused.
    is_wrong: bool,
}

impl Page {
    fn new(view: Arc<LiveView>, pixels: Pixels) -> Self {
        Self {
            view,
            pixels,
            changes: Vec::new(),
            seq: 0,
            frames: 0,
            under_way: None,
            sent: None,
            told_scene: None,
            last_state: String::new(),
            is_wrong: false,
        }
    }

    async fn attend(mut self, mut socket: WebSocket) -> Result<(), Gone> {
        let mut scene = self.view.scene_changes();
        let mut pictures = self.view.revisions.pictures();
        let mut told = self.view.told();
        let mut trouble = self.view.revisions.trouble();
        let mut looks = interval(LOOK);
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut waiting: Vec<FromPage> = Vec::new();
        let mut owes_scene = true;
        loop {
            if owes_scene && self.told_scene.is_none_or(|told| told.elapsed() >= SCENE_PAUSE) {
                owes_scene = false;
                self.told_scene = Some(Instant::now());
                let message = tokio::task::block_in_place(|| self.view.bench().scene(self.seq));
                send(&mut socket, &message).await?;
            }
            let picture = pictures.borrow_and_update().clone();
            self.show(&mut socket, picture).await?;
            let scene_due = async {
                match (owes_scene, self.told_scene) {
                    (true, Some(told)) => tokio::time::sleep(SCENE_PAUSE.saturating_sub(told.elapsed())).await,
                    _ => std::future::pending().await,
                }
            };
            tokio::select! {
                message = socket.recv() => {
                    let Some(message) = message else {
                        return Ok(());
                    };
                    take(&mut waiting, message?);
                    // Messages that arrived meanwhile are merged: only the last position of a drag counts.
                    while let Ok(Some(message)) = tokio::time::timeout(Duration::ZERO, socket.recv()).await {
                        take(&mut waiting, message?);
                    }
                    for message in std::mem::take(&mut waiting) {
                        self.hear(&mut socket, message).await?;
                    }
                }
                _ = scene.changed() => owes_scene = true,
                _ = pictures.changed() => {}
                message = told.recv() => match message {
                    Ok(message) => send(&mut socket, &message).await?,
                    Err(RecvError::Lagged(_)) => {}
                    Err(RecvError::Closed) => return Ok(()),
                },
                _ = trouble.changed() => {
                    let message = trouble.borrow_and_update().clone();
                    if let Some(message) = message {
                        send(&mut socket, &error(0, message.into())).await?;
                    }
                }
                _ = looks.tick() => self.tell_state(&mut socket).await?,
                () = scene_due => {}
            }
        }
    }

    /// Send this picture if it differs from the last and the page has received that one.
    async fn show(&mut self, socket: &mut WebSocket, picture: Option<Arc<Picture>>) -> Result<(), Gone> {
        let Some(picture) = picture else {
            return Ok(());
        };
        if self.under_way.is_some_and(|(_, since)| since.elapsed() < PATIENCE) {
            return Ok(());
        }
        let shown = self.view.bench().view();
        let in_it = self
            .changes
            .iter()
            .filter(|(_, revision)| *revision <= picture.revision);
        let seq = in_it.map(|(seq, _)| *seq).max().unwrap_or(0);
        let shows = (picture.revision, picture.quality, shown, seq);
        if self.sent == Some(shows) {
            return Ok(());
        }
        self.sent = Some(shows);
        self.frames += 1;
        self.under_way = Some((self.frames, Instant::now()));
        let film = picture.content.film();
        let (step, passes) = match picture.quality {
            Quality::Sketch(step) => (step, 0),
            Quality::Passes(passes) => (0, passes),
        };
        let header = FrameHeader {
            frame: self.frames,
            revision: picture.revision.0,
            seq,
            step,
            steps: picture.steps,
            passes,
            of: self.view.revisions.job().map_or(0, |job| job.limit),
            width: film.width,
            height: film.height,
        };
        let asked = self.pixels;
        let encode = move || {
            let film = picture.content.film();
            let pixels = match asked {
                Pixels::Jpeg => encode_jpeg(film, shown).map_err(|error| error.to_string())?,
                Pixels::Linear => linear(film),
            };
            let header = serde_json::to_vec(&header).map_err(|error| error.to_string())?;
            let mut bytes = Vec::with_capacity(4 + header.len() + pixels.len());
            bytes.extend((header.len() as u32).to_le_bytes());
            bytes.extend(header);
            bytes.extend(pixels);
            Ok::<_, String>(bytes)
        };
        match tokio::task::block_in_place(encode) {
            Ok(bytes) => socket.send(Message::Binary(bytes.into())).await?,
            Err(message) => send(socket, &error(0, message.into())).await?,
        }
        Ok(())
    }

    async fn hear(&mut self, socket: &mut WebSocket, message: FromPage) -> Result<(), Gone> {
        if let Some((seq, _)) = message.change() {
            self.seq = self.seq.max(seq);
            match tokio::task::block_in_place(|| self.view.change(&message)) {
                Ok(revision) => {
                    self.changes.push((seq, revision));
                    let surplus = self.changes.len().saturating_sub(WAITING);
                    self.changes.drain(..surplus);
                    if self.is_wrong {
                        self.is_wrong = false;
                        send(socket, &ToPage::Fine).await?;
                    }
                }
                Err(refusal) => {
                    self.is_wrong = true;
                    send(socket, &error(seq, refusal)).await?;
                }
            }
            return Ok(());
        }
        let told = match message {
            FromPage::Rest => {
                self.view.settle_down();
                return Ok(());
            }
            FromPage::Drawn { frame } => {
                self.under_way.take_if(|(under_way, _)| *under_way <= frame);
                return Ok(());
            }
            FromPage::Size { width } => {
                self.view.widen(width);
                return Ok(());
            }
            FromPage::Passes { passes } => {
                self.view.set_passes(passes);
                return Ok(());
            }
            FromPage::Pick { x, y } => {
                let picked = tokio::task::block_in_place(|| self.view.bench().picked(x, y));
                return send(socket, &picked).await;
            }
            FromPage::Nonsense(reason) => {
                debug!("a page says what is no message: {reason}");
                Err(reason)
            }
            FromPage::Save => self.view.save(),
            FromPage::Editor => launch::editor(&self.view),
            FromPage::Render => {
                launch::render(self.view.clone());
                return Ok(());
            }
            _ => return Ok(()),
        };
        match told {
            Ok(text) => send(socket, &ToPage::Told { text }).await,
            Err(message) => send(socket, &error(0, message.into())).await,
        }
    }

    /// Send the current activity if it has changed.
    async fn tell_state(&mut self, socket: &mut WebSocket) -> Result<(), Gone> {
        let rest = self.view.rest().borrow().clone();
        let workers = self.view.revisions.workers();
        let job = self.view.revisions.job();
        let picture = self.view.revisions.pictures().borrow().clone();
        let picture = picture.filter(|picture| picture.revision == rest.revision);
        let (passes, error) = match picture.as_deref() {
            Some(Picture {
                quality: Quality::Passes(passes),
                content: Content::Average(average),
                ..
            }) => (*passes, Some(average.relative_standard_error())),
            _ => (0, None),
        };
        let of = job.as_ref().map_or(0, |job| job.limit);
        let state = ToPage::State {
            workers,
            doing: match (&job, rest.is_trying) {
                _ if workers == 0 => "no workers",
                (_, true) => "pilot",
                (None, _) => "sketch",
                (Some(_), _) if passes < of => "passes",
                _ => "done",
            },
            passes,
            of,
            error: error.filter(|error| error.is_finite() && passes > 1),
            seconds: rest.since.map_or(0.0, |since| since.elapsed().as_secs_f64().round()),
        };
        let text = written(&state).unwrap_or_default();
        if text == self.last_state {
            return Ok(());
        }
        self.last_state = text.clone();
        socket.send(Message::Text(text.into())).await?;
        Ok(())
    }
}

/// Radiance: R, G, B of each pixel, little-endian, rows from the top.
fn linear(film: &Film) -> Vec<u8> {
    let values = film.pixels.as_flattened();
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A message as JSON. Misleading characters in names are spelt out, so that they are visible.
fn written(message: &ToPage) -> Option<String> {
    let text = serde_json::to_string(message).ok()?;
    if !text.contains(misleads) {
        return Some(text);
    }
    // Control characters are escaped already. The remaining ones are in strings, where a backslash is doubled.
    let spelt = text.chars().map(|c| match misleads(c) {
        true => format!("\\{}", c.escape_unicode()),
        false => c.to_string(),
    });
    Some(spelt.collect())
}

async fn send(socket: &mut WebSocket, message: &ToPage) -> Result<(), Gone> {
    let text = written(message).ok_or(Gone)?;
    socket.send(Message::Text(text.into())).await?;
    Ok(())
}

/// Queue a page's message and drop those that it supersedes.
fn take(waiting: &mut Vec<FromPage>, message: Message) {
    let Message::Text(text) = message else {
        return;
    };
    let message = FromPage::read(&text);
    waiting.pop_if(|before| before.is_outdone_by(&message));
    waiting.push(message);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_seen_as_they_are() {
        for (name, seen) in [
            ("a \"b\" \\u{61} µ", "a \"b\" \\u{61} µ"),
            ("gnp\u{202e}exe", "gnp\\u{202e}exe"),
            ("\\\u{2066}\u{feff}", "\\\\u{2066}\\u{feff}"),
        ] {
            let text = written(&ToPage::Told { text: name.into() }).unwrap();
            let read: serde_json::Value = serde_json::from_str(&text).unwrap();
            assert_eq!(read["text"], seen);
        }
    }
}
