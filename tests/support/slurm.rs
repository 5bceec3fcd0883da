//! A Slurm of a folder, for tests: `sbatch`, `squeue`, `sacct`, `scontrol` and `scancel` as one shell script. Allocations start at
//! once, or wait while a file `hold` exists. Other files change its answers:
//!
//! | file | effect |
//! |---|---|
//! | `refuse` | `sbatch` fails with its text |
//! | `slow` | `sbatch` takes a second |
//! | `unnamed` | `squeue` shows no job by its name |
//! | `purged` | `squeue` shows no job at all |
//! | `lost` | no command knows a job |

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

const SCRIPT: &str = r#"#!/usr/bin/env bash
set -euo pipefail
cd "$(dirname "$0")"
say() { printf '%s\n' "$*" >&2; }
if env | grep -E '^((SQUEUE|SACCT|SCANCEL|SCONTROL)_|SBATCH_(ARRAY_INX|WAIT|CLUSTERS|EXPORT)=|SLURM_CLUSTERS=)' > /dev/null; then
    say 'a variable of the user changes this command'
    exit 1
fi
case "$(basename "$0")" in
sbatch)
    [[ $1 == --version ]] && { echo 'slurm of a test'; exit; }
    if [[ -e refuse ]]; then say "sbatch: error: $(cat refuse)"; exit 1; fi
    [[ -e slow ]] && sleep 1
    for option; do
        case $option in
        --job-name=*) name=${option#*=} ;;
        --output=*) log=${option#*=} ;;
        esac
    done
    exec 9> lock
    flock 9
    id=$(($(cat last 2> /dev/null || echo 100) + 1))
    echo "$id" > last
    flock -u 9
    exec 9>&-
    mkdir -p "jobs/$id"
    cat > "jobs/$id/script"
    echo "$*" > "jobs/$id/options"
    echo "$name" > "jobs/$id/name"
    if [[ -e hold ]]; then
        echo PENDING > "jobs/$id/state"
    else
        echo RUNNING > "jobs/$id/state"
        (
            export SLURM_JOB_ID=$id SLURMD_NODENAME=node1 SLURM_CPUS_ON_NODE=1
            setsid bash "jobs/$id/script" &
            echo $! > "jobs/$id/pid"
            code=0
            wait $! || code=$?
            [[ $(cat "jobs/$id/state") == RUNNING ]] || exit 0
            if ((code)); then echo FAILED; else echo COMPLETED; fi > "jobs/$id/state"
        ) > "${log/\%j/$id}" 2>&1 < /dev/null &
    fi
    echo "$id"
    ;;
squeue)
    name= ids=
    for option; do
        case $option in
        --name=*) name=${option#*=} ;;
        --jobs=*) ids=,${option#*=}, ;;
        esac
    done
    if [[ $ids ]] && [[ -e purged || -e lost ]]; then
        say 'slurm_load_jobs error: Invalid job id specified'
        exit 1
    fi
    [[ -e unnamed || -e purged || -e lost ]] && [[ $name ]] && exit 0
    for job in jobs/*; do
        [[ -e $job/name ]] || continue
        if [[ $(cat "$job/name") == "$name" || $ids == *,${job#jobs/},* ]]; then
            echo "${job#jobs/}|$(cat "$job/state")|None"
        fi
    done
    ;;
scontrol)
    id=${!#}
    if [[ -e lost || ! -e jobs/$id ]]; then
        say 'slurm_load_jobs error: Invalid job id specified'
        exit 1
    fi
    echo "JobId=$id JobName=$(cat "jobs/$id/name") JobState=$(cat "jobs/$id/state") Reason=None"
    ;;
sacct)
    say 'Slurm accounting storage is disabled'
    exit 1
    ;;
scancel)
    only_waiting= ids=()
    for word; do
        case $word in
        --state=PENDING) only_waiting=1 ;;
        --name=*)
            for job in jobs/*; do
                if [[ -e $job/name && $(cat "$job/name") == "${word#*=}" ]]; then ids+=("${job#jobs/}"); fi
            done
            ;;
        *) ids+=("$word") ;;
        esac
    done
    for id in "${ids[@]}"; do
        state=$(cat "jobs/$id/state")
        if [[ $state == PENDING ]]; then
            echo CANCELLED > "jobs/$id/state"
        elif [[ $state == RUNNING && -z $only_waiting ]]; then
            echo CANCELLED > "jobs/$id/state"
            kill -TERM -- "-$(cat "jobs/$id/pid")"
        fi
    done
    ;;
esac
"#;

/// The folder of a Slurm. Its allocations are killed at the end of the test.
pub(crate) struct FakeSlurm {
    folder: PathBuf,
}

impl FakeSlurm {
    pub(crate) fn new(folder: &Path) -> Self {
        std::fs::create_dir_all(folder.join("jobs")).unwrap();
        for name in ["sbatch", "squeue", "sacct", "scontrol", "scancel"] {
            let path = folder.join(name);
            std::fs::write(&path, SCRIPT).unwrap();
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
        }
        Self { folder: folder.to_owned() }
    }

    /// `PATH` with its commands first.
    pub(crate) fn path(&self) -> String {
        format!("{}:{}", self.folder.display(), std::env::var("PATH").unwrap())
    }

    /// Creates or removes a file, such as `hold`.
    pub(crate) fn set(&self, name: &str, content: Option<&str>) {
        match content {
            Some(content) => std::fs::write(self.folder.join(name), content).unwrap(),
            None => std::fs::remove_file(self.folder.join(name)).unwrap(),
        }
    }

    /// Signals the batch shells of running allocations, and no other process: `--signal=B:TERM` does that before the time limit.
    pub(crate) fn signal_batch_shells(&self) {
        let (states, pids) = (self.all("state"), self.all("pid"));
        for (_, pid) in states.iter().zip(&pids).filter(|(state, _)| *state == "RUNNING") {
            assert!(Command::new("kill").args(["-TERM", pid]).status().unwrap().success());
        }
    }

    /// A file of all allocations in the order of their ids.
    pub(crate) fn all(&self, name: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.join("jobs")).unwrap();
        let mut ids: Vec<u64> =
            entries.map(|entry| entry.unwrap().file_name().to_str().unwrap().parse().unwrap()).collect();
        ids.sort_unstable();
        let read = |id: u64| std::fs::read_to_string(self.folder.join(format!("jobs/{id}/{name}")));
        ids.into_iter().map(|id| read(id).unwrap_or_default().trim().to_owned()).collect()
    }
}

impl Drop for FakeSlurm {
    fn drop(&mut self) {
        for pid in self.all("pid").iter().filter(|pid| !pid.is_empty()) {
            let _ = Command::new("kill")
                .args(["-KILL", "--", &format!("-{pid}")])
                .stderr(std::process::Stdio::null())
                .status();
        }
    }
}
