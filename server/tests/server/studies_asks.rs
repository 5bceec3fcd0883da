//! Ask and tell: clients run the proposals of a study, or propose runs themselves.

use std::collections::BTreeSet;
use std::process::Command;
use std::time::{Duration, Instant};

use reqwest::StatusCode;
use serde_json::{Value, json};

use super::studies::*;
use super::test_server::*;

/// A study whose proposals become no jobs by themselves.
pub(super) async fn driven(server: &TestServer, max_runs: u32) -> String {
    let mut question = question(max_runs);
    question["driver"] = json!("client");
    submit(server, &question).await
}

pub(super) async fn ask(server: &TestServer, id: &str, document: Value) -> TestResponse {
    server.post(&format!("/v1/studies/{id}/ask"), &document).await
}

pub(super) async fn hand_out(server: &TestServer, id: &str, count: u32) -> Vec<Value> {
    let asked = ask(server, id, json!({"count": count})).await.expect(StatusCode::OK);
    asked["runs"].as_array().unwrap().clone()
}

pub(super) async fn tell(server: &TestServer, id: &str, outcomes: &[Value]) -> TestResponse {
    server.post(&format!("/v1/studies/{id}/tell"), &json!({"outcomes": outcomes})).await
}

/// The outcome of a run that was handed out, drawn from the truth.
pub(super) fn outcome(run: &Value) -> Value {
    let gate_m = run["values"][GATE].as_f64().unwrap();
    let draw = fastrand::Rng::with_seed(run["seed"].as_u64().unwrap()).f64();
    json!({"run": run["run"], "responses": {"jammed": draw < jam_probability(gate_m)}})
}

pub(super) fn place(run: &Value) -> (String, u64) {
    (run["values"].to_string(), run["replicate"].as_u64().unwrap())
}

/// Waits until the answer rests on some runs.
pub(super) async fn wait_for_runs(server: &TestServer, id: &str, done: u64) -> Value {
    let deadline = Instant::now() + Duration::from_secs(30);
    loop {
        let answer = server.get(&format!("/v1/studies/{id}/answer")).await.expect(StatusCode::OK);
        if answer["answer"]["runs"]["done"] == done {
            return answer;
        }
        assert!(Instant::now() < deadline, "{done} runs: {answer}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_example_finds_a_known_boundary() {
    let (server, _dir) = TestServer::start().await;
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/examples/studies/ask-tell.py");
    let url = format!("http://{}", server.address);
    let run = move || Command::new("python3").args([script, &url]).output().expect("python3 is installed");
    let output = tokio::task::spawn_blocking(run).await.unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(said.contains("The study ended because the answer is as certain as asked."), "{said}");
    let study = server.get("/v1/studies").await.expect(StatusCode::OK)["items"][0].clone();
    let answer =
        server.get(&format!("/v1/studies/{}/answer", text(&study["id"]))).await.expect(StatusCode::OK);
    let crossings = answer["answer"]["finding"]["boundary"]["crossings"].as_array().unwrap();
    let certain = crossings.iter().find(|crossing| crossing["is_certain"] == true).expect("a crossing");
    let (low, high) = (certain["low"].as_f64().unwrap(), certain["high"].as_f64().unwrap());
    assert!(low < TRUE_GATE_M && TRUE_GATE_M < high && high - low < 0.03, "{low} to {high}");
    // No job was made.
    assert_eq!(trials(&server, text(&study["id"])).await, [Value::Null; 0]);
    server.stop().await;
}

#[tokio::test]
async fn handed_out_runs_are_pending_over_a_restart_and_never_proposed_twice() {
    let dir = tempfile::tempdir().unwrap();
    let mut server = TestServer::on(dir.path(), |_| {}).await;
    // Both the farm and a client run the proposals.
    let id = submit(&server, &hard_question(60)).await;
    let first = hand_out(&server, &id, 6).await;
    assert_eq!(first.len(), 6);
    server.stop().await;
    server = TestServer::on(dir.path(), |_| {}).await;
    let study = show(&server, &id).await;
    assert_eq!(study["runs"]["pending"], 6 + trials(&server, &id).await.len(), "{study}");
    let listed = server.get(&format!("/v1/studies/{id}/ask")).await.expect(StatusCode::OK);
    assert_eq!(listed["runs"].as_array().unwrap(), &first);
    let second = hand_out(&server, &id, 6).await;
    let jobs = trials(&server, &id).await;
    let job_place = |trial: &Value| (trial["factors"].to_string(), trial["replicate"].as_u64().unwrap());
    let places: BTreeSet<_> =
        first.iter().chain(&second).map(place).chain(jobs.iter().map(job_place)).collect();
    assert_eq!(places.len(), first.len() + second.len() + jobs.len(), "nothing is proposed twice");
    for run in first.iter().chain(&second) {
        assert_eq!(run["scenario"]["seed"], run["seed"]);
        assert_eq!(run["scenario"].pointer(GATE), Some(&run["values"][GATE]));
    }
    let told: Vec<Value> = first.iter().chain(&second).map(outcome).collect();
    let reply = tell(&server, &id, &told).await.expect(StatusCode::OK);
    assert_eq!((&reply["recorded"], &reply["repeated"]), (&json!(12), &json!(0)));
    let study = work(&server, &id, usize::MAX).await;
    assert_eq!(study["state"], "finished", "{study}");
    assert!(study["runs"]["done"].as_u64().unwrap() <= 60, "handed-out runs belong to the budget");
    let answer = wait_for_runs(&server, &id, study["runs"]["done"].as_u64().unwrap()).await;
    assert_eq!(answer["study"]["runs"]["pending"], 0);
    server.stop().await;
}

#[tokio::test]
async fn repeated_outcomes_are_recorded_once() {
    let (server, _dir) = TestServer::start().await;
    let id = driven(&server, 60).await;
    let runs = hand_out(&server, &id, 4).await;
    let told: Vec<Value> = runs.iter().map(outcome).collect();
    tell(&server, &id, &told[..3]).await.expect(StatusCode::OK);
    // A repeat is accepted beside a new outcome.
    let reply = tell(&server, &id, &told).await.expect(StatusCode::OK);
    assert_eq!((&reply["recorded"], &reply["repeated"]), (&json!(1), &json!(3)));
    // true and 1 are the same response.
    let jammed = told[0]["responses"]["jammed"].as_bool().unwrap();
    let number = json!({"run": runs[0]["run"], "responses": {"jammed": u8::from(jammed)}});
    assert_eq!(tell(&server, &id, &[number]).await.expect(StatusCode::OK)["repeated"], 1);
    let other = json!({"run": runs[0]["run"], "responses": {"jammed": !jammed}});
    let failed = json!({"run": runs[1]["run"], "failed": true});
    let problem = tell(&server, &id, &[other, told[2].clone(), failed]).await.problem(409, "wrong-state");
    let pointers: Vec<&str> =
        problem["errors"].as_array().unwrap().iter().map(|error| text(&error["pointer"])).collect();
    assert_eq!(pointers, ["/outcomes/0", "/outcomes/2"]);
    let answer = wait_for_runs(&server, &id, 4).await;
    assert_eq!(
        (&answer["answer"]["runs"]["pending"], &answer["study"]["runs"]["done"]),
        (&json!(0), &json!(4))
    );
    server.stop().await;
}

#[tokio::test]
async fn runs_can_be_given_back_and_expire() {
    let (server, _dir) = TestServer::start().await;
    let id = driven(&server, 60).await;
    let first = hand_out(&server, &id, 2).await;
    let back = json!({"run": first[0]["run"], "given_back": true});
    let reply = tell(&server, &id, std::slice::from_ref(&back)).await.expect(StatusCode::OK);
    assert_eq!(reply["study"]["runs"]["pending"], 1);
    assert_eq!(tell(&server, &id, &[back]).await.expect(StatusCode::OK)["repeated"], 1);
    // The same run comes again, with its seed.
    let again = hand_out(&server, &id, 1).await;
    assert_eq!((place(&again[0]), &again[0]["seed"]), (place(&first[0]), &first[0]["seed"]));
    assert_ne!(again[0]["run"], first[0]["run"]);
    tell(&server, &id, &[outcome(&again[0])]).await.expect(StatusCode::OK);
    // A late outcome of the run that was given back is the same run, and counts once.
    tell(&server, &id, &[outcome(&first[0]), outcome(&first[1])]).await.expect(StatusCode::OK);
    wait_for_runs(&server, &id, 2).await;

    let short = ask(&server, &id, json!({"count": 1, "expires_s": 1})).await.expect(StatusCode::OK);
    let short = short["runs"][0].clone();
    let deadline = Instant::now() + Duration::from_secs(20);
    while show(&server, &id).await["runs"]["pending"] != 0 {
        assert!(Instant::now() < deadline, "the run has expired");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let next = hand_out(&server, &id, 1).await;
    assert_eq!((place(&next[0]), &next[0]["seed"]), (place(&short), &short["seed"]));
    server.stop().await;
}

#[tokio::test]
async fn client_requests_jobs_and_reports_its_own_runs() {
    let (server, _dir) = TestServer::start().await;
    let id = driven(&server, 20).await;
    tokio::time::sleep(Duration::from_millis(500)).await;
    assert_eq!(trials(&server, &id).await, [Value::Null; 0], "the study proposes no job by itself");
    let points = json!([{"values": {GATE: 0.05}, "replicates": 3}, {"values": {GATE: 0.06}}]);
    let asked = ask(&server, &id, json!({"points": points})).await.expect(StatusCode::OK);
    assert_eq!((asked["jobs"].as_array().unwrap().len(), &asked["runs"]), (4, &json!([])));
    let more = ask(&server, &id, json!({"points": points})).await.expect(StatusCode::OK);
    assert_eq!(more["jobs"].as_array().unwrap().len(), 4);
    work(&server, &id, 8).await;
    check_runs(&server, &id).await;
    let jobs = trials(&server, &id).await;
    let at = |gate_m: f64| jobs.iter().filter(|trial| trial["factors"][GATE] == gate_m).count();
    assert_eq!((jobs.len(), at(0.05), at(0.06)), (8, 6, 2));
    wait_for_runs(&server, &id, 8).await;

    let own =
        |gate_m: f64, seed: u64| json!({"values": {GATE: gate_m}, "seed": seed, "responses": {"jammed": 1}});
    let told = [own(0.04, 1), own(0.04, 2), own(0.05, 1)];
    assert_eq!(tell(&server, &id, &told).await.expect(StatusCode::OK)["recorded"], 3);
    assert_eq!(tell(&server, &id, &told).await.expect(StatusCode::OK)["repeated"], 3);
    let mut other = own(0.04, 1);
    other["responses"]["jammed"] = json!(0);
    tell(&server, &id, &[other]).await.problem(409, "wrong-state");
    let answer = wait_for_runs(&server, &id, 11).await;
    let runs = &answer["study"]["runs"];
    assert_eq!((&runs["done"], &runs["outside_budget"]), (&json!(8), &json!(3)));
    let sentences = answer["study"]["answer"].to_string();
    assert!(
        sentences.contains("It uses 3 runs at points of clients, which its budget does not count."),
        "{sentences}"
    );
    assert!(sentences.contains("when a client asks it for runs"), "{sentences}");
    // 12 runs of the budget are left.
    let many = ask(&server, &id, json!({"points": [{"values": {GATE: 0.05}, "replicates": 13}]})).await;
    assert_eq!(many.problem(422, "invalid-document")["errors"][0]["pointer"], "/points");
    let mut handed_out = 0;
    loop {
        match hand_out(&server, &id, 30).await.len() {
            0 => break,
            runs => handed_out += runs,
        }
    }
    assert_eq!(handed_out, 12);
    server.stop().await;
}

#[tokio::test]
async fn cancelled_client_study_continues_by_the_retry_named_in_its_refusals() {
    let (server, _dir) = TestServer::start().await;
    let id = driven(&server, 60).await;
    let runs = hand_out(&server, &id, 2).await;
    server.post(&format!("/v1/studies/{id}/cancel"), &json!({})).await.expect(StatusCode::OK);
    let told: Vec<Value> = runs.iter().map(outcome).collect();
    let retry = format!("/v1/sweeps/{id}/retry");
    for refused in [
        ask(&server, &id, json!({"count": 1})).await,
        tell(&server, &id, &told).await,
        server.post(&format!("/v1/studies/{id}/resume"), &json!({})).await,
        server.post(&format!("/v1/studies/{id}/budget"), &json!({"max_runs": 70})).await,
    ] {
        let problem = refused.problem(409, "wrong-state");
        assert!(text(&problem["detail"]).contains(&format!("POST {retry}")), "{problem}");
    }
    // A retry of failures alone is none of the study.
    server.post(&format!("{retry}?class=lost"), &json!({})).await.expect(StatusCode::OK);
    assert_eq!(show(&server, &id).await["state"], "cancelled");
    server.post(&retry, &json!({})).await.expect(StatusCode::OK);
    assert_eq!(show(&server, &id).await["state"], "running");
    tell(&server, &id, &told).await.expect(StatusCode::OK);
    wait_for_runs(&server, &id, 2).await;
    assert_eq!(hand_out(&server, &id, 1).await.len(), 1);
    server.stop().await;
}

#[tokio::test]
async fn requests_with_faults_are_refused_with_all_of_them() {
    let (server, _dir) = TestServer::start().await;
    let id = driven(&server, 60).await;
    let run = hand_out(&server, &id, 1).await[0]["run"].clone();
    let gate = "/~1equipment~1gate_opening_m";
    let pointers = |answer: TestResponse| -> Vec<String> {
        let problem = answer.problem(422, "invalid-document");
        problem["errors"].as_array().unwrap().iter().map(|error| text(&error["pointer"]).to_owned()).collect()
    };
    let told = [
        json!({"run": 77, "responses": {"jammed": 1}}),
        json!({"run": run, "responses": {"jammed": 0.5, "discharged_kg": 3}}),
        json!({"values": {GATE: 0.5, "/equipment/belt_speed_m_s": 1}, "responses": {"jammed": 1}}),
        json!({"values": {}, "seed": 1, "responses": {}}),
        json!({"responses": {"jammed": 1}}),
        json!({"run": run, "failed": true, "given_back": true}),
        json!({"values": {GATE: 0.05}, "seed": 1, "given_back": true}),
    ];
    let found = pointers(tell(&server, &id, &told).await);
    let own = |index: usize, rest: &str| format!("/outcomes/{index}{rest}");
    let expected = [
        own(0, "/run"),
        own(1, "/responses/discharged_kg"),
        own(1, "/responses/jammed"),
        own(2, "/values/~1equipment~1belt_speed_m_s"),
        own(2, &format!("/values{gate}")),
        own(2, "/seed"),
        own(3, &format!("/values{gate}")),
        own(3, "/responses"),
        own(4, ""),
        own(5, ""),
        own(5, ""),
        own(6, ""),
    ];
    assert_eq!(found, expected);
    let asks = [
        (json!({"count": 0, "expires_s": 0}), vec!["/count", "/expires_s"]),
        (
            json!({"count": 5, "points": [{"values": {GATE: 0.05}, "replicates": 0}]}),
            vec!["/points/0/replicates", "/count"],
        ),
        (json!({"points": []}), vec!["/points"]),
        (
            json!({"points": [{"values": {GATE: 0.2}}, {"values": {"gate": 0.05}}]}),
            vec![
                "/points/0/values/~1equipment~1gate_opening_m",
                "/points/1/values/gate",
                "/points/1/values/~1equipment~1gate_opening_m",
            ],
        ),
    ];
    for (document, expected) in asks {
        let mut found = pointers(ask(&server, &id, document.clone()).await);
        let mut expected: Vec<String> = expected.into_iter().map(str::to_owned).collect();
        found.sort();
        expected.sort();
        assert_eq!(found, expected, "{document}");
    }
    // Nothing was recorded.
    assert_eq!(show(&server, &id).await["runs"]["pending"], 1);
    server.post(&format!("/v1/studies/{id}/cancel"), &json!({})).await.expect(StatusCode::OK);
    ask(&server, &id, json!({})).await.problem(409, "wrong-state");
    tell(&server, &id, &[]).await.problem(409, "wrong-state");
    server.stop().await;
}

#[tokio::test]
async fn a_repeated_request_hands_out_nothing_new() {
    let (server, _dir) = TestServer::start().await;
    let id = driven(&server, 60).await;
    let url = format!("http://{}/v1/studies/{id}/ask", server.address);
    let mut answers = Vec::new();
    for _ in 0..2 {
        let request = server.http.post(&url).header("idempotency-key", "once").json(&json!({"count": 3}));
        let asked: Value = request.send().await.unwrap().json().await.unwrap();
        answers.push(asked["runs"].clone());
    }
    assert_eq!(answers[0], answers[1]);
    assert_eq!(show(&server, &id).await["runs"]["pending"], 3);
    // Two at the same time: the second one began before the first had an answer.
    let ask = || async {
        let request = server.http.post(&url).header("idempotency-key", "both").json(&json!({"count": 2}));
        let asked: Value = request.send().await.unwrap().json().await.unwrap();
        asked["runs"].clone()
    };
    let (one, other) = tokio::join!(ask(), ask());
    assert_eq!((one.as_array().unwrap().len(), &one), (2, &other));
    assert_eq!(show(&server, &id).await["runs"]["pending"], 5);
    server.stop().await;
}
