//! Opening databases of PostgreSQL.
//!
//! One server uses a database: its writing connection holds a lock of the session. Each transaction that writes also takes a lock, so that
//! writers come one after the other even where several servers share a database.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use sqlx::postgres::{PgConnectOptions, PgPool, PgPoolOptions};
use sqlx::{ConnectOptions, PgConnection};
use tokio::time::{sleep, timeout};

use crate::store::{LocationError, StoreError};

/// The first PostgreSQL that the queries and the schema are written for.
const OLDEST: u32 = 140_000;

/// Readers of a server.
const READERS: u32 = 8;

/// Maximum time of a connection attempt, and of a wait for a reader.
const PATIENCE: Duration = Duration::from_secs(10);

/// Attempts, 100 ms apart, to get the lock that a server which was just killed may still hold.
const LOCK_ATTEMPTS: u32 = 30;

/// Takes the lock of the server for as long as the session lives.
pub(super) const LOCK_SERVER: &str = "SELECT pg_try_advisory_lock(8246779703540740722)";

/// Ends the session of an earlier connection of this server, which still holds the lock.
const END_EARLIER: &str = "SELECT count(pg_terminate_backend(pid)) FROM pg_locks
    WHERE locktype = 'advisory' AND pid = $1 AND classid::bigint << 32 | objid::bigint = 8246779703540740722
      AND database = (SELECT oid FROM pg_database WHERE datname = current_database())";

/// Begins a transaction of a writer, and waits for those of other servers.
pub(in crate::store) const BEGIN: &str = "BEGIN; SELECT pg_advisory_xact_lock(8246779703540740723)";

/// The same, with the savepoint of its first write.
pub(in crate::store) const BEGIN_GROUP: &str =
    "BEGIN; SELECT pg_advisory_xact_lock(8246779703540740723); SAVEPOINT piece";

/// The address of a database. It shows no password.
#[derive(Clone)]
pub struct Address(Box<PgConnectOptions>);

impl FromStr for Address {
    type Err = LocationError;

    fn from_str(text: &str) -> Result<Self, LocationError> {
        if !["postgres://", "postgresql://"].iter().any(|scheme| text.starts_with(scheme)) {
            return Err(LocationError::NotPostgres);
        }
        let options: PgConnectOptions = text.parse().map_err(|_| LocationError::NotPostgres)?;
        // The environment may name another one.
        let name = options.get_application_name().unwrap_or("roost").to_owned();
        Ok(Self(Box::new(options.application_name(&name))))
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(options) = self;
        let database = options.get_database().unwrap_or(options.get_username());
        match options.get_socket() {
            Some(socket) => write!(f, "postgres:///{database}?host={}", socket.display()),
            None => write!(f, "postgres://{}:{}/{database}", options.get_host(), options.get_port()),
        }
    }
}

impl fmt::Debug for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl Address {
    /// A connection that writes and holds the lock of the server, and the version of PostgreSQL. `earlier` is the session of a broken
    /// connection of this server.
    pub(in crate::store) async fn connect_writer(
        &self,
        earlier: Option<i32>,
    ) -> Result<(PgConnection, String), StoreError> {
        let (mut connection, version) = self.connect().await?;
        let primary =
            "SELECT NOT pg_is_in_recovery() AND current_setting('default_transaction_read_only') = 'off'";
        if !sqlx::query_scalar::<_, bool>(primary).fetch_one(&mut connection).await? {
            return Err(self.unsuitable("it accepts no writes: give the address of the primary"));
        }
        // An acknowledged write is on disk, whatever the setting of the database.
        let durable = "SELECT set_config('synchronous_commit', 'on', false) WHERE current_setting('synchronous_commit') = 'off'";
        sqlx::query(durable).execute(&mut connection).await?;
        for attempt in 0.. {
            if sqlx::query_scalar::<_, bool>(LOCK_SERVER).fetch_one(&mut connection).await? {
                break;
            }
            if attempt == LOCK_ATTEMPTS {
                return Err(StoreError::OtherServer(self.to_string()));
            }
            if let Some(earlier) = earlier {
                sqlx::query(END_EARLIER).bind(earlier).execute(&mut connection).await?;
            }
            sleep(Duration::from_millis(100)).await;
        }
        Ok((connection, version))
    }

    /// A connection without the lock of a server, and the version of PostgreSQL.
    pub(in crate::store) async fn connect(&self) -> Result<(PgConnection, String), StoreError> {
        let limits = [("statement_timeout", "60s"), ("lock_timeout", "10s")];
        let connecting = timeout(PATIENCE, (*self.0).clone().options(limits).connect()).await;
        let waited = |_| sqlx::Error::Io(std::io::ErrorKind::TimedOut.into());
        let fail = |source| StoreError::Connect { database: self.to_string(), source };
        let mut connection = connecting.map_err(waited).and_then(|done| done).map_err(fail)?;
        let sql = "SELECT current_setting('server_version_num')::bigint, current_setting('server_version'), current_setting('server_encoding')";
        let (number, version, encoding): (i64, String, String) =
            sqlx::query_as(sql).fetch_one(&mut connection).await?;
        if number < i64::from(OLDEST) {
            return Err(self.unsuitable(&format!("it is PostgreSQL {version}; 14 or newer is needed")));
        }
        if encoding != "UTF8" {
            return Err(
                self.unsuitable(&format!("its encoding is {encoding}: create it with the encoding UTF8"))
            );
        }
        Ok((connection, format!("PostgreSQL {version}")))
    }

    /// The readers of a server. They connect when they are needed.
    pub(in crate::store) fn readers(&self) -> PgPool {
        let limits =
            [("default_transaction_read_only", "on"), ("statement_timeout", "30s"), ("lock_timeout", "10s")];
        PgPoolOptions::new()
            .max_connections(READERS)
            .acquire_timeout(PATIENCE)
            .connect_lazy_with((*self.0).clone().options(limits))
    }

    fn unsuitable(&self, reason: &str) -> StoreError {
        StoreError::Unsuitable { database: self.to_string(), reason: reason.to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_shows_no_password() {
        for (text, shown) in [
            ("postgres://me:secret@db.example:5433/roost", "postgres://db.example:5433/roost"),
            ("postgresql://me@db.example/roost?password=secret", "postgres://db.example:5432/roost"),
            (
                "postgres://me:secret@localhost/roost?host=/run/postgresql",
                "postgres:///roost?host=/run/postgresql",
            ),
        ] {
            let address: Address = text.parse().unwrap();
            assert_eq!((address.to_string(), format!("{address:?}")), (shown.to_owned(), shown.to_owned()));
        }
        for wrong in ["", "roost", "mysql://me:secret@db/roost", "postgres://me:secret@db:port/roost"] {
            let error = wrong.parse::<Address>().unwrap_err();
            assert_eq!(error, LocationError::NotPostgres, "{wrong}");
        }
    }
}
