//! What `deploy/` holds, tried or read by the tools it is for. A tool that is not there is said and left out.

mod support;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use roost_api::job::JobState;

use support::Home;

fn deploy(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy").join(name)
}

fn is_there(tool: &str) -> bool {
    let found = Command::new(tool).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    let found = found.is_ok_and(|status| status.success());
    if !found {
        eprintln!("{tool} is not there: nothing checked with it");
    }
    found
}

#[test]
fn systemd_takes_the_units_and_finds_little_exposed() {
    if !is_there("systemd-analyze") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for name in ["roost-serve.service", "roost-work.service"] {
        let unit = std::fs::read_to_string(deploy(name)).unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, unit.replace("/usr/local/bin/roost", env!("CARGO_BIN_EXE_roost"))).unwrap();
        let verify = Command::new("systemd-analyze").arg("verify").arg(&path).output().unwrap();
        assert!(verify.status.success() && verify.stderr.is_empty(), "{}", support::said(&verify));
        let mut security = Command::new("systemd-analyze");
        // In tenths: 2.0 of 10.
        let security =
            security.args(["security", "--offline=true", "--threshold=20"]).arg(&path).output().unwrap();
        assert!(security.status.success(), "{}", support::said(&security));
    }
}

#[test]
fn the_slurm_script_is_sound_shell_and_a_signal_hands_the_job_back() {
    let script = deploy("workers.slurm.sh");
    if is_there("shellcheck") {
        let check = Command::new("shellcheck").arg(&script).output().unwrap();
        assert!(check.status.success(), "{}", support::said(&check));
    }
    let home = Home::new();
    let _server = home.serve();
    let job = home.submit(&support::long(600.0));
    let bin = Path::new(env!("CARGO_BIN_EXE_roost")).parent().unwrap();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    let mut task = Command::new("bash");
    task.arg(&script)
        .env("PATH", path)
        .env("ROOST_SERVER", &home.address)
        .env("ROOST_STATE", home.path("state"));
    task.env("SLURM_CPUS_PER_TASK", "1").env("SLURM_ARRAY_TASK_ID", "7").stdin(Stdio::null());
    let mut task = task.env("HOME", home.folder.path()).env("ROOST_GRACE_S", "0").spawn().unwrap();
    home.job_when(&job, "the job is under way", |job| job.state == JobState::Running);
    support::signal(task.id(), "TERM");
    let status = support::until("the task ends", || task.try_wait().unwrap());
    assert!(status.success(), "{status}");
    assert_eq!(home.job(&job).unwrap().state, JobState::Queued, "handed back");
}

#[test]
fn every_file_is_explained_and_runs_what_there_is() {
    let readme = std::fs::read_to_string(deploy("README.md")).unwrap();
    for entry in std::fs::read_dir(deploy("")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(name == "README.md" || readme.contains(&format!("`{name}`")), "{name}");
        let text = std::fs::read_to_string(deploy(&name)).unwrap();
        // Options that the files pass must be options.
        let help =
            ["serve", "work", "list", "prune"].map(|role| support::stdout(&support::run(&[role, "--help"])));
        let words = text.split(|c: char| c.is_whitespace() || "\"',[]()`;=".contains(c));
        let words = words.map(|word| word.trim_end_matches('.'));
        for option in words.filter(|word| word.starts_with("--") && word.len() > 4) {
            let foreign = [
                "--release",
                "--features",
                "--locked",
                "--bin",
                "--system",
                "--uid",
                "--create-home",
                "--home-dir",
                "--from",
                "--rm",
                "--array",
                "--cpus-per-task",
                "--mem",
                "--time",
                "--signal",
                "--requeue",
                "--job-name",
                "--export",
                "--replicas",
                "--from-file",
                "--now",
                "--scope",
                "--name",
                "--data",
                "--yes",
            ];
            let known = help.iter().any(|help| help.contains(option));
            assert!(known || foreign.contains(&option), "{name}: {option}");
        }
    }
}
