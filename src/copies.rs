//! `roost backup` and `roost restore`: copy the data folder of a server, and restore it.

use std::path::PathBuf;

use anyhow::Result;
use roost_terminal::{BadInput, Exit, message, print_json, print_line};
use serde_json::json;

use crate::database::{Database, with_advice};

/// Copy the data of a server into a folder; the server may be running
///
/// All parts of the copy are from the same moment, and the command checks the copy. In the copy, some jobs may have the state
/// running. After a restore, these jobs run again.
#[derive(Debug, clap::Args)]
pub(crate) struct Backup {
    /// Folder for the copy; this folder must not contain a backup
    folder: PathBuf,
    #[command(flatten)]
    common: Common,
}

/// Restore a backup into a data folder that has no database
#[derive(Debug, clap::Args)]
pub(crate) struct Restore {
    /// Folder of the backup
    folder: PathBuf,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, clap::Args)]
struct Common {
    /// Data folder of the server
    #[arg(long, default_value = "roost-data", value_name = "DIR")]
    data: PathBuf,
    #[command(flatten)]
    database: Database,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Common {
    /// PostgreSQL has programs of its own for this.
    fn refuse_postgres(&self) -> Result<()> {
        let Some(database) = &self.database.address else { return Ok(()) };
        let advice = "back it up with `pg_dump --format=custom`, restore it with `pg_restore`, and copy the folder of objects afterwards";
        Err(BadInput(format!("{database} is a database of PostgreSQL: {advice}")).into())
    }
}

pub(crate) async fn backup(args: Backup) -> Result<Exit> {
    args.common.refuse_postgres()?;
    let copied = roost_server::backup(&args.common.data, &args.folder).await;
    print_copied(&copied.map_err(with_advice)?, args.common.json)
}

pub(crate) async fn restore(args: Restore) -> Result<Exit> {
    args.common.refuse_postgres()?;
    print_copied(&roost_server::restore(&args.folder, &args.common.data).await?, args.common.json)
}

fn print_copied(copied: &roost_server::BackupReport, as_json: bool) -> Result<Exit> {
    let roost_server::BackupReport { bytes, jobs, results, absent_objects } = *copied;
    if as_json {
        let copied =
            json!({"bytes": bytes, "jobs": jobs, "results": results, "absent_objects": absent_objects});
        print_json(&copied)?;
    } else {
        print_line(format_args!(
            "{jobs} jobs and {results} results in {:.1} MiB",
            bytes as f64 / 1_048_576.0
        ))?;
    }
    if absent_objects > 0 {
        message!(
            "warning: {absent_objects} objects (frames of jobs) are not in the data folder and were not copied"
        );
    }
    Ok(Exit::Done)
}
