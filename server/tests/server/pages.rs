//! Pages of listings: links to the next page, and specified ranges.

use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::stl::{binary, wall};
use crate::test_server::{TestServer, envelope, scenario, text};

/// A server with three of each listed object; returns a sweep with jobs too.
async fn server_with_three_of_each() -> (TestServer, tempfile::TempDir, Value) {
    let (server, dir) = TestServer::start().await;
    let mut sweep = Value::Null;
    for number in 1..=3 {
        server.submit(&envelope(number)).await;
        server.worker("cpu").await;
        let document = json!({
            "name": "three", "base": scenario(100 * number), "design": {"kind": "grid"}, "factors": [], "replicates": 3,
        });
        sweep = server.post("/v1/sweeps", &document).await.expect(StatusCode::CREATED);
        let file = binary(&wall(10.0, 10.0 * number as f32));
        server.send_text("/v1/meshes", "model/stl", file).await.expect(StatusCode::CREATED);
    }
    (server, dir, sweep)
}

/// The address in a `link` header.
fn next_address(link: &str) -> &str {
    link.strip_prefix('<')
        .and_then(|link| link.strip_suffix(">; rel=\"next\""))
        .expect("a link to the next page")
}

#[tokio::test]
async fn every_page_links_to_the_next_one() {
    let (server, _dir, sweep) = server_with_three_of_each().await;
    let sweep = format!("/v1/sweeps/{}", text(&sweep["id"]));
    let worker = server.worker("cpu").await;
    while let Some(attempt) = worker.claim(1).await.pop() {
        worker.deliver(&attempt).await.expect(StatusCode::OK);
    }
    for (path, rows, total) in [
        ("/v1/jobs?state=succeeded&limit=5".to_owned(), "items", 12),
        ("/v1/sweeps?limit=2".to_owned(), "items", 3),
        (format!("{sweep}/jobs?limit=2&state=succeeded"), "items", 3),
        (format!("{sweep}/results?limit=2"), "trials", 3),
        (format!("{sweep}/series/discharged_mass?limit=2"), "items", 3),
        ("/v1/workers?limit=3".to_owned(), "items", 4),
        ("/v1/meshes?limit=2".to_owned(), "items", 3),
    ] {
        let (mut address, mut seen, mut pages) = (path.clone(), Vec::<Value>::new(), 0);
        loop {
            let page = server.get(&address).await;
            let link = page.link.clone();
            let page = page.expect(StatusCode::OK);
            let cursor = page["next_cursor"].as_str();
            assert_eq!(link.is_some(), cursor.is_some(), "{address}: {link:?}");
            seen.extend(page[rows].as_array().unwrap_or_else(|| panic!("{address}: {page}")).iter().cloned());
            pages += 1;
            let Some(link) = link else { break };
            for kept in path.split(['?', '&']) {
                assert!(link.contains(kept), "{link} asks for something else than {path}");
            }
            assert!(next_address(&link).ends_with(&format!("&cursor={}", cursor.unwrap())), "{link}");
            address = next_address(&link).to_owned();
        }
        assert!(pages > 1, "{path}");
        assert_eq!(seen.len(), total, "{path}");
        assert!(seen.iter().enumerate().all(|(place, row)| !seen[..place].contains(row)), "{path}: {seen:?}");
    }
    server.stop().await;
}

#[tokio::test]
async fn specified_ranges_are_enforced() {
    let (server, _dir, sweep) = server_with_three_of_each().await;
    let spec = server.get("/openapi.json").await.expect(StatusCode::OK);
    let mut ranges = 0;
    for (path, operations) in spec["paths"].as_object().unwrap() {
        let get = &operations["get"];
        let parameters = get["parameters"].as_array().into_iter().flatten();
        let has_cursor = parameters.clone().any(|parameter| parameter["name"] == "cursor");
        assert_eq!(has_cursor, get["responses"]["200"]["headers"]["link"].is_object(), "{path}");
        for parameter in parameters.filter(|parameter| parameter["in"] == "query") {
            let (name, schema) = (text(&parameter["name"]), &parameter["schema"]);
            if ["limit", "samples"].contains(&name) {
                assert!(schema["minimum"].is_u64() && schema["maximum"].is_u64(), "{path} {parameter}");
            }
            let (Some(low), Some(high)) = (schema["minimum"].as_u64(), schema["maximum"].as_u64()) else {
                continue;
            };
            assert_ne!(parameter["required"], true, "{path} {name}");
            let path = path.replace("{id}", text(&sweep["id"])).replace("{name}", "discharged_mass");
            for (value, status) in [(low, 200), (high, 200), (low - 1, 400), (high + 1, 400)] {
                let answer = server.get(&format!("{path}?{name}={value}")).await;
                assert_eq!(answer.status, status, "{path}?{name}={value}: {}", answer.text);
            }
            ranges += 1;
        }
    }
    assert_eq!(ranges, 10, "`limit` of nine listings, and `samples`");

    let worker = server.worker("cpu").await;
    // The claim comes last, since it takes all queued jobs: a claim without work waits.
    for field in ["wait_s", "max_jobs"] {
        let schema = &spec["components"]["schemas"]["ClaimRequest"]["properties"][field];
        let (low, high) = (schema["minimum"].as_f64().unwrap(), schema["maximum"].as_f64().unwrap());
        for (value, status) in [(low, 200), (high, 200), (low - 1.0, 422), (high + 1.0, 422)] {
            let mut request = worker.claim_request(1, 0.0);
            request[field] = if field == "max_jobs" { json!(value as i64) } else { json!(value) };
            let answer = server.post("/v1/claims", &request).await;
            assert_eq!(answer.status, status, "{field} {value}: {}", answer.text);
        }
    }

    for path in ["/v1/meshes/{digest}", "/v1/meshes/{digest}/file"] {
        let parameter = &spec["paths"][path]["get"]["parameters"][0];
        assert_eq!(parameter["schema"]["pattern"], "^[0-9a-f]{64}$", "{parameter}");
        for (digest, status) in [("a".repeat(64), 404), ("A".repeat(64), 400), ("a".repeat(63), 400)] {
            assert_eq!(server.get(&path.replace("{digest}", &digest)).await.status, status, "{digest}");
        }
    }
    server.stop().await;
}
