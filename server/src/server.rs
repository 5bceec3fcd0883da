//! The life of a server: bind, run, stop.

use std::fs::File;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::{TcpListener, TcpSocket};
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

use crate::clock::Clock;
use crate::config::ServerConfig;
use crate::data::{self, DATABASE, DataError};
use crate::queue::lease_end;
use crate::state::{Access, App, AppState, Connections, MeshCache, Metrics};
use crate::store::{OBJECTS, Store, StoreError};
use crate::{decider, http, process, reaper};

/// Why a server did not start, or ended.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// Other machines can reach the address, and there is no access token.
    #[error(
        "refusing to listen on {0} without access tokens, since other machines can reach it: make a token in the same `--data` with \
         `roost token create --scope admin`, or listen on a loopback address such as 127.0.0.1"
    )]
    NotLoopback(SocketAddr),
    /// The address is in use or does not belong to this machine.
    #[error("cannot listen on {address}")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// The cause.
        source: io::Error,
    },
    /// The data directory cannot be used.
    #[error(transparent)]
    Data(#[from] DataError),
    /// The database cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The task that writes to the database ended.
    #[error("the database writer ended unexpectedly: the log states the reason")]
    WriterEnded,
}

/// Time for requests to finish at shutdown.
const SHUTDOWN_GRACE: Duration = Duration::from_secs(3);

/// Maximum of clients that wait to be accepted; the system may allow fewer.
const BACKLOG: u32 = 4096;

/// Maximum of retries, 50 ms apart, while an earlier server still holds the address or the data directory.
const MAX_RETRIES: u32 = 20;

/// A server that is bound to its address but does not answer requests yet.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    pub(crate) app: App,
    /// Held while the server lives: two servers on one directory would lease the same jobs.
    _lock: File,
}

impl Server {
    /// Opens the data directory and the address. Attempts that ran when the server last stopped get a new
    /// lease.
    pub async fn bind(config: ServerConfig) -> Result<Self, ServerError> {
        let address = config.listen;
        let is_new = config.database.is_none() && !config.data.join(DATABASE).exists();
        // Without a database there are no tokens: refuse before creating files.
        if !address.ip().is_loopback() && is_new {
            return Err(ServerError::NotLoopback(address));
        }
        // The address first: a failure leaves no directory behind.
        let bind = async || listen(address).map_err(|source| ServerError::Bind { address, source });
        let listener = retry_in_use(bind).await?;
        if is_new {
            tracing::info!(data = %config.data.display(), "no database found: creating a new one");
        }
        let lock = retry_in_use(async || Ok(data::lock(&config.data)?)).await?;
        let address = listener.local_addr().map_err(|source| ServerError::Bind { address, source })?;
        let place = config.place();
        let store = Store::open(&place, &config.data.join(OBJECTS), config.objects.as_ref()).await?;
        let (tokens, is_loopback) = (store.tokens().await?, address.ip().is_loopback());
        if !is_loopback && tokens.iter().all(|token| token.is_revoked) {
            store.close().await;
            return Err(ServerError::NotLoopback(address));
        }
        let (max_requests_per_s, max_result_bytes) = (config.max_requests_per_s, config.max_result_bytes);
        let access = Access::new(max_requests_per_s, is_loopback, tokens);
        let newest_at_start = store.newest_record().await?;
        let clock = Clock::start();
        let running = store.renew_all_leases(lease_end(clock.lease_now(), config.lease)).await?;
        tracing::info!(%address, data = %config.data.display(), database = %place, running, "listening");
        if access.is_open() {
            tracing::warn!("no access token exists: every user of this machine may do everything");
        }
        let connections = Arc::new(Connections::new(max_connections(&config)));
        let metrics = Metrics::new(&store, &connections);
        let app = Arc::new(AppState {
            mesh_cache: MeshCache::new(config.max_mesh_triangles),
            config,
            store,
            clock,
            newest_at_start,
            work: Default::default(),
            delivery_budget: Arc::new(Semaphore::new(http::delivery_budget_kib(max_result_bytes))),
            upload_slots: Arc::new(Semaphore::new(http::MAX_UPLOADS)),
            sweep_views: Default::default(),
            sweep_responses: Default::default(),
            mesh_gate: Default::default(),
            submission_turns: Default::default(),
            connections,
            metrics,
            access,
            refusal_limit: Default::default(),
            shutdown: CancellationToken::new(),
            checkpoint_uploads: Default::default(),
            fill_uploads: Default::default(),
            progress: Default::default(),
            slots: Default::default(),
            farm_views: Default::default(),
            forecasts: Default::default(),
            study_forecasts: Default::default(),
            curve_points: Default::default(),
        });
        Ok(Self { listener, address, app, _lock: lock })
    }

    /// The address of the server.
    pub fn local_addr(&self) -> SocketAddr {
        self.address
    }

    /// Answers requests until `shutdown` is cancelled, then returns within a few seconds: waiting requests
    /// are answered at once, running requests are finished, and everything that was acknowledged is on disk.
    pub async fn run(self, shutdown: CancellationToken) -> Result<(), ServerError> {
        let app = self.app;
        let reaper = tokio::spawn(reaper::run(app.clone()));
        let decider = tokio::spawn(decider::run(app.clone()));
        let stop = app.shutdown.clone();
        let serving = http::serve(self.listener, app.clone(), stop.clone());
        tokio::pin!(serving);
        let served = tokio::select! {
            () = &mut serving => Ok(()),
            () = shutdown.cancelled() => {
                stop.cancel();
                // A client that neither reads nor closes must not delay the shutdown.
                let _ = tokio::time::timeout(SHUTDOWN_GRACE, &mut serving).await;
                Ok(())
            }
            () = app.store.ended() => {
                stop.cancel();
                let _ = tokio::time::timeout(SHUTDOWN_GRACE, &mut serving).await;
                Err(ServerError::WriterEnded)
            }
        };
        stop.cancel();
        let _ = reaper.await;
        let _ = decider.await;
        app.store.close().await;
        served
    }
}

/// Listens with a longer queue than the default of 1,024: a new client shall not wait behind a flood of others.
fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
    // Without this, the port of a server that has just ended stays in use for a minute.
    socket.set_reuseaddr(true)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

/// The number of connections that settings and system allow.
fn max_connections(config: &ServerConfig) -> usize {
    let descriptors = process::raise_descriptors(config.max_connections);
    let (wanted, possible) = (config.max_connections, process::connections_for(descriptors));
    if possible < wanted {
        tracing::warn!(
            wanted,
            possible,
            ?descriptors,
            "max_connections is reduced: raise the system's limit of open files (ulimit -n)"
        );
    }
    wanted.min(possible)
}

/// Retries for a moment while the address or the directory is in use: a server that was just killed may still
/// hold them.
async fn retry_in_use<T>(attempt: impl AsyncFn() -> Result<T, ServerError>) -> Result<T, ServerError> {
    for _ in 0..MAX_RETRIES {
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
    async fn server_ends_when_its_writer_has_ended() {
        let dir = tempfile::tempdir().unwrap();
        let listen = ([127, 0, 0, 1], 0).into();
        let config = ServerConfig { listen, data: dir.path().to_owned(), ..ServerConfig::default() };
        let server = Server::bind(config).await.unwrap();
        let app = server.app.clone();
        let running = tokio::spawn(server.run(CancellationToken::new()));
        app.store.close().await;
        let ended =
            tokio::time::timeout(Duration::from_secs(20), running).await.expect("the server has ended");
        assert!(matches!(ended.unwrap(), Err(ServerError::WriterEnded)));
    }
}
