//! Meshes from files beside a scenario, through the server to the worker.

mod support;

use std::path::Path;
use std::process::Stdio;

use roost_api::job::{FailureClass, JobState, JobView};
use serde_json::{Value, json};
use support::proxy::{Files, Proxy};
use support::stl::{ascii, binary, block, wall};
use support::{Sandbox, hopper_scenario, roost, run, stdout, transcript, wait_until};

/// Large enough for an interruption during its transfer.
fn block_file(length_mm: f32) -> Vec<u8> {
    binary(&block([length_mm, 60.0, 30.0], 20))
}

fn file(name: &str) -> Value {
    json!({"file": name, "units": "mm"})
}

fn write(sandbox: &Sandbox, name: &str, bytes: &[u8]) {
    let path = sandbox.path(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// A small scenario with product and wall from existing files.
fn scenario_with_files(sandbox: &Sandbox) -> Value {
    write(sandbox, "parts/block.stl", &block_file(120.0));
    write(sandbox, "parts/wall.stl", &ascii(&wall(200.0, 300.0)));
    let mut scenario = hopper_scenario(0.4);
    scenario["product"]["mesh"] = file("parts/block.stl");
    scenario["equipment"]["surfaces"] =
        json!([{"name": "wall", "mesh": file("parts/wall.stl"), "position_m": [0.4, 0, 0]}]);
    scenario
}

fn submit(sandbox: &Sandbox, document: &Value, arguments: &[&str]) -> (JobView, String) {
    let file = sandbox.file("scenario.json", document);
    let output = sandbox.roost(&[&["submit", "--json", &file], arguments].concat());
    (serde_json::from_str(&stdout(&output)).unwrap(), String::from_utf8(output.stderr).unwrap())
}

/// Names of the complete files in the cache of a worker.
fn cached(sandbox: &Sandbox, worker: &str) -> Vec<String> {
    let entries = std::fs::read_dir(sandbox.path(worker).join("meshes")).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().into_string().unwrap());
    names.filter(|name| name.ends_with(".stl")).collect()
}

/// The computed part of a result, without the machine.
fn physics(result: &Value) -> Value {
    json!([result["responses"], result["series"], result["scenario_digest"]])
}

#[test]
fn mesh_files_are_uploaded_once_and_give_the_local_result() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let proxy = Proxy::to(&sandbox.address);
    let _worker = sandbox.start_worker_at(&proxy.address, "worker", "1");
    let mut document = scenario_with_files(&sandbox);
    let (job, messages) = submit(&sandbox, &document, &["--wait"]);
    assert_eq!(job.state, JobState::Succeeded, "{:?}", job.failure_message);
    assert_eq!(messages.matches("uploaded").count(), 2, "{messages}");
    assert_eq!((proxy.requested(), cached(&sandbox, "worker").len()), (2, 2));

    let here = sandbox.path("here");
    stdout(&run(&["run", &sandbox.file("s.json", &document), "-o", &here.display().to_string()]));
    let here: Value = serde_json::from_slice(&std::fs::read(here.join("result.json")).unwrap()).unwrap();
    let there = sandbox.roost(&["results", &job.id.to_string(), "--format", "json"]);
    let there: Value = serde_json::from_str(&stdout(&there)).unwrap();
    assert_eq!(physics(&there), physics(&here));
    assert_eq!(there["scenario"]["product"]["mesh"]["digest"].as_str().unwrap().len(), 64);

    // Another job with the same meshes transfers no file.
    document["seed"] = json!(2);
    let (job, messages) = submit(&sandbox, &document, &["--wait"]);
    assert_eq!(job.state, JobState::Succeeded);
    assert!(!job.from_cache && !messages.contains("uploaded"), "{messages}");
    assert_eq!(proxy.requested(), 2);

    // A damaged file of the worker is fetched again.
    let damaged = sandbox.path("worker").join("meshes").join(&cached(&sandbox, "worker")[0]);
    std::fs::write(&damaged, "damaged").unwrap();
    document["seed"] = json!(3);
    let (job, _) = submit(&sandbox, &document, &["--wait"]);
    assert_eq!((job.state, job.attempt, proxy.requested()), (JobState::Succeeded, 1, 3));
    assert!(std::fs::metadata(&damaged).unwrap().len() > 100);
}

#[test]
fn mesh_levels_are_fetched_once_for_many_jobs() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let proxy = Proxy::to(&sandbox.address);
    // Two files with the same name.
    write(&sandbox, "short/part.stl", &block_file(100.0));
    write(&sandbox, "long/part.stl", &block_file(140.0));
    let base = scenario_with_files(&sandbox);
    let sweep = json!({
        "name": "lengths", "base": base, "design": {"kind": "grid"}, "replicates": 4,
        "factors": [{"pointer": "/product/mesh", "levels": [file("short/part.stl"), file("long/part.stl")]},
                    {"pointer": "/equipment/surfaces/0/mesh", "levels": [file("parts/wall.stl")]}],
    });
    let path = sandbox.file("sweep.json", &sweep);
    let text = stdout(&run(&["validate", &path]));
    for part in [
        "8 jobs",
        "mesh short/part.stl: 4800 triangles, 0.1 × 0.06 × 0.03 m, closed\n",
        "long/part.stl",
        "0 × 0.2 × 0.3 m, 4 open edges; it lies from x = 0.4 to 0.4, y = 0 to 0.2, z = 0 to 0.3 m\n",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let output = sandbox.roost(&["submit", "--json", &path]);
    let sweep: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let _worker = sandbox.start_worker_at(&proxy.address, "worker", "8");
    let id = sweep["id"].as_str().unwrap();
    let trials = wait_until("the sweep has ended", || {
        let results: Value =
            serde_json::from_str(&stdout(&sandbox.roost(&["results", id, "--format", "json"]))).unwrap();
        // A job that delivers its result still runs, though its fraction is 1.
        let trials = results["trials"].clone();
        let has_ended = |trial: &Value| !["queued", "running"].map(Value::from).contains(&trial["state"]);
        trials.as_array().unwrap().iter().all(has_ended).then_some(trials)
    });
    let trials = trials.as_array().unwrap();
    assert!(trials.iter().all(|trial| trial["state"] == "succeeded"), "{trials:?}");
    let filled = |trial: &Value| trial["responses"]["filled_kg"].as_f64().unwrap();
    assert!(filled(&trials[7]) > 1.1 * filled(&trials[0]), "the lengths differ");
    assert_eq!(proxy.requested(), 3, "two products and a wall; the product of the base alone runs nowhere");
}

#[test]
fn worker_killed_during_a_fetch_loses_no_job() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server_with_short_leases();
    let proxy = Proxy::to(&sandbox.address);
    proxy.set(Files::Stall);
    let first = sandbox.start_worker_at(&proxy.address, "worker", "1");
    let (job, _) = submit(&sandbox, &scenario_with_files(&sandbox), &[]);
    wait_until("the file is on its way", || (proxy.stalled() == 1).then_some(()));
    first.kill();
    assert_eq!(cached(&sandbox, "worker"), [""; 0], "a file is whole or not there");
    proxy.set(Files::Pass);
    let second = sandbox.start_worker_at(&proxy.address, "worker", "1");
    let done = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((done.state, done.attempt), (JobState::Succeeded, 2), "{}", second.log());
    assert_eq!((proxy.requested(), cached(&sandbox, "worker").len()), (3, 2));
}

#[test]
fn worker_stopped_during_a_fetch_returns_its_job() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let proxy = Proxy::to(&sandbox.address);
    proxy.set(Files::Stall);
    let worker = sandbox.start_worker_at(&proxy.address, "worker", "1");
    let (job, _) = submit(&sandbox, &scenario_with_files(&sandbox), &[]);
    wait_until("the file is on its way", || (proxy.stalled() == 1).then_some(()));
    worker.terminate();
    let (status, took) = worker.wait();
    assert!(status.success() && took.as_secs() < 5, "{status} after {took:?}");
    assert_eq!(sandbox.job(&job).unwrap().state, JobState::Queued);
}

#[test]
fn mesh_that_cannot_be_fetched_is_a_worker_failure() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let proxy = Proxy::to(&sandbox.address);
    proxy.set(Files::Deny);
    let _worker = sandbox.start_worker_at(&proxy.address, "worker", "1");
    let (job, _) = submit(&sandbox, &scenario_with_files(&sandbox), &[]);
    let failed = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((failed.failure_class, failed.attempt), (Some(FailureClass::Worker), 3));
    let message = failed.failure_message.unwrap();
    assert!(message.starts_with("cannot fetch mesh ") && message.ends_with("no such mesh"), "{message}");

    proxy.set(Files::Pass);
    stdout(&sandbox.roost(&["retry", &job.id.to_string()]));
    let done = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!(done.state, JobState::Succeeded);
}

#[test]
fn faulty_mesh_files_are_reported_with_all_other_faults() {
    let sandbox = Sandbox::new();
    let large = std::fs::File::create(sandbox.path("large.stl")).unwrap();
    large.set_len(64 * 1024 * 1024 + 1).unwrap();
    write(&sandbox, "folder/inside.txt", b"chicken");
    let surface = |name: &str, mesh: Value| json!({"name": name, "mesh": mesh});
    let mut bad = hopper_scenario(0.4);
    bad["product"]["mesh"] = file("nowhere.stl");
    bad["product"]["count"] = json!(-3);
    bad["equipment"]["surfaces"] = json!([
        surface("a", file("folder")),
        surface("b", file("folder/inside.txt")),
        surface("c", file("large.stl")),
        surface("d", file("folder/inside.txt/x.stl")),
        surface("e", json!({"file": 7, "units": "mm"})),
        surface("f", json!({"file": "a.stl", "digest": "0".repeat(64), "units": "mm"})),
    ]);
    let path = sandbox.file("bad.json", &bad);
    let out = sandbox.path("out").display().to_string();
    for arguments in [vec!["validate", &path], vec!["run", &path, "-o", &out]] {
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.starts_with(&format!("error: {path}: 8 faults\n")), "{text}");
        for (place, part) in [
            ("/product/mesh/file", "No such file or directory"),
            ("/product/count", "-3"),
            ("/equipment/surfaces/0/mesh/file", "Is a directory"),
            ("/equipment/surfaces/1/mesh/file", "is no STL mesh: neither"),
            ("/equipment/surfaces/2/mesh/file", "is larger than the maximum of 64.0 MiB"),
            ("/equipment/surfaces/3/mesh/file", "Not a directory"),
            ("/equipment/surfaces/4/mesh/file", "must be a text"),
            ("/equipment/surfaces/5/mesh/file", "excludes `digest`"),
        ] {
            let is_reported =
                text.lines().any(|line| line.starts_with(&format!("  {place}: ")) && line.contains(part));
            assert!(is_reported, "no `{part}` at {place} in {text}");
        }
    }
    assert!(!sandbox.path("out").exists());
    // The faults are reported before any request; there is no server.
    let output = sandbox.roost(&["submit", &path]);
    assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
    assert!(transcript(&output).contains("7 faults"), "{}", transcript(&output));
    let sweep = json!({"name": "s", "base": hopper_scenario(0.4), "design": {"kind": "grid"},
        "factors": [{"pointer": "/product/mesh", "levels": [file("a.stl"), file("b.stl")]}]});
    let output = run(&["validate", "--json", &sandbox.file("sweep.json", &sweep)]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let places: Vec<_> =
        report["errors"].as_array().unwrap().iter().map(|fault| fault["pointer"].clone()).collect();
    assert_eq!(places, ["/factors/0/levels/0/file", "/factors/0/levels/1/file"]);
}

#[test]
fn digest_without_a_file_needs_a_server() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let digest = roost_solver::mesh::digest(&block_file(120.0));
    let mut document = hopper_scenario(0.4);
    document["product"]["mesh"] = json!({"digest": digest, "units": "mm"});
    let path = sandbox.file("bare.json", &document);
    let out = sandbox.path("out").display().to_string();
    for arguments in [vec!["validate", &path], vec!["run", &path, "-o", &out]] {
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(text.lines().count(), 2, "{text}");
        assert!(text.contains("/product/mesh/digest: is the digest of a mesh at a server"), "{text}");
        assert!(text.contains("{\"file\": "), "{text}");
    }
    let output = sandbox.roost(&["submit", &path]);
    assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
    assert!(
        transcript(&output).contains("/product/mesh/digest: there is no mesh"),
        "{}",
        transcript(&output)
    );
    write(&sandbox, "block.stl", &block_file(120.0));
    let upload = async |client: roost_worker::client::Client| client.upload_mesh(block_file(120.0)).await;
    assert_eq!(sandbox.ask(upload).unwrap().digest, digest);
    stdout(&sandbox.roost(&["submit", &path]));
}

#[test]
fn mesh_paths_are_relative_to_the_document() {
    let sandbox = Sandbox::new();
    let document = scenario_with_files(&sandbox);
    let elsewhere = sandbox.path("parts");
    let report = |file: &str, here: &Path| -> Value {
        let mut child = roost()
            .args(["validate", "--json", file])
            .current_dir(here)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdin = child.stdin.take().unwrap();
        std::io::Write::write_all(&mut stdin, document.to_string().as_bytes()).unwrap();
        drop(stdin);
        let mut report: Value = serde_json::from_slice(&child.wait_with_output().unwrap().stdout).unwrap();
        // The forecast has the time of day.
        report["forecast"] = Value::Null;
        report
    };
    let path = sandbox.file("s.json", &document);
    let by_path = report(&path, &elsewhere);
    assert_eq!(by_path["valid"], true, "{by_path}");
    assert_eq!(by_path["meshes"].as_array().unwrap().len(), 2);
    assert_eq!(by_path["meshes"][1]["open_edges"], 4);
    assert_eq!(report("-", sandbox.folder.path()), by_path);
    assert_eq!(report("-", &elsewhere)["valid"], false);
}
