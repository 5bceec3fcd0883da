//! Deliveries to servers with canned answers.

use std::sync::{Arc, Mutex};

use roost_api::job::AttemptOutcome;
use roost_api::lease::ResultDelivery;
use roost_solver::mesh::Meshes;
use roost_solver::{CpuOptions, Flow, Limits, Progress, check, scenario, simulate};
use serde_json::json;

use super::*;
use crate::WorkerConfig;
use crate::client::RecordedFrames;
use crate::client::tests::{answering, answering_by};
use crate::outbox::Content;

/// A small result.
fn result() -> roost_api::RunResult {
    let document = json!({
        "experiment": "hopper",
        "product": {"count": 1, "subparticle_radius_m": 0.009},
        "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
        "numerics": {"timestep_s": "auto", "duration_s": 0.05},
    });
    let scenario = scenario::from_value(&document).unwrap();
    let checked = check(&scenario, &Meshes::default(), &Limits::NONE).unwrap();
    simulate(&checked, CpuOptions { threads: 1 }, &mut |_: &Progress| Flow::Cancel)
}

/// A session with one delivery in its outbox.
async fn session_with(server: &str, content: Content) -> (Session, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let config = WorkerConfig::new(server, "worker", folder.path());
    let session = Session::open(config, &CancellationToken::new()).unwrap();
    let delivery = Delivery { job_id: roost_api::ids::JobId::new(), attempt: 2, content, frames: None };
    store(&session, delivery).await;
    (session, folder)
}

/// Delivers to a server that refuses every result; returns the reports that it accepts.
async fn reports_after_refusal(status: &'static str, content: Content) -> (Vec<String>, tempfile::TempDir) {
    let accepted = Arc::new(Mutex::new(Vec::new()));
    let reports = accepted.clone();
    let server = answering_by("application/problem+json", move |request| {
        let (head, body) = request.split_once("\r\n\r\n").unwrap();
        if head.contains("/failure http") && !body.contains("series") {
            reports.lock().unwrap().push(body.to_owned());
            return ("200 OK".to_owned(), "{}".to_owned());
        }
        let code = &status[..3];
        let problem =
            format!(r#"{{"type":"/problems/x","title":"x","status":{code},"detail":"over 8 MiB"}}"#);
        (status.to_owned(), problem)
    })
    .await;
    let (session, folder) = session_with(&server, content).await;
    assert!(deliver_waiting(&session).await.unwrap(), "the outbox is empty");
    assert!(session.outbox.waiting().unwrap().is_empty());
    let reports = accepted.lock().unwrap().clone();
    (reports, folder)
}

#[tokio::test]
async fn a_refused_result_becomes_a_failure_report() {
    let worker_id = roost_api::ids::WorkerId::new();
    for status in ["413 Payload Too Large", "400 Bad Request", "422 Unprocessable Entity"] {
        let delivery = ResultDelivery { worker_id, result: result(), filled_by: None };
        let (reports, _folder) = reports_after_refusal(status, Content::Result(delivery)).await;
        assert_eq!(reports.len(), 1, "{status}");
        assert!(reports[0].contains(r#""outcome":"worker""#), "{status}: {}", reports[0]);
        assert!(reports[0].contains("refused the result: over 8 mib"), "{status}: {}", reports[0]);
    }
}

/// Delivers three short results to a server with this status and answer to `/v1/results`. Returns the paths of its requests, the jobs and
/// the refused files.
async fn requests_for(
    together: (&'static str, impl Fn(&[String]) -> String + Clone + Send + 'static),
) -> (Vec<String>, Vec<String>, Vec<String>) {
    let requests = Arc::new(Mutex::new(Vec::new()));
    let seen = requests.clone();
    let server = answering_by("application/problem+json", move |request| {
        let (head, body) = request.split_once("\r\n\r\n").unwrap();
        let path = head.split(' ').nth(1).unwrap().to_owned();
        seen.lock().unwrap().push(path.clone());
        if path != "/v1/results" {
            return ("200 OK".to_owned(), "{}".to_owned());
        }
        let body: serde_json::Value = serde_json::from_str(body).unwrap();
        let results = body["results"].as_array().unwrap().iter();
        let answers: Vec<_> = results.map(|result| result["job_id"].as_str().unwrap().to_owned()).collect();
        (together.0.to_owned(), (together.1)(&answers))
    })
    .await;
    let folder = tempfile::tempdir().unwrap();
    let config = WorkerConfig::new(&server, "worker", folder.path());
    let session = Session::open(config, &CancellationToken::new()).unwrap();
    let mut jobs = Vec::new();
    for _ in 0..3 {
        jobs.push(add_result(&session, result()).await);
    }
    assert!(deliver_waiting(&session).await.unwrap(), "the outbox is empty");
    assert!(session.outbox.waiting().unwrap().is_empty());
    let requests = requests.lock().unwrap().clone();
    let outbox = std::fs::read_dir(folder.path().join("outbox")).unwrap().next().unwrap().unwrap().path();
    let refused = std::fs::read_dir(outbox.join("refused")).unwrap();
    let refused = refused.map(|file| file.unwrap().file_name().into_string().unwrap()).collect();
    (requests, jobs, refused)
}

/// Adds a result to the outbox, and returns its job.
async fn add_result(session: &Session, result: roost_api::RunResult) -> String {
    let worker_id = roost_api::ids::WorkerId::new();
    let content = Content::Result(ResultDelivery { worker_id, result, filled_by: None });
    let job_id = roost_api::ids::JobId::new();
    store(session, Delivery { job_id, attempt: 1, content, frames: None }).await;
    job_id.to_string()
}

#[tokio::test]
async fn short_results_go_together_and_each_has_its_answer() {
    let answer = |jobs: &[String]| {
        let problem =
            |status: u16| json!({"type": "/problems/x", "title": "x", "status": status, "detail": "no"});
        let problems = [json!(null), problem(409), problem(422)];
        let answers = jobs.iter().zip(problems).map(|(job, problem)| {
            json!({"job_id": job, "attempt": 1, "recorded": problem.is_null(), "problem": problem})
        });
        json!({"answers": answers.collect::<Vec<_>>()}).to_string()
    };
    let (requests, jobs, refused) = requests_for(("200 OK", answer)).await;
    let report = format!("/v1/jobs/{}/attempts/1/failure", jobs[2]);
    assert_eq!(requests, ["/v1/results".to_owned(), report], "the refused result is reported");
    assert_eq!(refused, [format!("{}-1.json", jobs[2])], "a person can inspect it");
}

#[tokio::test]
async fn a_file_that_cannot_be_read_holds_up_no_other() {
    let server = answering("200 OK", "application/json", "{}").await;
    let folder = tempfile::tempdir().unwrap();
    let config = WorkerConfig::new(&server, "worker", folder.path());
    let session = Session::open(config, &CancellationToken::new()).unwrap();
    let job = add_result(&session, result()).await;
    let stored = session.outbox.waiting().unwrap().remove(0);
    // A folder has no content. Its name comes first.
    let unreadable = stored.with_file_name("0-1.json");
    std::fs::create_dir(&unreadable).unwrap();
    assert!(!deliver_waiting(&session).await.unwrap(), "the outbox is not empty");
    assert_eq!(session.outbox.waiting().unwrap(), [unreadable], "{job} is delivered");
}

#[tokio::test]
async fn results_go_one_by_one_where_they_cannot_go_together() {
    let unknown = r#"{"type":"/problems/not-found","title":"x","status":404,"detail":"there is no path"}"#;
    let internal = r#"{"type":"/problems/internal","title":"x","status":500,"detail":"a bug"}"#;
    let fewer = r#"{"answers": []}"#;
    for (status, answer) in [
        ("404 Not Found", unknown),
        ("404 Not Found", "<h1>nginx</h1>"),
        ("403 Forbidden", "<h1>nginx</h1>"),
        ("500 Internal Server Error", internal),
        ("200 OK", "<h1>nginx</h1>"),
        ("200 OK", fewer),
    ] {
        let (requests, jobs, refused) = requests_for((status, |_: &[String]| answer.to_owned())).await;
        let alone = jobs.iter().map(|job| format!("/v1/jobs/{job}/attempts/1/result"));
        let expected: Vec<_> = std::iter::once("/v1/results".to_owned()).chain(alone).collect();
        assert_eq!((requests, refused.len()), (expected, 0), "{status} {answer}");
    }
}

#[tokio::test]
async fn answers_in_another_order_settle_nothing() {
    let answer = |jobs: &[String]| {
        let answers = jobs
            .iter()
            .rev()
            .map(|job| json!({"job_id": job, "attempt": 1, "recorded": true, "problem": null}));
        json!({"answers": answers.collect::<Vec<_>>()}).to_string()
    };
    let (requests, ..) = requests_for(("200 OK", answer)).await;
    assert_eq!(requests.len(), 4, "the results go one by one: {requests:?}");
}

#[tokio::test]
async fn only_short_results_go_together() {
    let folder = tempfile::tempdir().unwrap();
    let config = WorkerConfig::new("http://127.0.0.1:1", "worker", folder.path());
    let session = Session::open(config, &CancellationToken::new()).unwrap();
    let mut long = result();
    for series in &mut long.series {
        series.values = vec![0.125; 1 << 18];
    }
    for result in [result(), result()] {
        add_result(&session, result).await;
    }
    add_deliveries(&session, &[false]).await;
    for result in [result(), long.clone(), long, result(), result(), result()] {
        add_result(&session, result).await;
    }
    let mut pass = OutboxPass {
        session: &session,
        paths: session.outbox.waiting().unwrap().into(),
        uploads: frames::Pass::default(),
        is_empty: true,
        has_warned: false,
    };
    let mut sizes = Vec::new();
    while !pass.paths.is_empty() {
        sizes.push(pass.next_group().await.unwrap().len());
    }
    assert_eq!(sizes, [2, 1, 1, 1, 1, 3], "a failure report and long results go alone");
}

#[tokio::test]
async fn results_stay_in_the_outbox_while_the_server_is_unavailable() {
    let problem = r#"{"type":"/problems/unavailable","title":"x","status":503,"detail":"later"}"#;
    let requests = Arc::new(Mutex::new(Vec::new()));
    let seen = requests.clone();
    let server = answering_by("application/problem+json", move |request| {
        seen.lock().unwrap().push(request.split(' ').nth(1).unwrap().to_owned());
        ("503 Service Unavailable".to_owned(), problem.to_owned())
    })
    .await;
    let worker_id = roost_api::ids::WorkerId::new();
    let content = Content::Result(ResultDelivery { worker_id, result: result(), filled_by: None });
    let (session, _folder) = session_with(&server, content).await;
    add_result(&session, result()).await;
    assert!(!deliver_waiting(&session).await.unwrap(), "both wait");
    assert_eq!(session.outbox.waiting().unwrap().len(), 2);
    assert_eq!(*requests.lock().unwrap(), ["/v1/results"], "more requests would not help");
}

/// Adds deliveries to an outbox, with recorded frames or without.
async fn add_deliveries(session: &Session, with_frames: &[bool]) {
    for has_frames in with_frames {
        let job_id = roost_api::ids::JobId::new();
        let folder = session.outbox.frames_folder(job_id, 1);
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join(roost_frames::STREAM), "frames").unwrap();
        let frames = has_frames.then_some(RecordedFrames { count: 1, stopped: None });
        let content = Content::Failure(failure());
        store(session, Delivery { job_id, attempt: 1, content, frames }).await;
    }
}

fn failure() -> roost_api::lease::FailureReport {
    roost_api::lease::FailureReport {
        worker_id: roost_api::ids::WorkerId::new(),
        outcome: AttemptOutcome::Worker,
        message: "stopped".to_owned(),
        result: None,
    }
}

#[tokio::test]
async fn after_a_failed_upload_only_deliveries_without_frames_follow() {
    let requests = Arc::new(Mutex::new(Vec::new()));
    let seen = requests.clone();
    let server = answering_by("application/json", move |request| {
        let line = request.lines().next().unwrap().to_owned();
        let is_upload = line.starts_with("put ");
        seen.lock().unwrap().push(line);
        (if is_upload { "503 Service Unavailable" } else { "200 OK" }.to_owned(), "{}".to_owned())
    })
    .await;
    let (session, _folder) = session_with(&server, Content::Failure(failure())).await;
    add_deliveries(&session, &[true, false, true, true, false]).await;
    let mut first_uploads = std::collections::HashSet::new();
    for _ in 0..3 {
        requests.lock().unwrap().clear();
        assert!(!deliver_waiting(&session).await.unwrap(), "three deliveries wait");
        assert_eq!(session.outbox.waiting().unwrap().len(), 3);
        let uploads: Vec<_> =
            requests.lock().unwrap().iter().filter(|line| line.starts_with("put ")).cloned().collect();
        assert_eq!(uploads.len(), 1, "{uploads:?}");
        first_uploads.extend(uploads);
    }
    assert_eq!(first_uploads.len(), 3, "the uploads take turns: {first_uploads:?}");
}

#[tokio::test]
async fn a_result_waits_for_a_valid_token() {
    for (status, content_type) in [
        ("401 Unauthorized", "application/problem+json"),
        ("403 Forbidden", "application/problem+json"),
        ("401 Unauthorized", "text/html"),
    ] {
        let body = match content_type {
            "text/html" => "<h1>nginx</h1>".to_owned(),
            _ => {
                format!(r#"{{"type":"/problems/x","title":"x","status":{},"detail":"no"}}"#, &status[..3])
            }
        };
        let server = answering(status, content_type, &body).await;
        let delivery =
            ResultDelivery { worker_id: roost_api::ids::WorkerId::new(), result: result(), filled_by: None };
        let (session, _folder) = session_with(&server, Content::Result(delivery)).await;
        assert!(!deliver_waiting(&session).await.unwrap(), "{status}: it waits");
        assert_eq!(session.outbox.waiting().unwrap().len(), 1, "{status} {content_type}");
    }
}

#[tokio::test]
async fn a_refused_partial_result_keeps_the_outcome() {
    let report = roost_api::lease::FailureReport {
        worker_id: roost_api::ids::WorkerId::new(),
        outcome: AttemptOutcome::Timeout,
        message: "stopped".to_owned(),
        result: Some(result()),
    };
    let (reports, _folder) = reports_after_refusal("413 Payload Too Large", Content::Failure(report)).await;
    assert_eq!(reports.len(), 1);
    assert!(reports[0].contains(r#""outcome":"timeout""#), "{}", reports[0]);
}
