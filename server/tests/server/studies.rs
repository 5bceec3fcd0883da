//! Studies: from the question to the answer, with a worker that draws its results from a known truth.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use super::test_server::*;

/// Pointer of the factor.
pub(super) const GATE: &str = "/equipment/gate_opening_m";

/// A change of a valid question.
type Change<'a> = &'a dyn Fn(&mut Value);

/// The probability of a jam at a gate opening, in metres.
pub(super) fn jam_probability(gate_m: f64) -> f64 {
    1.0 / (1.0 + ((gate_m - 0.055) / 0.004).exp())
}

/// The gate opening at which the probability of a jam is ½, in metres.
pub(super) const TRUE_GATE_M: f64 = 0.055;

pub(super) fn question(max_runs: u32) -> Value {
    json!({"name": "smallest gate", "base": scenario(1),
           "factors": [{"pointer": GATE, "low": 0.03, "high": 0.09}],
           "goal": {"boundary": {"of": {"probability": "jammed"}, "level": 0.5, "misclassified": 0.05}},
           "budget": {"max_runs": max_runs}})
}

/// A question that its rule cannot end in a few runs, whatever they give.
pub(super) fn hard_question(max_runs: u32) -> Value {
    let mut question = question(max_runs);
    question["goal"]["boundary"]["misclassified"] = json!(0.001);
    question
}

pub(super) async fn submit(server: &TestServer, question: &Value) -> String {
    let study = server.post("/v1/studies", question).await.expect(StatusCode::CREATED);
    text(&study["id"]).to_owned()
}

pub(super) async fn show(server: &TestServer, id: &str) -> Value {
    server.get(&format!("/v1/studies/{id}")).await.expect(StatusCode::OK)
}

async fn ask(server: &TestServer, id: &str, verb: &str) -> Value {
    server.post(&format!("/v1/studies/{id}/{verb}"), &json!({})).await.expect(StatusCode::OK)
}

/// Delivers a result for an attempt, drawn from the truth with the seed of the scenario.
pub(super) async fn deliver(worker: &Worker<'_>, attempt: &Value) {
    let scenario = &attempt["scenario"];
    let gate_m = scenario.pointer(GATE).and_then(Value::as_f64).unwrap();
    let mut result = result_of(scenario);
    let draw = fastrand::Rng::with_seed(result.scenario.seed).f64();
    result.responses.insert("jammed".to_owned(), json!(u8::from(draw < jam_probability(gate_m))));
    worker.deliver_result(attempt, &result).await.expect(StatusCode::OK);
}

/// Runs the jobs of a study until it is not `running` any more, or `enough` results are there.
pub(super) async fn work(server: &TestServer, id: &str, enough: usize) -> Value {
    let worker = server.worker("cpu").await;
    let deadline = Instant::now() + Duration::from_secs(120);
    let mut delivered = 0;
    loop {
        for attempt in worker.claim(4).await {
            deliver(&worker, &attempt).await;
            delivered += 1;
        }
        let study = show(server, id).await;
        if study["state"] != "running" || delivered >= enough {
            return study;
        }
        assert!(Instant::now() < deadline, "{study}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Waits until a finished study has no runs to make: the rest is cancelled soon after the last decision.
pub(super) async fn wait_until_idle(server: &TestServer, id: &str) {
    let deadline = Instant::now() + Duration::from_secs(60);
    while show(server, id).await["runs"]["pending"] != 0 {
        assert!(Instant::now() < deadline, "{}", show(server, id).await);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Every trial of a study's sweep, in small pages.
pub(super) async fn trials(server: &TestServer, id: &str) -> Vec<Value> {
    let (mut trials, mut next) = (Vec::new(), String::new());
    loop {
        let path = format!("/v1/sweeps/{id}/results?limit=7{next}");
        let page = server.get(&path).await.expect(StatusCode::OK);
        trials.extend(page["trials"].as_array().unwrap().iter().cloned());
        match page["next_cursor"].as_str() {
            Some(cursor) => next = format!("&cursor={cursor}"),
            None => return trials,
        }
    }
}

/// Checks that no run was proposed twice, and that all have different seeds.
pub(super) async fn check_runs(server: &TestServer, id: &str) {
    let trials = trials(server, id).await;
    let jobs = server.get(&format!("/v1/sweeps/{id}")).await.body["counts"].as_object().unwrap().clone();
    assert_eq!(trials.len() as u64, jobs.values().filter_map(Value::as_u64).sum::<u64>());
    let csv = server.get(&format!("/v1/sweeps/{id}/results?format=csv")).await.text;
    assert_eq!(csv.lines().count(), trials.len() + 1);
    let of = |names: [&str; 2]| -> BTreeSet<String> {
        trials
            .iter()
            .map(|trial| format!("{} {}", trial.pointer(names[0]).unwrap(), trial.pointer(names[1]).unwrap()))
            .collect()
    };
    assert_eq!(of(["/factors/~1equipment~1gate_opening_m", "/replicate"]).len(), trials.len());
    assert_eq!(of(["/seed", "/seed"]).len(), trials.len());
}

#[tokio::test]
async fn a_boundary_is_found_and_stated() {
    let (server, _dir) = TestServer::start().await;
    let id = submit(&server, &question(400)).await;
    let study = work(&server, &id, usize::MAX).await;
    assert_eq!((&study["state"], &study["finished"]), (&json!("finished"), &json!("by_rule")), "{study}");
    let answer = server.get(&format!("/v1/studies/{id}/answer")).await.expect(StatusCode::OK);
    let crossings = answer["answer"]["finding"]["boundary"]["crossings"].as_array().unwrap();
    let certain =
        crossings.iter().find(|crossing| crossing["is_certain"] == true).expect("a certain crossing");
    let (low, high) = (certain["low"].as_f64().unwrap(), certain["high"].as_f64().unwrap());
    assert!(low < TRUE_GATE_M && TRUE_GATE_M < high && high - low < 0.03, "{low} to {high}");
    let sentences = study["answer"].as_array().unwrap();
    let is_stated = |part: &str| sentences.iter().any(|sentence| text(sentence).contains(part));
    for part in ["gate opening", "as certain as asked", "8 mm radius", "95 % confidence"] {
        assert!(is_stated(part), "{part}: {sentences:?}");
    }
    check_runs(&server, &id).await;
    // Runs that nobody needs any more do not stay in the queue.
    wait_until_idle(&server, &id).await;
    assert_eq!(server.worker("cpu").await.claim(10).await, [Value::Null; 0]);
    server.stop().await;
}

#[tokio::test]
async fn restarted_server_continues_a_study() {
    let dir = tempfile::tempdir().unwrap();
    let mut server = TestServer::on(dir.path(), |_| {}).await;
    let id = submit(&server, &question(400)).await;
    let mut done = 0;
    for _ in 0..3 {
        let study = work(&server, &id, 8).await;
        assert!(study["runs"]["done"].as_u64().unwrap() > done || study["state"] == "finished", "{study}");
        done = study["runs"]["done"].as_u64().unwrap();
        server.stop().await;
        server = TestServer::on(dir.path(), |_| {}).await;
    }
    let study = work(&server, &id, usize::MAX).await;
    assert_eq!(study["finished"], "by_rule", "{study}");
    check_runs(&server, &id).await;
    server.stop().await;
}

#[tokio::test]
async fn study_ends_at_its_budget_and_continues_with_a_larger_one() {
    let (server, _dir) = TestServer::start().await;
    let id = submit(&server, &hard_question(12)).await;
    let study = work(&server, &id, usize::MAX).await;
    assert_eq!((&study["finished"], &study["runs"]["done"]), (&json!("by_budget"), &json!(12)), "{study}");
    let budget = format!("/v1/studies/{id}/budget");
    let problem = server.post(&budget, &json!({"max_runs": 5})).await.problem(422, "invalid-document");
    assert_eq!(problem["errors"][0]["pointer"], "/max_runs");
    let more = server.post(&budget, &json!({"max_runs": 20})).await.expect(StatusCode::OK);
    assert_eq!((&more["state"], &more["runs"]["max_runs"]), (&json!("running"), &json!(20)));
    let study = work(&server, &id, usize::MAX).await;
    assert_eq!(study["runs"]["done"], 20, "{study}");
    check_runs(&server, &id).await;
    server.stop().await;
}

#[tokio::test]
async fn a_paused_study_proposes_and_runs_nothing_and_a_cancelled_one_ends() {
    let (server, _dir) = TestServer::start().await;
    let id = submit(&server, &hard_question(400)).await;
    work(&server, &id, 8).await;
    let paused = ask(&server, &id, "pause").await;
    assert_eq!(paused["state"], "paused");
    let worker = server.worker("cpu").await;
    tokio::time::sleep(Duration::from_millis(600)).await;
    let before = trials(&server, &id).await.len();
    tokio::time::sleep(Duration::from_millis(600)).await;
    assert_eq!(worker.claim(10).await, [Value::Null; 0]);
    assert_eq!(trials(&server, &id).await.len(), before);
    assert_eq!(ask(&server, &id, "resume").await["state"], "running");
    work(&server, &id, 8).await;

    // Neither an extension nor a deletion takes the sweep from its study.
    server
        .post(&format!("/v1/sweeps/{id}/extend"), &json!({"replicates": 1}))
        .await
        .problem(409, "wrong-state");
    server.send(Method::DELETE, &format!("/v1/sweeps/{id}"), None).await.problem(409, "wrong-state");
    // A pause of the sweep is one of the study.
    let sweep = async |verb: &str| {
        server.post(&format!("/v1/sweeps/{id}/{verb}"), &json!({})).await.expect(StatusCode::OK)
    };
    sweep("pause").await;
    assert_eq!(show(&server, &id).await["state"], "paused");
    sweep("resume").await;
    assert_eq!(show(&server, &id).await["state"], "running");
    let cancelled = ask(&server, &id, "cancel").await;
    assert_eq!(cancelled["state"], "cancelled");
    assert_eq!(
        cancelled["answer"].as_array().unwrap().last(),
        Some(&json!("A user has cancelled the study."))
    );
    server.post(&format!("/v1/studies/{id}/pause"), &json!({})).await.problem(409, "wrong-state");
    server
        .post(&format!("/v1/studies/{id}/budget"), &json!({"max_runs": 500}))
        .await
        .problem(409, "wrong-state");
    server.send(Method::DELETE, &format!("/v1/sweeps/{id}"), None).await.expect(StatusCode::OK);
    server.get(&format!("/v1/studies/{id}")).await.problem(404, "not-found");
    server.stop().await;
}

#[tokio::test]
async fn a_retry_of_cancelled_jobs_continues_the_study() {
    let (server, _dir) = TestServer::start().await;
    let id = submit(&server, &hard_question(14)).await;
    let deadline = Instant::now() + Duration::from_secs(20);
    work(&server, &id, 4).await;
    while show(&server, &id).await["runs"]["pending"] == 0 {
        assert!(Instant::now() < deadline, "no further runs");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    ask(&server, &id, "cancel").await;
    let before = trials(&server, &id).await;
    assert!(before.iter().any(|trial| trial["state"] == "cancelled"));
    server.post(&format!("/v1/sweeps/{id}/retry"), &json!({})).await.expect(StatusCode::OK);
    assert_eq!(show(&server, &id).await["state"], "running");
    let study = work(&server, &id, usize::MAX).await;
    assert_eq!((&study["finished"], &study["runs"]["done"]), (&json!("by_budget"), &json!(14)), "{study}");
    check_runs(&server, &id).await;
    server.stop().await;
}

#[tokio::test]
async fn an_unchanged_study_is_not_sent_again() {
    let (server, _dir) = TestServer::start().await;
    let id = submit(&server, &question(400)).await;
    ask(&server, &id, "pause").await;
    for path in [format!("/v1/studies/{id}"), "/v1/studies".to_owned()] {
        let url = format!("http://{}{path}", server.address);
        let first = server.http.get(&url).send().await.unwrap();
        let etag = first.headers()["etag"].clone();
        let again = async || {
            server.http.get(&url).header("if-none-match", etag.clone()).send().await.unwrap().status()
        };
        assert_eq!(again().await, StatusCode::NOT_MODIFIED, "{path}");
    }
    let url = format!("http://{}/v1/studies/{id}", server.address);
    let etag = server.http.get(&url).send().await.unwrap().headers()["etag"].clone();
    ask(&server, &id, "resume").await;
    let changed = server.http.get(&url).header("if-none-match", etag).send().await.unwrap();
    assert_eq!(changed.status(), StatusCode::OK);
    server.stop().await;
}

#[tokio::test]
async fn points_whose_runs_fail_are_left_out_and_named() {
    let (server, _dir) = TestServer::start().await;
    let mut question = question(400);
    question["goal"] = json!({"estimate": {"points": [[0.04], [0.08]],
        "intervals": [{"of": {"probability": "jammed"}, "width": 0.5}]}});
    let id = submit(&server, &question).await;
    let worker = server.worker("cpu").await;
    let deadline = Instant::now() + Duration::from_secs(60);
    let study = loop {
        for attempt in worker.claim(4).await {
            if attempt["scenario"].pointer(GATE).and_then(Value::as_f64) == Some(0.08) {
                worker.fail(&attempt, "invalid", None).await.expect(StatusCode::OK);
            } else {
                deliver(&worker, &attempt).await;
            }
        }
        let study = show(&server, &id).await;
        if study["state"] == "finished" {
            break study;
        }
        assert!(Instant::now() < deadline, "{study}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    assert_eq!(study["finished"], "by_rule", "{study}");
    let sentences = study["answer"].to_string();
    assert!(
        sentences.contains("Left out because their runs fail or lack responses: gate opening 0.08 m"),
        "{sentences}"
    );
    server.stop().await;
}

#[tokio::test]
async fn a_study_with_faults_is_refused_with_all_of_them() {
    let (server, _dir) = TestServer::start().await;
    let refused = async |change: &dyn Fn(&mut Value)| -> Vec<String> {
        let mut question = question(400);
        change(&mut question);
        let problem = server.post("/v1/studies", &question).await.problem(422, "invalid-document");
        let errors = problem["errors"].as_array().unwrap();
        errors.iter().map(|error| text(&error["pointer"]).to_owned()).collect()
    };
    let cases: [(Change, &[&str]); 9] = [
        (
            &|q| q["goal"]["boundary"]["of"] = json!({"probability": "stuck"}),
            &["/goal/boundary/of/probability"],
        ),
        (
            &|q| q["goal"]["boundary"]["of"] = json!({"probability": "discharged_kg"}),
            &["/goal/boundary/of/probability"],
        ),
        (&|q| q["goal"]["boundary"]["level"] = json!(1.5), &["/goal/boundary/level"]),
        (&|q| q["goal"] = json!({"win": {}}), &["/goal"]),
        (&|q| q["factors"][0]["high"] = json!(-1.0), &["/factors/0/high", "/factors/0/high"]),
        (&|q| q["factors"][0]["high"] = json!(50.0), &["/factors/0/high"]),
        (
            &|q| q["factors"][0] = json!({"pointer": "/contact/condition", "low": 0, "high": 1}),
            &["/factors/0/pointer"],
        ),
        (&|q| q["budget"]["max_runs"] = json!(0), &["/budget/max_runs"]),
        (&|q| q["base"]["product"]["count"] = json!(-3), &["/base/product/count"]),
    ];
    for (change, expected) in cases {
        let found = refused(change).await;
        assert!(
            expected.iter().all(|pointer| found.iter().any(|other| other == pointer)),
            "{expected:?}: {found:?}"
        );
    }
    let both: &dyn Fn(&mut Value) = &|q| {
        q["goal"]["boundary"]["level"] = json!(1.5);
        q["base"]["product"]["count"] = json!(-3);
    };
    assert_eq!(refused(both).await, ["/goal/boundary/level", "/base/product/count"]);
    assert_eq!(server.get("/v1/studies").await.expect(StatusCode::OK)["items"], json!([]));
    server.stop().await;
}

#[tokio::test]
async fn a_repeated_submission_makes_one_study() {
    let (server, _dir) = TestServer::start().await;
    let url = format!("http://{}/v1/studies", server.address);
    let mut ids = BTreeSet::new();
    for _ in 0..2 {
        let request = server.http.post(&url).header("idempotency-key", "once").json(&question(40));
        let study: Value = request.send().await.unwrap().json().await.unwrap();
        ids.insert(text(&study["id"]).to_owned());
    }
    assert_eq!(ids.len(), 1);
    let listed = server.get("/v1/studies").await.expect(StatusCode::OK);
    assert_eq!(listed["items"].as_array().unwrap().len(), 1);
    server.stop().await;
}
