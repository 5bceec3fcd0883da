//! Projects of a running server: the list, the reason of jobs without budget, and claims that wake when the budget is raised.

use std::time::{Duration, Instant};

use reqwest::{Method, StatusCode};
use roost_api::time::Timestamp;
use roost_api::token::Scope;
use roost_server::{NewToken, ProjectChange};
use serde_json::{Value, json};

use super::database;
use super::test_server::*;

fn budget(core_hours: f64) -> ProjectChange {
    ProjectChange { budget_core_hours: Some(Some(core_hours)), ..ProjectChange::default() }
}

async fn ask(server: &TestServer, method: Method, path: &str, secret: &str, body: Option<Value>) -> Value {
    let request = server.http.request(method, format!("http://{}{path}", server.address)).bearer_auth(secret);
    let request = body.iter().fold(request, |request, body| request.json(body));
    let response = request.send().await.unwrap();
    assert!(response.status().is_success(), "{path}: {}", response.text().await.unwrap());
    response.json().await.unwrap_or_default()
}

#[tokio::test]
async fn raised_budget_wakes_waiting_claims() {
    let dir = tempfile::tempdir().unwrap();
    let mut file = database::tokens(dir.path(), true).await.unwrap();
    file.create_project("wax", budget(0.0)).await.unwrap();
    let token = NewToken {
        name: "laptop",
        user: "Ada",
        project: "wax",
        scopes: &[Scope::Admin, Scope::Worker],
        expires_at: None,
    };
    let (_, secret) = file.create_for(token, Timestamp::now()).await.unwrap();
    file.close().await.unwrap();
    let server = TestServer::on(dir.path(), |config| config.lease = Duration::from_secs(600)).await;
    let worker = roost_api::ids::WorkerId::new().to_string();
    let post = async |path: &str, body: Value| ask(&server, Method::POST, path, &secret, Some(body)).await;
    post("/v1/workers", registration(&worker, "cpu")).await;

    // A submission is accepted all the same.
    let job = post("/v1/jobs", envelope(1)).await;
    assert_eq!((&job["user"], &job["project"]), (&json!("Ada"), &json!("wax")));
    let path = format!("/v1/jobs/{}", text(&job["id"]));
    let waiting = ask(&server, Method::GET, &path, &secret, None).await["waiting"].clone();
    assert_eq!(waiting["reason"], "budget_used");
    assert_eq!(
        waiting["detail"],
        "project wax has used 0.0 of 0 core-hours; raise it with `roost project set wax --budget-core-hours N`"
    );
    let forecast = ask(&server, Method::GET, &format!("{path}/forecast"), &secret, None).await;
    assert_eq!(forecast["no_forecast"], waiting["detail"], "{forecast}");
    let projects = async || ask(&server, Method::GET, "/v1/projects", &secret, None).await;
    let row = |name: &str, budget: Value, queued: u64, running: u64| json!({"name": name, "share": 1, "budget_core_hours": budget, "used_core_hours": 0.0, "queued": queued, "running": running});
    let expected = json!({"items": [row("wax", json!(0.0), 1, 0), row("default", json!(null), 0, 0)], "next_cursor": null});
    assert_eq!(projects().await, expected);

    let started = Instant::now();
    let request =
        json!({"request_id": uuid::Uuid::now_v7(), "worker_id": worker, "max_jobs": 1, "wait_s": 20.0});
    let (reply, ()) = tokio::join!(post("/v1/claims", request), async {
        tokio::time::sleep(Duration::from_secs(1)).await;
        let mut file = database::tokens(dir.path(), false).await.unwrap();
        file.set_project("wax", budget(1.5)).await.unwrap();
        file.close().await.unwrap();
    });
    assert_eq!(reply["attempts"][0]["job_id"], job["id"], "{reply}");
    let waited = started.elapsed();
    assert!((1..60).contains(&waited.as_secs()), "{waited:?}");
    // A count is used for 20 times as long as it took.
    let deadline = Instant::now() + Duration::from_secs(120);
    while projects().await["items"][0] != row("wax", json!(1.5), 0, 1) {
        assert!(Instant::now() < deadline, "{}", projects().await);
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    server.stop().await;
}

#[tokio::test]
async fn list_of_projects_has_pages() {
    let dir = tempfile::tempdir().unwrap();
    let mut file = database::tokens(dir.path(), true).await.unwrap();
    for name in ["a", "b"] {
        file.create_project(name, ProjectChange { share: Some(7), ..ProjectChange::default() })
            .await
            .unwrap();
    }
    file.close().await.unwrap();
    let server = TestServer::on(dir.path(), |_| {}).await;
    let (mut names, mut path) = (Vec::new(), "/v1/projects?limit=2".to_owned());
    loop {
        let page = server.get(&path).await.expect(StatusCode::OK);
        names.extend(page["items"].as_array().unwrap().iter().map(|item| text(&item["name"]).to_owned()));
        let Some(cursor) = page["next_cursor"].as_str() else { break };
        path = format!("/v1/projects?limit=2&cursor={cursor}");
    }
    assert_eq!(names, ["b", "a", "default"]);
    for (query, named) in
        [("limit=0", "limit 0 is out of range: allowed is 1 to 500"), ("cursor=-1", "cursor -1")]
    {
        let refused = server.get(&format!("/v1/projects?{query}")).await.expect(StatusCode::BAD_REQUEST);
        assert!(text(&refused["detail"]).contains(named), "{refused}");
    }
    // Without tokens, jobs belong to the default project, and nobody knows the user.
    let job = server.submit(&envelope(1)).await;
    assert_eq!((&job["user"], &job["project"]), (&json!(null), &json!("default")));
    server.stop().await;
}
