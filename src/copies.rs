//! `roost backup` and `roost restore`: everything a server keeps, copied and put back.

use std::path::PathBuf;

use anyhow::Result;
use roost_server::DataError;
use serde_json::json;

use crate::exit::{BadInput, Exit};
use crate::ui;

/// Copy everything a server keeps into a folder, while it runs or not
///
/// The copy is of one moment and has been checked. Jobs that run at that moment run again after a restore.
#[derive(Debug, clap::Args)]
pub(crate) struct Backup {
    /// Folder for the copy, which must have none yet
    folder: PathBuf,
    #[command(flatten)]
    common: Common,
}

/// Put a backup into a data folder that has no database yet
#[derive(Debug, clap::Args)]
pub(crate) struct Restore {
    /// Folder of the backup
    folder: PathBuf,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, clap::Args)]
struct Common {
    /// Folder of everything the server keeps
    #[arg(long, default_value = "roost-data", value_name = "DIR")]
    data: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) async fn backup(args: Backup) -> Result<Exit> {
    let copied = roost_server::backup(&args.common.data, &args.folder).await;
    report(&copied.map_err(named)?, args.common.json)
}

/// Where a data folder has nothing, it is most likely another one than that of the server.
pub(crate) fn named(error: DataError) -> anyhow::Error {
    match error {
        DataError::Nothing(_) => {
            BadInput(format!("{error}: name the folder of the server with --data")).into()
        }
        other => other.into(),
    }
}

pub(crate) async fn restore(args: Restore) -> Result<Exit> {
    report(&roost_server::restore(&args.folder, &args.common.data).await?, args.common.json)
}

fn report(copied: &roost_server::BackupReport, as_json: bool) -> Result<Exit> {
    let roost_server::BackupReport { bytes, jobs, results, absent_objects } = *copied;
    if as_json {
        let copied =
            json!({"bytes": bytes, "jobs": jobs, "results": results, "absent_objects": absent_objects});
        ui::json(&copied)?;
    } else {
        ui::println(format_args!(
            "{jobs} jobs and {results} results in {:.1} MiB",
            bytes as f64 / 1_048_576.0
        ))?;
    }
    if absent_objects > 0 {
        ui::say!(
            "warning: objects (frames of jobs) that are not in the folder were not copied: {absent_objects}"
        );
    }
    Ok(Exit::Done)
}
