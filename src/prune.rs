//! `roost prune`: what ended long ago goes.

use std::time::Duration;

use anyhow::Result;
use serde_json::json;

use crate::delete::Deleting;
use crate::exit::Exit;
use crate::ui;

/// Delete sweeps and single jobs that ended long ago; without --yes only say what would go
///
/// With them go their results, and meshes uploaded that long ago that nothing names any more. `roost serve --prune-after` does the
/// same by itself.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Since their end: a number of hours, days or weeks, such as 12h, 30d or 8w
    #[arg(long, value_name = "AGE", value_parser = age)]
    older_than: Duration,
    #[command(flatten)]
    deleting: Deleting,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let Args { older_than, deleting } = args;
    let pruned = deleting.server.client()?.prune(older_than, !deleting.yes).await?;
    if deleting.json {
        ui::json(&json!(pruned))?;
        return Ok(Exit::Done);
    }
    for sweep in &pruned.sweeps {
        ui::println(format_args!(
            "{}  {}: {} jobs, ended {}",
            sweep.id, sweep.name, sweep.jobs, sweep.ended_at
        ))?;
    }
    let verb = deleting.verb();
    let (sweeps, jobs, meshes) = (pruned.sweeps.len(), pruned.jobs, pruned.meshes.len());
    ui::println(format_args!("{verb} {sweeps} sweeps, {jobs} single jobs, {meshes} meshes"))?;
    if !deleting.yes && !pruned.is_empty() {
        ui::say!("nothing is deleted yet; --yes does it");
    }
    Ok(Exit::Done)
}

/// An age as people write it.
pub(crate) fn age(text: &str) -> Result<Duration, String> {
    let wrong = || "give a number of hours, days or weeks, such as 12h, 30d or 8w".to_owned();
    let (number, unit) = text.split_at_checked(text.len().saturating_sub(1)).ok_or_else(wrong)?;
    let hours = match unit {
        "h" => 1,
        "d" => 24,
        "w" => 24 * 7,
        _ => return Err(wrong()),
    };
    let number: u32 = number.parse().map_err(|_| wrong())?;
    Ok(Duration::from_secs(u64::from(number) * hours * 3600))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_age_has_a_number_and_a_unit() {
        for (text, hours) in [("12h", 12), ("30d", 720), ("8w", 1344), ("0d", 0)] {
            assert_eq!(age(text), Ok(Duration::from_secs(hours * 3600)), "{text}");
        }
        for text in ["", "d", "30", "30 d", "-1d", "1.5d", "30m", "30é"] {
            assert!(age(text).is_err(), "{text}");
        }
    }
}
