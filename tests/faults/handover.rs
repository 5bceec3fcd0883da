//! A change of the leader under clients that wait: event streams resume on another server, and waiting claims get their jobs.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use roost_api::ids::WorkerId;
use serde_json::{Value, json};

use crate::requests::{accepted, claim_of, register, submit, wait_until_ready};
use crate::servers::{start, two_servers, two_servers_with, wait_to_stand_by};
use crate::support::{Sandbox, hopper_scenario, stdout, wait_until};

/// An event stream of a client, which ends by itself after a minute.
struct Stream {
    client: Child,
    lines: mpsc::Receiver<String>,
}

impl Stream {
    /// Opens one, from now on or after an event.
    fn open(sandbox: &Sandbox, sweep: &str, after: Option<u64>) -> Self {
        let mut command = Command::new("curl");
        command.args(["-sSN", "--max-time", "60"]);
        if let Some(after) = after {
            command.args(["-H", &format!("Last-Event-ID: {after}")]);
        }
        command.arg(format!("{}/v1/sweeps/{sweep}/events", sandbox.address));
        let mut client = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let (sender, lines) = mpsc::channel();
        let output = BufReader::new(client.stdout.take().unwrap());
        thread::spawn(move || output.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
        Self { client, lines }
    }

    /// The next event: its name, its content and its number, if it has one. None if the stream has ended.
    fn next(&self) -> Option<(String, Value, Option<u64>)> {
        let (mut name, mut data, mut id) = (String::new(), Value::Null, None);
        loop {
            let line = self.lines.recv_timeout(Duration::from_secs(60)).ok()?;
            match line.split_once(": ") {
                Some(("event", text)) => name = text.to_owned(),
                Some(("data", text)) => data = serde_json::from_str(text).unwrap(),
                Some(("id", text)) => id = text.parse().ok(),
                None if !name.is_empty() => return Some((name, data, id)),
                _ => {}
            }
        }
    }

    /// Notes changes of jobs until this number of jobs has succeeded in all, or the stream ends.
    fn note(&self, changes: &mut BTreeMap<u64, Value>, succeeded: usize) {
        let has = |changes: &BTreeMap<u64, Value>| {
            changes.values().filter(|change| change["state"] == "succeeded").count() >= succeeded
        };
        while !has(changes) {
            let Some((name, data, id)) = self.next() else { return };
            if name == "change" {
                assert_eq!(changes.insert(id.unwrap(), data), None, "no event comes twice");
            }
        }
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        let _ = self.client.kill();
        let _ = self.client.wait();
    }
}

#[test]
fn an_event_stream_resumes_on_another_server_and_misses_nothing() {
    let (_postgres, database, [one, two], [first, _second]) = two_servers();
    let document = json!({
        "name": "events",
        "base": hopper_scenario(0.4),
        "design": {"kind": "grid"},
        "factors": [{"pointer": "/equipment/belt_speed_m_s", "levels": [0.1, 0.2, 0.3]}],
        "replicates": 3,
    });
    let file = two.file("sweep.json", &document);
    let sweep: Value = serde_json::from_str(&stdout(&two.roost(&["submit", "--json", &file]))).unwrap();
    let id = sweep["id"].as_str().unwrap();
    // Through the standby.
    let stream = Stream::open(&two, id, None);
    let (name, view, start_id) = stream.next().expect("the first event");
    assert_eq!((&*name, &view["counts"]["queued"]), ("sweep", &json!(9)));
    let _worker = two.start_worker("worker");
    let mut changes = BTreeMap::new();
    stream.note(&mut changes, 2);
    first.kill();
    // The stream ends with the leader, some events later.
    stream.note(&mut changes, 9);
    let last = *changes.keys().last().unwrap();
    let before = changes.len();
    wait_until_ready(&two);
    let first = start(&one, &database);
    wait_to_stand_by(&first);
    Stream::open(&one, id, Some(last)).note(&mut changes, 9);
    assert!(changes.len() > before, "the client has come back before the end");

    let mut all = BTreeMap::new();
    Stream::open(&two, id, start_id).note(&mut all, 9);
    assert_eq!(changes, all);
}

#[test]
fn a_claim_that_waits_at_a_standby_gets_a_job_that_the_leader_receives() {
    // Nobody renews the leases of these claims.
    let start = |sandbox: &Sandbox, database: &str| {
        sandbox.start_server_with(&["--lease-s", "60", "--database", database])
    };
    let (_postgres, _database, [one, two], [first, second]) = two_servers_with(start);
    let worker = register(&two);
    let claimed = wait_for_work(&two, worker);
    thread::sleep(Duration::from_millis(500));
    assert!(!claimed.is_finished(), "it waits");
    let (submitted, job) = (Instant::now(), accepted(submit(&one, 1)));
    let (reply, answered) = claimed.join().unwrap();
    assert_eq!(reply["attempts"][0]["job_id"], job.as_str(), "{reply}");
    let wait = answered.duration_since(submitted);
    assert!(wait < Duration::from_secs(10), "the job wakes it: {wait:?}");

    // The leader stops in good order: it answers the claim without a job, and the next claim waits at the next leader.
    let claimed = wait_for_work(&two, worker);
    thread::sleep(Duration::from_millis(500));
    first.terminate();
    assert!(first.wait().0.success());
    let (reply, _) = claimed.join().unwrap();
    assert_eq!(reply, json!({"attempts": []}));
    let claimed = wait_for_work(&two, worker);
    wait_until("the second leads", || second.log().contains("listening").then_some(()));
    let job = accepted(submit(&two, 2));
    let (reply, _) = claimed.join().unwrap();
    assert_eq!(reply["attempts"][0]["job_id"], job.as_str(), "{reply}");
}

/// A claim that waits for up to 20 s, and the time of its answer.
fn wait_for_work(sandbox: &Sandbox, worker: WorkerId) -> JoinHandle<(Value, Instant)> {
    let sent = serde_json::to_string(&claim_of(worker, 20.0)).unwrap();
    let url = format!("{}/v1/claims", sandbox.address);
    thread::spawn(move || {
        let answer = Command::new("curl").args(["-sS", "--json", &sent, &url]).output().unwrap().stdout;
        (serde_json::from_slice(&answer).unwrap(), Instant::now())
    })
}
