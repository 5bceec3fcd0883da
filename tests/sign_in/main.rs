//! Sign-in with a real identity provider, by HTTP alone. `tests/browser/sign_in.rs` does it in a browser.

#[path = "../support/mod.rs"]
mod support;
mod visitor;

use std::sync::Arc;
use std::time::{Duration, Instant};

use rcgen::{CertificateParams, KeyPair};
use reqwest::Method;
use serde_json::{Value, json};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::pki_types::PrivateKeyDer;

use support::provider::{CLIENT_SECRET, Provider};
use support::{Process, Sandbox, run, stdout, wait_until};
use visitor::{Page, Visitor};

/// A server with sign-in, and its provider.
struct Site {
    sandbox: Sandbox,
    provider: Provider,
}

impl Site {
    fn new() -> Self {
        let sandbox = Sandbox::new();
        let provider = Provider::start(&sandbox.address);
        Self { sandbox, provider }
    }

    /// Starts the server with rules and further options.
    fn serve(&self, options: &[&str]) -> Process {
        let own = self.provider.options(&self.sandbox.address, &self.sandbox.path("secret"));
        // Each option once: one of the test takes the place of the usual one.
        let own = own.chunks(2).filter(|own| !options.contains(&own[0].as_str()));
        let own: Vec<_> = own.flatten().map(String::as_str).collect();
        let server = self
            .sandbox
            .spawn_server(&[&own[..], &["--log-format", "json", "--lease-s", "2"], options].concat());
        wait_until("the server answers", || self.sandbox.status("/healthz").filter(|status| *status == 200));
        server
    }

    fn at(&self, path: &str) -> String {
        format!("{}{path}", self.sandbox.address)
    }

    /// Begins a sign-in. Returns the address at the provider.
    fn begin(&self, visitor: &mut Visitor) -> String {
        let page = visitor.get(&self.at("/dashboard/sign-in"));
        assert_eq!(page.status, 303, "{}", page.text);
        page.location.unwrap()
    }

    /// Signs in up to the answer of the callback.
    fn sign_in(&self, visitor: &mut Visitor, user: &str) -> Page {
        let address = self.begin(visitor);
        let back = visitor.answer(&address, user, "accept");
        visitor.get(&back)
    }

    fn tokens(&self) -> Vec<Value> {
        let data = self.sandbox.path("data").display().to_string();
        serde_json::from_str(&stdout(&run(&["token", "list", "--json", "--data", &data]))).unwrap()
    }
}

fn audit_lines(server: &Process, action: &str) -> Vec<Value> {
    let log = server.log();
    let lines = log.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    lines.filter(|line| line["target"] == "audit" && line["action"] == action).collect()
}

#[test]
fn sessions_of_a_user_share_a_token_and_end_alone() {
    let site = Site::new();
    let server = site.serve(&["--oidc-allow", "scientists=default:submit"]);
    let mut laptop = Visitor::new();
    assert_eq!(laptop.get(&site.at("/v1/jobs")).status, 401, "a server with sign-in is not open");
    let shown = laptop.get(&site.at("/dashboard/session")).text;
    let host = site.provider.issuer.trim_start_matches("http://");
    assert_eq!(serde_json::from_str::<Value>(&shown).unwrap(), json!({"provider": host, "session": null}));

    let address = site.begin(&mut laptop);
    let attempt = laptop.cookie(&site.sandbox.address, "roost_sign_in").unwrap();
    let back = laptop.answer(&address, "ada", "accept");
    // The browser says that a page of another site leads here.
    let page = laptop.send(Method::GET, &back, &[("sec-fetch-site", "cross-site")], None);
    assert!(page.status == 200 && page.text.contains("content=\"0; url=/\""), "{}", page.text);
    let session = page.cookies.iter().find(|cookie| cookie.starts_with("roost_session=roost_")).unwrap();
    for attribute in ["HttpOnly", "SameSite=Strict", "Path=/", "Max-Age=43200"] {
        assert!(session.contains(attribute), "{attribute}: {session}");
    }
    assert!(page.cookies.iter().any(|cookie| cookie.starts_with("roost_sign_in=;")), "{:?}", page.cookies);
    assert_eq!(laptop.get(&site.at("/v1/jobs")).status, 200, "at once");
    let shown: Value = serde_json::from_str(&laptop.get(&site.at("/dashboard/session")).text).unwrap();
    assert_eq!(shown["session"], json!({"user": "ada@lab.example", "project": "default"}));

    // The same code a second time, with the cookie that the browser has forgotten.
    let sent = format!("roost_sign_in={attempt}");
    let again = Visitor::new().send(Method::GET, &back, &[("cookie", &sent)], None);
    assert!(
        again.status == 400 && again.text.contains("was used before"),
        "{}: {}",
        again.status,
        again.text
    );

    let mut desk = Visitor::new();
    assert_eq!(site.sign_in(&mut desk, "ada").status, 200);
    assert_eq!(laptop.get(&site.at("/v1/jobs")).status, 200, "the second sign-in ends no other session");
    let tokens = site.tokens();
    assert_eq!(tokens.len(), 1, "one token, so one owner with turns: {tokens:?}");
    assert_eq!(tokens[0]["user"], "ada@lab.example");
    assert!(tokens[0]["expires_at"].is_string() && tokens[0]["scopes"] == json!(["submit"]), "{tokens:?}");

    let foreign = laptop.send(
        Method::DELETE,
        &site.at("/dashboard/session"),
        &[("sec-fetch-site", "cross-site")],
        None,
    );
    assert_eq!(foreign.status, 403, "a page of another site ends no session");
    let secret = laptop.cookie(&site.sandbox.address, "roost_session").unwrap();
    assert_eq!(laptop.send(Method::DELETE, &site.at("/dashboard/session"), &[], None).status, 204);
    let kept = format!("roost_session={secret}");
    let after = Visitor::new().send(Method::GET, &site.at("/v1/jobs"), &[("cookie", &kept)], None);
    assert!(after.status == 401, "the secret is invalid after the sign-out, not only forgotten");
    assert_eq!(desk.get(&site.at("/v1/jobs")).status, 200, "the other browser is still signed in");

    for (action, count) in [("sign_in", 2), ("sign_out", 1), ("refuse", 4)] {
        let lines = audit_lines(&server, action);
        assert_eq!(lines.len(), count, "{action}: {lines:?}");
        for line in lines.iter().filter(|_| action != "refuse") {
            assert_eq!(line["user"], "ada@lab.example", "{line}");
            assert!(line["project"] == "default" && line["token"] == tokens[0]["id"], "{line}");
        }
    }
    let log = server.log();
    let code = back.split("code=").nth(1).unwrap().split('&').next().unwrap();
    for secret in [
        &secret,
        code,
        &attempt,
        CLIENT_SECRET,
        &desk.cookie(&site.sandbox.address, "roost_session").unwrap(),
    ] {
        assert!(!log.contains(secret), "the log has a secret: {secret}");
    }

    // The operator ends all sessions of a user.
    let data = site.sandbox.path("data").display().to_string();
    stdout(&run(&["token", "revoke", "--data", &data, tokens[0]["id"].as_str().unwrap()]));
    wait_until("the session has ended", || (desk.get(&site.at("/v1/jobs")).status == 401).then_some(()));
}

#[test]
fn a_refused_sign_in_says_why() {
    let site = Site::new();
    let server = site.serve(&["--oidc-allow", "scientists=default:submit", "--oidc-session", "10s"]);
    let refused = |page: &Page, status: u16, parts: &[&str]| {
        assert_eq!(page.status, status, "{}", page.text);
        assert!(parts.iter().all(|part| page.text.contains(part)), "{parts:?}: {}", page.text);
        assert!(!page.cookies.iter().any(|cookie| cookie.starts_with("roost_session")), "{:?}", page.cookies);
    };
    let mut ada = Visitor::new();
    let address = site.begin(&mut ada);
    let back = ada.answer(&address, "ada", "deny");
    refused(&ada.get(&back), 403, &["cancelled"]);
    let address = site.begin(&mut ada);
    let back = ada.answer(&address, "ada", "accept");
    refused(&Visitor::new().get(&back), 400, &["another browser"]);
    let state = back.split("state=").nth(1).unwrap().split('&').next().unwrap().to_owned();
    let other_state = back.replace(&state, &"0".repeat(64));
    let mut twin = Visitor::new();
    twin.jar = ada.jar.clone();
    refused(&twin.get(&other_state), 400, &["another browser"]);
    assert_eq!(ada.get(&back).status, 200, "the refusals have used nothing up");
    // A code of another sign-in of the same user has another nonce and another verifier.
    let address = site.begin(&mut ada);
    let foreign = address.replace("nonce=", "nonce=0");
    let back = ada.answer(&foreign, "ada", "accept");
    refused(&ada.get(&back), 502, &["nonce"]);
    let address = site.begin(&mut ada);
    let back = ada.answer(&address.replace("code_challenge=", "code_challenge=0"), "ada", "accept");
    refused(&ada.get(&back), 400, &["was used before"]);

    refused(&site.sign_in(&mut Visitor::new(), "bob"), 403, &["No rule", "named no group", "--oidc-allow"]);

    // The session expires, and the user of an unverified address has another name.
    let mut eve = Visitor::new();
    assert_eq!(site.sign_in(&mut eve, "eve").status, 200);
    let shown: Value = serde_json::from_str(&eve.get(&site.at("/dashboard/session")).text).unwrap();
    assert_eq!(shown["session"]["user"], "unverified", "the preferred name, not the address");
    let expired = wait_until("the session expires", || {
        Some(eve.get(&site.at("/v1/jobs"))).filter(|page| page.status == 401)
    });
    assert!(expired.text.contains("the session expired"), "{}", expired.text);
    server.terminate();
    server.wait();

    // Another client, whose ID tokens are for the first one, and a wrong secret.
    let allow = ["--oidc-allow", "*=default:read"];
    let server = site.serve(&[&allow[..], &["--oidc-client-id", "other"]].concat());
    refused(&site.sign_in(&mut Visitor::new(), "ada"), 502, &["another client"]);
    server.terminate();
    server.wait();
    let wrong = site.sandbox.path("wrong").display().to_string();
    std::fs::write(&wrong, "wrong").unwrap();
    let server = site.serve(&[&allow[..], &["--oidc-client-secret-file", &wrong]].concat());
    refused(&site.sign_in(&mut Visitor::new(), "ada"), 502, &["--oidc-client-secret-file"]);
    server.terminate();
    server.wait();
    // A project that does not exist yet.
    let server = site.serve(&["--oidc-allow", "scientists=wax:submit"]);
    refused(&site.sign_in(&mut Visitor::new(), "ada"), 500, &["project wax does not exist"]);
    assert!(server.log().contains("names a project that does not exist"), "at the start too");
}

#[test]
fn a_user_who_has_lost_a_group_loses_the_sessions_too() {
    let site = Site::new();
    let server = site.serve(&["--oidc-allow", "scientists=default:submit"]);
    let (mut laptop, mut desk) = (Visitor::new(), Visitor::new());
    assert_eq!(site.sign_in(&mut laptop, "ada").status, 200);
    let lines = audit_lines(&server, "sign_in");
    assert_eq!(lines[0]["scopes"], "submit", "{lines:?}");
    server.terminate();
    server.wait();
    let server = site.serve(&["--oidc-allow", "staff=default:read"]);
    let jobs = site.at("/v1/jobs");
    assert_eq!(laptop.get(&jobs).status, 200, "sessions outlive the server");
    let page = site.sign_in(&mut desk, "ada");
    assert!(page.status == 403 && page.text.contains("No rule"), "{}: {}", page.status, page.text);
    assert_eq!(laptop.get(&jobs).status, 401, "at once");
    let lines = audit_lines(&server, "refuse");
    let line = lines.iter().find(|line| line["status"] == 403).unwrap_or_else(|| panic!("{lines:?}"));
    assert_eq!(line["user"], "ada@lab.example", "{line}");
    assert!(line["identity"].as_str().unwrap().starts_with(&site.provider.issuer), "{line}");
}

#[test]
fn over_https_cookies_belong_to_this_host_alone() {
    let site = Site::new();
    let _server = site.serve(&["--oidc-allow", "*=default:read", "--oidc-redirect", "https://roost.example"]);
    let mut visitor = Visitor::new();
    let begin = site.at("/dashboard/sign-in");
    let foreign = visitor.send(Method::GET, &begin, &[("sec-fetch-site", "cross-site")], None);
    assert!(foreign.status == 403 && foreign.cookies.is_empty(), "{}: {}", foreign.status, foreign.text);
    let page = visitor.get(&begin);
    let cookie = |page: &Page, name: &str, parts: &[&str]| {
        let found = page.cookies.iter().find(|cookie| cookie.starts_with(&format!("{name}=")));
        let cookie = found.unwrap_or_else(|| panic!("{name}: {:?}", page.cookies));
        assert!(parts.iter().all(|part| cookie.contains(part)), "{parts:?}: {cookie}");
    };
    cookie(&page, "__Host-roost_sign_in", &["; Secure", "; Path=/;", "; HttpOnly", "SameSite=Lax"]);
    let back = visitor.answer(&page.location.unwrap(), "ada", "accept");
    let back = back.replace("https://roost.example", &site.sandbox.address);
    assert_eq!(visitor.send(Method::HEAD, &back, &[], None).status, 405, "the attempt is not used up");
    let page = visitor.get(&back);
    assert_eq!(page.status, 200, "{}", page.text);
    cookie(&page, "__Host-roost_session", &["; Secure", "; Path=/;", "; HttpOnly", "SameSite=Strict"]);
    let jobs = site.at("/v1/jobs");
    assert_eq!(visitor.get(&jobs).status, 200);
    let secret = visitor.cookie(&site.sandbox.address, "__Host-roost_session").unwrap();
    let planted = format!("roost_session={secret}");
    let other = Visitor::new().send(Method::GET, &jobs, &[("cookie", &planted)], None);
    assert_eq!(other.status, 401, "another host of the domain can plant the plain name");
}

#[test]
fn a_server_works_while_its_provider_is_away() {
    let site = Site::new();
    let data = site.sandbox.path("data").display().to_string();
    let token = stdout(&run(&["token", "create", "--scope", "submit", "--data", &data]));
    let bearer = format!("Bearer {}", token.trim());
    let authorized = [("authorization", bearer.as_str())];
    // A port that accepts connections and does not answer, and one that nobody listens on.
    let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let silent_at = silent.local_addr().unwrap();
    for (issuer, parts, at_least) in [
        ("http://127.0.0.1:1/".to_owned(), ["does not answer", "Tokens still work"], 0),
        (format!("http://{silent_at}"), ["does not answer", "Try again later"], 9),
    ] {
        let server = site.serve(&["--oidc-allow", "*=default:read", "--oidc-issuer", &issuer]);
        let mut visitor = Visitor::new();
        let began = Instant::now();
        let page = visitor.get(&site.at("/dashboard/sign-in"));
        assert_eq!(page.status, 503, "{}", page.text);
        assert!(parts.iter().all(|part| page.text.contains(part)), "{}", page.text);
        assert!(began.elapsed() >= Duration::from_secs(at_least), "{:?}", began.elapsed());
        // The failure holds for some seconds: nobody makes the server call the provider again and again.
        let began = Instant::now();
        assert_eq!(visitor.get(&site.at("/dashboard/sign-in")).status, 503);
        assert!(began.elapsed() < Duration::from_secs(9), "{:?}", began.elapsed());
        let began = Instant::now();
        let invented = site.at("/dashboard/sign-in/callback?code=c&state=0000");
        assert_eq!(visitor.get(&invented).status, 400, "refused before any call of the provider");
        assert!(began.elapsed() < Duration::from_secs(9), "{:?}", began.elapsed());
        let job = visitor.send(Method::GET, &site.at("/v1/jobs"), &authorized, None);
        assert_eq!(job.status, 200, "tokens still work");
        server.terminate();
        server.wait();
    }
    drop(silent);
}

/// A port that shows a certificate of no authority, for as long as the runtime lives.
fn untrusted() -> (u16, tokio::runtime::Runtime) {
    let key = KeyPair::generate().unwrap();
    let own = CertificateParams::new(vec!["localhost".to_owned()]).unwrap().self_signed(&key).unwrap();
    let config = ServerConfig::builder().with_no_client_auth();
    let key = PrivateKeyDer::try_from(key.serialize_der()).unwrap();
    let config = config.with_single_cert(vec![own.der().clone()], key).unwrap();
    let acceptor = TlsAcceptor::from(Arc::new(config));
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let listener = runtime.block_on(tokio::net::TcpListener::bind("127.0.0.1:0")).unwrap();
    let port = listener.local_addr().unwrap().port();
    runtime.spawn(async move {
        while let Ok((client, _)) = listener.accept().await {
            // The server disconnects here.
            let _ = acceptor.accept(client).await;
        }
    });
    (port, runtime)
}

#[test]
fn a_provider_with_an_untrusted_certificate_is_named_as_such() {
    let site = Site::new();
    let (port, _runtime) = untrusted();
    let issuer = format!("https://localhost:{port}");
    let server = site.serve(&["--oidc-allow", "*=default:read", "--oidc-issuer", &issuer]);
    let page = Visitor::new().get(&site.at("/dashboard/sign-in"));
    assert!(page.status == 502 && page.text.contains("is not trusted"), "{}: {}", page.status, page.text);
    let lines = audit_lines(&server, "refuse");
    assert!(lines[0]["cause"].as_str().unwrap().contains("certificate"), "{lines:?}");
}

#[test]
fn wrong_options_are_named_all_at_once() {
    let output =
        run(&["serve", "--oidc-issuer", "http://idp.example", "--oidc-allow", "x", "--oidc-session", "1y"]);
    assert_eq!(output.status.code(), Some(1), "{}", support::transcript(&output));
    let text = String::from_utf8(output.stderr).unwrap();
    for part in [
        "--oidc-issuer",
        "--oidc-client-id",
        "--oidc-client-secret-file",
        "--oidc-redirect",
        "--oidc-allow \"x\"",
        "--oidc-session \"1y\"",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
}
