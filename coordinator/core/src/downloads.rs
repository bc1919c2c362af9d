//! What a page answers to whoever asks for a picture: the picture to keep, or why there is none.

use axum::http::StatusCode;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use std::fmt::Display;

/// There is no picture yet.
pub fn none_yet() -> Response {
    (StatusCode::NOT_FOUND, "no pass is complete yet\n").into_response()
}

/// The picture could not be made.
pub fn failed(error: impl Display) -> Response {
    (StatusCode::INTERNAL_SERVER_ERROR, error.to_string()).into_response()
}

/// A file that the browser saves under this name.
pub fn to_keep(kind: &'static str, name: &str, bytes: Vec<u8>) -> Response {
    let attachment = format!("attachment; filename=\"{name}\"");
    let headers = [(CONTENT_TYPE, kind.to_owned()), (CONTENT_DISPOSITION, attachment)];
    (headers, bytes).into_response()
}

/// A title with only the characters that are safe in file names everywhere.
pub fn plain_name(title: &str) -> String {
    let is_safe = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    title.chars().map(|c| if is_safe(c) { c } else { '_' }).collect()
}
