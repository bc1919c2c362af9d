//! A coordinator on another machine, for the commands that call it.

use crate::failure::{Failure, UNREACHABLE};
use beamfarm_proto::wire::control_client::ControlClient;
use beamfarm_worker::security::{Credentials, Link, SecurityArgs};
use clap::Args;
use std::error::Error;
use std::time::Duration;
use tokio::time::timeout;
use tonic::{Code, Status};

/// Time limit of an answer: writing a large image takes a while.
const ANSWER: Duration = Duration::from_secs(120);
/// Enough for a status with thousands of workers.
const MESSAGE_BYTES: usize = 64 << 20;

/// Which coordinator.
#[derive(Args, Clone, Debug)]
pub struct RemoteArgs {
    /// The coordinator: http://HOST:PORT, or https://HOST:PORT
    #[arg(value_name = "URL")]
    pub url: String,

    #[command(flatten)]
    pub security: SecurityArgs,
}

impl RemoteArgs {
    /// Call the coordinator.
    pub fn call<T, F>(self, ask: impl FnOnce(ControlClient<Link>) -> F) -> Result<T, Failure>
    where
        F: Future<Output = Result<T, Failure>>,
    {
        let credentials = self.security.read().map_err(Failure::usage)?;
        call(&self.url, &credentials, ask)
    }
}

/// Call the coordinator at this address.
pub fn call<T, F>(
    url: &str,
    credentials: &Credentials,
    ask: impl FnOnce(ControlClient<Link>) -> F,
) -> Result<T, Failure>
where
    F: Future<Output = Result<T, Failure>>,
{
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(Failure::io)?;
    let url = match url.contains("://") {
        true => url.to_owned(),
        false => format!("http://{url}"),
    };
    runtime.block_on(async {
        let wrong = |error| Failure::usage(format!("{url}: {error}"));
        let link = credentials.link(&url).map_err(wrong)?;
        let control = ControlClient::new(link).max_decoding_message_size(MESSAGE_BYTES);
        let late = |_| Failure::unreachable(format!("{url} does not answer"));
        let answered = timeout(ANSWER, ask(control)).await.map_err(late)?;
        answered.map_err(|failure| failure.with_hint(&url))
    })
}

/// The failure for a refused or broken call.
pub fn failed(status: Status) -> Failure {
    let message = status.message();
    match status.code() {
        Code::InvalidArgument => Failure::usage(message),
        // Errors of the connection, unlike those of the coordinator, have a source.
        Code::Unavailable | Code::DeadlineExceeded | Code::Cancelled | Code::Unknown => unreachable(&status),
        Code::Internal if status.source().is_some() => unreachable(&status),
        Code::Unimplemented => Failure::io("this coordinator is of another version"),
        Code::Unauthenticated | Code::PermissionDenied => Failure::refused(message),
        _ => Failure::io(message),
    }
}

fn unreachable(status: &Status) -> Failure {
    Failure::unreachable(format!("{UNREACHABLE}: {}", reason(status)))
}

/// The innermost source of a status: the outer ones only say "transport error".
fn reason(status: &Status) -> String {
    let mut reason: &dyn std::error::Error = status;
    while let Some(source) = reason.source() {
        reason = source;
    }
    match reason.downcast_ref::<Status>() {
        Some(status) => status.message().to_owned(),
        None => reason.to_string(),
    }
}
