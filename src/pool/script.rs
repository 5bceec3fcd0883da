//! The batch script of an allocation, and the arguments of `sbatch`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use roost_terminal::BadInput;
use roost_worker::Slots;

use super::args::SlurmArgs;
use super::{ledger, observe};

/// An allocation as it is submitted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Submission {
    /// Arguments of `sbatch`, which reads the script from stdin.
    pub(super) arguments: Vec<String>,
    /// The batch script.
    pub(super) script: String,
}

impl Submission {
    /// The submissions of a pool: all are the same.
    pub(super) fn new(args: &SlurmArgs, name: &str, folder: &Path) -> Result<Self> {
        let roost = match &args.roost {
            Some(path) => path.clone(),
            None => std::env::current_exe().context("cannot find this binary; name it with --roost")?,
        };
        Ok(Self {
            arguments: arguments(args, name, folder),
            script: script(&roost, &worker_arguments(args, folder)?, args),
        })
    }

    /// The command as a shell line.
    pub(super) fn command(&self) -> String {
        let words = self.arguments.iter().map(|word| quoted(word));
        ["sbatch".to_owned()].into_iter().chain(words).collect::<Vec<_>>().join(" ")
    }
}

/// Options on the command line: those in a script give way to the user's environment (`SBATCH_TIMELIMIT`).
fn arguments(args: &SlurmArgs, name: &str, folder: &Path) -> Vec<String> {
    let limit_s = args.time_limit.as_secs();
    let (hours, minutes, seconds) = (limit_s / 3600, limit_s / 60 % 60, limit_s % 60);
    let own = [
        "--parsable".to_owned(),
        format!("--job-name={name}"),
        format!("--time={hours}:{minutes:02}:{seconds:02}"),
        format!("--signal=B:TERM@{}", args.warning().as_secs()),
        "--no-requeue".to_owned(),
        format!("--output={}", log_file(folder, "%j").display()),
    ];
    own.into_iter().chain(args.sbatch.iter().cloned()).collect()
}

/// The log of an allocation.
pub(super) fn log_file(folder: &Path, id: &str) -> PathBuf {
    ledger::logs(folder).join(format!("{id}.log"))
}

/// Arguments of `roost` on a compute node, without those that differ between workers.
fn worker_arguments(args: &SlurmArgs, folder: &Path) -> Result<Vec<String>> {
    let absolute = |path: &Path, option: &str| {
        path.canonicalize()
            .map_err(|error| BadInput(format!("cannot use {option} {}: {error}", path.display())))
    };
    let mut words: Vec<String> = ["work", "--server", args.server.address()].map(str::to_owned).to_vec();
    if let Some(path) = args.server.token_file() {
        words.extend(["--token-file".to_owned(), absolute(path, "--token-file")?.display().to_string()]);
    }
    if let Some(path) = args.server.ca() {
        words.extend(["--ca".to_owned(), absolute(path, "--ca")?.display().to_string()]);
    }
    let slots = match args.slots {
        Slots::Auto => "auto".to_owned(),
        Slots::Fixed(slots) => slots.to_string(),
    };
    let (idle, grace) = (format!("{}s", args.idle_timeout.as_secs()), args.grace.to_string());
    let state = folder.join("worker").display().to_string();
    let rest = ["--idle-timeout", &idle, "--grace", &grace, "--slots", &slots, "--state", &state];
    words.extend(rest.map(str::to_owned));
    Ok(words)
}

fn script(roost: &Path, worker: &[String], args: &SlurmArgs) -> String {
    let worker: Vec<String> = worker.iter().map(|word| quoted(word)).collect();
    let (worker, count) = (worker.join(" "), args.workers_per_alloc);
    let roost = quoted(&roost.display().to_string());
    let name = |number: &str| {
        format!("\"{}$SLURM_JOB_ID-{number}-${{SLURMD_NODENAME:-node}}\"", observe::WORKER_NAME)
    };
    let head = format!(
        "#!/usr/bin/env bash\n\
         #SBATCH --nodes=1\n\
         #SBATCH --ntasks={count}\n\
         # Workers of a Roost server, submitted by `roost pool slurm`. They end when they are idle.\n\
         set -euo pipefail\n\
         threads=$((${{SLURM_CPUS_ON_NODE:-1}} / {count}))\n\
         ((threads)) || threads=1\n\
         arguments=({worker} --threads \"$threads\")\n"
    );
    if count == 1 {
        let name = name("1");
        return format!(
            "{head}\
             # Replaces the shell: Slurm signals the batch process, which must be the worker.\n\
             exec {roost} \"${{arguments[@]}}\" --name {name}\n"
        );
    }
    let name = name("$number");
    format!(
        "{head}\
         workers=()\n\
         # Slurm signals the batch shell before the time limit, which passes the signal on.\n\
         trap 'kill -TERM \"${{workers[@]}}\" 2> /dev/null || true' TERM\n\
         for ((number = 1; number <= {count}; number++)); do\n    \
             {roost} \"${{arguments[@]}}\" --name {name} &\n    \
             workers+=($!)\n\
         done\n\
         status=0\n\
         for worker in \"${{workers[@]}}\"; do\n    \
             code=0\n    \
             wait \"$worker\" || code=$?\n    \
             # A signal ends `wait` before the worker has ended.\n    \
             while kill -0 \"$worker\" 2> /dev/null; do\n        \
                 code=0\n        \
                 wait \"$worker\" || code=$?\n    \
             done\n    \
             ((code == 0)) || status=$code\n\
         done\n\
         exit \"$status\"\n"
    )
}

/// A word for the shell, in quotes if it needs them.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=@%,+".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        args: SlurmArgs,
    }

    fn submission(words: &[&str]) -> Submission {
        let words = ["pool", "--server", "http://head:7373", "--roost", "/opt/a roost"].iter().chain(words);
        let cli = Cli::try_parse_from(words).unwrap_or_else(|error| panic!("{error}"));
        cli.args.check().unwrap();
        Submission::new(&cli.args, "roost-pool-1", Path::new("/home/me/pool")).unwrap()
    }

    #[test]
    fn the_command_has_the_options_of_pool_and_user() {
        let submission = submission(&["--time-limit", "90m", "--", "--partition=gpu", "--comment=a b"]);
        assert_eq!(
            submission.command(),
            "sbatch --parsable --job-name=roost-pool-1 --time=1:30:00 --signal=B:TERM@60 --no-requeue \
             --output=/home/me/pool/logs/%j.log --partition=gpu '--comment=a b'"
        );
    }

    #[test]
    fn one_worker_replaces_the_shell() {
        let script = submission(&["--idle-timeout", "2m"]).script;
        let expected = "#!/usr/bin/env bash\n#SBATCH --nodes=1\n#SBATCH --ntasks=1\n";
        assert!(script.starts_with(expected), "{script}");
        let worker = "arguments=(work --server http://head:7373 --idle-timeout 120s --grace 10 --slots auto \
                      --state /home/me/pool/worker --threads \"$threads\")\n";
        assert!(script.contains(worker), "{script}");
        let end = "exec '/opt/a roost' \"${arguments[@]}\" --name \"slurm-$SLURM_JOB_ID-1-${SLURMD_NODENAME:-node}\"\n";
        assert!(script.ends_with(end), "{script}");
    }

    #[test]
    fn several_workers_get_the_signal_of_the_shell() {
        let script = submission(&["--workers-per-alloc", "3", "--slots", "2"]).script;
        for part in ["#SBATCH --ntasks=3\n", "/ 3))", "number <= 3", "kill -TERM", "--slots 2 "] {
            assert!(script.contains(part), "{part}: {script}");
        }
    }

    #[test]
    fn scripts_are_valid_shell() {
        for words in [&[][..], &["--workers-per-alloc", "2"]] {
            let script = submission(words).script;
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), script).unwrap();
            let check = std::process::Command::new("bash").arg("-n").arg(file.path()).status().unwrap();
            assert!(check.success());
        }
    }

    #[test]
    fn words_are_quoted_for_the_shell() {
        assert_eq!(quoted("--gres=gpu:1"), "--gres=gpu:1");
        assert_eq!(quoted("a b"), "'a b'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
        assert_eq!(quoted("$HOME"), "'$HOME'");
    }

    #[test]
    fn a_short_allocation_is_warned_later() {
        let short = submission(&["--time-limit", "3m"]);
        assert!(short.command().contains(" --time=0:03:00 --signal=B:TERM@45 "), "{}", short.command());
    }
}
