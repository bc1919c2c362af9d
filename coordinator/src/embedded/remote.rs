//! A coordinator on another machine.

use super::Failure;
use crate::remote::{call, failed};
use crate::status;
use beamfarm_proto::{Token, wire};
use beamfarm_worker::security::{Credentials, SecurityArgs};
use std::path::PathBuf;

/// A coordinator and its credentials.
pub struct Remote {
    url: String,
    credentials: Credentials,
}

/// Ways to control its job.
#[derive(Clone, Copy, Debug)]
pub enum Steer {
    /// Hand out no more passes.
    Pause,
    /// Hand out passes again.
    Resume,
    /// End with the passes that are complete.
    Cancel,
    /// Set the total number of passes.
    Extend(u64),
}

/// Paths of PEM files.
#[derive(Clone, Debug, Default)]
pub struct Pem {
    /// Certificates of the authorities that may vouch for the coordinator.
    pub authority: Option<PathBuf>,
    /// The client certificate.
    pub certificate: Option<PathBuf>,
    /// The client certificate's private key.
    pub key: Option<PathBuf>,
}

impl Remote {
    /// A coordinator at http://HOST:PORT or https://HOST:PORT. Does not connect yet.
    pub fn new(url: String, token: Option<String>, pem: Pem) -> Result<Self, Failure> {
        let args = SecurityArgs {
            tls_ca: pem.authority,
            tls_cert: pem.certificate,
            tls_key: pem.key,
            token_file: None,
        };
        let credentials = args.read().map_err(Failure::usage)?;
        let token = token
            .map(|token| Token::parse(&token))
            .transpose()
            .map_err(Failure::usage)?;
        Ok(Self {
            url,
            credentials: Credentials {
                token: token.or(credentials.token),
                ..credentials
            },
        })
    }

    /// The state of its job: the JSON object of `beamfarm status --json`.
    pub fn status(&self) -> Result<String, Failure> {
        call(&self.url, &self.credentials, async |mut control| {
            let reply = control.status(wire::StatusRequest {}).await;
            status::json(reply.map_err(failed)?.into_inner())
        })
    }

    /// Control its job.
    pub fn steer(&self, steer: Steer) -> Result<(), Failure> {
        call(&self.url, &self.credentials, async |mut control| {
            let done = match steer {
                Steer::Pause => control.pause(wire::PauseRequest {}).await.map(drop),
                Steer::Resume => control.resume(wire::ResumeRequest {}).await.map(drop),
                Steer::Cancel => control.cancel(wire::CancelRequest {}).await.map(drop),
                Steer::Extend(passes) => control.extend(wire::ExtendRequest { passes }).await.map(drop),
            };
            done.map_err(failed)
        })
    }
}
