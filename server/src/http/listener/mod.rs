//! Accepts and serves connections, and bounds what slow clients cost.
//!
//! A client that sends half a request, or a body byte by byte, costs the server a file descriptor and some
//! kilobytes. Four rules bound that cost:
//!
//! - A request head must arrive within [`Timeouts::head`]; idle connections end after the same time.
//! - A request body must not pause for longer than [`Timeouts::body`].
//! - A client must read an answer at a minimum rate, see [`paced`].
//! - The number of connections is limited, see [`Connections`].
//!
//! Peer addresses have no limit of their own, since all workers of a site may share one.

mod paced;

use std::io;
use std::net::SocketAddr;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{ConnectInfo, Request};
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use hyper::body::{Frame, Incoming, SizeHint};
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tower_http::timeout::TimeoutBody;

use super::problem::{ApiError, ProblemKind};
use super::safety;
use crate::state::connections::{AnswerPermit, ConnectionSlot, Connections};
use paced::Paced;

/// Maximum length of a request head, in bytes. The dashboard and the command send up to 5 kB.
const MAX_HEAD_BYTES: usize = 16 * 1024;

/// Wait after an error of `accept`: nearly all such errors persist for a while.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

/// Time for a displaced connection to answer a request that arrived at that moment.
const CLOSE_GRACE: Duration = Duration::from_secs(1);

/// Maximum times that a client may take.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timeouts {
    /// From the start of a connection, or the end of the last answer on it, to the end of the next request
    /// head.
    pub(crate) head: Duration,
    /// From one part of a request body to the next, and until the peer acknowledges sent bytes. Also the time
    /// over which its rate of reading is averaged.
    pub(crate) body: Duration,
}

/// Serves until `stop`, then finishes the requests under way. Dropping the future closes every connection.
pub(crate) async fn serve(
    listener: TcpListener,
    router: Router,
    connections: Arc<Connections>,
    timeouts: Timeouts,
    stop: CancellationToken,
) {
    let router = Arc::new(TowerToHyperService::new(router));
    let mut tasks = JoinSet::new();
    loop {
        let accepted = tokio::select! {
            accepted = async {
                connections.wait_for_closing().await;
                listener.accept().await
            } => accepted,
            () = stop.cancelled() => break,
        };
        // Finished tasks take memory until they are joined.
        while tasks.try_join_next().is_some() {}
        match accepted {
            Ok((stream, peer)) => {
                if let Some(slot) = connections.enter() {
                    tasks.spawn(attend((stream, peer), router.clone(), slot, timeouts, stop.clone()));
                }
            }
            Err(error) if is_of_one_connection(&error) => {}
            Err(error) => {
                // The process may be out of file descriptors: free one for a new client.
                connections.displace_one(&error);
                let _ = stop.run_until_cancelled(tokio::time::sleep(ACCEPT_PAUSE)).await;
            }
        }
    }
    drop(listener);
    while tasks.join_next().await.is_some() {}
}

/// Whether the error concerns this one client, which gave up before it was accepted.
fn is_of_one_connection(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset)
}

/// Answers the requests of one connection, one after the other.
async fn attend(
    (stream, peer): (TcpStream, SocketAddr),
    router: Arc<TowerToHyperService<Router>>,
    slot: Arc<ConnectionSlot>,
    timeouts: Timeouts,
    stop: CancellationToken,
) {
    end_stalled(&stream, timeouts.body);
    let stream = Paced::new(stream, slot.clone(), timeouts.body);
    let service = service_fn(|mut request: Request<Incoming>| {
        // For the audit log.
        request.extensions_mut().insert(ConnectInfo(peer));
        let permit = slot.begin(request.uri().path());
        let router = router.clone();
        async move {
            let response = match &permit {
                Ok(_) => router.call(request.map(|body| patient(body, timeouts.body))).await,
                Err(refused) => Ok(busy(refused.limit)),
            };
            response.map(|response| response.map(|body| PermittedBody { body, _permit: permit.ok() }))
        }
    });
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(timeouts.head).max_header_size(MAX_HEAD_BYTES);
    let mut connection = pin!(http.serve_connection(TokioIo::new(stream), service));
    let mut close = pin!(slot.wait_for_close(&stop));
    let is_displaced = tokio::select! {
        ended = connection.as_mut() => return log_early_end(ended),
        is_displaced = close.as_mut() => is_displaced,
    };
    // Without a whole request there is no answer to finish.
    if !slot.has_had_request() {
        return;
    }
    connection.as_mut().graceful_shutdown();
    if !is_displaced {
        log_early_end(connection.await);
    } else if !slot.is_unread()
        && let Ok(ended) = tokio::time::timeout(CLOSE_GRACE, connection).await
    {
        log_early_end(ended);
    }
}

fn log_early_end(ended: hyper::Result<()>) {
    if let Err(error) = ended {
        tracing::trace!(%error, "a connection ended early");
    }
}

/// Lets the system end a connection whose peer acknowledges nothing, or reads nothing, for this long.
fn end_stalled(stream: &TcpStream, after: Duration) {
    #[cfg(target_os = "linux")]
    {
        let after_ms = u32::try_from(after.as_millis()).unwrap_or(u32::MAX);
        if let Err(error) = rustix::net::sockopt::set_tcp_user_timeout(stream, after_ms) {
            tracing::debug!(%error, "a connection has no TCP_USER_TIMEOUT");
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = (stream, after);
}

/// A request body that fails when its sender pauses for too long.
fn patient(body: Incoming, pause: Duration) -> Body {
    if body.is_end_stream() { Body::empty() } else { Body::new(TimeoutBody::new(pause, body)) }
}

/// The answer to a request above the limit.
fn busy(limit: usize) -> Response {
    let detail = format!(
        "the server already answers {limit} requests (a part of max_connections, which the operator can set): try again later"
    );
    let mut response = ApiError::new(ProblemKind::Unavailable, detail).into_response();
    let headers = response.headers_mut();
    headers.insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
    headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
    // Other answers get these headers in the router.
    safety::protect(&mut response, false);
    response
}

/// The body of an answer, which holds the permit until hyper has taken its last part.
struct PermittedBody {
    body: Body,
    _permit: Option<AnswerPermit>,
}

impl HttpBody for PermittedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
