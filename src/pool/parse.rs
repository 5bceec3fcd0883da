//! The output of `squeue`, `sacct`, `scontrol` and `sbatch`, in the forms that every version of Slurm prints: fields between bars.

use super::ledger::AllocationState;

/// Format of `squeue`: id, state, reason. The reason comes last, since it alone may have bars.
pub(super) const SQUEUE_FORMAT: &str = "%i|%T|%r";
/// Format of `sacct`: id, state, exit code.
pub(super) const SACCT_FORMAT: &str = "JobID,State,ExitCode";

/// A job as Slurm shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct SlurmJob {
    pub(super) id: u64,
    pub(super) state: AllocationState,
    /// The reason why it waits, or its exit code.
    pub(super) reason: String,
}

/// The jobs in the output of `squeue --noheader --format=SQUEUE_FORMAT`. Lines of other forms are passed over.
pub(super) fn squeue(text: &str) -> Vec<SlurmJob> {
    let job = |line: &str| {
        let mut fields = line.trim().splitn(3, '|');
        let (id, state, reason) = (fields.next()?, fields.next()?, fields.next()?);
        let reason = if reason == "None" { "" } else { reason };
        let state = state_of(state);
        let reason = if state == AllocationState::Failed && reason.is_empty() {
            reason_of_state(line)
        } else {
            reason.to_owned()
        };
        Some(SlurmJob { id: id.parse().ok()?, state, reason })
    };
    text.lines().filter_map(job).collect()
}

/// The state of a failed job, where Slurm gives no reason: `FAILED` alone says no more than the state.
fn reason_of_state(line: &str) -> String {
    match line.split('|').nth(1).unwrap_or_default() {
        "FAILED" => String::new(),
        state => state.to_lowercase(),
    }
}

/// The jobs in the output of `sacct --noheader --parsable2 --format=SACCT_FORMAT`, without their steps.
pub(super) fn sacct(text: &str) -> Vec<SlurmJob> {
    let job = |line: &str| {
        let mut fields = line.trim().split('|');
        let (id, state, code) = (fields.next()?, fields.next()?, fields.next()?);
        // Steps are `17.batch` and `17.extern`.
        let id = id.parse().ok()?;
        let state = state_of(state);
        let reason = match state {
            AllocationState::Failed => format!("exit code {code}"),
            _ => String::new(),
        };
        Some(SlurmJob { id, state, reason })
    };
    text.lines().filter_map(job).collect()
}

/// The job in the output of `scontrol --oneliner show job`; none in other texts.
pub(super) fn scontrol(text: &str) -> Option<SlurmJob> {
    // Fields that users write may have spaces, but they come later.
    let field = |name: &str| {
        let value = |word: &str| word.strip_prefix(name)?.strip_prefix('=').map(str::to_owned);
        text.split_whitespace().find_map(value)
    };
    let (id, state) = (field("JobId")?, field("JobState")?);
    let reason = field("Reason").filter(|reason| reason != "None").unwrap_or_default();
    Some(SlurmJob { id: id.parse().ok()?, state: state_of(&state), reason })
}

/// The id in the output of `sbatch --parsable`: `17`, or `17;cluster`.
pub(super) fn sbatch(text: &str) -> Option<u64> {
    text.lines().rev().find_map(|line| line.trim().split(';').next()?.parse().ok())
}

/// The state of a job. `sacct` writes `CANCELLED by 1000`.
fn state_of(text: &str) -> AllocationState {
    match text.split_whitespace().next().unwrap_or_default().trim_end_matches('+') {
        "PENDING" | "REQUEUED" | "REQUEUE_FED" | "REQUEUE_HOLD" | "RESV_DEL_HOLD" | "SPECIAL_EXIT" => {
            AllocationState::Waiting
        }
        "RUNNING" | "CONFIGURING" | "COMPLETING" | "RESIZING" | "SIGNALING" | "STAGE_OUT" | "STOPPED"
        | "SUSPENDED" => AllocationState::Running,
        "COMPLETED" => AllocationState::Completed,
        "CANCELLED" => AllocationState::Cancelled,
        "TIMEOUT" => AllocationState::TimedOut,
        "PREEMPTED" | "REVOKED" => AllocationState::Preempted,
        // BOOT_FAIL, DEADLINE, FAILED, LAUNCH_FAILED, NODE_FAIL, OUT_OF_MEMORY, and states of later versions.
        _ => AllocationState::Failed,
    }
}

#[cfg(test)]
mod tests {
    use super::AllocationState::*;
    use super::*;

    fn job(id: u64, state: AllocationState, reason: &str) -> SlurmJob {
        SlurmJob { id, state, reason: reason.to_owned() }
    }

    #[test]
    fn squeue_lines_have_id_state_and_reason() {
        let text = "17|PENDING|Resources\n18|RUNNING|None\n19|PENDING|a|b (c)\n20|COMPLETING|None\n21|CANCELLED|None\n\
                    22|TIMEOUT|TimeLimit\n23|FAILED|NonZeroExitCode\n24|NODE_FAIL|None\n27|FAILED|None\n25|COMPLETED|None\n\
                    26_[1-4]|PENDING|Priority\nslurm_load_jobs error: Unable to contact slurm controller\n\n";
        let expected = [
            job(17, Waiting, "Resources"),
            job(18, Running, ""),
            job(19, Waiting, "a|b (c)"),
            job(20, Running, ""),
            job(21, Cancelled, ""),
            job(22, TimedOut, "TimeLimit"),
            job(23, Failed, "NonZeroExitCode"),
            job(24, Failed, "node_fail"),
            job(27, Failed, ""),
            job(25, Completed, ""),
        ];
        assert_eq!(squeue(text), expected, "arrays and errors are passed over");
    }

    #[test]
    fn sacct_lines_have_id_state_and_exit_code() {
        let text = "17|COMPLETED|0:0\n17.batch|COMPLETED|0:0\n17.extern|COMPLETED|0:0\n18|CANCELLED by 1000|0:15\n18.batch|CANCELLED|0:15\n\
                    19|TIMEOUT|0:0\n20|OUT_OF_MEMORY|0:125\n21|PREEMPTED|0:0\n22|PENDING|0:0\n23|OUT_OF_ME+|0:125\n";
        let expected = [
            job(17, Completed, ""),
            job(18, Cancelled, ""),
            job(19, TimedOut, ""),
            job(20, Failed, "exit code 0:125"),
            job(21, Preempted, ""),
            job(22, Waiting, ""),
            job(23, Failed, "exit code 0:125"),
        ];
        assert_eq!(sacct(text), expected);
        assert_eq!(sacct("Slurm accounting storage is disabled\n"), []);
    }

    #[test]
    fn scontrol_shows_a_job_in_one_line() {
        let text = "JobId=17 JobName=roost-pool-1 UserId=me(1000) JobState=OUT_OF_MEMORY Reason=OutOfMemory Dependency=(null) \
                    ExitCode=0:125 Comment=a JobState=b\n";
        assert_eq!(scontrol(text), Some(job(17, Failed, "OutOfMemory")));
        assert_eq!(scontrol("JobId=17 JobState=RUNNING Reason=None"), Some(job(17, Running, "")));
        assert_eq!(scontrol("slurm_load_jobs error: Invalid job id specified\n"), None);
    }

    #[test]
    fn sbatch_prints_the_id_last() {
        assert_eq!(sbatch("17\n"), Some(17));
        assert_eq!(sbatch("17;cluster\n"), Some(17));
        assert_eq!(sbatch("a note of the site\n17\n"), Some(17));
        assert_eq!(sbatch(""), None);
        assert_eq!(sbatch("Submitted batch job 17\n"), None);
    }
}
