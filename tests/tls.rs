//! Commands and workers over https, with a reverse proxy in front of the server.

mod support;

use std::io::{Read, Write};
use std::process::Command;
use std::sync::Arc;

use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};
use roost_api::job::JobState;
use support::{Sandbox, hopper_scenario, stdout, transcript};
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::pki_types::PrivateKeyDer;

/// A TLS proxy for `localhost` with a certificate of its own authority.
struct Front {
    address: String,
    authority: String,
    _runtime: tokio::runtime::Runtime,
}

impl Front {
    fn of(server: &str) -> Self {
        Self::with(server, false)
    }

    /// A proxy that presents the certificate of the authority itself if `is_itself`.
    fn with(server: &str, is_itself: bool) -> Self {
        let authority_key = KeyPair::generate().unwrap();
        let mut authority = CertificateParams::new(vec!["localhost".to_owned()]).unwrap();
        authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let own = authority.self_signed(&authority_key).unwrap();
        let pem = own.pem();
        let key = KeyPair::generate().unwrap();
        let names = CertificateParams::new(vec!["localhost".to_owned()]).unwrap();
        let own_key = authority_key.serialize_der();
        let signed = names.signed_by(&key, &Issuer::new(authority, authority_key)).unwrap();
        let (certificate, key) = if is_itself { (own, own_key) } else { (signed, key.serialize_der()) };
        let key = PrivateKeyDer::try_from(key).unwrap();
        roost_worker::client::prepare_tls();
        let config = ServerConfig::builder().with_no_client_auth();
        let config = config.with_single_cert(vec![certificate.der().clone()], key).unwrap();
        let acceptor = TlsAcceptor::from(Arc::new(config));

        let runtime = tokio::runtime::Runtime::new().unwrap();
        let listener = runtime.block_on(TcpListener::bind("127.0.0.1:0")).unwrap();
        let port = listener.local_addr().unwrap().port();
        let server = server.trim_start_matches("http://").to_owned();
        runtime.spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                let (acceptor, server) = (acceptor.clone(), server.clone());
                tokio::spawn(async move {
                    // Clients that do not trust the certificate disconnect here.
                    let Ok(mut client) = acceptor.accept(client).await else { return };
                    let mut server = TcpStream::connect(server).await.unwrap();
                    let _ = tokio::io::copy_bidirectional(&mut client, &mut server).await;
                });
            }
        });
        Self { address: format!("https://localhost:{port}"), authority: pem, _runtime: runtime }
    }
}

#[test]
fn command_and_worker_reach_a_server_behind_tls() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let front = Front::of(&sandbox.address);
    let ca = sandbox.path("ca.pem");
    std::fs::write(&ca, &front.authority).unwrap();
    let ca = ca.display().to_string();

    let job = sandbox.submit(&hopper_scenario(0.02));
    let mut far = Sandbox::new();
    far.address.clone_from(&front.address);
    let worker = far.start_worker_with("far", &["--ca", &ca]);
    sandbox.wait_for_job(&job, "a result", |job| job.state == JobState::Succeeded);
    worker.terminate();
    let id = job.id.to_string();
    let shown = support::run(&["status", &id, "--server", &front.address, "--ca", &ca, "--json"]);
    assert!(stdout(&shown).contains("succeeded"), "{}", transcript(&shown));
}

/// Fails unless the command has this exit code and prints all words, without an error about the address.
fn assert_says(command: &mut Command, code: i32, words: &[&str]) {
    let output = command.output().unwrap();
    let text = transcript(&output);
    assert_eq!(output.status.code(), Some(code), "{text}");
    assert!(!text.contains("is not a server address"), "{text}");
    for word in words {
        assert!(text.contains(word), "no `{word}` in {text}");
    }
}

fn list(server: &str, more: &[&str]) -> Command {
    let mut command = support::roost();
    command.args(["list", "--server", server]).args(more).env_remove("ROOST_CA");
    command
}

#[test]
fn wrong_https_setup_is_reported_with_advice() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let front = Front::of(&sandbox.address);
    let (ca, other) = (sandbox.path("ca.pem"), sandbox.path("other.pem"));
    std::fs::write(&ca, &front.authority).unwrap();
    std::fs::write(&other, Front::of(&sandbox.address).authority).unwrap();
    let (ca, other) = (ca.display().to_string(), other.display().to_string());
    stdout(&list(&front.address, &["--ca", &ca]).output().unwrap());

    // Certificates of an unknown authority.
    let untrusted = ["an authority that is not trusted", "--ca FILE"];
    assert_says(&mut list(&front.address, &[]), 1, &untrusted);
    assert_says(&mut list(&front.address, &["--ca", &other]), 1, &untrusted);
    let mut slim = list(&front.address, &[]);
    let slim = slim.env("SSL_CERT_FILE", sandbox.path("none")).env("SSL_CERT_DIR", sandbox.path("none"));
    assert_says(slim, 1, &["No CA certificates", "ca-certificates", "--ca FILE"]);
    let number = front.address.replace("localhost", "127.0.0.1");
    assert_says(
        &mut list(&number, &["--ca", &ca]),
        1,
        &["127.0.0.1", "localhost", "a name that the certificate has"],
    );
    let itself = Front::with(&sandbox.address, true);
    std::fs::write(&other, &itself.authority).unwrap();
    let words = ["an authority's own certificate", "signed by it"];
    assert_says(&mut list(&itself.address, &["--ca", &other]), 1, &words);

    // Files without a certificate.
    std::fs::write(&other, "no certificate").unwrap();
    let words = [&other, "--ca", "no `-----BEGIN CERTIFICATE-----`"];
    assert_says(&mut list(&front.address, &["--ca", &other]), 2, &words);
    std::fs::write(&other, "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n").unwrap();
    assert_says(&mut list(&front.address, &["--ca", &other]), 2, &["--ca", "cannot be used"]);
    let absent = sandbox.path("absent.pem").display().to_string();
    assert_says(&mut list(&front.address, &["--ca", &absent]), 2, &[&absent, "--ca", "No such file"]);

    // The wrong protocol.
    let plain = sandbox.address.replace("http://127.0.0.1", "https://localhost");
    assert_says(&mut list(&plain, &["--ca", &ca]), 1, &["not TLS", "http://"]);
    let encrypted = front.address.replace("https://", "http://");
    assert_says(&mut list(&encrypted, &[]), 1, &["not HTTP", "https://"]);
}

#[test]
fn https_port_is_recognised_in_a_plain_http_response() {
    let answering = |head: &str, body: &str| {
        let length = body.len();
        let answer =
            format!("HTTP/1.1 {head}\r\ncontent-length: {length}\r\nconnection: close\r\n\r\n{body}");
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let mut request = [0; 4096];
            assert_ne!(stream.read(&mut request).unwrap(), 0);
            stream.write_all(answer.as_bytes()).unwrap();
        });
        address
    };
    // Like nginx on its TLS port, and most servers on port 80.
    let nginx =
        answering("400 Bad Request", "<title>400 The plain HTTP request was sent to HTTPS port</title>");
    assert_says(&mut list(&nginx, &[]), 1, &["sent to HTTPS port", "write the address with https://"]);
    let front = answering("301 Moved Permanently\r\nlocation: https://roost.example/v1/sweeps?limit=20", "");
    assert_says(&mut list(&front, &[]), 1, &["redirects to https://roost.example/", "give the address"]);
}
