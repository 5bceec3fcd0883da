//! The files in `deploy/`, checked by their tools. Tests of a missing tool are skipped.

#[path = "../server/src/store/testing/cluster.rs"]
#[allow(dead_code, reason = "no test here ends PostgreSQL")]
mod cluster;
mod kubernetes;
#[path = "deploy/releases.rs"]
mod releases;
mod support;

use std::net::SocketAddr;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use roost_api::job::JobState;

use support::Sandbox;

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
fn systemd_accepts_the_units_and_rates_their_exposure_low() {
    if !is_there("systemd-analyze") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for name in ["roost-serve.service", "roost-work.service"] {
        let unit = std::fs::read_to_string(deploy(name)).unwrap();
        let path = folder.path().join(name);
        let start = format!("ExecStart={} ", env!("CARGO_BIN_EXE_roost"));
        assert_eq!(
            unit.matches("ExecStart=roost ").count(),
            1,
            "{name}: found in /usr/local/bin and /usr/bin"
        );
        std::fs::write(&path, unit.replace("ExecStart=roost ", &start)).unwrap();
        let verify = Command::new("systemd-analyze").arg("verify").arg(&path).output().unwrap();
        assert!(verify.status.success() && verify.stderr.is_empty(), "{}", support::transcript(&verify));
        let mut security = Command::new("systemd-analyze");
        // In tenths: 2.0 of 10.
        let security =
            security.args(["security", "--offline=true", "--threshold=20"]).arg(&path).output().unwrap();
        assert!(security.status.success(), "{}", support::transcript(&security));
    }
}

#[test]
fn slurm_script_is_valid_and_a_signal_returns_the_job() {
    let script = deploy("workers.slurm.sh");
    if is_there("shellcheck") {
        let check = Command::new("shellcheck").arg(&script).output().unwrap();
        assert!(check.status.success(), "{}", support::transcript(&check));
    }
    let sandbox = Sandbox::new();
    // The lease is so long that a job is queued again only if its worker returns it.
    let _server = sandbox.start_server_with(&["--lease-s", "60"]);
    let job = sandbox.submit(&support::slow_scenario(600.0));
    let bin = Path::new(env!("CARGO_BIN_EXE_roost")).parent().unwrap();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    let mut task = Command::new("bash");
    task.arg(&script)
        .env("PATH", path)
        .env("ROOST_SERVER", &sandbox.address)
        .env("ROOST_STATE", sandbox.path("state"));
    task.env("SLURM_CPUS_PER_TASK", "1").env("SLURM_ARRAY_TASK_ID", "7").stdin(Stdio::null());
    let task = task.env("HOME", sandbox.folder.path()).env("ROOST_GRACE_S", "1").process_group(0);
    let mut task = task.spawn().unwrap();
    sandbox.wait_for_job(&job, "the job is under way", |job| support::fraction(job) > 0.0);
    // Like scancel: to all processes of the step, repeatedly.
    let group = format!("-{}", task.id());
    for _ in 0..3 {
        let sent = Command::new("kill").args(["-TERM", "--", &group]).status().unwrap();
        assert!(sent.success());
        std::thread::sleep(Duration::from_millis(100));
    }
    let status = support::wait_until("the task ends", || task.try_wait().unwrap());
    assert!(status.success(), "{status}");
    assert_eq!(sandbox.job(&job).unwrap().state, JobState::Queued, "handed back");
}

/// Time between the signal and the kill: the grace period, the delivery of a worker, and a margin.
#[test]
fn grace_periods_end_before_the_kill() {
    const TO_DELIVER_S: u64 = 10;
    let number_after = |text: &str, mark: &str| -> u64 {
        let rest = text.split_once(mark).unwrap_or_else(|| panic!("no {mark}")).1;
        rest.chars().take_while(char::is_ascii_digit).collect::<String>().parse().unwrap()
    };
    let slurm = std::fs::read_to_string(deploy("workers.slurm.sh")).unwrap();
    let grace_s = number_after(&slurm, "ROOST_GRACE_S:-");
    assert!(grace_s + TO_DELIVER_S <= 30, "Slurm's KillWait is 30 s");
    assert!(grace_s + TO_DELIVER_S <= number_after(&slurm, "--signal=B:TERM@"));
    let pods = std::fs::read_to_string(deploy("kubernetes/workers/workers.yaml")).unwrap();
    let grace_s = number_after(&pods, r#""--grace", ""#);
    assert!(grace_s + TO_DELIVER_S <= number_after(&pods, "terminationGracePeriodSeconds: "));
    let unit = std::fs::read_to_string(deploy("roost-work.service")).unwrap();
    assert!(!unit.contains("--grace") && number_after(&unit, "TimeoutStopSec=") >= TO_DELIVER_S);
}

#[test]
fn repeated_signals_are_one_request_and_a_later_one_ends_the_process() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server_with(&["--lease-s", "60"]);
    let (patient, hasty) = (
        sandbox.start_worker_with("patient", &["--grace", "1"]),
        sandbox.start_worker_with("hasty", &["--grace", "60"]),
    );
    let jobs = [1, 2].map(|seed| {
        let mut scenario = support::slow_scenario(600.0);
        scenario["seed"] = seed.into();
        sandbox.submit(&scenario)
    });
    for job in &jobs {
        sandbox.wait_for_job(job, "the job is under way", |job| job.state == JobState::Running);
    }
    // The server leases a job before its worker starts it; a worker without a run would end at the signal.
    for worker in [&patient, &hasty] {
        support::wait_until("the worker runs its job", || {
            worker.log().contains("running job=").then_some(())
        });
    }
    let signalled = Instant::now();
    patient.terminate();
    hasty.terminate();
    std::thread::sleep(Duration::from_millis(100));
    patient.terminate();
    hasty.terminate();
    let (status, _) = patient.wait();
    assert!(status.success(), "{status}");
    let states = jobs.map(|job| sandbox.job(&job).unwrap().state);
    assert_eq!(
        states.iter().filter(|state| **state == JobState::Queued).count(),
        1,
        "handed back: {states:?}"
    );

    std::thread::sleep(Duration::from_secs(12).saturating_sub(signalled.elapsed()));
    hasty.terminate();
    let (status, took) = hasty.wait();
    assert_eq!(status.code(), Some(128 + 15), "not in its grace");
    assert!(took < Duration::from_secs(5), "{took:?}");
}

/// The lines of the Containerfile that begin with an instruction, each with its arguments.
fn instructions(name: &str) -> Vec<String> {
    let text = std::fs::read_to_string(deploy("Containerfile")).unwrap().replace("\\\n", " ");
    let of_name = text.lines().filter_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    of_name.map(|rest| rest.trim().to_owned()).collect()
}

#[test]
fn container_listens_on_its_published_port_and_requires_a_token() {
    let sandbox = Sandbox::new();
    let port = sandbox.address.rsplit_once(':').unwrap().1;
    let data = sandbox.path("data").display().to_string();
    let command: Vec<String> = serde_json::from_str(&instructions("CMD")[0]).unwrap();
    let listen = command.iter().skip_while(|word| *word != "--listen").nth(1).unwrap();
    assert!(!listen.parse::<SocketAddr>().unwrap().ip().is_loopback(), "{listen}");
    let (in_data, in_port) = (|word: &String| word.replace("/var/lib/roost", &data), format!(":{port}"));
    let command: Vec<String> = command.iter().map(|word| in_data(word).replace(":7373", &in_port)).collect();

    let refused = support::roost().args(&command).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", support::transcript(&refused));
    let text = support::transcript(&refused);
    // The advice works, and is the same as in the head of the Containerfile.
    let to_do = "roost:/var/lib/roost roost token create --data /var/lib/roost --scope admin";
    let head = std::fs::read_to_string(deploy("Containerfile")).unwrap();
    assert!(head.contains(to_do), "{to_do}");
    let (_, to_do) = to_do.split_once(" roost ").unwrap();
    assert!(text.contains(&format!("-v VOLUME:/var/lib/roost IMAGE {to_do}")), "{text}");
    let to_do: Vec<String> = to_do.split(' ').map(|word| in_data(&word.to_owned())).collect();
    let token = support::stdout(&support::roost().args(&to_do).output().unwrap());

    let mut server =
        support::roost().args(&command).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let client = |token: &str| {
        let mut client = support::roost();
        client
            .args(["list", "--json", "--server", &sandbox.address])
            .env("ROOST_TOKEN", token)
            .output()
            .unwrap()
    };
    support::wait_until("the server answers with the token", || {
        client(&token).status.success().then_some(())
    });
    let stranger = client("roost_nothing");
    support::signal(server.id(), "TERM");
    let status = support::wait_until("the server ends", || server.try_wait().unwrap());
    assert!(status.success(), "{status}");
    assert_eq!(stranger.status.code(), Some(1), "{}", support::transcript(&stranger));
}

#[test]
fn image_is_complete_and_its_build_sees_only_sources() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let version = |text: &str| -> (u32, u32) {
        let mut numbers = text.split(['.', '-']).map(|number| number.parse().unwrap());
        (numbers.next().unwrap(), numbers.next().unwrap())
    };
    let wanted = manifest.split_once("\nrust-version = \"").unwrap().1.split('"').next().unwrap();
    let builder = instructions("FROM")[0].clone();
    let found = builder.split_once("/rust:").unwrap().1;
    assert!(version(found) >= version(wanted), "{builder}: the workspace wants {wanted}");
    assert!(
        instructions("RUN")
            .iter()
            .any(|run| run.contains("apt-get install") && run.contains(" ca-certificates"))
    );
    // A number, since Kubernetes cannot tell whether a name is root.
    let user = instructions("USER")[0].clone();
    assert!(user.split(':').all(|id| id.parse::<u32>().is_ok_and(|id| id > 0)), "{user}");
    assert!(
        instructions("RUN")
            .iter()
            .any(|run| run.contains("install -d -m 700 -o 10001 -g 10001 /var/lib/roost"))
    );

    // Only listed paths are included, so builds, data folders, tokens and the history stay out.
    let ignore = std::fs::read_to_string(root.join(".dockerignore")).unwrap();
    let mut rules = ignore.lines().filter(|line| !line.starts_with('#'));
    assert_eq!(rules.next(), Some("*"));
    let context = tempfile::tempdir().unwrap();
    for rule in rules {
        let name = rule.strip_prefix('!').unwrap_or_else(|| panic!("{rule}"));
        assert!(!name.contains(['*', '/']) && !["target", ".git"].contains(&name), "{rule}");
        assert!(root.join(name).exists(), "{rule}");
        std::os::unix::fs::symlink(root.join(name), context.path().join(name)).unwrap();
    }
    // Cargo finds all packages and targets of the manifests.
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["metadata", "--format-version", "1", "--no-deps", "--offline"]).current_dir(context.path());
    let output = cargo.output().unwrap();
    assert!(output.status.success(), "{}", support::transcript(&output));
}

/// All files in `deploy/` and its folders, by their path from there.
fn files() -> Vec<String> {
    let (mut found, mut folders) = (Vec::new(), vec![deploy("")]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.push(path.strip_prefix(deploy("")).unwrap().display().to_string());
            }
        }
    }
    found
}

#[test]
fn every_file_is_documented_and_uses_existing_options() {
    let readme = std::fs::read_to_string(deploy("README.md")).unwrap();
    for name in files() {
        let in_table = match name.split_once('/') {
            Some((folder, _)) => format!("`{folder}/`"),
            None => format!("`{name}`"),
        };
        assert!(name == "README.md" || readme.contains(&in_table), "{name}");
        let text = std::fs::read_to_string(deploy(&name)).unwrap();
        // Options in the files exist.
        let help =
            ["serve", "work", "list", "prune"].map(|role| support::stdout(&support::run(&[role, "--help"])));
        let words = text.split(|c: char| c.is_whitespace() || "\"',[]()`;=".contains(c));
        let words = words.map(|word| word.trim_end_matches('.'));
        for option in words.filter(|word| word.starts_with("--") && word.len() > 4) {
            let foreign = [
                "--gid",
                "--no-create-home",
                "--no-install-recommends",
                "--yes",
                "--release",
                "--features",
                "--locked",
                "--bin",
                "--system",
                "--uid",
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
                "--auth-host",
                "--encoding",
                "--host",
                "--quiet",
                "--username",
            ];
            let known = help.iter().any(|help| help.contains(option));
            assert!(known || foreign.contains(&option), "{name}: {option}");
        }
    }
}

/// The files that `cargo deb` reads from the root's manifest. The package itself is made by hand: docs/howto/install.md.
#[test]
fn debian_package_has_files_that_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let cargo = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(root)
        .output()
        .unwrap();
    let metadata: serde_json::Value = serde_json::from_str(&support::stdout(&cargo)).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let package = packages.iter().find(|package| package["name"] == "roost").unwrap();
    let deb = &package["metadata"]["deb"];
    let text = |value: &serde_json::Value| value.as_str().unwrap_or_default().to_owned();
    let assets: Vec<[String; 3]> = deb["assets"]
        .as_array()
        .unwrap()
        .iter()
        .map(|asset| [0, 1, 2].map(|part| text(&asset[part])))
        .collect();
    let (built, files): (Vec<_>, Vec<_>) =
        assets.iter().partition(|[source, ..]| source.starts_with("target/release/"));
    assert_eq!(built.len(), 1);
    assert_eq!(built[0], &["target/release/roost", "usr/bin/", "755"].map(str::to_owned));
    for [source, place, mode] in files {
        assert!(root.join(source).is_file(), "{source}");
        assert!(["etc/", "usr/share/"].iter().any(|folder| place.starts_with(folder)), "{place}");
        // Settings hold a token.
        assert_eq!(mode == "600", place.starts_with("etc/"), "{source}: {mode}");
    }
    assert!(root.join(text(&deb["license-file"][0])).is_file());
    let scripts = root.join(text(&deb["maintainer-scripts"]));
    let units: Vec<String> = deb["systemd-units"]
        .as_array()
        .unwrap()
        .iter()
        .map(|unit| format!("{}.service", text(&unit["unit-name"])))
        .collect();
    let all: Vec<String> = files_named(".service");
    assert_eq!(units, all, "every unit of deploy/");
    assert!(units.iter().all(|unit| scripts.join(unit).is_file()), "{units:?}");
    let unit = std::fs::read_to_string(deploy("roost-work.service")).unwrap();
    assert!(unit.contains("EnvironmentFile=-/etc/roost/worker.env\n"), "the file of the package");
    assert!(assets.iter().any(|[source, place, _]| source == "deploy/worker.env" && place == "etc/roost/"));
    let settings = std::fs::read_to_string(deploy("worker.env")).unwrap();
    assert!(
        settings.lines().all(|line| line.is_empty() || line.starts_with('#')),
        "defaults hold as installed"
    );
}

/// Files of `deploy/` with this ending, sorted.
fn files_named(end: &str) -> Vec<String> {
    let mut found: Vec<String> = files().into_iter().filter(|name| name.ends_with(end)).collect();
    found.sort();
    found
}
