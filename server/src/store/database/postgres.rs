//! Opening databases of PostgreSQL.
//!
//! One server leads a database: its writing connection holds a lock of the session, and has the address of the server in its name. Each
//! transaction that writes also takes a lock, so that writers come one after the other.

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

/// Maximum time of a connection attempt, of the steps that make it the writer, and of a wait for a reader.
const PATIENCE: Duration = Duration::from_secs(10);

/// Limits of a statement and of a wait for a lock, which PostgreSQL keeps.
const WRITER_LIMITS: [(&str, &str); 2] = [("statement_timeout", "60s"), ("lock_timeout", "10s")];

/// The writer prefers indexes, whatever the statistics say. A new database has none: a plan made then would read whole tables, and stay
/// until PostgreSQL analyses the grown tables. PostgreSQL would also compile each plan that has to read a whole table. A scan by a bitmap
/// does not mark the entries of old versions, so that each later scan would visit them again. Without generic plans, PostgreSQL plans the
/// search for jobs of each claim again, which takes three times as long as the search itself.
const WRITER_PLANS: &str =
    "SELECT set_config('enable_seqscan', 'off', false), set_config('enable_bitmapscan', 'off', false),
        set_config('enable_hashjoin', 'off', false), set_config('enable_mergejoin', 'off', false), set_config('jit', 'off', false),
        set_config('plan_cache_mode', 'force_generic_plan', false)";

/// PostgreSQL ends the session of a server that it cannot reach, after a minute.
const KEEPALIVES: [(&str, &str); 4] = [
    ("tcp_keepalives_idle", "30"),
    ("tcp_keepalives_interval", "10"),
    ("tcp_keepalives_count", "3"),
    ("tcp_user_timeout", "60000"),
];

/// Maximum time to begin or roll back a transaction: more than the wait for its lock.
pub(in crate::store) const BEGIN_DEADLINE: Duration = Duration::from_secs(12);

/// Maximum time of a write or a commit: more than a statement may take. Tests wait for it.
pub(in crate::store) const STATEMENT_DEADLINE: Duration =
    Duration::from_secs(if cfg!(test) { 10 } else { 65 });

/// Maximum time of a read on a lent connection: more than PostgreSQL lets a statement take. Tests wait for it.
pub(super) const READ_DEADLINE: Duration = Duration::from_secs(if cfg!(test) { 10 } else { 35 });

/// Attempts, 100 ms apart, to get the lock that a server which was just killed may still hold.
const LOCK_ATTEMPTS: u32 = 30;

/// Takes the lock of the server for as long as the session lives.
pub(super) const LOCK_SERVER: &str = "SELECT pg_try_advisory_lock(8246779703540740722)";

/// Ends the session of an earlier connection of this server, if it still holds the lock, and counts it.
const END_EARLIER: &str = "SELECT count(pg_terminate_backend(pid)) FROM pg_locks JOIN pg_stat_activity USING (pid)
    WHERE locktype = 'advisory' AND pid = ANY($1) AND classid::bigint << 32 | objid::bigint = 8246779703540740722
      AND database = (SELECT oid FROM pg_database WHERE datname = current_database())
      AND application_name = current_setting('application_name')";

/// The session that holds the lock of the server, its name, and whether it has been idle for longer than this number of seconds. The name is
/// null for a session of another role, to which no server may send its requests.
pub(in crate::store) const HOLDER: &str =
    "SELECT pid, CASE WHEN usename = session_user THEN application_name END,
        state LIKE 'idle%' AND now() - state_change > make_interval(secs => $1)
    FROM pg_locks JOIN pg_stat_activity USING (pid)
    WHERE locktype = 'advisory' AND granted AND classid::bigint << 32 | objid::bigint = 8246779703540740722
      AND database = (SELECT oid FROM pg_database WHERE datname = current_database())";

/// Between the name and the address of a server, in the name of its sessions.
const AT: &str = " at ";

/// Maximum length of the name of a session; PostgreSQL cuts off the rest.
const MAX_NAME_BYTES: usize = 63;

/// Begins a transaction of a writer, and waits for those of other servers. Each later statement must see what they committed, whatever
/// isolation the database has by default.
pub(in crate::store) const BEGIN: &str =
    "BEGIN ISOLATION LEVEL READ COMMITTED; SELECT pg_advisory_xact_lock(8246779703540740723)";

/// The same, with the savepoint of its first write.
pub(in crate::store) const BEGIN_GROUP: &str = "BEGIN ISOLATION LEVEL READ COMMITTED; SELECT pg_advisory_xact_lock(8246779703540740723); SAVEPOINT piece";

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
        // The environment may name another one. PostgreSQL replaces what is not ASCII.
        let name = options.get_application_name().unwrap_or("roost").replace(|c: char| !c.is_ascii(), "?");
        Ok(Self(Box::new(options.application_name(&name.replace(AT, "-")))))
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

/// The address of a server in the name of its session.
pub(in crate::store) fn address_in_name(name: &str) -> Option<&str> {
    name.rsplit_once(AT).map(|(_, address)| address)
}

impl Address {
    /// The same database, for the sessions of the server at this host and port.
    pub(crate) fn for_server(&self, server: &str) -> Self {
        let name = self.0.get_application_name().unwrap_or_default();
        let room = MAX_NAME_BYTES.saturating_sub(AT.len() + server.len());
        let name = &name[..room.min(name.len())];
        Self(Box::new((*self.0).clone().application_name(&format!("{name}{AT}{server}"))))
    }

    /// A connection that writes and holds the lock of the server, and the version of PostgreSQL. `sessions` are those of this server that
    /// may hold the lock. Afterwards it is the new one alone; after a failure, one more may hold it.
    pub(in crate::store) async fn connect_writer(
        &self,
        sessions: &mut Vec<i32>,
    ) -> Result<(PgConnection, String), StoreError> {
        let (mut connection, version) = self.connect().await?;
        let locked = timeout(PATIENCE, self.become_writer(&mut connection, sessions)).await;
        locked.unwrap_or_else(|_| Err(self.failed(late())))?;
        Ok((connection, version))
    }

    async fn become_writer(
        &self,
        connection: &mut PgConnection,
        sessions: &mut Vec<i32>,
    ) -> Result<(), StoreError> {
        let primary = "SELECT NOT pg_is_in_recovery() AND current_setting('default_transaction_read_only') = 'off', pg_backend_pid(),
                              has_database_privilege(current_database(), 'TEMPORARY')";
        let (writes, session, makes_temporary): (bool, i32, bool) =
            sqlx::query_as(primary).fetch_one(&mut *connection).await?;
        if !writes {
            return Err(StoreError::ReadOnly(self.to_string()));
        }
        if !makes_temporary {
            let reason =
                "its role may not make temporary tables: run GRANT TEMPORARY ON DATABASE … TO …".to_owned();
            return Err(StoreError::Unsuitable { database: self.to_string(), reason });
        }
        // An acknowledged write is on disk, whatever the setting of the database.
        let durable = "SELECT set_config('synchronous_commit', 'on', false) WHERE current_setting('synchronous_commit') = 'off'";
        sqlx::query(durable).execute(&mut *connection).await?;
        sqlx::query(WRITER_PLANS).execute(&mut *connection).await?;
        for attempt in 0.. {
            // Remembered before it asks: the answer may get lost.
            sessions.push(session);
            if sqlx::query_scalar::<_, bool>(LOCK_SERVER).fetch_one(&mut *connection).await? {
                break;
            }
            sessions.pop();
            let own: i64 = match sessions.is_empty() {
                true => 0,
                false => sqlx::query_scalar(END_EARLIER).bind(&*sessions).fetch_one(&mut *connection).await?,
            };
            if attempt == LOCK_ATTEMPTS {
                // An earlier session of this server that cannot be ended is no other server.
                return Err(if own > 0 {
                    self.failed(late())
                } else {
                    StoreError::OtherServer(self.to_string())
                });
            }
            sleep(Duration::from_millis(100)).await;
        }
        *sessions = vec![session];
        Ok(())
    }

    /// A connection without the lock of a server, and the version of PostgreSQL.
    pub(in crate::store) async fn connect(&self) -> Result<(PgConnection, String), StoreError> {
        let options = (*self.0).clone().options(WRITER_LIMITS).options(KEEPALIVES);
        let sql = "SELECT current_setting('server_version_num')::bigint, current_setting('server_version'), current_setting('server_encoding')";
        let connecting = timeout(PATIENCE, async {
            let mut connection = options.connect().await?;
            let row = sqlx::query_as::<_, (i64, String, String)>(sql).fetch_one(&mut connection).await?;
            Ok((connection, row))
        });
        let connected = connecting.await.unwrap_or_else(|_| Err(late()));
        let (connection, (number, version, encoding)) = connected.map_err(|error| self.failed(error))?;
        if let Some(reason) = unsuitable(number, &version, &encoding) {
            return Err(StoreError::Unsuitable { database: self.to_string(), reason });
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
            .connect_lazy_with((*self.0).clone().options(limits).options(KEEPALIVES))
    }

    fn failed(&self, source: sqlx::Error) -> StoreError {
        StoreError::Connect { database: self.to_string(), source }
    }
}

/// The reason why a database of this version and encoding cannot be used.
fn unsuitable(number: i64, version: &str, encoding: &str) -> Option<String> {
    if number < i64::from(OLDEST) {
        return Some(format!("it is PostgreSQL {version}; 14 or newer is needed"));
    }
    (encoding != "UTF8").then(|| format!("its encoding is {encoding}: create it with the encoding UTF8"))
}

/// The error of a missed deadline.
pub(in crate::store) fn late() -> sqlx::Error {
    sqlx::Error::Io(std::io::ErrorKind::TimedOut.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_sessions_have_the_address_of_their_server() {
        let plain: Address = "postgres://me@db.example/roost".parse().unwrap();
        let name_of = |address: &Address| address.0.get_application_name().unwrap().to_owned();
        assert_eq!(address_in_name(&name_of(&plain)), None);
        assert_eq!(name_of(&plain.for_server("10.0.0.5:7373")), "roost at 10.0.0.5:7373");
        let long: Address = format!("postgres://me@db.example/roost?application_name={}", "é at ".repeat(30))
            .parse()
            .unwrap();
        for server in ["10.0.0.5:7373", "[2001:db8::5]:7373", &format!("{}:7373", "a".repeat(54))] {
            let name = name_of(&long.for_server(server));
            assert!(name.len() <= MAX_NAME_BYTES, "{name}");
            assert_eq!(address_in_name(&name), Some(server));
        }
    }

    #[test]
    fn a_postgresql_that_is_too_old_or_has_another_encoding_is_refused() {
        let reason = |number, version, encoding| unsuitable(number, version, encoding).unwrap_or_default();
        assert_eq!(reason(130_022, "13.22", "UTF8"), "it is PostgreSQL 13.22; 14 or newer is needed");
        assert_eq!(reason(90_624, "9.6.24", "LATIN1"), "it is PostgreSQL 9.6.24; 14 or newer is needed");
        assert!(reason(140_000, "14.0", "LATIN1").starts_with("its encoding is LATIN1"));
        for (number, version) in [(140_000, "14.0"), (150_014, "15.14"), (180_000, "18.0")] {
            assert_eq!(unsuitable(number, version, "UTF8"), None);
        }
    }

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
