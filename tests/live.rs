//! What can be seen of a job that a real worker runs: its series while it runs, its frames afterwards, how fast it goes.

mod support;

use std::fs::File;
use std::io::Cursor;

use roost_api::job::{JobState, JobView};
use roost_frames::web::Reader;
use serde_json::{Value, json};
use support::{Home, fraction, long, said, scenario, stdout, until};

/// A client that asks no proxy.
fn plain() -> reqwest::Client {
    reqwest::Client::builder().no_proxy().build().unwrap()
}

/// A GET, as JSON.
fn get(home: &Home, path: &str) -> Option<Value> {
    let url = format!("{}{path}", home.address);
    let answer = home.ask(|_| async move { plain().get(url).send().await });
    let response = answer.ok().filter(|response| response.status().is_success())?;
    Some(home.ask(|_| async move { response.json().await.unwrap() }))
}

fn submit(home: &Home, scenario: &Value, more: &[&str]) -> JobView {
    let file = home.file("scenario.json", scenario);
    let arguments = [&["submit", "--json", &file], more].concat();
    serde_json::from_str(&stdout(&home.roost(&arguments))).unwrap()
}

#[test]
fn the_frames_of_a_job_are_those_of_the_same_run_here() {
    let home = Home::new();
    let _server = home.serve();
    let worker = home.work("worker");
    let job = submit(&home, &scenario(0.4), &["--frame-interval", "0.1"]);
    let done = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
    let told = done.frames.unwrap_or_else(|| panic!("no frames: {}", worker.log()));
    let (file, folder) = (home.path("job.roostframes"), home.path("here"));
    let (id, name) = (job.id.to_string(), file.display().to_string());
    assert!(home.roost(&["results", &id, "--frames", &name]).status.success());

    let out = home.path("out").display().to_string();
    let frames = folder.display().to_string();
    let scenario = home.file("here.json", &scenario(0.4));
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
    assert!(run.status.success(), "{}", said(&run));
    let (there, here) =
        (std::fs::read(&file).unwrap(), std::fs::read(folder.join("run.roostframes")).unwrap());
    assert!(there == here, "the same bits make the same pictures: {} and {} bytes", there.len(), here.len());
    let reader = Reader::open(File::open(&file).unwrap()).unwrap();
    assert_eq!((reader.index().len() as u64, there.len() as u64), (told.count, told.bytes));
    assert_eq!((reader.is_complete(), told.stopped), (true, None));
    // Nothing is left at the worker.
    let left = || walk(&home.path("worker")).into_iter().filter(|name| name.contains("frames")).count();
    until("the worker has tidied up", || (left() == 0).then_some(()));
}

/// All names under a folder.
fn walk(folder: &std::path::Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        found.push(entry.path().display().to_string());
        found.extend(walk(&entry.path()));
    }
    found
}

#[test]
fn frames_that_pass_the_limit_end_with_a_reason_and_the_job_succeeds() {
    let home = Home::new();
    let _server = home.serve_with(&["--max-frames-mb", "1"]);
    let _worker = home.work("worker");
    let mut many = scenario(0.5);
    many["product"] = json!({"count": 24, "subparticle_radius_m": 0.008});
    many["numerics"]["output_interval_s"] = json!(0.002);
    let job = submit(&home, &many, &["--frame-interval", "0.002"]);
    let done = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
    assert_eq!(done.state, JobState::Succeeded);
    let frames = done.frames.expect("those that fit");
    assert!((500_000..=1_000_000).contains(&frames.bytes), "{frames:?}");
    assert!(frames.stopped.as_ref().is_some_and(|why| why.contains("limit of 1000000 bytes")), "{frames:?}");
    let url = format!("{}/v1/jobs/{}/frames", home.address, job.id);
    let bytes = home.ask(|_| async move { plain().get(url).send().await.unwrap().bytes().await.unwrap() });
    assert!(Reader::open(Cursor::new(bytes.to_vec())).unwrap().is_complete());
}

#[test]
fn a_running_jobs_series_can_be_watched_and_survive_a_restart_of_the_server() {
    let home = Home::new();
    let server = home.serve();
    let _worker = home.work("worker");
    let job = home.submit(&long(60.0));
    let path = format!("/v1/jobs/{}/series/kinetic_energy", job.id);
    let samples = || {
        get(&home, &path)
            .filter(|series| series["partial"] == true)
            .map(|series| series["values"].as_array().unwrap().len())
    };
    let first = until("there are samples", || samples().filter(|samples| *samples > 0));
    let more = until("there are more", || samples().filter(|samples| *samples > first));
    let workers = get(&home, "/v1/workers").unwrap();
    let speed = workers["items"][0]["particle_steps_per_s"].as_f64().unwrap();
    assert!(speed > 1e4, "{workers}");
    assert!(workers["items"][0]["progress"][0]["fraction"].as_f64().unwrap() > 0.0);

    server.kill();
    let _server = home.serve();
    until("all samples are there again", || samples().filter(|samples| *samples >= more));
    let told = stdout(&home.roost(&["cancel", &job.id.to_string()]));
    assert!(told.contains(&job.id.to_string()) && told.contains("cancell"), "{told}");
    assert!(!told.contains("kinetic_energy"), "progress, and not the samples: {told}");
    let cancelled = home.job_when(&job, "it is cancelled", |job| job.state == JobState::Cancelled);
    assert_eq!(cancelled.attempt, 1);
    let kept = get(&home, &path).expect("a cancelled run keeps its partial series");
    assert!(kept["values"].as_array().unwrap().len() >= more, "{kept}");
    assert_eq!((&kept["partial"], cancelled.responses.len()), (&json!(false), 0));
    assert_eq!(fraction(&cancelled), 0.0);
}
