//! A coordinator that runs elsewhere.

use super::Failure;
use crate::remote::{call, failed};
use crate::status;
use beamfarm_proto::{Token, wire};
use beamfarm_worker::security::{Credentials, SecurityArgs};
use std::path::PathBuf;

/// A coordinator, and what opens it.
pub struct Remote {
    url: String,
    credentials: Credentials,
}

/// What it shall do.
#[derive(Clone, Copy, Debug)]
pub enum Steer {
    /// Hand out no more passes.
    Pause,
    /// Hand them out again.
    Resume,
    /// End with what is complete.
    Cancel,
    /// Have so many passes in all.
    Extend(u64),
}

/// Files of PEM.
#[derive(Clone, Debug, Default)]
pub struct Pem {
    /// Of the authorities that may vouch for it.
    pub authority: Option<PathBuf>,
    /// Certificate to show to it.
    pub certificate: Option<PathBuf>,
    /// The private key of that.
    pub key: Option<PathBuf>,
}

impl Remote {
    /// At http://HOST:PORT or https://HOST:PORT. Nothing is asked yet.
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

    /// How its job stands: the JSON object of `beamfarm status --json`.
    pub fn status(&self) -> Result<String, Failure> {
        call(&self.url, &self.credentials, async |mut control| {
            let reply = control.status(wire::StatusRequest {}).await;
            status::json(reply.map_err(failed)?.into_inner())
        })
    }

    /// Steer its job.
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
