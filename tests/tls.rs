//! https: the command and workers behind a proxy that speaks TLS, as a reverse proxy in front of a server does.

mod support;

use std::io::{Read, Write};
use std::process::Command;
use std::sync::Arc;

use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};
use roost_api::job::JobState;
use support::{Home, said, scenario, stdout};
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::pki_types::PrivateKeyDer;

/// A certificate of an authority of its own, and a listener with one for `localhost` that passes everything on.
struct Front {
    address: String,
    authority: String,
    _runtime: tokio::runtime::Runtime,
}

impl Front {
    fn of(server: &str) -> Self {
        Self::with(server, false)
    }

    /// The same; where asked to, it shows the certificate of the authority as its own.
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
                    // Who does not trust us breaks off here.
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
fn a_command_and_a_worker_reach_a_server_behind_tls() {
    let home = Home::new();
    let _server = home.serve();
    let front = Front::of(&home.address);
    let ca = home.path("ca.pem");
    std::fs::write(&ca, &front.authority).unwrap();
    let ca = ca.display().to_string();

    let job = home.submit(&scenario(0.02));
    let mut far = Home::new();
    far.address.clone_from(&front.address);
    let worker = far.work_with("far", &["--ca", &ca]);
    home.job_when(&job, "a result", |job| job.state == JobState::Succeeded);
    worker.terminate();
    let id = job.id.to_string();
    let shown = support::run(&["status", &id, "--server", &front.address, "--ca", &ca, "--json"]);
    assert!(stdout(&shown).contains("succeeded"), "{}", said(&shown));
}

/// Fails unless `roost list` ends with this exit code, and says all of the words but never that the address is none.
fn assert_says(command: &mut Command, code: i32, words: &[&str]) {
    let output = command.output().unwrap();
    let text = said(&output);
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
fn a_wrong_set_up_of_https_says_what_is_wrong_and_what_to_do() {
    let home = Home::new();
    let _server = home.serve();
    let front = Front::of(&home.address);
    let (ca, other) = (home.path("ca.pem"), home.path("other.pem"));
    std::fs::write(&ca, &front.authority).unwrap();
    std::fs::write(&other, Front::of(&home.address).authority).unwrap();
    let (ca, other) = (ca.display().to_string(), other.display().to_string());
    stdout(&list(&front.address, &["--ca", &ca]).output().unwrap());

    // Certificates that cannot be checked.
    let untrusted = ["an authority that is not trusted", "--ca FILE"];
    assert_says(&mut list(&front.address, &[]), 1, &untrusted);
    assert_says(&mut list(&front.address, &["--ca", &other]), 1, &untrusted);
    let mut slim = list(&front.address, &[]);
    let slim = slim.env("SSL_CERT_FILE", home.path("none")).env("SSL_CERT_DIR", home.path("none"));
    assert_says(slim, 1, &["No CA certificates", "ca-certificates", "--ca FILE"]);
    let number = front.address.replace("localhost", "127.0.0.1");
    assert_says(
        &mut list(&number, &["--ca", &ca]),
        1,
        &["127.0.0.1", "localhost", "a name that the certificate has"],
    );
    let itself = Front::with(&home.address, true);
    std::fs::write(&other, &itself.authority).unwrap();
    let words = ["an authority's own certificate", "signed by it"];
    assert_says(&mut list(&itself.address, &["--ca", &other]), 1, &words);

    // Files of authorities that are none.
    std::fs::write(&other, "no certificate").unwrap();
    let words = [&other, "--ca", "no `-----BEGIN CERTIFICATE-----`"];
    assert_says(&mut list(&front.address, &["--ca", &other]), 2, &words);
    std::fs::write(&other, "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n").unwrap();
    assert_says(&mut list(&front.address, &["--ca", &other]), 2, &["--ca", "cannot be used"]);
    let absent = home.path("absent.pem").display().to_string();
    assert_says(&mut list(&front.address, &["--ca", &absent]), 2, &[&absent, "--ca", "No such file"]);

    // The wrong one of two protocols.
    let plain = home.address.replace("http://127.0.0.1", "https://localhost");
    assert_says(&mut list(&plain, &["--ca", &ca]), 1, &["not TLS", "http://"]);
    let encrypted = front.address.replace("https://", "http://");
    assert_says(&mut list(&encrypted, &[]), 1, &["not HTTP", "https://"]);
}

#[test]
fn a_port_that_wants_https_is_named_when_it_answers_in_plain_http() {
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
    // As nginx does on its TLS port, and as most do on port 80.
    let nginx =
        answering("400 Bad Request", "<title>400 The plain HTTP request was sent to HTTPS port</title>");
    assert_says(&mut list(&nginx, &[]), 1, &["sent to HTTPS port", "write the address with https://"]);
    let front = answering("301 Moved Permanently\r\nlocation: https://roost.example/v1/sweeps?limit=20", "");
    assert_says(&mut list(&front, &[]), 1, &["redirects to https://roost.example/", "give the address"]);
}
