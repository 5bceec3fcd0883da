//! The life of a server: bind, lead or stand by, stop.

mod leading;
mod standby;

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::{TcpListener, TcpSocket};
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

use leading::Leading;

use crate::config::ServerConfig;
use crate::data::{DATABASE, DataError};
use crate::http::Role;
#[cfg(test)]
use crate::state::App;
use crate::state::Connections;
use crate::store::{Location, StoreError};
use crate::{http, process};

/// Why a server did not start, or ended.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// Other machines can reach the address, and there is no access token.
    #[error(
        "refusing to listen on {0} without access tokens, since other machines can reach it: make a token in the same `--data` with \
         `roost token create --scope admin`, let users sign in with `--oidc-issuer`, or listen on a loopback address such as 127.0.0.1"
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
    site: Site,
    /// None while another server leads.
    first: Option<Leading>,
}

/// The parts that a server keeps for its whole life, whether it leads or not.
struct Site {
    config: ServerConfig,
    /// The address that it listens on.
    address: SocketAddr,
    /// The database, whose sessions have the address of this server in their names.
    place: Location,
    connections: Arc<Connections>,
}

impl Site {
    /// Whether a leader gives the address of this server.
    fn is_own(&self, leader: &str) -> bool {
        self.config.advertised(self.address).is_some_and(|own| own == leader)
    }
}

impl Server {
    /// Opens the address, and the data directory unless another server leads. Attempts that ran when the server last stopped get a new
    /// lease.
    pub async fn bind(config: ServerConfig) -> Result<Self, ServerError> {
        let address = config.listen;
        let is_new = config.database.is_none() && !config.data.join(DATABASE).exists();
        // Without a database there are no tokens: refuse before creating files.
        if !address.ip().is_loopback() && is_new && config.sign_in.is_none() {
            return Err(ServerError::NotLoopback(address));
        }
        // The address first: a failure leaves no directory behind.
        let bind = || listen(address).map_err(|source| ServerError::Bind { address, source });
        let listener = retry_in_use(bind).await?;
        if is_new {
            tracing::info!(data = %config.data.display(), "no database found: creating a new one");
        }
        let address = listener.local_addr().map_err(|source| ServerError::Bind { address, source })?;
        let connections = Arc::new(Connections::new(max_connections(&config)));
        let advertised = config.advertised(address);
        if config.database.is_some() && advertised.is_none() {
            tracing::warn!(%address, "other servers of the database cannot reach this one: start it with --advertise HOST:PORT");
        }
        if config.database.is_some() && config.objects.is_none() {
            tracing::warn!(data = %config.data.display(), "objects are in the data folder: start servers on other machines with --objects s3://BUCKET/PREFIX");
        }
        let place = config.place().for_server(advertised.as_deref());
        let site = Site { config, address, place, connections };
        let first = match standby::led_by_another(&site).await? {
            true => None,
            false => match Leading::start(&site).await {
                // It has taken the lead meanwhile.
                Err(ServerError::Store(StoreError::OtherServer(_))) => None,
                started => Some(started?),
            },
        };
        if first.is_none() {
            tracing::info!(%address, database = %site.place, "standing by: the database is in use");
        }
        Ok(Self { listener, site, first })
    }

    /// The address of the server.
    pub fn local_addr(&self) -> SocketAddr {
        self.site.address
    }

    /// The state of a server that leads.
    #[cfg(test)]
    pub(crate) fn app(&self) -> App {
        self.first.as_ref().expect("it leads").app.clone()
    }

    /// Answers requests, or passes them on, until `shutdown` is cancelled. Then returns within a few seconds: waiting requests
    /// are answered at once, running requests are finished, and everything that was acknowledged is on disk.
    pub async fn run(self, shutdown: CancellationToken) -> Result<(), ServerError> {
        let Self { listener, site, mut first } = self;
        let (role, roles) = watch::channel(Role::Waits(None));
        let stop = CancellationToken::new();
        let serving = http::serve(listener, roles, &site.config, site.connections.clone(), stop.clone());
        tokio::pin!(serving);
        let (outcome, last) = loop {
            let leading = match first.take() {
                Some(leading) => leading,
                None => tokio::select! {
                    leading = standby::wait_to_lead(&site, &role) => leading,
                    () = shutdown.cancelled() => break (Ok(()), None),
                    () = &mut serving => return Ok(()),
                },
            };
            let tasks = leading.begin();
            role.send_replace(http::leading(leading.app.clone()));
            let ended = tokio::select! {
                () = &mut serving => return Ok(()),
                () = shutdown.cancelled() => Ok(()),
                () = leading.app.store.ended() => Err(ServerError::WriterEnded),
            };
            leading.app.shutdown.cancel();
            match ended {
                Err(_) if let Some(reason) = leading.app.store.deposed() => {
                    tracing::warn!("{reason}: this server stands by");
                    role.send_replace(Role::Waits(None));
                    // Requests under way may hold its state for a while.
                    tokio::spawn(leading.end(tasks));
                }
                ended => break (ended, Some((leading, tasks))),
            }
        };
        stop.cancel();
        // A client that neither reads nor closes must not delay the shutdown.
        let _ = tokio::time::timeout(SHUTDOWN_GRACE, &mut serving).await;
        if let Some((leading, tasks)) = last {
            leading.end(tasks).await;
        }
        outcome
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
async fn retry_in_use<T>(attempt: impl Fn() -> Result<T, ServerError>) -> Result<T, ServerError> {
    for _ in 0..MAX_RETRIES {
        match attempt() {
            Err(ServerError::Data(DataError::InUse(_))) => {}
            Err(ServerError::Bind { source, .. }) if source.kind() == io::ErrorKind::AddrInUse => {}
            done => return done,
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    attempt()
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
        let app = server.app();
        let running = tokio::spawn(server.run(CancellationToken::new()));
        app.store.close().await;
        let ended =
            tokio::time::timeout(Duration::from_secs(20), running).await.expect("the server has ended");
        assert!(matches!(ended.unwrap(), Err(ServerError::WriterEnded)));
    }
}
