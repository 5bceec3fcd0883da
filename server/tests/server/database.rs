//! The database of the servers in these tests: a file in the data directory, or PostgreSQL with `ROOST_TEST_DATABASE=postgres`.
//! Tests of the file itself then check nothing.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{LazyLock, Mutex};

use roost_server::{DataError, Location, TokenFile, copy_database, database_in, tokens_at, tokens_in};
use sqlx::{Connection, SqliteConnection};

#[path = "../../src/store/testing/cluster.rs"]
mod cluster;

use cluster::Cluster;

/// Tests that `cargo test` runs on both databases, by parts of their names. The tests of the store cover the queue there.
const ON_BOTH: [&str; 9] = [
    "contract::",
    "frames::",
    "meshes::",
    "series::",
    "studies",
    "sweeps::",
    "tables::",
    "upgrade::",
    "workbooks::",
];

#[test]
fn tests_of_what_users_read_pass_on_postgresql_too() {
    if is_postgres() {
        return;
    }
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.env("ROOST_TEST_DATABASE", "postgres").args(ON_BOTH).args(["--test-threads", "2"]);
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
    let passed = text.split("test result: ok. ").nth(1).and_then(|rest| rest.split(' ').next()?.parse().ok());
    assert!(passed.is_some_and(|passed: u32| passed > 60), "{text}");
}

/// The PostgreSQL of this process, which flushes nothing to disk.
static CLUSTER: LazyLock<Cluster> = LazyLock::new(|| {
    let memory = Path::new("/dev/shm");
    let below = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
    Cluster::start(&below, "-c fsync=off -c synchronous_commit=off -c full_page_writes=off")
});

/// The database of each data directory.
static DATABASES: LazyLock<Mutex<HashMap<PathBuf, String>>> = LazyLock::new(Mutex::default);

/// Whether the tests run on PostgreSQL.
pub(crate) fn is_postgres() -> bool {
    match std::env::var("ROOST_TEST_DATABASE").as_deref() {
        Ok("postgres") => true,
        Ok("sqlite") | Err(_) => false,
        Ok(other) => panic!("ROOST_TEST_DATABASE={other}: write sqlite or postgres"),
    }
}

/// The name of the database for a data directory: the same at each start of a server there.
fn name_of(data: &Path) -> String {
    let mut databases = DATABASES.lock().unwrap();
    let number = databases.len();
    let create = || {
        let name = format!("test_{number}");
        CLUSTER.create(&name);
        name
    };
    databases.entry(data.to_owned()).or_insert_with(create).clone()
}

/// The setting `database` of a server with this data directory. None is the file.
pub(crate) fn of(data: &Path) -> Option<Location> {
    is_postgres().then(|| CLUSTER.address(&name_of(data)).parse().unwrap())
}

/// The access tokens. Those in a file are opened by [`tokens_in`]; those in PostgreSQL have their database at once.
pub(crate) async fn tokens(data: &Path, create: bool) -> Result<TokenFile, DataError> {
    match of(data) {
        Some(place) => tokens_at(&place).await,
        None => tokens_in(data, create).await,
    }
}

/// Changes rows of a stopped server: a running one, which may hold a lock, shares the thread of the test.
pub(crate) async fn execute(data: &Path, statement: &'static str) {
    if is_postgres() {
        CLUSTER.execute(&name_of(data), &[statement]);
        return;
    }
    let mut file = open(data).await;
    sqlx::query(statement).execute(&mut file).await.unwrap();
    // A dropped connection closes later, and may still hold the database when the server starts.
    file.close().await.unwrap();
}

/// The number that a query finds.
pub(crate) async fn number(data: &Path, query: &'static str) -> i64 {
    if is_postgres() {
        return CLUSTER.execute(&name_of(data), &[query]).parse().unwrap();
    }
    let mut file = open(data).await;
    let number = sqlx::query_scalar(query).fetch_one(&mut file).await.unwrap();
    file.close().await.unwrap();
    number
}

/// Copies the file of a data directory to PostgreSQL, if the tests run there.
pub(crate) async fn take_from_file(data: &Path) {
    if let Some(place) = of(data) {
        // The source is of this version, as after a start.
        tokens_in(data, true).await.unwrap().close().await.unwrap();
        copy_database(&database_in(data), &place).await.unwrap();
    }
}

async fn open(data: &Path) -> SqliteConnection {
    let Location::File(path) = database_in(data) else { unreachable!("a data directory has a file") };
    SqliteConnection::connect(path.to_str().unwrap()).await.unwrap()
}
