//! Options of `roost pool slurm`, and their limits.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use roost_terminal::BadInput;
use roost_worker::Slots;

use super::rule::Limits;
use crate::interval::time;
use crate::target;
use crate::work::slots;

/// Time of a worker after its grace: storing checkpoints and delivering results.
const HAND_BACK: Duration = Duration::from_secs(10);

/// Shortest time limit: Slurm counts whole minutes.
const MIN_TIME_LIMIT: Duration = Duration::from_secs(60);

/// Slurm may send its signal a minute early. A shorter allocation could get it before its worker has started, and does without.
const MIN_SIGNALLED: Duration = Duration::from_secs(180);

/// Default of `KillWait`, the time between SIGTERM and SIGKILL at the time limit.
const KILL_WAIT: Duration = Duration::from_secs(30);

/// Submit workers to Slurm while queued jobs need more workers
///
/// This command is the pool. It runs in the foreground on a machine that has the program `sbatch` of Slurm; the server may be on
/// another machine. An allocation is a batch job of Slurm that runs `roost work`. An allocation ends when all its workers have
/// ended. A worker ends when it has had no job of the queue for the time --idle-timeout. A minute before the time limit of an
/// allocation, its workers store checkpoints and hand their jobs back. If this limit is below three minutes, they do so at the
/// limit. The workers do the same if somebody cancels the allocation with the command scancel, or if Slurm stops the allocation for
/// a more important job. Ctrl-C or SIGTERM ends the pool, but its allocations continue. If you start the pool again with the same
/// command, the pool finds these allocations and uses them. The access token needs the scopes `read` and `worker`.
#[derive(Debug, clap::Args)]
pub(super) struct SlurmArgs {
    #[command(flatten)]
    pub(super) server: target::Server,
    /// Maximum number of allocations that wait in Slurm's queue, 1 to 1000
    #[arg(long, default_value_t = 4, value_name = "N", value_parser = number::<1000>)]
    pub(super) backlog: u32,
    /// Maximum number of workers in all allocations, 1 to 100000
    #[arg(long, default_value_t = 64, value_name = "N", value_parser = number::<100_000>)]
    pub(super) max_workers: u32,
    /// Number of workers in an allocation, 1 to 1024; these workers share the processors of one node
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = number::<1024>)]
    pub(super) workers_per_alloc: u32,
    /// A worker exits after this time without a job of the queue
    #[arg(long, default_value = "5m", value_name = "TIME", value_parser = time)]
    pub(super) idle_timeout: Duration,
    /// Time limit of an allocation, 1m to 168h; Slurm rounds this time up to full minutes
    #[arg(long, default_value = "1h", value_name = "TIME", value_parser = time_limit)]
    pub(super) time_limit: Duration,
    /// The pool forecasts when the present workers will start each queued job. For jobs that start within this time, the pool submits
    /// no allocation
    #[arg(long, default_value = "1m", value_name = "TIME", value_parser = time)]
    pub(super) start_within: Duration,
    /// Maximum number of jobs that each worker runs at the same time: `auto`, or a number from 1 to 1024, as for `roost work`
    #[arg(long, default_value = "auto", value_name = "N", value_parser = slots)]
    pub(super) slots: Slots,
    /// Time that running jobs may continue after the signal of Slurm, before the worker hands the jobs back. Choose a value that is
    /// at least 10 s less than the setting KillWait of Slurm
    #[arg(long, default_value_t = 10, value_name = "SECONDS", value_parser = grace)]
    pub(super) grace: u64,
    /// Time between two checks of the server's queue and of Slurm's queue
    #[arg(long, default_value = "10s", value_name = "TIME", value_parser = time)]
    pub(super) interval: Duration,
    /// A failure means that Slurm refuses an allocation, that an allocation fails, or that an allocation ends before one of its
    /// workers has registered. After 3 failures in a row, the pool pauses for this time. After each further failure, the pause is
    /// twice as long, up to 1h
    #[arg(long, default_value = "1m", value_name = "TIME", value_parser = time)]
    pub(super) retry_pause: Duration,
    /// Folder for the pool's records, its logs, and the results that the server has not yet received. All compute nodes must have
    /// access to this folder [default: `pool` in the state folder of `roost work`]
    #[arg(long, value_name = "DIR")]
    pub(super) state: Option<PathBuf>,
    /// Path of the program roost on the compute nodes [default: the path of this program]
    #[arg(long, value_name = "FILE")]
    pub(super) roost: Option<PathBuf>,
    /// Cancel all allocations of the pool when the pool ends
    #[arg(long)]
    pub(super) cancel_on_exit: bool,
    /// Submit nothing: print the batch script, the sbatch command, and what the pool would do now
    #[arg(long)]
    pub(super) dry_run: bool,
    /// Options for sbatch, such as --partition=gpu --gres=gpu:1; write the value of a long option after `=`
    #[arg(last = true, value_name = "SBATCH OPTIONS")]
    pub(super) sbatch: Vec<String>,
}

/// Parses a number from 1 to a maximum.
fn number<const MAX: u32>(text: &str) -> Result<u32, String> {
    let found = text.parse().ok().filter(|number| (1..=MAX).contains(number));
    found.ok_or_else(|| format!("write a number of 1 to {MAX}"))
}

/// Parses the grace of workers; the time limit may allow less.
fn grace(text: &str) -> Result<u64, String> {
    let found = text.parse().ok().filter(|seconds| *seconds <= 50);
    found.ok_or_else(|| "write a number of seconds from 0 to 50".to_owned())
}

/// Parses the time limit of an allocation.
fn time_limit(text: &str) -> Result<Duration, String> {
    let found = time(text).ok().filter(|time| *time >= MIN_TIME_LIMIT);
    found.ok_or_else(|| "write a time from 1m to 168h, such as 90s, 30m or 24h".to_owned())
}

/// Long options of sbatch that the pool sets itself, and those that would break its accounts.
const OWN_LONG: &[(&str, &str)] = &[
    ("job-name", "the pool finds its allocations by their name"),
    ("time", "use --time-limit"),
    ("signal", "the pool sets it, so that workers hand their jobs back"),
    ("array", "the pool submits one allocation at a time"),
    ("parsable", "the pool sets it"),
    ("requeue", "the pool submits a new allocation instead"),
    ("no-requeue", "the pool sets it"),
    ("wrap", "the pool writes the batch script"),
    ("wait", "the pool watches its allocations itself"),
    ("clusters", "run a pool on each cluster"),
    ("test-only", "use --dry-run"),
    ("cluster", "run a pool on each cluster"),
    ("nodes", "an allocation is on one node"),
    ("output", "the pool reads the log"),
    ("export", "workers need the environment of the pool; --export=ALL,NAME=VALUE adds to it"),
    ("help", "see `man sbatch`"),
    ("usage", "see `man sbatch`"),
    ("version", "see `man sbatch`"),
];

/// The same as short options.
const OWN_SHORT: &[(char, &str)] = &[
    ('J', "job-name"),
    ('t', "time"),
    ('a', "array"),
    ('W', "wait"),
    ('M', "clusters"),
    ('N', "nodes"),
    ('o', "output"),
    ('V', "version"),
    ('h', "help"),
    ('u', "usage"),
];

/// Other short options of sbatch without a value: a group such as `-Qs` may have several.
const SHORT_FLAGS: &str = "HkOQsv";

/// Other short options of sbatch with a value, which may be the next word.
const SHORT_WITH_VALUE: &str = "AbBcCdDeFGiLmnpqSwx";

impl SlurmArgs {
    /// Checks what no option shows alone.
    pub(super) fn check(&self) -> Result<()> {
        if self.max_workers < self.workers_per_alloc {
            let (max, each) = (self.max_workers, self.workers_per_alloc);
            return bad(format!(
                "invalid value '{max}' for '--max-workers': an allocation has {each} workers (--workers-per-alloc), so that {each} \
                 to 100000 are allowed"
            ));
        }
        let most = (self.warning().unwrap_or(KILL_WAIT) - HAND_BACK).as_secs();
        if self.grace > most {
            let signal = match self.warning() {
                Some(warning) => {
                    format!("Slurm's signal comes {} s before the time limit", warning.as_secs())
                }
                None => format!(
                    "Slurm kills workers {} s after its signal (KillWait, by default) if --time-limit is below 3m",
                    KILL_WAIT.as_secs()
                ),
            };
            return bad(format!(
                "invalid value '{}' for '--grace': 0 to {most} are allowed, since {signal}, and workers need {} s to hand their jobs \
                 back",
                self.grace,
                HAND_BACK.as_secs()
            ));
        }
        check_sbatch(&self.sbatch).map_err(|why| BadInput(why).into())
    }

    /// Time between the signal that the pool asks for and the time limit: a minute, and less in short allocations.
    ///
    /// The shortest have none: they get SIGTERM at the time limit, and are killed [`KILL_WAIT`] later.
    pub(super) fn warning(&self) -> Option<Duration> {
        (self.time_limit >= MIN_SIGNALLED).then(|| (self.time_limit / 4).min(Duration::from_secs(60)))
    }

    /// The limits of the decision.
    pub(super) fn limits(&self) -> Limits {
        Limits {
            backlog: self.backlog,
            max_workers: self.max_workers,
            workers_per_alloc: self.workers_per_alloc,
            start_within: self.start_within,
            work_time: self.time_limit - self.warning().unwrap_or_default(),
            retry_pause: self.retry_pause,
        }
    }

    /// The number of slots, if it is fixed.
    pub(super) fn fixed_slots(&self) -> Option<u32> {
        match self.slots {
            Slots::Fixed(slots) => Some(slots as u32),
            Slots::Auto => None,
        }
    }
}

fn bad(why: String) -> Result<()> {
    Err(BadInput(why).into())
}

/// Refuses options that the pool sets itself, and words that sbatch would take for a script.
///
/// sbatch reads its options with getopt_long. An unambiguous beginning of a long name is enough, and a group has several short options.
/// The next word may be a value, so that a word after a long option alone is not allowed.
fn check_sbatch(options: &[String]) -> Result<(), String> {
    let mut words = options.iter().peekable();
    while let Some(word) = words.next() {
        if let Some(long) = word.strip_prefix("--") {
            let (name, value) =
                long.split_once('=').map_or((long, None), |(name, value)| (name, Some(value)));
            check_long(word, name, value)?;
            if value.is_none() && words.peek().is_some_and(|next| !next.starts_with("--")) {
                return Err(refused(
                    word,
                    "write its value after '=', as in --partition=gpu, or write it after all short options",
                ));
            }
        } else if let Some(group) = word.strip_prefix('-').filter(|group| !group.is_empty()) {
            if short_wants_value(word, group)? {
                words.next();
            }
        } else {
            return Err(refused(word, "only options for sbatch are allowed, such as --partition=gpu"));
        }
    }
    Ok(())
}

/// Checks a long option. Each beginning of a name of the pool counts as this name, whether sbatch finds it unambiguous or not.
fn check_long(word: &str, name: &str, value: Option<&str>) -> Result<(), String> {
    let adds_to_all = value.is_some_and(|value| value.split(',').any(|part| part == "ALL"));
    let is_own = |own: &str| own.starts_with(name) && !(own == "export" && name == own && adds_to_all);
    match OWN_LONG.iter().find(|(own, _)| is_own(own)) {
        Some((own, why)) => Err(refused(word, &format!("--{own} is not allowed there ({why})"))),
        None => Ok(()),
    }
}

/// Checks a group of short options. Returns whether the next word is the value of its last one.
fn short_wants_value(word: &str, group: &str) -> Result<bool, String> {
    for (at, letter) in group.char_indices() {
        if let Some((_, name)) = OWN_SHORT.iter().find(|(own, _)| *own == letter) {
            return check_long(word, name, None).map(|()| false);
        }
        if SHORT_WITH_VALUE.contains(letter) {
            return Ok(at + letter.len_utf8() == group.len());
        }
        if !SHORT_FLAGS.contains(letter) {
            return Err(refused(
                word,
                &format!("-{letter} is unknown here, so write the long name of the option"),
            ));
        }
    }
    Ok(false)
}

fn refused(word: &str, why: &str) -> String {
    format!("invalid value '{word}' after '--': {why}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(options: &[&str]) -> Result<(), String> {
        check_sbatch(&options.iter().map(|option| (*option).to_owned()).collect::<Vec<_>>())
    }

    #[test]
    fn options_for_sbatch_pass_and_those_of_the_pool_do_not() {
        for fine in [
            &[][..],
            &["--partition=gpu", "--gres=gpu:1"],
            &["-p", "gpu", "--mem=8G", "-c8", "--exclusive"],
            &["--time-min=10", "--exclusive", "--hold"],
            &["-HQpgpuJatWMVhNo", "-p", "--wrap=x"],
            &["--export=ALL", "--export=ALL,A=1", "--export-file=a"],
        ] {
            assert_eq!(check(fine), Ok(()), "{fine:?}");
        }
        for (bad, named) in [
            (&["--partition=gpu", "--time=10"][..], "use --time-limit"),
            (&["-t", "10"], "--time is not allowed"),
            (&["-J", "mine"], "--job-name is not allowed"),
            (&["--array=1-4"], "one allocation at a time"),
            (&["--wrap", "true"], "writes the batch script"),
            (&["-Mother"], "--clusters"),
            (&["--partition=gpu", "job.sh"], "only options for sbatch"),
            (&["-c8", "job.sh"], "'job.sh'"),
            (&["job.sh"], "'job.sh'"),
            // Beginnings of long names.
            (&["--job=x"], "--job-name is not allowed"),
            (&["--arr=1-4"], "--array is not allowed"),
            (&["--no"], "is not allowed"),
            (&["--"], "is not allowed"),
            // Groups of short options.
            (&["-HJx"], "--job-name is not allowed"),
            (&["-Qt10"], "--time is not allowed"),
            (&["-QsW"], "--wait is not allowed"),
            (&["-Hz"], "-z is unknown here"),
            // A word that is a value or a script.
            (&["--exclusive", "job.sh"], "write its value after '='"),
            (&["--comment", "-p", "job.sh"], "write its value after '='"),
            (&["--mem", "8G"], "write its value after '='"),
            (&["-p", "gpu", "job.sh"], "'job.sh'"),
            (&["-"], "only options for sbatch"),
            (&["-Q", ":"], "only options for sbatch"),
            (&["--nodes=2"], "on one node"),
            (&["-N2"], "--nodes is not allowed"),
            (&["--output=a.log"], "reads the log"),
            (&["-o", "a.log"], "--output is not allowed"),
            (&["--export=NONE"], "the environment of the pool"),
            (&["--export=HOME"], "the environment of the pool"),
            (&["--exp=ALL"], "--export is not allowed"),
        ] {
            assert!(check(bad).is_err_and(|why| why.contains(named)), "{bad:?}: {:?}", check(bad));
        }
    }

    #[test]
    fn a_time_limit_has_at_least_a_minute() {
        assert_eq!(time_limit("60s"), Ok(Duration::from_secs(60)));
        assert_eq!(time_limit("168h"), Ok(Duration::from_secs(604_800)));
        for text in ["59s", "0", "169h", "1:00:00", ""] {
            assert!(time_limit(text).is_err_and(|why| why.contains("1m to 168h")), "{text}");
        }
    }
}
