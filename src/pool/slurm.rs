//! Slurm's commands. Each has a time limit, since Slurm's controller may not answer.

use std::process::{Output, Stdio};
use std::time::Duration;

use roost_terminal::BadInput;
use tokio::io::AsyncWriteExt;
use tokio::process::Command;

use super::ledger::last_line;
use super::parse::{self, SACCT_FORMAT, SQUEUE_FORMAT, SlurmJob};

/// Maximum time of a command.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Variables that change what Slurm's commands print, or which jobs they show. Those of `sbatch` that choose resources stay.
const REMOVED_PREFIXES: [&str; 4] = ["SQUEUE_", "SACCT_", "SCANCEL_", "SCONTROL_"];
/// Variables of `sbatch` that the pool does not allow as options.
const REMOVED: [&str; 6] = [
    "SLURM_CLUSTERS",
    "SBATCH_CLUSTERS",
    "SBATCH_ARRAY_INX",
    "SBATCH_WAIT",
    "SBATCH_EXPORT",
    "SBATCH_SIGNAL",
];

/// Checks that this machine has `sbatch`.
pub(super) async fn check() -> Result<(), BadInput> {
    match run("sbatch", &["--version".to_owned()], "").await {
        Ok(_) => Ok(()),
        Err(why) => Err(BadInput(format!("Slurm's commands cannot be used here: {why}"))),
    }
}

/// Submits an allocation. Returns its id.
pub(super) async fn submit(arguments: &[String], script: &str) -> Result<u64, String> {
    let answer = run("sbatch", arguments, script).await?;
    parse::sbatch(&answer).ok_or_else(|| format!("sbatch printed no id: {}", last_line(&answer)))
}

/// The jobs of a name: those in Slurm's queue, and those that ended within its memory (MinJobAge, 5 minutes by default).
pub(super) async fn jobs(name: &str) -> Result<Vec<SlurmJob>, String> {
    queue(&format!("--name={name}")).await
}

/// Jobs of the queue, in all partitions, hidden ones as well.
async fn queue(filter: &str) -> Result<Vec<SlurmJob>, String> {
    let format = format!("--format={SQUEUE_FORMAT}");
    let arguments = ["--noheader", "--all", "--states=all", filter, &format].map(str::to_owned);
    Ok(parse::squeue(&run("squeue", &arguments, "").await?))
}

/// Jobs that the queue does not show under their name, by their ids. A job that is not in the answer is unknown to Slurm. An error
/// says nothing about any job.
pub(super) async fn jobs_by_id(ids: &[u64]) -> Result<Vec<SlurmJob>, String> {
    let left = |found: &[SlurmJob]| -> Vec<u64> {
        ids.iter().copied().filter(|id| found.iter().all(|job| job.id != *id)).collect()
    };
    let mut found = Vec::new();
    if !ids.is_empty() {
        found = known(queue(&format!("--jobs={}", joined(ids))).await)?.unwrap_or_default();
        found.retain(|job| ids.contains(&job.id));
    }
    let missing = left(&found);
    if !missing.is_empty() {
        // Accounts may show a job as running that the controller has lost: they say only how jobs ended.
        let has_ended = |job: &SlurmJob| missing.contains(&job.id) && !job.state.is_held();
        found.extend(accounts(&missing).await.into_iter().filter(has_ended));
    }
    for id in left(&found) {
        let arguments = ["--all", "--oneliner", "show", "job", &id.to_string()].map(str::to_owned);
        let text = known(run("scontrol", &arguments, "").await)?.unwrap_or_default();
        found.extend(parse::scontrol(&text).filter(|job| job.id == id));
    }
    Ok(found)
}

/// An answer about jobs; none if Slurm does not know their ids.
fn known<T>(answer: Result<T, String>) -> Result<Option<T>, String> {
    match answer {
        Ok(answer) => Ok(Some(answer)),
        Err(why) if why.to_lowercase().contains("invalid job id") => Ok(None),
        Err(why) => Err(why),
    }
}

/// The records of Slurm's accounts about jobs; none without accounts.
async fn accounts(ids: &[u64]) -> Vec<SlurmJob> {
    let jobs = format!("--jobs={}", joined(ids));
    let arguments =
        ["--noheader", "--parsable2", &jobs, &format!("--format={SACCT_FORMAT}")].map(str::to_owned);
    run("sacct", &arguments, "").await.map_or_else(|_| Vec::new(), |text| parse::sacct(&text))
}

/// Cancels waiting allocations. It spares those that have started meanwhile.
pub(super) async fn cancel_waiting(ids: &[u64]) -> Result<(), String> {
    let state = "--state=PENDING".to_owned();
    let arguments: Vec<String> = [state].into_iter().chain(ids.iter().map(u64::to_string)).collect();
    run("scancel", &arguments, "").await.map(drop)
}

/// Cancels all allocations of a pool by their name, even those that it could not record.
pub(super) async fn cancel_all(name: &str) -> Result<(), String> {
    run("scancel", &[format!("--name={name}")], "").await.map(drop)
}

fn joined(ids: &[u64]) -> String {
    ids.iter().map(u64::to_string).collect::<Vec<_>>().join(",")
}

/// Runs a command to its end. Returns its output, or the reason why it failed.
async fn run(program: &str, arguments: &[String], input: &str) -> Result<String, String> {
    let ended = tokio::time::timeout(TIMEOUT, output(program, arguments, input)).await;
    let output = match ended {
        Ok(Ok(output)) => output,
        Ok(Err(error)) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err(format!("{program} is not installed on this machine"));
        }
        Ok(Err(error)) => return Err(format!("{program}: {error}")),
        Err(_) => return Err(format!("{program} did not end within {} s", TIMEOUT.as_secs())),
    };
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let why = last_line(&said);
    let program_said = why.starts_with(program);
    Err(match why {
        "" => format!("{program} failed ({})", output.status),
        why if program_said => why.to_owned(),
        why => format!("{program}: {why}"),
    })
}

async fn output(program: &str, arguments: &[String], input: &str) -> std::io::Result<Output> {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // Ctrl-C in a terminal ends the pool, and not a command that submits. Slurm runs on no other system.
    #[cfg(unix)]
    command.process_group(0);
    for (name, _) in std::env::vars_os().filter(|(name, _)| is_removed(&name.to_string_lossy())) {
        command.env_remove(name);
    }
    let mut child = command.kill_on_drop(true).spawn()?;
    if let Some(mut stdin) = child.stdin.take() {
        // A command that does not read its input closes it.
        let _ = stdin.write_all(input.as_bytes()).await;
    }
    child.wait_with_output().await
}

/// Whether Slurm's commands do not get a variable of the environment.
fn is_removed(name: &str) -> bool {
    REMOVED.contains(&name) || REMOVED_PREFIXES.iter().any(|prefix| name.starts_with(prefix))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_that_hide_or_rename_jobs_do_not_reach_slurm() {
        for name in ["SQUEUE_PARTITION", "SQUEUE_FORMAT2", "SACCT_FORMAT", "SCANCEL_STATE", "SCONTROL_ALL"] {
            assert!(is_removed(name), "{name}");
        }
        for name in REMOVED {
            assert!(is_removed(name), "{name}");
        }
        // Without an option `--signal`, it would set one.
        assert!(is_removed("SBATCH_SIGNAL"));
        for name in ["PATH", "SLURM_CONF", "SBATCH_PARTITION", "SBATCH_ACCOUNT", "ROOST_TOKEN"] {
            assert!(!is_removed(name), "{name}");
        }
    }

    #[test]
    fn only_an_invalid_id_says_that_a_job_is_unknown() {
        let error = |why: &str| known::<()>(Err(why.to_owned()));
        assert_eq!(error("slurm_load_jobs error: Invalid job id specified"), Ok(None));
        assert_eq!(error("squeue did not end within 60 s"), Err("squeue did not end within 60 s".to_owned()));
        assert_eq!(known(Ok(7)), Ok(Some(7)));
    }
}
