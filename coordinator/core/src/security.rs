//! Who is admitted: TLS, client certificates, and the token.

use axum::response::{IntoResponse, Response};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use beamfarm_proto::Token;
use http::{HeaderMap, HeaderValue, Request, StatusCode, header};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::WebPkiClientVerifier;
use rustls::{RootCertStore, ServerConfig};
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use tonic::Status;

/// Path that reports that the coordinator is alive. Reveals nothing about the job and needs no token.
pub const HEALTH: &str = "/healthz";
/// The page, with its script, for links that carry the token after the #. It reveals nothing about the job.
pub const ENTER: &str = "/enter";
pub(crate) const ENTER_SCRIPT: &str = "/enter.js";
/// Paths of the page's buttons, which write the image and control the job.
pub(crate) const WRITE: &str = "/write";
pub(crate) const PAUSE: &str = "/pause";
pub(crate) const RESUME: &str = "/resume";
pub(crate) const EXTEND: &str = "/extend";
pub(crate) const CANCEL: &str = "/cancel";
/// Path of the live view's socket, which changes the scene.
pub const LOOK: &str = "/look";
/// Path prefix of the calls for people, and the one that only reads.
const CONTROL: &str = "/beamfarm.v1.Control/";
const STATUS: &str = "/beamfarm.v1.Control/Status";
/// Path prefix of gRPC calls.
const CALLS: &str = "/beamfarm.v1.";

/// What a listener requires of those who connect. Nothing by default.
#[derive(Clone, Debug, Default)]
pub struct Security {
    /// TLS, with its requirements for clients.
    pub tls: Option<Tls>,
    /// The token for every request except [`HEALTH`] and [`ENTER`].
    pub token: Option<Token>,
    /// The token for requests that control the job or change the scene; `None`: `token` is enough. It is valid for
    /// everything else too. If there is no `token`, everyone but workers must show it.
    pub operator: Option<Token>,
}

/// The server side of TLS 1.3.
#[derive(Clone, Debug)]
pub struct Tls {
    pub(crate) config: Arc<ServerConfig>,
    /// Whether clients need a certificate.
    clients: bool,
}

impl Tls {
    /// From PEM: the certificate with its intermediates, its private key, and the authorities for client certificates,
    /// which clients then must show. The error is for people.
    pub fn new(chain: &[u8], key: &[u8], clients: Option<&[u8]>) -> Result<Self, String> {
        let chain = certificates(chain, "the certificate")?;
        let key = PrivateKeyDer::from_pem_slice(key).map_err(|error| format!("the private key is not PEM: {error}"))?;
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = ServerConfig::builder_with_provider(provider.clone())
            .with_protocol_versions(&[&rustls::version::TLS13])
            .map_err(|error| error.to_string())?;
        let config = match clients {
            None => config.with_no_client_auth(),
            Some(authorities) => {
                let mut roots = RootCertStore::empty();
                for authority in certificates(authorities, "the authority of clients")? {
                    roots
                        .add(authority)
                        .map_err(|error| format!("the authority of clients: {error}"))?;
                }
                let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider)
                    .build()
                    .map_err(|error| format!("the authority of clients: {error}"))?;
                config.with_client_cert_verifier(verifier)
            }
        };
        let mut config = config
            .with_single_cert(chain, key)
            .map_err(|error| format!("certificate and private key: {error}"))?;
        config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
        Ok(Self {
            config: Arc::new(config),
            clients: clients.is_some(),
        })
    }
}

fn certificates(pem: &[u8], what: &str) -> Result<Vec<CertificateDer<'static>>, String> {
    let found: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(pem).collect();
    match found {
        Ok(found) if !found.is_empty() => Ok(found),
        Ok(_) => Err(format!("{what}: no CERTIFICATE in PEM")),
        Err(error) => Err(format!("{what} is not PEM: {error}")),
    }
}

impl Security {
    /// Whether strangers are kept out.
    pub fn keeps_strangers_out(&self) -> bool {
        self.token.is_some() || self.tls.as_ref().is_some_and(|tls| tls.clients)
    }

    /// Refuse an address that other machines can reach without authentication, unless `insecure` is set.
    pub fn check(&self, address: SocketAddr, insecure: bool) -> Result<(), String> {
        if address.ip().is_loopback() || self.keeps_strangers_out() || insecure {
            return Ok(());
        }
        Err(format!(
            "{address} can be reached from other machines, and whoever reaches it could read the scene and send passes.\n\
             Give it a token (--token-file FILE, or BEAMFARM_TOKEN) or ask for certificates (--tls-cert, --tls-key and \
             --tls-client-ca);\n--insecure-listen lets everybody in"
        ))
    }

    /// Whether a request shows an invalid token.
    pub(crate) fn is_wrong<B>(&self, request: &Request<B>) -> bool {
        let headers = request.headers();
        let shown = headers.contains_key(header::AUTHORIZATION);
        let is_token = |token: &Token| secret(headers).is_some_and(|it| token.matches(&it));
        let mut tokens = self.token.iter().chain(&self.operator).peekable();
        shown && tokens.peek().is_some() && !tokens.any(is_token)
    }

    /// The URL scheme.
    pub fn scheme(&self) -> &'static str {
        match self.tls {
            Some(_) => "https",
            None => "http",
        }
    }

    /// The answer to a request that is not admitted. `local`: the listener serves this machine only.
    pub(crate) fn refuse<B>(&self, request: &Request<B>, local: bool) -> Option<Response> {
        let headers = request.headers();
        if is_for_all(request) {
            return None;
        }
        if from_other_site(request) {
            let message = "a page of another site has no business here";
            return Some(answer(headers, Status::permission_denied(message)));
        }
        let shown = secret(headers);
        let shows = |token: &Option<Token>| {
            let pair = token.as_ref().zip(shown.as_deref());
            pair.is_some_and(|(token, shown)| token.matches(shown))
        };
        if shows(&self.operator) {
            return None;
        }
        let is_of_worker = request.uri().path().starts_with(CALLS) && !steers(request);
        if self.token.is_none() && self.operator.is_some() && !is_of_worker {
            let message = "the page asks for a token of its own, which is behind the # of the link to it";
            return Some(answer(headers, Status::unauthenticated(message)));
        }
        if self.token.is_none() {
            return (local && rebound(request)).then(|| {
                let message = "expected localhost or an address as host; with a token any name will do";
                answer(headers, Status::permission_denied(message))
            });
        }
        if shows(&self.token) {
            let message = "this is for operators: it asks for the token of `serve --operator-token-file`";
            return (self.operator.is_some() && steers(request))
                .then(|| answer(headers, Status::permission_denied(message)));
        }
        let message = match headers.contains_key(header::AUTHORIZATION) {
            true => "this is not the coordinator's token",
            false => "the coordinator asks for a token (--token-file FILE, or BEAMFARM_TOKEN)",
        };
        Some(answer(headers, Status::unauthenticated(message)))
    }
}

/// Whether a request asks for something public.
pub(crate) fn is_for_all<B>(request: &Request<B>) -> bool {
    matches!(request.uri().path(), HEALTH | ENTER | ENTER_SCRIPT)
}

/// Whether a request controls the job, other than as a worker.
fn steers<B>(request: &Request<B>) -> bool {
    let path = request.uri().path();
    let buttons = [WRITE, PAUSE, RESUME, EXTEND, CANCEL, LOOK];
    buttons.contains(&path) || path.starts_with(CONTROL) && path != STATUS
}

/// The token in a request: as bearer token, or as the password of any user, which browsers can ask for.
fn secret(headers: &HeaderMap) -> Option<Vec<u8>> {
    let value = headers.get(header::AUTHORIZATION)?.as_bytes();
    let space = value.iter().position(|byte| *byte == b' ')?;
    let (scheme, rest) = (&value[..space], value[space..].trim_ascii());
    if scheme.eq_ignore_ascii_case(b"bearer") {
        return Some(rest.to_vec());
    }
    if !scheme.eq_ignore_ascii_case(b"basic") {
        return None;
    }
    let mut pair = STANDARD.decode(rest).ok()?;
    let colon = pair.iter().position(|byte| *byte == b':')?;
    Some(pair.split_off(colon + 1))
}

fn text<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    headers.get(name).and_then(|value| value.to_str().ok())
}

fn host<B>(request: &Request<B>) -> &str {
    match request.uri().authority() {
        Some(authority) => authority.as_str(),
        None => text(request.headers(), "host").unwrap_or_default(),
    }
}

/// Whether a browser sends this on behalf of another site. Browsers add remembered passwords without asking.
fn from_other_site<B>(request: &Request<B>) -> bool {
    let headers = request.headers();
    if let Some("cross-site" | "same-site") = text(headers, "sec-fetch-site") {
        // Links from other sites may lead here.
        let link = text(headers, "sec-fetch-mode") == Some("navigate");
        return !(link && request.method().is_safe());
    }
    let origin = text(headers, "origin");
    let origin = origin.map(|origin| origin.split_once("://").map_or("", |it| it.1));
    origin.is_some_and(|origin| origin != host(request))
}

/// Whether this may come from a page that reaches this machine by a foreign name (DNS rebinding), which makes it
/// same-site. `localhost` and IP addresses cannot be rebound; workers are not browsers and send no origin.
fn rebound<B>(request: &Request<B>) -> bool {
    if request.uri().path().starts_with(CALLS) && !request.headers().contains_key(header::ORIGIN) {
        return false;
    }
    let authority = host(request).parse::<http::uri::Authority>();
    let name = authority.as_ref().map_or("", |authority| authority.host());
    let bare = name.trim_start_matches('[').trim_end_matches(']');
    bare != "localhost" && bare.parse::<IpAddr>().is_err()
}

pub(crate) fn is_grpc(headers: &HeaderMap) -> bool {
    let kind = headers.get(header::CONTENT_TYPE);
    kind.is_some_and(|kind| kind.as_bytes().starts_with(b"application/grpc"))
}

/// A refusal in the form that the client understands.
pub(crate) fn answer(asked: &HeaderMap, status: Status) -> Response {
    if is_grpc(asked) {
        return status.into_http();
    }
    let code = match status.code() {
        tonic::Code::Unauthenticated => StatusCode::UNAUTHORIZED,
        tonic::Code::PermissionDenied => StatusCode::FORBIDDEN,
        _ => StatusCode::SERVICE_UNAVAILABLE,
    };
    let mut response = (code, format!("{}\n", status.message())).into_response();
    if code == StatusCode::UNAUTHORIZED {
        let challenge = HeaderValue::from_static("Basic realm=\"beamfarm\", charset=\"UTF-8\"");
        let headers = response.headers_mut();
        headers.insert(header::WWW_AUTHENTICATE, challenge);
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(headers: &[(&str, &str)]) -> Request<()> {
        let mut request = Request::builder().uri("/");
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        request.body(()).unwrap()
    }

    const TOKEN: &str = "0123456789abcdef";

    fn with_token() -> Security {
        Security {
            token: Some(Token::parse(TOKEN).unwrap()),
            ..Security::default()
        }
    }

    #[test]
    fn the_token_opens_as_bearer_and_as_password() {
        let security = with_token();
        let basic = |pair: &str| format!("Basic {}", STANDARD.encode(pair));
        let good = [
            format!("Bearer {TOKEN}"),
            format!("bearer  {TOKEN} "),
            basic(&format!("anybody:{TOKEN}")),
            basic(&format!(":{TOKEN}")),
        ];
        for value in good {
            let refused = security.refuse(&request(&[("authorization", &value)]), true);
            assert!(refused.is_none(), "{value}");
        }
        let bad = [
            String::new(),
            TOKEN.into(),
            "Bearer".into(),
            "Bearer ".into(),
            format!("Bearer {TOKEN}0"),
            format!("Digest {TOKEN}"),
            "Basic %%%".into(),
            basic(TOKEN),
            basic(&format!("{TOKEN}:")),
        ];
        for value in bad {
            let refused = security.refuse(&request(&[("authorization", &value)]), true);
            assert_eq!(refused.unwrap().status(), StatusCode::UNAUTHORIZED);
        }
        let refused = security.refuse(&request(&[]), true).unwrap();
        assert!(refused.headers().contains_key(header::WWW_AUTHENTICATE));
        let health = Request::builder().uri(HEALTH).body(()).unwrap();
        assert!(security.refuse(&health, true).is_none());
        let enter = Request::builder().uri(ENTER).body(()).unwrap();
        assert!(security.refuse(&enter, true).is_none());
        let grpc = request(&[("content-type", "application/grpc")]);
        let refused = security.refuse(&grpc, true).unwrap();
        assert_eq!(refused.status(), StatusCode::OK);
        assert_eq!(refused.headers()["grpc-status"], "16");
    }

    #[test]
    fn workers_steer_no_job_where_operators_have_a_token() {
        const OPERATOR: &str = "operator-of-this-job";
        let mut security = with_token();
        let code = |security: &Security, path: &'static str, token: &str| {
            let mut request = request(&[("authorization", &format!("Bearer {token}"))]);
            *request.uri_mut() = http::Uri::from_static(path);
            security.refuse(&request, false).map(|answer| answer.status())
        };
        let steering = [
            "/write",
            "/pause",
            "/cancel",
            "/beamfarm.v1.Control/Cancel",
            "/beamfarm.v1.Control/Extend",
        ];
        let looking = ["/", "/beamfarm.v1.Control/Status", "/beamfarm.v1.Farm/Register"];
        for path in steering {
            assert_eq!(code(&security, path, TOKEN), None);
        }
        security.operator = Some(Token::parse(OPERATOR).unwrap());
        for path in steering {
            assert_eq!(code(&security, path, TOKEN), Some(StatusCode::FORBIDDEN), "{path}");
            assert_eq!(code(&security, path, OPERATOR), None, "{path}");
            assert_eq!(
                code(&security, path, "0123456789abcdeX"),
                Some(StatusCode::UNAUTHORIZED)
            );
        }
        for path in looking {
            assert_eq!(code(&security, path, TOKEN), None, "{path}");
            assert_eq!(code(&security, path, OPERATOR), None, "{path}");
        }
        let open = Security {
            token: None,
            ..security.clone()
        };
        for path in steering.iter().chain(&["/", LOOK, "/image.png"]) {
            assert_eq!(code(&open, path, TOKEN), Some(StatusCode::UNAUTHORIZED), "{path}");
            assert_eq!(code(&open, path, OPERATOR), None, "{path}");
        }
        assert_eq!(code(&open, "/beamfarm.v1.Revisions/Register", ""), None);
        let wrong = |token: &str| security.is_wrong(&request(&[("authorization", &format!("Bearer {token}"))]));
        assert!(!wrong(TOKEN) && !wrong(OPERATOR) && wrong("0123456789abcdeX"));
        assert!(!security.is_wrong(&request(&[])));
    }

    #[test]
    fn pages_of_other_sites_are_refused() {
        let grpc = ("content-type", "application/grpc");
        let password = format!("Bearer {TOKEN}");
        let password = ("authorization", password.as_str());
        let refused = |security: &Security, local, headers: &[(&str, &str)]| {
            let answer = security.refuse(&request(headers), local);
            // The other refusal is for a missing token: 401, or 16.
            answer.is_some_and(|answer| match answer.headers().get("grpc-status") {
                Some(code) => code == "7",
                None => answer.status() == StatusCode::FORBIDDEN,
            })
        };
        let open = Security::default();
        let mine: [&[(&str, &str)]; 6] = [
            &[("host", "localhost:7325")],
            &[("host", "127.0.0.1:7325")],
            &[("host", "[::1]:7325")],
            &[("host", "10.0.0.7")],
            &[("host", "localhost:1"), ("origin", "http://localhost:1")],
            &[
                ("host", "localhost:1"),
                ("sec-fetch-site", "cross-site"),
                ("sec-fetch-mode", "navigate"),
            ],
        ];
        for headers in mine {
            assert!(!refused(&open, true, headers), "{headers:?}");
        }
        let rebound: [&[(&str, &str)]; 4] = [
            &[("host", "rebound.example:7325")],
            &[],
            // What a page claims about its request is no reason to trust it.
            &[("host", "rebound.example"), grpc],
            &[("host", "rebound.example"), grpc, ("origin", "http://rebound.example")],
        ];
        for headers in rebound {
            assert!(refused(&open, true, headers), "{headers:?}");
            assert!(!refused(&open, false, headers), "{headers:?}");
            assert!(!refused(&with_token(), true, headers), "{headers:?}");
        }
        // A worker may know this machine by any name.
        let call = |origin: &[(&str, &str)]| {
            let mut call = request(&[&[("host", "gateway:7325"), grpc], origin].concat());
            *call.uri_mut() = http::Uri::from_static("/beamfarm.v1.Farm/Register");
            open.refuse(&call, true)
        };
        assert!(call(&[]).is_none());
        assert!(call(&[("origin", "http://gateway:7325")]).is_some());
        let cross: [&[(&str, &str)]; 3] = [
            &[("host", "localhost:1"), ("origin", "http://other.example"), password],
            &[("host", "localhost:1"), ("origin", "null"), password],
            &[("host", "localhost:1"), ("sec-fetch-site", "cross-site"), password],
        ];
        for headers in cross {
            assert!(refused(&open, false, headers), "{headers:?}");
            assert!(refused(&with_token(), false, headers), "{headers:?}");
        }
    }

    #[test]
    fn strangers_are_let_in_by_name_only() {
        let open = Security::default();
        let loopback = ["127.0.0.1:1", "127.9.9.9:1", "[::1]:1"];
        for address in loopback {
            assert!(open.check(address.parse().unwrap(), false).is_ok());
        }
        for address in ["0.0.0.0:1", "10.0.0.1:1", "[::]:1", "[fe80::1]:1"] {
            let address = address.parse().unwrap();
            let refused = open.check(address, false).unwrap_err();
            assert!(refused.contains("--token-file"), "{refused}");
            assert!(open.check(address, true).is_ok());
            assert!(with_token().check(address, false).is_ok());
        }
    }
}
