//! Server and workers as real processes, through the accidents that they promise to survive.

mod support;

use std::time::{Duration, Instant};

use roost_api::job::{FailureClass, JobState};
use roost_api::sweep::SweepView;
use serde_json::{Value, json};

use support::{Home, fraction, long, outbox, scenario, stdout};

/// Long enough to be caught in the middle, short enough to be waited for.
const A_WHILE_S: f64 = 10.0;

/// What SIGTERM promises: an exit in good order within this time.
const PROMISE: Duration = Duration::from_secs(5);

#[test]
fn a_sweep_goes_in_and_its_table_comes_out() {
    let home = Home::new();
    let _server = home.serve();
    let _worker = home.work("worker");
    let sweep = json!({
        "name": "small", "base": scenario(0.4), "design": {"kind": "grid"}, "replicates": 2,
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.06]}],
    });
    let file = home.file("sweep.json", &sweep);
    let view = stdout(&home.roost(&["submit", "--wait", "--json", &file]));
    let view: SweepView = serde_json::from_str(&view).unwrap();
    assert_eq!((view.counts.succeeded, view.counts.total()), (4, 4));
    assert_eq!(home.results_recorded(), 4);

    let id = view.id.to_string();
    let csv = stdout(&home.roost(&["results", &id, "--format", "csv"]));
    assert_eq!(csv.lines().count(), 5, "{csv}");
    assert!(csv.lines().next().unwrap().contains("discharged_kg"), "{csv}");
    let json: Value =
        serde_json::from_str(&stdout(&home.roost(&["results", &id, "--format", "json"]))).unwrap();
    let seeds: Vec<_> =
        json["trials"].as_array().unwrap().iter().map(|trial| trial["seed"].clone()).collect();
    assert_eq!(seeds, [1, 2, 1, 2]);
    assert!(json["trials"][0]["responses"]["discharged_kg"].is_number());
    let table = stdout(&home.roost(&["results", &id]));
    assert!(table.contains("gate_opening_m") && table.contains("succeeded"), "{table}");

    assert!(stdout(&home.roost(&["list"])).contains(&id));
    assert!(stdout(&home.roost(&["list", "--workers"])).contains("worker"));
    let jobs = stdout(&home.roost(&["list", "--jobs", "--state", "succeeded"]));
    assert_eq!(jobs.lines().count(), 6, "{jobs}");
    let job = json["trials"][3]["job_id"].as_str().unwrap();
    assert!(stdout(&home.roost(&["status", job])).contains("succeeded"));
    let series = stdout(&home.roost(&["results", job, "--format", "csv"]));
    assert!(series.starts_with("t_s,discharged_mass_kg"), "{series}");
}

#[test]
fn a_killed_workers_job_is_finished_once_by_another() {
    let home = Home::new();
    let _server = home.serve();
    let first = home.work("first");
    let job = home.submit(&long(A_WHILE_S));
    home.job_when(&job, "the job is under way", |job| fraction(job) > 0.05);
    first.kill();

    let second = home.work("second");
    let done = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((done.state, done.attempt), (JobState::Succeeded, 2), "{}", second.log());
    assert_eq!(home.results_recorded(), 1);
    support::until("the outbox is empty", || (outbox(&home.path("second")) == 0).then_some(()));
}

#[test]
fn a_killed_server_costs_no_run() {
    let home = Home::new();
    let server = home.serve();
    let worker = home.work("worker");
    let job = home.submit(&long(A_WHILE_S));
    home.job_when(&job, "the job is under way", |job| fraction(job) > 0.05);
    server.kill();

    let _server = home.serve();
    let back =
        home.job_when(&job, "the heartbeat is back", |job| fraction(job) > 0.05 || job.state.is_ended());
    assert_eq!(back.attempt, 1);
    let done = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((done.state, done.attempt), (JobState::Succeeded, 1), "{}", worker.log());
    assert_eq!(home.results_recorded(), 1);
}

#[test]
fn a_result_finished_while_the_server_is_away_waits_in_the_outbox() {
    let home = Home::new();
    let server = home.serve();
    let worker = home.work("worker");
    let job = home.submit(&long(A_WHILE_S));
    home.job_when(&job, "the job is under way", |job| job.state == JobState::Running);
    server.kill();
    support::until("the result is in the outbox", || (outbox(&home.path("worker")) == 1).then_some(()));
    // Not even the worker's own death loses it now.
    worker.kill();

    let _server = home.serve();
    let next = home.work("worker");
    let done = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((done.state, done.attempt), (JobState::Succeeded, 1), "{}", next.log());
    support::until("the outbox is empty", || (outbox(&home.path("worker")) == 0).then_some(()));
}

#[test]
fn a_result_waits_for_its_own_server_and_is_not_shown_to_another() {
    let (home, other) = (Home::new(), Home::new());
    let server = home.serve();
    let worker = home.work("worker");
    let job = home.submit(&long(1.0));
    home.job_when(&job, "the job is under way", |job| job.state == JobState::Running);
    server.kill();
    support::until("the result is in the outbox", || (outbox(&home.path("worker")) == 1).then_some(()));
    worker.kill();

    // The same state directory, another server: that one has never heard of the job.
    let _other_server = other.serve();
    let stranger = other.work_in("stranger", &home.path("worker"));
    let theirs = other.submit(&scenario(0.2));
    other.job_when(&theirs, "the other job has ended", |job| job.state == JobState::Succeeded);
    // The server has a result before the worker hears of that.
    support::until("the other's own result has left", || (outbox(&home.path("worker")) == 1).then_some(()));
    drop(stranger);
    assert_eq!(outbox(&home.path("worker")), 1, "the first server's result still waits");

    let _server = home.serve();
    let _worker = home.work("worker");
    let done = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((done.state, done.attempt), (JobState::Succeeded, 1));
}

#[test]
fn sigterm_hands_the_job_back_and_both_exit_in_good_order() {
    let _undisturbed = support::undisturbed();
    let home = Home::new();
    let server = home.serve();
    let worker = home.work("worker");
    let job = home.submit(&long(600.0));
    home.job_when(&job, "the job is under way", |job| fraction(job) > 0.0);

    worker.terminate();
    let (status, took) = worker.wait();
    assert!(status.success() && took < PROMISE, "{status} after {took:?}");
    let back = home.job(&job).unwrap();
    assert_eq!((back.state, back.attempt), (JobState::Queued, 1), "released, not lost");

    let idle = home.work("idle");
    home.job_when(&job, "another takes it up", |job| job.state == JobState::Running && job.attempt == 2);
    server.terminate();
    let (status, took) = server.wait();
    assert!(status.success() && took < PROMISE, "{status} after {took:?}");
    // Without a server to hand back to, a worker still exits.
    idle.terminate();
    let (status, took) = idle.wait();
    assert!(status.success() && took < PROMISE, "{status} after {took:?}");
}

#[test]
fn a_worker_waits_for_its_server_and_starts_anew_with_another() {
    let _undisturbed = support::undisturbed();
    let home = Home::new();
    let worker = home.work("worker");
    std::thread::sleep(Duration::from_millis(300));
    let server = home.serve();
    let job = home.submit(&scenario(0.2));
    home.job_when(&job, "the job has ended", |job| job.state == JobState::Succeeded);
    let job = home.submit(&long(600.0));
    home.job_when(&job, "the job is under way", |job| fraction(job) > 0.0);
    server.kill();

    // A server that has never heard of this worker, nor of its job: the worker drops that and serves the new one.
    std::fs::remove_dir_all(home.path("data")).unwrap();
    let _server = home.serve();
    let job = home.submit(&scenario(0.2));
    // Patience ends long before the first job's ten minutes: this is served because that was dropped.
    home.job_when(&job, "the job has ended", |job| job.state == JobState::Succeeded);

    worker.terminate();
    let (status, took) = worker.wait();
    assert!(status.success() && took < PROMISE, "an idle worker: {status} after {took:?}");
    let job = home.submit(&scenario(0.3));
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(home.job(&job).unwrap().state, JobState::Queued, "nothing claims after its end");
}

#[test]
fn cancel_reaches_a_running_solver_and_retry_runs_it_again() {
    let _undisturbed = support::undisturbed();
    let home = Home::new();
    let _server = home.serve();
    let _worker = home.work("worker");
    let job = home.submit(&long(600.0));
    home.job_when(&job, "the job is under way", |job| fraction(job) > 0.0);
    let id = job.id.to_string();
    stdout(&home.roost(&["cancel", &id]));
    let asked = Instant::now();
    let ended = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!(ended.state, JobState::Cancelled);
    assert!(asked.elapsed() < Duration::from_secs(20), "{:?}", asked.elapsed());

    stdout(&home.roost(&["retry", &id]));
    home.job_when(&job, "it runs again", |job| job.state == JobState::Running && job.attempt == 2);
    stdout(&home.roost(&["cancel", &id]));
    home.job_when(&job, "the job has ended", |job| job.state.is_ended());
}

#[test]
fn failures_carry_their_class_to_the_exit_code() {
    let home = Home::new();
    let _server = home.serve();
    let _worker = home.work("worker");
    let mut diverging = scenario(0.4);
    diverging["numerics"]["timestep_s"] = json!(0.02);
    diverging["numerics"]["allow_unstable"] = json!(true);
    let file = home.file("diverging.json", &diverging);
    let output = home.roost(&["submit", "--wait", "--json", &file]);
    assert_eq!(output.status.code(), Some(3), "{}", support::said(&output));

    let file = home.file("long.json", &long(600.0));
    let output = home.roost(&["submit", "--wait", "--json", "--max-wall-s", "0.3", &file]);
    assert_eq!(output.status.code(), Some(1), "{}", support::said(&output));
    let job: roost_api::job::JobView = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(job.failure_class, Some(FailureClass::Timeout));
}

#[test]
fn up_is_server_and_worker_in_one() {
    let home = Home::new();
    let listen = home.address.trim_start_matches("http://").to_owned();
    let data = home.path("data").display().to_string();
    let mut up = support::roost()
        .args(["up", "--listen", &listen, "--data", &data, "--threads", "1"])
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    support::until("the server answers", || {
        home.ask(|client| async move { client.sweeps(None, 1).await.ok() })
    });
    let file = home.file("scenario.json", &scenario(0.4));
    let output = home.roost(&["submit", "--wait", &file]);
    assert!(output.status.success(), "{}", support::said(&output));
    support::signal(up.id(), "TERM");
    let status = support::until("it exits", || up.try_wait().unwrap());
    assert!(status.success(), "{status}");
}

#[test]
fn accidents_over_and_over_lose_nothing_and_repeat_nothing() {
    let home = Home::new();
    let (mut server, mut worker) = (home.serve(), home.work("worker"));
    let sweep = json!({
        "name": "accidents", "base": long(0.3), "design": {"kind": "grid"}, "factors": [], "replicates": 12,
    });
    let file = home.file("sweep.json", &sweep);
    let view: SweepView = serde_json::from_str(&stdout(&home.roost(&["submit", "--json", &file]))).unwrap();
    for round in 0..6 {
        std::thread::sleep(Duration::from_millis(300 + 170 * round));
        if round % 2 == 0 {
            worker.kill();
            worker = home.work("worker");
        } else {
            server.kill();
            server = home.serve();
        }
    }
    let done = support::until("the sweep has ended", || {
        let sweep = home.ask(|client| async move { client.sweep(view.id).await }).unwrap();
        sweep.counts.is_ended().then_some(sweep)
    });
    assert_eq!(done.counts.succeeded, 12, "{:?}", done.counts);
    support::until("the outbox is empty", || (outbox(&home.path("worker")) == 0).then_some(()));
    assert_eq!(home.results_recorded(), 12);
    drop((server, worker));
}
