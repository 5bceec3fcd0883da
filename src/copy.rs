//! `roost copy`: move the database of a server between SQLite and PostgreSQL.

use std::path::Path;

use anyhow::Result;
use roost_server::{Location, copy_database, database_in};
use roost_terminal::{Exit, Table, message, print_json, print_lines};
use serde_json::json;

use crate::database::with_advice;

/// Copy the database of a stopped server to PostgreSQL, or from PostgreSQL to a data folder
///
/// The option `--from` names the source, and `--to` names the target: a data folder, or the address of a PostgreSQL database. The
/// target must be empty. After the copy, the command compares every table of the source and the target. The command does not copy
/// frames, checkpoints and filled states: they stay in their present folder or bucket.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Data folder or database to read
    #[arg(long, value_name = "DIR|postgres://USER@HOST/DATABASE", value_parser = crate::database::Place(place))]
    from: Location,
    /// Data folder or database to write
    #[arg(long, value_name = "DIR|postgres://USER@HOST/DATABASE", value_parser = crate::database::Place(place))]
    to: Location,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

fn place(text: &str) -> Result<Location, String> {
    // Settings as libpq takes them are no folder, and an error about a folder quotes it.
    if text.contains("://") || text.contains("password=") {
        return text.parse().map_err(|error: roost_server::LocationError| error.to_string());
    }
    Ok(database_in(Path::new(text)))
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let copied = copy_database(&args.from, &args.to).await.map_err(with_advice)?;
    if args.json {
        let tables: Vec<_> = copied
            .iter()
            .map(|copied| json!({"table": copied.table, "rows": copied.rows, "checksum": copied.checksum}))
            .collect();
        print_json(&json!(tables))?;
    } else {
        let mut table = Table::new(["table", "rows", "checksum"]);
        for copied in &copied {
            table.row([copied.table.to_owned(), copied.rows.to_string(), copied.checksum.clone()]);
        }
        print_lines(format_args!("{table}"))?;
    }
    message!("copied; the objects are still in the folder or bucket that they were in");
    Ok(Exit::Done)
}
