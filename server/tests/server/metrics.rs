//! Metrics for Prometheus, and the documentation page.

use std::time::{Duration, Instant};

use reqwest::{Method, StatusCode};
use serde_json::json;

use super::database;
use super::test_server::*;

/// The value of a metric.
async fn metric(server: &TestServer, name: &str) -> f64 {
    let text = server.get("/metrics").await.text;
    number(&text, name)
}

#[track_caller]
fn number(text: &str, name: &str) -> f64 {
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {name}:\n{text}")).parse().unwrap()
}

#[tokio::test]
async fn metrics_count_jobs_workers_and_requests() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    for seed in 0..3 {
        server.submit(&envelope(seed)).await;
    }
    let attempt = worker.claim_one().await;
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    worker.claim_one().await;
    server.get("/v1/nothing").await.problem(404, "not-found");
    let answer = server.get("/metrics").await;
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
    server.stop().await;
}

#[tokio::test]
async fn metrics_count_each_attempt_once() {
    let (server, _dir) = TestServer::with(|config| {
        config.lease = Duration::from_secs(6);
        config.max_claim_wait = Duration::from_millis(10);
    })
    .await;
    let worker = server.worker("cpu").await;
    for seed in 0..4 {
        server.submit(&envelope(seed)).await;
    }
    let attempts = worker.claim(4).await;
    // A repeat changes nothing and is not counted.
    for _ in 0..2 {
        worker.deliver(&attempts[0]).await.expect(StatusCode::OK);
        worker
            .fail(&attempts[1], "unstable", Some(&result_of(&attempts[1]["scenario"])))
            .await
            .expect(StatusCode::OK);
    }
    worker.fail(&attempts[2], "released", None).await.expect(StatusCode::OK);
    worker.fail(&attempts[2], "invalid", None).await.problem(409, "stale-attempt");
    // The last worker sends no more heartbeats.
    server.wait_for(&attempts[3]["job_id"], "queued").await;
    // The loss is counted after it is stored.
    let deadline = Instant::now() + Duration::from_secs(20);
    while metric(&server, "roost_attempts_total{outcome=\"lost\"}").await < 1.0 {
        assert!(Instant::now() < deadline, "the loss is not counted");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let text = server.get("/metrics").await.text;
    for (outcome, count) in [
        ("succeeded", 1.0),
        ("unstable", 1.0),
        ("released", 1.0),
        ("lost", 1.0),
        ("invalid", 0.0),
        ("worker", 0.0),
        ("timeout", 0.0),
        ("cancelled", 0.0),
    ] {
        let name = format!("roost_attempts_total{{outcome=\"{outcome}\"}}");
        assert_eq!(number(&text, &name), count, "{name}");
    }
    server.stop().await;
}

#[tokio::test]
async fn age_of_the_oldest_queued_job_counts_from_its_last_queueing() {
    let (server, _dir) = TestServer::start().await;
    // Jobs are counted once per second: the number may be old.
    let age = async |what: &str, fits: &dyn Fn(f64) -> bool| {
        let deadline = Instant::now() + Duration::from_secs(120);
        loop {
            let age = metric(&server, "roost_oldest_queued_seconds").await;
            if fits(age) {
                return age;
            }
            assert!(Instant::now() < deadline, "{what}: {age}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    age("nothing is queued", &|age| age == 0.0).await;
    let job = server.submit(&envelope(1)).await["id"].clone();
    age("it waits", &|age| age > 4.0).await;
    let again = Instant::now();
    for verb in ["cancel", "retry"] {
        server.post(&format!("/v1/jobs/{}/{verb}", text(&job)), &json!({})).await.expect(StatusCode::OK);
    }
    // From its first queueing it would be four seconds older.
    age("it pauses again", &|age| age > 0.0 && age < again.elapsed().as_secs_f64() + 1.0).await;
    server.worker("cpu").await.claim_one().await;
    age("it runs", &|age| age == 0.0).await;
    server.stop().await;
}

#[tokio::test]
async fn metrics_report_disk_process_and_build() {
    if database::is_postgres() {
        return; // it has no file
    }
    let (server, dir) = TestServer::start().await;
    server.submit(&envelope(1)).await;
    let text = server.get("/metrics").await.text;
    let length = |name: &str| std::fs::metadata(dir.path().join(name)).unwrap().len() as f64;
    assert_eq!(number(&text, "roost_database_bytes"), length("roost.db"));
    // The server may write between the two readings.
    let wal_bytes = number(&text, "roost_database_wal_bytes");
    assert!(wal_bytes > 0.0 && wal_bytes <= length("roost.db-wal"), "{wal_bytes}");
    assert!(number(&text, "roost_disk_free_bytes") > 1e6);
    let (commits, seconds) =
        (number(&text, "roost_commit_seconds_count"), number(&text, "roost_commit_seconds_sum"));
    assert!(commits >= 2.0 && seconds > 0.0 && seconds < 100.0 * commits, "{commits} commits in {seconds} s");
    assert!((5e6..1e10).contains(&number(&text, "process_resident_memory_bytes")), "{text}");
    let (open, limit) = (number(&text, "process_open_fds"), number(&text, "process_max_fds"));
    assert!(open > 10.0 && open < limit, "{open} of {limit}");
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_secs_f64();
    let age = now - number(&text, "process_start_time_seconds");
    assert!((0.0..100.0).contains(&age), "{age}");
    let build = format!(
        "roost_build_info{{version=\"{}\",solver_revision=\"{}\",commit=\"",
        env!("CARGO_PKG_VERSION"),
        roost_solver::SOLVER_REVISION
    );
    assert!(text.lines().any(|line| line.starts_with(&build)), "{build}\n{text}");
    server.stop().await;
}

#[tokio::test]
async fn long_polls_and_unsupported_methods_are_not_in_answer_times() {
    let (server, _dir) = TestServer::start().await;
    let worker = server.worker("cpu").await;
    let waited = worker.claim_request(1, 0.4);
    server.post("/v1/claims", &waited).await.expect(StatusCode::OK);
    let invented = Method::from_bytes(b"BREW").unwrap();
    for method in [Method::DELETE, Method::TRACE, invented] {
        server.send(method, "/v1/claims", None).await.problem(405, "method-not-allowed");
    }
    server.send(Method::HEAD, "/v1/version", None).await;
    server.get("/v1/version").await.expect(StatusCode::OK);
    let text = server.get("/metrics").await.text;
    assert_eq!(number(&text, r#"roost_http_long_poll_seconds_count{route="/v1/claims"}"#), 1.0);
    assert!(number(&text, r#"roost_http_long_poll_seconds_sum{route="/v1/claims"}"#) >= 0.4);
    assert_eq!(number(&text, r#"roost_http_request_seconds_count{method="GET",route="/v1/version"}"#), 1.0);
    let timed: Vec<_> = text.lines().filter(|line| line.starts_with("roost_http_request_seconds")).collect();
    for part in ["/v1/claims", "HEAD", "DELETE", "TRACE", "other"] {
        assert!(!timed.iter().any(|line| line.contains(part)), "{part}\n{timed:#?}");
    }
    let counted = r#"roost_http_requests_total{method="other",route="/v1/claims",status="405"}"#;
    assert_eq!(number(&text, counted), 1.0);
    server.stop().await;
}

#[tokio::test]
async fn documentation_page_loads_nothing_from_other_servers() {
    let (server, _dir) = TestServer::start().await;
    let page = server.get("/docs/").await;
    assert_eq!(page.status, 200, "{}", page.text);
    let start = server.get("/docs/swagger-initializer.js").await;
    assert!(start.text.contains("/openapi.json"), "{}", start.text);
    let mut assets = 0;
    for part in page.text.split(['"', '\'']).filter(|part| part.ends_with(".js") || part.ends_with(".css")) {
        assert!(!part.contains("//"), "from elsewhere: {part}");
        let path = part.trim_start_matches("./").trim_start_matches("/docs/");
        assert_eq!(server.get(&format!("/docs/{path}")).await.status, 200, "{part}");
        assets += 1;
    }
    assert!(assets >= 3, "{}", page.text);
    server.stop().await;
}
