//! Who is let in: tokens, TLS, client certificates.

use crate::farm::harness::{Coordinator, LONG, WorkerResult, free_port, spec, within};
use beamfarm_coordinator::limits::Limits;
use beamfarm_coordinator::security::{Security, Tls};
use beamfarm_coordinator::{End, Timing};
use beamfarm_proto::wire::farm_client::FarmClient;
use beamfarm_proto::{Token, VERSION, wire};
use beamfarm_worker::WorkerError;
use beamfarm_worker::security::Credentials;
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::watch;
use tonic::Code;
use tonic::transport::{Certificate, Identity};

const TOKEN: &str = "a-token-for-tests-alone";

/// A certificate authority.
pub struct Authority(CertifiedIssuer<'static, KeyPair>);

impl Authority {
    pub fn new() -> Self {
        let mut params = CertificateParams::default();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let key = KeyPair::generate().unwrap();
        Self(CertifiedIssuer::self_signed(params, key).unwrap())
    }

    pub fn pem(&self) -> String {
        self.0.pem()
    }

    /// Certificate and key for this name.
    pub fn issue(&self, name: &str) -> (String, String) {
        let key = KeyPair::generate().unwrap();
        let params = CertificateParams::new([name.to_string()]).unwrap();
        let certificate = params.signed_by(&key, &self.0).unwrap();
        (certificate.pem(), key.serialize_pem())
    }
}

async fn coordinator(security: Security) -> Coordinator {
    let timing = Timing {
        heartbeat: Duration::from_millis(50),
        lease: LONG,
    };
    Coordinator::start_behind(free_port(), spec(1), timing, (security, Limits::default())).await
}

fn token(text: &str) -> Option<Token> {
    Some(Token::parse(text).unwrap())
}

/// How a worker of the library fares with them.
async fn work(url: String, credentials: Credentials) -> WorkerResult {
    let (_drain, receiver) = watch::channel(false);
    let config = beamfarm_worker::Config {
        url,
        credentials,
        threads: 1,
        at_once: None,
        name: "test".into(),
        state: None,
        cache: None,
        patience: Duration::from_millis(300),
        grace: Duration::from_secs(10),
    };
    within(
        "a worker's end",
        beamfarm_worker::run(config, beamfarm_worker::offer::Offered::processors(), receiver),
    )
    .await
}

/// The code of a call with these credentials.
async fn register(url: &str, credentials: &Credentials) -> Code {
    let request = wire::RegisterRequest {
        protocol: beamfarm_proto::PROTOCOL,
        version: VERSION.into(),
        identity: crate::farm::harness::identity_of("raw"),
        offers: vec![wire::Offer::of_processors(crate::farm::harness::canary())],
        ..Default::default()
    };
    let mut farm = FarmClient::new(credentials.link(url).unwrap());
    match within("an answer about a worker", farm.register(request)).await {
        Ok(_) => Code::Ok,
        Err(status) => status.code(),
    }
}

/// The answer to this raw request, as a browser sees it.
async fn http(coordinator: &Coordinator, path: &str, headers: &str) -> String {
    let mut stream = TcpStream::connect(coordinator.address).await.unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n{headers}\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    let read = stream.read_to_string(&mut answer);
    within(path, read).await.unwrap();
    answer
}

#[tokio::test]
async fn only_those_with_the_token_get_in() {
    let coordinator = coordinator(Security {
        token: token(TOKEN),
        ..Default::default()
    })
    .await;
    let with = |token| Credentials {
        token,
        ..Default::default()
    };
    let url = coordinator.url();
    for wrong in [None, token("another-token-entirely")] {
        let credentials = with(wrong);
        let begun = Instant::now();
        let shown = credentials.token.is_some();
        assert_eq!(register(&url, &credentials).await, Code::Unauthenticated);
        // Guessing is slowed down.
        assert!(!shown || begun.elapsed() >= Duration::from_millis(300));
        let refused = work(url.clone(), credentials).await;
        assert!(matches!(refused, Err(WorkerError::Refused(_))), "{refused:?}");
    }
    assert_eq!(coordinator.farm.progress().registered, 0);
    assert_eq!(register(&url, &with(token(TOKEN))).await, Code::Ok);
    work(url, with(token(TOKEN))).await.unwrap();
    assert_eq!(coordinator.ended().await, End::Complete);
}

#[tokio::test]
async fn health_is_for_everybody_and_nothing_else_is() {
    let coordinator = coordinator(Security {
        token: token(TOKEN),
        ..Default::default()
    })
    .await;
    let health = http(&coordinator, "/healthz", "").await;
    assert!(health.starts_with("HTTP/1.1 200 "), "{health}");
    for path in ["/", "/metrics", "/healthz/x", "/beamfarm.v1.Farm/Register"] {
        let refused = http(&coordinator, path, "").await;
        assert!(refused.starts_with("HTTP/1.1 401 "), "{refused}");
        assert!(refused.contains("www-authenticate: Basic"), "{refused}");
        assert!(!refused.contains(TOKEN));
        let bearer = format!("authorization: Bearer {TOKEN}\r\n");
        let inside = http(&coordinator, path, &bearer).await;
        assert!(!inside.starts_with("HTTP/1.1 401 "), "{inside}");
    }
}

#[tokio::test]
async fn tls_needs_an_authority_that_both_believe() {
    let authority = Authority::new();
    let (certificate, key) = authority.issue("localhost");
    let tls = Tls::new(certificate.as_bytes(), key.as_bytes(), None).unwrap();
    let coordinator = coordinator(Security {
        tls: Some(tls),
        token: token(TOKEN),
        ..Default::default()
    })
    .await;
    let port = coordinator.address.port();
    let url = format!("https://localhost:{port}");
    let trust = |authority: &Authority| Credentials {
        authority: Some(Certificate::from_pem(authority.pem())),
        token: token(TOKEN),
        ..Default::default()
    };
    let strange = trust(&Authority::new());
    let alone = Credentials {
        authority: None,
        ..strange.clone()
    };
    for credentials in [strange, alone] {
        let refused = work(url.clone(), credentials).await.unwrap_err();
        let WorkerError::Unreachable { message, .. } = refused else {
            panic!("{refused}");
        };
        assert!(message.contains("certificate"), "{message}");
    }
    // The certificate is not for this name.
    let other = format!("https://127.0.0.1:{port}");
    assert_ne!(register(&other, &trust(&authority)).await, Code::Ok);
    let plain = Credentials {
        authority: None,
        ..trust(&authority)
    };
    let unheard = work(coordinator.url(), plain).await.unwrap_err().to_string();
    assert!(unheard.contains("expect https://"), "{unheard}");
    let nameless = Credentials {
        token: None,
        ..trust(&authority)
    };
    assert_eq!(register(&url, &nameless).await, Code::Unauthenticated);
    assert_eq!(coordinator.farm.progress().registered, 0);
    work(url, trust(&authority)).await.unwrap();
    assert_eq!(coordinator.ended().await, End::Complete);
}

#[tokio::test]
async fn mutual_tls_asks_for_a_certificate() {
    let (servers, clients) = (Authority::new(), Authority::new());
    let (certificate, key) = servers.issue("localhost");
    let tls = Tls::new(certificate.as_bytes(), key.as_bytes(), Some(clients.pem().as_bytes()));
    let security = Security {
        tls: Some(tls.unwrap()),
        ..Default::default()
    };
    let anywhere = "0.0.0.0:7325".parse().unwrap();
    assert!(security.check(anywhere, false).is_ok());
    let coordinator = coordinator(security).await;
    let url = format!("https://localhost:{}", coordinator.address.port());
    let show = |identity| Credentials {
        authority: Some(Certificate::from_pem(servers.pem())),
        identity,
        token: None,
    };
    let identity = |authority: &Authority| {
        let (certificate, key) = authority.issue("worker");
        Some(Identity::from_pem(certificate, key))
    };
    for wrong in [None, identity(&Authority::new()), identity(&servers)] {
        let unheard = work(url.clone(), show(wrong)).await.unwrap_err().to_string();
        assert!(unheard.contains("--tls-cert"), "{unheard}");
    }
    assert_eq!(coordinator.farm.progress().registered, 0);
    work(url, show(identity(&clients))).await.unwrap();
    assert_eq!(coordinator.ended().await, End::Complete);
}

#[test]
fn what_is_no_certificate_is_named() {
    let authority = Authority::new();
    let (certificate, key) = authority.issue("localhost");
    let (_, other) = authority.issue("localhost");
    let (certificate, key) = (certificate.as_bytes(), key.as_bytes());
    let new = |chain, key, clients| Tls::new(chain, key, clients).unwrap_err();
    assert!(new(b"", key, None).contains("certificate"));
    assert!(new(key, key, None).contains("certificate"));
    assert!(new(certificate, certificate, None).contains("private key"));
    assert!(new(certificate, other.as_bytes(), None).contains("private key"));
    assert!(new(certificate, key, Some(b"x")).contains("clients"));
}
