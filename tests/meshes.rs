//! Meshes on their way: from files beside a scenario through the server to the worker that runs it.

mod support;

use std::path::Path;
use std::process::Stdio;

use roost_api::job::{FailureClass, JobState, JobView};
use serde_json::{Value, json};
use support::proxy::{Files, Proxy};
use support::stl::{ascii, binary, block, wall};
use support::{Home, roost, run, said, scenario, stdout, until};

/// Long enough to be caught on its way.
fn block_file(length_mm: f32) -> Vec<u8> {
    binary(&block([length_mm, 60.0, 30.0], 20))
}

fn file(name: &str) -> Value {
    json!({"file": name, "units": "mm"})
}

fn write(home: &Home, name: &str, bytes: &[u8]) {
    let path = home.path(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// A small scenario with a product and a wall from files that are there.
fn with_files(home: &Home) -> Value {
    write(home, "parts/block.stl", &block_file(120.0));
    write(home, "parts/wall.stl", &ascii(&wall(200.0, 300.0)));
    let mut scenario = scenario(0.4);
    scenario["product"]["mesh"] = file("parts/block.stl");
    scenario["equipment"]["surfaces"] =
        json!([{"name": "wall", "mesh": file("parts/wall.stl"), "position_m": [0.4, 0, 0]}]);
    scenario
}

fn submit(home: &Home, document: &Value, arguments: &[&str]) -> (JobView, String) {
    let file = home.file("scenario.json", document);
    let output = home.roost(&[&["submit", "--json", &file], arguments].concat());
    (serde_json::from_str(&stdout(&output)).unwrap(), String::from_utf8(output.stderr).unwrap())
}

/// Files in the cache of a worker that are whole, by name.
fn cached(home: &Home, worker: &str) -> Vec<String> {
    let entries = std::fs::read_dir(home.path(worker).join("meshes")).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().into_string().unwrap());
    names.filter(|name| name.ends_with(".stl")).collect()
}

/// What a run computed, whoever did.
fn physics(result: &Value) -> Value {
    json!([result["responses"], result["series"], result["scenario_digest"]])
}

#[test]
fn files_travel_once_and_compute_what_they_compute_here() {
    let home = Home::new();
    let _server = home.serve();
    let proxy = Proxy::to(&home.address);
    let _worker = home.work_by(&proxy.address, "worker", "1");
    let mut document = with_files(&home);
    let (job, said) = submit(&home, &document, &["--wait"]);
    assert_eq!(job.state, JobState::Succeeded, "{:?}", job.failure_message);
    assert_eq!(said.matches("uploaded").count(), 2, "{said}");
    assert_eq!((proxy.asked(), cached(&home, "worker").len()), (2, 2));

    let here = home.path("here");
    stdout(&run(&["run", &home.file("s.json", &document), "-o", &here.display().to_string()]));
    let here: Value = serde_json::from_slice(&std::fs::read(here.join("result.json")).unwrap()).unwrap();
    let there = home.roost(&["results", &job.id.to_string(), "--format", "json"]);
    let there: Value = serde_json::from_str(&stdout(&there)).unwrap();
    assert_eq!(physics(&there), physics(&here));
    assert_eq!(there["scenario"]["product"]["mesh"]["digest"].as_str().unwrap().len(), 64);

    // Another job of the same meshes: nothing is sent, up or down.
    document["seed"] = json!(2);
    let (job, said) = submit(&home, &document, &["--wait"]);
    assert_eq!(job.state, JobState::Succeeded);
    assert!(!job.from_cache && !said.contains("uploaded"), "{said}");
    assert_eq!(proxy.asked(), 2);

    // A file that was damaged on the worker's disk is fetched again.
    let damaged = home.path("worker").join("meshes").join(&cached(&home, "worker")[0]);
    std::fs::write(&damaged, "damaged").unwrap();
    document["seed"] = json!(3);
    let (job, _) = submit(&home, &document, &["--wait"]);
    assert_eq!((job.state, job.attempt, proxy.asked()), (JobState::Succeeded, 1, 3));
    assert!(std::fs::metadata(&damaged).unwrap().len() > 100);
}

#[test]
fn levels_may_be_files_and_many_jobs_at_once_fetch_each_once() {
    let home = Home::new();
    let _server = home.serve();
    let proxy = Proxy::to(&home.address);
    // Two files of one name.
    write(&home, "short/part.stl", &block_file(100.0));
    write(&home, "long/part.stl", &block_file(140.0));
    let base = with_files(&home);
    let sweep = json!({
        "name": "lengths", "base": base, "design": {"kind": "grid"}, "replicates": 4,
        "factors": [{"pointer": "/product/mesh", "levels": [file("short/part.stl"), file("long/part.stl")]},
                    {"pointer": "/equipment/surfaces/0/mesh", "levels": [file("parts/wall.stl")]}],
    });
    let path = home.file("sweep.json", &sweep);
    let text = stdout(&run(&["validate", &path]));
    for part in
        ["8 jobs", "mesh short/part.stl: 4800 triangles, 0.1 × 0.06 × 0.03 m, closed", "long/part.stl"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    let output = home.roost(&["submit", "--json", &path]);
    let sweep: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let _worker = home.work_by(&proxy.address, "worker", "8");
    let id = sweep["id"].as_str().unwrap();
    let trials = until("the sweep has ended", || {
        let results: Value =
            serde_json::from_str(&stdout(&home.roost(&["results", id, "--format", "json"]))).unwrap();
        (results["sweep"]["fraction"] == 1.0).then(|| results["trials"].clone())
    });
    let trials = trials.as_array().unwrap();
    assert!(trials.iter().all(|trial| trial["state"] == "succeeded"), "{trials:?}");
    let filled = |trial: &Value| trial["responses"]["filled_kg"].as_f64().unwrap();
    assert!(filled(&trials[7]) > 1.1 * filled(&trials[0]), "the lengths differ");
    assert_eq!(proxy.asked(), 3, "two products and a wall; the product of the base alone runs nowhere");
}

#[test]
fn a_worker_killed_while_fetching_harms_nothing() {
    let home = Home::new();
    let _server = home.serve();
    let proxy = Proxy::to(&home.address);
    proxy.set(Files::Stall);
    let first = home.work_by(&proxy.address, "worker", "1");
    let (job, _) = submit(&home, &with_files(&home), &[]);
    until("the file is on its way", || (proxy.stalled() == 1).then_some(()));
    first.kill();
    assert_eq!(cached(&home, "worker"), [""; 0], "a file is whole or not there");
    proxy.set(Files::Pass);
    let second = home.work_by(&proxy.address, "worker", "1");
    let done = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((done.state, done.attempt), (JobState::Succeeded, 2), "{}", second.log());
    assert_eq!((proxy.asked(), cached(&home, "worker").len()), (3, 2));
}

#[test]
fn a_worker_that_is_stopped_while_fetching_hands_its_job_back() {
    let _undisturbed = support::undisturbed();
    let home = Home::new();
    let _server = home.serve();
    let proxy = Proxy::to(&home.address);
    proxy.set(Files::Stall);
    let worker = home.work_by(&proxy.address, "worker", "1");
    let (job, _) = submit(&home, &with_files(&home), &[]);
    until("the file is on its way", || (proxy.stalled() == 1).then_some(()));
    worker.terminate();
    let (status, took) = worker.wait();
    assert!(status.success() && took.as_secs() < 5, "{status} after {took:?}");
    assert_eq!(home.job(&job).unwrap().state, JobState::Queued);
}

#[test]
fn a_mesh_that_cannot_be_fetched_is_the_workers_failure() {
    let home = Home::new();
    let _server = home.serve();
    let proxy = Proxy::to(&home.address);
    proxy.set(Files::Deny);
    let _worker = home.work_by(&proxy.address, "worker", "1");
    let (job, _) = submit(&home, &with_files(&home), &[]);
    let failed = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!((failed.failure_class, failed.attempt), (Some(FailureClass::Worker), 3));
    let message = failed.failure_message.unwrap();
    assert!(message.starts_with("cannot fetch mesh ") && message.ends_with("no such mesh"), "{message}");

    proxy.set(Files::Pass);
    stdout(&home.roost(&["retry", &job.id.to_string()]));
    let done = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!(done.state, JobState::Succeeded);
}

#[test]
fn files_that_cannot_be_used_are_told_with_their_place_and_what_else_is_wrong() {
    let home = Home::new();
    let large = std::fs::File::create(home.path("large.stl")).unwrap();
    large.set_len(64 * 1024 * 1024 + 1).unwrap();
    write(&home, "folder/inside.txt", b"chicken");
    let surface = |name: &str, mesh: Value| json!({"name": name, "mesh": mesh});
    let mut bad = scenario(0.4);
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
    let path = home.file("bad.json", &bad);
    let out = home.path("out").display().to_string();
    for arguments in [vec!["validate", &path], vec!["run", &path, "-o", &out]] {
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.starts_with(&format!("error: {path}: 8 faults\n")), "{text}");
        for (place, part) in [
            ("/product/mesh/file", "No such file or directory"),
            ("/product/count", "-3"),
            ("/equipment/surfaces/0/mesh/file", "Is a directory"),
            ("/equipment/surfaces/1/mesh/file", "is no STL mesh: neither"),
            ("/equipment/surfaces/2/mesh/file", "is larger than 64.0 MiB"),
            ("/equipment/surfaces/3/mesh/file", "Not a directory"),
            ("/equipment/surfaces/4/mesh/file", "must be a text"),
            ("/equipment/surfaces/5/mesh/file", "excludes `digest`"),
        ] {
            let told =
                text.lines().any(|line| line.starts_with(&format!("  {place}: ")) && line.contains(part));
            assert!(told, "no `{part}` at {place} in {text}");
        }
    }
    assert!(!home.path("out").exists());
    // Before anything is sent: there is nobody.
    let output = home.roost(&["submit", &path]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("7 faults"), "{}", said(&output));
    let sweep = json!({"name": "s", "base": scenario(0.4), "design": {"kind": "grid"},
        "factors": [{"pointer": "/product/mesh", "levels": [file("a.stl"), file("b.stl")]}]});
    let output = run(&["validate", "--json", &home.file("sweep.json", &sweep)]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let places: Vec<_> =
        report["errors"].as_array().unwrap().iter().map(|fault| fault["pointer"].clone()).collect();
    assert_eq!(places, ["/factors/0/levels/0/file", "/factors/0/levels/1/file"]);
}

#[test]
fn a_digest_alone_needs_a_server() {
    let home = Home::new();
    let _server = home.serve();
    let digest = roost_solver::mesh::digest(&block_file(120.0));
    let mut document = scenario(0.4);
    document["product"]["mesh"] = json!({"digest": digest, "units": "mm"});
    let path = home.file("bare.json", &document);
    let out = home.path("out").display().to_string();
    for arguments in [vec!["validate", &path], vec!["run", &path, "-o", &out]] {
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(text.lines().count(), 2, "{text}");
        assert!(text.contains("/product/mesh/digest: names a mesh of a server"), "{text}");
        assert!(text.contains("{\"file\": "), "{text}");
    }
    let output = home.roost(&["submit", &path]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("/product/mesh/digest: there is no mesh"), "{}", said(&output));
    write(&home, "block.stl", &block_file(120.0));
    let upload = async |client: roost_worker::client::Client| client.upload_mesh(block_file(120.0)).await;
    assert_eq!(home.ask(upload).unwrap().digest, digest);
    stdout(&home.roost(&["submit", &path]));
}

#[test]
fn paths_are_seen_from_the_document_and_from_here_for_stdin() {
    let home = Home::new();
    let document = with_files(&home);
    let elsewhere = home.path("parts");
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
        serde_json::from_slice(&child.wait_with_output().unwrap().stdout).unwrap()
    };
    let path = home.file("s.json", &document);
    let by_path = report(&path, &elsewhere);
    assert_eq!(by_path["valid"], true, "{by_path}");
    assert_eq!(by_path["meshes"].as_array().unwrap().len(), 2);
    assert_eq!(by_path["meshes"][1]["open_edges"], 4);
    assert_eq!(report("-", home.folder.path()), by_path);
    assert_eq!(report("-", &elsewhere)["valid"], false);
}
