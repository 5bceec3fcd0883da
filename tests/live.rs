//! Series of a running job, and frames and speed of a finished one, with a real worker.

mod support;

use std::fs::File;
use std::io::Cursor;

use roost_api::job::{JobState, JobView};
use roost_frames::web::Reader;
use serde_json::{Value, json};
use support::{Sandbox, fraction, hopper_scenario, slow_scenario, stdout, transcript, wait_until};

/// An HTTP client without a proxy.
fn http_client() -> reqwest::Client {
    reqwest::Client::builder().no_proxy().build().unwrap()
}

/// The response to a GET as JSON.
fn get(sandbox: &Sandbox, path: &str) -> Option<Value> {
    let url = format!("{}{path}", sandbox.address);
    let answer = sandbox.ask(|_| async move { http_client().get(url).send().await });
    let response = answer.ok().filter(|response| response.status().is_success())?;
    Some(sandbox.ask(|_| async move { response.json().await.unwrap() }))
}

fn submit(sandbox: &Sandbox, scenario: &Value, more: &[&str]) -> JobView {
    let file = sandbox.file("scenario.json", scenario);
    let arguments = [&["submit", "--json", &file], more].concat();
    serde_json::from_str(&stdout(&sandbox.roost(&arguments))).unwrap()
}

#[test]
fn frames_of_a_job_equal_those_of_a_local_run() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let worker = sandbox.start_worker("worker");
    let job = submit(&sandbox, &hopper_scenario(0.4), &["--frame-interval", "0.1"]);
    let done = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
    let told = done.frames.unwrap_or_else(|| panic!("no frames: {}", worker.log()));
    let (file, folder) = (sandbox.path("job.roostframes"), sandbox.path("here"));
    let (id, name) = (job.id.to_string(), file.display().to_string());
    assert!(sandbox.roost(&["results", &id, "--frames", &name]).status.success());

    let out = sandbox.path("out").display().to_string();
    let frames = folder.display().to_string();
    let scenario = sandbox.file("here.json", &hopper_scenario(0.4));
    let run = support::run(&[
        "run",
        &scenario,
        "-o",
        &out,
        "--frames",
        &frames,
        "--frame-interval",
        "0.1",
        "--frame-format",
        "web",
    ]);
    assert!(run.status.success(), "{}", transcript(&run));
    let (there, here) =
        (std::fs::read(&file).unwrap(), std::fs::read(folder.join("run.roostframes")).unwrap());
    assert!(there == here, "the same bits make the same pictures: {} and {} bytes", there.len(), here.len());
    let reader = Reader::open(File::open(&file).unwrap()).unwrap();
    assert_eq!((reader.index().len() as u64, there.len() as u64), (told.count, told.bytes));
    assert_eq!((reader.is_complete(), told.stopped), (true, None));
    // The worker has removed its files.
    let left = || walk(&sandbox.path("worker")).into_iter().filter(|name| name.contains("frames")).count();
    wait_until("the worker has tidied up", || (left() == 0).then_some(()));
}

/// All file names in a folder, recursively.
fn walk(folder: &std::path::Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        found.push(entry.path().display().to_string());
        found.extend(walk(&entry.path()));
    }
    found
}

#[test]
fn frames_above_the_limit_stop_with_a_reason_and_the_job_succeeds() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server_with(&["--max-frames-mb", "1"]);
    let _worker = sandbox.start_worker("worker");
    let mut many = hopper_scenario(0.5);
    many["product"] = json!({"count": 24, "subparticle_radius_m": 0.008});
    many["numerics"]["output_interval_s"] = json!(0.002);
    let job = submit(&sandbox, &many, &["--frame-interval", "0.002"]);
    let done = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!(done.state, JobState::Succeeded);
    let frames = done.frames.expect("those that fit");
    assert!((500_000..=1_000_000).contains(&frames.bytes), "{frames:?}");
    assert!(frames.stopped.as_ref().is_some_and(|why| why.contains("limit of 1000000 bytes")), "{frames:?}");
    let url = format!("{}/v1/jobs/{}/frames", sandbox.address, job.id);
    let bytes =
        sandbox.ask(|_| async move { http_client().get(url).send().await.unwrap().bytes().await.unwrap() });
    assert!(Reader::open(Cursor::new(bytes.to_vec())).unwrap().is_complete());
}

#[test]
fn series_of_a_running_job_survive_a_restart_of_the_server() {
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let job = sandbox.submit(&slow_scenario(600.0));
    let path = format!("/v1/jobs/{}/series/kinetic_energy", job.id);
    let samples = || {
        get(&sandbox, &path)
            .filter(|series| series["partial"] == true)
            .map(|series| series["values"].as_array().unwrap().len())
    };
    let first = wait_until("there are samples", || samples().filter(|samples| *samples > 0));
    let more = wait_until("there are more", || samples().filter(|samples| *samples > first));
    let workers = get(&sandbox, "/v1/workers").unwrap();
    let speed = workers["items"][0]["particle_steps_per_s"].as_f64().unwrap();
    assert!(speed > 1e4, "{workers}");
    assert!(workers["items"][0]["progress"][0]["fraction"].as_f64().unwrap() > 0.0);

    server.kill();
    let _server = sandbox.start_server();
    wait_until("all samples are there again", || samples().filter(|samples| *samples >= more));
    let told = stdout(&sandbox.roost(&["cancel", &job.id.to_string()]));
    assert!(told.contains(&job.id.to_string()) && told.contains("cancell"), "{told}");
    assert!(!told.contains("kinetic_energy"), "progress, and not the samples: {told}");
    let cancelled = sandbox.wait_for_job(&job, "it is cancelled", |job| job.state == JobState::Cancelled);
    assert_eq!(cancelled.attempt, 1);
    let kept = get(&sandbox, &path).expect("a cancelled run keeps its partial series");
    assert!(kept["values"].as_array().unwrap().len() >= more, "{kept}");
    assert_eq!((&kept["partial"], cancelled.responses.len()), (&json!(false), 0));
    assert_eq!(fraction(&cancelled), 0.0);
}
