//! The list of frames, and their pictures as they were written.

use super::thumbnail::thumbnail as small;
use super::{Web, curve};
use crate::series::{FrameState, FrameView};
use askama::Template;
use axum::extract::{Query, State};
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use std::sync::Arc;

/// Pixels of the longer side of a small picture, for screens of two pixels a point.
const SIDE: u32 = 192;

#[derive(Template)]
#[template(path = "watch/frames.html")]
struct FramesPiece {
    rows: Vec<Row>,
    done: usize,
    failed: usize,
}

struct Row {
    frame: i64,
    has_picture: bool,
    state: &'static str,
    class: &'static str,
    message: Option<String>,
    passes: u64,
    error: String,
    time: String,
}

/// The list, if there are frames.
pub(super) fn list(frames: &[FrameView]) -> Option<String> {
    if frames.is_empty() {
        return None;
    }
    let count = |states: &[FrameState]| frames.iter().filter(|view| states.contains(&view.state)).count();
    let piece = FramesPiece {
        done: count(&[FrameState::Done, FrameState::Kept]),
        failed: count(&[FrameState::Failed]),
        rows: frames.iter().map(row).collect(),
    };
    Some(piece.render().unwrap_or_else(|error| error.to_string()))
}

fn row(view: &FrameView) -> Row {
    let unknown = || "\u{2013}".to_owned();
    Row {
        frame: view.frame,
        has_picture: view.picture.is_some(),
        state: view.state.as_str(),
        class: match view.state {
            FrameState::Rendering | FrameState::Done | FrameState::Kept => "good",
            FrameState::Waiting => "soft",
            FrameState::Stopped => "still",
            FrameState::Failed => "bad",
        },
        message: view.message.clone(),
        passes: view.passes,
        error: view.error.map_or_else(unknown, curve::percent),
        time: view.seconds.map_or_else(unknown, |seconds| format!("{seconds:.1} s")),
    }
}

/// Which frame.
#[derive(Deserialize)]
pub(super) struct Which {
    frame: i64,
}

/// Its picture, as the job wrote it.
pub(super) async fn png(State(web): State<Arc<Web>>, Query(which): Query<Which>) -> Response {
    answer(written(&web, which).await)
}

/// The same, but small.
pub(super) async fn thumbnail(State(web): State<Arc<Web>>, Query(which): Query<Which>) -> Response {
    let Some(bytes) = written(&web, which).await else {
        return answer(None);
    };
    let made = tokio::task::spawn_blocking(move || small(&bytes, SIDE));
    answer(made.await.ok().flatten())
}

async fn written(web: &Web, Which { frame }: Which) -> Option<Vec<u8>> {
    let mut frames = web.series.frames().into_iter();
    let picture = frames.find(|view| view.frame == frame)?.picture?;
    tokio::fs::read(picture).await.ok()
}

fn answer(png: Option<Vec<u8>>) -> Response {
    match png {
        Some(bytes) => ([(CONTENT_TYPE, "image/png")], bytes).into_response(),
        None => (StatusCode::NOT_FOUND, "there is no picture of this frame\n").into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_frame_says_is_text() {
        assert_eq!(list(&[]), None);
        let failed = FrameView {
            state: FrameState::Failed,
            message: Some("<script>".into()),
            ..FrameView::waiting(7)
        };
        let done = FrameView {
            state: FrameState::Done,
            picture: Some("frame.0008.png".into()),
            error: Some(0.0123),
            seconds: Some(5.04),
            ..FrameView::waiting(8)
        };
        let text = list(&[failed, done]).unwrap_or_default();
        assert!(text.contains("1 of 2 frames are there, 1 failed"), "{text}");
        assert!(text.contains("&#60;script") && !text.contains("<script"), "{text}");
        assert!(
            text.contains("/thumbnail.png?frame=8") && !text.contains("/thumbnail.png?frame=7"),
            "{text}"
        );
        assert!(text.contains("1.2 %") && text.contains("5.0 s"), "{text}");
    }
}
