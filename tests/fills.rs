//! Fills that jobs of different workers share: each is computed once, and results have the bits of runs that fill for themselves.

mod support;

use std::collections::BTreeMap;
use std::path::PathBuf;

use roost_api::job::{FilledBy, JobState, JobView};
use serde_json::{Value, json};

use support::{Process, Sandbox, hopper_scenario, outbox_len, stdout, wait_until};

const GATES_M: [f64; 3] = [0.05, 0.06, 0.08];
const SEEDS: u64 = 3;

/// A slice of a hopper, whose filling takes most of the run.
fn slice() -> Value {
    let mut scenario = hopper_scenario(0.1);
    scenario["product"]["count"] = json!(4);
    scenario["numerics"]["rest_speed_m_s"] = json!(0.05);
    scenario
}

fn sweep(shared_fill: bool) -> Value {
    let factors = json!([{"pointer": "/equipment/gate_opening_m", "levels": GATES_M}]);
    json!({"name": "gates", "base": slice(), "design": {"kind": "grid"}, "factors": factors, "replicates": SEEDS,
           "shared_fill": shared_fill, "cache": "bypass"})
}

/// Submits a sweep, waits for its end, and returns its jobs with their results, by gate and seed.
fn finish(sandbox: &Sandbox, sweep: &Value) -> BTreeMap<String, (JobView, [Value; 4])> {
    let file = sandbox.file("sweep.json", sweep);
    let id = sandbox.json_output(&["submit", "--wait", &file])["id"].as_str().unwrap().to_owned();
    let jobs = sandbox.get(&format!("/v1/sweeps/{id}/jobs?limit=100"));
    let jobs: Vec<JobView> = serde_json::from_value(jobs["items"].clone()).unwrap();
    assert_eq!(jobs.len(), GATES_M.len() * SEEDS as usize);
    let with_result = |job: JobView| {
        assert_eq!(job.state, JobState::Succeeded, "{job:?}");
        let result = sandbox.get(&format!("/v1/jobs/{}/result", job.id));
        let physics = ["responses", "series", "curves", "end_reason"].map(|name| result[name].clone());
        (format!("{:?} {}", job.factors, job.seed), (job, physics))
    };
    jobs.into_iter().map(with_result).collect()
}

/// How many jobs filled by themselves, and how many started from the fill of another.
fn filled_by(jobs: &BTreeMap<String, (JobView, [Value; 4])>) -> (usize, usize) {
    let count = |by| jobs.values().filter(|(job, _)| job.filled_by == Some(by)).count();
    (count(FilledBy::Attempt), count(FilledBy::Shared))
}

#[track_caller]
fn expect_same(
    shared: &BTreeMap<String, (JobView, [Value; 4])>,
    own: &BTreeMap<String, (JobView, [Value; 4])>,
) {
    assert!(shared.keys().eq(own.keys()));
    for (key, (_, physics)) in shared {
        assert!(*physics == own[key].1, "the result of {key} differs");
    }
}

/// The stored objects of the server.
fn objects(sandbox: &Sandbox) -> Vec<PathBuf> {
    let list =
        |folder: PathBuf| std::fs::read_dir(folder).into_iter().flatten().flatten().map(|it| it.path());
    let folders = list(sandbox.path("data").join("objects")).filter(|folder| !folder.ends_with("uploads"));
    folders.flat_map(list).collect()
}

fn two_workers(sandbox: &Sandbox) -> [Process; 2] {
    ["first", "second"].map(|name| sandbox.start_worker(name))
}

#[test]
fn two_workers_compute_each_fill_once_and_results_keep_their_bits() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let own = {
        let _workers = two_workers(&sandbox);
        let own = finish(&sandbox, &sweep(false));
        assert_eq!(filled_by(&own), (0, 0), "these share none");
        assert!(objects(&sandbox).is_empty());
        own
    };
    let workers = ["third", "fourth"].map(|name| sandbox.start_worker(name));
    let shared = finish(&sandbox, &sweep(true));
    assert_eq!(filled_by(&shared), (SEEDS as usize, (GATES_M.len() - 1) * SEEDS as usize));
    assert_eq!(objects(&sandbox).len(), SEEDS as usize, "a fill of each seed");
    expect_same(&shared, &own);
    let (job, _) = shared.values().find(|(job, _)| job.filled_by == Some(FilledBy::Shared)).unwrap();
    let status = stdout(&sandbox.roost(&["status", &job.id.to_string()]));
    assert!(status.contains("started from a filled state of another run"), "{status}");

    // The server keeps them: a new worker fills none.
    drop(workers);
    let _later = sandbox.start_worker("later");
    let again = finish(&sandbox, &sweep(true));
    assert_eq!(filled_by(&again), (0, again.len()));
    expect_same(&again, &own);
}

/// Steps so small that the filling takes seconds.
fn slow_fill(gate_m: f64, timestep_s: f64) -> Value {
    let mut scenario = slice();
    scenario["equipment"]["gate_opening_m"] = json!(gate_m);
    scenario["numerics"]["timestep_s"] = json!(timestep_s);
    scenario
}

#[test]
fn kill_of_a_worker_that_computes_a_fill_releases_the_waiting_jobs() {
    let sandbox = Sandbox::new();
    // The lease of the first worker, which is stopped, outlasts the work of the second.
    let _server = sandbox.start_server_with(&["--lease-s", "20"]);
    let first = sandbox.start_worker("first");
    // The filling lasts until the second worker has started and done other work.
    let slower_fill = |gate_m| slow_fill(gate_m, 2.5e-6);
    let filling = sandbox.submit(&slower_fill(0.05));
    sandbox.wait_for_job(&filling, "it fills", |job| job.progress.is_some());
    first.freeze();
    let waiting = sandbox.submit(&slower_fill(0.06));
    let other = sandbox.submit(&hopper_scenario(0.1));
    let _second = sandbox.start_worker("second");
    sandbox.wait_for_job(&other, "the second worker takes other work", |job| job.state.is_ended());
    assert_eq!(sandbox.job(&waiting).unwrap().attempt, 0, "it waits for the fill");
    first.kill();
    let done = sandbox.wait_for_job(&waiting, "it is freed", |job| job.state.is_ended());
    assert_eq!(done.state, JobState::Succeeded, "{done:?}");
    let lost = sandbox.wait_for_job(&filling, "the lost job ends", |job| job.state.is_ended());
    assert_eq!((lost.state, lost.attempt), (JobState::Succeeded, 2), "{lost:?}");
    let by = [done.filled_by, lost.filled_by];
    assert!(by.contains(&Some(FilledBy::Attempt)) && by.contains(&Some(FilledBy::Shared)), "{by:?}");
}

#[test]
fn a_damaged_or_lost_fill_is_computed_again() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let first = sandbox.start_worker("first");
    let one = |gate_m: f64| {
        let mut scenario = slice();
        scenario["equipment"]["gate_opening_m"] = json!(gate_m);
        let job = sandbox.submit(&scenario);
        let done = sandbox.wait_for_job(&job, "it ends", |job| job.state.is_ended());
        assert_eq!(done.state, JobState::Succeeded, "{done:?}");
        done.filled_by
    };
    assert_eq!(one(0.05), Some(FilledBy::Attempt));
    first.terminate();
    assert!(first.wait().0.success());
    let [object] = &objects(&sandbox)[..] else { panic!("one object") };
    let mut bytes = std::fs::read(object).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(object, bytes).unwrap();
    let second = sandbox.start_worker("second");
    assert_eq!(one(0.06), Some(FilledBy::Attempt), "{}", second.log());
    assert_eq!(one(0.07), Some(FilledBy::Shared));
    second.terminate();
    assert!(second.wait().0.success());
    wait_until("the repaired fill is alone", || (objects(&sandbox).len() == 1).then_some(()));
    std::fs::remove_file(&objects(&sandbox)[0]).unwrap();
    let _third = sandbox.start_worker("third");
    assert_eq!(one(0.08), Some(FilledBy::Attempt));
    assert_eq!(objects(&sandbox).len(), 1, "uploaded again");
    // The worker forgets a result only after the server's answer.
    wait_until("the outbox is empty", || (outbox_len(&sandbox.path("third")) == 0).then_some(()));
}

#[test]
fn worker_uploads_a_cached_fill_that_the_server_lacks() {
    let sandbox = Sandbox::new();
    let server = sandbox.start_server_with(&["--fills-limit-mib", "0"]);
    let _worker = sandbox.start_worker_with("first", &["--slots", "2"]);
    let one = |gate_m: f64| sandbox.submit(&slow_fill(gate_m, 5e-6));
    let end = |job: &JobView| sandbox.wait_for_job(job, "it ends", |job| job.state.is_ended());
    // The server shares none: two slots of one worker fill once.
    let both = [one(0.05), one(0.06)];
    let by = both.each_ref().map(|job| end(job).filled_by);
    assert_eq!(by.iter().filter(|by| **by == Some(FilledBy::Attempt)).count(), 1, "{by:?}");
    assert_eq!(by.iter().filter(|by| **by == Some(FilledBy::Shared)).count(), 1, "{by:?}");
    server.terminate();
    assert!(server.wait().0.success());
    assert!(objects(&sandbox).is_empty());
    let _server = sandbox.start_server();
    assert_eq!(end(&one(0.07)).filled_by, Some(FilledBy::Shared));
    assert_eq!(objects(&sandbox).len(), 1, "other workers need not fill");
}
