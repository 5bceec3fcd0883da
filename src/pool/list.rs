//! `roost pool list`: the allocations of a pool.

use std::path::PathBuf;

use anyhow::Result;
use roost_api::time::Timestamp;
use roost_terminal::{BadInput, Exit, Table, print_json, print_line, print_lines};
use serde_json::json;

use super::default_state;
use super::ledger::{self, Ledger};
use super::rule::counted;

/// List the allocations of a pool, and state the reason if the pool pauses
///
/// The command reads the folder of the pool. Therefore it also works when the pool does not run. The list also has up to 200
/// allocations that have already ended.
#[derive(Debug, clap::Args)]
pub(super) struct ListArgs {
    /// Folder of the pool [default: `pool` in the state folder of `roost work`]
    #[arg(long, value_name = "DIR")]
    state: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn execute(args: &ListArgs) -> Result<Exit> {
    let folder = args.state.clone().unwrap_or_else(default_state);
    let Some(ledger) = ledger::read(&folder)? else {
        let path = folder.display();
        return Err(
            BadInput(format!("no pool has used the folder {path}: name its folder with --state")).into()
        );
    };
    let is_running = ledger::is_in_use(&folder);
    let paused_until = ledger.paused_until().filter(|until| *until > Timestamp::now());
    if args.json {
        let mut document = json!(ledger);
        document["running"] = json!(is_running);
        document["paused_until"] = json!(paused_until);
        print_json(&document)?;
        return Ok(Exit::Done);
    }
    if !ledger.allocations.is_empty() {
        print_lines(format_args!("{}", table(&ledger)))?;
    }
    let (waiting, working) = (ledger.waiting().len() as u64, u64::from(ledger.running(true)));
    let starting = u64::from(ledger.running(false));
    print_line(format_args!(
        "{} submitted; {waiting} waiting, {starting} without a registered worker, {working} working",
        counted(ledger.submitted, "allocation")
    ))?;
    if let Some(until) = paused_until {
        let failures = counted(ledger.failures.in_a_row.into(), "failure");
        print_line(format_args!("paused until {until} after {failures}: {}", ledger.failures.why))?;
    } else if ledger.failures.in_a_row > 0 {
        print_line(format_args!("last failure: {}", ledger.failures.why))?;
    }
    if is_running {
        print_line(format_args!("last look at {}: {}", ledger.updated_at, ledger.why))?;
    } else {
        print_line(format_args!("no pool runs on this folder; its last look was at {}", ledger.updated_at))?;
    }
    Ok(Exit::Done)
}

fn table(ledger: &Ledger) -> Table {
    let mut table = Table::new(["id", "state", "worker", "submitted", "started", "ended", "reason"]);
    let time = |time: Option<Timestamp>| time.map_or_else(|| "–".to_owned(), |time| time.to_string());
    for one in &ledger.allocations {
        table.row([
            one.id.to_string(),
            one.state.as_str().to_owned(),
            if one.registered { "registered" } else { "–" }.to_owned(),
            one.submitted_at.to_string(),
            time(one.started_at),
            time(one.ended_at),
            one.reason.clone(),
        ]);
    }
    table
}
