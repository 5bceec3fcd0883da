//! Several servers of one database: one leads, and the others pass requests on and take its place.

use std::io::{BufRead, BufReader};
use std::os::unix::fs::symlink;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use roost_api::job::JobState;
use serde_json::json;

use crate::cluster::Cluster;
use crate::support::{self, Process, Sandbox, hopper_scenario};

/// Two places for servers of one database, with the same folder of objects.
pub(crate) fn pair_of_sandboxes(new: impl Fn() -> Sandbox) -> [Sandbox; 2] {
    let pair = [new(), new()];
    std::fs::create_dir(pair[0].path("data")).unwrap();
    symlink(pair[0].path("data"), pair[1].path("data")).unwrap();
    pair
}

/// A PostgreSQL with one database, and two servers of it: the first one leads.
pub(crate) fn two_servers() -> (Cluster, String, [Sandbox; 2], [Process; 2]) {
    two_servers_with(start)
}

/// The same, each started by a function.
pub(crate) fn two_servers_with(
    start: impl Fn(&Sandbox, &str) -> Process,
) -> (Cluster, String, [Sandbox; 2], [Process; 2]) {
    let postgres = Cluster::start(&std::env::temp_dir(), "");
    let database = postgres.create("roost");
    let sandboxes = pair_of_sandboxes(Sandbox::new);
    let servers = [0, 1].map(|index| start(&sandboxes[index], &database));
    wait_to_stand_by(&servers[1]);
    (postgres, database, sandboxes, servers)
}

/// Starts a server with short leases.
pub(crate) fn start(sandbox: &Sandbox, database: &str) -> Process {
    sandbox.start_server_with(&["--lease-s", "3", "--database", database])
}

/// Waits for the log of a standby: it may pass on a request before.
pub(crate) fn wait_to_stand_by(server: &Process) {
    support::wait_until("it stands by", || server.log().contains("requests are passed on").then_some(()));
}

/// Asks for the list of jobs for some time. Each answer must be 200.
fn answers_all_the_time(sandbox: &Sandbox, time: Duration) {
    let started = Instant::now();
    while started.elapsed() < time {
        assert_eq!(sandbox.status("/v1/jobs"), Some(200), "after {:?}", started.elapsed());
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn either_of_two_servers_answers_and_the_second_leads_after_the_first() {
    let (_postgres, database, [one, two], [first, second]) = two_servers();
    // Workers and users may use either.
    let _workers = [one.start_worker("one"), two.start_worker("two")];
    let submit = |sandbox: &Sandbox, seed: u32| {
        let mut scenario = hopper_scenario(0.6);
        scenario["seed"] = json!(seed);
        sandbox.submit(&scenario)
    };
    let mut jobs: Vec<_> = (0..8).map(|seed| submit(if seed % 2 == 0 { &one } else { &two }, seed)).collect();
    two.wait_for_job(&jobs[0], "a job is under way or has ended", |job| job.state != JobState::Queued);
    let ids = |sandbox: &Sandbox| -> Vec<serde_json::Value> {
        let page = sandbox.get("/v1/jobs");
        page["items"].as_array().unwrap().iter().map(|job| job["id"].clone()).collect()
    };
    assert_eq!((ids(&one).len(), ids(&one)), (jobs.len(), ids(&two)));

    // A crash: workers of the dead server go on once it is back.
    first.kill();
    answers_all_the_time(&two, Duration::from_secs(3));
    let first = start(&one, &database);
    wait_to_stand_by(&first);
    jobs.push(submit(&one, 8));

    // The end of an upgrade: the second stops in good order.
    second.terminate();
    answers_all_the_time(&one, Duration::from_secs(3));
    let (status, _) = second.wait();
    assert!(status.success(), "{status}");
    let _second = start(&two, &database);
    jobs.push(submit(&two, 9));

    for job in &jobs {
        two.wait_for_job(job, "the job has succeeded", |job| job.state == JobState::Succeeded);
    }
    assert_eq!(one.results_recorded(), jobs.len() as u64, "one result for each job");
}

/// A request by a process of its own, which ends by itself after a minute.
fn curl(arguments: &[&str], url: &str) -> Child {
    let mut command = Command::new("curl");
    command.args(["-sN", "--max-time", "60"]).args(arguments).arg(url).stdout(Stdio::piped()).spawn().unwrap()
}

#[test]
fn a_frozen_leader_loses_the_lead_and_stands_by_afterwards() {
    const TIMED_OUT: i32 = 28;
    let (_postgres, _database, [one, two], [first, _second]) = two_servers();
    let waiting = one.submit(&hopper_scenario(0.6));
    let mut stream = curl(&[], &format!("{}/v1/jobs/{}/events", two.address, waiting.id));
    let (mut events, mut line) = (BufReader::new(stream.stdout.take().unwrap()), String::new());
    events.read_line(&mut line).unwrap();
    assert!(!line.is_empty(), "no event");
    first.freeze();
    let waited = Instant::now();
    let read = curl(&["-o", "/dev/null", "-w", "%{http_code}"], &format!("{}/v1/jobs", two.address));
    support::wait_until("the second server leads", || two.answers("/readyz", 200).then_some(()));
    assert!(waited.elapsed() > Duration::from_secs(10), "a short pause is no reason: {:?}", waited.elapsed());
    assert_eq!(read.wait_with_output().unwrap().stdout, b"200", "a read from before goes to the next leader");
    let ended = stream.wait().unwrap();
    assert_ne!(ended.code(), Some(TIMED_OUT), "a stream of the frozen leader ends");

    let job = two.submit(&hopper_scenario(0.6));
    first.thaw();
    support::wait_until("the first server stands by", || {
        first.log().contains("another server leads now").then_some(())
    });
    let seen = one.wait_for_job(&job, "it passes requests on", |_| true);
    assert_eq!(seen.state, JobState::Queued);
    let _worker = one.start_worker("worker");
    for job in [waiting, job] {
        two.wait_for_job(&job, "the job has succeeded", |job| job.state == JobState::Succeeded);
    }
}
