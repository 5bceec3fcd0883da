//! The examples of `api.md`: every shell block under a route runs against a real server, in the order of the page. A `curl` that
//! gets an error response fails the test.

mod support;

use std::fmt::Write;
use std::process::Command;

use roost_api::job::JobState;
use serde_json::{Value, json};
use support::{Sandbox, hopper_scenario, stl};

/// A route as `METHOD /path`, and the shell below its heading.
fn examples(page: &str) -> Vec<(&str, Vec<&str>)> {
    let mut sections = page.split("\n### ").skip(1);
    let mut found = Vec::new();
    for section in &mut sections {
        // The end of a chapter ends its last route.
        let section = section.split("\n## ").next().unwrap_or_default();
        let (route, text) = section.split_once('\n').unwrap_or((section, ""));
        let blocks = text.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
        found.push((route, blocks));
    }
    found
}

/// Shell commands before the example of a route, for data that the page assumes.
fn before(route: &str) -> &'static str {
    match route {
        "GET /v1/jobs/{id}/result" => "JOB=$DONE",
        // The job before it recorded none.
        "GET /v1/jobs/{id}/frames" => "JOB=$FRAMED",
        "POST /v1/jobs/{id}/cancel" => "JOB=$QUEUED",
        "POST /v1/workers" => "WORKER=$(cat /proc/sys/kernel/random/uuid)",
        // The previous worker is draining.
        "POST /v1/claims" => {
            r#"JOB=$(submit)
WORKER=$(cat /proc/sys/kernel/random/uuid)
# Of what computed the result that it will deliver.
DEVICE=$(curl -s $R/v1/jobs/$DONE/result | sed -n 's/.*"device":"\([^"]*\)".*/\1/p')
curl -s $R/v1/workers --json '{"worker_id": "'$WORKER'", "name": "again", "api_version": "v1", "solver_revision": '$REVISION',
  "backend": "cpu", "device": "'"$DEVICE"'", "threads": 1}'"#
        }
        "PUT /v1/jobs/{id}/attempts/{n}/checkpoint" => "printf 'a checkpoint' > run.checkpoint",
        "PUT /v1/jobs/{id}/attempts/{n}/fill" => "printf 'a checkpoint' > run.fill",
        "POST /v1/jobs/{id}/attempts/{n}/result" => {
            r#"printf '{"worker_id": "%s", "result": %s}' $WORKER "$(curl -s $R/v1/jobs/$DONE/result)" > delivery.json"#
        }
        "POST /v1/results" => {
            r#"JOB=$(submit)
curl -s $R/v1/claims --json '{"request_id": "'$(cat /proc/sys/kernel/random/uuid)'", "worker_id": "'$WORKER'", "max_jobs": 1, "wait_s": 5}'
printf '{"results": [{"job_id": "%s", "attempt": 1, "delivery": %s}]}' $JOB "$(cat delivery.json)" > deliveries.json"#
        }
        "POST /v1/jobs/{id}/attempts/{n}/failure" => {
            r#"JOB=$(submit)
curl -s $R/v1/claims --json '{"request_id": "'$(cat /proc/sys/kernel/random/uuid)'", "worker_id": "'$WORKER'", "max_jobs": 1, "wait_s": 5}'"#
        }
        _ => "",
    }
}

/// Shell commands after the example, which set variables for later examples.
fn after(route: &str) -> &'static str {
    match route {
        "POST /v1/jobs" => "QUEUED=$(id) JOB=$(id)",
        "POST /v1/sweeps" => "SWEEP=$(id)",
        "POST /v1/meshes" => r#"MESH=$(sed -n 's/^{"digest":"\([0-9a-f]*\)".*/\1/p' out)"#,
        _ => "",
    }
}

#[test]
fn every_example_of_the_api_succeeds() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/api.md")).unwrap();
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let worker = sandbox.start_worker("worker");
    let done = sandbox.submit(&hopper_scenario(0.2));
    sandbox.wait_for_job(&done, "the job has ended", |job| job.state == JobState::Succeeded);
    let file = sandbox.file("framed.json", &hopper_scenario(0.1));
    let framed = sandbox.roost(&["submit", "--wait", "--json", "--frame-interval", "0.05", &file]);
    let framed: Value = serde_json::from_str(&support::stdout(&framed)).unwrap();
    // The following examples act as a worker.
    worker.terminate();
    assert!(worker.wait().0.success());

    std::fs::write(sandbox.path("hopper.stl"), stl::binary(&stl::block([120.0, 60.0, 30.0], 1))).unwrap();
    let again = json!({"scenario": hopper_scenario(0.2), "cache": "bypass", "priority": 100});
    std::fs::write(sandbox.path("again.json"), again.to_string()).unwrap();
    let mut script = format!(
        "set -euo pipefail\ntrap 'cat out >&2' EXIT\ncd '{}'\nR={}\nDONE={}\nFRAMED={}\nREVISION={}\nDIGEST={}\nSLICE= JOB= SWEEP= WORKER= MESH=\n{}",
        sandbox.folder.path().display(),
        sandbox.address,
        done.id,
        framed["id"].as_str().unwrap(),
        roost_solver::SOLVER_REVISION,
        roost_solver::mesh::digest(b"a checkpoint"),
        // An event stream ends only by the timeout of curl (28).
        r#"curl() { command curl --fail-with-body "$@" || [ $? = 28 ]; }
b3sum() { echo $MESH; }
id() { sed -n 's/^{"id":"\([^"]*\)".*/\1/p' out | head -n 1; }
submit() { curl -s $R/v1/jobs --json @again.json | sed -n 's/^{"id":"\([^"]*\)".*/\1/p'; }
"#
    );
    let examples = examples(&page);
    for (route, blocks) in &examples {
        assert!(!blocks.is_empty(), "{route} has no example");
        writeln!(script, "echo '=== {route}' >&2\n{}\n: > out", before(route)).unwrap();
        for block in blocks {
            // One response per line.
            writeln!(script, "{{\n{}\necho; }} >> out", block.replace("\ncurl ", "\necho\ncurl ")).unwrap();
        }
        writeln!(script, "cat out >&2\n{}", after(route)).unwrap();
    }
    assert!(examples.len() > 30, "{} routes", examples.len());
    let output = Command::new("bash").args(["-c", &script]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "{}",
        said.chars().rev().take(3000).collect::<Vec<_>>().iter().rev().collect::<String>()
    );

    // The examples had their effects.
    let answer = |route: &str| -> Value {
        let told = said.split(&format!("=== {route}\n")).nth(1).unwrap_or_default();
        let lines = told.lines().take_while(|line| !line.starts_with("=== "));
        lines.filter_map(|line| serde_json::from_str(line).ok()).last().unwrap_or_default()
    };
    assert_eq!(answer("POST /v1/sweeps/{id}/extend")["points"], 9, "a grid of 2 × 3 with one more gate");
    assert_eq!(answer("DELETE /v1/sweeps/{id}")["dry_run"], true);
    assert_eq!(answer("POST /v1/jobs/{id}/attempts/{n}/result")["recorded"], true);
    assert_eq!(answer("POST /v1/results")["answers"][0]["recorded"], true);
    assert_eq!(answer("PUT /v1/jobs/{id}/attempts/{n}/checkpoint")["recorded"], true);
    assert_eq!(std::fs::read(sandbox.path("stored.checkpoint")).unwrap(), b"a checkpoint");
    // The worker stored the fill of the first job, which has the same hopper.
    assert_eq!(answer("PUT /v1/jobs/{id}/attempts/{n}/fill")["recorded"], false);
    assert!(std::fs::read(sandbox.path("stored.fill")).unwrap().starts_with(b"ROOSTCKP"));
    assert_eq!(&std::fs::read(sandbox.path("results.parquet")).unwrap()[..4], b"PAR1");
    assert!(std::fs::read_to_string(sandbox.path("results.csv")).unwrap().starts_with("job_id,point,"));
    let short = std::fs::read_to_string(sandbox.path("short.csv")).unwrap();
    assert!(short.lines().nth(1).unwrap().starts_with(",,,,m,m/s,"), "{short}");
    assert_eq!(&std::fs::read(sandbox.path("results.xlsx")).unwrap()[..4], b"PK\x03\x04");
}

#[test]
fn wrong_example_is_reported() {
    let page = "## Things\n\n### GET /x\n\nText.\n\n```sh\ncurl a\n```\n\n```json\n{}\n```\n\n### GET /y\n\nNone.\n\n## Next\n\n```sh\nno\n```\n";
    assert_eq!(examples(page), [("GET /x", vec!["curl a\n"]), ("GET /y", vec![])]);
}
