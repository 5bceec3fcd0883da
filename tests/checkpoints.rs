//! Checkpoints between real processes: a job goes on after a signal, a kill and a pause, and its result is that of an undisturbed run.

mod support;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use roost_api::job::{JobState, JobView};
use serde_json::{Value, json};

use support::small_disk::SmallDisk;
use support::{Process, Sandbox, fraction, run, slow_scenario, stdout};

/// Simulated time of the scenario: some seconds of wall time.
const DURATION_S: f64 = 15.0;

/// A server that stores no fills: checkpoints are its only objects.
fn start_server_without_fills(sandbox: &Sandbox, lease_s: &str) -> Process {
    sandbox.start_server_with(&["--lease-s", lease_s, "--fills-limit-mib", "0"])
}

/// The parts of a result that do not depend on wall time.
fn physics(result: &Value) -> [Value; 4] {
    ["responses", "series", "curves", "end_reason"].map(|name| result[name].clone())
}

/// The result of an undisturbed run, which is simulated once for all tests.
fn undisturbed() -> &'static [Value; 4] {
    static RESULT: LazyLock<[Value; 4]> = LazyLock::new(|| {
        let sandbox = Sandbox::new();
        let (file, folder) = (sandbox.file("run.json", &slow_scenario(DURATION_S)), sandbox.path("run"));
        let folder = folder.display().to_string();
        stdout(&run(&["run", "--backend", "cpu", "--threads", "1", "-o", &folder, &file]));
        let result = std::fs::read(Path::new(&folder).join("result.json")).unwrap();
        physics(&serde_json::from_slice(&result).unwrap())
    });
    &RESULT
}

/// Waits for the result of a job, and compares it.
#[track_caller]
fn expect_same(sandbox: &Sandbox, job: &JobView, expected: &[Value; 4]) -> JobView {
    let done = sandbox.wait_for_job(job, "the job has ended", |job| job.state.is_ended());
    assert_eq!(done.state, JobState::Succeeded, "{done:?}");
    let result = sandbox.get(&format!("/v1/jobs/{}/result", job.id));
    assert!(physics(&result) == *expected, "the result differs");
    assert_eq!(done.checkpoint, None, "deleted with the result");
    done
}

fn objects(sandbox: &Sandbox) -> Vec<PathBuf> {
    let list =
        |folder: &Path| std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let folders = list(&sandbox.path("data").join("objects")).filter(|folder| !folder.ends_with("uploads"));
    folders.flat_map(|folder| list(&folder).collect::<Vec<_>>()).collect()
}

#[test]
fn a_job_continues_after_sigterm_with_the_result_of_an_undisturbed_run() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let expected = undisturbed();
    let _server = start_server_without_fills(&sandbox, "30");
    let worker = sandbox.start_worker("first");
    let job = sandbox.submit(&slow_scenario(DURATION_S));
    sandbox.wait_for_job(&job, "the job is under way", |job| fraction(job) > 0.1);
    worker.terminate();
    assert!(worker.wait().0.success());
    let back = sandbox.job(&job).unwrap();
    let checkpoint = back.checkpoint.clone().expect("stored before the worker ended");
    assert_eq!((back.state, back.attempt, back.resumed_from_s), (JobState::Queued, 1, None));
    assert!(checkpoint.simulated_s > 0.0 && checkpoint.attempt == 1, "{checkpoint:?}");
    let status = stdout(&sandbox.roost(&["status", &job.id.to_string()]));
    assert!(status.contains("checkpoint at "), "{status}");
    let metrics = support::wait_until("metrics", || {
        let metrics = sandbox.text("/metrics");
        metrics.contains(r#"roost_attempts_total{outcome="preempted"} 1"#).then_some(metrics)
    });
    assert!(metrics.contains(r#"roost_attempts_total{outcome="lost"} 0"#), "{metrics}");

    let _next = sandbox.start_worker("second");
    let done = expect_same(&sandbox, &job, expected);
    assert_eq!((done.attempt, done.resumed_from_s), (2, Some(checkpoint.simulated_s)));
    support::wait_until("the checkpoint is deleted", || objects(&sandbox).is_empty().then_some(()));
}

#[test]
fn a_job_continues_from_its_last_checkpoint_after_a_kill() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let expected = undisturbed();
    let _server = sandbox.start_server_with(&["--lease-s", "2", "--checkpoint-interval", "1s"]);
    let worker = sandbox.start_worker("first");
    let job = sandbox.submit(&slow_scenario(DURATION_S));
    sandbox.wait_for_job(&job, "a checkpoint", |job| job.checkpoint.is_some());
    worker.kill();
    let _next = sandbox.start_worker("second");
    let done = expect_same(&sandbox, &job, expected);
    assert_eq!(done.attempt, 2);
    assert!(done.resumed_from_s.is_some_and(|from_s| from_s > 0.0), "{done:?}");
}

#[test]
fn a_damaged_checkpoint_is_discarded_and_the_job_begins_at_zero() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let expected = undisturbed();
    let _server = start_server_without_fills(&sandbox, "2");
    let worker = sandbox.start_worker("first");
    let job = sandbox.submit(&slow_scenario(DURATION_S));
    sandbox.wait_for_job(&job, "the job is under way", |job| fraction(job) > 0.1);
    worker.terminate();
    assert!(worker.wait().0.success());
    let [object] = &objects(&sandbox)[..] else { panic!("one object") };
    let mut bytes = std::fs::read(object).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(object, bytes).unwrap();
    let next = sandbox.start_worker("second");
    let done = expect_same(&sandbox, &job, expected);
    assert_eq!((done.attempt, done.resumed_from_s), (2, None));
    assert!(next.log().contains("the run begins at zero"), "{}", next.log());
}

#[test]
fn a_paused_job_is_handed_back_and_continues_after_its_resume() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let expected = undisturbed();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let job = sandbox.submit(&slow_scenario(DURATION_S));
    sandbox.wait_for_job(&job, "the job is under way", |job| fraction(job) > 0.1);
    let id = job.id.to_string();
    stdout(&sandbox.roost(&["pause", &id]));
    let paused = sandbox.wait_for_job(&job, "it is handed back", |job| {
        job.state == JobState::Queued && job.checkpoint.is_some()
    });
    assert!(paused.paused, "{paused:?}");
    let other = sandbox.submit(&support::hopper_scenario(0.2));
    sandbox.wait_for_job(&other, "the worker does other work", |job| job.state == JobState::Succeeded);
    assert_eq!(sandbox.job(&job).unwrap().attempt, 1, "nobody claims it");
    let list = stdout(&sandbox.roost(&["list", "--jobs"]));
    assert!(list.contains("paused"), "{list}");

    let resumed = stdout(&sandbox.roost(&["resume", "--json", &id]));
    assert!(resumed.contains(r#""paused": false"#) || resumed.contains(r#""paused":false"#), "{resumed}");
    let done = expect_same(&sandbox, &job, expected);
    assert_eq!(done.attempt, 2);
    assert!(done.resumed_from_s.is_some_and(|from_s| from_s > 0.0), "{done:?}");
}

/// The result in a folder, without its cost.
fn physics_in(folder: &str) -> [Value; 4] {
    physics(&serde_json::from_slice(&std::fs::read(Path::new(folder).join("result.json")).unwrap()).unwrap())
}

#[test]
fn a_run_continues_from_its_checkpoint_after_an_interrupt() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let expected = undisturbed();
    let file = sandbox.file("run.json", &slow_scenario(DURATION_S));
    let folder = sandbox.path("saved").display().to_string();
    let saved = sandbox.path("saved").join("checkpoint.roost");
    let arguments =
        ["run", "--backend", "cpu", "--threads", "1", "--checkpoint-every", "1s", "-o", &folder, &file];
    let mut command = support::roost();
    let child = command.args(arguments).stderr(std::process::Stdio::piped()).spawn().unwrap();
    support::wait_until("a checkpoint", || saved.exists().then_some(()));
    support::signal(child.id(), "INT");
    let stopped = child.wait_with_output().unwrap();
    let log = String::from_utf8_lossy(&stopped.stderr).into_owned();
    assert!(!stopped.status.success() && log.contains("the same command continues from"), "{log}");

    // Another seed is another run, and nothing is lost.
    let other = run(&[&arguments[..], &["--seed", "99"]].concat());
    let log = support::transcript(&other);
    assert!(
        !other.status.success() && log.contains("of another scenario") && log.contains("--from-start"),
        "{log}"
    );
    let short = sandbox.file("short.json", &support::hopper_scenario(0.1));
    let without = support::transcript(&run(&["run", "--backend", "cpu", "-o", &folder, &short]));
    assert!(without.contains("--checkpoint-every continues from there") && saved.exists(), "{without}");
    let bytes = std::fs::read(&saved).unwrap();
    std::fs::write(&saved, &bytes[..bytes.len() / 2]).unwrap();
    let damaged = support::transcript(&run(&arguments));
    assert!(damaged.contains("the checkpoint is damaged"), "{damaged}");
    std::fs::write(&saved, bytes).unwrap();

    let continued = run(&arguments);
    let log = support::transcript(&continued);
    assert!(continued.status.success() && log.contains("continues from the checkpoint at "), "{log}");
    assert!(physics_in(&folder) == *expected, "the result differs");
    assert!(!saved.exists(), "deleted at the end");
}

#[test]
fn a_full_disk_keeps_the_last_checkpoint_and_the_run_goes_on() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let Some(disk) = SmallDisk::mount(&sandbox.path("saved"), 4) else {
        eprintln!("left out: only root may mount the small disk that this fills");
        return;
    };
    let expected = undisturbed();
    let file = sandbox.file("run.json", &slow_scenario(DURATION_S));
    let folder = sandbox.path("saved").display().to_string();
    let saved = sandbox.path("saved").join("checkpoint.roost");
    let arguments =
        ["run", "--backend", "cpu", "--threads", "1", "--checkpoint-every", "1s", "-o", &folder, &file];
    let process = Process::start(support::roost().args(arguments), sandbox.path("run.log"));
    support::wait_until("a checkpoint", || saved.exists().then_some(()));
    disk.fill();
    support::wait_until("it says that a checkpoint was not saved", || {
        let is_said = process.log().contains("the checkpoint was not saved");
        if !is_said {
            disk.fill(); // a checkpoint that was written before has replaced an older one, and so freed some space
        }
        is_said.then_some(())
    });
    let kept = std::fs::read(&saved).unwrap();
    let before = process.log().len();
    support::wait_until("the run goes on", || (process.log().len() > before).then_some(()));
    assert_eq!(std::fs::read(&saved).unwrap(), kept, "the last one stays");
    process.kill();
    disk.clear();
    let continued = run(&arguments);
    let log = support::transcript(&continued);
    assert!(continued.status.success() && log.contains("continues from the checkpoint at "), "{log}");
    assert!(physics_in(&folder) == *expected, "the result differs");
}

#[test]
fn runs_that_differ_in_the_gate_share_their_fill_and_no_bit_differs() {
    let sandbox = Sandbox::new();
    let mut scenario = support::hopper_scenario(0.3);
    let fills = sandbox.path("fills").display().to_string();
    let mut run_with = |gate_m: f64, more: &[&str]| {
        scenario["equipment"]["gate_opening_m"] = gate_m.into();
        let file = sandbox.file("gate.json", &scenario);
        let folder = sandbox.path(&format!("gate-{gate_m}-{}", more.len())).display().to_string();
        let output = run(&[&["run", "--backend", "cpu", "-o", &folder, &file][..], more].concat());
        let log = support::transcript(&output);
        assert!(output.status.success(), "{log}");
        (physics_in(&folder), log.contains("starts from a hopper filled before"))
    };
    let shared = ["--fills", fills.as_str()];
    assert!(!run_with(0.04, &shared).1, "the first one fills");
    let (other, is_shared) = run_with(0.07, &shared);
    let (own, has_own_fill) = run_with(0.07, &["--no-shared-fill"]);
    assert!(is_shared && !has_own_fill);
    assert!(other == own, "the result differs");
}

#[test]
fn several_sweeps_and_jobs_are_paused_by_one_command() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let factors = json!([{"pointer": "/equipment/belt_speed_m_s", "levels": [0.1, 0.2]}]);
    let sweep = json!({"name": "belts", "base": support::hopper_scenario(0.2), "design": {"kind": "grid"}, "factors": factors});
    let sweep = sandbox.json_output(&["submit", &sandbox.file("sweep.json", &sweep)]);
    let (id, job) =
        (sweep["id"].as_str().unwrap().to_owned(), sandbox.submit(&support::hopper_scenario(0.2)));
    let ids = [id.as_str(), &job.id.to_string()];
    let paused = |expected: u64| {
        let view = sandbox.get(&format!("/v1/sweeps/{id}"));
        assert_eq!(
            (view["paused"].as_u64(), sandbox.job(&job).unwrap().paused),
            (Some(expected), expected > 0)
        );
    };
    let table = stdout(&sandbox.roost(&[&["pause"], &ids[..]].concat()));
    assert!(table.contains("paused"), "{table}");
    paused(2);
    stdout(&sandbox.roost(&[&["resume"], &ids[..]].concat()));
    paused(0);
    let unknown = sandbox.roost(&["pause", "01890a5d-ac96-774b-bcce-b302099a8057"]);
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("no sweep and no job"), "{unknown:?}");
}
