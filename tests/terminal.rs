//! Texts from documents, workers and servers cannot control the terminal or imitate a line of a command.

mod support;

use std::process::{Command, Output, Stdio};

use roost_api::API_VERSION;
use roost_api::ids::WorkerId;
use roost_api::job::AttemptOutcome;
use roost_api::lease::{ClaimRequest, FailureReport};
use roost_api::worker::WorkerRegistration;
use roost_solver::SOLVER_REVISION;
use serde_json::{Value, json};
use support::{Sandbox, hopper_scenario, transcript};
use uuid::Uuid;

/// Control sequences: window title, line end, text direction, colour by an 8-bit character, deletion, cursor movement.
const EVIL: &str = "a\u{1b}]0;owned\u{7}\nerror: b\u{202e}gpj\u{9b}31m\u{7f}\r\tc";
/// The escaped form of the control sequences.
const SHOWN: &str = r"a\u001b]0;owned\u0007\nerror: b\u202egpj\u009b31m\u007f\r\tc";

/// Fails if a text has control characters, or a line that starts with foreign text.
fn assert_safe(text: &str) {
    let unsafe_char = |c: char| (c.is_control() && c != '\n') || ('\u{202a}'..='\u{202e}').contains(&c);
    assert!(!text.contains(unsafe_char), "{text:?}");
    assert!(!text.lines().any(|line| line.starts_with("error: b")), "{text:?}");
}

/// The output of a command, which must be safe, and contain the escaped text if `is_there`.
fn safe_output(output: &Output, is_there: bool) -> String {
    let text = [&output.stdout[..], &output.stderr[..]].map(String::from_utf8_lossy).concat();
    assert_safe(&text);
    assert_eq!(text.contains(SHOWN), is_there, "{}", transcript(output));
    text
}

/// Registers a worker whose name has control sequences, and fails the only job with such a message.
fn fail_a_job(sandbox: &Sandbox) {
    let registration = WorkerRegistration {
        worker_id: WorkerId::new(),
        name: EVIL.to_owned(),
        api_version: API_VERSION.to_owned(),
        solver_revision: SOLVER_REVISION,
        backend: "cpu".to_owned(),
        device: EVIL.to_owned(),
        memory_mib: None,
        threads: 1,
    };
    let worker_id = registration.worker_id;
    let claim = ClaimRequest {
        request_id: Uuid::now_v7(),
        worker_id,
        max_jobs: 1,
        wait_s: 20.0,
        shares_fills: false,
    };
    sandbox.ask(|client| async move {
        client.register(&registration).await.unwrap();
        let claimed = client.claim(&claim).await.unwrap().attempts.remove(0);
        let (outcome, message) = (AttemptOutcome::Invalid, EVIL.to_owned());
        let report = FailureReport { worker_id, outcome, message, result: None };
        client.report_failure(claimed.job_id, claimed.attempt, &report).await.unwrap();
    });
}

#[test]
fn names_and_messages_are_escaped_in_every_output() {
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let sweep = json!({
        "name": EVIL,
        "labels": {EVIL: EVIL},
        "base": hopper_scenario(0.1),
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.05]}],
        "design": {"kind": "grid"},
    });
    let file = sandbox.file("sweep.json", &sweep);
    let mut waiting = support::roost();
    waiting.args(["submit", "--wait", &file]).env("ROOST_SERVER", &sandbox.address);
    let waiting = waiting.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    fail_a_job(&sandbox);
    let waited = safe_output(&waiting.wait_with_output().unwrap(), false);
    let id = waited.lines().find_map(|line| line.strip_prefix("sweep ")?.split(':').next()).unwrap();
    let job = sandbox.json_output(&["list", "--jobs"])["items"][0]["id"].as_str().unwrap().to_owned();

    for (arguments, is_there) in [
        (vec!["list"], true),
        (vec!["list", "--workers"], true),
        (vec!["list", "--jobs"], false),
        (vec!["status", id], true),
        (vec!["status", &job], true),
        (vec!["results", id], false),
        (vec!["results", id, "--by", "point"], false),
        (vec!["results", &job], false),
        (vec!["effects", id], false),
        (vec!["cancel", id], true),
        (vec!["delete", id], false),
    ] {
        safe_output(&sandbox.roost(&arguments), is_there);
    }
    // A JSON document stays the same and is safe.
    let document = sandbox.roost(&["list", "--json"]);
    assert_safe(&String::from_utf8_lossy(&document.stdout));
    let document: Value = serde_json::from_slice(&document.stdout).unwrap();
    assert_eq!(document["items"][0]["name"], EVIL);
    let log = server.log();
    assert_safe(&log);
    assert!(log.contains("owned"), "the log names the worker: {log}");

    // On a terminal, without further options.
    if Command::new("script").arg("--version").output().is_ok_and(|found| found.status.success()) {
        let list = format!("{} list --workers --server {}", env!("CARGO_BIN_EXE_roost"), sandbox.address);
        let terminal = Command::new("script").args(["-qec", &list, "/dev/null"]).output().unwrap();
        let text = String::from_utf8_lossy(&terminal.stdout).replace("\r\n", "\n");
        assert_safe(&text);
        assert!(text.contains(SHOWN), "{text:?}");
    } else {
        support::skip("`script` is not there: nothing looked at on a terminal");
    }
}

#[test]
fn faults_of_a_document_are_escaped() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut document = hopper_scenario(0.1);
    document[EVIL] = json!(EVIL);
    document["equipment"]["side_walls"] = json!(EVIL);
    let file = sandbox.file("scenario.json", &document);
    for command in ["validate", "submit"] {
        safe_output(&sandbox.roost(&[command, &file]), true);
    }
    let sweep = json!({
        "base": hopper_scenario(0.1),
        "factors": [{"pointer": EVIL, "levels": [EVIL]}],
        "design": {"kind": "grid"},
    });
    safe_output(&sandbox.roost(&["submit", &sandbox.file("sweep.json", &sweep)]), true);
    let sweep = json!({"base": hopper_scenario(0.1), "design": {"kind": "csv", "file": EVIL}});
    safe_output(&sandbox.roost(&["submit", &sandbox.file("sweep.json", &sweep)]), true);
}
