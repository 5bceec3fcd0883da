//! `roost pool slurm --dry-run`: the batch script, the command, and the decision of one look.

use anyhow::Result;
use roost_api::time::Timestamp;
use roost_terminal::{Exit, message, print_line, print_lines};

use super::args::SlurmArgs;
use super::rule::{Decision, counted};
use super::script::SlurmSubmission;
use super::{default_state, ledger, observe, run, slurm};

pub(super) async fn execute(args: SlurmArgs) -> Result<Exit> {
    args.check()?;
    let client = args.server.client()?;
    let folder = std::path::absolute(args.state.clone().unwrap_or_else(default_state))?;
    let stored = ledger::read(&folder)?;
    let mut ledger = run::ledger_for(&args, stored);
    let submission = SlurmSubmission::new(&args, &ledger.name, &folder)?;
    print_lines(format_args!("{}\n", submission.script))?;
    print_line(format_args!("command: {} < the script above", submission.command()))?;
    if let Some(warning) = run::loopback_warning(client.server()) {
        message!("warning: {warning}");
    }
    match slurm::jobs(&ledger.name).await {
        Ok(jobs) => drop(observe::record_jobs(&mut ledger, &jobs, Timestamp::now())),
        Err(why) => message!("note: without a look at Slurm ({why}); as if it held no other allocation"),
    }
    let depth = client.queue_depth().await?;
    // As if an empty queue had been empty for long.
    let decision = run::decision(&args, &ledger, &depth, Some(Timestamp(0)), Timestamp::now());
    for (_, warning) in &decision.warnings {
        message!("warning: {warning}");
    }
    print_line(format_args!("decision: {}", in_words(&decision)))?;
    message!("nothing is submitted or cancelled");
    Ok(Exit::Done)
}

fn in_words(decision: &Decision) -> String {
    let Decision { submit, cancel, pause, why, .. } = decision;
    if let Some(pause) = pause {
        return format!("pause until {}: {}", pause.until, pause.why);
    }
    match (*submit, cancel.len() as u64) {
        (0, 0) => format!("do nothing: {why}"),
        (0, count) => format!("cancel {}: {why}", counted(count, "waiting allocation")),
        (count, _) => format!("submit {}: {why}", counted(count.into(), "allocation")),
    }
}
