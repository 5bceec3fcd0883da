//! Large sweeps: tables by pages and columns, counts and listings by failure class and point, the document itself.

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use super::farm::*;

/// Three points of two replicates; of the last point one run is unstable and one is queued.
async fn run(farm: &Farm) -> (Value, String) {
    let document = json!({"name": "gates", "base": scenario(10), "design": {"kind": "grid"}, "replicates": 2,
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.05, 0.06]}]});
    let view = farm.post("/v1/sweeps", &document).await.expect(StatusCode::CREATED);
    let worker = farm.worker("cpu").await;
    let attempts = worker.claim(5).await;
    for attempt in &attempts[..4] {
        worker.deliver(attempt).await.expect(StatusCode::OK);
    }
    worker.fail(&attempts[4], "unstable", None).await.expect(StatusCode::OK);
    (document, format!("/v1/sweeps/{}", text(&view["id"])))
}

#[tokio::test]
async fn a_table_is_the_same_in_pages_and_whole() {
    let (farm, _dir) = Farm::start().await;
    let (_, path) = run(&farm).await;
    for (by, rows) in [("trial", "trials"), ("point", "points")] {
        let whole = farm.get(&format!("{path}/results?by={by}")).await.expect(StatusCode::OK);
        assert_eq!(whole["next_cursor"], Value::Null);
        let whole = whole[rows].as_array().unwrap();
        assert_eq!(whole.len(), if by == "trial" { 6 } else { 3 });
        for limit in [1, 2, 4] {
            let (mut paged, mut next) = (Vec::new(), format!("{path}/results?by={by}&limit={limit}"));
            loop {
                let url = format!("http://{}{next}", farm.address);
                let answer = farm.http.get(url).send().await.unwrap();
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
        farm.get(&format!("{path}/results?{query}")).await.problem(400, "invalid-query");
    }
    farm.stop().await;
}

#[tokio::test]
async fn a_table_has_only_the_responses_that_were_asked_for() {
    let (farm, _dir) = Farm::start().await;
    let (_, path) = run(&farm).await;
    let table = farm.get(&format!("{path}/results?responses=regime,nothing")).await.expect(StatusCode::OK);
    assert_eq!(table["trials"][0]["responses"], json!({"regime": "constant"}));
    let table =
        farm.get(&format!("{path}/results?by=point&responses=discharged_kg")).await.expect(StatusCode::OK);
    let names: Vec<_> = table["points"][0]["responses"].as_object().unwrap().keys().collect();
    assert_eq!(names, ["discharged_kg"]);
    let csv = farm.get(&format!("{path}/results?format=csv&responses=regime,discharged_kg&limit=2")).await;
    let lines: Vec<_> = csv.text.lines().collect();
    assert!(lines[0].ends_with("solver_revision,regime,discharged_kg"), "{}", csv.text);
    assert_eq!(lines.len(), 3);
    let whole = farm.get(&format!("{path}/results?format=csv")).await.text;
    assert!(whole.lines().next().unwrap().ends_with("discharged_kg,regime,time_to_99_percent_s"), "{whole}");
    assert_eq!(whole.lines().count(), 7);
    farm.stop().await;
}

#[tokio::test]
async fn failures_are_counted_by_class_and_found_by_class_and_point() {
    let (farm, _dir) = Farm::start().await;
    let (_, path) = run(&farm).await;
    let view = farm.get(&path).await.expect(StatusCode::OK);
    assert_eq!(view["failures"], json!({"invalid": 0, "unstable": 1, "worker": 0, "lost": 0, "timeout": 0}));
    let found = async |path: String| {
        let page = farm.get(&path).await.expect(StatusCode::OK);
        let place = |job: &Value| (job["point"].as_u64().unwrap(), job["replicate"].as_u64().unwrap());
        page["items"].as_array().unwrap().iter().map(place).collect::<Vec<_>>()
    };
    assert_eq!(found(format!("{path}/jobs?failure=unstable")).await, [(2, 0)]);
    assert_eq!(found("/v1/jobs?failure=unstable".to_owned()).await, [(2, 0)]);
    assert_eq!(found(format!("{path}/jobs?failure=lost")).await, []);
    assert_eq!(found(format!("{path}/jobs?point=1")).await, [(1, 1), (1, 0)]);
    assert_eq!(found(format!("{path}/jobs?point=2&state=failed")).await, [(2, 0)]);
    farm.get("/v1/jobs?point=1").await.problem(400, "invalid-query");
    farm.get(&format!("{path}/jobs?failure=bad")).await.problem(400, "invalid-query");
    farm.stop().await;
}

#[tokio::test]
async fn a_sweep_can_be_submitted_again_as_it_was() {
    let (farm, _dir) = Farm::start().await;
    let (mut document, path) = run(&farm).await;
    let spec = farm.get(&format!("{path}/spec")).await.expect(StatusCode::OK);
    document["schema"] = json!("roost.sweep/1");
    assert_eq!(spec, document, "as it was sent, no default written out");
    farm.post("/v1/sweeps", &spec).await.expect(StatusCode::CREATED);
    farm.post(&format!("{path}/extend"), &json!({"replicates": 1})).await.expect(StatusCode::OK);
    farm.send(Method::POST, &format!("{path}/cancel"), None).await.expect(StatusCode::OK);
    farm.send(Method::DELETE, &path, None).await.expect(StatusCode::OK);
    farm.get(&format!("{path}/spec")).await.problem(404, "not-found");
    farm.stop().await;
}
