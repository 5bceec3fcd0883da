//! What `deploy/` holds, tried or read by the tools it is for. A tool that is not there is said and left out.

mod support;

use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

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
    // Within this lease no job returns to the queue but by being handed back.
    let _server = home.serve_with(&["--lease-s", "60"]);
    let job = home.submit(&support::long(600.0));
    let bin = Path::new(env!("CARGO_BIN_EXE_roost")).parent().unwrap();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    let mut task = Command::new("bash");
    task.arg(&script)
        .env("PATH", path)
        .env("ROOST_SERVER", &home.address)
        .env("ROOST_STATE", home.path("state"));
    task.env("SLURM_CPUS_PER_TASK", "1").env("SLURM_ARRAY_TASK_ID", "7").stdin(Stdio::null());
    let task = task.env("HOME", home.folder.path()).env("ROOST_GRACE_S", "1").process_group(0);
    let mut task = task.spawn().unwrap();
    home.job_when(&job, "the job is under way", |job| job.state == JobState::Running);
    // As scancel does: to all processes of the step, and again.
    let group = format!("-{}", task.id());
    for _ in 0..3 {
        let sent = Command::new("kill").args(["-TERM", "--", &group]).status().unwrap();
        assert!(sent.success());
        std::thread::sleep(Duration::from_millis(100));
    }
    let status = support::until("the task ends", || task.try_wait().unwrap());
    assert!(status.success(), "{status}");
    assert_eq!(home.job(&job).unwrap().state, JobState::Queued, "handed back");
}

/// What has to fit between the signal and the kill: the grace, what a worker then takes to deliver, and some seconds to spare.
#[test]
fn graces_end_well_before_the_kill() {
    const TO_DELIVER_S: u64 = 10;
    let number_after = |text: &str, mark: &str| -> u64 {
        let rest = text.split_once(mark).unwrap_or_else(|| panic!("no {mark}")).1;
        rest.chars().take_while(char::is_ascii_digit).collect::<String>().parse().unwrap()
    };
    let slurm = std::fs::read_to_string(deploy("workers.slurm.sh")).unwrap();
    let grace_s = number_after(&slurm, "ROOST_GRACE_S:-");
    assert!(grace_s + TO_DELIVER_S <= 30, "Slurm's KillWait is 30 s");
    assert!(grace_s + TO_DELIVER_S <= number_after(&slurm, "--signal=B:TERM@"));
    let pods = std::fs::read_to_string(deploy("workers.kubernetes.yaml")).unwrap();
    let grace_s = number_after(&pods, r#""--grace", ""#);
    assert!(grace_s + TO_DELIVER_S <= number_after(&pods, "terminationGracePeriodSeconds: "));
    let unit = std::fs::read_to_string(deploy("roost-work.service")).unwrap();
    assert!(!unit.contains("--grace") && number_after(&unit, "TimeoutStopSec=") >= TO_DELIVER_S);
}

#[test]
fn repeats_of_a_signal_are_one_request_and_a_later_one_ends_it_at_once() {
    let home = Home::new();
    let _server = home.serve_with(&["--lease-s", "60"]);
    let (patient, hasty) =
        (home.work_with("patient", &["--grace", "1"]), home.work_with("hasty", &["--grace", "60"]));
    let jobs = [1, 2].map(|seed| {
        let mut scenario = support::long(600.0);
        scenario["seed"] = seed.into();
        home.submit(&scenario)
    });
    for job in &jobs {
        home.job_when(job, "the job is under way", |job| job.state == JobState::Running);
    }
    let signalled = Instant::now();
    patient.terminate();
    hasty.terminate();
    std::thread::sleep(Duration::from_millis(100));
    patient.terminate();
    hasty.terminate();
    let (status, _) = patient.wait();
    assert!(status.success(), "{status}");
    let states = jobs.map(|job| home.job(&job).unwrap().state);
    assert_eq!(
        states.iter().filter(|state| **state == JobState::Queued).count(),
        1,
        "handed back: {states:?}"
    );

    std::thread::sleep(Duration::from_millis(5_200).saturating_sub(signalled.elapsed()));
    hasty.terminate();
    let (status, took) = hasty.wait();
    assert_eq!(status.code(), Some(128 + 15), "not in its grace");
    assert!(took < Duration::from_secs(5), "{took:?}");
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
