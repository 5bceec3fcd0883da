//! https: the command and workers behind a proxy that speaks TLS, as a reverse proxy in front of a server does.

mod support;

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
        let authority_key = KeyPair::generate().unwrap();
        let mut authority = CertificateParams::new(Vec::new()).unwrap();
        authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let pem = authority.self_signed(&authority_key).unwrap().pem();
        let key = KeyPair::generate().unwrap();
        let names = CertificateParams::new(vec!["localhost".to_owned()]).unwrap();
        let certificate = names.signed_by(&key, &Issuer::new(authority, authority_key)).unwrap();
        let key = PrivateKeyDer::try_from(key.serialize_der()).unwrap();
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

    let stranger = support::run(&["list", "--server", &front.address]);
    assert!(said(&stranger).contains("certificate"), "{}", said(&stranger));
    assert_ne!(stranger.status.code(), Some(0));
    let other = home.path("other.pem");
    std::fs::write(&other, Front::of(&home.address).authority).unwrap();
    let other = other.display().to_string();
    let stranger = support::run(&["list", "--server", &front.address, "--ca", &other]);
    assert!(said(&stranger).contains("certificate"), "{}", said(&stranger));
    std::fs::write(&other, "no certificate").unwrap();
    let nothing = support::run(&["list", "--server", &front.address, "--ca", &other]);
    assert!(said(&nothing).contains("BEGIN CERTIFICATE"), "{}", said(&nothing));
}
