//! Options for who may connect.

use crate::failure::Failure;
use beamfarm_coordinator::security::{Security, Tls};
use beamfarm_image::input;
use beamfarm_proto::Token;
use beamfarm_worker::security::MOST_PEM;
use clap::Args;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use tracing::warn;

#[derive(Args, Clone, Debug)]
pub struct ListenArgs {
    /// Certificate of this coordinator, as PEM: encrypts all traffic
    ///
    /// The file also has the certificates between it and its authority.
    #[arg(
        long,
        value_name = "FILE",
        env = "BEAMFARM_TLS_CERT",
        requires = "tls_key",
        help_heading = "Farm"
    )]
    tls_cert: Option<PathBuf>,

    /// Private key of --tls-cert, as PEM
    #[arg(
        long,
        value_name = "FILE",
        env = "BEAMFARM_TLS_KEY",
        requires = "tls_cert",
        help_heading = "Farm"
    )]
    tls_key: Option<PathBuf>,

    /// Let in only clients with a certificate from these authorities, as PEM
    #[arg(
        long,
        value_name = "FILE",
        env = "BEAMFARM_TLS_CLIENT_CA",
        requires = "tls_cert",
        help_heading = "Farm"
    )]
    tls_client_ca: Option<PathBuf>,

    /// Let in only clients with the token in this file
    ///
    /// Without it BEAMFARM_TOKEN may hold the token itself.
    #[arg(long, value_name = "FILE", env = "BEAMFARM_TOKEN_FILE", help_heading = "Farm")]
    token_file: Option<PathBuf>,

    /// Require the token in this file to pause, cancel, extend or write the job
    ///
    /// It is good for everything else, too. Workers need not know it.
    #[arg(
        long,
        value_name = "FILE",
        env = "BEAMFARM_OPERATOR_TOKEN_FILE",
        help_heading = "Farm"
    )]
    operator_token_file: Option<PathBuf>,

    /// Let in everybody who can reach the port, from other machines too
    #[arg(long, help_heading = "Farm")]
    insecure_listen: bool,
}

/// A secret that other users can read is not one.
fn warn_if_others_read(file: &Path) {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = std::fs::metadata(file).map(|file| file.permissions().mode());
        if mode.is_ok_and(|mode| mode & 0o044 != 0) {
            let path = file.display();
            warn!("{path} can be read by other users of this machine: chmod 600 keeps it secret");
        }
    }
    #[cfg(not(unix))]
    let _ = file;
}

impl ListenArgs {
    /// Read the files that the options name, for a listener at this address.
    pub fn read(&self, address: SocketAddr) -> Result<Security, Failure> {
        let pem = |path: &Path| {
            let read = input::read_given(path, MOST_PEM);
            read.map_err(|error| Failure::usage(format!("{}: {error}", path.display())))
        };
        let tls = match (&self.tls_cert, &self.tls_key) {
            (Some(cert), Some(key)) => {
                let clients = self.tls_client_ca.as_deref().map(pem).transpose()?;
                let tls = Tls::new(&pem(cert)?, &pem(key)?, clients.as_deref());
                Some(tls.map_err(|error| Failure::usage(format!("TLS: {error}")))?)
            }
            _ => None,
        };
        let token = Token::read(self.token_file.as_deref()).map_err(Failure::usage)?;
        let operator = match &self.operator_token_file {
            Some(file) => Token::read(Some(file)).map_err(Failure::usage)?,
            None => None,
        };
        if operator.is_some() && token.is_none() {
            let message = "--operator-token-file: without --token-file everybody may do everything";
            return Err(Failure::usage(message));
        }
        for file in [&self.tls_key, &self.token_file, &self.operator_token_file]
            .into_iter()
            .flatten()
        {
            warn_if_others_read(file);
        }
        let security = Security { tls, token, operator };
        security
            .check(address, self.insecure_listen)
            .map_err(|error| Failure::usage(format!("--listen {error}")))?;
        if !address.ip().is_loopback() && security.tls.is_none() {
            warn!("there is no TLS: whoever listens on the network sees the token, the scene and the image");
        }
        Ok(security)
    }
}
