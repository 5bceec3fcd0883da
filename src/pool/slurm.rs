//! Slurm's commands. Each has a time limit, since Slurm's controller may not answer.

use std::process::{Output, Stdio};
use std::time::Duration;

use roost_terminal::BadInput;
use tokio::io::AsyncWriteExt;
use tokio::process::Command;

use super::parse::{self, SACCT_FORMAT, SQUEUE_FORMAT, SlurmJob};

/// Maximum time of a command.
const TIMEOUT: Duration = Duration::from_secs(60);

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
    let format = format!("--format={SQUEUE_FORMAT}");
    let arguments = ["--noheader", "--states=all", &format!("--name={name}"), &format].map(str::to_owned);
    Ok(parse::squeue(&run("squeue", &arguments, "").await?))
}

/// The records of Slurm's accounts about jobs that the queue does not show; none without accounts.
pub(super) async fn accounts(ids: &[u64]) -> Vec<SlurmJob> {
    let jobs = format!("--jobs={}", joined(ids));
    let arguments =
        ["--noheader", "--parsable2", &jobs, &format!("--format={SACCT_FORMAT}")].map(str::to_owned);
    run("sacct", &arguments, "").await.map_or_else(|_| Vec::new(), |text| parse::sacct(&text))
}

/// Cancels allocations; `only_waiting` spares those that have started meanwhile.
pub(super) async fn cancel(ids: &[u64], only_waiting: bool) -> Result<(), String> {
    if ids.is_empty() {
        return Ok(());
    }
    let state = only_waiting.then(|| "--state=PENDING".to_owned());
    let arguments: Vec<String> = state.into_iter().chain(ids.iter().map(u64::to_string)).collect();
    run("scancel", &arguments, "").await.map(drop)
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
    let mut child = command.kill_on_drop(true).spawn()?;
    if let Some(mut stdin) = child.stdin.take() {
        // A command that does not read its input closes it.
        let _ = stdin.write_all(input.as_bytes()).await;
    }
    child.wait_with_output().await
}

/// The last line with text.
pub(super) fn last_line(text: &str) -> &str {
    text.lines().map(str::trim).rfind(|line| !line.is_empty()).unwrap_or_default()
}
