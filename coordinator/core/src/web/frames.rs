//! The list of frames and their pictures.

use super::thumbnail::thumbnail as small;
use super::{Web, curve};
use crate::html;
use crate::html::Html;
use crate::series::{FrameState, FrameView};
use axum::extract::{Query, State};
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use beamfarm_image::input;
use serde::Deserialize;
use std::sync::Arc;

/// Longer side of a thumbnail in pixels, for screens with two pixels per point.
const SIDE: u32 = 192;

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
pub(super) fn list(frames: &[FrameView]) -> Option<Html> {
    if frames.is_empty() {
        return None;
    }
    let count = |states: &[FrameState]| frames.iter().filter(|view| states.contains(&view.state)).count();
    let failed = count(&[FrameState::Failed]);
    Some(html!(
        r#"<p>{done} of {all} frames are there{failed}.</p>
<table>
<thead><tr><th scope="col">Frame</th><th scope="col">Picture</th><th scope="col">State</th><th scope="col">Passes</th><th scope="col">Error</th><th scope="col">Time</th></tr></thead>
<tbody>{rows}
</tbody>
</table>"#,
        done = count(&[FrameState::Done, FrameState::Kept]),
        all = frames.len(),
        failed = (failed > 0).then(|| html!(", {failed} failed", failed = failed)),
        rows = frames.iter().map(|view| row(view).html()).collect::<Html>(),
    ))
}

impl Row {
    fn html(&self) -> Html {
        let picture = self.has_picture.then(|| {
            html!(
                r#"<a href="/frame.png?frame={frame}"><img src="/thumbnail.png?frame={frame}" alt="Frame {frame}" width="96" loading="lazy"></a>"#,
                frame = self.frame,
            )
        });
        html!(
            r#"
<tr><th scope="row">{frame}</th><td data-label="Picture">{picture}</td><td data-label="State" class="{class}">{state}{message}</td><td data-label="Passes">{passes}</td><td data-label="Error">{error}</td><td data-label="Time">{time}</td></tr>"#,
            frame = self.frame,
            picture = picture,
            class = self.class,
            state = self.state,
            message = self
                .message
                .as_ref()
                .map(|message| html!(": {message}", message = message)),
            passes = self.passes,
            error = self.error,
            time = self.time,
        )
    }
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

/// The requested frame.
#[derive(Deserialize)]
pub(super) struct Which {
    frame: i64,
}

/// Its picture as the job wrote it.
pub(super) async fn png(State(web): State<Arc<Web>>, Query(which): Query<Which>) -> Response {
    answer(written(&web, which).await)
}

/// Its thumbnail.
pub(super) async fn thumbnail(State(web): State<Arc<Web>>, Query(which): Query<Which>) -> Response {
    let Some(bytes) = written(&web, which).await else {
        return answer(None);
    };
    let made = tokio::task::spawn_blocking(move || small(&bytes, SIDE));
    answer(made.await.ok().flatten())
}

/// The largest picture file that is sent, in bytes.
const MOST_BYTES: u64 = 1 << 30;

async fn written(web: &Web, Which { frame }: Which) -> Option<Vec<u8>> {
    let mut frames = web.series.frames().into_iter();
    let picture = frames.find(|view| view.frame == frame)?.picture?;
    let read = tokio::task::spawn_blocking(move || input::read(&picture, MOST_BYTES));
    read.await.ok()?.ok()
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
        let text = list(&[failed, done]).unwrap_or_default().into_string();
        assert!(text.contains("1 of 2 frames are there, 1 failed"), "{text}");
        assert!(text.contains("&#60;script") && !text.contains("<script"), "{text}");
        assert!(
            text.contains("/thumbnail.png?frame=8") && !text.contains("/thumbnail.png?frame=7"),
            "{text}"
        );
        assert!(text.contains("1.2 %") && text.contains("5.0 s"), "{text}");
    }
}
