//! The router, `/openapi.json` and `api.md` describe the same API.

use std::collections::BTreeSet;

use reqwest::{Method, StatusCode};
use serde_json::Value;

use super::test_server::*;

/// Headings such as `### POST /v1/jobs`.
fn documented() -> BTreeSet<(String, String)> {
    let text = include_str!("../../../api.md");
    let headings = text.lines().filter_map(|line| line.strip_prefix("### "));
    headings
        .filter_map(|heading| heading.split_once(' '))
        .filter(|(_, path)| path.starts_with('/'))
        .map(|(method, path)| (method.to_owned(), path.to_owned()))
        .collect()
}

fn specified(spec: &Value) -> BTreeSet<(String, String)> {
    let paths = spec["paths"].as_object().unwrap();
    let routes = paths.iter().flat_map(|(path, item)| {
        let methods = ["get", "post", "put", "delete", "patch"].into_iter();
        methods
            .filter(|method| item.get(method).is_some())
            .map(|method| (method.to_uppercase(), path.clone()))
    });
    routes.collect()
}

#[tokio::test]
async fn the_specification_and_api_md_list_the_same_routes() {
    let (server, _dir) = TestServer::start().await;
    let spec = server.get("/openapi.json").await.expect(StatusCode::OK);
    assert!(text(&spec["openapi"]).starts_with("3.1"));
    let specified = specified(&spec);
    assert_eq!(documented(), specified);
    assert!(specified.len() > 20, "{specified:?}");
    server.stop().await;
}

#[tokio::test]
async fn every_documented_route_is_routed() {
    let (server, _dir) = TestServer::start().await;
    for (method, path) in documented() {
        let filled = path
            .replace("{id}", "01890000-0000-7000-8000-000000000000")
            .replace("{n}", "1")
            .replace("{digest}", &"0".repeat(64))
            .replace("{name}", "discharged_mass");
        let answer = server.send(Method::from_bytes(method.as_bytes()).unwrap(), &filled, None).await;
        let routed = answer.status != 405 && !answer.text.contains("there is no path");
        assert!(routed, "{method} {path}: {} {}", answer.status, answer.text);
    }
    let fallback = server.get("/v1/nothing").await;
    assert!(fallback.text.contains("there is no path"), "what the check above looks for");
    server.stop().await;
}

#[tokio::test]
async fn every_reference_in_the_specification_resolves() {
    fn references<'a>(value: &'a Value, found: &mut Vec<&'a str>) {
        match value {
            Value::Object(fields) => {
                found.extend(fields.get("$ref").and_then(Value::as_str));
                fields.values().for_each(|value| references(value, found));
            }
            Value::Array(items) => items.iter().for_each(|value| references(value, found)),
            _ => {}
        }
    }
    let (server, _dir) = TestServer::start().await;
    let spec = server.get("/openapi.json").await.expect(StatusCode::OK);
    let mut found = Vec::new();
    references(&spec, &mut found);
    assert!(found.len() > 20);
    for reference in found {
        let pointer = reference.strip_prefix('#').unwrap();
        assert!(spec.pointer(pointer).is_some(), "{reference}");
    }
    server.stop().await;
}

#[test]
fn every_curl_example_is_of_a_documented_route() {
    let text = include_str!("../../../api.md");
    let documented = documented();
    let examples = text.matches("curl ").count();
    assert!(examples >= documented.len(), "{examples} examples for {} routes", documented.len());
}

#[tokio::test]
async fn the_document_made_without_a_server_is_the_served_one() {
    let (server, _dir) = TestServer::start().await;
    let served = server.get("/openapi.json").await.expect(StatusCode::OK);
    let made: serde_json::Value = serde_json::from_str(&roost_server::openapi()).expect("JSON");
    assert!(made == served, "they differ");
    server.stop().await;
}
