//! A server from start to end: bind, run, stop.

use std::fs::File;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::{TcpListener, TcpSocket};
use tokio::sync::{Notify, Semaphore};
use tokio_util::sync::CancellationToken;

use crate::app::{App, AppState, ProgressBoard};
use crate::clock::Clock;
use crate::config::ServerConfig;
use crate::data::{self, DATABASE, DataError};
use crate::queue::lease_end;
use crate::store::{Store, StoreError};
use crate::{http, process, reaper};

/// Why a server did not start, or stopped.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// An address that others can reach.
    #[error(
        "refusing to listen on {0} without access tokens, which others could reach: make one in the same `--data` with `roost token create \
         --scope admin`, or listen on a loopback address such as 127.0.0.1"
    )]
    NotLoopback(SocketAddr),
    /// The address is taken or not ours.
    #[error("cannot listen on {address}")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// Why.
        source: io::Error,
    },
    /// The data directory cannot be used.
    #[error(transparent)]
    Data(#[from] DataError),
    /// The database cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The task that writes to the database ended.
    #[error("the database writer ended by itself; the log says more")]
    WriterEnded,
}

/// Requests under way at shutdown get this long.
const GRACE: Duration = Duration::from_secs(3);

/// Clients that may wait to be accepted; the system may keep fewer.
const BACKLOG: u32 = 4096;

/// Tries, 50 ms apart, for what a server before this one may not have let go of.
const PATIENCE: u32 = 20;

/// A server that listens but does not answer yet.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    pub(crate) app: App,
    /// Held while the server lives: two servers on one directory would both hand out its leases.
    _lock: File,
}

impl Server {
    /// Opens the data directory and the address. Attempts that ran when the server last stopped get a fresh lease.
    pub async fn bind(config: ServerConfig) -> Result<Self, ServerError> {
        let address = config.listen;
        // Nothing is made where there cannot be tokens.
        if !address.ip().is_loopback() && !config.data.join(DATABASE).exists() {
            return Err(ServerError::NotLoopback(address));
        }
        // The address first: what cannot be listened on leaves no directory behind.
        let bind = async || listen(address).map_err(|source| ServerError::Bind { address, source });
        let listener = patiently(bind).await?;
        if !config.data.join(DATABASE).exists() {
            tracing::info!(data = %config.data.display(), "no database is here: making a new one");
        }
        let lock = patiently(async || Ok(data::lock(&config.data)?)).await?;
        let address = listener.local_addr().map_err(|source| ServerError::Bind { address, source })?;
        let store = Store::open(&config.data.join(DATABASE), config.objects.as_ref()).await?;
        let (tokens, is_loopback) = (store.tokens().await?, address.ip().is_loopback());
        if !is_loopback && tokens.iter().all(|token| token.is_revoked) {
            store.close().await;
            return Err(ServerError::NotLoopback(address));
        }
        let (max_requests_per_s, max_result_bytes) = (config.max_requests_per_s, config.max_result_bytes);
        let access = http::Access::new(max_requests_per_s, is_loopback, tokens);
        let newest_at_start = store.newest_record().await?;
        let clock = Clock::start();
        let running = store.start_afresh(lease_end(clock.lease_now(), config.lease)).await?;
        tracing::info!(%address, data = %config.data.display(), running, "listening");
        if access.is_open() {
            tracing::warn!("no access token exists: everybody on this machine may do everything");
        }
        let connections = Arc::new(http::Connections::new(max_connections(&config)));
        let metrics = http::Metrics::new(&store, &connections);
        let app = Arc::new(AppState {
            config,
            store,
            clock,
            newest_at_start,
            work: Notify::new(),
            deliveries: Arc::new(Semaphore::new(http::places_for_deliveries(max_result_bytes))),
            uploads: Arc::new(Semaphore::new(http::UPLOADS_AT_ONCE)),
            views: Default::default(),
            responses: Default::default(),
            shelf: Default::default(),
            mesh_gate: Default::default(),
            connections,
            metrics,
            access,
            shutdown: CancellationToken::new(),
            progress: ProgressBoard::default(),
        });
        Ok(Self { listener, address, app, _lock: lock })
    }

    /// The address it listens on.
    pub fn local_addr(&self) -> SocketAddr {
        self.address
    }

    /// Answers requests until `shutdown` is cancelled, then returns within a few seconds: what waits is answered
    /// at once, what is under way is finished, what has been accepted is on disk.
    pub async fn run(self, shutdown: CancellationToken) -> Result<(), ServerError> {
        let app = self.app;
        let reaper = tokio::spawn(reaper::run(app.clone()));
        let stop = app.shutdown.clone();
        let serving = http::serve(self.listener, app.clone(), stop.clone());
        tokio::pin!(serving);
        let served = tokio::select! {
            () = &mut serving => Ok(()),
            () = shutdown.cancelled() => {
                stop.cancel();
                // A client that neither reads nor closes must not keep the server.
                let _ = tokio::time::timeout(GRACE, &mut serving).await;
                Ok(())
            }
            () = app.store.ended() => {
                stop.cancel();
                let _ = tokio::time::timeout(GRACE, &mut serving).await;
                Err(ServerError::WriterEnded)
            }
        };
        stop.cancel();
        let _ = reaper.await;
        app.store.close().await;
        served
    }
}

/// Listens with a longer queue than the usual one of 1,024: a new client shall not wait behind a flood of others.
fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
    // Else the port of a server that has just ended stays taken for a minute.
    socket.set_reuseaddr(true)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

/// The connections that the settings and the system allow.
fn max_connections(config: &ServerConfig) -> usize {
    let descriptors = process::raise_descriptors(config.max_connections);
    let (wanted, possible) = (config.max_connections, process::connections_for(descriptors));
    if possible < wanted {
        tracing::warn!(
            wanted,
            possible,
            ?descriptors,
            "fewer connections than wanted: the system allows too few open files"
        );
    }
    wanted.min(possible)
}

/// Tries again for a moment when something is still in use: a server that was killed just before is not quite gone.
async fn patiently<T>(attempt: impl AsyncFn() -> Result<T, ServerError>) -> Result<T, ServerError> {
    for _ in 0..PATIENCE {
        match attempt().await {
            Err(ServerError::Data(DataError::InUse(_))) => {}
            Err(ServerError::Bind { source, .. }) if source.kind() == io::ErrorKind::AddrInUse => {}
            done => return done,
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    attempt().await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_server_whose_writer_ended_ends() {
        let dir = tempfile::tempdir().unwrap();
        let listen = ([127, 0, 0, 1], 0).into();
        let config = ServerConfig { listen, data: dir.path().to_owned(), ..ServerConfig::default() };
        let server = Server::bind(config).await.unwrap();
        let app = server.app.clone();
        let running = tokio::spawn(server.run(CancellationToken::new()));
        app.store.close().await;
        let ended = tokio::time::timeout(Duration::from_secs(20), running).await.expect("not half alive");
        assert!(matches!(ended.unwrap(), Err(ServerError::WriterEnded)));
    }
}
