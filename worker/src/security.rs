//! How this side of a connection proves its identity, and whom it trusts.

use beamfarm_image::input;
use beamfarm_proto::Token;
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity};
use tonic::{Request, Status};

/// Most bytes of a certificate or key file.
pub const MOST_PEM: u64 = 4 << 20;
/// Interval of probes on an idle connection, and the time limit for the answer.
const PROBE_EVERY: Duration = Duration::from_secs(10);
const PROBE_TIMEOUT: Duration = Duration::from_secs(20);
/// Time limit for connecting, including TLS.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Options of whatever connects to a coordinator.
#[derive(Args, Clone, Debug, Default)]
pub struct SecurityArgs {
    /// Certificates of the authorities that may vouch for the coordinator, as PEM [default: the machine's]
    #[arg(long, value_name = "FILE", env = "BEAMFARM_TLS_CA", help_heading = "Farm")]
    pub tls_ca: Option<PathBuf>,

    /// Certificate to show to the coordinator, as PEM
    ///
    /// The file also has the certificates between it and its authority.
    #[arg(
        long,
        value_name = "FILE",
        env = "BEAMFARM_TLS_CERT",
        requires = "tls_key",
        help_heading = "Farm"
    )]
    pub tls_cert: Option<PathBuf>,

    /// Private key of --tls-cert, as PEM
    #[arg(
        long,
        value_name = "FILE",
        env = "BEAMFARM_TLS_KEY",
        requires = "tls_cert",
        help_heading = "Farm"
    )]
    pub tls_key: Option<PathBuf>,

    /// File with the coordinator's token
    ///
    /// Without it BEAMFARM_TOKEN may hold the token itself.
    #[arg(long, value_name = "FILE", env = "BEAMFARM_TOKEN_FILE", help_heading = "Farm")]
    pub token_file: Option<PathBuf>,
}

impl SecurityArgs {
    /// Reads the files that the options name. The error is for users.
    pub fn read(&self) -> Result<Credentials, String> {
        let pem =
            |path: &Path| input::read_given(path, MOST_PEM).map_err(|error| format!("{}: {error}", path.display()));
        let authority = self.tls_ca.as_deref().map(pem).transpose()?;
        let identity = match (&self.tls_cert, &self.tls_key) {
            (Some(cert), Some(key)) => Some(Identity::from_pem(pem(cert)?, pem(key)?)),
            _ => None,
        };
        Ok(Credentials {
            authority: authority.map(Certificate::from_pem),
            identity,
            token: Token::read(self.token_file.as_deref())?,
        })
    }
}

/// The contents named by [`SecurityArgs`]. Empty by default, which suffices for a coordinator on this machine.
#[derive(Clone, Debug, Default)]
pub struct Credentials {
    /// The authorities that may vouch for the coordinator; the machine's own if there is none.
    pub authority: Option<Certificate>,
    /// The certificate to show.
    pub identity: Option<Identity>,
    /// The token to send.
    pub token: Option<Token>,
}

/// A connection that sends the token with every call.
pub type Link = InterceptedService<Channel, Bearer>;

/// Adds the token to calls.
#[derive(Clone, Debug)]
pub struct Bearer(Option<MetadataValue<Ascii>>);

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(token) = &self.0 {
            request.metadata_mut().insert("authorization", token.clone());
        }
        Ok(request)
    }
}

impl Credentials {
    /// A connection to `url`, http://HOST:PORT or https://HOST:PORT, established with its first call. The error says
    /// what is wrong with the address or the certificates.
    pub fn link(&self, url: &str) -> Result<Link, String> {
        let mut endpoint = Endpoint::from_shared(url.to_owned())
            .map_err(|error| describe(&error))?
            .connect_timeout(CONNECT_TIMEOUT)
            .http2_keep_alive_interval(PROBE_EVERY)
            .keep_alive_timeout(PROBE_TIMEOUT)
            .keep_alive_while_idle(true)
            .tcp_nodelay(true);
        if let Some(port) = wrong_port(endpoint.uri()) {
            return Err(format!("port {port}; expected 1 to 65535"));
        }
        match endpoint.uri().scheme_str() {
            Some("https") => {
                let mut tls = ClientTlsConfig::new().timeout(CONNECT_TIMEOUT);
                tls = match &self.authority {
                    Some(authority) => tls.ca_certificate(authority.clone()),
                    None => tls.with_native_roots(),
                };
                if let Some(identity) = &self.identity {
                    tls = tls.identity(identity.clone());
                }
                endpoint = endpoint
                    .tls_config(tls)
                    .map_err(|error| format!("TLS: {}", describe(&error)))?;
            }
            Some("http") if self.authority.is_some() || self.identity.is_some() => {
                return Err("there are certificates, but the address is not https://".into());
            }
            Some("http") => {}
            _ => return Err("neither http:// nor https://".into()),
        }
        let mut bearer = None;
        if let Some(token) = &self.token {
            let value = MetadataValue::try_from(token.bearer());
            let mut value = value.map_err(|error| error.to_string())?;
            value.set_sensitive(true);
            bearer = Some(value);
            let host = endpoint.uri().host().unwrap_or_default();
            if endpoint.uri().scheme_str() == Some("http") && !is_loopback(host) {
                tracing::warn!("the token goes to {host} unencrypted: https:// would hide it");
            }
        }
        let channel = endpoint.connect_lazy();
        Ok(InterceptedService::new(channel, Bearer(bearer)))
    }
}

/// An invalid port: without a port the scheme's default would be used silently.
fn wrong_port(uri: &tonic::transport::Uri) -> Option<&str> {
    let authority = uri.authority()?.as_str();
    let (host, port) = authority.rsplit_once(':')?;
    let is_address = authority.ends_with(']') || host.contains(':') && !host.ends_with(']');
    (!is_address && !port.parse::<u16>().is_ok_and(|port| port > 0)).then_some(port)
}

fn is_loopback(host: &str) -> bool {
    let host = host.trim_start_matches('[').trim_end_matches(']');
    let address = host.parse::<std::net::IpAddr>();
    host == "localhost" || address.is_ok_and(|address| address.is_loopback())
}

/// The message, with the probable cause if one side uses TLS and the other does not, or requires a certificate: neither
/// side can tell the other.
pub fn with_hint(url: &str, message: String) -> String {
    let has = |words: &[&str]| words.iter().any(|word| message.contains(word));
    let hangs_up = has(&["broken pipe", "connection closed", "onnection reset", "fatal alert"]);
    let hint = match url.starts_with("https://") {
        false if hangs_up || has(&["frame with invalid size", "http2 error"]) => "does it expect https://?",
        true if has(&["InvalidContentType"]) => "does it speak http:// only?",
        true if hangs_up => "does it ask for a certificate (--tls-cert and --tls-key) of another authority?",
        _ => return message,
    };
    format!("{message}; {hint}")
}

/// The innermost cause of an error: the outer ones only say "transport error".
pub fn describe(error: &dyn std::error::Error) -> String {
    let mut innermost = error;
    while let Some(source) = innermost.source() {
        innermost = source;
    }
    innermost.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn ports_that_are_none_are_refused() {
        let link = |url: &str| Credentials::default().link(url);
        for good in [
            "http://a",
            "http://a:1",
            "http://[::1]",
            "http://[::1]:65535",
            "http://10.0.0.1:7325",
        ] {
            assert!(link(good).is_ok(), "{good}");
        }
        for bad in ["http://a:99999", "http://a:0", "http://[::1]:70000", "http://a:"] {
            assert!(link(bad).unwrap_err().contains("port"), "{bad}");
        }
    }
}
