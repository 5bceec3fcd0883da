//! What others read of the server: Prometheus its metrics, people its specification.

use reqwest::StatusCode;

use super::farm::*;

#[tokio::test]
async fn metrics_count_jobs_by_state_workers_and_requests_by_route() {
    let (farm, _dir) = Farm::start().await;
    let worker = farm.worker("cpu").await;
    for seed in 0..3 {
        farm.submit(&envelope(seed)).await;
    }
    let attempt = worker.claim_one().await;
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    worker.claim_one().await;
    farm.get("/v1/nothing").await.problem(404, "not-found");
    let answer = farm.get("/metrics").await;
    assert!(answer.media_type.starts_with("application/openmetrics-text"), "{}", answer.media_type);
    for line in [
        r#"roost_jobs{state="queued"} 1"#,
        r#"roost_jobs{state="running"} 1"#,
        r#"roost_jobs{state="succeeded"} 1"#,
        r#"roost_jobs{state="failed"} 0"#,
        "roost_workers 1",
        r#"roost_http_requests_total{method="POST",route="/v1/jobs",status="202"} 3"#,
        r#"roost_http_requests_total{method="GET",route="unknown",status="404"} 1"#,
        r#"roost_http_request_seconds_count{method="POST",route="/v1/jobs"} 3"#,
        "# EOF",
    ] {
        assert!(answer.text.lines().any(|known| known == line), "{line}\n{}", answer.text);
    }
    farm.stop().await;
}

#[tokio::test]
async fn the_reader_of_the_specification_asks_nobody_else() {
    let (farm, _dir) = Farm::start().await;
    let page = farm.get("/docs/").await;
    assert_eq!(page.status, 200, "{}", page.text);
    let start = farm.get("/docs/swagger-initializer.js").await;
    assert!(start.text.contains("/openapi.json"), "{}", start.text);
    let mut assets = 0;
    for part in page.text.split(['"', '\'']).filter(|part| part.ends_with(".js") || part.ends_with(".css")) {
        assert!(!part.contains("//"), "from elsewhere: {part}");
        let path = part.trim_start_matches("./").trim_start_matches("/docs/");
        assert_eq!(farm.get(&format!("/docs/{path}")).await.status, 200, "{part}");
        assets += 1;
    }
    assert!(assets >= 3, "{}", page.text);
    farm.stop().await;
}
