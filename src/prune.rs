//! `roost prune`: delete sweeps and jobs that ended long ago.

use std::time::Duration;

use anyhow::Result;
use roost_terminal::{Exit, message, print_json, print_line};
use serde_json::json;

use crate::delete::DeleteArgs;

/// Delete sweeps and single jobs that ended long ago; without --yes, only show these sweeps and jobs
///
/// The command also deletes the results of these sweeps and jobs. Meshes (STL files) of the same age are deleted too, if no job or
/// sweep uses them. The option `--prune-after` of `roost serve` deletes the same data automatically.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Delete sweeps and jobs that ended longer ago than this time, such as 12h, 30d or 8w (hours, days or weeks)
    #[arg(long, value_name = "AGE", value_parser = age)]
    older_than: Duration,
    #[command(flatten)]
    delete: DeleteArgs,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let Args { older_than, delete } = args;
    let pruned = delete.server.client()?.prune(older_than, !delete.yes).await?;
    if delete.json {
        print_json(&json!(pruned))?;
        return Ok(Exit::Done);
    }
    for sweep in &pruned.sweeps {
        print_line(format_args!(
            "{}  {}: {} jobs, ended {}",
            sweep.id, sweep.name, sweep.jobs, sweep.ended_at
        ))?;
    }
    let verb = delete.verb();
    let (sweeps, jobs, meshes) = (pruned.sweeps.len(), pruned.jobs, pruned.meshes.len());
    print_line(format_args!("{verb} {sweeps} sweeps, {jobs} single jobs, {meshes} meshes"))?;
    if !delete.yes && !pruned.is_empty() {
        message!("nothing is deleted; add --yes to delete");
    }
    Ok(Exit::Done)
}

/// Parses an age such as `30d`.
pub(crate) fn age(text: &str) -> Result<Duration, String> {
    let error = || "write a number of hours, days or weeks, such as 12h, 30d or 8w".to_owned();
    let (number, unit) = text.split_at_checked(text.len().saturating_sub(1)).ok_or_else(error)?;
    let hours = match unit {
        "h" => 1,
        "d" => 24,
        "w" => 24 * 7,
        _ => return Err(error()),
    };
    let number: u32 = number.parse().map_err(|_| error())?;
    Ok(Duration::from_secs(u64::from(number) * hours * 3600))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn age_is_a_number_and_a_unit() {
        for (text, hours) in [("12h", 12), ("30d", 720), ("8w", 1344), ("0d", 0)] {
            assert_eq!(age(text), Ok(Duration::from_secs(hours * 3600)), "{text}");
        }
        for text in ["", "d", "30", "30 d", "-1d", "1.5d", "30m", "30é"] {
            assert!(age(text).is_err(), "{text}");
        }
    }
}
