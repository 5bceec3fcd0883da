//! The options that name the data of a server. The address of a database may hold a password.

use std::ffi::OsStr;
use std::path::PathBuf;

use anyhow::Result;
use clap::builder::TypedValueParser;
use clap::error::ErrorKind;
use clap::{Arg, Command, Error};
use roost_server::{DataError, Location, TokenFile};
use roost_terminal::BadInput;

/// The option.
#[derive(Debug, clap::Args)]
pub(crate) struct Database {
    /// PostgreSQL database for the queue and the results. Without this option, the queue and the results are in the data folder.
    /// Roost reads the password of the database from the environment variable PGPASSWORD. If this variable is not set, Roost reads
    /// the password from the file that PGPASSFILE names (by default ~/.pgpass)
    #[arg(
        long = "database",
        global = true,
        env = "ROOST_DATABASE",
        hide_env_values = true,
        value_name = "postgres://USER@HOST/DATABASE",
        value_parser = Place(address)
    )]
    pub(crate) address: Option<Location>,
}

/// The data of a server, for commands that need no running server.
#[derive(Debug, clap::Args)]
pub(crate) struct ServerData {
    /// Data folder of the server
    #[arg(long = "data", global = true, default_value = "roost-data", value_name = "DIR")]
    pub(crate) folder: PathBuf,
    #[command(flatten)]
    pub(crate) database: Database,
}

impl ServerData {
    /// Opens its tokens and projects. `create` creates a missing database in the folder.
    pub(crate) async fn open(&self, create: bool) -> Result<TokenFile> {
        Ok(match &self.database.address {
            Some(database) => roost_server::tokens_at(database).await?,
            None => roost_server::tokens_in(&self.folder, create).await.map_err(with_advice)?,
        })
    }
}

/// An empty data folder is most likely not that of the server.
pub(crate) fn with_advice(error: DataError) -> anyhow::Error {
    match error {
        DataError::Nothing(_) => {
            BadInput(format!("{error}; give the data folder of the server with --data")).into()
        }
        other => other.into(),
    }
}

/// Reads an address. Its errors do not quote the address: clap's own would print a password to the terminal or the journal.
#[derive(Clone, Copy)]
pub(crate) struct Place(pub(crate) fn(&str) -> Result<Location, String>);

fn address(text: &str) -> Result<Location, String> {
    text.parse().map_err(|error: roost_server::LocationError| error.to_string())
}

impl TypedValueParser for Place {
    type Value = Location;

    fn parse_ref(&self, command: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<Location, Error> {
        let text = value.to_str().ok_or_else(|| "the address is not UTF-8".to_owned());
        text.and_then(self.0).map_err(|reason| {
            let option = arg.map(ToString::to_string).unwrap_or_default();
            Error::raw(ErrorKind::ValueValidation, format!("invalid value for '{option}': {reason}\n"))
                .with_cmd(command)
        })
    }
}
