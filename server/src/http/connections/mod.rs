//! Serves connections: how many there may be at once, and how long a client may take to say what it wants.
//!
//! A client that sends half a request, or a body byte by byte, costs the server a file descriptor and some kilobytes. Four
//! rules bound that cost. A request head must arrive within [`Timeouts::head`], which also ends connections that have been
//! idle for so long. A request body must not pause for longer than [`Timeouts::body`]. An answer must be read
//! at a minimum rate: see [`paced`]. And the number of connections has a
//! limit: see [`Connections`] for what happens there.
//!
//! There is no limit for each peer address, since all workers of a site may share one.

mod paced;
mod streams;
mod table;

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

use super::problem::{ApiError, Kind};
use super::safety;
use paced::Paced;
pub(crate) use streams::StreamPlace;
pub(crate) use table::Connections;
use table::{Place, Turn};

/// The longest request head accepted, in bytes. The longest that the dashboard or the command sends takes 5 kB.
const MAX_HEAD_BYTES: usize = 16 * 1024;

/// After an error of `accept` the server waits this long: nearly all of them stay for a while.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

/// A connection that was told to close gets so long for a request that came at that very moment.
const CLOSE_GRACE: Duration = Duration::from_secs(1);

/// How long a client may take.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timeouts {
    /// From the start of a connection, or the end of the last answer on it, to the end of the next request head.
    pub(crate) head: Duration,
    /// From one part of a request body to the next, for the peer to acknowledge the bytes that were sent to it, and the time over which
    /// its rate of reading is averaged.
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
                connections.settled().await;
                listener.accept().await
            } => accepted,
            () = stop.cancelled() => break,
        };
        // A task that has ended takes memory until it is joined.
        while tasks.try_join_next().is_some() {}
        match accepted {
            Ok((stream, peer)) => {
                if let Some(place) = connections.enter() {
                    tasks.spawn(attend((stream, peer), router.clone(), place, timeouts, stop.clone()));
                }
            }
            Err(error) if is_of_one_connection(&error) => {}
            Err(error) => {
                // Without a file descriptor left, the place of a connection that waits is worth more to a new client.
                connections.make_room(&error);
                let _ = stop.run_until_cancelled(tokio::time::sleep(ACCEPT_PAUSE)).await;
            }
        }
    }
    drop(listener);
    while tasks.join_next().await.is_some() {}
}

/// Whether the client gave up before it was accepted, which says nothing about the next one.
fn is_of_one_connection(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset)
}

/// Answers the requests of one connection, one after the other.
async fn attend(
    (stream, peer): (TcpStream, SocketAddr),
    router: Arc<TowerToHyperService<Router>>,
    place: Arc<Place>,
    timeouts: Timeouts,
    stop: CancellationToken,
) {
    end_stalled(&stream, timeouts.body);
    let stream = Paced::new(stream, place.clone(), timeouts.body);
    let service = service_fn(|mut request: Request<Incoming>| {
        // For the audit log.
        request.extensions_mut().insert(ConnectInfo(peer));
        let turn = place.begin(request.uri().path());
        let router = router.clone();
        async move {
            let response = match &turn {
                Ok(_) => router.call(request.map(|body| patient(body, timeouts.body))).await,
                Err(refused) => Ok(busy(refused.limit)),
            };
            response.map(|response| response.map(|body| Answer { body, _turn: turn.ok() }))
        }
    });
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(timeouts.head).max_header_size(MAX_HEAD_BYTES);
    let mut connection = pin!(http.serve_connection(TokioIo::new(stream), service));
    let mut leaves = pin!(place.leaves(&stop));
    let is_displaced = tokio::select! {
        ended = connection.as_mut() => return note(ended),
        is_displaced = leaves.as_mut() => is_displaced,
    };
    // Nothing was asked on it yet, or only half: there is nothing to finish.
    if !place.has_asked() {
        return;
    }
    connection.as_mut().graceful_shutdown();
    if !is_displaced {
        note(connection.await);
    } else if !place.is_unread()
        && let Ok(ended) = tokio::time::timeout(CLOSE_GRACE, connection).await
    {
        note(ended);
    }
}

fn note(ended: hyper::Result<()>) {
    if let Err(error) = ended {
        tracing::trace!(%error, "a connection ended early");
    }
}

/// Has the system end a connection whose peer acknowledges nothing, or reads nothing, for so long.
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

/// The answer to a request that is one too many.
fn busy(limit: usize) -> Response {
    let detail = format!(
        "the server answers {limit} requests already (from max_connections, which the operator can set); try again later"
    );
    let mut response = ApiError::new(Kind::Unavailable, detail).into_response();
    let headers = response.headers_mut();
    headers.insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
    headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
    // It did not come through the router, which completes all others.
    safety::protect(&mut response, false);
    response
}

/// The body of an answer; its connection answers until hyper has taken the last of it.
struct Answer {
    body: Body,
    _turn: Option<Turn>,
}

impl HttpBody for Answer {
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
