//! The data of a server: a temporary folder, and a database of PostgreSQL if one is given.

use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};
use reqwest::Url;
use sqlx::{AssertSqlSafe, Connection, PgConnection, SqliteConnection};
use tempfile::TempDir;
use uuid::Uuid;

/// A PostgreSQL server in which databases can be created.
#[derive(Clone)]
pub(super) struct Postgres(Url);

impl Postgres {
    /// The server at an address.
    pub(super) fn at(address: &str) -> Result<Self> {
        let url = Url::parse(address).with_context(|| format!("--postgres {address} is no address"))?;
        ensure!(url.scheme() == "postgres", "--postgres {address} must begin with postgres://");
        Ok(Self(url))
    }

    /// Calls a program of PostgreSQL that creates or drops a database.
    fn call(&self, program: &str, options: &[&str], database: &str) -> Result<()> {
        let command = Command::new(program)
            .args(options)
            .args(["--maintenance-db", self.0.as_str(), database])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .status();
        let status =
            command.with_context(|| format!("cannot start {program}: install the clients of PostgreSQL"))?;
        if !status.success() {
            bail!("{program} {database} failed");
        }
        Ok(())
    }
}

/// The data of one server. It is removed at the end.
pub(super) struct Data {
    folder: TempDir,
    database: Option<(Postgres, String)>,
}

impl Data {
    /// An empty folder, and an empty database if the server is to use PostgreSQL.
    pub(super) fn new(postgres: Option<Postgres>) -> Result<Self> {
        let folder = tempfile::tempdir()?;
        let name = format!("roost_bench_{}", Uuid::now_v7().simple());
        if let Some(postgres) = &postgres {
            postgres.call("createdb", &[], &name)?;
        }
        Ok(Self { folder, database: postgres.map(|postgres| (postgres, name)) })
    }

    /// The options of `roost serve` that name it.
    pub(super) fn options(&self) -> Vec<String> {
        let mut options = vec!["--data".to_owned(), self.folder.path().display().to_string()];
        if let Some((postgres, name)) = &self.database {
            let mut url = postgres.0.clone();
            url.set_path(name);
            options.extend(["--database".to_owned(), url.to_string()]);
        }
        options
    }

    /// A transaction that has read the jobs and stays open, as that of a report or a backup would.
    pub(super) async fn open_transaction(&self) -> Result<OpenTransaction> {
        const READ: &str = "SELECT count(*) FROM jobs";
        Ok(match &self.database {
            Some((postgres, name)) => {
                let mut url = postgres.0.clone();
                url.set_path(name);
                let mut connection = PgConnection::connect(url.as_str()).await?;
                sqlx::raw_sql("BEGIN ISOLATION LEVEL REPEATABLE READ").execute(&mut connection).await?;
                sqlx::raw_sql(READ).execute(&mut connection).await?;
                OpenTransaction::Postgres(connection)
            }
            None => {
                let file = format!("sqlite://{}?mode=ro", self.folder.path().join("roost.db").display());
                let mut connection = SqliteConnection::connect(&file).await?;
                sqlx::raw_sql(AssertSqlSafe(format!("BEGIN; {READ}"))).execute(&mut connection).await?;
                OpenTransaction::Sqlite(connection)
            }
        })
    }
}

/// A transaction that reads, open until it is dropped.
pub(super) enum OpenTransaction {
    Postgres(#[expect(dead_code, reason = "it is open as long as it lives")] PgConnection),
    Sqlite(#[expect(dead_code, reason = "it is open as long as it lives")] SqliteConnection),
}

impl Drop for Data {
    /// The server has ended by now: it is dropped before its data.
    fn drop(&mut self) {
        if let Some((postgres, name)) = &self.database
            && let Err(error) = postgres.call("dropdb", &["--force"], name)
        {
            eprintln!("{error:#}");
        }
    }
}
