//! Server and workers as real processes, which are killed, stopped and restarted.

mod support;

use std::process::Stdio;
use std::time::{Duration, Instant};

use roost_api::job::{FailureClass, JobState};
use roost_api::sweep::SweepView;
use serde_json::{Value, json};

use support::{Sandbox, fraction, hopper_scenario, outbox_len, roost, slow_scenario, stdout, wait_until};

/// Duration of a job that tests can interrupt and still wait for.
const JOB_DURATION_S: f64 = 10.0;

/// Maximum time from SIGTERM to the exit.
const SIGTERM_TIMEOUT: Duration = Duration::from_secs(5);
/// The same of a worker whose server does not answer, as deploy/README.md says: 3 s to store a checkpoint and 5 s to deliver, and a second
/// for its claim.
const UNREACHABLE_TIMEOUT: Duration = Duration::from_secs(9);

#[test]
fn sweep_is_submitted_and_its_table_downloaded() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let sweep = json!({
        "name": "small", "base": hopper_scenario(0.4), "design": {"kind": "grid"}, "replicates": 2,
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.06]}],
    });
    let file = sandbox.file("sweep.json", &sweep);
    let view = stdout(&sandbox.roost(&["submit", "--wait", "--json", &file]));
    let view: SweepView = serde_json::from_str(&view).unwrap();
    assert_eq!((view.counts.succeeded, view.counts.total()), (4, 4));
    assert_eq!(sandbox.results_recorded(), 4);

    let id = view.id.to_string();
    let csv = stdout(&sandbox.roost(&["results", &id, "--format", "csv"]));
    assert_eq!(csv.lines().count(), 5, "{csv}");
    assert!(csv.lines().next().unwrap().contains("discharged_kg"), "{csv}");
    let json: Value =
        serde_json::from_str(&stdout(&sandbox.roost(&["results", &id, "--format", "json"]))).unwrap();
    let seeds: Vec<_> =
        json["trials"].as_array().unwrap().iter().map(|trial| trial["seed"].clone()).collect();
    assert_eq!(seeds, [1, 2, 1, 2]);
    assert!(json["trials"][0]["responses"]["discharged_kg"].is_number());
    let table = stdout(&sandbox.roost(&["results", &id]));
    assert!(table.contains("gate_opening_m") && table.contains("succeeded"), "{table}");

    assert!(stdout(&sandbox.roost(&["list"])).contains(&id));
    assert!(stdout(&sandbox.roost(&["list", "--workers"])).contains("worker"));
    let jobs = stdout(&sandbox.roost(&["list", "--jobs", "--state", "succeeded"]));
    assert_eq!(jobs.lines().count(), 6, "{jobs}");
    let job = json["trials"][3]["job_id"].as_str().unwrap();
    assert!(stdout(&sandbox.roost(&["status", job])).contains("succeeded"));
    let series = stdout(&sandbox.roost(&["results", job, "--format", "csv"]));
    assert!(series.starts_with("t_s,discharged_mass_kg"), "{series}");
}

#[test]
fn job_of_a_killed_worker_is_finished_once_by_another() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server_with_short_leases();
    let first = sandbox.start_worker("first");
    let job = sandbox.submit(&slow_scenario(JOB_DURATION_S));
    sandbox.wait_for_job(&job, "the job is under way", |job| fraction(job) > 0.05);
    first.kill();

    let second = sandbox.start_worker("second");
    let done = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((done.state, done.attempt), (JobState::Succeeded, 2), "{}", second.log());
    assert_eq!(sandbox.results_recorded(), 1);
    support::wait_until("the outbox is empty", || (outbox_len(&sandbox.path("second")) == 0).then_some(()));
}

#[test]
fn killed_server_loses_no_run() {
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let worker = sandbox.start_worker("worker");
    let job = sandbox.submit(&slow_scenario(JOB_DURATION_S));
    sandbox.wait_for_job(&job, "the job is under way", |job| fraction(job) > 0.05);
    server.kill();

    let _server = sandbox.start_server();
    let back = sandbox
        .wait_for_job(&job, "the heartbeat is back", |job| fraction(job) > 0.05 || job.state.is_ended());
    assert_eq!(back.attempt, 1);
    let done = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((done.state, done.attempt), (JobState::Succeeded, 1), "{}", worker.log());
    assert_eq!(sandbox.results_recorded(), 1);
}

#[test]
fn result_waits_in_the_outbox_while_the_server_is_down() {
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let worker = sandbox.start_worker("worker");
    let job = sandbox.submit(&slow_scenario(JOB_DURATION_S));
    sandbox.wait_for_job(&job, "the job is under way", |job| fraction(job) > 0.0);
    server.kill();
    support::wait_until("the result is in the outbox", || {
        (outbox_len(&sandbox.path("worker")) == 1).then_some(())
    });
    // The result survives the end of the worker.
    worker.kill();

    let _server = sandbox.start_server();
    let next = sandbox.start_worker("worker");
    let done = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((done.state, done.attempt), (JobState::Succeeded, 1), "{}", next.log());
    support::wait_until("the outbox is empty", || (outbox_len(&sandbox.path("worker")) == 0).then_some(()));
}

#[test]
fn result_is_delivered_to_its_own_server_only() {
    let (sandbox, other) = (Sandbox::new(), Sandbox::new());
    let server = sandbox.start_server();
    let worker = sandbox.start_worker("worker");
    let job = sandbox.submit(&slow_scenario(JOB_DURATION_S));
    sandbox.wait_for_job(&job, "the job is under way", |job| fraction(job) > 0.0);
    server.kill();
    support::wait_until("the result is in the outbox", || {
        (outbox_len(&sandbox.path("worker")) == 1).then_some(())
    });
    worker.kill();

    // The same state folder with another server, which does not know the job.
    let _other_server = other.start_server();
    let stranger = other.start_worker_in("stranger", &sandbox.path("worker"));
    let theirs = other.submit(&hopper_scenario(0.2));
    other.wait_for_job(&theirs, "the other job has ended", |job| job.state == JobState::Succeeded);
    // The server has recorded a result before the worker gets the response.
    support::wait_until("the other's own result has left", || {
        (outbox_len(&sandbox.path("worker")) == 1).then_some(())
    });
    drop(stranger);
    assert_eq!(outbox_len(&sandbox.path("worker")), 1, "the first server's result still waits");

    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let done = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((done.state, done.attempt), (JobState::Succeeded, 1));
}

#[test]
fn sigterm_returns_the_job_and_both_processes_exit_cleanly() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let worker = sandbox.start_worker("worker");
    let job = sandbox.submit(&slow_scenario(600.0));
    sandbox.wait_for_job(&job, "the job is under way", |job| fraction(job) > 0.0);

    worker.terminate();
    let (status, took) = worker.wait();
    assert!(status.success() && took < SIGTERM_TIMEOUT, "{status} after {took:?}");
    let back = sandbox.job(&job).unwrap();
    assert_eq!((back.state, back.attempt), (JobState::Queued, 1), "released, not lost");

    let idle = sandbox.start_worker("idle");
    sandbox
        .wait_for_job(&job, "another takes it up", |job| job.state == JobState::Running && job.attempt == 2);
    server.terminate();
    let (status, took) = server.wait();
    assert!(status.success() && took < SIGTERM_TIMEOUT, "{status} after {took:?}");
    // A worker exits even if it cannot return its job.
    idle.terminate();
    let (status, took) = idle.wait();
    assert!(status.success() && took < UNREACHABLE_TIMEOUT, "{status} after {took:?}");
}

#[test]
fn worker_waits_for_its_server_and_registers_again() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let worker = sandbox.start_worker("worker");
    std::thread::sleep(Duration::from_millis(300));
    let server = sandbox.start_server();
    let job = sandbox.submit(&hopper_scenario(0.2));
    sandbox.wait_for_job(&job, "the job has ended", |job| job.state == JobState::Succeeded);
    let job = sandbox.submit(&slow_scenario(600.0));
    sandbox.wait_for_job(&job, "the job is under way", |job| fraction(job) > 0.0);
    server.kill();

    // The new server knows neither the worker nor its job: the worker drops the job and serves the new server.
    std::fs::remove_dir_all(sandbox.path("data")).unwrap();
    let _server = sandbox.start_server();
    let job = sandbox.submit(&hopper_scenario(0.2));
    // The timeout is shorter than the first job, so the worker must have dropped that.
    sandbox.wait_for_job(&job, "the job has ended", |job| job.state == JobState::Succeeded);

    worker.terminate();
    let (status, took) = worker.wait();
    assert!(status.success() && took < SIGTERM_TIMEOUT, "an idle worker: {status} after {took:?}");
    let job = sandbox.submit(&hopper_scenario(0.3));
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(sandbox.job(&job).unwrap().state, JobState::Queued, "nothing claims after its end");
}

#[test]
fn cancel_stops_a_running_job_and_retry_runs_it_again() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let job = sandbox.submit(&slow_scenario(600.0));
    sandbox.wait_for_job(&job, "the job is under way", |job| fraction(job) > 0.0);
    let id = job.id.to_string();
    stdout(&sandbox.roost(&["cancel", &id]));
    let asked = Instant::now();
    let ended = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!(ended.state, JobState::Cancelled);
    assert!(asked.elapsed() < Duration::from_secs(20), "{:?}", asked.elapsed());

    stdout(&sandbox.roost(&["retry", &id]));
    sandbox.wait_for_job(&job, "it runs again", |job| job.state == JobState::Running && job.attempt == 2);
    stdout(&sandbox.roost(&["cancel", &id]));
    sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
}

#[test]
fn failure_class_decides_the_exit_code() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let mut diverging = hopper_scenario(0.4);
    diverging["numerics"]["timestep_s"] = json!(0.02);
    diverging["numerics"]["allow_unstable"] = json!(true);
    let file = sandbox.file("diverging.json", &diverging);
    let output = sandbox.roost(&["submit", "--wait", "--json", &file]);
    assert_eq!(output.status.code(), Some(3), "{}", support::transcript(&output));

    let file = sandbox.file("long.json", &slow_scenario(600.0));
    let output = sandbox.roost(&["submit", "--wait", "--json", "--max-wall-s", "0.3", &file]);
    assert_eq!(output.status.code(), Some(1), "{}", support::transcript(&output));
    let job: roost_api::job::JobView = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(job.failure_class, Some(FailureClass::Timeout));
}

#[test]
fn up_runs_server_and_worker_in_one_process() {
    let sandbox = Sandbox::new();
    let listen = sandbox.address.trim_start_matches("http://").to_owned();
    let data = sandbox.path("data").display().to_string();
    let mut up = support::roost()
        .args(["up", "--listen", &listen, "--data", &data, "--threads", "1"])
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    support::wait_until("the server answers", || {
        sandbox.ask(|client| async move { client.sweeps(None, 1).await.ok() })
    });
    let file = sandbox.file("scenario.json", &hopper_scenario(0.4));
    let output = sandbox.roost(&["submit", "--wait", &file]);
    assert!(output.status.success(), "{}", support::transcript(&output));
    support::signal(up.id(), "TERM");
    let status = support::wait_until("it exits", || up.try_wait().unwrap());
    assert!(status.success(), "{status}");
}

#[test]
fn repeated_kills_lose_no_job_and_repeat_no_result() {
    let sandbox = Sandbox::new();
    let (mut server, mut worker) = (sandbox.start_server_with_short_leases(), sandbox.start_worker("worker"));
    let sweep = json!({
        "name": "accidents", "base": slow_scenario(0.3), "design": {"kind": "grid"}, "factors": [], "replicates": 12,
    });
    let file = sandbox.file("sweep.json", &sweep);
    let view: SweepView =
        serde_json::from_str(&stdout(&sandbox.roost(&["submit", "--json", &file]))).unwrap();
    for round in 0..6 {
        std::thread::sleep(Duration::from_millis(300 + 170 * round));
        if round % 2 == 0 {
            worker.kill();
            worker = sandbox.start_worker("worker");
        } else {
            server.kill();
            server = sandbox.start_server_with_short_leases();
        }
    }
    let done = support::wait_until("the sweep has ended", || {
        let sweep = sandbox.ask(|client| async move { client.sweep(view.id).await }).unwrap();
        sweep.counts.is_ended().then_some(sweep)
    });
    assert_eq!(done.counts.succeeded, 12, "{:?}", done.counts);
    support::wait_until("the outbox is empty", || (outbox_len(&sandbox.path("worker")) == 0).then_some(()));
    assert_eq!(sandbox.results_recorded(), 12);
    drop((server, worker));
}

#[test]
fn waiting_reports_an_unreachable_server_and_ends_with_ctrl_c() {
    let sandbox = Sandbox::new();
    let mut server = sandbox.start_server();
    let file = sandbox.file("scenario.json", &hopper_scenario(0.2));
    let wait = || {
        let log = sandbox.path("wait.log");
        let child = roost()
            .args(["submit", "--wait", "--server", &sandbox.address, &file])
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(&log).unwrap())
            .spawn()
            .unwrap();
        let stderr = move || std::fs::read_to_string(&log).unwrap();
        wait_until("it waits", || stderr().contains("queued").then_some(()));
        (child, stderr)
    };
    let ends = |mut child: std::process::Child| {
        support::signal(child.id(), "INT");
        let started = Instant::now();
        let status = wait_until("it ends", || child.try_wait().unwrap());
        // Less than the timeout of a request.
        assert!(started.elapsed() < Duration::from_secs(30), "{:?}", started.elapsed());
        assert_eq!(status.code(), Some(1));
    };

    let (child, stderr) = wait();
    server.kill();
    wait_until("the message", || stderr().contains("waiting for the server").then_some(()));
    std::thread::sleep(Duration::from_millis(1500));
    assert_eq!(stderr().matches("waiting for the server").count(), 1, "{}", stderr());
    ends(child);

    server = sandbox.start_server();
    let (child, _) = wait();
    server.freeze();
    std::thread::sleep(Duration::from_millis(1500));
    ends(child);
}
