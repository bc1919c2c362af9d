//! Updates for open pages: pieces of the page that have changed. They are made once for all pages, and only while any
//! is open.

use super::{Web, page};
use crate::series::Series;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::{MissedTickBehavior, interval, sleep};
use tokio_stream::wrappers::ReceiverStream;
use tracing::Instrument;

/// Time between checks of the farm.
const LOOK: Duration = Duration::from_secs(1);
/// Time for pages to fetch the last picture when the job is over.
const LAST_LOOK: Duration = Duration::from_secs(1);

/// No more updates will come.
const OVER: &str = "over";
/// A different job is shown from now on.
const NEXT: &str = "next";

/// A piece of the page: the name of its place, and its HTML. `over` or `next` is the last.
type Piece = (&'static str, Arc<str>);
type Pieces = Vec<Piece>;

/// Sends updates to open pages.
pub(super) struct Live {
    series: Arc<Series>,
    pieces: watch::Sender<Pieces>,
    maker: Mutex<Option<JoinHandle<()>>>,
}

impl Live {
    pub fn new(series: Arc<Series>) -> Self {
        Self {
            series,
            pieces: watch::Sender::default(),
            maker: Mutex::default(),
        }
    }

    fn subscribe(&self) -> watch::Receiver<Pieces> {
        let mut maker = self.maker.lock().unwrap_or_else(PoisonError::into_inner);
        let receiver = self.pieces.subscribe();
        if maker.as_ref().is_none_or(JoinHandle::is_finished) {
            self.pieces.send_replace(Pieces::new());
            let make = make(self.series.clone(), self.pieces.clone());
            *maker = Some(tokio::spawn(make.in_current_span()));
        }
        receiver
    }
}

/// Make the pieces while somebody wants them. They show the first job in line; when that changes, pages are told to
/// reload.
async fn make(series: Arc<Series>, pieces: watch::Sender<Pieces>) {
    let mut ticks = interval(LOOK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let watch = series.current();
    loop {
        let over = tokio::select! {
            biased;
            () = series.over() => true,
            _ = ticks.tick() => false,
            () = pieces.closed() => return,
        };
        let made = page::pieces(&series, &watch).await.into_iter();
        let last = match over {
            true => Some(OVER),
            false => (!Arc::ptr_eq(&series.current(), &watch)).then_some(NEXT),
        };
        // Browsers drop events without data.
        let last_piece = last.map(|last| (last, Arc::from(last)));
        let made = made.map(|(name, text)| (name, text.into()));
        pieces.send_replace(made.chain(last_piece).collect());
        if last.is_some() {
            return;
        }
    }
}

pub(super) async fn stream(State(web): State<Arc<Web>>) -> Response {
    let Some(place) = web.watch().sit_down() else {
        let message = "too many pages are open\n";
        return (StatusCode::SERVICE_UNAVAILABLE, message).into_response();
    };
    let mut news = web.live.subscribe();
    let (sender, receiver) = mpsc::channel::<Result<Event, Infallible>>(16);
    tokio::spawn(async move {
        let mut sent = Pieces::new();
        loop {
            let pieces = news.borrow_and_update().clone();
            for piece in &pieces {
                if sent.contains(piece) {
                    continue;
                }
                let event = Event::default().event(piece.0).data(&*piece.1);
                if sender.send(Ok(event)).await.is_err() {
                    return;
                }
            }
            if pieces.last().is_some_and(|(name, _)| [OVER, NEXT].contains(name)) {
                break;
            }
            sent = pieces;
            tokio::select! {
                changed = news.changed() => if changed.is_err() { return },
                () = sender.closed() => return,
            }
        }
        drop(sender);
        sleep(LAST_LOOK).await;
        drop(place);
    });
    let stream = Sse::new(ReceiverStream::new(receiver));
    stream.keep_alive(KeepAlive::default()).into_response()
}
