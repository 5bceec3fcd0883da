//! The batch script of an allocation, and the arguments of `sbatch`.

use std::path::Path;

use anyhow::{Context, Result};
use roost_terminal::BadInput;
use roost_worker::Slots;

use super::args::SlurmArgs;
use super::{ledger, observe};

/// An allocation as it is submitted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct SlurmSubmission {
    /// Arguments of `sbatch`, which reads the script from stdin.
    pub(super) arguments: Vec<String>,
    /// The batch script.
    pub(super) script: String,
}

impl SlurmSubmission {
    /// The submissions of a pool: all are the same.
    pub(super) fn new(args: &SlurmArgs, name: &str, folder: &Path) -> Result<Self> {
        let roost = match &args.roost {
            Some(path) => path.clone(),
            None => std::env::current_exe().context("cannot find this binary; name it with --roost")?,
        };
        let roost = text(&roost, "--roost")?;
        let folder = text(folder, "--state")?;
        if folder.contains(['%', '\\']) {
            // Slurm replaces such parts of the option `--output`.
            return Err(
                BadInput(format!("cannot use --state {folder}: name a folder without % and \\")).into()
            );
        }
        Ok(Self {
            arguments: arguments(args, name, folder),
            script: script(roost, name, &worker_arguments(args, folder)?, args),
        })
    }

    /// The command as a shell line.
    pub(super) fn command(&self) -> String {
        let words = self.arguments.iter().map(|word| quoted(word));
        ["sbatch".to_owned()].into_iter().chain(words).collect::<Vec<_>>().join(" ")
    }
}

/// Options on the command line: those in a script give way to the user's environment (`SBATCH_TIMELIMIT`).
fn arguments(args: &SlurmArgs, name: &str, folder: &str) -> Vec<String> {
    let limit_s = args.time_limit.as_secs();
    let (hours, minutes, seconds) = (limit_s / 3600, limit_s / 60 % 60, limit_s % 60);
    let signal = args.warning().map(|warning| format!("--signal=B:TERM@{}", warning.as_secs()));
    let before = [
        "--parsable".to_owned(),
        format!("--job-name={name}"),
        format!("--time={hours}:{minutes:02}:{seconds:02}"),
    ];
    let after = [
        "--no-requeue".to_owned(),
        format!("--output={}", ledger::log_file(Path::new(folder), "%j").display()),
    ];
    before.into_iter().chain(signal).chain(after).chain(args.sbatch.iter().cloned()).collect()
}

/// A path as the scripts have it: they are text.
fn text<'a>(path: &'a Path, option: &str) -> Result<&'a str, BadInput> {
    let unusable = || BadInput(format!("cannot use {option} {}: its name is not UTF-8", path.display()));
    path.to_str().ok_or_else(unusable)
}

/// Arguments of `roost` on a compute node, without those that differ between workers.
fn worker_arguments(args: &SlurmArgs, folder: &str) -> Result<Vec<String>> {
    let absolute = |path: &Path, option: &str| {
        let found = path.canonicalize();
        let found =
            found.map_err(|error| BadInput(format!("cannot use {option} {}: {error}", path.display())))?;
        text(&found, option).map(str::to_owned)
    };
    let mut words: Vec<String> = ["work", "--server", args.server.address()].map(str::to_owned).to_vec();
    if let Some(path) = args.server.token_file() {
        words.extend(["--token-file".to_owned(), absolute(path, "--token-file")?]);
    }
    if let Some(path) = args.server.ca() {
        words.extend(["--ca".to_owned(), absolute(path, "--ca")?]);
    }
    let slots = match args.slots {
        Slots::Auto => "auto".to_owned(),
        Slots::Fixed(slots) => slots.to_string(),
    };
    let (idle, grace) = (format!("{}s", args.idle_timeout.as_secs()), args.grace.to_string());
    let state = format!("{}/worker", folder.trim_end_matches('/'));
    let rest = ["--idle-timeout", &idle, "--grace", &grace, "--slots", &slots, "--state", &state];
    words.extend(rest.map(str::to_owned));
    Ok(words)
}

fn script(roost: &str, pool: &str, worker: &[String], args: &SlurmArgs) -> String {
    let worker: Vec<String> = worker.iter().map(|word| quoted(word)).collect();
    let (worker, count) = (worker.join(" "), args.workers_per_alloc);
    let roost = quoted(roost);
    let prefix = observe::worker_prefix(pool);
    let name = |number: &str| format!("\"{prefix}$SLURM_JOB_ID-{number}-${{SLURMD_NODENAME:-node}}\"");
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
         # Slurm may signal the batch shell alone, which passes the signal on.\n\
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

/// A word for the shell, in quotes if it needs them. `a=b` would be an assignment.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=@%,+".contains(c);
    let is_assignment = word.contains('=') && !word.starts_with('-');
    if !word.is_empty() && !is_assignment && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        args: SlurmArgs,
    }

    fn args(words: &[&str]) -> SlurmArgs {
        let words = ["pool", "--server", "http://head:7373", "--roost", "/opt/a roost"].iter().chain(words);
        let cli = Cli::try_parse_from(words).unwrap_or_else(|error| panic!("{error}"));
        cli.args.check().unwrap();
        cli.args
    }

    fn submission(words: &[&str]) -> SlurmSubmission {
        SlurmSubmission::new(&args(words), "roost-pool-1", Path::new("/home/me/pool")).unwrap()
    }

    #[test]
    fn paths_that_slurm_or_the_shell_would_change_are_refused() {
        let args = args(&[]);
        for (folder, named) in [
            (OsStr::new("/home/me/100%j"), "without % and \\"),
            (OsStr::new("/home/me/a\\b"), "without % and \\"),
            (OsStr::from_bytes(b"/home/me/\xff"), "is not UTF-8"),
        ] {
            let error = SlurmSubmission::new(&args, "roost-pool-1", Path::new(folder)).unwrap_err();
            assert!(error.to_string().contains(named), "{error}");
        }
        let args = SlurmArgs { roost: Some(OsStr::from_bytes(b"/\xff").into()), ..args };
        let error = SlurmSubmission::new(&args, "roost-pool-1", Path::new("/home/me/pool")).unwrap_err();
        assert!(error.to_string().contains("--roost"), "{error}");
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
        let end = "exec '/opt/a roost' \"${arguments[@]}\" --name \"slurm-1-$SLURM_JOB_ID-1-${SLURMD_NODENAME:-node}\"\n";
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
        assert_eq!(quoted("a=b/roost"), "'a=b/roost'", "not an assignment");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
        assert_eq!(quoted("$HOME"), "'$HOME'");
    }

    #[test]
    fn a_short_allocation_is_warned_later() {
        let short = submission(&["--time-limit", "3m"]);
        assert!(short.command().contains(" --time=0:03:00 --signal=B:TERM@45 "), "{}", short.command());
        let shortest = submission(&["--time-limit", "179s"]);
        assert!(shortest.command().contains(" --time=0:02:59 --no-requeue "), "{}", shortest.command());
        let work_time = |limit| args(&["--time-limit", limit]).limits().work_time.as_secs();
        assert_eq!((work_time("3m"), work_time("179s"), work_time("1m")), (135, 179, 60));
    }
}
