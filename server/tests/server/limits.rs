//! Limits of labels, names and priorities of submissions.

use reqwest::{Method, StatusCode};
use roost_api::ids::WorkerId;
use roost_api::time::Timestamp;
use roost_api::token::Scope;
use serde_json::{Map, Value, json};

use super::database;
use super::test_server::*;

/// This many labels.
fn labels(count: usize, value: &str) -> Value {
    (0..count).map(|index| (format!("key {index}"), json!(value))).collect::<Map<_, _>>().into()
}

fn sweep(seed: u64, labels: &Value) -> Value {
    json!({"name": "s", "base": scenario(seed), "design": {"kind": "grid"}, "factors": [], "labels": labels})
}

fn pointers(problem: &Value) -> Vec<&str> {
    problem["errors"].as_array().unwrap().iter().map(|fault| text(&fault["pointer"])).collect()
}

#[tokio::test]
async fn labels_are_limited_in_number_and_length() {
    let (server, _dir) = TestServer::start().await;
    let fits = labels(64, &"x".repeat(256));
    let (mut job, swept) = (envelope(1), sweep(2, &fits));
    job["labels"] = fits;
    assert_eq!(server.submit(&job).await["labels"], job["labels"]);
    server.post("/v1/sweeps", &swept).await.expect(StatusCode::CREATED);
    server.post("/v1/validate", &swept).await.expect(StatusCode::OK);

    // 128 characters of two bytes and one of one.
    let long = format!("{}x", "é".repeat(128));
    let mut wrong = labels(62, "x");
    wrong[&long] = json!("short");
    wrong["a/b"] = json!("y".repeat(1_000_000));
    wrong["one"] = json!("too many");
    let (mut job, swept) = (envelope(3), sweep(4, &wrong));
    job["labels"] = wrong;
    for (path, document) in
        [("/v1/jobs", &job), ("/v1/validate", &job), ("/v1/sweeps", &swept), ("/v1/validate", &swept)]
    {
        let answer = server.post(path, document).await;
        assert!(answer.text.len() < 5000, "{path}: {} bytes", answer.text.len());
        let problem = answer.problem(422, "invalid-document");
        assert_eq!(pointers(&problem), ["/labels", "/labels", "/labels/a~1b"], "{path}: {problem}");
        let errors = &problem["errors"];
        assert_eq!(errors[0]["value"], json!(65), "{problem}");
        assert_eq!(errors[0]["allowed"], json!("at most 64"), "{problem}");
        assert!(text(&errors[1]["value"]).starts_with("éé"), "{problem}");
        assert!(text(&errors[2]["value"]).contains("yyy"), "{problem}");
        for fault in &errors.as_array().unwrap()[1..] {
            assert_eq!(fault["allowed"], json!("at most 256 bytes"), "{problem}");
        }
    }
    server.stop().await;
}

#[tokio::test]
async fn names_are_limited_in_length() {
    let (server, _dir) = TestServer::start().await;
    let (fits, long) = ("x".repeat(256), "x".repeat(257));
    let named = |name: &str| {
        let mut sweep = sweep(1, &json!({}));
        sweep["name"] = json!(name);
        sweep["needs"] = json!({"backend": name});
        sweep
    };
    server.post("/v1/sweeps", &named(&fits)).await.expect(StatusCode::CREATED);
    for path in ["/v1/sweeps", "/v1/validate"] {
        let problem = server.post(path, &named(&long)).await.problem(422, "invalid-document");
        assert_eq!(pointers(&problem), ["/name", "/needs/backend"], "{problem}");
        assert_eq!(problem["errors"][0]["allowed"], json!("at most 256 bytes"));
    }
    let mut job = envelope(1);
    job["needs"] = json!({"backend": long});
    let problem = server.post("/v1/jobs", &job).await.problem(422, "invalid-document");
    assert_eq!(pointers(&problem), ["/needs/backend"]);

    let worker = |name: &str| {
        let mut worker = registration(&WorkerId::new().to_string(), name);
        (worker["name"], worker["device"]) = (json!(name), json!(name));
        worker
    };
    server.post("/v1/workers", &worker(&fits)).await.expect(StatusCode::OK);
    let problem = server.post("/v1/workers", &worker(&long)).await.problem(422, "invalid-document");
    assert_eq!(pointers(&problem), ["/name", "/backend", "/device"]);
    let workers = server.get("/v1/workers").await.expect(StatusCode::OK);
    assert_eq!(workers["items"].as_array().unwrap().len(), 1);
    server.stop().await;
}

#[tokio::test]
async fn labels_of_a_sweep_are_stored_once_and_apply_to_its_jobs() {
    let (server, dir) = TestServer::start().await;
    let long = labels(64, &"x".repeat(256));
    let mut many = sweep(1, &long);
    many["replicates"] = json!(900);
    let many = server.post("/v1/sweeps", &many).await.expect(StatusCode::CREATED);
    let extend = format!("/v1/sweeps/{}/extend", text(&many["id"]));
    server.post(&extend, &json!({"replicates": 1})).await.expect(StatusCode::OK);
    let mut alone = envelope(5000);
    alone["labels"] = json!({"key 1": "mine"});
    server.submit(&alone).await;
    server.submit(&envelope(5001)).await;

    let found = async |filter: &str| {
        let page = server.get(&format!("/v1/jobs?limit=500&label={filter}")).await.expect(StatusCode::OK);
        page["items"].as_array().unwrap().clone()
    };
    let all = found("key%201").await;
    assert_eq!((all.len(), &all[0]["labels"], &all[1]["labels"]), (500, &alone["labels"], &long));
    assert_eq!(found("key%201=mine").await.len(), 1);
    let swept = found(&format!("key%201={}", "x".repeat(256))).await;
    assert_eq!((swept.len(), &swept[0]["labels"]), (500, &long));
    assert_eq!(server.job(&swept[0]["id"]).await["labels"], long);
    assert_eq!(found("elsewhere").await.len(), 0);
    server.stop().await;
    if !database::is_postgres() {
        let bytes = std::fs::metadata(dir.path().join("roost.db")).unwrap().len();
        assert!(bytes < 4_000_000, "{bytes} bytes of 901 jobs with 17 kB of labels");
    }
}

#[tokio::test]
async fn priority_range_applies_to_submit_tokens_only() {
    let dir = tempfile::tempdir().unwrap();
    let mut tokens = database::tokens(dir.path(), true).await.unwrap();
    let mut secrets = Vec::new();
    for scopes in [&[Scope::Submit][..], &[Scope::Submit, Scope::Admin]] {
        secrets.push(tokens.create("t", scopes, Timestamp::now()).await.unwrap().1);
    }
    tokens.close().await.unwrap();
    let server = TestServer::on(dir.path(), |_| {}).await;
    let [submits, admin] = [&secrets[0], &secrets[1]];
    let send = async |secret: &str, path: &str, body: &Value| {
        let request = server.http.request(Method::POST, format!("http://{}{path}", server.address));
        let response = request.bearer_auth(secret).json(body).send().await.unwrap();
        (response.status().as_u16(), response.json::<Value>().await.unwrap())
    };
    let urgent = |mut document: Value, priority: i32| {
        document["priority"] = json!(priority);
        document
    };
    for (path, document) in [("/v1/jobs", envelope(1)), ("/v1/sweeps", sweep(2, &json!({})))] {
        for priority in [-100, 100] {
            let (status, answer) = send(submits, path, &urgent(document.clone(), priority)).await;
            assert!(status < 300, "{path} {priority}: {answer}");
        }
        for priority in [i32::MIN, -101, 101] {
            let (status, problem) = send(submits, path, &urgent(document.clone(), priority)).await;
            assert_eq!((status, &problem["type"]), (403, &json!("/problems/forbidden")), "{path}: {problem}");
            assert_eq!(pointers(&problem), ["/priority"]);
            assert_eq!(problem["errors"][0]["value"], json!(priority));
            assert!(text(&problem["errors"][0]["allowed"]).contains("-100 to 100"), "{problem}");
        }
    }
    let (status, sweep) = send(admin, "/v1/sweeps", &urgent(sweep(9, &json!({})), i32::MAX)).await;
    assert_eq!(status, 201, "{sweep}");
    let extend = format!("/v1/sweeps/{}/extend", text(&sweep["id"]));
    let (status, problem) = send(submits, &extend, &json!({"replicates": 1})).await;
    assert_eq!(
        (status, &problem["type"]),
        (403, &json!("/problems/forbidden")),
        "extending a sweep of an admin"
    );
    assert!(text(&problem["detail"]).contains("2147483647"), "{problem}");
    assert_eq!(send(admin, &extend, &json!({"replicates": 1})).await.0, 200);
    server.stop().await;
}

#[tokio::test]
async fn server_without_tokens_accepts_every_priority() {
    let (server, _dir) = TestServer::start().await;
    let mut job = envelope(1);
    job["priority"] = json!(i32::MAX);
    assert_eq!(server.submit(&job).await["priority"], json!(i32::MAX));
    server.stop().await;
}
