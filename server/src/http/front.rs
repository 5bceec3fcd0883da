//! The server that answers a request.
//!
//! Several servers can share a database of PostgreSQL. One of them leads: it answers. The others pass each request on to the leader, body
//! and answer as streams. A request that finds no leader waits a moment for one.

mod body;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{ConnectInfo, Request, State};
use axum::http::uri::{Authority, PathAndQuery, Scheme};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Uri, Version, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use hyper::service::Service;
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::{TokioExecutor, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::sync::watch;
use tokio::time::{Instant, sleep, timeout, timeout_at};
use tokio_util::sync::CancellationToken;

use super::problem::{ApiError, ProblemKind};
use super::{meta, metrics, safety};
use body::{Lent, Relayed};

/// Maximum time that a request waits for a leader. A leader that stops has a successor within a few seconds. Tests wait for it.
const PATIENCE: Duration = Duration::from_secs(if cfg!(test) { 4 } else { 10 });

/// Wait before a leader that could not be reached is tried again.
const RETRY: Duration = Duration::from_millis(200);

/// Time for which `/readyz` waits: a probe has less patience than a client, usually 5 s.
const PROBE: Duration = Duration::from_secs(3);

/// Maximum time of an attempt to connect to the leader.
const CONNECT: Duration = Duration::from_secs(2);

/// Time for the answers of a leader after the end of its lead.
const LAST_ANSWERS: Duration = Duration::from_secs(3);

/// Time for the answers of the leader after this server was told to stop.
const LAST_RELAYS: Duration = Duration::from_secs(1);

/// Age at which an unused connection to the leader is closed. The leader closes one after 10 s.
const IDLE: Duration = Duration::from_secs(5);

/// Silence after which the system asks whether the leader's machine still has the connection.
const KEEPALIVE: Duration = Duration::from_secs(10);

/// Marks a request that a server has passed on. It is not passed on twice.
const PASSED_ON: HeaderName = HeaderName::from_static("roost-passed-on");

/// The clients and proxies that a request came from.
const FORWARDED_FOR: HeaderName = HeaderName::from_static("x-forwarded-for");

/// Headers of one connection, which are not passed on (RFC 9110, section 7.6.1).
const OF_CONNECTION: [HeaderName; 6] = [
    header::CONNECTION,
    header::TE,
    header::TRAILER,
    header::TRANSFER_ENCODING,
    header::UPGRADE,
    header::EXPECT,
];

/// Headers that are passed on even if `connection` names them.
const OF_REQUEST: [HeaderName; 4] =
    [header::HOST, header::AUTHORIZATION, header::COOKIE, header::CONTENT_LENGTH];

/// The `host` of a request without one. A leader without access tokens refuses it.
const NO_HOST: HeaderValue = HeaderValue::from_static("missing.invalid");

/// The server that answers requests.
#[derive(Clone)]
pub(crate) enum Role {
    /// This server.
    Leads(TowerToHyperService<Router>),
    /// The server at this host and port.
    PassesOn(Authority),
    /// Nobody that this server knows of. It says why, if it cannot lead or reach the leader.
    Waits(Option<Arc<str>>),
}

impl Role {
    /// The role beside a leader at this host and port; none if it is neither.
    pub(crate) fn passes_on(leader: &str) -> Option<Self> {
        leader.parse().ok().map(Self::PassesOn)
    }

    /// Whether both send a request to the same place.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::PassesOn(leader), Self::PassesOn(other)) => leader == other,
            (Self::Waits(reason), Self::Waits(other)) => reason == other,
            _ => false,
        }
    }

    /// Whether requests are passed on to this server.
    fn passes_on_to(&self, leader: &Authority) -> bool {
        matches!(self, Self::PassesOn(other) if other == leader)
    }
}

/// A router of all requests, which reads the present role. After `stop`, no request waits any more.
pub(crate) fn router(roles: watch::Receiver<Role>, stop: CancellationToken) -> Router {
    let mut connector = HttpConnector::new();
    connector.set_connect_timeout(Some(CONNECT));
    connector.set_nodelay(true);
    connector.set_keepalive(Some(KEEPALIVE));
    connector.set_keepalive_interval(Some(KEEPALIVE));
    connector.set_keepalive_retries(Some(2));
    #[cfg(target_os = "linux")]
    connector.set_tcp_user_timeout(Some(KEEPALIVE * 2));
    let client = Client::builder(TokioExecutor::new())
        .pool_timer(TokioTimer::new())
        .pool_idle_timeout(IDLE)
        .build(connector);
    Router::new().fallback(answer).with_state(Arc::new(Front { roles, stop, client }))
}

/// A request without an answer of the leader.
struct Unanswered {
    /// The request, if sending it again cannot do anything twice.
    again: Option<Request>,
    why: &'static str,
}

struct Front {
    roles: watch::Receiver<Role>,
    stop: CancellationToken,
    client: Client<HttpConnector, Lent>,
}

async fn answer(State(front): State<Arc<Front>>, mut request: Request) -> Response {
    let mut roles = front.roles.clone();
    let is_probe = request.uri().path() == "/readyz";
    let patience = if is_probe { PROBE } else { PATIENCE };
    let (mut deadline, mut was_silent) = (Instant::now() + patience, false);
    let mut reason = None;
    loop {
        let role = roles.borrow_and_update().clone();
        if let Role::Leads(router) = role {
            let method = request.method().clone();
            let response = router.call(request).await.unwrap_or_else(|never| match never {});
            return with_unknown_length(response, &method);
        }
        match request.uri().path() {
            "/healthz" if request.method().is_safe() => return own(meta::healthz().await),
            "/metrics" if request.method().is_safe() => return own(metrics::of_standby()),
            "/readyz" if matches!(role, Role::Waits(Some(_))) => deadline = Instant::now(),
            _ => {}
        }
        if let Role::Waits(Some(obstacle)) = &role {
            reason = Some(obstacle.clone());
        }
        if let Role::PassesOn(leader) = role
            && !request.headers().contains_key(PASSED_ON)
        {
            let began = Instant::now();
            let passed = front.pass_on(&leader, request);
            let passed = match is_probe {
                true => timeout(PROBE, passed)
                    .await
                    .unwrap_or(Err(Unanswered { again: None, why: "did not answer" })),
                false => passed.await,
            };
            match passed {
                Ok(response) => return response,
                Err(Unanswered { again, why }) => {
                    let why = format!("the leading server {why}: try again later").into();
                    let Some(again) = again else { return unavailable(Some(why)) };
                    (request, reason) = (again, Some(why));
                }
            }
            // The time with a leader that fell silent does not count. No request is the end of two leaders.
            if began.elapsed() > CONNECT * 2 {
                if was_silent {
                    return unavailable(reason);
                }
                was_silent = true;
                deadline = Instant::now() + PATIENCE;
            }
        }
        let has_changed = roles.has_changed().unwrap_or(false);
        if front.stop.is_cancelled() || Instant::now() >= deadline && !has_changed {
            return unavailable(reason);
        }
        // An unreachable leader may be back before another one leads.
        let change = timeout_at(deadline.min(Instant::now() + RETRY), roles.changed());
        let _ = front.stop.run_until_cancelled(change).await;
    }
}

impl Front {
    /// The answer of the leader.
    async fn pass_on(&self, leader: &Authority, request: Request) -> Result<Response, Unanswered> {
        let (parts, body) = request.into_parts();
        let lent = Lent::new(body);
        let mut sent = Request::from_parts(parts.clone(), lent.clone());
        let path = parts.uri.path_and_query().cloned().unwrap_or(PathAndQuery::from_static("/"));
        let target = Uri::builder().scheme(Scheme::HTTP).authority(leader.clone()).path_and_query(path);
        *sent.uri_mut() = target.build().expect("all parts are valid");
        *sent.version_mut() = Version::HTTP_11;
        let peer = parts.extensions.get::<ConnectInfo<SocketAddr>>();
        adapt(sent.headers_mut(), parts.uri.authority(), peer.map(|ConnectInfo(peer)| *peer));
        let is_unsent = tokio::select! {
            answered = self.client.request(sent) => match answered {
                Ok(response) => {
                    let (lead, stop) = (self.end_of(leader), self.end_of_relays());
                    let end = async move { tokio::select! { () = lead => {} () = stop => {} } };
                    return Ok(relay(response, &parts.method, end));
                }
                Err(error) => {
                    tracing::debug!(%error, %leader, "a request could not be passed on");
                    error.is_connect()
                }
            },
            () = self.end_of(leader) => false,
            () = self.end_of_relays() => false,
        };
        let again = if is_unsent || parts.method.is_safe() { lent.unread() } else { None };
        let again = again.map(|body| Request::from_parts(parts, body));
        Err(Unanswered { again, why: if is_unsent { "cannot be reached" } else { "did not answer" } })
    }

    /// Returns some time after the end of a lead. A leader that stopped in good order has answered by then.
    fn end_of(&self, leader: &Authority) -> impl Future<Output = ()> + Send + 'static {
        let (mut roles, leader) = (self.roles.clone(), leader.clone());
        async move {
            loop {
                if roles.wait_for(|role| !role.passes_on_to(&leader)).await.is_err() {
                    // This server stops.
                    return std::future::pending().await;
                }
                sleep(LAST_ANSWERS).await;
                // It may only have been out of sight.
                if !roles.borrow().passes_on_to(&leader) {
                    return;
                }
            }
        }
    }

    /// Returns some time after this server was told to stop.
    fn end_of_relays(&self) -> impl Future<Output = ()> + Send + 'static {
        let stop = self.stop.clone();
        async move {
            stop.cancelled().await;
            sleep(LAST_RELAYS).await;
        }
    }
}

/// The answer of a leader as one of this server.
fn relay(
    response: hyper::Response<hyper::body::Incoming>,
    method: &Method,
    end: impl Future<Output = ()> + Send + 'static,
) -> Response {
    let (mut parts, body) = response.into_parts();
    leave_out(&mut parts.headers);
    with_unknown_length(Response::from_parts(parts, Body::new(Relayed::new(body, end))), method)
}

/// An answer to HEAD has the length of another body in its headers, or none: axum would state that of the empty body.
fn with_unknown_length(response: Response, method: &Method) -> Response {
    match *method {
        Method::HEAD => response.map(|_| Body::from_stream(stream::empty::<Result<Bytes, axum::Error>>())),
        _ => response,
    }
}

/// Adapts the headers of a request that is passed on.
fn adapt(headers: &mut HeaderMap, authority: Option<&Authority>, peer: Option<SocketAddr>) {
    leave_out(headers);
    headers.insert(PASSED_ON, HeaderValue::from_static("1"));
    // A request in absolute form names its host there (RFC 9112, section 3.2.2).
    let host = authority.and_then(|authority| HeaderValue::try_from(authority.as_str()).ok());
    if let Some(host) = host {
        headers.insert(header::HOST, host);
    } else if !headers.contains_key(header::HOST) {
        headers.insert(header::HOST, NO_HOST);
    }
    if let Some(peer) = peer {
        let before = headers.get_all(FORWARDED_FOR).iter().filter_map(|value| value.to_str().ok());
        let all: Vec<String> = before.map(str::to_owned).chain([peer.ip().to_string()]).collect();
        let all = HeaderValue::try_from(all.join(", ")).expect("parts of a header, and an address");
        headers.insert(FORWARDED_FOR, all);
    }
}

/// Removes the headers of the connection, and those that it names.
fn leave_out(headers: &mut HeaderMap) {
    let named = headers.get_all(header::CONNECTION).iter().filter_map(|value| value.to_str().ok());
    let named = named.flat_map(|names| names.split(',')).filter_map(|name| name.trim().parse().ok());
    let named: Vec<HeaderName> = named.filter(|name| !OF_REQUEST.contains(name)).collect();
    for name in named.iter().chain(&OF_CONNECTION) {
        headers.remove(name);
    }
}

/// An answer of a server that does not lead.
fn own(answer: impl IntoResponse) -> Response {
    let mut response = answer.into_response();
    safety::protect(&mut response, false);
    response
}

/// An answer with the reason, as far as this server knows it.
fn unavailable(reason: Option<Arc<str>>) -> Response {
    let detail = reason.as_deref().unwrap_or("no server of this database leads now: try again later");
    let mut response = own(ApiError::new(ProblemKind::Unavailable, detail));
    response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
    response
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use axum::http::StatusCode;

    use super::*;

    async fn ask(roles: &watch::Receiver<Role>, request: axum::http::request::Builder) -> Response {
        let router = TowerToHyperService::new(router(roles.clone(), CancellationToken::new()));
        router.call(request.body(Body::from("document")).unwrap()).await.unwrap()
    }

    #[test]
    fn headers_of_the_connection_stay_and_the_peer_is_named_last() {
        let mut headers = HeaderMap::new();
        for (name, value) in [
            ("connection", "close, host, x-of-this-connection"),
            ("x-of-this-connection", "1"),
            ("transfer-encoding", "chunked"),
            ("authorization", "Bearer secret"),
            ("x-forwarded-for", "192.0.2.7"),
        ] {
            headers.append(name.parse::<HeaderName>().unwrap(), value.parse().unwrap());
        }
        adapt(&mut headers, None, Some("[2001:db8::9]:4242".parse().unwrap()));
        let left: Vec<_> =
            headers.iter().map(|(name, value)| (name.as_str(), value.to_str().unwrap())).collect();
        let expected = [
            ("authorization", "Bearer secret"),
            ("x-forwarded-for", "192.0.2.7, 2001:db8::9"),
            ("roost-passed-on", "1"),
            ("host", "missing.invalid"),
        ];
        assert_eq!(left.iter().collect::<BTreeSet<_>>(), expected.iter().collect());
        // A leader without tokens checks the host that the client has named.
        headers.insert(header::HOST, HeaderValue::from_static("localhost"));
        adapt(&mut headers, Some(&Authority::from_static("evil.example")), None);
        assert_eq!(headers[header::HOST], "evil.example");
    }

    #[tokio::test]
    async fn a_request_without_a_leader_waits_and_is_refused() {
        let (role, roles) = watch::channel(Role::Waits(None));
        let began = Instant::now();
        let refused = ask(&roles, Request::post("/v1/jobs")).await;
        assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE);
        assert_eq!(refused.headers()[header::RETRY_AFTER], "1");
        assert!(began.elapsed() >= PATIENCE, "{:?}", began.elapsed());
        // One that another server passed on waits too, and is not sent round in a circle.
        role.send_replace(Role::PassesOn(Authority::from_static("192.0.2.1:7373")));
        let refused = ask(&roles, Request::post("/v1/jobs").header(PASSED_ON, "1")).await;
        assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE);
        for (path, status) in [("/healthz", StatusCode::OK), ("/metrics", StatusCode::OK)] {
            assert_eq!(ask(&roles, Request::get(path)).await.status(), status, "{path}");
        }
    }

    #[tokio::test]
    async fn a_request_that_reached_no_leader_goes_to_the_next_one() {
        let gone = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap().local_addr().unwrap();
        let leader = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address: Authority = leader.local_addr().unwrap().to_string().parse().unwrap();
        let echo = Router::new()
            .fallback(async |method: Method, uri: Uri, body: String| format!("{method} {uri} {body}"));
        tokio::spawn(async move { axum::serve(leader, echo).await });
        let (role, roles) = watch::channel(Role::PassesOn(gone.to_string().parse().unwrap()));
        let change = async {
            tokio::time::sleep(RETRY * 2).await;
            role.send_replace(Role::PassesOn(address));
        };
        let (answer, ()) = tokio::join!(ask(&roles, Request::post("/v1/jobs?dry_run=true")), change);
        assert_eq!(answer.status(), StatusCode::OK);
        let body = axum::body::to_bytes(answer.into_body(), 1000).await.unwrap();
        assert_eq!(body, "POST /v1/jobs?dry_run=true document");
    }
}
