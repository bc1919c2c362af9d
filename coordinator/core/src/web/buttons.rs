//! The page's buttons; they do what the calls of the same names do. Requests from other sites are refused earlier.
//! Scripts get the text, forms return to the page.

use super::Web;
use crate::watch::Watch;
use axum::extract::{Query, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Redirect, Response};
use serde::Deserialize;
use std::sync::Arc;
use tracing::info;

type Done = Result<String, String>;

fn answer(headers: &HeaderMap, done: Done) -> Response {
    let from_script = headers.get("accept").is_some_and(|accept| accept == "text/plain");
    match done {
        _ if !from_script => Redirect::to(&format!("/?done={}", done.is_ok())).into_response(),
        Ok(message) => message.into_response(),
        Err(message) => (StatusCode::CONFLICT, message).into_response(),
    }
}

/// The first job in line, if it is not over.
fn running(web: &Web) -> Result<Arc<Watch>, String> {
    match web.series.is_over() {
        false => Ok(web.watch()),
        true => Err("the job is over".into()),
    }
}

pub(super) async fn write(State(web): State<Arc<Web>>, headers: HeaderMap) -> Response {
    answer(&headers, web.watch().write_now().await)
}

pub(super) async fn pause(State(web): State<Arc<Web>>, headers: HeaderMap) -> Response {
    let paused = running(&web).map(|_| web.series.pause(true));
    answer(&headers, paused.map(|()| "paused".into()))
}

pub(super) async fn resume(State(web): State<Arc<Web>>, headers: HeaderMap) -> Response {
    let resumed = running(&web).map(|_| web.series.pause(false));
    answer(&headers, resumed.map(|()| "resumed".into()))
}

pub(super) async fn cancel(State(web): State<Arc<Web>>, headers: HeaderMap) -> Response {
    let cancelled = running(&web).map(|_| {
        info!("cancelled from the page");
        web.series.cancel();
    });
    answer(
        &headers,
        cancelled.map(|()| "ended with the passes that are complete".into()),
    )
}

/// The new total number of passes.
#[derive(Deserialize)]
pub(super) struct Passes {
    passes: u64,
}

pub(super) async fn extend(
    State(web): State<Arc<Web>>,
    headers: HeaderMap,
    Query(Passes { passes }): Query<Passes>,
) -> Response {
    let extended = running(&web).and_then(|watch| watch.farm().extend(passes).map_err(|error| error.to_string()));
    answer(&headers, extended.map(|()| format!("{passes} passes in all")))
}
