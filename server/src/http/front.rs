//! Which server answers a request.
//!
//! Several servers can share a database of PostgreSQL. One of them leads: it answers. The others pass each request on to the leader, body
//! and answer as streams. A request that finds no leader waits a moment for one.

use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{ConnectInfo, Request, State};
use axum::http::uri::{Authority, PathAndQuery, Scheme};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Uri, header};
use axum::response::{IntoResponse, Response};
use hyper::body::{Frame, SizeHint};
use hyper::service::Service;
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::{TokioExecutor, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::sync::watch;
use tokio::time::{Instant, timeout_at};

use super::problem::{ApiError, ProblemKind};
use super::{meta, metrics, safety};

/// Maximum time that a request waits for a leader. A leader that stops has a successor within two seconds. Tests wait for it.
const PATIENCE: Duration = Duration::from_secs(if cfg!(test) { 1 } else { 10 });

/// Wait before a leader that could not be reached is tried again.
const RETRY: Duration = Duration::from_millis(200);

/// Maximum time of an attempt to connect to the leader.
const CONNECT: Duration = Duration::from_secs(2);

/// Time for the answers of a leader after the end of its lead.
const LAST_ANSWERS: Duration = Duration::from_secs(3);

/// Age at which an unused connection to the leader is closed. The leader closes one after 10 s.
const IDLE: Duration = Duration::from_secs(5);

/// Marks a request that a server has passed on. It is not passed on twice.
const PASSED_ON: HeaderName = HeaderName::from_static("roost-passed-on");

/// The peer that a proxy names.
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

/// Who answers requests.
#[derive(Clone)]
pub(crate) enum Role {
    /// This server.
    Leads(TowerToHyperService<Router>),
    /// The server at this host and port.
    PassesOn(Authority),
    /// Nobody, for this reason.
    Waits(String),
}

impl Role {
    /// Whether both send a request to the same place.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::PassesOn(leader), Self::PassesOn(other)) => leader == other,
            (Self::Waits(reason), Self::Waits(other)) => reason == other,
            _ => false,
        }
    }
}

/// A router of all requests, which reads the present role.
pub(crate) fn router(roles: watch::Receiver<Role>) -> Router {
    let mut connector = HttpConnector::new();
    connector.set_connect_timeout(Some(CONNECT));
    connector.set_nodelay(true);
    let client = Client::builder(TokioExecutor::new())
        .pool_timer(TokioTimer::new())
        .pool_idle_timeout(IDLE)
        .build(connector);
    Router::new().fallback(answer).with_state(Arc::new(Front { roles, client }))
}

struct Front {
    roles: watch::Receiver<Role>,
    client: Client<HttpConnector, Lent>,
}

async fn answer(State(front): State<Arc<Front>>, mut request: Request) -> Response {
    let mut roles = front.roles.clone();
    let deadline = Instant::now() + PATIENCE;
    loop {
        let role = roles.borrow_and_update().clone();
        let reason = match role {
            Role::Leads(router) => {
                return router.call(request).await.unwrap_or_else(|never| match never {});
            }
            _ if request.uri().path() == "/healthz" => return own(meta::healthz().await),
            _ if request.uri().path() == "/metrics" => return own(metrics::of_standby()),
            Role::PassesOn(leader) if request.headers().contains_key(PASSED_ON) => {
                format!("the server that passed this request on does not know yet that {leader} leads")
            }
            Role::PassesOn(leader) => match front.pass_on(&leader, request).await {
                Ok(response) => return response,
                Err(Failure { again: Some(unsent), reason }) => {
                    request = unsent;
                    reason
                }
                Err(Failure { again: None, reason }) => return unavailable(&reason),
            },
            Role::Waits(reason) => reason,
        };
        if Instant::now() >= deadline {
            return unavailable(&reason);
        }
        // An unreachable leader may be back before another one leads.
        let _ = timeout_at(deadline.min(Instant::now() + RETRY), roles.changed()).await;
    }
}

/// A request without an answer of the leader.
struct Failure {
    /// The request, if sending it again cannot do anything twice.
    again: Option<Request>,
    reason: String,
}

impl Front {
    async fn pass_on(&self, leader: &Authority, request: Request) -> Result<Response, Failure> {
        let (parts, body) = request.into_parts();
        let lent = Lent::new(body);
        let mut sent = Request::from_parts(parts.clone(), lent.clone());
        let path = parts.uri.path_and_query().cloned().unwrap_or(PathAndQuery::from_static("/"));
        let target = Uri::builder().scheme(Scheme::HTTP).authority(leader.clone()).path_and_query(path);
        *sent.uri_mut() = target.build().expect("all parts are valid");
        let peer = parts.extensions.get::<ConnectInfo<SocketAddr>>();
        name_peer(sent.headers_mut(), peer.map(|ConnectInfo(peer)| *peer));
        let is_unsent = tokio::select! {
            answered = self.client.request(sent) => match answered {
                Ok(mut response) => {
                    leave_out(response.headers_mut());
                    return Ok(response.map(Body::new));
                }
                Err(error) => error.is_connect(),
            },
            () = self.end_of(leader) => false,
        };
        let again = if is_unsent || parts.method.is_safe() { lent.unread() } else { None };
        let again = again.map(|body| Request::from_parts(parts, body));
        Err(Failure { again, reason: format!("the server at {leader}, which led, does not answer") })
    }

    /// Returns some time after the end of a lead. A leader that stopped in good order has answered by then.
    async fn end_of(&self, leader: &Authority) {
        let mut roles = self.roles.clone();
        let leads = |role: &Role| matches!(role, Role::PassesOn(other) if other == leader);
        if roles.wait_for(|role| !leads(role)).await.is_err() {
            // The server stops.
            return std::future::pending().await;
        }
        tokio::time::sleep(LAST_ANSWERS).await;
    }
}

/// Adapts the headers of a request that is passed on.
fn name_peer(headers: &mut HeaderMap, peer: Option<SocketAddr>) {
    leave_out(headers);
    headers.insert(PASSED_ON, HeaderValue::from_static("1"));
    if let Some(peer) = peer {
        let peer = HeaderValue::try_from(peer.ip().to_string()).expect("digits, letters and colons");
        headers.append(FORWARDED_FOR, peer);
    }
}

/// Removes the headers of the connection, and those that it names.
fn leave_out(headers: &mut HeaderMap) {
    let named = headers.get_all(header::CONNECTION).iter().filter_map(|value| value.to_str().ok());
    let named: Vec<HeaderName> =
        named.flat_map(|names| names.split(',')).filter_map(|name| name.trim().parse().ok()).collect();
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

fn unavailable(reason: &str) -> Response {
    let detail = format!("no server of this database answers now: {reason}; try again later");
    let mut response = own(ApiError::new(ProblemKind::Unavailable, detail));
    response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
    response
}

/// The body of a request that is passed on. It can be taken back as long as nobody has read from it.
#[derive(Clone)]
struct Lent(Arc<Mutex<LentBody>>);

struct LentBody {
    body: Body,
    is_read: bool,
}

impl Lent {
    fn new(body: Body) -> Self {
        Self(Arc::new(Mutex::new(LentBody { body, is_read: false })))
    }

    fn lock(&self) -> MutexGuard<'_, LentBody> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The whole body, if nobody has read from it.
    fn unread(&self) -> Option<Body> {
        let mut lent = self.lock();
        (!lent.is_read).then(|| std::mem::take(&mut lent.body))
    }
}

impl HttpBody for Lent {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let mut lent = self.lock();
        lent.is_read = true;
        Pin::new(&mut lent.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.lock().body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.lock().body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use axum::http::{Method, StatusCode};

    use super::*;

    async fn ask(roles: &watch::Receiver<Role>, request: axum::http::request::Builder) -> Response {
        let router = TowerToHyperService::new(router(roles.clone()));
        router.call(request.body(Body::from("document")).unwrap()).await.unwrap()
    }

    #[test]
    fn headers_of_the_connection_stay_and_the_peer_is_named_last() {
        let mut headers = HeaderMap::new();
        for (name, value) in [
            ("connection", "close, x-of-this-connection"),
            ("x-of-this-connection", "1"),
            ("transfer-encoding", "chunked"),
            ("authorization", "Bearer secret"),
            ("x-forwarded-for", "192.0.2.7"),
        ] {
            headers.append(name.parse::<HeaderName>().unwrap(), value.parse().unwrap());
        }
        name_peer(&mut headers, Some("[2001:db8::9]:4242".parse().unwrap()));
        let left: Vec<_> =
            headers.iter().map(|(name, value)| (name.as_str(), value.to_str().unwrap())).collect();
        let expected = [
            ("authorization", "Bearer secret"),
            ("x-forwarded-for", "192.0.2.7"),
            ("x-forwarded-for", "2001:db8::9"),
            ("roost-passed-on", "1"),
        ];
        assert_eq!(left, expected);
    }

    #[tokio::test]
    async fn a_request_without_a_leader_waits_and_is_refused() {
        let (role, roles) = watch::channel(Role::Waits("nobody leads".to_owned()));
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
