//! Sweeps: pages and columns of tables, filters by failure class and point, the submitted document.

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use super::test_server::*;

/// Three points with two replicates; of the last point one run is unstable and one is queued.
async fn run_sweep(server: &TestServer) -> (Value, String) {
    let document = json!({"name": "gates", "base": scenario(10), "design": {"kind": "grid"}, "replicates": 2,
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.05, 0.06]}]});
    let view = server.post("/v1/sweeps", &document).await.expect(StatusCode::CREATED);
    let worker = server.worker("cpu").await;
    let attempts = worker.claim(5).await;
    for attempt in &attempts[..4] {
        worker.deliver(attempt).await.expect(StatusCode::OK);
    }
    worker.fail(&attempts[4], "unstable", None).await.expect(StatusCode::OK);
    (document, format!("/v1/sweeps/{}", text(&view["id"])))
}

#[tokio::test]
async fn pages_of_a_table_make_the_whole_table() {
    let (server, _dir) = TestServer::start().await;
    let (_, path) = run_sweep(&server).await;
    for (by, rows) in [("trial", "trials"), ("point", "points")] {
        let whole = server.get(&format!("{path}/results?by={by}")).await.expect(StatusCode::OK);
        assert_eq!(whole["next_cursor"], Value::Null);
        let whole = whole[rows].as_array().unwrap();
        assert_eq!(whole.len(), if by == "trial" { 6 } else { 3 });
        for limit in [1, 2, 4] {
            let (mut paged, mut next) = (Vec::new(), format!("{path}/results?by={by}&limit={limit}"));
            loop {
                let url = format!("http://{}{next}", server.address);
                let answer = server.http.get(url).send().await.unwrap();
                let link = answer.headers().get("link").map(|link| link.to_str().unwrap().to_owned());
                let page: Value = answer.json().await.unwrap();
                paged.extend(page[rows].as_array().unwrap().clone());
                let cursor = page["next_cursor"].as_str();
                assert_eq!(cursor.is_some(), link.is_some(), "{page}");
                let Some(link) = link else { break };
                let address = link.strip_prefix('<').unwrap().strip_suffix(">; rel=\"next\"").unwrap();
                assert!(address.ends_with(&format!("cursor={}", cursor.unwrap())), "{link}");
                next = address.to_owned();
            }
            assert_eq!(&paged, whole, "{by} {limit}");
        }
    }
    for query in ["cursor=3", "cursor=a.b", "limit=0", "limit=5001", "by=row"] {
        server.get(&format!("{path}/results?{query}")).await.problem(400, "invalid-query");
    }
    server.stop().await;
}

#[tokio::test]
async fn head_of_a_streamed_table_states_no_length() {
    let (server, _dir) = TestServer::start().await;
    let (_, path) = run_sweep(&server).await;
    let url = format!("http://{}{path}/results?format=csv", server.address);
    let length = |answer: &reqwest::Response| answer.headers().get("content-length").cloned();
    let whole = server.http.get(&url).send().await.unwrap();
    let head = server.http.head(&url).send().await.unwrap();
    assert_eq!((head.status(), length(&head)), (StatusCode::OK, length(&whole)));
    server.stop().await;
}

#[tokio::test]
async fn table_has_only_selected_responses() {
    let (server, _dir) = TestServer::start().await;
    let (_, path) = run_sweep(&server).await;
    let table = server.get(&format!("{path}/results?responses=regime,nothing")).await.expect(StatusCode::OK);
    assert_eq!(table["trials"][0]["responses"], json!({"regime": "constant"}));
    let table =
        server.get(&format!("{path}/results?by=point&responses=discharged_kg")).await.expect(StatusCode::OK);
    let names: Vec<_> = table["points"][0]["responses"].as_object().unwrap().keys().collect();
    assert_eq!(names, ["discharged_kg"]);
    let csv = server.get(&format!("{path}/results?format=csv&responses=regime,discharged_kg&limit=2")).await;
    let lines: Vec<_> = csv.text.lines().collect();
    assert!(lines[0].ends_with("solver_revision,regime,discharged_kg"), "{}", csv.text);
    assert_eq!(lines.len(), 3);
    let whole = server.get(&format!("{path}/results?format=csv")).await.text;
    assert!(whole.lines().next().unwrap().ends_with("discharged_kg,regime,time_to_99_percent_s"), "{whole}");
    assert_eq!(whole.lines().count(), 7);
    server.stop().await;
}

#[tokio::test]
async fn failures_are_counted_and_filtered_by_class_and_point() {
    let (server, _dir) = TestServer::start().await;
    let (_, path) = run_sweep(&server).await;
    let view = server.get(&path).await.expect(StatusCode::OK);
    assert_eq!(view["failures"], json!({"invalid": 0, "unstable": 1, "worker": 0, "lost": 0, "timeout": 0}));
    let found = async |path: String| {
        let page = server.get(&path).await.expect(StatusCode::OK);
        let place = |job: &Value| (job["point"].as_u64().unwrap(), job["replicate"].as_u64().unwrap());
        page["items"].as_array().unwrap().iter().map(place).collect::<Vec<_>>()
    };
    assert_eq!(found(format!("{path}/jobs?failure=unstable")).await, [(2, 0)]);
    assert_eq!(found("/v1/jobs?failure=unstable".to_owned()).await, [(2, 0)]);
    assert_eq!(found(format!("{path}/jobs?failure=lost")).await, []);
    assert_eq!(found(format!("{path}/jobs?point=1")).await, [(1, 1), (1, 0)]);
    assert_eq!(found(format!("{path}/jobs?point=2&state=failed")).await, [(2, 0)]);
    server.get("/v1/jobs?point=1").await.problem(400, "invalid-query");
    server.get(&format!("{path}/jobs?failure=bad")).await.problem(400, "invalid-query");
    server.stop().await;
}

#[tokio::test]
async fn shown_sweep_document_can_be_submitted_again() {
    let (server, _dir) = TestServer::start().await;
    let (mut document, path) = run_sweep(&server).await;
    let spec = server.get(&format!("{path}/spec")).await.expect(StatusCode::OK);
    document["schema"] = json!("roost.sweep/1");
    assert_eq!(spec, document, "as it was sent, without defaults");
    server.post("/v1/sweeps", &spec).await.expect(StatusCode::CREATED);
    server.post(&format!("{path}/extend"), &json!({"replicates": 1})).await.expect(StatusCode::OK);
    server.send(Method::POST, &format!("{path}/cancel"), None).await.expect(StatusCode::OK);
    server.send(Method::DELETE, &path, None).await.expect(StatusCode::OK);
    server.get(&format!("{path}/spec")).await.problem(404, "not-found");
    server.stop().await;
}
